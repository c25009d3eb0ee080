//! A builder's reference to a primitive: its box and its number.

use crate::math::Aabb;
use fearless_simd::{Simd, SimdBase, f32x8};
use glam::Vec4;

/// Box and number of a primitive in 32 bytes.
///
/// Layout: low corner, number, negative high corner, −2. With the high corner negated, one minimum
/// over eight lanes grows a box.
///
/// The number has bit 30 set, so that it reads as an ordinary float. A plain small integer would be
/// a denormal, and vector additions that touch denormals are a hundred times slower on some
/// machines.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(32))]
pub(crate) struct PrimRef([f32; 8]);

const TAG: u32 = 1 << 30;

/// The largest number of primitives. A larger tagged number would read as infinity or NaN.
pub(crate) const MAX_PRIMS: usize = 0x3f80_0000;

impl PrimRef {
    pub(crate) fn new(b: Aabb, id: u32) -> Self {
        debug_assert!((id as usize) < MAX_PRIMS, "primitive number {id} too large");
        let (lo, hi) = (b.min, b.max);
        PrimRef([lo.x, lo.y, lo.z, f32::from_bits(TAG | id), -hi.x, -hi.y, -hi.z, -2.0])
    }

    #[inline(always)]
    pub(crate) fn id(&self) -> u32 {
        self.0[3].to_bits() & !TAG
    }

    #[cfg(test)]
    pub(crate) fn bounds(&self) -> Aabb {
        Aabb::new(self.lo().truncate(), self.hi().truncate())
    }

    /// Whether the box is empty, so there is nothing to build.
    #[inline(always)]
    pub(crate) fn is_empty(&self) -> bool {
        self.0[0] > -self.0[4]
    }

    #[inline(always)]
    fn lo(&self) -> Vec4 {
        Vec4::from_slice(&self.0[..4])
    }

    #[inline(always)]
    fn hi(&self) -> Vec4 {
        -Vec4::from_slice(&self.0[4..])
    }

    /// Twice the centre. The fourth lane is meaningless.
    #[inline(always)]
    pub(crate) fn center2(&self) -> Vec4 {
        self.lo() - Vec4::from_slice(&self.0[4..])
    }
}

/// Bounds of a set of primitives, and bounds of twice their centres. The fourth lanes are
/// meaningless.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SetBounds {
    pub(crate) lo: Vec4,
    pub(crate) hi: Vec4,
    pub(crate) center2_lo: Vec4,
    pub(crate) center2_hi: Vec4,
}

impl SetBounds {
    pub(crate) const EMPTY: SetBounds = SetBounds {
        lo: Vec4::INFINITY,
        hi: Vec4::NEG_INFINITY,
        center2_lo: Vec4::INFINITY,
        center2_hi: Vec4::NEG_INFINITY,
    };

    #[inline(always)]
    pub(crate) fn grow(&mut self, p: &PrimRef) {
        let c = p.center2();
        self.lo = self.lo.min(p.lo());
        self.hi = self.hi.max(p.hi());
        self.center2_lo = self.center2_lo.min(c);
        self.center2_hi = self.center2_hi.max(c);
    }

    /// Grows only the bounds of the centres.
    #[inline(always)]
    pub(crate) fn grow_centers(&mut self, p: &PrimRef) {
        let c = p.center2();
        self.center2_lo = self.center2_lo.min(c);
        self.center2_hi = self.center2_hi.max(c);
    }

    #[inline(always)]
    pub(crate) fn set_box(&mut self, b: Box4) {
        (self.lo, self.hi) = (Vec4::from_slice(&b.0[..4]), -Vec4::from_slice(&b.0[4..]));
    }

    pub(crate) fn union(&self, o: &SetBounds) -> SetBounds {
        SetBounds {
            lo: self.lo.min(o.lo),
            hi: self.hi.max(o.hi),
            center2_lo: self.center2_lo.min(o.center2_lo),
            center2_hi: self.center2_hi.max(o.center2_hi),
        }
    }

    pub(crate) fn of(refs: &[PrimRef]) -> SetBounds {
        let mut b = SetBounds::EMPTY;
        for p in refs {
            b.grow(p);
        }
        b
    }

    pub(crate) fn aabb(&self) -> Aabb {
        Aabb::new(self.lo.truncate(), self.hi.truncate())
    }
}

/// A box in the layout of a [`PrimRef`]; accumulates the bounds of a bin.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(32))]
pub(crate) struct Box4([f32; 8]);

impl Box4 {
    pub(crate) const EMPTY: Box4 = Box4([f32::INFINITY; 8]);

    #[inline(always)]
    pub(crate) fn grow<S: Simd>(&mut self, simd: S, p: &PrimRef) {
        f32x8::from_slice(simd, &self.0)
            .min(f32x8::from_slice(simd, &p.0))
            .store_slice(&mut self.0);
    }

    #[inline(always)]
    pub(crate) fn union<S: Simd>(&mut self, simd: S, o: &Box4) {
        f32x8::from_slice(simd, &self.0)
            .min(f32x8::from_slice(simd, &o.0))
            .store_slice(&mut self.0);
    }

    /// The box around all of `boxes`.
    #[inline(always)]
    pub(crate) fn around<S: Simd>(simd: S, boxes: &[Box4]) -> Box4 {
        let mut all = Box4::EMPTY;
        for one in boxes {
            all.union(simd, one);
        }
        all
    }

    /// Half the surface area. Only called on boxes that are not empty.
    #[inline(always)]
    pub(crate) fn half_area(&self) -> f32 {
        let [lx, ly, lz, _, hx, hy, hz, _] = self.0;
        let (x, y, z) = (-hx - lx, -hy - ly, -hz - lz);
        x * y + y * z + z * x
    }
}
