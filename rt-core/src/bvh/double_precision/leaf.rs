//! Leaf tests of the traversal: the filter, and what it leaves open.

use super::build::{Numbered, leaf_floats, leaf_number};
use super::crossing::{Bounds, ExactRay};
use super::filter::{Filtered, filter};
use super::local_ray::LocalRay;
use super::nearest::Nearest;
use crate::bvh::layout::wide::{ChildRef, Unit, WIDTH};
use crate::bvh::query::{AnyHit, ClosestHit};
use crate::bvh::traverse::single::{LeafTest, inflate_t};
use crate::stats::{Counter, count};
use fearless_simd::Simd;

/// A ray, in f64 and for the tree.
#[derive(Clone, Copy)]
pub(super) struct TreeRay {
    pub(super) exact: ExactRay,
    pub(super) local: LocalRay,
}

/// A search that goes on from subtree to subtree.
pub(super) trait Search<S: Simd>: LeafTest<S> + Copy {
    /// Boxes that the f32 ray enters beyond this are left out.
    fn limit(&self) -> f32;

    /// Whether nothing more needs to be visited.
    fn is_over(&self) -> bool;
}

/// Lanes of the pair that hold triangles: leaves may be partly filled, and a leaf alone comes
/// twice.
#[inline(always)]
fn filled(first: ChildRef, second: Option<ChildRef>) -> u32 {
    let lanes = |leaf: ChildRef| (1u32 << leaf.count()) - 1;
    lanes(first) | second.map_or(0, |leaf| lanes(leaf) << 4)
}

/// Calls `$test` with each pair of the leaves in `$leaves` until it returns true.
macro_rules! pairs {
    ($refs:ident, $leaves:ident, |$first:ident, $second:ident| $test:expr) => {
        loop {
            let $first = ChildRef($refs[$leaves.trailing_zeros() as usize & 7]);
            $leaves &= $leaves - 1;
            let next = ChildRef($refs[$leaves.trailing_zeros() as usize & 7]);
            let $second = ($leaves != 0).then_some(next);
            $leaves &= $leaves.wrapping_sub(1);
            if $test {
                return true;
            }
            if $leaves == 0 {
                return false;
            }
        }
    };
}

/// Looks for the closest hit.
#[derive(Clone, Copy)]
pub(super) struct ClosestLeaf<'r> {
    triangles: &'r Numbered,
    ray: &'r TreeRay,
    pub(super) nearest: Nearest,
    limit: f32,
}

impl<'r> ClosestLeaf<'r> {
    #[inline(always)]
    pub(super) fn new(triangles: &'r Numbered, ray: &'r TreeRay) -> Self {
        let nearest = Nearest::none(ray.exact.ray.t_max);
        ClosestLeaf { triangles, ray, nearest, limit: ray.local.s_max }
    }

    #[inline(always)]
    fn pair<S: Simd>(
        &mut self,
        simd: S,
        units: &[Unit],
        first: ChildRef,
        second: Option<ChildRef>,
        skip_t: &mut f32,
    ) {
        count(Counter::Primitives, 2);
        let floats = [leaf_floats(units, first), leaf_floats(units, second.unwrap_or(first))];
        let local = &self.ray.local;
        let Some(found) = filter(simd, floats, &local.setup) else { return };
        let Filtered { possible, certain, near, far } = found;
        let mut lanes = possible & filled(first, second);
        while lanes != 0 {
            let i = lanes.trailing_zeros() as usize & 7;
            lanes &= lanes - 1;
            if near[i] > *skip_t {
                continue;
            }
            let number = leaf_number(floats[i >> 2], i);
            let bounds = Bounds { lo: local.t_below(near[i]), hi: local.t_above(far[i]) };
            let certain = certain >> i & 1 == 1;
            let nearest = &mut self.nearest;
            if nearest.offer(&self.ray.exact, self.triangles, number, bounds, certain) {
                self.limit = local.s_above(nearest.bounds.hi);
                *skip_t = inflate_t(self.limit);
            }
        }
    }
}

