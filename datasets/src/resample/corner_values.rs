//! Values at the corners of a uniform lattice of cells, from averages over the cells.
//!
//! An average is not the value at the cell's centre: between the two are h²/24 times the second
//! derivatives. And a lattice of the centres lacks half of the cells at the border. Along each axis
//! in turn, averages to the left and to the right of a corner give its value with an error of
//! fourth order (Colella and Woodward, "The Piecewise Parabolic Method (PPM) for gas-dynamical
//! simulations", 1984, equation 1.9 for equal cells). At shocks it is the mean of both neighbours,
//! which makes no new extrema, and at the ends of a row the last average.

use rayon::prelude::*;

/// Up to the first number, the third difference of averages, as a part of their largest first one,
/// is that of a smooth field: a bell with a width of two cells has 0.54. From the second on, it is
/// that of a step, next to which it is 1 or more.
pub(super) const ROUGHNESS: [f64; 2] = [0.55, 0.9];
/// As much at the ends of a row, where values go beyond the averages: a step over two cells there
/// may have 0.33.
pub(super) const ROUGHNESS_AT_ENDS: [f64; 2] = [0.1, 0.3];

/// How far the value at an end may be from the last average, by the difference of the last two. On
/// a line it is 0.5.
const MOST_BEYOND: f64 = 0.75;

/// Values at the corners of `cells` cells along each axis, x fastest, from averages over the cells
/// in the same order. There is one corner more than cells along each axis.
///
/// # Panics
/// If the number of averages is not that of the cells.
///
/// ```
/// use datasets::resample::corner_values;
/// // Averages of x² over [0, 1], [1, 2], [2, 3], [3, 4].
/// let averages = [1.0 / 3.0, 7.0 / 3.0, 19.0 / 3.0, 37.0 / 3.0];
/// let corners = corner_values([4, 1, 1], &averages);
/// for (x, value) in corners[..5].iter().enumerate() {
///     assert!((value - (x * x) as f64).abs() < 1e-12);
/// }
/// ```
pub fn corner_values(cells: [usize; 3], averages: &[f64]) -> Vec<f64> {
    assert_eq!(averages.len(), cells.iter().product::<usize>(), "one average for each cell");
    let mut dims = cells;
    let mut values = along(averages, dims, 0);
    for axis in [1, 2] {
        dims[axis - 1] += 1;
        values = along(&values, dims, axis);
    }
    values
}

/// Averages along one axis become values at corners.
fn along(values: &[f64], dims: [usize; 3], axis: usize) -> Vec<f64> {
    let n = dims[axis];
    if n == 0 || values.is_empty() {
        return vec![];
    }
    let inner: usize = dims[..axis].iter().product();
    let mut out = vec![0.0; values.len() / n * (n + 1)];
    if axis == 0 {
        // Row by row: a piece of one number would be too little work for a thread.
        out.par_chunks_mut(n + 1).zip(values.par_chunks(n)).for_each(|(out, row)| {
            let corners = out.iter_mut().enumerate();
            corners.for_each(|(corner, to)| *to = at_corner(corner, n, |cell| row[cell]));
        });
        return out;
    }
    // A piece of `inner` numbers is those of one corner along the axis.
    out.par_chunks_mut(inner).enumerate().for_each(|(piece, out)| {
        let (outer, corner) = (piece / (n + 1), piece % (n + 1));
        for (i, to) in out.iter_mut().enumerate() {
            *to = at_corner(corner, n, |cell| values[(outer * n + cell) * inner + i]);
        }
    });
    out
}

