//! The boxes of a level that meet a box: a tree of bounding boxes, split at the median along the
//! longest side. A level of n boxes costs n log n, not n for each box of the coarser one.

use super::index_box::IndexBox;

/// Boxes that are compared one by one.
const LEAF: usize = 8;

/// Boxes in the order of the tree: the middle of a range splits it.
pub(in crate::read) struct BoxTree {
    boxes: Vec<IndexBox>,
    /// The bounds of the range whose middle is here.
    bounds: Vec<IndexBox>,
}

impl BoxTree {
    pub(in crate::read) fn new(boxes: impl Iterator<Item = IndexBox>) -> BoxTree {
        let mut boxes: Vec<IndexBox> = boxes.collect();
        let mut bounds = boxes.clone();
        split(&mut boxes, &mut bounds);
        BoxTree { boxes, bounds }
    }

    /// Calls `found` with what each box has in common with `other`.
    pub(in crate::read) fn visit(&self, other: &IndexBox, found: &mut dyn FnMut(IndexBox)) {
        self.visit_range(0, self.boxes.len(), other, found);
    }

    fn visit_range(
        &self,
        first: usize,
        end: usize,
        other: &IndexBox,
        found: &mut dyn FnMut(IndexBox),
    ) {
        if end - first <= LEAF {
            let leaf = &self.boxes[first..end];
            leaf.iter().filter_map(|b| other.intersection(b)).for_each(found);
            return;
        }
        let middle = usize::midpoint(first, end);
        if other.intersection(&self.bounds[middle]).is_some() {
            self.visit_range(first, middle, other, found);
            self.visit_range(middle, end, other, found);
        }
    }
}

fn split(boxes: &mut [IndexBox], bounds: &mut [IndexBox]) {
    if boxes.len() <= LEAF {
        return;
    }
    let mut whole = boxes[0];
    for b in boxes.iter() {
        for a in 0..3 {
            whole.low[a] = whole.low[a].min(b.low[a]);
            whole.high[a] = whole.high[a].max(b.high[a]);
        }
    }
    let axis = (0..3).max_by_key(|&a| whole.high[a] - whole.low[a]).unwrap_or(0);
    let middle = usize::midpoint(0, boxes.len());
    boxes.select_nth_unstable_by_key(middle, |b| b.low[axis] + b.high[axis]);
    bounds[middle] = whole;
    let (low, high) = boxes.split_at_mut(middle);
    let (low_bounds, high_bounds) = bounds.split_at_mut(middle);
    // The bounds of this range stand where the second half begins, which uses its own middle only:
    // a range of more than one leaf has it behind its start.
    split(low, low_bounds);
    split(high, high_bounds);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_boxes_that_meet_one_are_those_of_a_search_over_all(
            corners in prop::collection::vec(
                (prop::array::uniform3(-20i64..20), prop::array::uniform3(0i64..8)), 0..200),
            low in prop::array::uniform3(-25i64..20),
            size in prop::array::uniform3(0i64..20),
        ) {
            let of = |low: [i64; 3], size: [i64; 3]| {
                IndexBox { low, high: [0, 1, 2].map(|a| low[a] + size[a]) }
            };
            let boxes: Vec<IndexBox> = corners.iter().map(|c| of(c.0, c.1)).collect();
            let other = of(low, size);
            let key = |b: &IndexBox| (b.low, b.high);
            let mut expected: Vec<_> =
                boxes.iter().filter_map(|b| other.intersection(b)).map(|b| key(&b)).collect();
            let mut found = Vec::new();
            BoxTree::new(boxes.into_iter()).visit(&other, &mut |b| found.push(key(&b)));
            expected.sort_unstable();
            found.sort_unstable();
            prop_assert_eq!(found, expected);
        }
    }
}
