//! Finds the parametric coordinates of a point in a cell, and the shares of its corners there.
//!
//! Hexahedra, wedges and pyramids are isoparametric finite elements (orders of VTK; shape functions
//! as in "The VTK User's Guide", and, for the pyramid, a hexahedron whose upper face is one point).
//! Newton's method inverts their maps. If the map folds (corners with Jacobians of both signs,
//! collapsed edges) or Newton fails, the cell becomes a fan of tetrahedra around its centre and the
//! centres of its faces, which joins its neighbours at their corners and edges.
//!
//! Polynomials of corners that disagree, as at shocks, would be joined with a kink at each face:
//! the shares of elements have slopes there. Those of hexahedra can be taken at smoothstep
//! parameters instead ([`Shares::Smooth`]), which have none.

use super::mesh::Shape;
use glam::{DMat3, DVec3};

/// The functions by which the corners of a cell share in a value.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) enum Shares {
    /// The shape functions of the element.
    #[default]
    OfElement,
    /// Those of a hexahedron at smoothstep parameters: without slope across its faces. Then the
    /// gradient of a mean of polynomials is continuous where lines of the grid go straight through
    /// a face. The error in smooth fields is larger, by up to half.
    Smooth,
}

impl Shares {
    /// The shares at the parameters `q`, and their derivatives.
    pub(super) fn at(self, shape: &Shape, q: DVec3) -> Basis {
        if self == Shares::OfElement {
            return basis(shape, q);
        }
        // Beyond a bent face the smoothstep goes on, but not far.
        let q = q.clamp(DVec3::splat(-BEYOND), DVec3::splat(1.0 + BEYOND));
        let (mut n, mut d) = basis(shape, q * q * (3.0 - 2.0 * q));
        let slope = 6.0 * q * (1.0 - q);
        d.iter_mut().for_each(|d| *d *= slope);
        // The sum is 1 but for rounding, which the large values of a field would show.
        n[0] = 1.0 - n[1..].iter().sum::<f64>();
        (n, d)
    }
}

/// A cell with its corners, prepared for queries at many points.
pub(super) struct Cell<'a> {
    corners: &'a [DVec3],
    shape: &'a Shape,
    shares: Shares,
    /// Whether to use the tetrahedra for all points.
    folded: bool,
    /// Length of the diagonal of the cell's box.
    size: f64,
}

/// Newton has converged when the step is this small, in units of the cell: far below
/// [`super::rasterize::INSIDE_TOLERANCE`].
const CONVERGED: f64 = 1e-12;
/// From the centre of a convex cell, Newton's method takes three to five steps; distorted cells
/// need more.
const MAX_STEPS: usize = 25;
/// Ratio of the smallest to the largest Jacobian among corners below which a cell counts as folded
/// or collapsed.
const MIN_JACOBIAN_RATIO: f64 = 1e-6;
/// Parameters this far beyond a face have smooth shares of their own.
const BEYOND: f64 = 0.25;

/// Shape functions and their derivatives along the three parameters.
pub(super) type Basis = ([f64; 8], [DVec3; 8]);

