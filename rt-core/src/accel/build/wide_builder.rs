//! From primitives to an 8-wide hierarchy, top down and in parallel.
//!
//! Large sets are cut in two recursively (each half its own task) until they are small; a wide node then takes the eight sets that come
//! from always opening the one with the largest surface. Small sets become fragments: pieces of the final arena with references relative
//! to their start, which are copied together at the end. Sizes of tasks and fragments are fixed, so the tree is the same for any number of
//! threads.

use super::binned_sah::{Split, halve, split};
use super::prim_ref::{PrimRef, SetBounds};
use crate::accel::wide::{
    CHILD_ROW, ChildRef, LEAF_SIZE, MAX_DEPTH, NODE_UNITS, Unit, WIDTH, WideBvh, write_node,
};
use crate::math::Aabb;
use crate::simd::huge_pages;
use rayon::prelude::*;

/// Sets up to this size are built by one task into one fragment.
const FRAGMENT: usize = 1 << 14;
/// Below this depth of nodes sets are halved instead of cut by cost. Cost-driven cuts of adversarial input (sizes that grow like 2^k) can
/// peel off one primitive at a time; halving bounds the depth by this plus log2 of the count, and with it the traversal stack.
const MAX_COST_DEPTH: usize = 28;

/// Puts primitives into leaves.
pub(crate) trait LeafWriter: Sync {
    /// Units per leaf.
    const UNITS: usize;
    /// Writes up to four primitives into a leaf's units.
    fn write(&self, prims: impl ExactSizeIterator<Item = u32> + Clone, out: &mut [Unit]);
}

/// A set of primitives on its way to become a subtree.
enum Set<'a> {
    /// Already cut in two.
    Cut(Box<(Set<'a>, Set<'a>)>, SetBounds, usize),
    /// Not yet.
    Whole(&'a mut [PrimRef], SetBounds),
}

impl Set<'_> {
    fn bounds(&self) -> &SetBounds {
        match self {
            Set::Cut(_, b, _) | Set::Whole(_, b) => b,
        }
    }
    fn len(&self) -> usize {
        match self {
            Set::Cut(_, _, n) => *n,
            Set::Whole(refs, _) => refs.len(),
        }
    }
}

/// A finished piece of the arena, or a node over pieces.
enum Piece {
    /// Units with references relative to the first; `nodes` lists where its nodes start.
    Fragment {
        units: Vec<Unit>,
        nodes: Vec<u32>,
        root: ChildRef,
        depth: usize,
    },
    Node(Vec<(Aabb, Piece)>),
}

impl Piece {
    /// Nodes from the root of the whole tree to the deepest leaf in here.
    fn depth(&self) -> usize {
        match self {
            Piece::Fragment { depth, .. } => *depth,
            Piece::Node(children) => children.iter().map(|(_, c)| c.depth()).max().unwrap_or(1),
        }
    }
}

/// Builds a hierarchy over `refs`; `bins` per axis decides between speed and quality (4 to 16; 0 only halves).
pub(crate) fn build_wide<W: LeafWriter>(mut refs: Vec<PrimRef>, writer: &W, bins: usize) -> WideBvh {
    if refs.is_empty() {
        let mut units = vec![Unit::ZERO; NODE_UNITS];
        write_node(&mut units, &[]);
        return WideBvh { units, bounds: Aabb::EMPTY, depth: 1 };
    }
    let bounds = refs.par_chunks(1 << 16).map(SetBounds::of).reduce(|| SetBounds::EMPTY, |a, b| a.union(&b));
    let mut piece = build_piece(cut_large(&mut refs, bounds, bins), writer, bins, 0);
    if piece.depth() > MAX_DEPTH {
        // Deeper than the traversal stack: only halving then, which is logarithmic whatever the input.
        piece = build_piece(cut_large(&mut refs, bounds, 0), writer, 0, 0);
    }
    // The boxes are in the pieces now: 32 bytes a primitive less at the peak, which is the copy below.
    drop(refs);
    assemble(piece, bounds.aabb())
}

fn cut<'a>(refs: &'a mut [PrimRef], bounds: &SetBounds, bins: usize) -> Split<'a> {
    if bins == 0 { halve(refs) } else { split(refs, bounds, bins) }
}

/// Cuts sets down to a few fragments' size, both sides of each cut in parallel.
fn cut_large<'a>(refs: &'a mut [PrimRef], bounds: SetBounds, bins: usize) -> Set<'a> {
    let n = refs.len();
    if n <= FRAGMENT {
        return Set::Whole(refs, bounds);
    }
    let s = cut(refs, &bounds, bins);
    let (l, r) =
        rayon::join(|| cut_large(s.left, s.left_bounds, bins), || cut_large(s.right, s.right_bounds, bins));
    Set::Cut(Box::new((l, r)), bounds, n)
}

/// Opens the set with the largest surface until there are eight, or all fit into leaves.
fn open_until_wide<'a>(root: Set<'a>, bins: usize, depth: usize, out: &mut Vec<Set<'a>>) {
    out.clear();
    out.push(root);
    while out.len() < WIDTH {
        let candidate = out
            .iter()
            .enumerate()
            .filter(|(_, s)| s.len() > LEAF_SIZE)
            .map(|(i, s)| (i, s.bounds().aabb().half_area()))
            // The first of equals, so that ties do not depend on anything but the input.
            .fold(
                None,
                |best: Option<(usize, f32)>, (i, a)| {
                    if best.is_none_or(|(_, b)| a > b) { Some((i, a)) } else { best }
                },
            );
        let Some((i, _)) = candidate else { break };
        let (l, r) = match out.swap_remove(i) {
            Set::Cut(pair, _, _) => *pair,
            Set::Whole(refs, bounds) => {
                let Split { left, left_bounds, right, right_bounds } =
                    cut(refs, &bounds, if depth < MAX_COST_DEPTH { bins } else { 0 });
                (Set::Whole(left, left_bounds), Set::Whole(right, right_bounds))
            }
        };
        out.push(l);
        out.push(r);
    }
}

