//! The shares of a cell's corners at a place, and their gradients.
//!
//! For x(q) = Σ Nᵢ(q) xᵢ the gradient in space is ∇Nᵢ = J⁻ᵀ ∂Nᵢ/∂q with the
//! Jacobian J = ∂x/∂q of the map, which Newton's method has at the end. Of cells without a map
//! of their own, as polyhedra, shares are linear in the tetrahedra of `shape::Cell`, and so are
//! their gradients.

use super::blend::{LANES, Share, set};
use crate::resample::mesh::Shape;
use crate::resample::shape::{Cell, Shares, basis};
use glam::{DMat3, DVec3};

/// Newton has converged when the step, in units of the cell, is this small: the next one would be
/// of the order of its square.
const CONVERGED: f64 = 1e-7;
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
    pub(super) fn prepare(&mut self, corners: &[DVec3], shape: &Shape, size: f64, shares: Shares) {
        self.kind = MapKind::Newton;
        self.shares = shares;
        self.middle = match shape {
            Shape::Tetra => DVec3::splat(0.25),
            Shape::Wedge => DVec3::new(1.0 / 3.0, 1.0 / 3.0, 0.5),
            Shape::Pyramid => DVec3::new(0.5, 0.5, 0.2),
            _ => DVec3::splat(0.5),
        };
        let folded = matches!(shape, Shape::Faces(_)) || Cell::new(corners, shape).is_folded();
        if folded {
            (self.kind, self.shape) = (MapKind::Fan, Some(shape.clone()));
            return;
        }
        let (at, jacobian) = place_and_jacobian(corners, shape, self.middle);
        let edges = match shape {
            Shape::Hexa => [corners[1], corners[3], corners[4]],
            Shape::Wedge => [corners[1], corners[2], corners[3]],
            _ => [corners[1], corners[2], corners[3.min(corners.len() - 1)]],
        };
        let off = |i: usize, p: DVec3| (corners[i] - p).length() <= AFFINE * size;
        let [a, b, c] = edges;
        let affine = match shape {
            Shape::Tetra => true,
            Shape::Hexa => off(2, a + b) && off(5, a + c) && off(6, a + b + c) && off(7, b + c),
            Shape::Wedge => off(4, a + c) && off(5, b + c),
            _ => false,
        };
        let inverse = jacobian.inverse();
        if !inverse.is_finite() {
            (self.kind, self.shape) = (MapKind::Fan, Some(shape.clone()));
            return;
        }
        if affine {
            self.kind = MapKind::Affine;
        }
        (self.at_middle, self.inverse) = (at, inverse);
        self.shape = Some(shape.clone());
    }
}

/// Place relative to the first corner, and Jacobian.
fn place_and_jacobian(corners: &[DVec3], shape: &Shape, q: DVec3) -> (DVec3, DMat3) {
    if *shape == Shape::Tetra {
        let edges = DMat3::from_cols(corners[1], corners[2], corners[3]);
        return (edges * q, edges);
    }
    let (n, d) = basis(shape, q);
    let (mut x, mut j) = (DVec3::ZERO, DMat3::ZERO);
    for (i, &p) in corners.iter().enumerate() {
        x += n[i] * p;
        j.x_axis += d[i].x * p;
        j.y_axis += d[i].y * p;
        j.z_axis += d[i].z * p;
    }
    (x, j)
}

/// The shares of the corners at `at`; both are relative to the cell's origin. False when there are
/// none: all its tetrahedra are flat.
pub(super) fn shares(corners: &[DVec3], map: &Map, at: DVec3, out: &mut Vec<Share>) -> bool {
    let groups = corners.len().div_ceil(LANES);
    out.clear();
    out.resize(groups, Share::NONE);
    let Some(shape) = &map.shape else { return false };
    if map.kind == MapKind::Fan {
        return by_tetrahedra(corners, shape, at, out);
    }
    let mut q = map.middle + map.inverse * (at - map.at_middle);
    let mut inverse = map.inverse;
    if map.kind == MapKind::Newton {
        let within = |q: DVec3| q.clamp(DVec3::splat(-0.5), DVec3::splat(1.5));
        q = within(q);
        let mut converged = false;
        for _ in 0..MAX_STEPS {
            let (x, jacobian) = place_and_jacobian(corners, shape, q);
            inverse = jacobian.inverse();
            let next = within(q + inverse * (at - x));
            let moved = (next - q).abs().max_element();
            q = next;
            // NaN has not converged either.
            if moved <= CONVERGED {
                converged = true;
                break;
            }
            if !moved.is_finite() {
                break;
            }
        }
        if !converged {
            return by_tetrahedra(corners, shape, at, out);
        }
    }
    let to_space = inverse.transpose();
    if *shape == Shape::Tetra {
        let first = 1.0 - q.x - q.y - q.z;
        set(out, 0, first, to_space * DVec3::NEG_ONE);
        for (i, axis) in DVec3::AXES.into_iter().enumerate() {
            set(out, i + 1, q[i], to_space * axis);
        }
        return true;
    }
    let (n, d) = map.shares.at(shape, q);
    for i in 0..corners.len() {
        set(out, i, n[i], to_space * d[i]);
    }
    true
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
