//! Contours against fields whose surfaces are known, and against each other.

use super::*;
use crate::generate::wavelet::Wavelet;
use crate::model::{
    Attributes, Block, CellType, Cells, DataArray, ImageData, Points, StructuredGrid,
    UnstructuredGrid, Values,
};
use std::collections::HashMap;

/// The cells of an n x n x n lattice of the unit cube as cells of one kind.
fn cube(n: usize, kind: u8) -> UnstructuredGrid {
    let at = |k: usize| k as f64 / n as f64;
    let mut points = Vec::new();
    for k in 0..=n {
        for j in 0..=n {
            points.extend((0..=n).map(|i| [at(i), at(j), at(k)]));
        }
    }
    let id = |i: usize, j: usize, k: usize| (i + (n + 1) * (j + (n + 1) * k)) as u32;
    let mut grid = UnstructuredGrid { points: Points::F64(points), ..Default::default() };
    for (k, j, i) in (0..n * n * n).map(|c| (c / n / n, c / n % n, c % n)) {
        let p = |x: usize, y: usize, z: usize| id(i + x, j + y, k + z);
        let hex = [
            p(0, 0, 0),
            p(1, 0, 0),
            p(1, 1, 0),
            p(0, 1, 0),
            p(0, 0, 1),
            p(1, 0, 1),
            p(1, 1, 1),
            p(0, 1, 1),
        ];
        let parts: &[&[usize]] = match kind {
            10 => &[
                &[0, 1, 2, 6],
                &[0, 2, 3, 6],
                &[0, 3, 7, 6],
                &[0, 7, 4, 6],
                &[0, 4, 5, 6],
                &[0, 5, 1, 6],
            ],
            13 => &[&[0, 1, 2, 4, 5, 6], &[0, 2, 3, 4, 6, 7]],
            _ => &[&[0, 1, 2, 3, 4, 5, 6, 7]],
        };
        for part in parts {
            grid.cells.push(part.iter().map(|&c| hex[c]));
            grid.types.push(kind);
            if kind == 42 {
                let first = grid.polyhedron_faces.len();
                let CellType::Solid(table) = CellType::of(12) else { unreachable!("a hexahedron") };
                for face in table {
                    grid.polyhedron_faces.push(face.iter().map(|&c| hex[usize::from(c)]));
                }
                grid.faces_of_cell.push(first..first + 6);
            }
        }
    }
    grid
}

fn with_field(mut grid: UnstructuredGrid, field: impl Fn(DVec3) -> f64) -> Dataset {
    let values = (0..grid.points.len()).map(|i| field(grid.points.get(i))).collect();
    grid.attributes.point.push(DataArray::new("f", 1, Values::F64(values)));
    Dataset::UnstructuredGrid(grid)
}

fn ball(p: DVec3) -> f64 {
    (p - 0.5).length()
}

fn of_values<'a>(isovalues: &'a [f64]) -> ContourOf<'a> {
    ContourOf::Values { array: "f", isovalues }
}

/// Edges that do not have two triangles, found by the bits of their ends.
fn open_edges(mesh: &TriMesh) -> usize {
    let bits = |k: u32| mesh.positions[k as usize].to_array().map(f32::to_bits);
    let mut edges: HashMap<[[u32; 3]; 2], i32> = HashMap::new();
    for t in &mesh.indices {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            let (a, b) = (bits(a), bits(b));
            if a != b {
                *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
            }
        }
    }
    edges.values().filter(|n| **n != 0).count()
}

fn area(mesh: &TriMesh) -> f64 {
    let corner = |k: u32| mesh.positions[k as usize].as_dvec3();
    let twice = |t: &[u32; 3]| {
        let [a, b, c] = t.map(corner);
        (b - a).cross(c - a).length()
    };
    0.5 * mesh.indices.iter().map(twice).sum::<f64>()
}

#[test]
fn balls_of_cells_of_every_shape_are_closed_and_have_their_area() {
    for kind in [10, 12, 13, 42] {
        let data = with_field(cube(16, kind), ball);
        let found = contour(&data, &of_values(&[0.3]), None, None).unwrap();
        assert!(found.report.solids >= 16 * 16 * 16, "{kind}");
        assert_eq!(open_edges(&found.mesh), 0, "{kind}");
        let expected = 4.0 * std::f64::consts::PI * 0.09;
        let error = (area(&found.mesh) / expected - 1.0).abs();
        assert!(error < 0.02, "{kind}: {error}");
        assert!(found.report.warnings().is_empty());
    }
}

