//! Small closed shapes with known volumes, for tests, examples and first renderings.

use super::wavelet::Wavelet;
use crate::isosurface::{self, Options};
use glam::{DVec3, Vec3};
use rt_core::grid::Grid;
use rt_core::mesh::{Attribute, TriMesh};
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

/// The unit sphere as an icosahedron subdivided `level` times: 20·4^level triangles of nearly equal
/// size. Levels above 12 (335 million triangles) are treated as 12.
///
/// ```
/// let ball = datasets::generate::shapes::icosphere(2);
/// assert_eq!((ball.num_triangles(), ball.positions.len()), (320, 162));
/// ```
pub fn icosphere(level: u32) -> TriMesh {
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    // The corners of three golden rectangles.
    let mut points: Vec<DVec3> = Vec::new();
    for axis in 0..3 {
        for (a, b) in [(-1.0, g), (1.0, g), (-1.0, -g), (1.0, -g)] {
            let mut p = DVec3::ZERO;
            p[axis] = a;
            p[(axis + 1) % 3] = b;
            points.push(p.normalize());
        }
    }
    // Three corners at edge length from each other form a triangle; its normal determines the
    // order.
    let edge = points.iter().skip(1).map(|p| p.distance(points[0])).fold(f64::MAX, f64::min) * 1.01;
    let mut triangles = Vec::new();
    for a in 0..12usize {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let [p, q, r] = [points[a], points[b], points[c]];
                if p.distance(q) < edge && q.distance(r) < edge && r.distance(p) < edge {
                    let outward = (q - p).cross(r - p).dot(p) > 0.0;
                    triangles.push(if outward { [a, b, c] } else { [a, c, b] }.map(|i| i as u32));
                }
            }
        }
    }
    for _ in 0..level.min(12) {
        let mut middles = HashMap::new();
        let mut middle = |a: u32, b: u32, points: &mut Vec<DVec3>| -> u32 {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (
                    middle(a, b, &mut points),
                    middle(b, c, &mut points),
                    middle(c, a, &mut points),
                );
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    let positions: Vec<Vec3> = points.iter().map(|p| p.as_vec3()).collect();
    let normals = Some(Attribute::per_vertex(positions.clone()));
    TriMesh { normals, ..TriMesh::new(positions, triangles) }
}

/// The cube from -1 to 1: 8 shared vertices, 12 triangles.
pub fn cube() -> TriMesh {
    let positions =
        (0..8).map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - 1.0);
    let faces =
        [[0u32, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
    TriMesh::new(positions.collect(), triangles.collect())
}

/// The unit sphere by longitude and latitude around z, with one vertex at each pole: `around` (at
/// least 3) by `rings` (at least 2) patches. It serves as an example of long thin triangles (at the
/// poles).
pub fn uv_sphere(around: u32, rings: u32) -> TriMesh {
    let (around, rings) = (around.max(3), rings.max(2));
    let mut positions = vec![Vec3::Z];
    for r in 1..rings {
        let (s, c) = (PI * r as f64 / rings as f64).sin_cos();
        positions.extend((0..around).map(|a| {
            let (sa, ca) = (TAU * a as f64 / around as f64).sin_cos();
            DVec3::new(s * ca, s * sa, c).as_vec3()
        }));
    }
    positions.push(-Vec3::Z);
    let south = positions.len() as u32 - 1;
    let at = |r: u32, a: u32| 1 + (r - 1) * around + a % around;
    let mut triangles = Vec::new();
    for a in 0..around {
        triangles.push([0, at(1, a), at(1, a + 1)]);
        for r in 1..rings - 1 {
            triangles.push([at(r, a), at(r + 1, a), at(r + 1, a + 1)]);
            triangles.push([at(r, a), at(r + 1, a + 1), at(r, a + 1)]);
        }
        triangles.push([at(rings - 1, a), south, at(rings - 1, a + 1)]);
    }
    let normals = Some(Attribute::per_vertex(positions.clone()));
    TriMesh { normals, ..TriMesh::new(positions, triangles) }
}

/// A torus around z: circle of radius 1, tube of radius `tube`, `around` by `across` quads (at
/// least 3 each) as triangles.
pub fn torus(tube: f32, around: u32, across: u32) -> TriMesh {
    let (around, across) = (around.max(3), across.max(3));
    let (mut positions, mut normals, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..around {
        let (si, ci) = (TAU * i as f64 / around as f64).sin_cos();
        for j in 0..across {
            let (sj, cj) = (TAU * j as f64 / across as f64).sin_cos();
            let n = DVec3::new(cj * ci, cj * si, sj);
            positions.push((DVec3::new(ci, si, 0.0) + n * tube as f64).as_vec3());
            normals.push(n.as_vec3());
            let at = |i: u32, j: u32| i % around * across + j % across;
            triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    TriMesh { normals: Some(Attribute::per_vertex(normals)), ..TriMesh::new(positions, triangles) }
}

/// An isosurface of the wavelet on `points`³ samples whose border is pulled below every isovalue,
/// so that the surface is closed: an intricate solid with handles and cavities, within the cube
/// from -1 to 1.
pub fn closed_wavelet(points: u32, iso: f64) -> Result<TriMesh, isosurface::IsosurfaceError> {
    let points = points.clamp(3, 1 << 10);
    let w = Wavelet::with_points(points);
    let sampled =
        w.grid().unwrap_or_else(|_| unreachable!("3 to 1024 points per axis are a valid extent"));
    let (n, last) = (points as usize, points as usize - 1);
    let spacing = DVec3::splat(2.0 / last as f64);
    let mut grid = Grid::new(sampled.dims(), DVec3::NEG_ONE, spacing, sampled.into_values())?;
    for (i, v) in grid.values_mut().iter_mut().enumerate() {
        if [i % n, i / n % n, i / (n * n)].iter().any(|&c| c == 0 || c == last) {
            *v = f32::min(*v, iso as f32 - 100.0);
        }
    }
    Ok(isosurface::extract(&grid, &[iso], Options { normals: true, ..Default::default() })?.mesh)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{open_or_flipped_edges, volume};

    #[test]
    fn all_shapes_are_closed_outward_and_have_their_volume() {
        let ball = 4.0 / 3.0 * PI;
        let torus_volume = 2.0 * PI * PI * 0.3f64.powi(2);
        for (name, mesh, expected, tolerance) in [
            ("icosphere", icosphere(4), ball, 0.01),
            ("cube", cube(), 8.0, 1e-9),
            ("uv sphere", uv_sphere(60, 40), ball, 0.01),
            (
                "coarsest uv \
              sphere",
                uv_sphere(0, 0),
                0.75f64.sqrt(),
                1e-6,
            ), // a double pyramid over a triangle
            ("torus", torus(0.3, 80, 40), torus_volume, 0.01),
        ] {
            assert_eq!(open_or_flipped_edges(&mesh.indices), 0, "{name}");
            let v = volume(&mesh);
            assert!(
                (v / expected - 1.0).abs() <= tolerance,
                "{name}: volume {v}, expected {expected}"
            );
            mesh.check().unwrap();
            assert_eq!(mesh.validate().zero_area, 0, "{name}");
        }
    }

    #[test]
    fn closed_wavelet_is_watertight() {
        let mesh = closed_wavelet(31, 157.09).unwrap();
        assert!(mesh.num_triangles() > 5000 && (0.1..8.0).contains(&volume(&mesh)));
        let b = mesh.bounds();
        assert!(b.min.min_element() > -1.0 && b.max.max_element() < 1.0, "{b:?}");
        assert_eq!(open_or_flipped_edges(&mesh.indices), 0);
    }

    #[test]
    fn icosphere_has_20_times_4_to_the_level_triangles() {
        for level in 0..5 {
            assert_eq!(icosphere(level).num_triangles(), 20 << (2 * level));
        }
    }
}
