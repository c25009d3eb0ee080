//! The meshes that would share one ordinary tree.
//!
//! Each gets a compact tree of its own, but in the space that all share, and rays are moved into
//! that space by the bounds of all: so hits have the bits that the shared tree gives.

use crate::bvh::blas::Blas;
use crate::bvh::build::{Stopped, build_in_parallel};
use crate::bvh::mesh_group::{GroupInput, KnownTrees};
use crate::math::Aabb;
use std::sync::Arc;

/// The structures of the members, in their order.
pub(in crate::bvh) fn build_members(
    input: &GroupInput<'_>,
    known: Option<&KnownTrees<'_>>,
) -> Result<Vec<Arc<Blas>>, Stopped> {
    let geometry_of = |k: usize| input.instances[input.members[k] as usize].geometry;
    let size_of = |k: usize| input.sources.geometries[geometry_of(k)].num_primitives();
    let build = |k: usize| {
        let address = input.sources.geometries[geometry_of(k)].address();
        if let Some(old) = known.and_then(|trees| trees.get(&address))
            && old.blas.frame == input.frame
            && old.blas.bvh().is_some()
        {
            input.progress.advance(size_of(k))?;
            return Ok(Arc::clone(old.blas));
        }
        let mesh = input.sources.triangles(geometry_of(k));
        // The bounds of all are not known before all are built.
        let given = Some((input.frame, Aabb::EMPTY));
        Ok(Arc::new(Blas::for_mesh(mesh, input.options, given, input.progress)?))
    };
    let sizes: Vec<usize> = (0..input.members.len()).map(size_of).collect();
    let built = build_in_parallel(&sizes, build).into_iter().collect::<Result<Vec<_>, _>>()?;
    let all = || built.iter().fold(Aabb::EMPTY, |b, blas| b.union(blas.bounds()));
    let reach = input.reach.unwrap_or_else(all);
    Ok(built.into_iter().map(|blas| blas.with_reach(reach)).collect())
}
