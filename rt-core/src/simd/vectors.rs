//! Arithmetic on sixteen three-dimensional vectors at a time. Operations are those of glam's
//! `Vec3`, in the same order and without fused multiply-add, so each lane has the bits of the same
//! arithmetic on one `Vec3`, with every instruction set.

use crate::ray::LANES;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, f32x16, mask32x16};
use glam::{Mat3, Vec3};

/// Sixteen numbers in memory.
pub(crate) type Row = [f32; LANES];

/// Sixteen vectors in memory, one row per component.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct Rows3(pub(crate) [Row; 3]);

impl Rows3 {
    pub(crate) const ZERO: Rows3 = Rows3([[0.0; LANES]; 3]);

    #[inline(always)]
    pub(crate) fn get(&self, lane: usize) -> Vec3 {
        Vec3::new(self.0[0][lane], self.0[1][lane], self.0[2][lane])
    }

    #[inline(always)]
    pub(crate) fn set(&mut self, lane: usize, v: Vec3) {
        (self.0[0][lane], self.0[1][lane], self.0[2][lane]) = (v.x, v.y, v.z);
    }
}

/// Sixteen vectors in registers.
#[derive(Clone, Copy)]
pub(crate) struct Vec3x16<S: Simd> {
    pub(crate) x: f32x16<S>,
    pub(crate) y: f32x16<S>,
    pub(crate) z: f32x16<S>,
}

impl<S: Simd> Vec3x16<S> {
    #[inline(always)]
    pub(crate) fn splat(simd: S, v: Vec3) -> Self {
        let s = |x| f32x16::splat(simd, x);
        Vec3x16 { x: s(v.x), y: s(v.y), z: s(v.z) }
    }

    #[inline(always)]
    pub(crate) fn load(simd: S, rows: &Rows3) -> Self {
        Self::load_rows(simd, [&rows.0[0], &rows.0[1], &rows.0[2]])
    }

    #[inline(always)]
    pub(crate) fn load_rows(simd: S, [x, y, z]: [&Row; 3]) -> Self {
        Vec3x16 {
            x: f32x16::from_slice(simd, x),
            y: f32x16::from_slice(simd, y),
            z: f32x16::from_slice(simd, z),
        }
    }

    #[inline(always)]
    pub(crate) fn store(self, rows: &mut Rows3) {
        self.x.store_slice(&mut rows.0[0]);
        self.y.store_slice(&mut rows.0[1]);
        self.z.store_slice(&mut rows.0[2]);
    }

    #[inline(always)]
    pub(crate) fn add(self, o: Self) -> Self {
        Vec3x16 { x: self.x + o.x, y: self.y + o.y, z: self.z + o.z }
    }

    #[inline(always)]
    pub(crate) fn sub(self, o: Self) -> Self {
        Vec3x16 { x: self.x - o.x, y: self.y - o.y, z: self.z - o.z }
    }

    /// Componentwise product.
    #[inline(always)]
    pub(crate) fn mul(self, o: Self) -> Self {
        Vec3x16 { x: self.x * o.x, y: self.y * o.y, z: self.z * o.z }
    }

    /// Each vector times its own scalar.
    #[inline(always)]
    pub(crate) fn scale(self, s: f32x16<S>) -> Self {
        Vec3x16 { x: self.x * s, y: self.y * s, z: self.z * s }
    }

    /// Each vector divided by its own scalar.
    #[inline(always)]
    pub(crate) fn div(self, s: f32x16<S>) -> Self {
        Vec3x16 { x: self.x / s, y: self.y / s, z: self.z / s }
    }

    #[inline(always)]
    pub(crate) fn neg(self) -> Self {
        Vec3x16 { x: -self.x, y: -self.y, z: -self.z }
    }

    /// Each vector's maximum norm: the magnitude of its largest component.
    #[inline(always)]
    pub(crate) fn max_norm(self) -> f32x16<S> {
        self.x.abs().max(self.y.abs()).max(self.z.abs())
    }

    #[inline(always)]
    pub(crate) fn dot(self, o: Self) -> f32x16<S> {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    #[inline(always)]
    pub(crate) fn cross(self, o: Self) -> Self {
        Vec3x16 {
            x: self.y * o.z - o.y * self.z,
            y: self.z * o.x - o.z * self.x,
            z: self.x * o.y - o.x * self.y,
        }
    }

    /// `m` times each vector.
    #[inline(always)]
    pub(crate) fn transformed(self, simd: S, m: &Mat3) -> Self {
        let column = |c: Vec3| Self::splat(simd, c);
        column(m.x_axis)
            .scale(self.x)
            .add(column(m.y_axis).scale(self.y))
            .add(column(m.z_axis).scale(self.z))
    }

    /// `self` where `mask` is set, `o` elsewhere.
    #[inline(always)]
    pub(crate) fn or_else(self, mask: mask32x16<S>, o: Self) -> Self {
        Vec3x16 {
            x: mask.select(self.x, o.x),
            y: mask.select(self.y, o.y),
            z: mask.select(self.z, o.z),
        }
    }

    /// Like `Vec3::try_normalize`: unit vectors, and a mask of the lanes where normalising
    /// succeeded.
    #[inline(always)]
    pub(crate) fn try_normalize(self, simd: S) -> (Self, mask32x16<S>) {
        let r = f32x16::splat(simd, 1.0) / self.dot(self).sqrt();
        (
            self.scale(r),
            r.simd_gt(f32x16::splat(simd, 0.0)) & r.simd_lt(f32x16::splat(simd, f32::INFINITY)),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_shapes::Random;
    use fearless_simd::{Level, dispatch};

    #[test]
    fn lanes_have_the_bits_of_single_vectors() {
        let mut r = Random::new(5);
        let mut some = || {
            let mut rows = Rows3::ZERO;
            for lane in 0..LANES {
                rows.set(lane, r.direction() * (r.unit() * 3.0));
            }
            rows
        };
        let (a, b) = (some(), some());
        let m = Mat3::from_cols(
            Vec3::new(1.5, -0.3, 0.1),
            Vec3::new(0.2, 0.7, -2.0),
            Vec3::new(0.4, 3.1, 0.9),
        );
        dispatch!(Level::new(), simd => {
            let (va, vb) = (Vec3x16::load(simd, &a), Vec3x16::load(simd, &b));
            let mut out = [Rows3::ZERO; 3];
            va.cross(vb).store(&mut out[0]);
            va.try_normalize(simd).0.store(&mut out[1]);
            va.transformed(simd, &m).store(&mut out[2]);
            let dot = va.dot(vb);
            for lane in 0..LANES {
                let (p, q) = (a.get(lane), b.get(lane));
                assert_eq!(out[0].get(lane), p.cross(q));
                assert_eq!(out[1].get(lane), p.normalize());
                assert_eq!(out[2].get(lane), m * p);
                assert_eq!(dot.as_slice()[lane], p.dot(q));
            }
        });
    }
}
