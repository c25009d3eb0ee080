//! Values at the centres of a uniform lattice of cells, from averages over the cells, some of which
//! are missing.
//!
//! An average is not the value at the cell's centre: between the two are h²/24 times the second
//! derivatives. Along each axis in turn, the second difference of the averages around takes this
//! off, with an error of fourth order. Beside a missing one, those on the other side give it. At
//! shocks averages stay as they are, which makes no new extrema.

use super::corner_values::{ROUGHNESS, ROUGHNESS_AT_ENDS, smoothness};
use rayon::prelude::*;

/// Values at the centres of `cells` cells along each axis, x fastest, from averages over the cells
/// in the same order. Where an average is not finite, the value is NaN.
///
/// # Panics
/// If the number of averages is not that of the cells.
///
/// ```
/// use datasets::resample::centre_values;
/// // Averages of x² over cells around -2, -1, 0, 1 and 2, with one missing.
/// let averages = [4.0, 1.0, 0.0, 1.0, f64::NAN].map(|square| square + 1.0 / 12.0);
/// let centres = centre_values([5, 1, 1], &averages);
/// for (value, square) in centres[..4].iter().zip([4.0, 1.0, 0.0, 1.0]) {
///     assert!((value - square).abs() < 1e-12);
/// }
/// assert!(centres[4].is_nan());
/// ```
pub fn centre_values(cells: [usize; 3], averages: &[f64]) -> Vec<f64> {
    assert_eq!(averages.len(), cells.iter().product::<usize>(), "one average for each cell");
    let mut values = averages.to_vec();
    for axis in 0..3 {
        let stride: usize = cells[..axis].iter().product();
        let count = cells[axis];
        let before = values.clone();
        values.par_iter_mut().enumerate().with_min_len(4096).for_each(|(i, value)| {
            let place = i / stride.max(1) % count.max(1);
            let near = |step: isize| {
                let inside = (0..count as isize).contains(&(place as isize + step));
                inside.then(|| before[i.wrapping_add_signed(step * stride as isize)])
            };
            *value = at_centre(|step| near(step).filter(|v| v.is_finite()));
        });
    }
    values
}

/// The value at the centre of a cell. `average` is that of the cell so many steps on, if there is
/// one.
fn at_centre(average: impl Fn(isize) -> Option<f64>) -> f64 {
    let Some(own) = average(0) else { return f64::NAN };
    let all = |steps: [isize; 4]| {
        let [a, b, c, d] = steps.map(&average);
        Some([a?, b?, c?, d?])
    };
    let correction = |second: f64, share: f64| own - share * second / 24.0;
    if let (Some(before), Some(after)) = (average(-1), average(1)) {
        let around = [all([-2, -1, 0, 1]), all([-1, 0, 1, 2])];
        let shares = around.into_iter().flatten().map(|a| smoothness(a, ROUGHNESS));
        // With three averages alone, nothing tells a smooth field from a step.
        let share = shares.reduce(f64::min).unwrap_or(0.0);
        return correction(before - 2.0 * own + after, share);
    }
    // On a line through the second differences of the next two.
    let one_sided = all([0, 1, 2, 3]).or_else(|| all([0, -1, -2, -3]));
    one_sided.map_or(own, |a| {
        let second = 2.0 * a[0] - 5.0 * a[1] + 4.0 * a[2] - a[3];
        correction(second, smoothness(a, ROUGHNESS_AT_ENDS))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cubic polynomial without a step by any measure, and its integral from 0.
    fn cubic(x: f64) -> f64 {
        1.0 + 3.0 * x - 0.2 * x * x + 0.02 * x * x * x
    }

    fn integral(x: f64) -> f64 {
        x + 1.5 * x * x - 0.2 / 3.0 * x.powi(3) + 0.005 * x.powi(4)
    }

    #[test]
    fn cubic_fields_are_exact_beside_missing_cells() {
        // A block in the middle, and one at a corner. Everywhere four cells in a row are left.
        let cells = [13, 6, 12];
        let at = |c: usize| [c % 13, c / 13 % 6, c / 78];
        let is_missing =
            |[x, y, z]: [usize; 3]| ((5..7).contains(&x) && z == 5) || (x < 2 && y < 2 && z < 2);
        let mean = |i: usize| integral(i as f64 + 1.0) - integral(i as f64);
        let averages: Vec<f64> = (0..13 * 6 * 12)
            .map(|c| match is_missing(at(c)) {
                true => f64::NAN,
                false => at(c).map(mean).iter().product(),
            })
            .collect();
        for (c, value) in centre_values(cells, &averages).iter().enumerate() {
            let [x, y, z] = at(c).map(|i| cubic(i as f64 + 0.5));
            assert_eq!(value.is_nan(), is_missing(at(c)), "{:?}", at(c));
            let error = (value / (x * y * z) - 1.0).abs();
            assert!(value.is_nan() || error < 1e-12, "{:?}: {error}", at(c));
        }
    }

    #[test]
    fn a_step_keeps_its_averages() {
        for at in 1..9usize {
            let averages: Vec<f64> = (0..9).map(|i| f64::from(u8::from(i >= at))).collect();
            assert_eq!(centre_values([9, 1, 1], &averages), averages, "step at {at}");
        }
        assert_eq!(centre_values([1, 1, 1], &[3.0]), [3.0]);
        assert!(centre_values([0, 3, 2], &[]).is_empty());
    }
}
