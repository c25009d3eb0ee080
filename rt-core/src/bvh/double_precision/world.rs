//! The world of f64 meshes, and single rays in it.

use super::build::{LEAF_UNITS, Numbered, Tree, build_tree};
use super::crossing::ExactRay;
use super::distance::hit_point;
use super::input::{HitF64, MeshF64, RayF64};
use super::leaf::{AnyLeaf, ClosestLeaf, TreeRay, crosses};
use super::local_ray::{LocalRay, Start};
use super::nearest::Nearest;
use crate::bvh::build::MAX_PRIMS;
use crate::bvh::error::BuildError;
use crate::bvh::layout::wide::Unit;
use crate::bvh::options::{BuildOptions, BuildReport, Robustness, Storage};
use crate::bvh::traverse::single::traverse_body;
use crate::bvh::traverse::tree_view::TreeView;
use crate::mesh::MeshError;
use crate::simd::SimdLevel;
use fearless_simd::{Level, Simd, dispatch};
use glam::DVec3;
use std::sync::Arc;
use std::time::Instant;

/// Triangle meshes with positions in f64, and rays that are exact in f64.
///
/// Decisions (which triangle is nearest, on which side of an edge a ray passes, whether a hit is in
/// range) are those of exact arithmetic on the given numbers; `t` is at most 2 ulp from the exact
/// value. Rays that meet an edge or a vertex hit all triangles there, so none passes between them.
///
/// The work is nearly that of a [`crate::bvh::World`]: a filter in f32 leaves few triangles to f64,
/// and fewer to exact arithmetic. It works best while triangles are larger than 10⁻⁶ of the world
/// and rays start within 10¹³ of its sizes. Beyond, answers are as exact and take longer.
///
/// ```
/// use rt_core::prelude::*;
///
/// // A millimetre of ground, in metres of a UTM zone: f32 has half a metre there.
/// let corner = DVec3::new(500_000.25, 5_400_000.5, 312.75);
/// let (east, north) = (DVec3::X * 1e-3, DVec3::Y * 1e-3);
/// let mesh = MeshF64::new(vec![corner, corner + east, corner + north], vec![[0, 1, 2]]);
/// let world = WorldF64::from_mesh(mesh, &BuildOptions::default())?;
/// let above = corner + (east + north) * 0.25 + DVec3::Z * 1000.0;
/// let hit = world.closest(&RayF64::new(above, DVec3::NEG_Z)).expect("straight above it");
/// assert_eq!((hit.t, hit.mesh, hit.prim), (1000.0, 0, 0));
/// assert!(!world.occluded(&RayF64::new(above + east, DVec3::NEG_Z)));
/// # Ok::<(), rt_core::bvh::BuildError>(())
/// ```
pub struct WorldF64 {
    pub(super) triangles: Numbered,
    pub(super) tree: Tree,
    pub(super) level: Level,
    report: BuildReport,
}

impl WorldF64 {
    /// Builds the tree of all meshes. They share it, in world coordinates.
    ///
    /// Triangles with coordinates that are not finite or indices out of range are left out and
    /// counted in the report.
    ///
    /// # Errors
    /// When the meshes have too many triangles together, or the machine lacks `options.simd`.
    pub fn build(
        meshes: Vec<Arc<MeshF64>>,
        options: &BuildOptions,
    ) -> Result<WorldF64, BuildError> {
        let start = Instant::now();
        let level = SimdLevel::resolve(options.simd)?;
        let mut all = 0usize;
        for (geometry, mesh) in meshes.iter().enumerate() {
            all = all.saturating_add(mesh.indices.len());
            if all >= MAX_PRIMS {
                let limit = MAX_PRIMS - 1;
                let source = MeshError::TooLarge { what: "triangles", found: all, limit };
                return Err(BuildError::Mesh { geometry, source });
            }
        }
        let triangles = Numbered::new(meshes);
        let mut tree = build_tree(&triangles, options.quality);
        let mut notes = std::mem::take(&mut tree.notes);
        if options.storage == Storage::Compact {
            notes.push(
                "storage `compact` is for meshes in f32; leaves here hold numbers of triangles, \
                 and the meshes keep their corners"
                    .into(),
            );
        }
        if options.robustness == Robustness::Fast {
            notes.push(
                "robustness `fast` has no effect on rays in f64: they are always watertight".into(),
            );
        }
        let total = start.elapsed();
        let report = BuildReport {
            total,
            phases: vec![("tree", total)],
            primitives: triangles.len() as usize - tree.skipped,
            skipped: tree.skipped,
            bytes: tree.bvh.units.len() * size_of::<Unit>(),
            depth: tree.bvh.depth,
            notes,
        };
        Ok(WorldF64 { triangles, tree, level, report })
    }

    /// A world of one mesh.
    ///
    /// # Errors
    /// As [`WorldF64::build`].
    pub fn from_mesh(
        mesh: impl Into<Arc<MeshF64>>,
        options: &BuildOptions,
    ) -> Result<WorldF64, BuildError> {
        WorldF64::build(vec![mesh.into()], options)
    }