/// The value at a corner of a row of `n` cells.
#[inline]
fn at_corner(corner: usize, n: usize, average: impl Fn(usize) -> f64) -> f64 {
    let near = match corner {
        0 => average(0),
        _ if corner == n => average(n - 1),
        _ => 0.5 * (average(corner - 1) + average(corner)),
    };
    if n < 4 {
        return near;
    }
    // Of a corner near the end, the same cells seen from there.
    let from_left = corner <= n / 2;
    let place = if from_left { corner } else { n - corner };
    let first = place.saturating_sub(2);
    let a = [0, 1, 2, 3].map(|k| {
        let cell = first + k;
        average(if from_left { cell } else { n - 1 - cell })
    });
    // Near the ends, steps over two cells are hard to tell from smooth fields.
    let smooth = match place {
        0 => {
            let smooth = (25.0 * a[0] - 23.0 * a[1] + 13.0 * a[2] - 3.0 * a[3]) / 12.0;
            let reach = MOST_BEYOND * (a[0] - a[1]).abs();
            smooth.max(a[0] - reach).min(a[0] + reach)
        }
        1 => {
            let smooth = (3.0 * a[0] + 13.0 * a[1] - 5.0 * a[2] + a[3]) / 12.0;
            smooth.max(a[0].min(a[1])).min(a[0].max(a[1]))
        }
        _ => (7.0 * (a[1] + a[2]) - (a[0] + a[3])) / 12.0,
    };
    let share = smoothness(a, if place < 2 { ROUGHNESS_AT_ENDS } else { ROUGHNESS });
    near + share * (smooth - near)
}

/// 1 where four averages are those of a smooth field, 0 at a step.
#[inline]
pub(super) fn smoothness([a, b, c, d]: [f64; 4], [smooth, step]: [f64; 2]) -> f64 {
    let first = (b - a).abs().max((c - b).abs()).max((d - c).abs());
    let third = ((d - a) - 3.0 * (c - b)).abs();
    // Equal averages have no step.
    let x = ((step * first - third) / ((step - smooth) * first).max(f64::MIN_POSITIVE)).min(1.0);
    if x > 0.0 { x * x * (3.0 - 2.0 * x) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A product of cubic polynomials, and its integral from 0.
    fn cubic(x: f64) -> f64 {
        1.0 + 3.0 * x - 0.2 * x * x + 0.02 * x * x * x
    }

    fn integral(x: f64) -> f64 {
        x + 1.5 * x * x - 0.2 / 3.0 * x.powi(3) + 0.005 * x.powi(4)
    }

    #[test]
    fn cubic_fields_are_exact_at_all_corners() {
        let cells = [5, 4, 7];
        let mean = |i: usize| integral(i as f64 + 1.0) - integral(i as f64);
        let averages: Vec<f64> =
            (0..5 * 4 * 7).map(|c| mean(c % 5) * mean(c / 5 % 4) * mean(c / 20)).collect();
        let corners = corner_values(cells, &averages);
        assert_eq!(corners.len(), 6 * 5 * 8);
        for (c, value) in corners.iter().enumerate() {
            let [x, y, z] = [c % 6, c / 6 % 5, c / 30].map(|i| cubic(i as f64));
            assert!((value / (x * y * z) - 1.0).abs() < 1e-12, "{c}: {value} {}", x * y * z);
        }
    }

    #[test]
    fn a_step_makes_no_new_extrema() {
        for n in [4, 9, 10] {
            for at in 1..n {
                for between in [0.0, 0.3, 0.5, 1.0] {
                    let mut averages: Vec<f64> =
                        (0..n).map(|i| f64::from(u8::from(i >= at))).collect();
                    averages[at] = between;
                    let corners = corner_values([n, 1, 1], &averages);
                    for (i, value) in corners[1..n].iter().enumerate() {
                        let inside = (-0.01..=1.01).contains(value);
                        assert!(inside, "{n} cells, step at {at} of {between}: {value} at {i}");
                    }
                    // The last corners go on as the averages do.
                    for (value, a, b) in [
                        (corners[0], averages[0], averages[1]),
                        (corners[n], averages[n - 1], averages[n - 2]),
                    ] {
                        let beyond = (value - a).abs() <= MOST_BEYOND * (a - b).abs() + 1e-12;
                        assert!(beyond, "{n} cells, step at {at} of {between}: {value}");
                    }
                }
            }
        }
    }

    #[test]
    fn few_cells_and_equal_ones_keep_their_values() {
        assert_eq!(corner_values([1, 1, 1], &[3.0]), [3.0; 8]);
        assert_eq!(corner_values([2, 1, 1], &[1.0, 3.0])[..3], [1.0, 2.0, 3.0]);
        assert_eq!(corner_values([6, 5, 4], &[0.1; 120]), [0.1; 7 * 6 * 5]);
        assert!(corner_values([0, 3, 2], &[]).is_empty());
    }
}
