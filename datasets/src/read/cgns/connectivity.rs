//! The connectivity of a section: its elements as lists of integers.

use super::element::{Element, MIXED, NFACE, NGON};
use super::tree::{Node, Tree};
use super::zone::rind;
use crate::read::error::Fault;
use std::ops::Range;

/// An `Elements_t` of a zone.
pub(super) struct Section {
    pub(super) node: Node,
    pub(super) kind: i64,
    /// Numbers of the first and the last element.
    pub(super) range: [i64; 2],
    /// Elements at the start and the end that belong to other zones.
    rind: [u64; 2],
    children: Vec<Node>,
}

/// Lists of integers, one for each element.
pub(super) struct Lists {
    values: Vec<i64>,
    ends: Vec<usize>,
}

impl Lists {
    pub(super) fn iter(&self) -> impl ExactSizeIterator<Item = &[i64]> {
        (0..self.ends.len()).map(move |i| &self.values[self.range(i)])
    }
    fn range(&self, i: usize) -> Range<usize> {
        i.checked_sub(1).map_or(0, |before| self.ends[before])..self.ends[i]
    }
}

impl Section {
    pub(super) fn new(tree: &Tree, node: &Node) -> Result<Section, Fault> {
        let children = tree.children(node)?;
        let head = node.integers()?;
        let Some(&kind) = head.first() else {
            return Err(node.fault("it has no type of elements"));
        };
        let range = children.iter().find(|c| c.label == "IndexRange_t");
        let range = range.ok_or_else(|| node.fault("it has no ElementRange"))?.integers()?;
        let [first, last] = range[..] else {
            return Err(node.fault(format!("the range of elements {range:?}")));
        };
        if first < 1 || last < first || last >= i64::from(u32::MAX) {
            return Err(node.fault(format!("the range of elements {range:?}")));
        }
        let rind = rind(&children, 1)?[0];
        Ok(Section { node: node.clone(), kind, range: [first, last], rind, children })
    }

    /// Number of elements.
    pub(super) fn len(&self) -> usize {
        (self.range[1] - self.range[0] + 1) as usize
    }

    /// Axes of its elements; `None` if they are of several kinds, or not known.
    pub(super) fn axes(&self) -> Option<usize> {
        match self.kind {
            MIXED => None,
            NGON => Some(2),
            NFACE => Some(3),
            kind => Element::of(kind).map(|e| e.axes),
        }
    }

    /// The name of its kind.
    pub(super) fn kind_name(&self) -> String {
        match self.kind {
            MIXED => "MIXED".into(),
            NGON => "NGON_n".into(),
            NFACE => "NFACE_n".into(),
            kind => Element::of(kind).map_or_else(|| format!("type {kind}"), |e| e.name.into()),
        }
    }

    /// The elements that belong to the zone, of all.
    pub(super) fn own(&self) -> Range<usize> {
        let [before, after] = self.rind.map(|r| usize::try_from(r).unwrap_or(usize::MAX));
        let end = self.len().saturating_sub(after);
        before.min(end)..end
    }

    fn child(&self, name: &str) -> Option<&Node> {
        self.children.iter().find(|c| c.name == name)
    }

    pub(super) fn connectivity(&self) -> Result<Vec<i64>, Fault> {
        let node = self.child("ElementConnectivity");
        node.ok_or_else(|| self.node.fault("it has no ElementConnectivity"))?.integers()
    }

    /// The cells on both sides of each face, all first ones before all second ones.
    pub(super) fn parents(&self) -> Result<Option<Vec<i64>>, Fault> {
        let Some(node) = self.child("ParentElements") else { return Ok(None) };
        let parents = node.integers()?;
        if parents.len() != 2 * self.len() {
            let what = format!("{} parents of {} faces", parents.len(), self.len());
            return Err(node.fault(what));
        }
        Ok(Some(parents))
    }

    /// The lists of faces or polyhedra: with starts (from version 4 on), or each behind its length.
    pub(super) fn lists(&self) -> Result<Lists, Fault> {
        let values = self.connectivity()?;
        let wrong = |what: String| self.node.fault(what);
        if let Some(starts) = self.child("ElementStartOffset") {
            let starts = starts.integers()?;
            if starts.len() != self.len() + 1 || starts[0] != 0 {
                let what = format!("{} starts of {} elements", starts.len(), self.len());
                return Err(wrong(what));
            }
            let mut ends = Vec::with_capacity(self.len());
            for w in starts.windows(2) {
                let end = usize::try_from(w[1]).ok().filter(|e| *e <= values.len() && w[0] <= w[1]);
                ends.push(end.ok_or_else(|| {
                    wrong(format!("an element from {} to {} of {}", w[0], w[1], values.len()))
                })?);
            }
            return Ok(Lists { values, ends });
        }
        // Without starts: n, then n integers.
        let (mut flat, mut ends) = (Vec::with_capacity(values.len()), Vec::new());
        let mut rest = &values[..];
        while let [n, after @ ..] = rest {
            let list = usize::try_from(*n).ok().and_then(|n| after.split_at_checked(n));
            let (list, next) = list.ok_or_else(|| {
                wrong(format!("an element of {n} integers, of which {} follow", after.len()))
            })?;
            flat.extend_from_slice(list);
            ends.push(flat.len());
            rest = next;
        }
        if ends.len() != self.len() {
            return Err(wrong(format!("{} elements in a range of {}", ends.len(), self.len())));
        }
        Ok(Lists { values: flat, ends })
    }
}