fn build_piece<W: LeafWriter>(set: Set<'_>, writer: &W, bins: usize, depth: usize) -> Piece {
    if set.len() <= FRAGMENT {
        let n = set.len();
        let mut f = FragmentBuilder { writer, bins, units: Vec::new(), nodes: Vec::new(), depth: 0 };
        f.units.reserve(n * W::UNITS / 3 + n / 2 + NODE_UNITS);
        let root = f.build(set, depth);
        return Piece::Fragment { units: f.units, nodes: f.nodes, root, depth: f.depth };
    }
    let mut children = Vec::with_capacity(WIDTH);
    open_until_wide(set, bins, depth, &mut children);
    let pieces = children
        .into_par_iter()
        .map(|c| (c.bounds().aabb(), build_piece(c, writer, bins, depth + 1)))
        .collect();
    Piece::Node(pieces)
}

struct FragmentBuilder<'w, W> {
    writer: &'w W,
    bins: usize,
    units: Vec<Unit>,
    nodes: Vec<u32>,
    depth: usize,
}

impl<W: LeafWriter> FragmentBuilder<'_, W> {
    fn build(&mut self, set: Set<'_>, depth: usize) -> ChildRef {
        self.depth = self.depth.max(depth + 1);
        if set.len() <= LEAF_SIZE {
            return self.leaf(set);
        }
        let at = self.units.len();
        self.nodes.push(at as u32);
        self.units.resize(at + NODE_UNITS, Unit::ZERO);
        let mut sets = Vec::with_capacity(WIDTH);
        open_until_wide(set, self.bins, depth, &mut sets);
        let mut children = [(Aabb::EMPTY, ChildRef::NONE); WIDTH];
        let count = sets.len();
        // Leaves first: they stand right behind their node.
        let mut inner = Vec::with_capacity(WIDTH);
        for (slot, s) in sets.into_iter().enumerate() {
            children[slot].0 = s.bounds().aabb();
            if s.len() <= LEAF_SIZE {
                children[slot].1 = self.leaf(s);
            } else {
                inner.push((slot, s));
            }
        }
        for (slot, s) in inner {
            children[slot].1 = self.build(s, depth + 1);
        }
        write_node(&mut self.units[at..at + NODE_UNITS], &children[..count]);
        ChildRef::node(at)
    }

    fn leaf(&mut self, set: Set<'_>) -> ChildRef {
        let Set::Whole(refs, _) = set else { unreachable!("sets of at most four primitives are never cut") };
        // Ascending numbers: with ties in t the first of a leaf wins, whatever the order of partitioning.
        refs.sort_unstable_by_key(|p| p.id());
        let at = self.units.len();
        self.units.resize(at + W::UNITS, Unit::ZERO);
        self.writer.write(refs.iter().map(|p| p.id()), &mut self.units[at..]);
        ChildRef::leaf(at, refs.len())
    }
}

/// Copies the pieces into one arena.
fn assemble(piece: Piece, bounds: Aabb) -> WideBvh {
    fn size(p: &Piece) -> usize {
        match p {
            Piece::Fragment { units, .. } => units.len(),
            Piece::Node(children) => NODE_UNITS + children.iter().map(|(_, c)| size(c)).sum::<usize>(),
        }
    }
    fn place(p: Piece, base: usize, out: &mut [Unit]) -> (ChildRef, usize) {
        match p {
            Piece::Fragment { units, nodes, root, depth } => {
                out.copy_from_slice(&units);
                for n in nodes {
                    for c in out[n as usize + CHILD_ROW].bits_mut() {
                        *c = ChildRef(*c).shifted(base).0;
                    }
                }
                (root.shifted(base), depth)
            }
            Piece::Node(children) => {
                let (node, mut rest) = out.split_at_mut(NODE_UNITS);
                let mut next = base + NODE_UNITS;
                let mut jobs = Vec::with_capacity(WIDTH);
                for (b, c) in children {
                    let n = size(&c);
                    let (mine, others) = rest.split_at_mut(n);
                    jobs.push((b, c, next, mine));
                    next += n;
                    rest = others;
                }
                let placed: Vec<(Aabb, (ChildRef, usize))> =
                    jobs.into_par_iter().map(|(b, c, base, out)| (b, place(c, base, out))).collect();
                let depth = placed.iter().map(|(_, (_, d))| *d).max().unwrap_or(1);
                let refs: Vec<_> = placed.into_iter().map(|(b, (r, _))| (b, r)).collect();
                write_node(node, &refs);
                (ChildRef::node(base), depth)
            }
        }
    }
    // A tree of one leaf still gets a node, so that traversal always starts at one.
    let piece = match piece {
        Piece::Fragment { root, .. } if root.is_leaf() => Piece::Node(vec![(bounds, piece)]),
        p => p,
    };
    let total = size(&piece);
    let mut units = huge_pages::zeroed_units(total);
    let (_, depth) = place(piece, 0, &mut units);
    WideBvh { units, bounds, depth }
}
