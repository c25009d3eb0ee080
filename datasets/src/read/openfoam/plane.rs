//! Two-dimensional cases: OpenFOAM computes them on a mesh that is one cell thick, between patches
//! of type `empty` (a plane flow) or `wedge` (an axisymmetric one). They become polygons in the
//! plane.

use super::poly_mesh::{Patch, PolyMesh, wall_points};
use crate::model::{Cells, Points, UnstructuredGrid};
use glam::{DMat3, DVec3};

const TRIANGLE: u8 = 5;
const POLYGON: u8 = 7;
const QUAD: u8 = 9;

/// What a one-cell-thick mesh stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Symmetry {
    /// The flow does not depend on the coordinate across.
    Plane,
    /// The flow does not depend on the angle about an axis.
    Axis,
}

/// Front faces that deviate more from a plane, relative to the size of the mesh, are not flat.
const FLATNESS: f64 = 1e-5;

/// The cells as polygons with the numbers of the cells: for a plane flow halfway between the
/// patches, for an axisymmetric one with x along the axis and y the radius. `None` if the mesh is
/// three-dimensional.
pub(super) fn flattened(mesh: &PolyMesh) -> Option<(UnstructuredGrid, Symmetry)> {
    let of = |kind: &str| front_and_back(mesh, |p| p.kind == kind);
    if let Some(sides) = of("wedge") {
        return Some((around_axis(mesh, &sides)?, Symmetry::Axis));
    }
    Some((between(mesh, &of("empty")?)?, Symmetry::Plane))
}

/// The two faces of each cell on such patches; `None` unless every cell has two.
fn front_and_back(mesh: &PolyMesh, is_side: impl Fn(&Patch) -> bool) -> Option<Vec<[usize; 2]>> {
    let mut sides = vec![[usize::MAX; 2]; mesh.cells];
    for face in mesh.patches.iter().filter(|p| is_side(p)).flat_map(|p| p.faces.clone()) {
        let side = &mut sides[mesh.owner[face] as usize];
        let free = side.iter().position(|f| *f == usize::MAX)?;
        side[free] = face;
    }
    (mesh.cells > 0 && sides.iter().all(|s| s[1] != usize::MAX)).then_some(sides)
}

/// Twice the area of a face along its normal.
fn normal(mesh: &PolyMesh, face: usize) -> DVec3 {
    let ids = mesh.faces.get(face);
    let point = |k: usize| DVec3::from(mesh.points[ids[k] as usize]);
    let first = point(0);
    (1..ids.len() - 1).map(|k| (point(k) - first).cross(point(k + 1) - first)).sum()
}

/// The direction, with its largest component positive.
fn forward(v: DVec3) -> DVec3 {
    let largest = v.abs().max_position();
    if v[largest] < 0.0 { -v } else { v }
}

fn size(mesh: &PolyMesh) -> f64 {
    let nothing = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let points = mesh.points.iter().map(|p| DVec3::from(*p));
    let (low, high) = points.fold(nothing, |(l, h), p| (l.min(p), h.max(p)));
    (high - low).max_element()
}

fn between(mesh: &PolyMesh, sides: &[[usize; 2]]) -> Option<UnstructuredGrid> {
    let across = forward(normal(mesh, sides[0][0])).try_normalize()?;
    let height = |face: usize| {
        let ids = mesh.faces.get(face);
        let sum: f64 = ids.iter().map(|&k| DVec3::from(mesh.points[k as usize]).dot(across)).sum();
        sum / ids.len() as f64
    };
    let [low, high] = {
        let [a, b] = sides[0].map(height);
        [a.min(b), a.max(b)]
    };
    let tolerance = FLATNESS * size(mesh);
    let middle = 0.5 * (low + high);
    let mut fronts = Vec::with_capacity(sides.len());
    for side in sides {
        let [a, b] = side.map(height);
        let front = if a > b { side[0] } else { side[1] };
        let flat = |face: usize, at: f64| {
            let ids = mesh.faces.get(face).iter();
            let far = |&k: &u32| DVec3::from(mesh.points[k as usize]).dot(across) - at;
            ids.map(far).all(|d| d.abs() <= tolerance)
        };
        if !flat(front, high) {
            return None;
        }
        fronts.push(front);
    }
    let onto = |p: DVec3| p + across * (middle - p.dot(across));
    Some(polygons(mesh, &fronts, across, onto))
}

fn around_axis(mesh: &PolyMesh, sides: &[[usize; 2]]) -> Option<UnstructuredGrid> {
    let [a, b] = sides[0].map(|face| normal(mesh, face).normalize_or_zero());
    let axis = forward(a.cross(b).try_normalize()?);
    // The point of both planes that is nearest to the origin along the axis.
    let on = |face: usize| DVec3::from(mesh.points[mesh.faces.get(face)[0] as usize]);
    let rows = DMat3::from_cols(a, b, axis).transpose();
    if rows.determinant() == 0.0 {
        return None;
    }
    let centre = rows.inverse() * DVec3::new(a.dot(on(sides[0][0])), b.dot(on(sides[0][1])), 0.0);
    let tolerance = FLATNESS * size(mesh);
    let mut fronts = Vec::with_capacity(sides.len());
    for side in sides {
        // The face on the plane of the first cell's first face.
        let lies = |face: &&usize| {
            let far = |&k: &u32| (DVec3::from(mesh.points[k as usize]) - centre).dot(a).abs();
            mesh.faces.get(**face).iter().map(far).all(|d| d <= tolerance)
        };
        fronts.push(*side.iter().find(lies)?);
    }
    let onto = |p: DVec3| {
        let along = (p - centre).dot(axis);
        DVec3::new(along, (p - centre - along * axis).length(), 0.0)
    };
    Some(polygons(mesh, &fronts, DVec3::Z, onto))
}

/// One polygon for each cell, counter-clockwise as seen from the tip of `up`.
fn polygons(
    mesh: &PolyMesh,
    fronts: &[usize],
    up: DVec3,
    onto: impl Fn(DVec3) -> DVec3,
) -> UnstructuredGrid {
    let mut new_id = vec![Cells::NO_POINT; mesh.points.len()];
    let mut points: Vec<[f64; 3]> = Vec::new();
    let mut grid = UnstructuredGrid::default();
    for &face in fronts {
        let mut ids: Vec<u32> = Vec::new();
        for &old in mesh.faces.get(face) {
            let id = &mut new_id[old as usize];
            if *id == Cells::NO_POINT {
                *id = points.len() as u32;
                points.push(onto(DVec3::from(mesh.points[old as usize])).to_array());
            }
            ids.push(*id);
        }
        let at = |k: usize| DVec3::from(points[ids[k] as usize]);
        let area: DVec3 =
            (1..ids.len() - 1).map(|k| (at(k) - at(0)).cross(at(k + 1) - at(0))).sum();
        if area.dot(up) < 0.0 {
            ids.reverse();
        }
        grid.types.push(match ids.len() {
            3 => TRIANGLE,
            4 => QUAD,
            _ => POLYGON,
        });
        grid.cells.push(ids);
    }
    let is_wall = mesh.wall_points();
    let walls = new_id.iter().zip(&is_wall).filter(|(id, wall)| **wall && **id != Cells::NO_POINT);
    grid.attributes.field.push(wall_points(walls.map(|(id, _)| *id)));
    grid.points = Points::F64(points);
    grid
}