#[test]
fn a_plane_of_a_warped_lattice_is_flat_and_complete() {
    let n = 6_usize;
    let mut points = Vec::new();
    for (k, j, i) in (0..n * n * n).map(|c| (c / n / n, c / n % n, c % n)) {
        let [x, y, z] = [i, j, k].map(|c| c as f64 / (n - 1) as f64);
        let inside = [i, j, k].iter().all(|&c| c > 0 && c + 1 < n);
        let shift = if inside { 0.05 * (7.0 * x + 3.0 * y).sin() } else { 0.0 };
        points.push([x + shift, y - shift, z + shift]);
    }
    let end = n as i32 - 1;
    let mut grid = StructuredGrid {
        extent: [0, end, 0, end, 0, end],
        points: Points::F64(points),
        attributes: Attributes::default(),
    };
    let values = (0..n * n * n).map(|i| grid.points.get(i).x).collect();
    grid.attributes.point.push(DataArray::new("x", 1, Values::F64(values)));
    let data = Dataset::StructuredGrid(grid);
    let plane = ContourOf::Plane { point: DVec3::splat(0.47), normal: DVec3::new(0.0, 0.0, 3.0) };
    let found = contour(&data, &plane, Some("x"), None).unwrap();
    assert!((area(&found.mesh) - 1.0).abs() < 1e-6, "{}", area(&found.mesh));
    let scalars = &found.mesh.scalars.as_ref().unwrap().values;
    for (p, s) in found.mesh.positions.iter().zip(scalars) {
        assert!((p.z - 0.47).abs() < 1e-6 && (p.x - s).abs() < 1e-5, "{p} {s}");
    }
    let none = ContourOf::Plane { point: DVec3::ZERO, normal: DVec3::ZERO };
    assert!(contour(&data, &none, None, None).unwrap_err().to_string().contains("no direction"));
}

#[test]
fn pieces_that_share_their_points_meet() {
    // Two halves of a ball, cut through cells of different shapes.
    let halves = [12, 10].map(|kind| {
        let mut grid = cube(8, kind);
        let keep: Vec<usize> = (0..grid.cells.len())
            .filter(|&c| {
                let ids = grid.cells.get(c);
                let middle: f64 = ids.iter().map(|&k| grid.points.get(k as usize).x).sum();
                (middle / ids.len() as f64 > 0.5) == (kind == 10)
            })
            .collect();
        let mut cells = Cells::new();
        keep.iter().for_each(|&c| cells.push(grid.cells.get(c).iter().copied()));
        grid.types = vec![kind; cells.len()];
        grid.cells = cells;
        with_field(grid, |p| (p - DVec3::new(0.5, 0.52, 0.48)).length())
    });
    let origin = Some(DVec3::splat(0.5));
    let mut both = TriMesh::default();
    for half in &halves {
        let found = contour(half, &of_values(&[0.31]), None, origin).unwrap();
        let first = both.positions.len() as u32;
        both.positions.extend(&found.mesh.positions);
        both.indices.extend(found.mesh.indices.iter().map(|t| t.map(|k| k + first)));
    }
    // A hexahedron's face has a middle, and the two tetrahedra behind it do not: their surfaces
    // meet at the edges alone. Cells of one shape meet everywhere.
    let blocks = |kind: u8| {
        let block = |x: f64| {
            let mut grid = cube(6, kind);
            let Points::F64(points) = &mut grid.points else { unreachable!("as made") };
            points.iter_mut().for_each(|p| p[0] += x);
            let f = |p: DVec3| (p - DVec3::new(1.0, 0.5, 0.45)).length();
            Block { name: x.to_string(), data: with_field(grid, f) }
        };
        Dataset::MultiBlock(vec![block(0.0), block(1.0)])
    };
    for kind in [10, 12, 13, 42] {
        let found = contour(&blocks(kind), &of_values(&[0.31]), None, None).unwrap();
        assert_eq!(open_edges(&found.mesh), 0, "{kind}");
    }
    let ball = 4.0 * std::f64::consts::PI * 0.31 * 0.31;
    let ratio = area(&both) / ball;
    assert!((0.95..1.0).contains(&ratio), "{ratio}");
}

