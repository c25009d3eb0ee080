//! What a builder knows of a primitive: its box and its number.

use crate::math::Aabb;
use glam::Vec4;

/// Box and number of a primitive in 32 bytes.
///
/// The number sits in the low box's fourth lane with bit 30 set, so that it reads as an ordinary float: a plain small integer would be
/// a denormal, and vector additions that touch denormals are a hundred times slower on some machines.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(32))]
pub(crate) struct PrimRef {
    lo: Vec4,
    hi: Vec4,
}

const TAG: u32 = 1 << 30;

/// The largest number of primitives: beyond it the tagged number would read as infinity or NaN.
pub(crate) const MAX_PRIMS: usize = 0x3f80_0000;

impl PrimRef {
    pub(crate) fn new(b: Aabb, id: u32) -> Self {
        debug_assert!((id as usize) < MAX_PRIMS, "primitive number {id} too large");
        PrimRef { lo: b.min.extend(f32::from_bits(TAG | id)), hi: b.max.extend(2.0) }
    }

    #[inline(always)]
    pub(crate) fn id(&self) -> u32 {
        self.lo.w.to_bits() & !TAG
    }

    /// Made from an empty box: nothing to build.
    #[inline(always)]
    pub(crate) fn is_empty(&self) -> bool {
        self.lo.x > self.hi.x
    }

    pub(crate) fn bounds(&self) -> Aabb {
        Aabb::new(self.lo.truncate(), self.hi.truncate())
    }

    /// Twice the centre; the fourth lane is meaningless.
    #[inline(always)]
    pub(crate) fn center2(&self) -> Vec4 {
        self.lo + self.hi
    }
}

/// Box of a set of primitives and box of twice their centres. The fourth lanes are meaningless.
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
        self.lo = self.lo.min(p.lo);
        self.hi = self.hi.max(p.hi);
        self.center2_lo = self.center2_lo.min(c);
        self.center2_hi = self.center2_hi.max(c);
    }

    /// Grows the box of the centres alone.
    #[inline(always)]
    pub(crate) fn grow_centers(&mut self, p: &PrimRef) {
        let c = p.center2();
        self.center2_lo = self.center2_lo.min(c);
        self.center2_hi = self.center2_hi.max(c);
    }

    #[inline(always)]
    pub(crate) fn set_box(&mut self, b: Box4) {
        (self.lo, self.hi) = (b.lo, b.hi);
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

/// Box alone, four lanes: what a bin accumulates.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Box4 {
    lo: Vec4,
    hi: Vec4,
}

impl Box4 {
    pub(crate) const EMPTY: Box4 = Box4 { lo: Vec4::INFINITY, hi: Vec4::NEG_INFINITY };

    #[inline(always)]
    pub(crate) fn grow(&mut self, p: &PrimRef) {
        self.lo = self.lo.min(p.lo);
        self.hi = self.hi.max(p.hi);
    }

    #[inline(always)]
    pub(crate) fn union(&mut self, o: &Box4) {
        self.lo = self.lo.min(o.lo);
        self.hi = self.hi.max(o.hi);
    }

    /// Half the surface area; only called on boxes that hold something.
    #[inline(always)]
    pub(crate) fn half_area(&self) -> f32 {
        let e = self.hi - self.lo;
        e.x * e.y + e.y * e.z + e.z * e.x
    }
}
