//! The acceleration structure of one geometry, in coordinates chosen for precision.
//!
//! Local space is object space translated to the geometry's centre when it lies far from zero, and
//! scaled by a power of two when it is tiny or huge. Both are exact for the data: differences of
//! nearby f32 positions are exact, and a power of two changes only exponents. The benefit: rays
//! that start near the geometry have small coordinates, and products of three lengths in the
//! triangle test neither overflow nor underflow.

use super::build::{LeafCapacity, PrimRef, Progress, Stopped, build_wide};
use super::compact::CompactBvh;
use super::layout::id_leaf::{IdWriter, leaf_primitive_ids};
use super::layout::local_frame::LocalFrame;
use super::layout::triangles::widened;
use super::layout::wide::{ChildRef, LEAF_SIZE, Unit, WideBvh};
use super::options::{BuildOptions, Storage};
use super::query::{AnyHit, ClosestHit, TriangleTest};
use super::traverse::tree_view::TreeView;
use super::traverse::triangle_leaf::ClosestTri;
use super::triangle_bvh::{self, TriBvh};
use crate::bvh::traverse::single::{LeafTest, RaySetup, inflate_t, traverse};
use crate::math::Aabb;
use crate::mesh::Triangles;
use crate::ray::Ray;
use crate::shapes::Shape;
use fearless_simd::Simd;
use rayon::prelude::*;
use std::sync::Arc;

/// Contents of the leaves.
#[derive(Clone)]
pub(crate) enum Content {
    Triangles(TriBvh),
    Compact(CompactBvh),
    /// A member of the world's mesh group, whose tree holds the triangles.
    Member {
        bounds: Aabb,
        depth: usize,
    },
    Shape {
        bvh: WideBvh,
        shape: Arc<dyn Shape>,
    },
}

/// The structure of one geometry.
#[derive(Clone)]
pub(crate) struct Blas {
    pub(crate) frame: LocalFrame,
    /// Local bounds of the geometry that this is a part of.
    whole: Option<Aabb>,
    pub(crate) content: Content,
    pub(crate) primitives: usize,
    pub(crate) skipped: usize,
    /// Expected work per ray relative to the tree as built; refits increase it.
    pub(crate) cost_growth: f64,
    /// For [`super::BuildReport::notes`].
    pub(crate) notes: Vec<String>,
}

impl Blas {
    /// `given`: local space and local bounds of the geometry that this is a part of.
    pub(crate) fn for_mesh(
        mesh: Triangles<'_>,
        options: &BuildOptions,
        given: Option<(LocalFrame, Aabb)>,
        progress: &Progress<'_>,
    ) -> Result<Blas, Stopped> {
        let frame = given
            .map_or_else(|| LocalFrame::choose(mesh.origin, mesh.bounds()), |(frame, _)| frame);
        let whole = given.map(|(_, bounds)| bounds);
        let (content, skipped, notes) = match options.storage {
            Storage::Plain => {
                let mut tris = TriBvh::build(mesh, &frame, 0, options.quality, progress)?;
                let (skipped, notes) = (tris.skipped, std::mem::take(&mut tris.notes));
                (Content::Triangles(tris), skipped, notes)
            }
            Storage::Compact => {
                let mut tree = CompactBvh::build(mesh, &frame, options.quality, progress)?;
                let (skipped, notes) = (tree.skipped, std::mem::take(&mut tree.notes));
                (Content::Compact(tree), skipped, notes)
            }
        };
        let primitives = mesh.indices.len() - skipped;
        Ok(Blas { frame, whole, primitives, skipped, cost_growth: 1.0, notes, content })
    }

