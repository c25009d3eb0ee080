//! Slopes, curvature and third derivatives from polynomials of fourth degree.
//!
//! A polynomial of third degree that is fitted to the values around a point takes up a part of what
//! the field's fourth derivatives do there: its slopes are wrong by their product with the third
//! power of the distance of the values. Terms of fourth degree keep that out. They are not kept
//! themselves: within the cells around the point they are small.
//!
//! Averages over cells keep polynomials of third degree. On a grid, the cells around a point do not
//! determine fourth powers along an axis; with those that they determine, deflections through a
//! bell had 0.8 times the error, but averages of a cubic field over stretched cells came back with
//! errors of 2e-4.

use super::counts::Counts;
use super::least_squares::NormalEquations;
use super::polynomial::{TERMS, TERMS_TO_DEGREE, monomials};
use super::sample::{NEAREST_SQUARE, Sample};
use glam::DVec3;

/// Number of monomials of degree 1 to 4.
const TO_FOURTH: usize = 34;
/// Those along a line, in a plane and in space.
const OF_DIMENSION: [usize; 3] = [4, 14, TO_FOURTH];
/// Equations for each unknown, at least.
const EQUATIONS_PER_TERM: f64 = 1.5;

/// The terms of degree 1 to 3 of a polynomial of degree 4 through a point's value; `None` where the
/// samples around it do not determine it.
pub(super) fn to_third_degree(samples: &[Sample], counts: Counts) -> Option<[f64; TERMS]> {
    let unknowns = OF_DIMENSION[counts.terms[1].clamp(1, 3) - 1];
    if (samples.len() as f64) < EQUATIONS_PER_TERM * unknowns as f64 {
        return None;
    }
    let mut equations = NormalEquations::<TO_FOURTH>::EMPTY;
    for s in samples {
        // As for polynomials of third degree: weights that fall faster gain nothing.
        let weight = s.square.max(NEAREST_SQUARE).powi(-4);
        equations.add(&row(s.place), s.value, weight, TO_FOURTH);
    }
    let (terms, determined) = equations.solve_and_count(TO_FOURTH);
    (determined == unknowns).then(|| std::array::from_fn(|i| terms[i]))
}

/// All monomials: after those to third degree x times these, y times those without x, and zzzz.
fn row(u: DVec3) -> [f64; TO_FOURTH] {
    let lower = monomials(u);
    let third = &lower[TERMS_TO_DEGREE[2]..];
    let mut row = [0.0; TO_FOURTH];
    row[..TERMS].copy_from_slice(&lower);
    for (i, m) in third.iter().enumerate() {
        row[TERMS + i] = u.x * m;
    }
    for (i, m) in third[6..].iter().enumerate() {
        row[TERMS + third.len() + i] = u.y * m;
    }
    row[TO_FOURTH - 1] = u.z * third[9];
    row
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_have_every_monomial_once() {
        // Powers of three primes are different.
        let mut row = row(DVec3::new(2.0, 3.0, 5.0)).to_vec();
        row.sort_by(f64::total_cmp);
        let mut expected = vec![];
        for (i, j, k) in (0..125).map(|n| (n % 5, n / 5 % 5, n / 25)) {
            if (1..=4).contains(&(i + j + k)) {
                expected.push(f64::from(2u32.pow(i) * 3u32.pow(j) * 5u32.pow(k)));
            }
        }
        expected.sort_by(f64::total_cmp);
        assert_eq!(row, expected);
    }
}
