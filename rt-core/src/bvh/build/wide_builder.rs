//! Builds an 8-wide hierarchy from primitives, top down and in parallel.
//!
//! Large sets are split in two recursively (each half is its own task) down to fragments. Each
//! fragment becomes a binary tree with a plan of the nodes to keep as wide nodes. Then all sizes
//! are known: the arena is allocated, and every fragment writes its own part of it. The sizes of
//! tasks and fragments are fixed, so the tree is the same for any number of threads.

use super::binary_tree::BinaryTree;
use super::binned_sah::{SahConfig, SearchSpace, Split, halve, split_into};
use super::collapse::{NO_CHILD, WidePlan, plan};
use super::obvhs_tree::{MAX_BINARY_DEPTH, reinsert};
use super::prim_ref::{PrimRef, SetBounds};
use super::progress::{PRIMITIVES_BETWEEN_CHECKS, Progress, Stopped};
use super::sah_tree::{MAX_COST_DEPTH, sah_tree};
use crate::bvh::layout::wide::{
    ChildRef, LeafWriter, MAX_DEPTH, NODE_UNITS, Unit, WIDTH, WideBvh, write_node,
};
use crate::math::Aabb;
use crate::simd::huge_pages;
use fearless_simd::Level;
use rayon::prelude::*;

/// Largest number of splits by cost above the fragments. Sets further down are halved.
const MAX_LARGE_CUTS: usize = 20;
/// Largest depth of a fragment's binary tree.
const FRAGMENT_DEPTH: usize = MAX_COST_DEPTH + MAX_FRAGMENT_LOG2 as usize;
/// Largest size of a fragment, as a power of two.
const MAX_FRAGMENT_LOG2: u32 = 16;

const _: () = assert!(1 << MAX_FRAGMENT_LOG2 <= PRIMITIVES_BETWEEN_CHECKS);

// Whatever the input, no path is longer than the traversal stack allows: sets of up to 2^30
// primitives are halved down to fragments of 2^14.
const _: () = assert!(
    MAX_LARGE_CUTS + 16 + FRAGMENT_DEPTH <= MAX_DEPTH && MAX_BINARY_DEPTH <= FRAGMENT_DEPTH
);

/// The method to build the binary tree of a fragment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Method {
    /// Top down by the surface area heuristic.
    Sah,
    /// [`Method::Sah`], then obvhs' reinsertion.
    Reinsertion,
}

/// Configuration of the builder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct BuilderConfig {
    pub(crate) method: Method,
    /// For the splits above the fragments, and inside them with SAH.
    pub(crate) sah: SahConfig,
}

impl BuilderConfig {
    /// Sets up to this size become one fragment, built by one task.
    fn fragment(self) -> usize {
        match self.method {
            Method::Sah => 1 << 14,
            Method::Reinsertion => 1 << MAX_FRAGMENT_LOG2,
        }
    }
}

/// Fractions of the nodes that each pass of the reinsertion tries.
const REINSERTION_PASSES: [f32; 6] = [1.0, 0.5, 0.33, 0.25, 0.2, 0.15];

/// The tree above the fragments.
enum CutTree {
    Cut(Box<[CutTree; 2]>, Aabb),
    Fragment(Fragment),
}

struct Fragment {
    tree: BinaryTree,
    plan: WidePlan,
    /// Whether obvhs could not build or improve this fragment.
    fell_back: bool,
}

impl Fragment {
    fn new(
        refs: &mut [PrimRef],
        spare: &mut [PrimRef],
        bounds: &SetBounds,
        config: BuilderConfig,
        level: Level,
    ) -> Fragment {
        let mut fell_back = false;
        let tree = match config.method {
            Method::Sah => sah_tree(refs, spare, bounds, config.sah, level),
            Method::Reinsertion => {
                let tree = sah_tree(refs, spare, bounds, config.sah, level);
                reinsert(&tree, &REINSERTION_PASSES, config.sah.leaves).unwrap_or_else(|| {
                    fell_back = true;
                    tree
                })
            }
        };
        let plan = plan(&tree);
        Fragment { tree, plan, fell_back }
    }
}