pub(super) fn basis(shape: &Shape, q: DVec3) -> Basis {
    let (r, s, t) = (q.x, q.y, q.z);
    let (r1, s1, t1) = (1.0 - r, 1.0 - s, 1.0 - t);
    let mut n = [0.0; 8];
    let mut d = [DVec3::ZERO; 8];
    let v = DVec3::new;
    match shape {
        Shape::Wedge => {
            let u = 1.0 - r - s;
            n[..6].copy_from_slice(&[u * t1, r * t1, s * t1, u * t, r * t, s * t]);
            d[..6].copy_from_slice(&[
                v(-t1, -t1, -u),
                v(t1, 0.0, -r),
                v(0.0, t1, -s),
                v(-t, -t, u),
                v(t, 0.0, r),
                v(0.0, t, s),
            ]);
        }
        Shape::Pyramid => {
            n[..5].copy_from_slice(&[r1 * s1 * t1, r * s1 * t1, r * s * t1, r1 * s * t1, t]);
            d[..5].copy_from_slice(&[
                v(-s1 * t1, -r1 * t1, -r1 * s1),
                v(s1 * t1, -r * t1, -r * s1),
                v(s * t1, r * t1, -r * s),
                v(-s * t1, r1 * t1, -r1 * s),
                v(0.0, 0.0, 1.0),
            ]);
        }
        _ => {
            n = [
                r1 * s1 * t1,
                r * s1 * t1,
                r * s * t1,
                r1 * s * t1,
                r1 * s1 * t,
                r * s1 * t,
                r * s * t,
                r1 * s * t,
            ];
            d = [
                v(-s1 * t1, -r1 * t1, -r1 * s1),
                v(s1 * t1, -r * t1, -r * s1),
                v(s * t1, r * t1, -r * s),
                v(-s * t1, r1 * t1, -r1 * s),
                v(-s1 * t, -r1 * t, r1 * s1),
                v(s1 * t, -r * t, r * s1),
                v(s * t, r * t, r * s),
                v(-s * t, r1 * t, r1 * s),
            ];
        }
    }
    (n, d)
}

/// Parameters of the corners at which the Jacobian is tested. A pyramid's Jacobian vanishes at its
/// apex by construction.
fn corner_parameters(shape: &Shape) -> &'static [DVec3] {
    const fn v(x: f64, y: f64, z: f64) -> DVec3 {
        DVec3::new(x, y, z)
    }
    const HEXA: [DVec3; 8] = [
        v(0.0, 0.0, 0.0),
        v(1.0, 0.0, 0.0),
        v(1.0, 1.0, 0.0),
        v(0.0, 1.0, 0.0),
        v(0.0, 0.0, 1.0),
        v(1.0, 0.0, 1.0),
        v(1.0, 1.0, 1.0),
        v(0.0, 1.0, 1.0),
    ];
    const WEDGE: [DVec3; 6] = [
        v(0.0, 0.0, 0.0),
        v(1.0, 0.0, 0.0),
        v(0.0, 1.0, 0.0),
        v(0.0, 0.0, 1.0),
        v(1.0, 0.0, 1.0),
        v(0.0, 1.0, 1.0),
    ];
    match shape {
        Shape::Hexa => &HEXA,
        Shape::Pyramid => &HEXA[..4],
        Shape::Wedge => &WEDGE,
        _ => &[],
    }
}

