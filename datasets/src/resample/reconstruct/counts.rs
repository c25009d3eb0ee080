//! How many values a polynomial is fitted to.

use super::polynomial::TERMS_TO_DEGREE;
use glam::{DMat3, DVec3};

/// Squares of distances from a plane or a line, as a part of all, that are still in it.
const FLATNESS: f64 = 1e-6;

/// Numbers of values, by the dimension of the space that they lie in: along a line, in a plane (a
/// layer of cells), and in space. With the numbers of space, a polynomial in a plane would reach
/// over seven cells, and bells of six cells lost 8 % of their gradients.
#[derive(Debug, Clone, Copy)]
pub(super) struct Counts {
    /// Number of the nearest values that a polynomial is fitted to, two for each unknown. (In space
    /// with 32, a power hangs on one value in some cells; with 56, nothing gains.)
    pub(super) nearest: usize,
    /// As many when these leave a power undetermined, as at borders.
    pub(super) more: usize,
    /// Number of the nearest values that a polynomial of fourth degree is fitted to.
    pub(super) quartic: usize,
    /// Number of samples of a spline: on a grid, those that share a cell.
    pub(super) adjacent: usize,
    /// The nearest of them, as on a grid. The spline gives each a quarter of the point's own
    /// weight.
    pub(super) next: usize,
    /// Number of monomials of degree 1 to the given one.
    pub(super) terms: [usize; 4],
}

const COUNTS: [Counts; 3] = [
    Counts { nearest: 6, more: 24, quartic: 8, adjacent: 2, next: 2, terms: [0, 1, 2, 3] },
    Counts { nearest: 16, more: 60, quartic: 28, adjacent: 8, next: 4, terms: [0, 2, 5, 9] },
    Counts { nearest: 40, more: 120, quartic: 68, adjacent: 26, next: 6, terms: TERMS_TO_DEGREE },
];

impl Counts {
    /// For values at places relative to a point. A `free` one has no value itself, and its plane or
    /// line need not go through it.
    pub(super) fn of(places: impl Iterator<Item = DVec3> + Clone, free: bool) -> Counts {
        let count = places.clone().count().max(1) as f64;
        let middle = if free { places.clone().sum::<DVec3>() / count } else { DVec3::ZERO };
        let mut m = DMat3::ZERO;
        for place in places {
            let d = place - middle;
            m += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        }
        let trace = m.x_axis.x + m.y_axis.y + m.z_axis.z;
        // Elimination with the largest pivots. What is left is beside the line or the plane.
        let mut dimension = 0;
        while dimension < 3 {
            let diagonal = DVec3::new(m.x_axis.x, m.y_axis.y, m.z_axis.z);
            let largest = diagonal.max_position();
            let pivot = diagonal[largest];
            if pivot.is_nan() || pivot <= FLATNESS * trace {
                break;
            }
            let column = m.col(largest);
            let share = column / pivot;
            m -= DMat3::from_cols(column * share.x, column * share.y, column * share.z);
            dimension += 1;
        }
        COUNTS[dimension.max(1) - 1]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Places -2..=2 along so many axes, at height `z`.
    fn grid(axes: usize, z: f64) -> Vec<DVec3> {
        let steps = |axis: usize| if axis < axes { -2..=2 } else { 0..=0 };
        let mut places = vec![];
        for i in steps(0) {
            for j in steps(1) {
                for k in steps(2) {
                    let turned = DVec3::new(0.6 * i as f64 - 0.8 * j as f64, j as f64, k as f64);
                    places.push(turned + z * DVec3::Z);
                }
            }
        }
        places
    }

    #[test]
    fn lines_planes_and_space_are_told_apart() {
        let terms = |axes, z, free| Counts::of(grid(axes, z).into_iter(), free).terms[1];
        for axes in 1..=3 {
            assert_eq!(terms(axes, 0.0, false), axes);
            assert_eq!(terms(axes, 0.5, true), axes, "beside the point");
        }
        assert_eq!(Counts::of([].into_iter(), true).terms[1], 1);
    }
}