    /// The meshes as given.
    pub fn meshes(&self) -> &[Arc<MeshF64>] {
        &self.triangles.meshes
    }

    /// The smallest and the largest corner of all triangles that can be hit; `None` without any.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        self.tree.bounds
    }

    /// Report on the build.
    pub fn report(&self) -> &BuildReport {
        &self.report
    }

    /// The closest hit along `ray`. Of hits at exactly the same distance, that of the lowest mesh's
    /// lowest triangle.
    pub fn closest(&self, ray: &RayF64) -> Option<HitF64> {
        if !ray.is_valid() {
            return None;
        }
        dispatch!(self.level, simd => self.closest_in(simd, ray))
    }

    /// Whether anything lies within `[t_min, t_max)` of `ray`.
    pub fn occluded(&self, ray: &RayF64) -> bool {
        ray.is_valid() && dispatch!(self.level, simd => self.occluded_in(simd, ray))
    }

    /// The point of a hit, from the triangle's corners: on the surface to an ulp or so of the
    /// corners, however far away the ray started. `None` for a hit of another world.
    ///
    /// ```
    /// use rt_core::prelude::*;
    ///
    /// let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
    /// let mesh = MeshF64::new(corners, vec![[0, 1, 2]]);
    /// let world = WorldF64::from_mesh(mesh, &BuildOptions::default())?;
    /// let from = DVec3::new(0.25, 0.5, 1e9);
    /// let hit: HitF64 = world.closest(&RayF64::new(from, DVec3::NEG_Z)).unwrap();
    /// assert_eq!(world.point_of_hit(&hit), Some(DVec3::new(0.25, 0.5, 0.0)));
    /// # Ok::<(), rt_core::bvh::BuildError>(())
    /// ```
    pub fn point_of_hit(&self, hit: &HitF64) -> Option<DVec3> {
        let mesh = self.triangles.meshes.get(hit.mesh as usize)?;
        let [a, b, c] = mesh.triangle(hit.prim as usize)?;
        Some(a + ((b - a) * hit.u + (c - a) * hit.v))
    }

    #[inline(never)]
    fn closest_in<S: Simd>(&self, simd: S, ray: &RayF64) -> Option<HitF64> {
        simd.vectorize(
            #[inline(always)]
            || {
                let (exact, reciprocals) = ExactRay::new(ray);
                let local = match LocalRay::start(&exact, reciprocals, &self.tree.frame) {
                    Start::Miss => return None,
                    Start::Everything => return self.closest_of_everything(ray),
                    Start::Tree(local) => local,
                };
                let ray = TreeRay { exact, local };
                let mut leaves = ClosestLeaf::new(&self.triangles, &ray);
                let tree = TreeView::all(&self.tree.bvh);
                traverse_body(simd, &tree, &ray.local.setup, ray.local.s_max, &mut leaves);
                self.hit(&ray.exact.ray, &leaves.nearest)
            },
        )
    }

    #[inline(never)]
    fn occluded_in<S: Simd>(&self, simd: S, ray: &RayF64) -> bool {
        simd.vectorize(
            #[inline(always)]
            || {
                let (exact, reciprocals) = ExactRay::new(ray);
                let local = match LocalRay::start(&exact, reciprocals, &self.tree.frame) {
                    Start::Miss => return false,
                    Start::Everything => return self.occluded_by_anything(ray),
                    Start::Tree(local) => local,
                };
                let ray = TreeRay { exact, local };
                let mut leaves = AnyLeaf::new(&self.triangles, &ray);
                let tree = TreeView::all(&self.tree.bvh);
                traverse_body(simd, &tree, &ray.local.setup, ray.local.s_max, &mut leaves);
                leaves.found
            },
        )
    }

    /// The hit that a search has found.
    #[inline(always)]
    pub(super) fn hit(&self, ray: &RayF64, nearest: &Nearest) -> Option<HitF64> {
        if !nearest.found {
            return None;
        }
        let corners = self.triangles.corners(nearest.number)?;
        let point = hit_point(ray, corners);
        let (mesh, prim) = self.triangles.place(nearest.number);
        Some(HitF64 { t: point.t, u: point.u, v: point.v, prim, mesh })
    }

    /// The closest hit, from a test of every triangle.
    #[cold]
    pub(super) fn closest_of_everything(&self, ray: &RayF64) -> Option<HitF64> {
        let (exact, _) = ExactRay::new(ray);
        let mut nearest = Nearest::none(exact.ray.t_max);
        for number in 0..self.triangles.len() {
            nearest.offer_undecided(&exact, &self.triangles, number);
        }
        self.hit(ray, &nearest)
    }

    #[cold]
    pub(super) fn occluded_by_anything(&self, ray: &RayF64) -> bool {
        let (exact, _) = ExactRay::new(ray);
        (0..self.triangles.len()).any(|number| crosses(&self.triangles, &exact, number))
    }
}

const _: () = assert!(LEAF_UNITS * size_of::<Unit>() == 160, "three cache lines");
