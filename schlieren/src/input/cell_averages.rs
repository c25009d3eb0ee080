//! Values in the middles of a lattice's cells, from averages over the cells.
//!
//! Solvers of finite volumes keep averages. The average over a cell of side h differs from the
//! value in its middle by h²/24 times the second derivatives, which is 4 parts in a thousand of a
//! bell whose standard deviation is five cells. Differences of the averages give the second
//! derivatives (McCorquodale and Colella, "A high-order finite-volume method for conservation laws
//! on locally refined grids", Comm. App. Math. Comp. Sci. 2011), and the error is of fourth order
//! then.

use rayon::prelude::*;

/// Of the second differences beside it, a cell's counts up to this multiple, and not at all where
/// their signs differ: what remains at a captured shock is nothing, and smooth extrema keep their
/// height (Colella and Sekora, "A limiter for PPM that preserves accuracy at smooth extrema",
/// J. Comput. Phys. 2008).
const BESIDE: f64 = 1.25;

/// Turns averages over the cells of a uniform lattice, x fastest, into values in their middles.
/// Cells beside one that has no finite value, and the first and last along an axis, keep their
/// average along it.
pub(super) fn to_middle_values(averages: &[f64], dims: [usize; 3]) -> Vec<f64> {
    let stride = [1, dims[0], dims[0] * dims[1]];
    let second = |i: usize, at: usize, axis: usize| {
        let inner = at > 0 && at + 1 < dims[axis];
        let s = stride[axis];
        inner.then(|| (averages[i - s] - averages[i]) + (averages[i + s] - averages[i]))
    };
    let limited = |i: usize, at: usize, axis: usize| -> Option<f64> {
        let s = stride[axis];
        let own = second(i, at, axis)?;
        // Beside the border, the only neighbour counts.
        let before = second(i - s, at - 1, axis);
        let after = second(i + s, at + 1, axis);
        let mut least = own.abs();
        for beside in [before, after].into_iter().flatten() {
            let bends_alike = beside * own > 0.0;
            if !bends_alike {
                return None;
            }
            least = least.min(BESIDE * beside.abs());
        }
        Some(least.copysign(own)).filter(|d| d.is_finite())
    };
    averages
        .par_iter()
        .enumerate()
        .map(|(i, average)| {
            let at = [i % dims[0], i / dims[0] % dims[1], i / stride[2]];
            let sum: f64 = (0..3).filter_map(|axis| limited(i, at[axis], axis)).sum();
            average - sum / 24.0
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The average of exp(-x²/2σ²) over a cell, by Gauss points.
    fn average(x: f64, sigma: f64) -> f64 {
        let f = |x: f64| (-x * x / (2.0 * sigma * sigma)).exp();
        let near = 0.5 * (3.0f64 / 5.0).sqrt();
        (5.0 * f(x - near) + 8.0 * f(x) + 5.0 * f(x + near)) / 18.0
    }

    #[test]
    fn averages_over_cells_are_not_values_in_their_middles() {
        let (n, sigma) = (24, 5.0);
        let places = |i: usize| (i % n) as f64 - 11.5;
        let averages: Vec<f64> =
            (0..n * n).map(|i| average(places(i), sigma) * average(places(i / n), sigma)).collect();
        let worst = |values: &[f64]| {
            let exact = |i: usize| {
                (-(places(i).powi(2) + places(i / n).powi(2)) / (2.0 * sigma * sigma)).exp()
            };
            let inner = |i: &usize| (3..n - 3).contains(&(i % n)) && (3..n - 3).contains(&(i / n));
            (0..n * n).filter(inner).map(|i| (values[i] - exact(i)).abs()).fold(0.0, f64::max)
        };
        assert!(worst(&averages) > 3e-3);
        let values = to_middle_values(&averages, [n, n, 1]);
        assert!(worst(&values) < 1e-4, "{}", worst(&values));
    }

    #[test]
    fn a_captured_step_gets_no_new_extrema_and_gaps_do_not_spread() {
        let step: Vec<f64> = (0..12).map(|i| f64::from(u8::from(i > 5))).collect();
        assert_eq!(to_middle_values(&step, [12, 1, 1]), step);
        let mut gap: Vec<f64> = (0..12).map(|i| f64::from(i * i)).collect();
        gap[4] = f64::NAN;
        let values = to_middle_values(&gap, [12, 1, 1]);
        assert_eq!(values.iter().filter(|v| v.is_nan()).count(), 1);
        assert!((values[9] - (81.0 - 2.0 / 24.0)).abs() < 1e-12, "{values:?}");
    }
}
