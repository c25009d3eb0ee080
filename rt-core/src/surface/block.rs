//! Surface data of sixteen hits at once, for local lighting.
//!
//! Most of the time goes to memory access: a hit names a triangle, the triangle three vertices,
//! each of them a position and its attributes. The values of sixteen hits are read into rows first,
//! so that sixteen waits overlap. Then the arithmetic of [`ResolvedInstance::shading_point`] runs
//! on all lanes, with the same bits. Lanes that need f64 (tiny or huge triangles, normals that
//! cannot be normalised) are left to `shading_point` itself.

use super::triangle_rows::TriangleRows;
use super::{HitPoint, ORDINARY_NORMAL_SQUARED, ResolvedInstance, ShadingPoint, Source, plane_of};
use crate::bvh::traverse::block_hits::set_bits;
use crate::material::{ColorSource, Sides};
use crate::ray::{HitBlock, LANES, RayBlock};
use crate::simd::prefetch_item;
use crate::simd::vectors::{Row, Rows3, Vec3x16};
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x16, mask32x16};
use glam::{DVec3, Vec3};

/// Sixteen [`ShadingPoint`]s, one row per component.
#[repr(C, align(64))]
pub(crate) struct ShadingPointBlock {
    pub(crate) point: Rows3,
    pub(crate) normal: Rows3,
    pub(crate) color: Rows3,
    pub(crate) opacity: Row,
}

impl ShadingPointBlock {
    pub(crate) fn new() -> ShadingPointBlock {
        ShadingPointBlock {
            point: Rows3::ZERO,
            normal: Rows3::ZERO,
            color: Rows3::ZERO,
            opacity: [0.0; LANES],
        }
    }

    pub(crate) fn get(&self, lane: usize) -> ShadingPoint {
        ShadingPoint {
            point: self.point.get(lane),
            normal: self.normal.get(lane),
            color: self.color.get(lane),
            opacity: self.opacity[lane],
        }
    }

    fn set(&mut self, lane: usize, shading_point: &ShadingPoint) {
        self.point.set(lane, shading_point.point);
        self.normal.set(lane, shading_point.normal);
        self.color.set(lane, shading_point.color);
        self.opacity[lane] = shading_point.opacity;
    }
}

/// What a [`super::SurfacePoint`] has beyond a shading point.
#[repr(C, align(64))]
pub(crate) struct ExactRows {
    pub(crate) point: Rows3,
    /// Before orientation: unit normals that point outwards.
    pub(crate) face_normal: Rows3,
    pub(crate) point_error: Row,
    /// Bit per lane.
    pub(super) outside: u16,
}

impl ExactRows {
    pub(super) fn new() -> ExactRows {
        ExactRows {
            point: Rows3::ZERO,
            face_normal: Rows3::ZERO,
            point_error: [0.0; LANES],
            outside: 0,
        }
    }
}

/// World-space planes through sixteen hits, see [`ResolvedInstance::plane`].
#[repr(C, align(64))]
pub(crate) struct Planes {
    pub(crate) point: [[f64; LANES]; 3],
    pub(crate) normal: [[f64; LANES]; 3],
}

impl Planes {
    pub(crate) fn new() -> Planes {
        Planes { point: [[0.0; LANES]; 3], normal: [[0.0; LANES]; 3] }
    }
}

