//! Converts vertices to spheres, and lines and edges to tubes.

use super::GeometrySet;
use crate::input::{Cells, Shape};
use rt_core::glam::DVec3;
use rt_core::shapes::{Radii, Spheres, Tubes};
use std::collections::HashSet;
use std::sync::Arc;

/// Adds spheres and tubes if `shape` gives radii.
pub(super) fn add(shape: &Shape<'_>, built: &mut GeometrySet) {
    if shape.point_radius > 0.0 && !shape.verts.is_empty() {
        let centers = points_of(shape, &shape.verts);
        built.spheres =
            Spheres::from_f64_centers(&centers, Radii::Common(shape.point_radius as f32))
                .ok()
                .map(Arc::new);
    }
    if shape.line_radius > 0.0 {
        let (mut points, mut offsets) = (Vec::new(), vec![0u32]);
        let mut add_line = |line: &mut dyn Iterator<Item = DVec3>| {
            points.extend(line);
            offsets.push(points.len() as u32);
        };
        for i in 0..shape.lines.len() {
            let run = shape.lines.run(i);
            add_line(&mut run.filter_map(|k| point(shape, &shape.lines, k)));
        }
        if shape.edges_only {
            let exists = |e: &[u32; 2]| (e[1] as usize) < shape.points.len();
            for [a, b] in edges(&shape.polys).into_iter().filter(exists) {
                let ends = [a, b].map(|v| shape.points.at(v as usize));
                add_line(&mut ends.into_iter());
            }
        }
        if points.len() >= 2 {
            let radii = Radii::Common(shape.line_radius as f32);
            built.tubes = Tubes::from_f64_points(&points, &offsets, radii).ok().map(Arc::new);
        }
    }
}

fn point(shape: &Shape<'_>, cells: &Cells<'_>, k: usize) -> Option<DVec3> {
    let v = cells.connectivity.vertex(k) as usize;
    (v < shape.points.len()).then(|| shape.points.at(v))
}

fn points_of(shape: &Shape<'_>, cells: &Cells<'_>) -> Vec<DVec3> {
    (0..cells.len()).flat_map(|i| cells.run(i)).filter_map(|k| point(shape, cells, k)).collect()
}

/// Lists each edge of the polygons once, in order of first appearance.
fn edges(polys: &Cells<'_>) -> Vec<[u32; 2]> {
    let (mut seen, mut out) = (HashSet::new(), Vec::new());
    for i in 0..polys.len() {
        let run = polys.run(i);
        for k in run.clone() {
            let next = if k + 1 < run.end { k + 1 } else { run.start };
            let (a, b) = (polys.connectivity.vertex(k), polys.connectivity.vertex(next));
            let edge = [a.min(b), a.max(b)];
            if a != b && edge[1] != u32::MAX && seen.insert(edge) {
                out.push(edge);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::{Ids, Points};

    #[test]
    fn edges_shared_by_two_polygons_are_drawn_once() {
        let quads = Cells {
            offsets: Ids::I64(&[0, 4, 8]),
            connectivity: Ids::I64(&[0, 1, 2, 3, 1, 4, 5, 2]),
        };
        assert_eq!(edges(&quads).len(), 7);
    }

    #[test]
    fn spheres_and_tubes_come_only_when_asked_for() {
        let points = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0]];
        let line = Cells { offsets: Ids::I64(&[0, 2]), connectivity: Ids::I64(&[0, 1]) };
        let shape = Shape {
            lines: line,
            verts: line,
            ..Shape::polygons(1, Points::F32(&points), Cells::NONE)
        };
        let built = super::super::build(&shape);
        assert!(built.mesh.is_none() && built.spheres.is_none() && built.tubes.is_none());
        let built = super::super::build(&Shape { line_radius: 0.1, point_radius: 0.2, ..shape });
        assert!(built.spheres.is_some() && built.tubes.is_some());
    }
}