/// A node of the arena above the fragments, or a fragment.
enum TopNode {
    Wide(Vec<TopNode>, Aabb),
    Fragment(Fragment),
}

/// How the fragments are built.
#[derive(Clone, Copy)]
struct Plan<'p> {
    config: BuilderConfig,
    level: Level,
    progress: &'p Progress<'p>,
    /// Whether the primitives are those that the caller of the build knows of.
    counts: bool,
}

/// Builds a hierarchy over `refs`. Adds a note to `notes` for each part that could not be built as
/// `config` says.
pub(crate) fn build_wide<W: LeafWriter>(
    mut refs: Vec<PrimRef>,
    writer: &W,
    config: BuilderConfig,
    notes: &mut Vec<String>,
    progress: &Progress<'_>,
) -> Result<WideBvh, Stopped> {
    if refs.is_empty() {
        let mut units = vec![Unit::ZERO; NODE_UNITS];
        write_node(&mut units, &[]);
        return Ok(WideBvh { units, bounds: Aabb::EMPTY, depth: 1 });
    }
    let bounds =
        refs.par_chunks(1 << 16).map(SetBounds::of).reduce(|| SetBounds::EMPTY, |a, b| a.union(&b));
    progress.check()?;
    debug_assert_eq!(config.sah.leaves.size(), W::CAPACITY, "leaves that the writer can hold");
    let level = Level::new();
    let mut spare = huge_pages::scratch_copy(&refs);
    let plan = Plan { config, level, progress, counts: W::COUNTS };
    let root = collapse_cuts(fragments(&mut refs, &mut spare, &bounds, plan, 0)?);
    let (fallbacks, all) = root.fallbacks();
    if fallbacks > 0 {
        notes.push(format!(
            "{fallbacks} of {all} parts built by the surface area heuristic alone: obvhs does not \
             take their sizes or makes too deep a tree"
        ));
    }
    // The boxes are now in the trees. Dropping these saves 64 bytes per primitive while the arena
    // is written.
    drop((refs, spare));
    // A tree of one leaf also gets a node, so that traversal always starts at a node.
    let root = match root {
        TopNode::Fragment(f) if f.plan.nodes.is_empty() => {
            TopNode::Wide(vec![TopNode::Fragment(f)], bounds.aabb())
        }
        node => node,
    };
    let depth = root.depth();
    debug_assert!(depth <= MAX_DEPTH, "depth {depth} is bounded by construction");
    let mut units = huge_pages::filled(Unit::ZERO, root.units::<W>());
    root.write(writer, 0, &mut units, progress);
    // Stopped, it has left out parts.
    progress.check()?;
    Ok(WideBvh { units, bounds: bounds.aabb(), depth })
}

/// Splits sets down to fragments, both sides of each split in parallel, and plans the fragments.
/// `spare` is scratch memory as long as `refs`.
fn fragments(
    refs: &mut [PrimRef],
    spare: &mut [PrimRef],
    bounds: &SetBounds,
    plan: Plan<'_>,
    depth: usize,
) -> Result<CutTree, Stopped> {
    let Plan { config, level, progress, counts } = plan;
    progress.check()?;
    if refs.len() <= config.fragment() {
        let fragment = Fragment::new(refs, spare, bounds, config, level);
        progress.advance(if counts { refs.len() } else { 0 })?;
        return Ok(CutTree::Fragment(fragment));
    }
    let by_cost = depth < MAX_LARGE_CUTS;
    let cut = by_cost
        .then(|| {
            split_into(refs, spare, bounds, config.sah, &mut SearchSpace::new(level), progress)
        })
        .flatten();
    progress.check()?;
    // The split moved everything to `spare`. Halves stay in `refs`.
    let (Split { left, left_bounds, right, right_bounds }, spare) = match cut {
        Some(s) => (s, refs),
        None => (halve(refs), spare),
    };
    let (spare_left, spare_right) = spare.split_at_mut(left.len());
    let (l, r) = rayon::join(
        || fragments(left, spare_left, &left_bounds, plan, depth + 1),
        || fragments(right, spare_right, &right_bounds, plan, depth + 1),
    );
    Ok(CutTree::Cut(Box::new([l?, r?]), bounds.aabb()))
}

