//! Polynomials of fifth degree through the six nodes around a point along each axis: of higher
//! order than the spline and independent of it, to tell how far the spline is off.

use super::{Interpolate, Sample, cell};
use crate::field::Field;

/// Nodes along each axis, or fewer where the field has no more.
const NODES: usize = 6;

/// The polynomials of a field. They read its values and keep nothing. The value is continuous, its
/// gradient is not.
pub(crate) struct Lagrange<'a> {
    field: &'a Field,
}

impl<'a> Lagrange<'a> {
    pub(crate) fn new(field: &'a Field) -> Lagrange<'a> {
        Lagrange { field }
    }

    /// Whether the polynomials are of higher degree than the spline along some axis.
    pub(crate) fn is_of_higher_degree(field: &Field) -> bool {
        field.dims().iter().any(|n| *n > 4)
    }
}

/// The first node of the polynomial at a coordinate, and the weights of its nodes in the value and
/// in the derivative. Weights of nodes that the field does not have are zero.
fn weights(at: f64, nodes: usize) -> (usize, [f64; NODES], [f64; NODES]) {
    let (i, t) = cell(at, nodes);
    let first = i.saturating_sub(2).min(nodes.saturating_sub(NODES));
    let count = nodes.min(NODES);
    let u = (i - first) as f64 + t;
    let (mut value, mut slope) = ([0.0; NODES], [0.0; NODES]);
    for j in 0..count {
        // The product of the other nodes' factors, and its derivative by the product rule.
        let (mut product, mut derivative) = (1.0, 0.0);
        for k in (0..count).filter(|k| *k != j) {
            let scale = 1.0 / (j as f64 - k as f64);
            let factor = (u - k as f64) * scale;
            derivative = derivative * factor + product * scale;
            product *= factor;
        }
        (value[j], slope[j]) = (product, derivative);
    }
    (first, value, slope)
}

impl Interpolate for Lagrange<'_> {
    fn sample(&self, at: [f64; 3]) -> Sample {
        let d = self.field.dims();
        let [(i, wx, dx), (j, wy, dy), (k, wz, dz)] = [0, 1, 2].map(|c| weights(at[c], d[c]));
        let count = d.map(|n| n.min(NODES));
        let eps = self.field.eps();
        let (mut value, mut gradient) = (0.0, [0.0; 3]);
        for c in 0..count[2] {
            // Value, slope along x and slope along y in the layer.
            let mut layer = [0.0; 3];
            for b in 0..count[1] {
                let start = i + d[0] * (j + b + d[1] * (k + c));
                let row = &eps[start..start + count[0]];
                let (mut v, mut g) = (0.0, 0.0);
                for (a, e) in row.iter().enumerate() {
                    v += wx[a] * f64::from(*e);
                    g += dx[a] * f64::from(*e);
                }
                layer[0] += wy[b] * v;
                layer[1] += wy[b] * g;
                layer[2] += dy[b] * v;
            }
            value += wz[c] * layer[0];
            gradient[0] += wz[c] * layer[1];
            gradient[1] += wz[c] * layer[2];
            gradient[2] += dz[c] * layer[0];
        }
        Sample { eps: value, gradient }
    }

    fn dims(&self) -> [usize; 3] {
        self.field.dims()
    }

    fn memory_bytes(&self) -> usize {
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn polynomials_of_fifth_degree_are_exact_also_in_faces() {
        let p = |u: f64| 1.0 + u - 0.5 * u.powi(2) + 0.2 * u.powi(4) - 0.1 * u.powi(5);
        let dp = |u: f64| 1.0 - u + 0.8 * u.powi(3) - 0.5 * u.powi(4);
        let q = |u: f64| 2.0 - 0.3 * u.powi(3);
        let dims = [9, 7, 2];
        let field = Field::from_fn(dims, [0.125; 3], DVec3::ZERO, 1.0, |at| {
            p(at.x) * q(at.y) * (1.0 + at.z)
        })
        .unwrap();
        let polynomials = Lagrange::new(&field);
        for x in [0.0, 0.5, 3.25, 7.75, 8.0] {
            for y in [0.0, 2.5, 5.9, 6.0] {
                for z in [0.0, 0.4, 1.0] {
                    let (u, v, w) = (0.125 * x, 0.125 * y, 0.125 * z);
                    let s = polynomials.sample([x, y, z]);
                    let dq = -0.9 * v.powi(2);
                    let expected = [
                        p(u) * q(v) * (1.0 + w),
                        0.125 * dp(u) * q(v) * (1.0 + w),
                        0.125 * p(u) * dq * (1.0 + w),
                        0.125 * p(u) * q(v),
                    ];
                    let got = [s.eps, s.gradient[0], s.gradient[1], s.gradient[2]];
                    for (a, b) in got.iter().zip(expected) {
                        // The nodes are rounded to f32.
                        assert!((a - b).abs() < 4e-6, "{x} {y} {z}: {got:?} {expected:?}");
                    }
                }
            }
        }
        assert!(Lagrange::is_of_higher_degree(&field));
    }
}
