//! Evaluates the derivatives of the cubic spline of a projected map.

use crate::interpolate::bspline_weights;

/// First derivatives of a map's spline, per metre.
pub(super) fn derivatives(
    c: &[f32],
    row: usize,
    [i, k]: [usize; 2],
    [x, y]: [f64; 2],
    per_m: [f64; 2],
) -> [f64; 2] {
    let ((wx, dx), (wy, dy)) = (bspline_weights(x), bspline_weights(y));
    let c = |a: usize, b: usize| f64::from(c[i + a + (k + b) * row]);
    let (mut along_x, mut along_y) = (0.0, 0.0);
    for b in 0..4 {
        for a in 0..3 {
            along_x += wy[b] * dx[a] * (c(a + 1, b) - c(a, b));
            along_y += wx[b] * dy[a] * (c(b, a + 1) - c(b, a));
        }
    }
    [along_x * per_m[0], along_y * per_m[1]]
}

/// Second derivatives, per metre squared: second differences with linear weights.
pub(super) fn second_derivatives(
    c: &[f32],
    row: usize,
    [i, k]: [usize; 2],
    [x, y]: [f64; 2],
    [p, q]: [f64; 2],
) -> [[f64; 2]; 2] {
    let ((wx, dx), (wy, dy)) = (bspline_weights(x), bspline_weights(y));
    let (hx, hy) = ([1.0 - x, x], [1.0 - y, y]);
    let c = |a: usize, b: usize| f64::from(c[i + a + (k + b) * row]);
    let [mut xx, mut xy, mut yy] = [0.0f64; 3];
    for b in 0..4 {
        for a in 0..2 {
            xx += wy[b] * hx[a] * (c(a, b) - 2.0 * c(a + 1, b) + c(a + 2, b));
            yy += wx[b] * hy[a] * (c(b, a) - 2.0 * c(b, a + 1) + c(b, a + 2));
        }
    }
    for b in 0..3 {
        for a in 0..3 {
            xy += dx[a] * dy[b] * ((c(a + 1, b + 1) - c(a, b + 1)) - (c(a + 1, b) - c(a, b)));
        }
    }
    [[xx * p * p, xy * p * q], [xy * p * q, yy * q * q]]
}
