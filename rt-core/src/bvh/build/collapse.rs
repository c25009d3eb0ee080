//! Converts a binary tree to 8-wide nodes.
//!
//! Which binary nodes become wide nodes decides how many nodes a ray meets and how full they are.
//! Opening always the child with the largest surface leaves many nodes half empty; choosing by
//! dynamic programming over "the cheapest way to stand for this subtree with at most i roots" is
//! optimal for the given binary tree (Ylitie, Karras and Laine, "Efficient Incoherent Ray Traversal
//! on GPUs Through Compressed Wide BVHs", HPG 2017, section 3). Leaves are what the builder made
//! them, so the cost is the summed surface of the wide nodes alone. Measured on nested isosurfaces
//! (1 M triangles, balanced preset): 5.95 children a node and 3.66 triangles a leaf, 56 bytes a
//! triangle; greedy opening with the leaves of that time took 63.6. Rays take the same time with
//! both (0.98 to 1.05, geometric mean 1.00).

use super::binary_tree::BinaryTree;
use crate::bvh::layout::wide::WIDTH;

/// Marks an unused slot in a [`WidePlan`] node.
pub(crate) const NO_CHILD: u32 = u32::MAX;

/// The wide nodes of a fragment, parents before children in depth-first order.
#[derive(Debug, Default)]
pub(crate) struct WidePlan {
    /// Binary nodes that are the children of each wide node: leaves of the binary tree first, then
    /// the roots of further wide nodes.
    pub(crate) nodes: Vec<[u32; WIDTH]>,
    /// Leaves in the fragment.
    pub(crate) leaves: usize,
    /// Wide nodes on the longest path; 0 for a fragment that is one leaf.
    pub(crate) depth: usize,
}

/// Chooses the wide nodes of `tree`.
pub(crate) fn plan(tree: &BinaryTree) -> WidePlan {
    let mut planner = Planner { tree, costs: Vec::new(), plan: WidePlan::default() };
    planner.plan.leaves = tree.nodes.iter().filter(|n| n.is_leaf()).count();
    planner.plan.nodes.reserve(planner.plan.leaves / 3 + 2);
    planner.find_costs();
    if !tree.nodes[0].is_leaf() {
        planner.wide_node(0, 1);
    }
    planner.plan
}

/// `[i − 1]`: cost of a subtree with at most i roots, i = 1..=8. The last entry is the cost of
/// filling exactly the eight slots of a separate node.
type Costs = [f32; WIDTH];

struct Planner<'t> {
    tree: &'t BinaryTree,
    costs: Vec<Costs>,
    plan: WidePlan,
}

/// The cheapest division of `i` slots between two children: cost, and number of slots for the left
/// one.
#[inline(always)]
fn share(left: &Costs, right: &Costs, i: usize) -> (f32, usize) {
    let mut best = (f32::INFINITY, 1);
    for k in 1..i {
        let cost = left[k - 1] + right[i - k - 1];
        if cost < best.0 {
            best = (cost, k);
        }
    }
    best
}

impl Planner<'_> {
    fn find_costs(&mut self) {
        let nodes = &self.tree.nodes;
        self.costs.resize(nodes.len(), [0.0; WIDTH]);
        // Children come after parents: backwards is bottom up.
        for (i, n) in nodes.iter().enumerate().rev().filter(|(_, n)| !n.is_leaf()) {
            let [l, r] = [self.costs[n.first as usize], self.costs[n.first as usize + 1]];
            let mut c = [f32::INFINITY; WIDTH];
            for k in 0..WIDTH - 1 {
                for m in 0..WIDTH - 1 - k {
                    c[k + m + 1] = c[k + m + 1].min(l[k] + r[m]);
                }
            }
            let spread = c[WIDTH - 1];
            c[0] = n.bounds.half_area() + spread;
            for k in 1..WIDTH - 1 {
                c[k] = c[k].min(c[0]);
            }
            self.costs[i] = c;
        }
    }

    fn wide_node(&mut self, node: usize, depth: usize) {
        self.plan.depth = self.plan.depth.max(depth);
        let mut children = [NO_CHILD; WIDTH];
        let mut count = 0;
        self.spread(node, WIDTH, &mut children, &mut count);
        // Leaves first: they are stored directly after their node. Stable, so that the order is the
        // binary tree's.
        let mut ordered = [NO_CHILD; WIDTH];
        let is_leaf = |c: &&u32| self.tree.nodes[**c as usize].is_leaf();
        let leaves = children[..count].iter().filter(is_leaf);
        let inner = children[..count].iter().filter(|c| !is_leaf(c));
        for (place, c) in ordered.iter_mut().zip(leaves.chain(inner)) {
            *place = *c;
        }
        self.plan.nodes.push(ordered);
        for c in ordered.into_iter().take(count) {
            if !self.tree.nodes[c as usize].is_leaf() {
                self.wide_node(c as usize, depth + 1);
            }
        }
    }

    /// Divides `places` slots between the two children of `node`.
    fn spread(&self, node: usize, places: usize, out: &mut [u32; WIDTH], count: &mut usize) {
        let left = self.tree.nodes[node].first as usize;
        let (_, k) = share(&self.costs[left], &self.costs[left + 1], places);
        for (child, places) in [(left, k), (left + 1, places - k)] {
            let c = &self.costs[child];
            // A single root when it is as cheap as any division.
            if places == 1 || self.tree.nodes[child].is_leaf() || c[places - 1] >= c[0] {
                out[*count] = child as u32;
                *count += 1;
            } else {
                self.spread(child, places, out, count);
            }
        }
    }
}
