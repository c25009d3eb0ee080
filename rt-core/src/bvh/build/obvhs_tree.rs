//! Binary trees improved by the reinsertion optimiser of the crate obvhs (Meister and Bittner,
//! "Parallel Reinsertion for Bounding Volume Hierarchy Optimization", 2018).
//!
//! It runs within a fragment of the primitives, which bounds its memory and its time. Inputs that
//! obvhs 0.4 cannot handle are excluded:
//! - Boxes whose surface overflows f32 lead to comparisons of NaN, which panic: `None` here.
//! - Trees may become as deep as there are primitives: `None` beyond [`MAX_BINARY_DEPTH`].
//! - The optimiser's stack has a fixed size, twice the depth that the tree stores: the true depth
//!   is set before every pass.
//!
//! obvhs' builder (PLOC, Meister and Bittner 2018) was a preset once. It took longer than
//! [`super::sah_tree`] with few bins, and rays through its trees took longer, too.

use super::binary_tree::BinaryTree;
use super::binned_sah::LeafCapacity;
use crate::bvh::layout::wide::LEAF_SIZE;
use crate::math::Aabb;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::bvh2::{Bvh2, node::Bvh2Node};

/// Deeper trees are refused.
pub(super) const MAX_BINARY_DEPTH: usize = 50;
/// Boxes with more than this half area are refused: sums and products of a few of them must stay
/// finite.
const LARGEST_HALF_AREA: f32 = 1e30;

/// False for NaN as well.
fn is_ordinary(b: Aabb) -> bool {
    b.half_area() <= LARGEST_HALF_AREA
}

/// `tree` with subtrees moved to where they cost less; `None` when obvhs cannot handle it. Each
/// pass tries the given share of the nodes, those with the largest surface.
pub(crate) fn reinsert(
    tree: &BinaryTree,
    passes: &[f32],
    leaves: LeafCapacity,
) -> Option<BinaryTree> {
    if !is_ordinary(tree.nodes[0].bounds) {
        return None;
    }
    let mut bvh = to_bvh2(tree);
    let mut optimizer = ReinsertionOptimizer::default();
    for &part in passes {
        bvh.max_depth = depth_of(&bvh.nodes).max(obvhs::bvh2::DEFAULT_MAX_STACK_DEPTH);
        optimizer.run(&mut bvh, part, Some(vec![1.0]));
    }
    to_binary_tree(&bvh, &tree.ids, leaves, |leaf| {
        Aabb::new(leaf.aabb().min.into(), leaf.aabb().max.into())
    })
}

/// Breadth first, since the optimiser takes the first nodes for the largest.
fn to_bvh2(tree: &BinaryTree) -> Bvh2 {
    let mut nodes: Vec<Bvh2Node> = Vec::with_capacity(tree.nodes.len());
    let node = |i: u32| {
        let n = &tree.nodes[i as usize];
        let aabb = obvhs::aabb::Aabb { min: n.bounds.min.into(), max: n.bounds.max.into() };
        Bvh2Node::new(aabb, n.count, n.first)
    };
    nodes.push(node(0));
    let mut next = 0;
    while next < nodes.len() {
        if !nodes[next].is_leaf() {
            let left = nodes[next].first_index;
            nodes[next].first_index = nodes.len() as u32;
            nodes.push(node(left));
            nodes.push(node(left + 1));
        }
        next += 1;
    }
    let primitive_indices = (0..tree.ids.len() as u32).collect();
    Bvh2 { nodes, primitive_indices, ..Default::default() }
}

/// Nodes on the longest path.
fn depth_of(nodes: &[Bvh2Node]) -> usize {
    let (mut deepest, mut stack) = (0, vec![(0u32, 1)]);
    while let Some((i, depth)) = stack.pop() {
        deepest = deepest.max(depth);
        let n = &nodes[i as usize];
        if !n.is_leaf() {
            stack.extend([(n.first_index, depth + 1), (n.first_index + 1, depth + 1)]);
        }
    }
    deepest
}

/// Renumbers the nodes, makes subtrees of up to four primitives leaves, and computes boxes anew
/// from `leaf_bounds`. The leaves of `bvh` refer to places in `ids`.
fn to_binary_tree(
    bvh: &Bvh2,
    ids: &[u32],
    leaves: LeafCapacity,
    leaf_bounds: impl Fn(&Bvh2Node) -> Aabb,
) -> Option<BinaryTree> {
    // ---- Primitives below each node. The optimiser does not number parents before children.
    let mut counts = vec![0u32; bvh.nodes.len()];
    let mut depths = vec![0u8; bvh.nodes.len()];
    let mut order: Vec<u32> = (0..bvh.nodes.len() as u32).collect();
    if !bvh.children_are_ordered_after_parents {
        order.clear();
        let mut stack = vec![0u32];
        while let Some(i) = stack.pop() {
            order.push(i);
            let n = &bvh.nodes[i as usize];
            if !n.is_leaf() {
                stack.extend([n.first_index, n.first_index + 1]);
            }
        }
    }
    depths[0] = 1;
    for &i in &order {
        let (n, depth) = (&bvh.nodes[i as usize], depths[i as usize]);
        if depth as usize > MAX_BINARY_DEPTH {
            return None;
        }
        if !n.is_leaf() {
            depths[n.first_index as usize..][..2].fill(depth + 1);
        }
    }
    for &i in order.iter().rev() {
        let n = &bvh.nodes[i as usize];
        let first = n.first_index as usize;
        counts[i as usize] =
            if n.is_leaf() { n.prim_count } else { counts[first] + counts[first + 1] };
    }

    // ---- The new tree, parents first.
    let mut tree = BinaryTree::with_room_for(ids.len());
    tree.add_root();
    let mut todo = vec![(0u32, 0usize, 1usize)];
    let (mut next, mut below) = (0, Vec::new());
    while let Some((i, node, depth)) = todo.pop() {
        tree.depth = tree.depth.max(depth);
        if counts[i as usize] as usize > leaves.size() {
            let left = tree.open(node);
            let first = bvh.nodes[i as usize].first_index;
            todo.extend([(first + 1, left + 1, depth + 1), (first, left, depth + 1)]);
            continue;
        }
        let mut bounds = Aabb::EMPTY;
        let mut prims = [0; LEAF_SIZE];
        let mut count = 0;
        below.push(i);
        while let Some(i) = below.pop() {
            let n = &bvh.nodes[i as usize];
            if n.is_leaf() {
                bounds = bounds.union(leaf_bounds(n));
                for place in n.first_index..n.first_index + n.prim_count {
                    prims[count] = ids[place as usize];
                    count += 1;
                }
            } else {
                below.extend([n.first_index + 1, n.first_index]);
            }
        }
        tree.make_leaf(node, next, prims[..count].iter().copied());
        tree.nodes[node].bounds = bounds;
        next += count;
    }
    debug_assert_eq!(next, ids.len(), "every primitive is in one leaf");

    // ---- Boxes, children first.
    for i in (0..tree.nodes.len()).rev() {
        if !tree.nodes[i].is_leaf() {
            let first = tree.nodes[i].first as usize;
            let b: Aabb = tree.nodes[first].bounds.union(tree.nodes[first + 1].bounds);
            tree.nodes[i].bounds = b;
        }
    }
    Some(tree)
}
