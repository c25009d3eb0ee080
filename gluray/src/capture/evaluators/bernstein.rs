//! Points of Bézier curves and surfaces (OpenGL 1.1, section 5.1): sums of Bernstein polynomials by
//! Horner's scheme.
//!
//! With s = 1 - t, and b(i) = C(n, i) · p(i) · t^i, the curve of degree n is ((b(0)·s + b(1))·s +
//! …)·s + b(n). The order of the operations is Mesa's, so that the driver's lines over a surface
//! lie on our surface.

/// The point of a curve at `t`, with `N` values. There is at least one control point.
pub(super) fn curve<const N: usize>(
    points: impl IntoIterator<Item = [f32; N]>,
    order: usize,
    t: f32,
) -> [f32; N] {
    let mut points = points.into_iter();
    let mut next = || points.next().unwrap_or([0.0; N]);
    let first = next();
    if order < 2 {
        return first;
    }
    let s = 1.0 - t;
    let mut binomial = (order - 1) as f32;
    let second = next();
    let mut sum: [f32; N] = std::array::from_fn(|k| s * first[k] + binomial * t * second[k]);
    let mut power = t * t;
    for i in 2..order {
        binomial *= (order - i) as f32;
        binomial *= 1.0 / i as f32;
        let p = next();
        (0..N).for_each(|k| sum[k] = s * sum[k] + binomial * power * p[k]);
        power *= t;
    }
    sum
}

/// The point of a surface. The control points come row by row: first all of the first row in `u`,
/// and so on.
pub(super) fn surface<const N: usize>(
    points: &[[f32; N]],
    orders: [usize; 2],
    at: [f32; 2],
) -> [f32; N] {
    let ([rows, columns], [u, v]) = (orders, at);
    if columns > rows {
        let across =
            (0..columns).map(|j| curve((0..rows).map(|i| points[i * columns + j]), rows, u));
        curve(across, columns, v)
    } else {
        let along =
            points.chunks_exact(columns.max(1)).map(|row| curve(row.iter().copied(), columns, v));
        curve(along, rows, u)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The definition, in double precision.
    fn defined(points: &[f64], t: f64) -> f64 {
        let n = points.len() - 1;
        let binomial = |i: usize| (0..i).fold(1.0, |b, k| b * (n - k) as f64 / (k + 1) as f64);
        let term = |(i, p): (usize, &f64)| {
            binomial(i) * t.powi(i as i32) * (1.0 - t).powi((n - i) as i32) * p
        };
        points.iter().enumerate().map(term).sum()
    }

    fn some(i: usize) -> f64 {
        (i * 7919 % 101) as f64 / 50.0 - 1.0
    }

    #[test]
    fn curves_of_any_order_are_the_sum_of_bernstein_s_polynomials() {
        for order in 1..=30 {
            let points: Vec<f64> = (0..order).map(some).collect();
            for t in [0.0, 0.25, 0.4, 1.0, 1.2] {
                let [found] = curve(points.iter().map(|p| [*p as f32]), order, t as f32);
                let (right, size) = (defined(&points, t), 1.4_f64.powi(order as i32).max(1.0));
                let far = if t > 1.0 { size } else { 1.0 };
                assert!(
                    (f64::from(found) - right).abs() < 2e-5 * far,
                    "{order} {t}: {found} {right}"
                );
            }
        }
    }

    #[test]
    fn surfaces_are_curves_of_points_of_curves_whatever_their_orders() {
        for (rows, columns) in [(1, 1), (1, 5), (5, 1), (2, 6), (6, 2), (4, 4)] {
            let points: Vec<[f32; 2]> =
                (0..rows * columns).map(|i| [some(i) as f32, some(3 * i) as f32]).collect();
            let [u, v] = [0.3, 0.8];
            let found = surface(&points, [rows, columns], [u as f32, v as f32]);
            for k in 0..2 {
                let row = |i: usize| {
                    points[i * columns..][..columns]
                        .iter()
                        .map(|p| f64::from(p[k]))
                        .collect::<Vec<_>>()
                };
                let along: Vec<f64> = (0..rows).map(|i| defined(&row(i), v)).collect();
                assert!(
                    (f64::from(found[k]) - defined(&along, u)).abs() < 1e-5,
                    "{rows} {columns}"
                );
            }
        }
    }
}
