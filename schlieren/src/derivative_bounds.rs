//! Finds the largest derivatives of a field from finite differences on its lattice.
//!
//! A derivative is a tensor, and its size at a node is its Frobenius norm. For the Hessian this is
//! `sqrt(xx² + yy² + zz² + 2 xy² + 2 xz² + 2 yz²)`. It is at least as large as the second
//! derivative along any direction, and it bounds how neighbouring rays diverge. Pure differences
//! are not enough: `eps = a x y` has no pure second derivative, but it spreads light along its
//! diagonals.

use crate::field::Field;
use rayon::prelude::*;
use std::cmp::Ordering;

/// Largest absolute values in a field, per metre to the power of the order.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DerivativeBounds {
    /// |grad eps|.
    pub gradient: f64,
    /// |grad eps| on the field's faces, where oblique views have edges.
    pub gradient_on_faces: f64,
    /// Second derivatives, including mixed ones.
    pub second: f64,
    /// Second derivatives along the lattice's axes alone: the leading error of trilinear cells.
    pub second_along_axes: f64,
    /// Third derivatives, including mixed ones.
    pub third: f64,
    /// Fourth derivatives along the lattice's axes. Splines are products of splines along the axes,
    /// so these determine their errors.
    pub fourth: f64,
    /// The node of the largest fourth derivative, where a lattice follows its flow least, at least
    /// three nodes from the faces. Of equal ones, the first in the order of the nodes.
    pub fourth_at: [usize; 3],
    /// |eps|.
    pub eps: f64,
}

/// Contribution of a difference to the norm of a derivative tensor.
#[derive(Clone, Copy)]
struct Part {
    /// Order along x, in addition to the orders along y and z.
    along_x: usize,
    /// How often the derivative occurs in its tensor.
    multiplicity: f64,
}

/// Differences by their orders along y and z, with their orders along x.
const DIFFERENCES: [(usize, usize, &[Part]); 12] = {
    const fn p(along_x: usize, multiplicity: u32) -> Part {
        Part { along_x, multiplicity: multiplicity as f64 }
    }
    [
        (0, 0, &[p(1, 1), p(2, 1), p(3, 1), p(4, 1)]),
        (1, 0, &[p(0, 1), p(1, 2), p(2, 3)]),
        (0, 1, &[p(0, 1), p(1, 2), p(2, 3)]),
        (2, 0, &[p(0, 1), p(1, 3)]),
        (0, 2, &[p(0, 1), p(1, 3)]),
        (1, 1, &[p(0, 2), p(1, 6)]),
        (3, 0, &[p(0, 1)]),
        (0, 3, &[p(0, 1)]),
        (2, 1, &[p(0, 3)]),
        (1, 2, &[p(0, 3)]),
        (4, 0, &[p(0, 1)]),
        (0, 4, &[p(0, 1)]),
    ]
};

/// Coefficients of finite differences, by order.
const COEFFICIENTS: [&[f64]; 5] = [
    &[1.0],
    &[-1.0, 1.0],
    &[1.0, -2.0, 1.0],
    &[-1.0, 3.0, -3.0, 1.0],
    &[1.0, -4.0, 6.0, -4.0, 1.0],
];

/// Squares of derivatives along a row of nodes: orders 1 to 4, and order 2 along the axes.
#[derive(Default)]
struct Row {
    squares: [Vec<f64>; 5],
    difference: Vec<f64>,
}

const ALONG_AXES: usize = 4;

impl DerivativeBounds {
    /// Computes the bounds in one parallel pass over the lattice.
    pub fn new(field: &Field) -> DerivativeBounds {
        let [nx, ny, nz] = field.dims();
        (0..ny * nz)
            .into_par_iter()
            .map_init(Row::default, |row, r| row.bounds(field, r % ny, r / ny, nx))
            .reduce(DerivativeBounds::default, DerivativeBounds::max)
    }

