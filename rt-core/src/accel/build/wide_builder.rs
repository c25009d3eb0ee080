//! From primitives to an 8-wide hierarchy, top down and in parallel.
//!
//! Large sets are cut in two recursively (each half its own task) down to fragments. Each fragment becomes a binary tree, and a plan which of
//! its nodes stay as wide ones; then sizes are known, the arena is made, and every fragment writes its own part of it. Sizes of tasks and
//! fragments are fixed, so the tree is the same for any number of threads.

use super::binary_tree::BinaryTree;
use super::binned_sah::{SahEffort, Split, halve, split};
use super::collapse::{NO_CHILD, WidePlan, plan};
use super::prim_ref::{PrimRef, SetBounds};
use super::sah_tree::sah_tree;
use crate::accel::wide::{ChildRef, LEAF_SIZE, MAX_DEPTH, NODE_UNITS, Unit, WIDTH, WideBvh, write_node};
use crate::math::Aabb;
use crate::simd::huge_pages;
use rayon::prelude::*;

/// Sets up to this size are built by one task into one fragment.
const FRAGMENT: usize = 1 << 14;
/// Cuts above the fragments that follow the costs; sets further down are halved.
const MAX_LARGE_CUTS: usize = 40;

/// Puts primitives into leaves.
pub(crate) trait LeafWriter: Sync {
    /// Units per leaf.
    const UNITS: usize;
    /// Writes up to four primitives into a leaf's units.
    fn write(&self, prims: &[u32], out: &mut [Unit]);
}

/// The tree above the fragments.
enum Top {
    Cut(Box<[Top; 2]>, Aabb),
    Fragment(Fragment),
}

struct Fragment {
    tree: BinaryTree,
    plan: WidePlan,
}

/// Nodes of the arena above the fragments.
enum TopNode {
    Wide(Vec<TopNode>, Aabb),
    Fragment(Fragment),
}

/// Builds a hierarchy over `refs`; `effort` decides between speed and quality.
pub(crate) fn build_wide<W: LeafWriter>(mut refs: Vec<PrimRef>, writer: &W, effort: SahEffort) -> WideBvh {
    if refs.is_empty() {
        let mut units = vec![Unit::ZERO; NODE_UNITS];
        write_node(&mut units, &[]);
        return WideBvh { units, bounds: Aabb::EMPTY, depth: 1 };
    }
    let bounds = refs.par_chunks(1 << 16).map(SetBounds::of).reduce(|| SetBounds::EMPTY, |a, b| a.union(&b));
    let mut root = open_top(fragments(&mut refs, &bounds, effort, 0));
    if root.depth() > MAX_DEPTH {
        // Deeper than the traversal stack: only halving then, which is logarithmic whatever the input.
        root = open_top(fragments(&mut refs, &bounds, SahEffort::HALVE, 0));
    }
    // The boxes are in the trees now: 32 bytes a primitive less while the arena is written.
    drop(refs);
    // A tree of one leaf still gets a node, so that traversal always starts at one.
    let root = match root {
        TopNode::Fragment(f) if f.plan.nodes.is_empty() => {
            TopNode::Wide(vec![TopNode::Fragment(f)], bounds.aabb())
        }
        node => node,
    };
    let depth = root.depth();
    let mut units = huge_pages::zeroed_units(root.units::<W>());
    root.write(writer, 0, &mut units);
    WideBvh { units, bounds: bounds.aabb(), depth }
}

/// Cuts sets down to fragments, both sides of each cut in parallel, and plans these.
fn fragments(refs: &mut [PrimRef], bounds: &SetBounds, effort: SahEffort, depth: usize) -> Top {
    if refs.len() <= FRAGMENT {
        let tree = sah_tree(refs, bounds, effort);
        let plan = plan(&tree);
        return Top::Fragment(Fragment { tree, plan });
    }
    let Split { left, left_bounds, right, right_bounds } =
        if effort == SahEffort::HALVE || depth >= MAX_LARGE_CUTS {
            halve(refs)
        } else {
            split(refs, bounds, effort)
        };
    let (l, r) = rayon::join(
        || fragments(left, &left_bounds, effort, depth + 1),
        || fragments(right, &right_bounds, effort, depth + 1),
    );
    Top::Cut(Box::new([l, r]), bounds.aabb())
}

