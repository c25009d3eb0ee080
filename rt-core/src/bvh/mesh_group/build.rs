//! Builds the trees of the members, or takes them from an earlier world, and joins them.

use super::subtree::Subtree;
use super::{Member, MeshGroup, assemble};
use crate::bvh::blas::{Blas, Content};
use crate::bvh::build::{Progress, Stopped, build_in_parallel};
use crate::bvh::geometry::{Instance, Sources};
use crate::bvh::layout::local_frame::LocalFrame;
use crate::bvh::layout::wide::WideBvh;
use crate::bvh::options::BuildOptions;
use crate::bvh::triangle_bvh::TriBvh;
use crate::math::Aabb;
use glam::DVec3;
use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::Arc;

/// What a group is built from.
pub(in crate::bvh) struct GroupInput<'a> {
    pub(in crate::bvh) sources: Sources<'a>,
    pub(in crate::bvh) instances: &'a [Instance],
    /// Instances of the members, ascending.
    pub(in crate::bvh) members: &'a [u32],
    pub(in crate::bvh) frame: LocalFrame,
    /// World position of render space's origin.
    pub(in crate::bvh) origin: DVec3,
    /// Bounds of the group that this is a part of.
    pub(in crate::bvh) reach: Option<Aabb>,
    pub(in crate::bvh) options: &'a BuildOptions,
    pub(in crate::bvh) progress: &'a Progress<'a>,
}

/// A geometry of an earlier world: its index there, its index among the members of the group
/// there, and its structure.
#[derive(Clone, Copy)]
pub(in crate::bvh) struct KnownTree<'w> {
    pub(in crate::bvh) geometry: usize,
    pub(in crate::bvh) member: Option<usize>,
    pub(in crate::bvh) blas: &'w Arc<Blas>,
}

/// Geometries of an earlier world by the address of their data.
pub(in crate::bvh) type KnownTrees<'w> = HashMap<usize, KnownTree<'w>>;

/// Where the tree of a member comes from.
enum Source<'w> {
    Built(WideBvh),
    /// A tree of its own in the earlier world.
    Alone(&'w WideBvh),
    /// A member of the earlier world's group.
    Member(&'w MeshGroup, usize),
}

/// A group, and the structure of each member.
type BuiltGroup = (Arc<MeshGroup>, Vec<Arc<Blas>>);

/// The group, and the structure of each member. `Ok(None)` when the tree would be too large or too
/// deep.
pub(in crate::bvh) fn build_group(
    input: &GroupInput<'_>,
    known: Option<&KnownTrees<'_>>,
    previous: Option<&Arc<MeshGroup>>,
    notes: &mut Vec<String>,
) -> Result<Option<BuiltGroup>, Stopped> {
    if let (Some(known), Some(group)) = (known, previous)
        && let Some(unchanged) = unchanged_group(input, known, group)
    {
        return Ok(Some(unchanged));
    }
    let geometry_of = |k: usize| input.instances[input.members[k] as usize].geometry;
    let address_of = |geometry: usize| input.sources.geometries[geometry].address();
    let size_of = |k: usize| input.sources.geometries[geometry_of(k)].num_primitives();
    let mut first = 0usize;
    let firsts: Vec<u32> = (0..input.members.len())
        .map(|k| {
            let at = first;
            first += size_of(k);
            at as u32
        })
        .collect();
    if u32::try_from(first).is_err() {
        return Ok(None);
    }

    let build = |k: usize| {
        if let Some(old) = known.and_then(|trees| trees.get(&address_of(geometry_of(k))))
            && old.blas.frame == input.frame
            && let Some(blas) = Blas::as_part_of(old.blas, input.reach.map(|r| (input.frame, r)))
            && let Some(source) = source_of(old, previous)
        {
            input.progress.advance(size_of(k))?;
            return Ok((blas, source));
        }
        let mesh = input.sources.triangles(geometry_of(k));
        let tree =
            TriBvh::build(mesh, &input.frame, firsts[k], input.options.quality, input.progress)?;
        let (blas, bvh) = Blas::member(mesh, input.frame, input.reach, tree);
        Ok((Arc::new(blas), Source::Built(bvh)))
    };
    let sizes: Vec<usize> = (0..input.members.len()).map(size_of).collect();
    let built = build_in_parallel(&sizes, build);

    let (mut members, mut subtrees) = (Vec::new(), Vec::new());
    for (k, built) in built.into_iter().enumerate() {
        let (blas, source) = built?;
        let depth = blas.depth();
        let (units, base, first) = match source {
            Source::Built(bvh) => (Cow::Owned(bvh.units), 0, firsts[k]),
            Source::Alone(bvh) => (Cow::Borrowed(bvh.units.as_slice()), 0, 0),
            Source::Member(group, m) => {
                let Member { first, ref units, .. } = group.members[m];
                (Cow::Borrowed(group.subtree(m)), units.start, first)
            }
        };
        members.push(as_member(blas));
        subtrees.push(Subtree {
            instance: input.members[k],
            geometry: geometry_of(k),
            triangles: size_of(k) as u32,
            units,
            base,
            first,
            depth,
        });
    }
    input.progress.check()?;
    let tree = assemble(subtrees, input.options.quality.config(), notes, input.progress)?;
    let group = tree.and_then(|tree| MeshGroup::new(tree, input.frame, input.reach, input.origin));
    Ok(group.map(|group| (Arc::new(group), members)))
}

/// The group of the earlier world when it has the same meshes, in the same order and space.
fn unchanged_group(
    input: &GroupInput<'_>,
    known: &KnownTrees<'_>,
    group: &Arc<MeshGroup>,
) -> Option<BuiltGroup> {
    let same_reach = match input.reach {
        Some(reach) => reach == group.reach,
        None => group.reach == group.bvh.bounds,
    };
    let same_place = same_reach && group.frame == input.frame;
    if !same_place || group.members.len() != input.members.len() {
        return None;
    }
    let same = |(m, &instance): (&Member, &u32)| {
        let geometry = input.instances[instance as usize].geometry;
        let old = known.get(&input.sources.geometries[geometry].address())?;
        (m.instance == instance && m.geometry == geometry && old.geometry == geometry)
            .then(|| Blas::as_part_of(old.blas, input.reach.map(|r| (input.frame, r))))
            .flatten()
    };
    let blas = group.members.iter().zip(input.members).map(same).collect::<Option<Vec<_>>>()?;
    Some((Arc::clone(group), blas))
}

fn source_of<'w>(old: &KnownTree<'w>, previous: Option<&'w Arc<MeshGroup>>) -> Option<Source<'w>> {
    match &old.blas.content {
        Content::Triangles(tris) => Some(Source::Alone(&tris.bvh)),
        Content::Member { .. } => Some(Source::Member(previous?, old.member?)),
        Content::Compact(_) | Content::Shape { .. } => None,
    }
}

/// The structure of a mesh whose tree is a part of a group's.
fn as_member(blas: Arc<Blas>) -> Arc<Blas> {
    match blas.content {
        Content::Member { .. } => blas,
        _ => Arc::new(blas.without_tree()),
    }
}