    fn max(self, other: DerivativeBounds) -> DerivativeBounds {
        DerivativeBounds {
            gradient: self.gradient.max(other.gradient),
            gradient_on_faces: self.gradient_on_faces.max(other.gradient_on_faces),
            second: self.second.max(other.second),
            second_along_axes: self.second_along_axes.max(other.second_along_axes),
            third: self.third.max(other.third),
            fourth: self.fourth.max(other.fourth),
            fourth_at: match self.fourth.total_cmp(&other.fourth) {
                Ordering::Greater => self.fourth_at,
                Ordering::Less => other.fourth_at,
                Ordering::Equal => {
                    let order = |[i, j, k]: [usize; 3]| [k, j, i];
                    order(order(self.fourth_at).min(order(other.fourth_at)))
                }
            },
            eps: self.eps.max(other.eps),
        }
    }
}

impl Row {
    /// The largest values in the row of nodes at (j, k). Nodes whose difference would reach beyond
    /// the last node use the difference of the last nodes. Every node then has all differences that
    /// fit into the lattice.
    fn bounds(&mut self, field: &Field, j: usize, k: usize, nx: usize) -> DerivativeBounds {
        let (eps, dims) = (field.eps(), field.dims());
        let per_m = field.spacing_m().map(|h| 1.0 / h);
        for s in &mut self.squares {
            s.clear();
            s.resize(nx, 0.0);
        }
        for (along_y, along_z, parts) in DIFFERENCES {
            if along_y >= dims[1] || along_z >= dims[2] {
                continue;
            }
            let (j, k) = (j.min(dims[1] - 1 - along_y), k.min(dims[2] - 1 - along_z));
            let scale = per_m[1].powi(along_y as i32) * per_m[2].powi(along_z as i32);
            self.difference.clear();
            self.difference.resize(nx, 0.0);
            for (b, w) in COEFFICIENTS[along_z].iter().enumerate() {
                for (a, v) in COEFFICIENTS[along_y].iter().enumerate() {
                    let nodes = &eps[((k + b) * dims[1] + j + a) * nx..][..nx];
                    let weight = scale * v * w;
                    for (d, e) in self.difference.iter_mut().zip(nodes) {
                        *d += weight * f64::from(*e);
                    }
                }
            }
            for part in parts.iter().filter(|p| p.along_x < nx) {
                let order = along_y + along_z + part.along_x;
                let factor = part.multiplicity * per_m[0].powi(2 * part.along_x as i32);
                add_squares(&mut self.squares[order - 1], &self.difference, part.along_x, factor);
                if order == 2 && part.multiplicity == 1.0 {
                    add_squares(
                        &mut self.squares[ALONG_AXES],
                        &self.difference,
                        part.along_x,
                        factor,
                    );
                }
            }
        }
        let largest = |s: &[f64]| s.iter().fold(0.0f64, |m, v| m.max(*v)).sqrt();
        let gradient = largest(&self.squares[0]);
        let on_face = j == 0 || j + 1 == dims[1] || k == 0 || k + 1 == dims[2];
        let ends = self.squares[0][0].max(self.squares[0][nx - 1]).sqrt();
        let nodes = &eps[(k * dims[1] + j) * nx..][..nx];
        DerivativeBounds {
            gradient,
            gradient_on_faces: if on_face { gradient } else { ends },
            second: largest(&self.squares[1]),
            second_along_axes: largest(&self.squares[ALONG_AXES]),
            third: largest(&self.squares[2]),
            fourth: largest(&self.squares[3]),
            fourth_at: self.node_of_fourth(j, k, [nx, dims[1], dims[2]]),
            eps: f64::from(nodes.iter().fold(0.0f32, |m, e| m.max(e.abs()))),
        }
    }

    /// The node in the middle of the row's largest fourth difference.
    fn node_of_fourth(&self, j: usize, k: usize, dims: [usize; 3]) -> [usize; 3] {
        let squares = self.squares[3].iter().enumerate();
        let largest = squares.fold((0, 0.0f64), |m, (i, s)| if *s > m.1 { (i, *s) } else { m });
        // A difference begins two nodes before its middle. Rays beside the node shall not leave
        // the field.
        let middle = |first: usize, n: usize| match n.checked_sub(4) {
            Some(last) if last >= 3 => (first + 2).clamp(3, last),
            _ => n / 2,
        };
        [middle(largest.0, dims[0]), middle(j, dims[1]), middle(k, dims[2])]
    }
}

