//! Matrices of OpenGL, column by column, in the arithmetic of the driver.

/// `a * b`, column by column, summed in Mesa's order.
pub(crate) fn product(a: &[f32; 16], b: &[f32; 16]) -> [f32; 16] {
    std::array::from_fn(|i| {
        let (column, row) = (i / 4, i % 4);
        (1..4).fold(a[row] * b[4 * column], |s, k| s + a[4 * k + row] * b[4 * column + k])
    })
}

/// `m * (p, 1)` as a multiplication and three multiply-adds, as in the driver's program.
pub(crate) fn transform(m: &[f32; 16], p: [f32; 3]) -> [f32; 4] {
    std::array::from_fn(|r| m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r])
}
