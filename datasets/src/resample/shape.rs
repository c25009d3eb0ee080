//! Finds the parametric coordinates of a point in a cell, and the value there.
//!
//! Hexahedra, wedges and pyramids are isoparametric finite elements (orders of VTK; shape functions
//! as in "The VTK User's Guide", and, for the pyramid, a hexahedron whose upper face is one point).
//! Newton's method inverts their maps. If the map folds (corners with Jacobians of both signs,
//! collapsed edges) or Newton fails, the cell becomes a fan of tetrahedra around its centre and the
//! centres of its faces, which joins its neighbours at their corners and edges.

use super::mesh::Shape;
use glam::{DMat3, DVec3};

/// Result of locating a point in a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CellSample {
    /// Interpolated value.
    pub(super) value: f64,
    /// Distance outside the cell, in units of the cell; 0 inside.
    pub(super) outside: f64,
}

/// A cell with its corners, prepared for queries at many points.
pub(super) struct Cell<'a> {
    corners: &'a [DVec3],
    values: &'a [f64],
    shape: &'a Shape,
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

/// Shape functions and their derivatives along the three parameters.
type Basis = ([f64; 8], [DVec3; 8]);

fn basis(shape: &Shape, q: DVec3) -> Basis {
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
    pub(super) fn new(corners: &'a [DVec3], values: &'a [f64], shape: &'a Shape) -> Self {
        let (low, high) = corners
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
        let mut cell = Cell { corners, values, shape, folded: false, size: (high - low).length() };
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

    /// True when the cell's own map cannot be used.
    pub(super) fn is_folded(&self) -> bool {
        self.folded
    }

    /// Position relative to the first corner, Jacobian and interpolated value at parameters `q`.
    fn map(&self, q: DVec3) -> (DVec3, DMat3, f64) {
        let (n, d) = basis(self.shape, q);
        let (mut x, mut j, mut value) = (DVec3::ZERO, DMat3::ZERO, 0.0);
        for (i, (&p, &v)) in self.corners.iter().zip(self.values).enumerate() {
            let p = p - self.corners[0];
            x += n[i] * p;
            j.x_axis += d[i].x * p;
            j.y_axis += d[i].y * p;
            j.z_axis += d[i].z * p;
            // 0 · NaN is NaN: a corner without weight must not affect the value.
            if n[i] != 0.0 {
                value += n[i] * v;
            }
        }
        (x, j, value)
    }

    /// Locates `p` in the cell and interpolates the value.
    pub(super) fn locate(&self, p: DVec3) -> Option<CellSample> {
        match self.shape {
            Shape::Tetra => {
                let c = self.corners;
                let weights = barycentric(c[0], c[1], c[2], c[3], p, self.size)?;
                Some(cell_sample(&weights, self.values.iter().copied()))
            }
            Shape::Faces(_) => self.in_fan(p),
            _ if self.folded => self.in_fan(p),
            _ => self.by_newton(p).or_else(|| self.in_fan(p)),
        }
    }

    fn by_newton(&self, p: DVec3) -> Option<CellSample> {
        let target = p - self.corners[0];
        let third = DVec3::new(1.0 / 3.0, 1.0 / 3.0, 0.5);
        let mut q = if *self.shape == Shape::Wedge { third } else { DVec3::splat(0.5) };
        for _ in 0..MAX_STEPS {
            let (x, jacobian, value) = self.map(q);
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
                return Some(CellSample { value, outside });
            }
        }
        None
    }

    /// The best result of the tetrahedra between the cell's centre, face centres and edges.
    fn in_fan(&self, p: DVec3) -> Option<CellSample> {
        let centre = mean(self.corners.iter().copied());
        let centre_value = self.values.iter().sum::<f64>() / self.values.len() as f64;
        let mut best: Option<CellSample> = None;
        let mut consider = |face: DVec3, face_value: f64, a: u32, b: u32| {
            let (a, b) = (a as usize, b as usize);
            let (pa, pb) = (self.corners[a], self.corners[b]);
            let Some(w) = barycentric(centre, face, pa, pb, p, self.size) else { return };
            let sample = cell_sample(
                &w,
                [centre_value, face_value, self.values[a], self.values[b]].into_iter(),
            );
            if best.is_none_or(|b| sample.outside < b.outside) {
                best = Some(sample);
            }
        };
        let mut each_face = |face: &mut dyn ExactSizeIterator<Item = u32>| {
            let ids: Vec<u32> = face.collect();
            if ids.len() == 3 {
                let a = ids[0] as usize;
                return consider(self.corners[a], self.values[a], ids[1], ids[2]);
            }
            let at = mean(ids.iter().map(|&i| self.corners[i as usize]));
            let value =
                ids.iter().map(|&i| self.values[i as usize]).sum::<f64>() / ids.len().max(1) as f64;
            for i in 0..ids.len() {
                consider(at, value, ids[i], ids[(i + 1) % ids.len()]);
            }
        };
        const HEXA: [[u32; 4]; 6] =
            [[0, 4, 7, 3], [1, 2, 6, 5], [0, 1, 5, 4], [3, 7, 6, 2], [0, 3, 2, 1], [4, 5, 6, 7]];
        const WEDGE: [&[u32]; 5] =
            [&[0, 1, 2], &[3, 5, 4], &[0, 3, 4, 1], &[1, 4, 5, 2], &[2, 5, 3, 0]];
        const PYRAMID: [&[u32]; 5] =
            [&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]];
        match self.shape {
            Shape::Faces(faces) => faces.iter().for_each(|f| each_face(&mut f.iter().copied())),
            Shape::Wedge => WEDGE.iter().for_each(|f| each_face(&mut f.iter().copied())),
            Shape::Pyramid => PYRAMID.iter().for_each(|f| each_face(&mut f.iter().copied())),
            _ => HEXA.iter().for_each(|f| each_face(&mut f.iter().copied())),
        }
        best
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

fn cell_sample(weights: &[f64; 4], values: impl Iterator<Item = f64>) -> CellSample {
    let value = weights.iter().zip(values).map(|(w, v)| if *w == 0.0 { 0.0 } else { w * v }).sum();
    let outside = weights.iter().fold(0.0f64, |o, w| o.max(-w));
    CellSample { value, outside }
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
            let cell = Cell::new(&points, &values, &shape);
            assert!(!cell.is_folded());
            let mut inside = 0;
            for i in 0..1000 {
                let p = DVec3::new((i % 10) as f64, (i / 10 % 10) as f64, (i / 100) as f64) * 0.11;
                if let Some(at) = cell.locate(p).filter(|at| at.outside == 0.0) {
                    inside += 1;
                    assert!((at.value - linear(p)).abs() < 1e-10, "{shape:?} at {p}: {at:?}");
                }
            }
            assert!(inside > 50, "{shape:?}: only {inside} points inside");
        }
    }

    #[test]
    fn inside_and_outside_of_a_cube() {
        let points = corners(&CUBE);
        let values = vec![0.0; 8];
        let cell = Cell::new(&points, &values, &Shape::Hexa);
        for (p, outside) in [
            ([0.5, 0.5, 0.5], 0.0),
            ([1.0, 1.0, 1.0], 0.0),
            ([1.1, 0.5, 0.5], 0.1),
            ([0.5, -0.2, 1.1], 0.2),
        ] {
            let got = cell.locate(DVec3::from(p)).unwrap().outside;
            assert!((got - outside).abs() < 1e-12, "{p:?}: {got}");
        }
        assert!(cell.locate(DVec3::splat(50.0)).is_none_or(|at| at.outside >= 0.5));
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
            let cell = Cell::new(&points, &values, &Shape::Hexa);
            assert_eq!(cell.is_folded(), folded);
            let at = cell.locate(p).unwrap();
            assert!(at.outside < 1e-12 && (at.value - linear(p)).abs() < 1e-12, "{at:?}");
        }
        // No volume at all.
        let flat: Vec<DVec3> = corners(&CUBE).iter().map(|p| DVec3::new(p.x, p.y, 0.0)).collect();
        let cell = Cell::new(&flat, &[0.0; 8], &Shape::Hexa);
        assert!(cell.is_folded() && cell.locate(DVec3::new(0.5, 0.5, 0.0)).is_none());
    }

    #[test]
    fn far_from_the_origin_no_digits_are_lost_in_the_cell() {
        let far = DVec3::splat(1e6);
        let points: Vec<DVec3> = corners(&CUBE).iter().map(|p| far + *p * 1e-3).collect();
        let values: Vec<f64> = corners(&CUBE).iter().map(|p| linear(*p)).collect();
        let at =
            Cell::new(&points, &values, &Shape::Hexa).locate(far + DVec3::splat(0.5e-3)).unwrap();
        // 1e6 has an ulp of 1.2e-10, which is 1.2e-7 of the cell.
        assert!((at.value - linear(DVec3::splat(0.5))).abs() < 1e-6);
    }
}