/// Adds `factor` times the squared differences of an order along a row.
fn add_squares(to: &mut [f64], values: &[f64], order: usize, factor: f64) {
    let count = values.len() - order;
    // The frequent orders are unrolled by hand so that the compiler sees the whole sum.
    match order {
        0 => to.iter_mut().zip(values).for_each(|(t, v)| *t += factor * v * v),
        1 => {
            for ((t, a), b) in to.iter_mut().zip(values).zip(&values[1..]) {
                *t += factor * (b - a) * (b - a);
            }
        }
        2 => {
            for (((t, a), b), c) in to.iter_mut().zip(values).zip(&values[1..]).zip(&values[2..]) {
                let d = (a + c) - 2.0 * b;
                *t += factor * d * d;
            }
        }
        _ => {
            for (t, v) in to.iter_mut().zip(values.windows(order + 1)) {
                let d: f64 = v.iter().zip(COEFFICIENTS[order]).map(|(v, c)| v * c).sum();
                *t += factor * d * d;
            }
        }
    }
    // The last nodes use the last difference that fits into the row.
    let last: f64 = values[count - 1..].iter().zip(COEFFICIENTS[order]).map(|(v, c)| v * c).sum();
    for t in &mut to[count..] {
        *t += factor * last * last;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    /// Polynomials have the same derivatives everywhere, and differences are exact for them.
    #[test]
    fn derivatives_of_polynomials_are_those_of_their_tensors() {
        let of = |f: fn(DVec3) -> f64| {
            let (dims, spacing) = ([9, 8, 7], [0.25, 0.5, 0.125]);
            // Powers of two: f32 holds the values exactly.
            DerivativeBounds::new(
                &Field::from_fn(dims, spacing, DVec3::ZERO, 1.0, |p| f(p) / 4096.0).unwrap(),
            )
        };
        let near = |a: f64, b: f64| (a * 4096.0 - b).abs() < 1e-6 * b.max(1.0);
        let r = of(|p| p.x * p.y);
        assert!(
            near(r.second, 2f64.sqrt()) && near(r.second_along_axes, 0.0) && near(r.third, 0.0),
            "{r:?}"
        );
        let r = of(|p| 3.0 * p.y * p.z + p.x * p.x);
        assert!(near(r.second, 22f64.sqrt()) && near(r.second_along_axes, 2.0), "{r:?}");
        let r = of(|p| p.x * p.y * p.z);
        assert!(near(r.third, 6f64.sqrt()) && near(r.fourth, 0.0), "{r:?}");
        for f in
            [|p: DVec3| p.x * p.x * p.z, |p: DVec3| p.y * p.y * p.x, |p: DVec3| p.z * p.z * p.y]
        {
            assert!(near(of(f).third, 12f64.sqrt()), "{:?}", of(f));
        }
        let r = of(|p| p.z.powi(4));
        assert!(near(r.fourth, 24.0), "{r:?}");
        // eps = x + 2 y + 3 z has the gradient (1, 2, 3) everywhere.
        let r = of(|p| p.x + 2.0 * p.y + 3.0 * p.z);
        assert!(near(r.gradient, 14f64.sqrt()) && near(r.gradient_on_faces, 14f64.sqrt()), "{r:?}");
        assert!(near(r.second, 0.0) && near(r.eps, 2.0 + 2.0 * 3.5 + 3.0 * 0.75), "{r:?}");
    }

    /// Planes and rods of nodes have only the differences that fit into them.
    #[test]
    fn lattices_of_two_nodes_along_an_axis_have_no_more_than_a_slope_there() {
        for dims in [[2, 9, 9], [9, 2, 9], [9, 9, 2], [2, 2, 2]] {
            let f =
                Field::from_fn(dims, [1.0; 3], DVec3::ZERO, 1.0, |p| (p.x + p.y * p.z) / 4096.0)
                    .unwrap();
            let r = DerivativeBounds::new(&f);
            assert!(
                r.gradient >= 1.0 / 4096.0 && (r.second * 4096.0 - 2f64.sqrt()).abs() < 1e-6,
                "{r:?}"
            );
            assert!(r.third * 4096.0 < 1e-6, "{r:?}");
        }
    }
}
