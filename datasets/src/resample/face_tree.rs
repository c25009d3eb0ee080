//! A tree of boxes over faces, for those that a line passes and the one that is nearest to a place.

use glam::DVec3;

/// Faces in a leaf, at most.
const IN_LEAF: usize = 4;

/// Numbers of faces, by their boxes.
#[derive(Default)]
pub(super) struct FaceTree {
    /// The first is the root. Empty without faces.
    nodes: Vec<Node>,
    /// Numbers of faces in the order of the leaves.
    order: Vec<u32>,
}

#[derive(Debug, Clone, Copy)]
struct Node {
    low: DVec3,
    high: DVec3,
    /// The left child, which the right one follows; or the first face of a leaf.
    first: u32,
    /// Faces of a leaf; 0 for other nodes.
    count: u32,
}

impl FaceTree {
    /// The tree over these boxes. Splits the faces in halves along the longest side of their
    /// middles' box.
    pub(super) fn of(boxes: &[(DVec3, DVec3)]) -> FaceTree {
        let (mut nodes, mut order) = (Vec::new(), (0..boxes.len() as u32).collect::<Vec<u32>>());
        if boxes.is_empty() {
            return FaceTree { nodes, order };
        }
        let nothing = Node { low: DVec3::ZERO, high: DVec3::ZERO, first: 0, count: 0 };
        nodes.push(nothing);
        let mut open = vec![(0usize, 0usize, boxes.len())];
        while let Some((node, first, end)) = open.pop() {
            let faces = &mut order[first..end];
            let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            let (mut low_middle, mut high_middle) = (low, high);
            for &face in faces.iter() {
                let (l, h) = boxes[face as usize];
                (low, high) = (low.min(l), high.max(h));
                (low_middle, high_middle) = (low_middle.min(l + h), high_middle.max(l + h));
            }
            // A box without thickness is a plane; rounding must not let a line pass it.
            let margin = DVec3::splat(1e-9 * (high - low).max_element())
                + 4.0 * f64::EPSILON * low.abs().max(high.abs());
            let (mut of_node, count) = ((first as u32, faces.len() as u32), faces.len());
            if count > IN_LEAF {
                let size = high_middle - low_middle;
                let axis = if size.x >= size.y && size.x >= size.z {
                    0
                } else {
                    1 + usize::from(size.z > size.y)
                };
                let key =
                    |face: &u32| boxes[*face as usize].0[axis] + boxes[*face as usize].1[axis];
                faces.select_nth_unstable_by(count / 2, |a, b| {
                    key(a).total_cmp(&key(b)).then(a.cmp(b))
                });
                of_node = (nodes.len() as u32, 0);
                let left = nodes.len();
                nodes.extend([nothing; 2]);
                open.push((left, first, first + count / 2));
                open.push((left + 1, first + count / 2, end));
            }
            let (low, high) = (low - margin, high + margin);
            nodes[node] = Node { low, high, first: of_node.0, count: of_node.1 };
        }
        FaceTree { nodes, order }
    }

    /// Calls `look` with each face whose box the line from `at` in `direction` passes between two
    /// distances. `look` returns the second of them for the faces after it.
    pub(super) fn on_line(
        &self,
        at: DVec3,
        direction: DVec3,
        [from, to]: [f64; 2],
        mut look: impl FnMut(u32) -> f64,
    ) {
        let mut reach = to;
        let mut stack = Vec::with_capacity(64);
        stack.extend((!self.nodes.is_empty()).then_some(0u32));
        let inverse = direction.recip();
        while let Some(number) = stack.pop() {
            let node = &self.nodes[number as usize];
            if !node.meets(at, inverse, from, reach) {
                continue;
            }
            if node.count == 0 {
                // The nearer child is looked at first.
                let middle = |n: u32| {
                    let n = &self.nodes[n as usize];
                    (n.low + n.high).dot(direction)
                };
                let (left, right) = (node.first, node.first + 1);
                let near_first = middle(left) <= middle(right);
                stack.extend(if near_first { [right, left] } else { [left, right] });
                continue;
            }
            for &face in self.in_leaf(node) {
                reach = look(face);
            }
        }
    }

    /// The least of the squares of the faces' distances from a place, which `distance2` tells;
    /// infinite without faces.
    pub(super) fn nearest2(&self, at: DVec3, distance2: impl Fn(u32) -> f64) -> f64 {
        let mut best = f64::INFINITY;
        let mut stack = Vec::with_capacity(64);
        stack.extend(self.nodes.first().map(|n| (n.distance2(at), 0u32)));
        while let Some((of_box, number)) = stack.pop() {
            if of_box >= best {
                continue;
            }
            let node = &self.nodes[number as usize];
            if node.count > 0 {
                best = self.in_leaf(node).iter().fold(best, |b, &face| b.min(distance2(face)));
                continue;
            }
            let child = |n: u32| (self.nodes[n as usize].distance2(at), n);
            let (left, right) = (child(node.first), child(node.first + 1));
            stack.extend(if left.0 <= right.0 { [right, left] } else { [left, right] });
        }
        best
    }

    fn in_leaf(&self, node: &Node) -> &[u32] {
        &self.order[node.first as usize..(node.first + node.count) as usize]
    }
}

impl Node {
    /// Whether a line meets the box between two distances.
    fn meets(&self, at: DVec3, inverse: DVec3, from: f64, to: f64) -> bool {
        let (mut near, mut far) = (from, to);
        for a in 0..3 {
            // In the plane of a side, 0 · ∞ is NaN, which `min` and `max` leave out.
            let (s, t) = ((self.low[a] - at[a]) * inverse[a], (self.high[a] - at[a]) * inverse[a]);
            near = near.max(s.min(t));
            far = far.min(s.max(t));
        }
        near <= far
    }

    /// Square of the distance from a place.
    fn distance2(&self, at: DVec3) -> f64 {
        (self.low - at).max(at - self.high).max(DVec3::ZERO).length_squared()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Boxes without order, some of them flat.
    fn boxes(n: u32) -> Vec<(DVec3, DVec3)> {
        let number = |i: u32| f64::from(i.wrapping_mul(0x9e37_79b9) >> 8) / f64::from(1u32 << 24);
        let place = |i: u32| DVec3::new(number(i), number(i + 7), number(i + 13));
        let size = |i: u32| 0.1 * place(i + 29) * DVec3::new(1.0, f64::from(i % 2), 1.0);
        (0..n).map(|i| (place(3 * i), place(3 * i) + size(i))).collect()
    }

    #[test]
    fn the_nearest_box_is_that_of_a_search_through_all() {
        for n in [1, 4, 5, 300] {
            let boxes = boxes(n);
            let tree = FaceTree::of(&boxes);
            let distance2 =
                |at: DVec3, (low, high): (DVec3, DVec3)| at.clamp(low, high).distance_squared(at);
            for k in 0..50 {
                let at = DVec3::new(f64::from(k) * 0.05 - 0.7, 0.3, f64::from(k % 7) * 0.3 - 0.5);
                let all = boxes.iter().map(|b| distance2(at, *b)).fold(f64::INFINITY, f64::min);
                assert_eq!(tree.nearest2(at, |face| distance2(at, boxes[face as usize])), all);
            }
        }
        assert_eq!(FaceTree::of(&[]).nearest2(DVec3::ZERO, |_| 0.0), f64::INFINITY);
    }
}