impl<'a> Cell<'a> {
    pub(super) fn new(corners: &'a [DVec3], shape: &'a Shape) -> Self {
        let (low, high) = corners
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
        let size = (high - low).length();
        let mut cell = Cell { corners, shape, shares: Shares::OfElement, folded: false, size };
        let parameters = corner_parameters(shape);
        if !parameters.is_empty() {
            let jacobians = parameters.iter().map(|q| cell.map(*q).1.determinant());
            let (low, high) = jacobians
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), j| (l.min(j), h.max(j)));
            let (small, large) = if low + high >= 0.0 { (low, high) } else { (-high, -low) };
            cell.folded = small.is_nan() || small <= MIN_JACOBIAN_RATIO * large;
        }
        cell
    }

    /// The cell with other shares.
    pub(super) fn with_shares(self, shares: Shares) -> Self {
        Cell { shares, ..self }
    }

    /// True when the cell's own map cannot be used.
    pub(super) fn is_folded(&self) -> bool {
        self.folded
    }

    /// Position relative to the first corner and Jacobian at parameters `q`.
    fn map(&self, q: DVec3) -> (DVec3, DMat3) {
        let (n, d) = basis(self.shape, q);
        let (mut x, mut j) = (DVec3::ZERO, DMat3::ZERO);
        for (i, &p) in self.corners.iter().enumerate() {
            let p = p - self.corners[0];
            x += n[i] * p;
            j.x_axis += d[i].x * p;
            j.y_axis += d[i].y * p;
            j.z_axis += d[i].z * p;
        }
        (x, j)
    }

    /// Locates `p` in the cell: the distance outside, in units of the cell (0 inside), and in
    /// `weights` the share of each corner in the value there.
    pub(super) fn locate(&self, p: DVec3, weights: &mut Vec<f64>) -> Option<f64> {
        weights.clear();
        match self.shape {
            Shape::Tetra => {
                let c = self.corners;
                let shares = barycentric(c[0], c[1], c[2], c[3], p, self.size)?;
                weights.extend(shares);
                Some(outside_of(&shares))
            }
            Shape::Faces(_) => self.in_fan(p, weights),
            _ if self.folded => self.in_fan(p, weights),
            _ => self.by_newton(p, weights).or_else(|| self.in_fan(p, weights)),
        }
    }

    fn by_newton(&self, p: DVec3, weights: &mut Vec<f64>) -> Option<f64> {
        let target = p - self.corners[0];
        let third = DVec3::new(1.0 / 3.0, 1.0 / 3.0, 0.5);
        let mut q = if *self.shape == Shape::Wedge { third } else { DVec3::splat(0.5) };
        for _ in 0..MAX_STEPS {
            let (x, jacobian) = self.map(q);
            let det = jacobian.determinant();
            if det == 0.0 || !det.is_finite() {
                return None;
            }
            let step = jacobian.inverse() * (target - x);
            // Keep the iterate near the cell: far outside, the map may have other solutions.
            let next = (q + step).clamp(DVec3::splat(-0.5), DVec3::splat(1.5));
            let moved = (next - q).abs().max_element();
            q = next;
            if moved <= CONVERGED {
                // An iterate at the edge of the clamp has not converged to a solution: the point is
                // outside.
                let below = -q;
                let above = if *self.shape == Shape::Wedge {
                    DVec3::new(q.x + q.y - 1.0, -1.0, q.z - 1.0)
                } else {
                    q - DVec3::ONE
                };
                let outside = below.max(above).max_element().max(0.0);
                weights.extend(&self.shares.at(self.shape, q).0[..self.corners.len()]);
                return Some(outside);
            }
        }
        None
    }

    /// The best result of the tetrahedra between the cell's centre, face centres and edges.
    fn in_fan(&self, p: DVec3, weights: &mut Vec<f64>) -> Option<f64> {
        let centre = mean(self.corners.iter().copied());
        // The distance outside, the shares of centre, face and two corners, and the face.
        let mut best: Option<(f64, [f64; 4])> = None;
        let mut best_face: Vec<u32> = Vec::new();
        self.shape.each_face(|face| {
            let at = mean(face.iter().map(|&i| self.corners[i as usize]));
            for i in 0..face.len() {
                let next = (i + 1) % face.len();
                let [a, b] = [face[i], face[next]].map(|k| self.corners[k as usize]);
                let Some(shares) = barycentric(centre, at, a, b, p, self.size) else { continue };
                let outside = outside_of(&shares);
                if best.is_none_or(|(least, _)| outside < least) {
                    best = Some((outside, shares));
                    // The edge comes first.
                    best_face.clear();
                    best_face.extend((0..face.len()).map(|k| face[(i + k) % face.len()]));
                }
            }
        });
        let (outside, [of_centre, of_face, a, b]) = best?;
        weights.clear();
        weights.resize(self.corners.len(), of_centre / self.corners.len() as f64);
        for &corner in &best_face {
            weights[corner as usize] += of_face / best_face.len() as f64;
        }
        for (corner, share) in best_face.iter().zip([a, b]) {
            weights[*corner as usize] += share;
        }
        Some(outside)
    }
}

