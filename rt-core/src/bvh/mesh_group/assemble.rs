//! Joins the subtrees of meshes under an upper part, in one array.

use super::Member;
use super::subtree::Subtree;
use super::upper::{Upper, build_upper, link};
use crate::bvh::build::{BuilderConfig, MAX_PRIMS, Progress, Stopped};
use crate::bvh::layout::triangles::TRI_LEAF_UNITS;
use crate::bvh::layout::wide::{CHILD_ROW, ChildRef, MAX_DEPTH, NODE_UNITS, Unit, WideBvh};
use crate::bvh::traverse::tree_view::ChildOwners;
use crate::simd::huge_pages;
use rayon::prelude::*;

/// A group's tree.
pub(in crate::bvh) struct GroupTree {
    pub(super) bvh: WideBvh,
    pub(super) owners: Vec<ChildOwners>,
    pub(super) members: Vec<Member>,
    pub(super) replaced_units: usize,
    pub(super) triangles: u32,
}

/// Joins the subtrees, which are in the order of their instances. `Ok(None)` when the result would
/// be deeper than a traversal stack allows or larger than child references reach.
pub(in crate::bvh) fn assemble(
    subtrees: Vec<Subtree<'_>>,
    config: BuilderConfig,
    notes: &mut Vec<String>,
    progress: &Progress<'_>,
) -> Result<Option<GroupTree>, Stopped> {
    let triangles: usize = subtrees.iter().map(|s| s.triangles as usize).sum();
    let units: usize = subtrees.iter().map(|s| s.units.len()).sum();
    if triangles >= MAX_PRIMS {
        return Ok(None);
    }

    let Upper { tree: upper, opened, replaced } = build_upper(&subtrees, config, notes, progress)?;
    let depth = upper.depth + subtrees.iter().map(|s| s.depth).max().unwrap_or(0);
    if depth > MAX_DEPTH || upper.units.len() + units > ChildRef::MAX_UNITS {
        return Ok(None);
    }

    // ---- The array: upper part, then the subtrees.
    let mut arena = huge_pages::filled(Unit::ZERO, upper.units.len() + units);
    let (top, mut rest) = arena.split_at_mut(upper.units.len());
    top.copy_from_slice(&upper.units);
    let instances: Vec<u32> = subtrees.iter().map(|s| s.instance).collect();
    let mut members = Vec::with_capacity(subtrees.len());
    let mut copies = Vec::with_capacity(subtrees.len());
    let (mut at, mut first) = (top.len(), 0);
    for s in &subtrees {
        let units = at..at + s.units.len();
        let (mine, others) = rest.split_at_mut(units.len());
        at = units.end;
        members.push(Member { instance: s.instance, geometry: s.geometry, first, units });
        copies.push((s, mine));
        rest = others;
        first += s.triangles;
    }
    let moved = |k: usize| members[k].units.start.wrapping_sub(subtrees[k].base);
    let owners = link(top, &opened, &instances, moved);
    copies.into_par_iter().zip(&members).for_each(|((s, out), m)| {
        let shift =
            Shift { units: m.units.start.wrapping_sub(s.base), ids: m.first.wrapping_sub(s.first) };
        out.copy_from_slice(&s.units);
        shift.apply(out, s.base);
    });
    let bvh = WideBvh { units: arena, bounds: upper.bounds, depth };
    let replaced_units = replaced * NODE_UNITS;
    let triangles = triangles as u32;
    Ok(Some(GroupTree { bvh, owners, members, replaced_units, triangles }))
}

/// What is added to the references and to the triangle numbers of a subtree when it moves. Sums
/// wrap around.
#[derive(Clone, Copy)]
struct Shift {
    units: usize,
    ids: u32,
}

/// Subtrees of at least this many units are separate tasks.
const PARALLEL_UNITS: usize = 1 << 14;

impl Shift {
    /// Changes the subtree in `units`, whose root has the unit `base` in its own references.
    fn apply(self, units: &mut [Unit], base: usize) {
        if self.units == 0 && self.ids == 0 {
            return;
        }
        let children = units[CHILD_ROW].bits_mut();
        let old = *children;
        let used = old.iter().take_while(|&&c| ChildRef(c) != ChildRef::NONE).count();
        for c in &mut children[..used] {
            *c = ChildRef(*c).moved(self.units).0;
        }
        // ---- The children's subtrees, in the order of the array.
        let mut parts: Vec<ChildRef> = old[..used].iter().map(|&c| ChildRef(c)).collect();
        parts.sort_unstable_by_key(|c| c.unit());
        let end = base + units.len();
        let parallel = units.len() >= PARALLEL_UNITS;
        let mut rest = &mut units[NODE_UNITS..];
        let mut jobs = Vec::with_capacity(used);
        for (k, &child) in parts.iter().enumerate() {
            let next = parts.get(k + 1).map_or(end, |c| c.unit());
            let (mine, others) = rest.split_at_mut(next - child.unit());
            jobs.push((child, mine));
            rest = others;
        }
        let change = |(child, mine): (ChildRef, &mut [Unit])| {
            if child.is_leaf() {
                self.apply_to_leaf(mine);
            } else {
                self.apply(mine, child.unit());
            }
        };
        if parallel {
            jobs.into_par_iter().for_each(change);
        } else {
            jobs.into_iter().for_each(change);
        }
    }

    fn apply_to_leaf(self, leaf: &mut [Unit]) {
        debug_assert_eq!(leaf.len(), TRI_LEAF_UNITS, "a leaf's part of the array is the leaf");
        // The numbers are the second half of the last unit.
        for id in &mut leaf[TRI_LEAF_UNITS - 1].bits_mut()[4..] {
            *id = id.wrapping_add(self.ids);
        }
    }
}