#[test]
fn values_of_cells_become_means_and_colour_their_triangles() {
    let mut grid = cube(8, 12);
    let centre = |c: usize| {
        let ids = grid.cells.get(c);
        ids.iter().map(|&k| grid.points.get(k as usize)).sum::<DVec3>() / ids.len() as f64
    };
    let x: Vec<f64> = (0..grid.cells.len()).map(|c| centre(c).x).collect();
    grid.attributes.cell.push(DataArray::new("f", 1, Values::F64(x)));
    let data = Dataset::UnstructuredGrid(grid);
    let found = contour(&data, &of_values(&[0.5]), Some("f"), None).unwrap();
    assert!(found.report.averaged);
    // Means of a linear field are exact inside.
    assert!(found.mesh.positions.iter().all(|p| (p.x - 0.5).abs() < 1e-6));
    let scalars = found.mesh.scalars.unwrap();
    assert_eq!(scalars.values.len(), found.mesh.indices.len());
    assert!(scalars.values.iter().all(|s| (s - 0.4375).abs() < 1e-6 || (s - 0.5625).abs() < 1e-6));
}

#[test]
fn contours_of_the_wavelet_lie_on_its_isosurface() {
    let grid = Wavelet::with_points(21).grid().unwrap();
    let mut image = ImageData::new(grid.dims().to_array(), grid.origin(), grid.spacing());
    let values = Values::F32(grid.values().to_vec());
    image.attributes.point.push(DataArray::new("f", 1, values));
    let found = contour(&Dataset::ImageData(image), &of_values(&[157.09]), None, None).unwrap();
    let cubes = crate::isosurface::extract(&grid, &[157.09], Default::default()).unwrap().mesh;
    let ratio = area(&found.mesh) / area(&cubes);
    assert!((0.98..1.02).contains(&ratio), "{ratio}");
    // Vertices of marching cubes lie on edges of cells, where both are linear.
    let bits = |p: &Vec3| p.to_array().map(f32::to_bits);
    let mine: std::collections::HashSet<_> = found.mesh.positions.iter().map(bits).collect();
    let shared = cubes.positions.iter().filter(|p| mine.contains(&bits(p))).count();
    assert!(2 * shared > cubes.positions.len(), "{shared} of {}", cubes.positions.len());
}

#[test]
fn what_has_no_contour_is_counted() {
    let mut grid = cube(2, 12);
    grid.cells.push([0, 1, 2]);
    grid.types.push(5);
    grid.cells.push([0, 1, 2, 999]);
    grid.types.push(10);
    grid.cells.push([0, 1]);
    grid.types.push(10);
    grid.cells.push([0, 1, 2, 3]);
    grid.types.push(99);
    let data = with_field(grid, |p| if p.x > 0.9 { f64::NAN } else { p.x });
    let found = contour(&data, &of_values(&[0.25]), None, None).unwrap();
    let r = found.report;
    assert_eq!((r.flat_cells, r.bad_cells, r.unknown_type, r.not_finite), (1, 2, 1, 4));
    assert_eq!(r.warnings().len(), 3);
    assert!((area(&found.mesh) - 1.0).abs() < 1e-6);
    let missing = ContourOf::Values { array: "g", isovalues: &[0.0] };
    assert!(contour(&data, &missing, None, None).unwrap_err().to_string().contains("no array `g`"));
}

#[test]
fn copies_of_other_processes_cells_are_left_out_and_help_with_means() {
    let mut grid = cube(4, 12);
    let ghost: Vec<u8> = (0..64).map(|c| u8::from(c % 4 == 3)).collect();
    let x: Vec<f64> = (0..64).map(|c| (c % 4) as f64).collect();
    grid.attributes.cell.push(DataArray::new("vtkGhostType", 1, Values::U8(ghost)));
    grid.attributes.cell.push(DataArray::new("f", 1, Values::F64(x)));
    let found = contour(&Dataset::UnstructuredGrid(grid), &of_values(&[2.4]), None, None).unwrap();
    assert_eq!(found.report.ghost_cells, 16);
    // At x = 0.75 the mean is 2.5, so the surface lies before it.
    assert!(found.mesh.num_triangles() > 0);
    assert!(found.mesh.positions.iter().all(|p| p.x > 0.5 && p.x < 0.75));
}
