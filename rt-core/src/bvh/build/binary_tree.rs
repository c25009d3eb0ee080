//! Binary trees over one fragment of the primitives: the output of every builder and the input of
//! the collapse.

use crate::bvh::layout::wide::LEAF_SIZE;
use crate::math::Aabb;

/// A box and either two children or up to four primitives.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BinaryNode {
    pub(crate) bounds: Aabb,
    /// A leaf's first index in [`BinaryTree::ids`]; an inner node's left child, which the right one
    /// follows.
    pub(crate) first: u32,
    /// Primitives of a leaf; 0 for inner nodes.
    pub(crate) count: u32,
}

const NEW: BinaryNode = BinaryNode { bounds: Aabb::EMPTY, first: 0, count: 0 };

impl BinaryNode {
    #[inline(always)]
    pub(crate) fn is_leaf(&self) -> bool {
        self.count != 0
    }
}

/// A tree whose root is node 0 and whose children come after their parents.
#[derive(Debug, Default)]
pub(crate) struct BinaryTree {
    pub(crate) nodes: Vec<BinaryNode>,
    /// Primitive numbers in the order of the leaves; ascending within a leaf.
    pub(crate) ids: Vec<u32>,
    /// Nodes on the longest path from the root to a leaf.
    pub(crate) depth: usize,
}

impl BinaryTree {
    /// A tree with capacity for `prims` primitives. Leaves hold more than three on average.
    pub(crate) fn with_room_for(prims: usize) -> BinaryTree {
        BinaryTree { nodes: Vec::with_capacity(prims * 5 / 8 + 8), ids: vec![0; prims], depth: 0 }
    }

    /// Adds the root.
    pub(crate) fn add_root(&mut self) {
        self.nodes.push(NEW);
    }

    /// Makes `node` a leaf of up to four primitives, with ids from index `first` on. Ids ascend:
    /// with ties in t the first of a leaf wins, for any order of partitioning.
    #[inline]
    pub(crate) fn make_leaf(
        &mut self,
        node: usize,
        first: usize,
        prims: impl ExactSizeIterator<Item = u32>,
    ) {
        let count = prims.len();
        let n = &mut self.nodes[node];
        (n.first, n.count) = (first as u32, count as u32);
        let ids = &mut self.ids[first..first + count];
        for (id, p) in ids.iter_mut().zip(prims) {
            *id = p;
        }
        sort4(ids);
    }

    /// Adds the two children of `node` and returns the left one's index.
    #[inline]
    pub(crate) fn open(&mut self, node: usize) -> usize {
        let left = self.nodes.len();
        self.nodes.extend([NEW, NEW]);
        self.nodes[node].first = left as u32;
        left
    }

    /// The surface area heuristic's cost relative to the root's area: expected nodes and leaves
    /// that a ray through the root's box visits.
    #[cfg(test)]
    pub(crate) fn cost(&self) -> f64 {
        let sum: f64 = self.nodes.iter().map(|n| n.bounds.half_area() as f64).sum();
        sum / self.nodes[0].bounds.half_area() as f64
    }
}

/// Sorts up to four numbers with a network of five exchanges.
#[inline]
fn sort4(ids: &mut [u32]) {
    debug_assert!(ids.len() <= LEAF_SIZE, "leaves hold up to four");
    let mut v = [u32::MAX; LEAF_SIZE];
    v[..ids.len()].copy_from_slice(ids);
    for (a, b) in [(0, 1), (2, 3), (0, 2), (1, 3), (1, 2)] {
        (v[a], v[b]) = (v[a].min(v[b]), v[a].max(v[b]));
    }
    let n = ids.len();
    ids.copy_from_slice(&v[..n]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_network_sorts_every_order_of_up_to_four() {
        for code in 0..256u32 {
            for n in 0..=4 {
                let v: Vec<u32> = (0..n).map(|i| (code >> (2 * i)) & 3).collect();
                let (mut found, mut expected) = (v.clone(), v);
                sort4(&mut found);
                expected.sort_unstable();
                assert_eq!(found, expected);
            }
        }
    }
}
