//! Cuts the tree of a piece of a mesh into parts that become meshlets.

use crate::bvh::layout::id_leaf::leaf_primitive_ids;
use crate::bvh::layout::wide::{CHILD_ROW, ChildRef, LEAF_SIZE, NODE_UNITS, WideBvh, get_box};
use crate::math::Aabb;
use rayon::prelude::*;

/// Most triangles of a meshlet.
pub(super) const MAX_TRIANGLES: usize = 64;
/// Most leaves: more than 64 triangles fill, fewer than they may need one by one.
pub(super) const MAX_LEAVES: usize = 24;
/// Parts with fewer triangles wait for company from further up in the tree. What joins them there
/// lies farther away. (With 24, trees took as many bytes.)
const SMALL: usize = 8;

/// A leaf of the tree.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leaf {
    pub(super) bounds: Aabb,
    pub(super) prims: [u32; LEAF_SIZE],
    pub(super) count: usize,
}

impl Leaf {
    /// The triangles.
    pub(super) fn ids(&self) -> &[u32] {
        &self.prims[..self.count]
    }
}

/// Leaves that lie together.
#[derive(Debug, Clone)]
pub(super) struct Part {
    pub(super) leaves: Vec<Leaf>,
    triangles: usize,
    bounds: Aabb,
}

impl Part {
    pub(super) fn of(leaves: Vec<Leaf>) -> Part {
        Part {
            triangles: leaves.iter().map(|leaf| leaf.count).sum(),
            bounds: leaves.iter().fold(Aabb::EMPTY, |b, leaf| b.union(leaf.bounds)),
            leaves,
        }
    }

    fn fits_with(&self, other: &Part) -> bool {
        self.triangles + other.triangles <= MAX_TRIANGLES
            && self.leaves.len() + other.leaves.len() <= MAX_LEAVES
    }
}

/// Levels of a tree whose subtrees are cut in parallel.
const PARALLEL_LEVELS: usize = 3;

/// The parts of a tree whose leaves hold triangle numbers. The same for any number of threads.
pub(super) fn parts(tree: &WideBvh) -> Vec<Part> {
    let mut finished = Vec::new();
    let rest = parts_below(tree, 0, 0, &mut finished);
    finished.extend(rest);
    finished
}

/// Cuts the subtree of a node on a level. Returns the parts that may still grow: a single one when
/// the subtree fits a meshlet, or small ones.
fn parts_below(tree: &WideBvh, at: usize, level: usize, finished: &mut Vec<Part>) -> Vec<Part> {
    let node = &tree.units[at..at + NODE_UNITS];
    let refs = node[CHILD_ROW].bits();
    let count = refs.iter().take_while(|&&child| ChildRef(child) != ChildRef::NONE).count();
    let below = |slot: usize, open: &mut Vec<Part>, finished: &mut Vec<Part>| {
        let child = ChildRef(refs[slot]);
        if !child.is_leaf() {
            open.extend(parts_below(tree, child.unit(), level + 1, finished));
            return;
        }
        let ids = leaf_primitive_ids(&tree.units, child);
        let mut prims = [0; LEAF_SIZE];
        prims[..ids.len()].copy_from_slice(ids);
        let bounds = get_box(node, slot);
        open.push(Part::of(vec![Leaf { bounds, prims, count: ids.len() }]));
    };
    let mut open: Vec<Part> = Vec::new();
    if level < PARALLEL_LEVELS {
        let cut = |slot| {
            let (mut open, mut finished) = (Vec::new(), Vec::new());
            below(slot, &mut open, &mut finished);
            (open, finished)
        };
        let cut: Vec<_> = (0..count).into_par_iter().map(cut).collect();
        for (parts, ended) in cut {
            open.extend(parts);
            finished.extend(ended);
        }
    } else {
        (0..count).for_each(|slot| below(slot, &mut open, finished));
    }
    join(&mut open);
    if open.len() > 1 {
        open.retain_mut(|part| {
            let grows = part.triangles < SMALL;
            if !grows {
                finished.push(std::mem::replace(part, Part::of(Vec::new())));
            }
            grows
        });
    }
    open
}

/// Joins parts that fit into one meshlet, those with the smallest common box first.
fn join(parts: &mut Vec<Part>) {
    loop {
        let mut best: Option<(f32, usize, usize)> = None;
        for j in 1..parts.len() {
            for i in 0..j {
                let (a, b) = (&parts[i], &parts[j]);
                let area = a.bounds.union(b.bounds).half_area();
                if a.fits_with(b) && best.is_none_or(|(least, _, _)| area < least) {
                    best = Some((area, i, j));
                }
            }
        }
        let Some((_, i, j)) = best else { return };
        let Part { leaves, triangles, bounds } = parts.remove(j);
        let part = &mut parts[i];
        part.leaves.extend(leaves);
        part.triangles += triangles;
        part.bounds = part.bounds.union(bounds);
    }
}
