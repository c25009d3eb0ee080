//! Surface points of sixteen hits at once, from which rays can start.
//!
//! What [`super::block`] does for local lighting, with point and face normal in f64 as
//! [`ResolvedInstance::surface`] computes them: the same bits. Lanes without a face normal or a
//! shading normal are left to that function.

use super::block::{ExactRows, ShadingPointBlock};
use super::triangle_rows::TriangleRows;
use super::{HitPoint, POINT_ERROR, ResolvedInstance, SurfacePoint};
use crate::ray::{HitBlock, LANES, RayBlock};
use crate::simd::vectors::{Row, Rows3, Vec3x16};
use fearless_simd::{Simd, SimdBase, f32x16, mask32x16};

/// Sixteen [`SurfacePoint`]s, one row per component.
pub(crate) struct SurfacePointBlock {
    shading: ShadingPointBlock,
    exact: ExactRows,
}

/// Rays will start at the point.
struct ExactPoint;

impl HitPoint for ExactPoint {
    const COMPUTED: bool = true;
    const EXACT: bool = true;
}

impl SurfacePointBlock {
    pub(crate) fn new() -> SurfacePointBlock {
        SurfacePointBlock { shading: ShadingPointBlock::new(), exact: ExactRows::new() }
    }

    /// Normals, colours and opacities, and what rays that start here need.
    #[inline(always)]
    pub(crate) fn rows(&self) -> (&ShadingPointBlock, &ExactRows) {
        (&self.shading, &self.exact)
    }

    pub(crate) fn set(&mut self, lane: usize, s: &SurfacePoint) {
        let SurfacePointBlock { shading, exact } = self;
        exact.point.set(lane, s.point);
        exact.point_error[lane] = s.point_error;
        exact.face_normal.set(lane, s.face_normal);
        shading.normal.set(lane, s.normal);
        exact.outside = exact.outside & !(1 << lane) | (s.outside as u16) << lane;
        shading.color.set(lane, s.color);
        shading.opacity[lane] = s.opacity;
    }

    #[inline(always)]
    pub(crate) fn get(&self, lane: usize) -> SurfacePoint {
        SurfacePoint {
            point: self.exact.point.get(lane),
            point_error: self.exact.point_error[lane],
            face_normal: self.exact.face_normal.get(lane),
            normal: self.shading.normal.get(lane),
            outside: self.exact.outside >> lane & 1 != 0,
            color: self.shading.color.get(lane),
            opacity: self.shading.opacity[lane],
        }
    }
}

impl ResolvedInstance<'_> {
    /// [`ResolvedInstance::surface`] for hits of `lanes`, all of them on this instance. Returns the
    /// lanes that it completed; other lanes of `out` are undefined.
    pub(crate) fn surface_block<S: Simd>(
        &self,
        simd: S,
        lanes: u16,
        rays: &RayBlock,
        hits: &HitBlock,
        out: &mut SurfacePointBlock,
    ) -> u16 {
        let mut triangles = TriangleRows::new();
        match self.triangle_rows(simd, lanes, rays, hits, &mut triangles) {
            0 => 0,
            found => found & self.triangle_points(simd, &triangles, rays, hits, out),
        }
    }

    #[inline(never)]
    fn triangle_points<S: Simd>(
        &self,
        simd: S,
        triangles: &TriangleRows,
        rays: &RayBlock,
        hits: &HitBlock,
        SurfacePointBlock { shading, exact }: &mut SurfacePointBlock,
    ) -> u16 {
        simd.vectorize(
            #[inline(always)]
            || {
                self.triangle_block_body::<S, ExactPoint>(
                    simd, triangles, rays, hits, shading, exact,
                )
            },
        )
    }

    /// Points, outward face normals and errors. Returns the lanes that have a normal.
    #[inline(always)]
    pub(super) fn exact_points<S: Simd>(
        &self,
        simd: S,
        corners: [Vec3x16<S>; 3],
        u: &Row,
        v: &Row,
        out: &mut ExactRows,
    ) -> mask32x16<S> {
        let mut rows = [Rows3::ZERO; 3];
        for k in 0..3 {
            corners[k].store(&mut rows[k]);
        }
        let moved = self.normal_from_object.is_some();
        let mut positive = [0.0; LANES];
        // Loops over lanes of f64 numbers are vectorized by the compiler.
        for l in 0..LANES {
            let at = [rows[0].get(l), rows[1].get(l), rows[2].get(l)];
            let (point, n) = self.point_and_cross(at, [u[l], v[l]], moved);
            let length = n.length();
            out.point.set(l, point.as_vec3());
            out.face_normal.set(l, (n / length).as_vec3());
            positive[l] = if length > 0.0 { 1.0 } else { 0.0 };
        }
        let splat = |x: f32| f32x16::splat(simd, x);
        let coordinates =
            corners[0].max_norm().max(corners[1].max_norm()).max(corners[2].max_norm());
        let mut error = splat(POINT_ERROR) * coordinates * splat(self.stretch);
        if self.moved {
            let point = Vec3x16::load(simd, &out.point);
            error += splat(POINT_ERROR) * point.max_norm();
        }
        error.store_slice(&mut out.point_error);
        f32x16::from_slice(simd, &positive).simd_gt(splat(0.0))
    }
}