impl Shape {
    /// Calls `f` with the corners of each face.
    pub(super) fn each_face(&self, mut f: impl FnMut(&[u32])) {
        const TETRA: [&[u32]; 4] = [&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[2, 0, 3]];
        const HEXA: [&[u32]; 6] = [
            &[0, 4, 7, 3],
            &[1, 2, 6, 5],
            &[0, 1, 5, 4],
            &[3, 7, 6, 2],
            &[0, 3, 2, 1],
            &[4, 5, 6, 7],
        ];
        const WEDGE: [&[u32]; 5] =
            [&[0, 1, 2], &[3, 5, 4], &[0, 3, 4, 1], &[1, 4, 5, 2], &[2, 5, 3, 0]];
        const PYRAMID: [&[u32]; 5] =
            [&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]];
        match self {
            Shape::Faces(faces) => {
                faces.iter().filter(|face| !face.is_empty()).for_each(|face| f(face));
            }
            Shape::Tetra => TETRA.into_iter().for_each(f),
            Shape::Wedge => WEDGE.into_iter().for_each(f),
            Shape::Pyramid => PYRAMID.into_iter().for_each(f),
            Shape::Hexa => HEXA.into_iter().for_each(f),
        }
    }
}

fn mean(points: impl ExactSizeIterator<Item = DVec3>) -> DVec3 {
    let n = points.len().max(1) as f64;
    points.sum::<DVec3>() / n
}

/// Barycentric coordinates; `None` for a tetrahedron whose volume vanishes at the scale of the
/// cell.
fn barycentric(a: DVec3, b: DVec3, c: DVec3, d: DVec3, p: DVec3, size: f64) -> Option<[f64; 4]> {
    let edges = DMat3::from_cols(b - a, c - a, d - a);
    let det = edges.determinant();
    // 1e-14 of the volume of the cell's box: below this, rounding dominates.
    if det.is_nan() || det.abs() <= 1e-14 * size * size * size {
        return None;
    }
    let w = edges.inverse() * (p - a);
    Some([1.0 - w.x - w.y - w.z, w.x, w.y, w.z])
}

