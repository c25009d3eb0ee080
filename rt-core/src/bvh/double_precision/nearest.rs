//! The nearest triangle so far, and which of two is nearer.

use super::build::Numbered;
use super::crossing::{Bounds, ExactRay};
use glam::DVec3;
use std::cmp::Ordering;

/// The nearest hit so far.
#[derive(Debug, Clone, Copy)]
pub(super) struct Nearest {
    pub(super) number: u32,
    pub(super) found: bool,
    /// Of the hit's parameter. Until there is one, the ray's limit.
    pub(super) bounds: Bounds,
    /// Whether the bounds are those of f64.
    sharp: bool,
}

impl Nearest {
    pub(super) fn none(t_max: f64) -> Self {
        let bounds = Bounds { lo: t_max, hi: t_max };
        Nearest { number: 0, found: false, bounds, sharp: true }
    }

    /// Takes a triangle that is surely hit, or that may be, at a parameter within `bounds` if so.
    /// Returns whether it is the nearest now.
    #[inline(always)]
    pub(super) fn offer(
        &mut self,
        ray: &ExactRay,
        triangles: &Numbered,
        number: u32,
        bounds: Bounds,
        certain: bool,
    ) -> bool {
        if bounds.lo > self.bounds.hi {
            return false;
        }
        let in_range = bounds.lo >= ray.ray.t_min && bounds.hi < ray.ray.t_max;
        if certain && in_range && bounds.hi < self.bounds.lo {
            *self = Nearest { number, found: true, bounds, sharp: false };
            return true;
        }
        self.offer_undecided(ray, triangles, number)
    }

    /// Takes a triangle that may be hit.
    #[inline(never)]
    pub(super) fn offer_undecided(
        &mut self,
        ray: &ExactRay,
        triangles: &Numbered,
        number: u32,
    ) -> bool {
        if self.found && number == self.number {
            return false;
        }
        let Some(corners) = triangles.corners(number) else { return false };
        let Some(bounds) = ray.crossing(corners) else { return false };
        if self.found && !self.is_behind(ray, triangles, number, corners, bounds) {
            return false;
        }
        *self = Nearest { number, found: true, bounds, sharp: true };
        true
    }

    /// Whether another hit is nearer than this one, or as near with a lower number.
    fn is_behind(
        &mut self,
        ray: &ExactRay,
        triangles: &Numbered,
        number: u32,
        corners: [DVec3; 3],
        bounds: Bounds,
    ) -> bool {
        let Some(own) = triangles.corners(self.number) else { return true };
        if !self.sharp {
            self.bounds = ray.crossing(own).unwrap_or(self.bounds);
            self.sharp = true;
        }
        if bounds.hi < self.bounds.lo {
            return true;
        }
        if bounds.lo > self.bounds.hi {
            return false;
        }
        match ray.compare(corners, own) {
            Ordering::Less => true,
            Ordering::Equal => number < self.number,
            Ordering::Greater => false,
        }
    }
}
