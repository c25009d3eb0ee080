//! Rounds coordinates to integers, in which the predicates are exact.
//!
//! The step is the same along all axes, as circles must stay circles: 2^-40 of the longest side of
//! the box, or 1e-12. That is below the rounding of any file with fewer than twelve digits, and a
//! millionth of a boundary layer's first cell that is a millionth of the box.

use super::hilbert;
use rayon::prelude::*;

/// Bits of a coordinate.
pub(super) const BITS: u32 = 40;

/// Points as integers, in the order of a Hilbert curve, each place once.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Snapped {
    /// Coordinates from 0 to 2^40.
    pub(super) places: Vec<[i64; 3]>,
    /// The number in `places` of each point that was given.
    pub(crate) place_of: Vec<u32>,
}

impl Snapped {
    /// Rounds points, which must be finite and fewer than 2^32 - 1. Points that fall on the same
    /// integers are one place.
    pub(crate) fn new(points: &[[f64; 3]]) -> Snapped {
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        for p in points {
            for a in 0..3 {
                low[a] = low[a].min(p[a]);
                high[a] = high[a].max(p[a]);
            }
        }
        // Halves, so that no difference of finite numbers overflows.
        let side = (0..3).map(|a| 0.5 * high[a] - 0.5 * low[a]).fold(0.0, f64::max);
        let steps = (1u64 << (BITS - 1)) as f64;
        let round = |p: &[f64; 3]| {
            [0, 1, 2].map(|a| match side > 0.0 {
                true => ((0.5 * p[a] - 0.5 * low[a]) / side * 2.0 * steps).round() as i64,
                false => 0,
            })
        };
        // With the places in the key, the order does not depend on that of the points.
        let mut keyed: Vec<(u64, [i64; 3], u32)> = points
            .par_iter()
            .enumerate()
            .map(|(i, p)| {
                let place = round(p);
                (
                    hilbert::index(place.map(|x| (x >> (BITS + 1 - hilbert::BITS)) as u32)),
                    place,
                    i as u32,
                )
            })
            .collect();
        keyed.par_sort_unstable();
        let mut places: Vec<[i64; 3]> = Vec::with_capacity(points.len());
        let mut place_of = vec![0; points.len()];
        for (_, place, point) in keyed {
            if places.last() != Some(&place) {
                places.push(place);
            }
            place_of[point as usize] = (places.len() - 1) as u32;
        }
        Snapped { places, place_of }
    }

    /// Number of different places.
    pub(crate) fn len(&self) -> usize {
        self.places.len()
    }
}