    pub(crate) fn for_shape(
        shape: Arc<dyn Shape>,
        options: &BuildOptions,
        given: Option<(LocalFrame, Aabb)>,
        progress: &Progress<'_>,
    ) -> Result<Blas, Stopped> {
        let n = shape.num_primitives();
        let refs: Vec<PrimRef> = (0..n as u32)
            .into_par_iter()
            .with_min_len(1 << 12)
            .filter_map(|i| {
                if !progress.goes_on_at(i) {
                    return None;
                }
                let b = shape.bounds(i);
                (!b.is_empty() && b.min.is_finite() && b.max.is_finite())
                    .then(|| PrimRef::new(widened(b), i))
            })
            .collect();
        progress.check()?;
        let primitives = refs.len();
        let mut notes = Vec::new();
        let mut config = options.quality.config();
        let bvh = if shape.is_costly() {
            config.sah.leaves = LeafCapacity::One;
            build_wide(refs, &IdWriter::<1>, config, &mut notes, progress)?
        } else {
            build_wide(refs, &IdWriter::<LEAF_SIZE>, config, &mut notes, progress)?
        };
        let frame = LocalFrame { center: shape.origin(), scale: 1.0 };
        Ok(Blas {
            frame,
            whole: given.map(|(_, bounds)| bounds),
            primitives,
            skipped: n - primitives,
            cost_growth: 1.0,
            notes,
            content: Content::Shape { bvh, shape },
        })
    }

    /// The tree of a shape that has the same primitives, bounds and hits: shared when it is the
    /// same shape, else copied.
    pub(crate) fn with_shape(this: &Arc<Blas>, shape: &Arc<dyn Shape>) -> Arc<Blas> {
        match &this.content {
            Content::Shape { bvh, shape: old } if !Arc::ptr_eq(old, shape) => {
                let content = Content::Shape { bvh: bvh.clone(), shape: Arc::clone(shape) };
                Arc::new(Blas { content, notes: this.notes.clone(), ..**this })
            }
            _ => Arc::clone(this),
        }
    }

    /// This structure as that of a part of a geometry with `given` local space and bounds (`None`
    /// for a whole geometry): shared where both are the same, copied where the bounds differ.
    /// `None` in another space, which needs another tree.
    pub(crate) fn as_part_of(
        this: &Arc<Blas>,
        given: Option<(LocalFrame, Aabb)>,
    ) -> Option<Arc<Blas>> {
        let whole = given.map(|(_, bounds)| bounds);
        if given.is_some_and(|(frame, _)| frame != this.frame) || this.is_part() && given.is_none()
        {
            return None;
        }
        Some(if this.whole == whole {
            Arc::clone(this)
        } else {
            let (content, notes) = (this.content.clone(), this.notes.clone());
            Arc::new(Blas { content, notes, whole, ..**this })
        })
    }

    /// The part of a group's tree that holds one mesh. `reach`: local bounds of the mesh that this
    /// is a part of.
    pub(crate) fn member(
        mesh: Triangles<'_>,
        frame: LocalFrame,
        reach: Option<Aabb>,
        tree: TriBvh,
    ) -> (Blas, WideBvh) {
        let TriBvh { bvh, skipped, notes } = tree;
        let primitives = mesh.indices.len() - skipped;
        let content = Content::Member { bounds: bvh.bounds, depth: bvh.depth };
        let blas =
            Blas { frame, whole: reach, primitives, skipped, cost_growth: 1.0, notes, content };
        (blas, bvh)
    }

    /// This mesh as a member of a group, which holds a copy of the tree.
    pub(crate) fn without_tree(&self) -> Blas {
        let content = Content::Member { bounds: self.bounds(), depth: self.depth() };
        Blas { content, notes: self.notes.clone(), ..*self }
    }

    /// The tree of its own; `None` for a member of a group.
    pub(crate) fn bvh(&self) -> Option<&WideBvh> {
        match &self.content {
            Content::Triangles(t) => Some(&t.bvh),
            Content::Compact(t) => Some(&t.bvh),
            Content::Shape { bvh, .. } => Some(bvh),
            Content::Member { .. } => None,
        }
    }

    /// Local bounds of the primitives held here.
    pub(crate) fn bounds(&self) -> Aabb {
        match &self.content {
            Content::Triangles(t) => t.bvh.bounds,
            Content::Compact(t) => t.bvh.bounds,
            Content::Shape { bvh, .. } => bvh.bounds,
            Content::Member { bounds, .. } => *bounds,
        }
    }

    /// Nodes on the longest path from the root to a leaf.
    pub(crate) fn depth(&self) -> usize {
        match &self.content {
            Content::Triangles(t) => t.bvh.depth,
            Content::Compact(t) => t.bvh.depth,
            Content::Shape { bvh, .. } => bvh.depth,
            Content::Member { depth, .. } => *depth,
        }
    }

