//! Weighted least squares for a few unknowns, by Cholesky factors of the normal equations.
//!
//! The unknowns have an order. A column that earlier columns explain almost wholly is left out, and
//! its unknown is zero: on a plane repeated along its normal, the second power of the height is
//! such a column.

/// A column is left out when less than this share of its square is its own. Of the third power over
/// three points that are not quite on a grid, little is left, and a coefficient that follows from
/// that is noise.
const OWN_SHARE: f64 = 1e-4;

/// Sums of products of up to `N` columns and a right-hand side.
pub(super) struct NormalEquations<const N: usize> {
    /// Lower triangle.
    matrix: [[f64; N]; N],
    right: [f64; N],
}

impl<const N: usize> NormalEquations<N> {
    pub(super) const EMPTY: Self = NormalEquations { matrix: [[0.0; N]; N], right: [0.0; N] };

    /// Adds the equation row · x = value, for the first `used` unknowns.
    pub(super) fn add(&mut self, row: &[f64; N], value: f64, weight: f64, used: usize) {
        for i in 0..used.min(N) {
            let scaled = weight * row[i];
            self.right[i] += scaled * value;
            for (sum, other) in self.matrix[i][..=i].iter_mut().zip(row) {
                *sum += scaled * other;
            }
        }
    }

    /// The first `used` unknowns; the others are zero.
    pub(super) fn solve(&self, used: usize) -> [f64; N] {
        self.solve_and_count(used).0
    }

    /// [`NormalEquations::solve`], and how many of the unknowns the equations determine.
    pub(super) fn solve_and_count(&self, used: usize) -> ([f64; N], usize) {
        let used = used.min(N);
        let mut factor = [[0.0; N]; N];
        let mut y = [0.0; N];
        let mut kept = [false; N];
        for i in 0..used {
            for j in 0..i {
                if kept[j] {
                    let inner: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
                    factor[i][j] = (self.matrix[i][j] - inner) / factor[j][j];
                }
            }
            let own = self.matrix[i][i] - factor[i][..i].iter().map(|f| f * f).sum::<f64>();
            // NaN is left out too.
            kept[i] = own > OWN_SHARE * self.matrix[i][i];
            if kept[i] {
                factor[i][i] = own.sqrt();
                let inner: f64 = (0..i).map(|k| factor[i][k] * y[k]).sum();
                y[i] = (self.right[i] - inner) / factor[i][i];
            } else {
                factor[i] = [0.0; N];
            }
        }
        let mut x = [0.0; N];
        for i in (0..used).rev().filter(|&i| kept[i]) {
            let inner: f64 = (i + 1..used).map(|k| factor[k][i] * x[k]).sum();
            x[i] = (y[i] - inner) / factor[i][i];
        }
        (x, kept.iter().filter(|k| **k).count())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found_among_many_points_and_dependent_columns_are_zero() {
        let mut equations = NormalEquations::<4>::EMPTY;
        for i in 0..7 {
            let x = f64::from(i) - 2.5;
            // The third column is twice the second.
            let row = [1.0, x, 2.0 * x, x * x];
            equations.add(&row, 3.0 - 0.5 * x + 0.25 * x * x, 1.0 + f64::from(i), 4);
        }
        let x = equations.solve(4);
        for (got, want) in x.iter().zip([3.0, -0.5, 0.0, 0.25]) {
            assert!((got - want).abs() < 1e-12, "{x:?}");
        }
        assert_eq!(equations.solve_and_count(4).1, 3);
        assert_eq!(equations.solve(1)[1..], [0.0; 3]);
        assert_eq!(NormalEquations::<4>::EMPTY.solve(4), [0.0; 4]);
    }
}
