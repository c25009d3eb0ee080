//! Converts coordinates to `f32` relative to an origin, in parallel.

use crate::input::Points;
use rayon::prelude::*;
use rt_core::glam::{DVec3, Vec3};

/// Number of points per task.
const CHUNK: usize = 1 << 15;

/// Origin and offsets from it. For `f32` points these are zero and the points themselves, which
/// already have all the available precision.
pub(super) fn relative(points: &Points<'_>) -> (DVec3, Vec<Vec3>) {
    match points {
        Points::F32(p) => (DVec3::ZERO, vectors(p)),
        Points::F64(p) => {
            let origin = middle_if_far(p);
            let offset = |q: &[f64; 3]| (DVec3::from(*q) - origin).as_vec3();
            (origin, p.par_iter().with_min_len(CHUNK).map(offset).collect())
        }
    }
}

/// Copies the values.
pub(super) fn vectors(values: &[[f32; 3]]) -> Vec<Vec3> {
    values.par_iter().with_min_len(CHUNK).map(|v| Vec3::from(*v)).collect()
}

/// Middle of the finite points if they lie further from zero than from each other. Otherwise zero,
/// which leaves the points unchanged.
fn middle_if_far(points: &[[f64; 3]]) -> DVec3 {
    let empty = || (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (lo, hi) = points
        .par_chunks(CHUNK)
        .map(|chunk| {
            let finite = chunk.iter().map(|p| DVec3::from(*p)).filter(|p| p.is_finite());
            finite.fold(empty(), |(lo, hi), p| (lo.min(p), hi.max(p)))
        })
        .reduce(empty, |a, b| (a.0.min(b.0), a.1.max(b.1)));
    let middle = 0.5 * lo + 0.5 * hi;
    let far = middle.abs().max_element() > (hi - lo).max_element();
    if middle.is_finite() && far { middle.as_vec3().as_dvec3() } else { DVec3::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn millimetres_on_a_planet_survive() {
        let points = [[6.4e6, 1.0, 0.0], [6.4e6 + 0.001, 1.0, 0.0], [f64::NAN, 0.0, 0.0]];
        let (_, p) = relative(&Points::F64(&points));
        assert!((p[1].x - p[0].x - 0.001).abs() < 1e-6, "{p:?}");
        assert!(p[2].x.is_nan());
    }

    #[test]
    fn points_around_zero_are_not_changed() {
        let (origin, p) = relative(&Points::F64(&[[-1.0, 0.0, 0.25], [1.0, 3.0, 0.5]]));
        assert_eq!((origin, p[1]), (DVec3::ZERO, Vec3::new(1.0, 3.0, 0.5)));
    }
}
