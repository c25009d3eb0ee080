//! The shares of a cell's corners at a place, and their gradients.
//!
//! For x(q) = Σ Nᵢ(q) xᵢ the gradient in space is ∇Nᵢ = J⁻ᵀ ∂Nᵢ/∂q with the
//! Jacobian J = ∂x/∂q of the map, which Newton's method has at the end. Of cells without a map
//! of their own, as polyhedra, shares are linear in the tetrahedra of `shape::Cell`, and so are
//! their gradients.

use super::blend::{LANES, Share, set};
use super::trilinear::Trilinear;
use crate::resample::mesh::Shape;
use crate::resample::shape::Shares;
use glam::{DMat3, DVec3};

/// Newton has converged when the step, in units of the cell, is this small: the next one would be
/// of the order of its square, and the Jacobian before this step is as good as one in f32.
const CONVERGED: f64 = 1e-6;
/// Steps, at most. The first guess is that of the linear map at the middle.
const MAX_STEPS: usize = 16;
/// A cell whose corners are this near those of a parallelepiped, as a part of its size, has a
/// linear map.
const AFFINE: f64 = 1e-12;

/// How parameters follow from a place.
#[derive(Debug, Default)]
pub(super) struct Map {
    kind: MapKind,
    shape: Option<Shape>,
    shares: Shares,
    place: Trilinear,
    /// Place and inverse Jacobian at the parameters `middle`.
    middle: DVec3,
    at_middle: DVec3,
    inverse: DMat3,
}

#[derive(Debug, Default, Clone, Copy, PartialEq)]
enum MapKind {
    Affine,
    Newton,
    /// By tetrahedra.
    #[default]
    Fan,
}

impl Map {
    /// The map of a cell of this size, which is folded or not.
    pub(super) fn prepare(
        &mut self,
        corners: &[DVec3],
        shape: Shape,
        size: f64,
        is_folded: bool,
        shares: Shares,
    ) {
        self.kind = MapKind::Fan;
        self.shares = shares;
        self.middle = match shape {
            Shape::Tetra => DVec3::splat(0.25),
            Shape::Wedge => DVec3::new(1.0 / 3.0, 1.0 / 3.0, 0.5),
            Shape::Pyramid => DVec3::new(0.5, 0.5, 0.2),
            _ => DVec3::splat(0.5),
        };
        if let Some(place) = Trilinear::new(corners, &shape).filter(|_| !is_folded) {
            let (at, jacobian) = place.at(self.middle);
            let inverse = jacobian.inverse();
            if inverse.is_finite() {
                let linear = place.is_linear(AFFINE * size);
                self.kind = if linear { MapKind::Affine } else { MapKind::Newton };
                (self.place, self.at_middle, self.inverse) = (place, at, inverse);
            }
        }
        self.shape = Some(shape);
    }

    /// The parameters of a place, and the inverse of the Jacobian there. `None` when Newton's
    /// method fails, and for cells without a map.
    fn parameters(&self, at: DVec3) -> Option<(DVec3, DMat3)> {
        let q = self.middle + self.inverse * (at - self.at_middle);
        match self.kind {
            MapKind::Affine => return Some((q, self.inverse)),
            MapKind::Fan => return None,
            MapKind::Newton => {}
        }
        let within = |q: DVec3| q.clamp(DVec3::splat(-0.5), DVec3::splat(1.5));
        let mut q = within(q);
        for _ in 0..MAX_STEPS {
            let (x, jacobian) = self.place.at(q);
            let inverse = jacobian.inverse();
            let next = within(q + inverse * (at - x));
            let moved = (next - q).abs().max_element();
            q = next;
            // NaN has not converged either.
            if moved <= CONVERGED {
                return Some((q, inverse));
            }
            if !moved.is_finite() {
                break;
            }
        }
        None
    }
}

/// The shares of the corners at `at`, and their slopes along parameters, whose gradients in space
/// are the columns of the result. Places are relative to the cell's origin. `None` when there are
/// no shares: all tetrahedra of the cell are flat.
pub(super) fn shares(
    corners: &[DVec3],
    map: &Map,
    at: DVec3,
    out: &mut Vec<Share>,
) -> Option<DMat3> {
    let shape = map.shape.as_ref()?;
    out.clear();
    out.resize(corners.len().div_ceil(LANES), Share::NONE);
    let Some((q, inverse)) = map.parameters(at) else {
        return by_tetrahedra(corners, shape, at, out).then_some(DMat3::IDENTITY);
    };
    match (shape, map.shares, &mut out[..]) {
        (Shape::Tetra, _, [share]) => *share = Share::of_tetrahedron(q),
        (Shape::Hexa, Shares::OfElement, [lower, upper]) => {
            [*lower, *upper] = Share::of_hexahedron(q);
        }
        _ => {
            let (n, d) = map.shares.at(shape, q);
            for i in 0..corners.len() {
                set(out, i, n[i], d[i]);
            }
        }
    }
    Some(inverse.transpose())
}

/// The shares in that tetrahedron, between the cell's middle, a face's middle and an edge, which
/// the place is in or nearest to.
fn by_tetrahedra(corners: &[DVec3], shape: &Shape, at: DVec3, out: &mut [Share]) -> bool {
    let centre = corners.iter().sum::<DVec3>() / corners.len() as f64;
    // How far outside, the shares of the face's middle and the edge, their gradients, the edge.
    let mut best: Option<(f64, DVec3, DMat3, [u32; 2])> = None;
    let mut best_face: Vec<u32> = Vec::new();
    shape.each_face(|face| {
        let sum: DVec3 = face.iter().map(|&i| corners[i as usize]).sum();
        let on_face = sum / face.len() as f64;
        for i in 0..face.len() {
            let edge = [face[i], face[(i + 1) % face.len()]];
            let [a, b] = edge.map(|k| corners[k as usize] - centre);
            let inverse = DMat3::from_cols(on_face - centre, a, b).inverse();
            if !inverse.is_finite() {
                continue;
            }
            let w = inverse * (at - centre);
            let outside = (w.x + w.y + w.z - 1.0).max((-w).max_element()).max(0.0);
            if best.as_ref().is_none_or(|b| outside < b.0) {
                best = Some((outside, w, inverse.transpose(), edge));
                best_face.clear();
                best_face.extend(face);
            }
        }
    });
    let Some((_, w, rows, edge)) = best else { return false };
    let gradients = [rows.x_axis, rows.y_axis, rows.z_axis];
    let of_centre = (1.0 - w.x - w.y - w.z, -(gradients[0] + gradients[1] + gradients[2]));
    let (all, of_face) = (corners.len() as f64, best_face.len() as f64);
    for i in 0..corners.len() {
        let (mut n, mut d) = (of_centre.0 / all, of_centre.1 / all);
        // A corner may be twice in a face that collapsed.
        for _ in best_face.iter().filter(|&&k| k as usize == i) {
            (n, d) = (n + w.x / of_face, d + gradients[0] / of_face);
        }
        for (k, share, gradient) in [(edge[0], w.y, gradients[1]), (edge[1], w.z, gradients[2])] {
            if k as usize == i {
                (n, d) = (n + share, d + gradient);
            }
        }
        set(out, i, n, d);
    }
    true
}
