//! The maps of hexahedra, wedges, pyramids and tetrahedra from their parameters to places, as
//! polynomials.
//!
//! All of them are x(r, s, t) = a r + b s + c t + d rs + e rt + f st + g rst, relative to the first
//! corner. A place and its Jacobian take a fraction of the operations that sums over the corners'
//! shape functions take.

use crate::resample::mesh::Shape;
use glam::{DMat3, DVec3};

/// Coefficients of the map of a cell, in the order of the text above.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Trilinear {
    of: [DVec3; 7],
}

impl Trilinear {
    /// The map of a cell with these corners; the first one is the origin. `None` for polyhedra,
    /// which have none.
    pub(super) fn new(corners: &[DVec3], shape: &Shape) -> Option<Trilinear> {
        let none = DVec3::ZERO;
        let of = match (shape, corners) {
            (Shape::Tetra, [_, a, b, c, ..]) => [*a, *b, *c, none, none, none, none],
            (Shape::Hexa, &[_, a, ab, b, c, ac, abc, bc, ..]) => {
                let (rs, rt, st) = (ab - a - b, ac - a - c, bc - b - c);
                [a, b, c, rs, rt, st, abc - ab - c - rt - st]
            }
            (Shape::Wedge, &[_, a, b, c, ac, bc, ..]) => {
                [a, b, c, none, ac - a - c, bc - b - c, none]
            }
            // The square at the bottom shrinks to the apex.
            (Shape::Pyramid, &[_, a, ab, b, c, ..]) => {
                let rs = ab - a - b;
                [a, b, c, rs, -a, -b, -rs]
            }
            _ => return None,
        };
        Some(Trilinear { of })
    }

    /// Whether the map is linear but for this distance.
    pub(super) fn is_linear(&self, within: f64) -> bool {
        self.of[3..].iter().all(|c| c.length() <= within)
    }

    /// Place relative to the first corner, and Jacobian.
    #[inline]
    pub(super) fn at(&self, q: DVec3) -> (DVec3, DMat3) {
        let [a, b, c, rs, rt, st, rst] = self.of;
        let (r, s, t) = (q.x, q.y, q.z);
        let bend = rs + rst * t;
        let by_r = a + rt * t + bend * s;
        let across = b + st * t;
        let by_s = across + bend * r;
        let by_t = c + rt * r + (st + rst * r) * s;
        (by_r * r + across * s + c * t, DMat3::from_cols(by_r, by_s, by_t))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::resample::shape::basis;

    #[test]
    fn maps_are_those_of_the_shape_functions() {
        let corners = [
            [0.0, 0.0, 0.0],
            [1.1, 0.1, -0.1],
            [1.0, 0.9, 0.2],
            [-0.1, 1.2, 0.1],
            [0.1, -0.2, 1.0],
            [0.9, 0.1, 1.1],
            [1.2, 1.1, 0.8],
            [0.2, 0.9, 1.3],
        ]
        .map(DVec3::from);
        let q = DVec3::new(0.3, 0.45, 0.2);
        for (shape, count) in [(Shape::Hexa, 8), (Shape::Wedge, 6), (Shape::Pyramid, 5)] {
            let map = Trilinear::new(&corners[..count], &shape).unwrap();
            let (n, d) = basis(&shape, q);
            let (place, jacobian) = map.at(q);
            let sum =
                |f: &dyn Fn(usize) -> f64| (0..count).map(|i| corners[i] * f(i)).sum::<DVec3>();
            assert!((place - sum(&|i| n[i])).length() < 1e-15, "{shape:?}");
            for axis in 0..3 {
                let column = jacobian.col(axis) - sum(&|i| d[i][axis]);
                assert!(column.length() < 1e-15, "{shape:?}, axis {axis}");
            }
            assert!(!map.is_linear(1e-3), "{shape:?}");
        }
        let tetrahedron = Trilinear::new(&corners[..4], &Shape::Tetra).unwrap();
        assert!(tetrahedron.is_linear(0.0));
        assert_eq!(tetrahedron.at(DVec3::X).0, corners[1]);
        assert!(Trilinear::new(&corners, &Shape::Faces(vec![])).is_none());
    }
}