/// Wide nodes above the fragments: always opens the set with the largest surface until there are eight. Few enough not to need the
/// collapse of [`plan`].
fn open_top(root: Top) -> TopNode {
    let (pair, bounds) = match root {
        Top::Fragment(f) => return TopNode::Fragment(f),
        Top::Cut(pair, bounds) => (pair, bounds),
    };
    let mut sets = Vec::from(*pair);
    while sets.len() < WIDTH {
        let area = |t: &Top| match t {
            Top::Cut(_, b) => Some(b.half_area()),
            Top::Fragment(_) => None,
        };
        // The first of equals, so that ties do not depend on anything but the input.
        let mut largest: Option<(usize, f32)> = None;
        for (i, a) in sets.iter().enumerate().filter_map(|(i, s)| area(s).map(|a| (i, a))) {
            if largest.is_none_or(|(_, b)| a > b) {
                largest = Some((i, a));
            }
        }
        let Some((i, _)) = largest else { break };
        let Top::Cut(pair, _) = sets.swap_remove(i) else { unreachable!("fragments have no area here") };
        sets.extend(*pair);
    }
    TopNode::Wide(sets.into_iter().map(open_top).collect(), bounds)
}

impl TopNode {
    fn bounds(&self) -> Aabb {
        match self {
            TopNode::Wide(_, b) => *b,
            TopNode::Fragment(f) => f.tree.nodes[0].bounds,
        }
    }

    /// Nodes on the longest path from here to a leaf.
    fn depth(&self) -> usize {
        match self {
            TopNode::Wide(children, _) => 1 + children.iter().map(TopNode::depth).max().unwrap_or(0),
            TopNode::Fragment(f) => f.plan.depth,
        }
    }

    /// Units of the arena this takes.
    fn units<W: LeafWriter>(&self) -> usize {
        match self {
            TopNode::Wide(children, _) => {
                NODE_UNITS + children.iter().map(TopNode::units::<W>).sum::<usize>()
            }
            TopNode::Fragment(f) => f.plan.nodes.len() * NODE_UNITS + f.plan.leaves * W::UNITS,
        }
    }

    /// Writes this part of the arena, which starts at unit `base`.
    fn write<W: LeafWriter>(self, writer: &W, base: usize, out: &mut [Unit]) -> ChildRef {
        match self {
            TopNode::Fragment(f) => {
                let mut w = FragmentWriter { fragment: &f, writer, base, out, next_node: 0, next_unit: 0 };
                if f.plan.nodes.is_empty() { w.leaf(0) } else { w.node() }
            }
            TopNode::Wide(children, _) => {
                let (node, mut rest) = out.split_at_mut(NODE_UNITS);
                let mut next = base + NODE_UNITS;
                let mut jobs = Vec::with_capacity(WIDTH);
                for c in children {
                    let n = c.units::<W>();
                    let (mine, others) = rest.split_at_mut(n);
                    jobs.push((c, next, mine));
                    next += n;
                    rest = others;
                }
                let placed: Vec<(Aabb, ChildRef)> = jobs
                    .into_par_iter()
                    .map(|(c, base, out)| (c.bounds(), c.write(writer, base, out)))
                    .collect();
                write_node(node, &placed);
                ChildRef::node(base)
            }
        }
    }
}

/// Writes a fragment's nodes and leaves in the plan's order.
struct FragmentWriter<'f, W> {
    fragment: &'f Fragment,
    writer: &'f W,
    /// The first unit of `out` in the arena.
    base: usize,
    out: &'f mut [Unit],
    next_node: usize,
    next_unit: usize,
}

impl<W: LeafWriter> FragmentWriter<'_, W> {
    fn node(&mut self) -> ChildRef {
        let ids = self.fragment.plan.nodes[self.next_node];
        self.next_node += 1;
        let at = self.next_unit;
        self.next_unit += NODE_UNITS;
        let mut children = [(Aabb::EMPTY, ChildRef::NONE); WIDTH];
        let mut count = 0;
        for id in ids.into_iter().take_while(|&id| id != NO_CHILD) {
            let child = &self.fragment.tree.nodes[id as usize];
            let reference = if child.is_leaf() { self.leaf(id as usize) } else { self.node() };
            children[count] = (child.bounds, reference);
            count += 1;
        }
        write_node(&mut self.out[at..at + NODE_UNITS], &children[..count]);
        ChildRef::node(self.base + at)
    }

    fn leaf(&mut self, id: usize) -> ChildRef {
        let tree = &self.fragment.tree;
        let node = &tree.nodes[id];
        let prims = &tree.ids[node.first as usize..][..node.count as usize];
        debug_assert!((1..=LEAF_SIZE).contains(&prims.len()), "a leaf of {}", prims.len());
        let at = self.next_unit;
        self.next_unit += W::UNITS;
        self.writer.write(prims, &mut self.out[at..at + W::UNITS]);
        ChildRef::leaf(self.base + at, prims.len())
    }
}
