//! The hierarchy over a mesh's triangles.

use super::build::{MAX_PRIMS, PrimRef, Progress, Stopped, build_wide};
use super::layout::local_frame::LocalFrame;
use super::layout::triangles::TriWriter;
use super::layout::wide::WideBvh;
use super::options::BuildQuality;
use super::query::TriangleTest;
use super::traverse::meshlets;
use super::traverse::single::{RaySetup, traverse_body};
use super::traverse::tree_view::TreeView;
use super::traverse::triangle_leaf::{AnyLeaf, ClosestLeaf, ClosestTri};
use crate::math::Aabb;
use crate::mesh::Triangles;
use crate::ray::Ray;
use crate::simd::huge_pages;
use fearless_simd::Simd;
use rayon::prelude::*;

/// A hierarchy over a mesh's triangles, in the mesh's object space.
#[derive(Clone)]
pub(crate) struct TriBvh {
    pub(crate) bvh: WideBvh,
    pub(crate) skipped: usize,
    pub(crate) notes: Vec<String>,
}

impl TriBvh {
    /// Triangle `i` of the mesh gets the number `first + i`.
    pub(crate) fn build(
        mesh: Triangles<'_>,
        frame: &LocalFrame,
        first: u32,
        quality: BuildQuality,
        progress: &Progress<'_>,
    ) -> Result<TriBvh, Stopped> {
        debug_assert!(mesh.indices.len() < MAX_PRIMS, "checked by the caller");
        let writer = TriWriter::new(mesh, frame, first);
        // Nearly always every triangle is usable: collect in place and remove the few others
        // afterwards.
        let mut refs: Vec<PrimRef> = huge_pages::scratch(mesh.indices.len());
        (0..mesh.indices.len() as u32)
            .into_par_iter()
            .with_min_len(1 << 14)
            .map(|i| {
                let goes_on = progress.goes_on_at(i);
                PrimRef::new(if goes_on { writer.bounds(i) } else { Aabb::EMPTY }, i)
            })
            .collect_into_vec(&mut refs);
        progress.check()?;
        refs.retain(|r| !r.is_empty());
        let skipped = mesh.indices.len() - refs.len();
        let mut notes = Vec::new();
        let bvh = build_wide(refs, &writer, quality.config(), &mut notes, progress)?;
        Ok(TriBvh { bvh, skipped, notes })
    }
}

/// The closest hit of a local-space ray. Set-up and traversal are one function body: called once
/// per ray, the call chain around a traversal used to take two fifths of the time.
#[inline(never)]
pub(crate) fn closest<S: Simd, T: TriangleTest>(
    simd: S,
    tree: &TreeView<'_>,
    ray: &Ray,
) -> ClosestTri {
    if tree.meshlets() != 0 {
        return meshlets::closest::<S, T>(simd, tree, ray);
    }
    simd.vectorize(
        #[inline(always)]
        || {
            let setup = RaySetup::new(ray);
            let mut leaves = ClosestLeaf::<T>::new(&setup, ray.t_max);
            traverse_body(simd, tree, &setup, ray.t_max, &mut leaves);
            leaves.best
        },
    )
}

/// Whether anything blocks a local-space ray.
#[inline(never)]
pub(crate) fn occluded<S: Simd, T: TriangleTest>(simd: S, tree: &TreeView<'_>, ray: &Ray) -> bool {
    if tree.meshlets() != 0 {
        return meshlets::occluded::<S, T>(simd, tree, ray);
    }
    simd.vectorize(
        #[inline(always)]
        || {
            let setup = RaySetup::new(ray);
            let mut leaves = AnyLeaf::<T>::new(&setup, ray.t_max);
            traverse_body(simd, tree, &setup, ray.t_max, &mut leaves);
            leaves.found
        },
    )
}