impl ResolvedInstance<'_> {
    /// Prefetches the vertex indices of triangle `prim`.
    #[inline]
    pub(crate) fn prefetch_triangle(&self, prim: u32) {
        if let Source::Mesh(mesh) = self.source {
            prefetch_item(&mesh.indices, prim as usize);
        }
    }

    /// Prefetches the vertex data of triangle `prim` that [`ResolvedInstance::shading_point_block`]
    /// will read.
    #[inline]
    pub(crate) fn prefetch_vertices(&self, prim: u32) {
        if let Source::Mesh(mesh) = self.source {
            for k in mesh.indices[prim as usize] {
                prefetch_item(&mesh.positions, k as usize);
                if let Some(n) = self.shading_normals(mesh) {
                    prefetch_item(&n.values, k as usize);
                }
                match (&self.material.color_source, self.scalars, self.colors) {
                    (ColorSource::Scalars(_), Some(s), _) => prefetch_item(&s.values, k as usize),
                    (ColorSource::Attribute, _, Some(c)) => prefetch_item(&c.values, k as usize),
                    _ => {}
                }
            }
        }
    }

    /// [`ResolvedInstance::shading_point`] for the hits whose bits are set in `lanes`, all of them
    /// on this instance; other lanes of `out` are undefined.
    pub(crate) fn shading_point_block<S: Simd, P: HitPoint>(
        &self,
        simd: S,
        lanes: u16,
        rays: &RayBlock,
        hits: &HitBlock,
        out: &mut ShadingPointBlock,
    ) {
        let mut triangles = TriangleRows::new();
        let found = self.triangle_rows(simd, lanes, rays, hits, &mut triangles);
        let done = if found == 0 {
            0
        } else {
            self.triangle_block::<S, P>(simd, &triangles, rays, hits, out)
        };
        let done = done & found;
        let mut left = lanes & !done;
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            if let Some(hit) = hits.get(lane) {
                out.set(lane, &self.shading_point::<P>(&rays.get(lane), &hit));
            }
        }
    }

    /// [`ResolvedInstance::plane`] for the hits whose bits are set in `lanes`, all of them on this
    /// instance.
    pub(crate) fn plane_block<S: Simd>(
        &self,
        simd: S,
        lanes: u16,
        rays: &RayBlock,
        hits: &HitBlock,
        origin: DVec3,
        out: &mut Planes,
    ) {
        let mut corners = [Rows3::ZERO; 3];
        let found = self.corner_rows(lanes, rays, hits, &mut corners);
        if found != 0 {
            self.triangle_planes(simd, &corners, found, hits, origin, out);
        }
        for lane in set_bits(lanes & !found) {
            if let Some(hit) = hits.get(lane) {
                let (point, normal) = self.plane(&rays.get(lane), &hit, origin);
                for c in 0..3 {
                    (out.point[c][lane], out.normal[c][lane]) = (point[c], normal[c]);
                }
            }
        }
    }

    #[inline(never)]
    fn triangle_planes<S: Simd>(
        &self,
        simd: S,
        corners: &[Rows3; 3],
        lanes: u16,
        hits: &HitBlock,
        origin: DVec3,
        out: &mut Planes,
    ) {
        simd.vectorize(
            #[inline(always)]
            || {
                let (moved, m) = (self.normal_from_object.is_some(), self.render_from_object);
                let mut all = Planes::new();
                for l in 0..LANES {
                    let at = [corners[0].get(l), corners[1].get(l), corners[2].get(l)];
                    let (p, n) = plane_of(at, [hits.u[l], hits.v[l]], moved, &m, origin);
                    (all.point[0][l], all.point[1][l], all.point[2][l]) = (p.x, p.y, p.z);
                    (all.normal[0][l], all.normal[1][l], all.normal[2][l]) = (n.x, n.y, n.z);
                }
                for c in 0..3 {
                    for l in 0..LANES {
                        let on = lanes >> l & 1 != 0;
                        out.point[c][l] = if on { all.point[c][l] } else { out.point[c][l] };
                        out.normal[c][l] = if on { all.normal[c][l] } else { out.normal[c][l] };
                    }
                }
            },
        );
    }

    /// Returns the lanes that it completed.
    #[inline(never)]
    fn triangle_block<S: Simd, P: HitPoint>(
        &self,
        simd: S,
        triangles: &TriangleRows,
        rays: &RayBlock,
        hits: &HitBlock,
        out: &mut ShadingPointBlock,
    ) -> u16 {
        let exact = &mut ExactRows::new();
        simd.vectorize(
            #[inline(always)]
            || self.triangle_block_body::<S, P>(simd, triangles, rays, hits, out, exact),
        )
    }

    /// With [`HitPoint::EXACT`], fills `exact` too.
    #[inline(always)]
    pub(super) fn triangle_block_body<S: Simd, P: HitPoint>(
        &self,
        simd: S,
        triangles: &TriangleRows,
        rays: &RayBlock,
        hits: &HitBlock,
        out: &mut ShadingPointBlock,
        exact: &mut ExactRows,
    ) -> u16 {
        let v = |x: f32| f32x16::splat(simd, x);
        let [a, b, c] = [0, 1, 2].map(|k| Vec3x16::load(simd, &triangles.corners[k]));
        let (u, w2) = (f32x16::from_slice(simd, &hits.u), f32x16::from_slice(simd, &hits.v));
        let dir = Vec3x16::load_rows(simd, [&rays.dx, &rays.dy, &rays.dz]);

        // ---- Face normal.
        let (e1, e2) = (b.sub(a), c.sub(a));
        let mut n = e1.cross(e2);
        if let Some(m) = &self.normal_from_object {
            n = n.transformed(simd, m);
        }
        let squared = n.dot(n);
        let mut done = squared.simd_ge(v(ORDINARY_NORMAL_SQUARED.start))
            & squared.simd_lt(v(ORDINARY_NORMAL_SQUARED.end));
        if P::EXACT {
            done = self.exact_points(simd, [a, b, c], &hits.u, &hits.v, exact);
        }

        // ---- Shading normal.
        let (outward, shading) = if triangles.has_normals {
            let mut s = Vec3x16::load(simd, &triangles.normals);
            if let Some(m) = &self.normal_from_object {
                s = s.transformed(simd, m);
            }
            let (unit, ok) = s.try_normalize(simd);
            done &= ok;
            let n = if P::EXACT { Vec3x16::load(simd, &exact.face_normal) } else { n };
            (n, unit)
        } else if P::EXACT {
            let unit = Vec3x16::load(simd, &exact.face_normal);
            (unit, unit)
        } else {
            let unit = n.scale(v(1.0) / squared.sqrt());
            (unit, unit)
        };

        // ---- Orientation: seen side and lit side.
        let zero = v(0.0);
        let outside = outward.dot(dir).simd_le(zero);
        let back = shading.neg();
        let (normal, drawn) = match self.material.sides {
            Sides::Both => (shading.or_else(outside, back), mask32x16::splat(simd, true)),
            Sides::BothByNormal => (
                shading.or_else(shading.dot(dir).simd_le(zero), back),
                mask32x16::splat(simd, true),
            ),
            Sides::LitOutside => (shading, mask32x16::splat(simd, true)),
            Sides::FrontOnly => (shading, outside),
            Sides::BackOnly => (back, !outside),
        };
        normal.store(&mut out.normal);
        if P::EXACT {
            outward.or_else(outside, outward.neg()).store(&mut exact.face_normal);
            exact.outside = outside.to_bitmask() as u16;
        }

        // ---- Point.
        if P::EXACT {
            out.point = exact.point;
        } else if P::COMPUTED {
            let inside = e1.scale(u).add(e2.scale(w2));
            let shift = Vec3x16::splat(simd, self.render_from_object.translation.as_vec3());
            let point = if self.normal_from_object.is_none() {
                a.add(shift).add(inside)
            } else {
                let m = &self.render_from_object.matrix3.as_mat3();
                a.transformed(simd, m).add(shift).add(inside.transformed(simd, m))
            };
            point.store(&mut out.point);
        }

        // ---- Colour.
        let alpha = if triangles.has_colors {
            let [r, g, b, a] = &triangles.colors;
            out.color.0 = [*r, *g, *b];
            f32x16::from_slice(simd, a)
        } else {
            Vec3x16::splat(simd, Vec3::from(self.material.color)).store(&mut out.color);
            v(1.0)
        };
        drawn.select(v(self.material.opacity) * alpha, zero).store_slice(&mut out.opacity);
        done.to_bitmask() as u16
    }
}
