//! Computes the coefficients of the cubic B-spline through given values at the nodes.

/// Replaces the values `v` in `line[1..=n]` by the coefficients `c` of the natural spline, with
/// `(c[i-1] + 4 c[i] + c[i+1]) / 6 = v[i]`. Its second derivative vanishes at both ends, so that
/// straight lines stay straight. `line[0]` and `line[n+1]` receive the coefficients outside.
///
/// (Mirrored ends, which are usual for images, would force the gradient to zero at the field's
/// faces.)
pub(crate) fn prefilter_line(line: &mut [f64]) {
    let n = line.len() - 2;
    debug_assert!(n >= 2, "a line of a field has two nodes or more");
    // A natural spline's end coefficients are the end values: c'' = 0 there makes (c[-1] + c[1]) /
    // 2 = c[0]. What remains is tridiagonal for c[1..n-1], solved by elimination.
    let v = &mut line[1..=n];
    if n > 2 {
        // c[i-1] + 4 c[i] + c[i+1] = 6 v[i]
        let mut ratio = vec![0.0; n];
        let mut pivot = 4.0;
        let (first, last) = (v[0], v[n - 1]);
        v[1] = (6.0 * v[1] - first) / pivot;
        for i in 2..n - 1 {
            ratio[i] = 1.0 / pivot;
            pivot = 4.0 - ratio[i];
            v[i] = (6.0 * v[i] - v[i - 1]) / pivot;
        }
        ratio[n - 1] = 1.0 / pivot;
        v[n - 2] -= last * ratio[n - 1];
        for i in (1..n - 2).rev() {
            v[i] -= ratio[i + 1] * v[i + 1];
        }
    }
    line[0] = 2.0 * line[1] - line[2];
    line[n + 1] = 2.0 * line[n] - line[n - 1];
}