impl<S: Simd> LeafTest<S> for ClosestLeaf<'_> {
    type Query = ClosestHit;
    const TOGETHER: bool = true;

    #[inline(always)]
    fn test_many(
        &mut self,
        simd: S,
        units: &[Unit],
        refs: &[u32; WIDTH],
        mut leaves: u32,
        skip_t: &mut f32,
    ) -> bool {
        pairs!(refs, leaves, |first, second| {
            self.pair(simd, units, first, second, skip_t);
            false
        })
    }

    #[inline(always)]
    fn test(&mut self, simd: S, units: &[Unit], leaf: ChildRef, skip_t: &mut f32) -> bool {
        self.pair(simd, units, leaf, None, skip_t);
        false
    }
}

impl<S: Simd> Search<S> for ClosestLeaf<'_> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.limit
    }

    #[inline(always)]
    fn is_over(&self) -> bool {
        false
    }
}

/// Looks for any hit.
#[derive(Clone, Copy)]
pub(super) struct AnyLeaf<'r> {
    triangles: &'r Numbered,
    ray: &'r TreeRay,
    pub(super) found: bool,
}

impl<'r> AnyLeaf<'r> {
    #[inline(always)]
    pub(super) fn new(triangles: &'r Numbered, ray: &'r TreeRay) -> Self {
        AnyLeaf { triangles, ray, found: false }
    }

    #[inline(always)]
    fn pair<S: Simd>(
        &mut self,
        simd: S,
        units: &[Unit],
        first: ChildRef,
        second: Option<ChildRef>,
    ) -> bool {
        count(Counter::Primitives, 2);
        let floats = [leaf_floats(units, first), leaf_floats(units, second.unwrap_or(first))];
        let TreeRay { exact, local } = self.ray;
        let Some(found) = filter(simd, floats, &local.setup) else { return false };
        let Filtered { possible, certain, near, far } = found;
        let mut lanes = possible & filled(first, second);
        while lanes != 0 {
            let i = lanes.trailing_zeros() as usize & 7;
            lanes &= lanes - 1;
            let bounds = Bounds { lo: local.t_below(near[i]), hi: local.t_above(far[i]) };
            let (t_min, t_max) = (exact.ray.t_min, exact.ray.t_max);
            if bounds.hi < t_min || bounds.lo >= t_max {
                continue;
            }
            let certain = certain >> i & 1 == 1 && bounds.lo >= t_min && bounds.hi < t_max;
            if certain || crosses(self.triangles, exact, leaf_number(floats[i >> 2], i)) {
                self.found = true;
                return true;
            }
        }
        false
    }
}

/// Whether a ray hits a triangle within its range.
#[inline(never)]
pub(super) fn crosses(triangles: &Numbered, ray: &ExactRay, number: u32) -> bool {
    triangles.corners(number).is_some_and(|corners| ray.crossing(corners).is_some())
}

impl<S: Simd> LeafTest<S> for AnyLeaf<'_> {
    type Query = AnyHit;
    const TOGETHER: bool = true;

    #[inline(always)]
    fn test_many(
        &mut self,
        simd: S,
        units: &[Unit],
        refs: &[u32; WIDTH],
        mut leaves: u32,
        _: &mut f32,
    ) -> bool {
        pairs!(refs, leaves, |first, second| self.pair(simd, units, first, second))
    }

    #[inline(always)]
    fn test(&mut self, simd: S, units: &[Unit], leaf: ChildRef, _: &mut f32) -> bool {
        self.pair(simd, units, leaf, None)
    }
}

impl<S: Simd> Search<S> for AnyLeaf<'_> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.ray.local.s_max
    }

    #[inline(always)]
    fn is_over(&self) -> bool {
        self.found
    }
}