/// How far outside its tetrahedron a point with these coordinates is.
fn outside_of(shares: &[f64; 4]) -> f64 {
    shares.iter().fold(0.0, |most, w| most.max(-w))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CUBE: [[f64; 3]; 8] = [
        [0., 0., 0.],
        [1., 0., 0.],
        [1., 1., 0.],
        [0., 1., 0.],
        [0., 0., 1.],
        [1., 0., 1.],
        [1., 1., 1.],
        [0., 1., 1.],
    ];

    fn corners(of: &[[f64; 3]]) -> Vec<DVec3> {
        of.iter().map(|&c| DVec3::from(c)).collect()
    }
    fn linear(p: DVec3) -> f64 {
        1.0 + 2.0 * p.x - 3.0 * p.y + 0.5 * p.z
    }

    /// The distance outside and the value of a field with these values at the corners.
    fn located(cell: &Cell<'_>, values: &[f64], p: DVec3) -> Option<(f64, f64)> {
        let mut weights = vec![7.0];
        let outside = cell.locate(p, &mut weights)?;
        assert_eq!(weights.len(), values.len());
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-10, "{weights:?}");
        Some((outside, weights.iter().zip(values).map(|(w, v)| w * v).sum()))
    }

    #[test]
    fn linear_fields_are_exact_in_every_shape() {
        let mut warped = corners(&CUBE);
        warped[6] = DVec3::new(1.3, 1.2, 1.4);
        warped[3] = DVec3::new(-0.2, 1.1, 0.1);
        let wedge = corners(&[
            [0., 0., 0.],
            [1., 0., 0.],
            [0., 1., 0.],
            [0., 0., 1.],
            [1.1, 0., 1.],
            [0., 1., 1.4],
        ]);
        let pyramid =
            corners(&[[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.], [0.4, 0.6, 1.]]);
        let tetra = corners(&[[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]]);
        let faces = Shape::Faces(vec![
            vec![0, 4, 7, 3],
            vec![1, 2, 6, 5],
            vec![0, 1, 5, 4],
            vec![3, 7, 6, 2],
            vec![0, 3, 2, 1],
            vec![4, 5, 6, 7],
        ]);
        for (points, shape) in [
            (warped.clone(), Shape::Hexa),
            (warped, faces),
            (wedge, Shape::Wedge),
            (pyramid, Shape::Pyramid),
            (tetra, Shape::Tetra),
        ] {
            let values: Vec<f64> = points.iter().map(|p| linear(*p)).collect();
            let cell = Cell::new(&points, &shape);
            assert!(!cell.is_folded());
            let mut inside = 0;
            for i in 0..1000 {
                let p = DVec3::new((i % 10) as f64, (i / 10 % 10) as f64, (i / 100) as f64) * 0.11;
                if let Some((_, value)) = located(&cell, &values, p).filter(|at| at.0 == 0.0) {
                    inside += 1;
                    assert!((value - linear(p)).abs() < 1e-10, "{shape:?} at {p}: {value}");
                }
            }
            assert!(inside > 50, "{shape:?}: only {inside} points inside");
        }
    }

    #[test]
    fn inside_and_outside_of_a_cube() {
        let points = corners(&CUBE);
        let values = vec![0.0; 8];
        let cell = Cell::new(&points, &Shape::Hexa);
        for (p, outside) in [
            ([0.5, 0.5, 0.5], 0.0),
            ([1.0, 1.0, 1.0], 0.0),
            ([1.1, 0.5, 0.5], 0.1),
            ([0.5, -0.2, 1.1], 0.2),
        ] {
            let got = located(&cell, &values, DVec3::from(p)).unwrap().0;
            assert!((got - outside).abs() < 1e-12, "{p:?}: {got}");
        }
        assert!(located(&cell, &values, DVec3::splat(50.0)).is_none_or(|at| at.0 >= 0.5));
    }

    #[test]
    fn collapsed_and_turned_hexahedra() {
        // An edge collapsed to a point pair (a wedge stored as a hexahedron), as on the axis of an
        // O-grid.
        let mut collapsed = corners(&CUBE);
        collapsed[3] = collapsed[0];
        collapsed[7] = collapsed[4];
        // Inverted orientation: a left-handed lattice.
        let mirrored: Vec<DVec3> =
            corners(&CUBE).iter().map(|p| DVec3::new(-p.x, p.y, p.z)).collect();
        for (points, folded, p) in [
            (collapsed, true, DVec3::new(0.7, 0.3, 0.4)),
            (mirrored, false, DVec3::new(-0.7, 0.3, 0.4)),
        ] {
            let values: Vec<f64> = points.iter().map(|p| linear(*p)).collect();
            let cell = Cell::new(&points, &Shape::Hexa);
            assert_eq!(cell.is_folded(), folded);
            let (outside, value) = located(&cell, &values, p).unwrap();
            assert!(outside < 1e-12 && (value - linear(p)).abs() < 1e-12, "{outside} {value}");
        }
        // No volume at all.
        let flat: Vec<DVec3> = corners(&CUBE).iter().map(|p| DVec3::new(p.x, p.y, 0.0)).collect();
        let cell = Cell::new(&flat, &Shape::Hexa);
        assert!(cell.is_folded() && located(&cell, &[0.0; 8], DVec3::splat(0.5)).is_none());
    }

    #[test]
    fn far_from_the_origin_no_digits_are_lost_in_the_cell() {
        let far = DVec3::splat(1e6);
        let points: Vec<DVec3> = corners(&CUBE).iter().map(|p| far + *p * 1e-3).collect();
        let values: Vec<f64> = corners(&CUBE).iter().map(|p| linear(*p)).collect();
        let cell = Cell::new(&points, &Shape::Hexa);
        let (_, value) = located(&cell, &values, far + DVec3::splat(0.5e-3)).unwrap();
        // 1e6 has an ulp of 1.2e-10, which is 1.2e-7 of the cell.
        assert!((value - linear(DVec3::splat(0.5))).abs() < 1e-6);
    }
}
