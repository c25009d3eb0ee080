//! What the leaves of the upper level refer to: an instance, or the group of all meshes that are
//! not instanced.

use super::blas::{Blas, Content};
use super::instance_filter::InstanceFilter;
use super::layout::wide::WideBvh;
use super::mesh_group::MeshGroup;
use super::placement::Placement;
use super::query::{HitQuery, TriangleTest};
use super::shape_packets;
use super::stored_mesh::StoredMesh;
use super::traverse::tree_view::TreeView;
use super::triangle_bvh;
use crate::ray::{Hit, HitBlock, Ray, RayBlock};
use crate::stored_volume::StoredIsosurface;
use fearless_simd::Simd;

#[derive(Clone, Copy)]
pub(super) enum Entry<'w> {
    /// One instance of a geometry with a tree of its own.
    Instance { number: u32, placement: &'w Placement, blas: &'w Blas },
    /// Many instances that share a tree.
    Group(&'w MeshGroup),
}

/// A shape whose primitives take many rays at once, and the tree of its primitives.
pub(super) enum PacketShapeEntry<'w> {
    Mesh { tree: &'w WideBvh, mesh: &'w StoredMesh },
    Isosurface { tree: &'w WideBvh, surface: &'w StoredIsosurface },
}

impl PacketShapeEntry<'_> {
    /// Traces blocks in local space; `hits` has none yet, and gets them as hits of `instance`.
    pub(super) fn trace<S: Simd, Q: HitQuery>(
        &self,
        simd: S,
        rays: &[RayBlock],
        hits: &mut [HitBlock],
        instance: u32,
    ) {
        match *self {
            PacketShapeEntry::Mesh { tree, mesh } => {
                shape_packets::trace::<S, Q, _>(simd, tree, mesh, rays, hits, instance);
            }
            PacketShapeEntry::Isosurface { tree, surface } => {
                shape_packets::trace::<S, Q, _>(simd, tree, surface, rays, hits, instance);
            }
        }
    }
}

impl<'w> Entry<'w> {
    pub(super) fn placement(self) -> &'w Placement {
        match self {
            Entry::Instance { placement, .. } => placement,
            Entry::Group(group) => &group.placement,
        }
    }

    /// The hierarchy of triangles, with what `filter` allows; `None` for shapes. Whether an
    /// instance is allowed as a whole is for the caller to check.
    #[inline]
    pub(super) fn triangles<'a>(self, filter: InstanceFilter<'a>) -> Option<TreeView<'a>>
    where
        'w: 'a,
    {
        match self {
            Entry::Instance { blas, .. } => match &blas.content {
                Content::Triangles(tris) => Some(TreeView::all(&tris.bvh)),
                Content::Compact(tree) => Some(TreeView::of_meshlets(tree)),
                Content::Shape { .. } | Content::Member { .. } => None,
            },
            Entry::Group(group) => Some(group.tree(filter)),
        }
    }

    /// What takes many rays at once, where this is an instance of such a shape.
    #[inline]
    pub(super) fn packet_shape(self) -> Option<PacketShapeEntry<'w>> {
        let Entry::Instance { blas, .. } = self else { return None };
        let Content::Shape { bvh: tree, shape } = &blas.content else { return None };
        let shape = shape.as_any()?;
        if let Some(mesh) = shape.downcast_ref() {
            return Some(PacketShapeEntry::Mesh { tree, mesh });
        }
        let surface = shape.downcast_ref()?;
        Some(PacketShapeEntry::Isosurface { tree, surface })
    }

    /// The number that hits in this entry's tree are stored with until [`Entry::resolve`].
    pub(super) fn number(self) -> u32 {
        match self {
            Entry::Instance { number, .. } => number,
            Entry::Group(_) => 0,
        }
    }

    /// Nodes on the longest path from the root of the tree to a leaf.
    pub(super) fn depth(self) -> usize {
        match self {
            Entry::Instance { blas, .. } => blas.depth(),
            Entry::Group(group) => group.bvh.depth,
        }
    }

    /// The instance of primitive `prim` of the tree, and its number there.
    #[inline]
    pub(super) fn owner(self, prim: u32) -> (u32, u32) {
        match self {
            Entry::Instance { number, .. } => (number, prim),
            Entry::Group(group) => group.owner(prim),
        }
    }

    /// Replaces the tree's own numbers in hits by those of instances and their primitives.
    #[inline]
    pub(super) fn resolve(self, hits: &mut [HitBlock]) {
        if let Entry::Group(group) = self {
            group.resolve(hits);
        }
    }

    /// The closest hit of a ray in local space.
    #[inline]
    pub(super) fn closest<S: Simd, T: TriangleTest>(
        self,
        simd: S,
        ray: &Ray,
        filter: InstanceFilter<'_>,
    ) -> Option<Hit> {
        match self {
            Entry::Instance { number, blas, .. } => {
                let c = blas.closest::<S, T>(simd, ray);
                c.found.then_some(Hit { t: c.t, u: c.u, v: c.v, prim: c.prim, instance: number })
            }
            Entry::Group(group) => {
                let c = triangle_bvh::closest::<S, T>(simd, &group.tree(filter), ray);
                c.found.then(|| {
                    let (instance, prim) = group.owner(c.prim);
                    Hit { t: c.t, u: c.u, v: c.v, prim, instance }
                })
            }
        }
    }

    /// Whether anything blocks a ray in local space.
    #[inline]
    pub(super) fn occluded<S: Simd, T: TriangleTest>(
        self,
        simd: S,
        ray: &Ray,
        filter: InstanceFilter<'_>,
    ) -> bool {
        match self {
            Entry::Instance { blas, .. } => blas.occluded::<S, T>(simd, ray),
            Entry::Group(group) => triangle_bvh::occluded::<S, T>(simd, &group.tree(filter), ray),
        }
    }
}