    /// Bounds that decide how rays are transformed to local space: those of the whole geometry.
    pub(crate) fn reach(&self) -> Aabb {
        self.whole.unwrap_or(self.bounds())
    }

    /// This structure with other bounds that decide how rays are transformed.
    pub(crate) fn with_reach(self: Arc<Blas>, reach: Aabb) -> Arc<Blas> {
        if self.whole == Some(reach) {
            return self;
        }
        let mut blas = Arc::unwrap_or_clone(self);
        blas.whole = Some(reach);
        Arc::new(blas)
    }

    pub(crate) fn is_compact(&self) -> bool {
        matches!(self.content, Content::Compact(_))
    }

    pub(crate) fn is_part(&self) -> bool {
        self.whole.is_some()
    }

    /// The closest hit of a local-space ray.
    #[inline]
    pub(crate) fn closest<S: Simd, T: TriangleTest>(&self, simd: S, ray: &Ray) -> ClosestTri {
        match &self.content {
            Content::Triangles(tris) => {
                triangle_bvh::closest::<S, T>(simd, &TreeView::all(&tris.bvh), ray)
            }
            Content::Compact(tree) => {
                triangle_bvh::closest::<S, T>(simd, &TreeView::of_meshlets(tree), ray)
            }
            Content::Member { .. } => unreachable!("rays reach a member through its group"),
            Content::Shape { bvh, shape } => {
                let (setup, t_max) = (RaySetup::new(ray), ray.t_max);
                let best = ClosestTri { t: t_max, u: 0.0, v: 0.0, prim: 0, found: false };
                let mut leaves = ShapeClosest { shape: &**shape, ray: *ray, best };
                traverse(simd, &TreeView::all(bvh), &setup, t_max, &mut leaves);
                leaves.best
            }
        }
    }

    /// Whether anything blocks a local-space ray.
    #[inline]
    pub(crate) fn occluded<S: Simd, T: TriangleTest>(&self, simd: S, ray: &Ray) -> bool {
        match &self.content {
            Content::Triangles(tris) => {
                triangle_bvh::occluded::<S, T>(simd, &TreeView::all(&tris.bvh), ray)
            }
            Content::Compact(tree) => {
                triangle_bvh::occluded::<S, T>(simd, &TreeView::of_meshlets(tree), ray)
            }
            Content::Member { .. } => unreachable!("rays reach a member through its group"),
            Content::Shape { bvh, shape } => {
                let mut leaves = ShapeAny { shape: &**shape, ray: *ray, found: false };
                traverse(simd, &TreeView::all(bvh), &RaySetup::new(ray), ray.t_max, &mut leaves);
                leaves.found
            }
        }
    }
}

/// The closest hit of a ray among primitives of a shape.
pub(super) struct ShapeClosest<'a> {
    pub(super) shape: &'a dyn Shape,
    pub(super) ray: Ray,
    pub(super) best: ClosestTri,
}

impl<S: Simd> LeafTest<S> for ShapeClosest<'_> {
    type Query = ClosestHit;

    #[inline(always)]
    fn test(&mut self, _: S, units: &[Unit], leaf: ChildRef, skip_t: &mut f32) -> bool {
        for &prim in leaf_primitive_ids(units, leaf) {
            // Up to and including the best so far: a tie goes to the lower number, as with
            // triangles.
            let ray = Ray { t_max: self.best.t.next_up(), ..self.ray };
            let Some(h) = self.shape.closest(prim, &ray) else { continue };
            let b = &mut self.best;
            if h.t < b.t || (h.t == b.t && prim < b.prim) {
                *b = ClosestTri { t: h.t, u: h.u, v: h.v, prim, found: true };
                *skip_t = inflate_t(h.t);
            }
        }
        false
    }
}

/// Whether a primitive of a shape blocks a ray.
pub(super) struct ShapeAny<'a> {
    pub(super) shape: &'a dyn Shape,
    pub(super) ray: Ray,
    pub(super) found: bool,
}

impl<S: Simd> LeafTest<S> for ShapeAny<'_> {
    type Query = AnyHit;

    #[inline(always)]
    fn test(&mut self, _: S, units: &[Unit], leaf: ChildRef, _: &mut f32) -> bool {
        self.found = leaf_primitive_ids(units, leaf)
            .iter()
            .any(|&prim| self.shape.occluded(prim, &self.ray));
        self.found
    }
}