/// Collapses the splits above the fragments into wide nodes: repeatedly opens the set with the
/// largest surface until there are eight. There are few sets, so the collapse of [`plan`] is not
/// needed.
fn collapse_cuts(root: CutTree) -> TopNode {
    let (pair, bounds) = match root {
        CutTree::Fragment(f) => return TopNode::Fragment(f),
        CutTree::Cut(pair, bounds) => (pair, bounds),
    };
    let mut sets = Vec::from(*pair);
    while sets.len() < WIDTH {
        let area = |t: &CutTree| match t {
            CutTree::Cut(_, b) => Some(b.half_area()),
            CutTree::Fragment(_) => None,
        };
        // The first of equal areas, so that ties depend only on the input.
        let mut largest: Option<(usize, f32)> = None;
        for (i, a) in sets.iter().enumerate().filter_map(|(i, s)| area(s).map(|a| (i, a))) {
            if largest.is_none_or(|(_, b)| a > b) {
                largest = Some((i, a));
            }
        }
        let Some((i, _)) = largest else { break };
        let CutTree::Cut(pair, _) = sets.swap_remove(i) else {
            unreachable!("fragments have no area here")
        };
        sets.extend(*pair);
    }
    TopNode::Wide(sets.into_iter().map(collapse_cuts).collect(), bounds)
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
            TopNode::Wide(children, _) => {
                1 + children.iter().map(TopNode::depth).max().unwrap_or(0)
            }
            TopNode::Fragment(f) => f.plan.depth,
        }
    }

    /// Numbers of fragments that obvhs could not build, and of all fragments.
    fn fallbacks(&self) -> (usize, usize) {
        match self {
            TopNode::Wide(children, _) => children
                .iter()
                .map(TopNode::fallbacks)
                .fold((0, 0), |(f, n), (g, m)| (f + g, n + m)),
            TopNode::Fragment(f) => (f.fell_back as usize, 1),
        }
    }

    /// Number of arena units of this part.
    fn units<W: LeafWriter>(&self) -> usize {
        match self {
            TopNode::Wide(children, _) => {
                NODE_UNITS + children.iter().map(TopNode::units::<W>).sum::<usize>()
            }
            TopNode::Fragment(f) => f.plan.nodes.len() * NODE_UNITS + f.plan.leaves * W::UNITS,
        }
    }

    /// Writes this part of the arena, which starts at unit `base`; leaves out what is not yet
    /// written when the build is stopped.
    fn write<W: LeafWriter>(
        self,
        writer: &W,
        base: usize,
        out: &mut [Unit],
        progress: &Progress<'_>,
    ) -> ChildRef {
        match self {
            TopNode::Fragment(_) if progress.check().is_err() => ChildRef::NONE,
            TopNode::Fragment(f) => {
                let mut w =
                    FragmentWriter { fragment: &f, writer, base, out, next_node: 0, next_unit: 0 };
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
                    .map(|(c, base, out)| (c.bounds(), c.write(writer, base, out, progress)))
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
    /// Index of the first unit of `out` in the arena.
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
        debug_assert!((1..=W::CAPACITY).contains(&prims.len()), "a leaf of {}", prims.len());
        let at = self.next_unit;
        self.next_unit += W::UNITS;
        self.writer.write(prims, &mut self.out[at..at + W::UNITS]);
        self.writer.reference(self.base + at, prims)
    }
}
