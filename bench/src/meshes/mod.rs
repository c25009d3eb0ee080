//! Meshes that several experiments use: the dissertation's nested wavelet surfaces, and others of
//! the kinds that users bring.

mod anisotropic;
mod cells;
mod city;
mod forest;
mod scene;
mod spheres;

pub use anisotropic::{slivers, terrain};
pub use cells::cells;
pub use city::city;
pub use forest::forest;
pub use scene::MeshScene;
pub use spheres::spheres;

use anyhow::Context as _;
use datasets::generate::nested_wavelet::Size;
use datasets::generate::wavelet::Wavelet;
use datasets::isosurface;
use glam::{DQuat, DVec3, Vec3};
use rt_core::math::SplitMix64;
use rt_core::mesh::TriMesh;
use std::collections::HashMap;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Nested isosurfaces of the wavelet (dissertation section 4.3): many small triangles of the same
/// size.
pub fn wavelet(size: Size) -> anyhow::Result<Arc<TriMesh>> {
    let surfaces = size.generate(Default::default()).with_context(|| {
        format!("cannot make the wavelet surfaces of {} triangles", size.name())
    })?;
    Ok(Arc::new(surfaces.mesh))
}

/// The surfaces of the smallest size from a coarser grid of `points` per axis, which gives fewer
/// triangles for quick runs.
pub fn coarse_wavelet(points: u32) -> anyhow::Result<Arc<TriMesh>> {
    let grid = Wavelet::with_points(points).grid()?;
    let surfaces = isosurface::extract(&grid, &Size::M1.isovalues(), Default::default())
        .with_context(|| format!("cannot make wavelet surfaces from {points} points per axis"))?;
    Ok(Arc::new(surfaces.mesh))
}

/// Pipes through a box in all directions, like a plant's piping: long thin triangles that overlap
/// without order, the opposite of an isosurface. Each pipe has 2 x 24 x 8 triangles.
pub fn pipes(count: u32) -> Arc<TriMesh> {
    const SIDES: u32 = 24;
    const SEGMENTS: u32 = 8;
    let mut random = SplitMix64::new(1);
    let mut mesh = TriMesh::default();
    for _ in 0..count {
        let place = DVec3::new(
            random.between(-1.0, 1.0),
            random.between(-1.0, 1.0),
            random.between(-1.0, 1.0),
        );
        let turn = DQuat::from_rotation_arc(DVec3::Z, random.direction());
        let radius = 0.004 * (1.0 + 4.0 * random.unit() * random.unit());
        let length = 0.2 + 1.3 * random.unit();
        let first = mesh.positions.len() as u32;
        for s in 0..=SEGMENTS {
            for k in 0..SIDES {
                let (sin, cos) = (f64::from(k) / f64::from(SIDES) * TAU).sin_cos();
                let along = (f64::from(s) / f64::from(SEGMENTS) - 0.5) * length;
                mesh.positions
                    .push((place + turn * DVec3::new(radius * cos, radius * sin, along)).as_vec3());
            }
        }
        for s in 0..SEGMENTS {
            for k in 0..SIDES {
                let at = |s: u32, k: u32| first + s * SIDES + k % SIDES;
                mesh.indices.push([at(s, k), at(s, k + 1), at(s + 1, k + 1)]);
                mesh.indices.push([at(s, k), at(s + 1, k + 1), at(s + 1, k)]);
            }
        }
    }
    Arc::new(mesh)
}

/// A closed sphere-like surface around `center`: an icosahedron whose triangles are divided into
/// four `level` times, with vertices moved along the radius to 1 + `crumple` x (-1..1). It is
/// star-shaped: every ray from inside hits it.
pub fn crumpled_sphere(level: u32, crumple: f64, center: DVec3) -> TriMesh {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    // Corners of three rectangles, rotated so that no edge lies in an axis plane.
    let tilt = DQuat::from_rotation_arc(DVec3::Z, DVec3::new(0.3, 0.5, 0.8).normalize());
    let mut points: Vec<DVec3> = Vec::new();
    for axis in 0..3 {
        for (a, b) in [(-1.0, -golden), (-1.0, golden), (1.0, -golden), (1.0, golden)] {
            let p = [DVec3::new(0.0, a, b), DVec3::new(b, 0.0, a), DVec3::new(a, b, 0.0)][axis];
            points.push(tilt * p.normalize());
        }
    }
    let mut triangles = icosahedron_faces(&points);
    for _ in 0..level {
        let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    let mut random = SplitMix64::new(7);
    let place = |p: &DVec3| -> Vec3 {
        (*p * (1.0 + crumple * random.between(-1.0, 1.0)) + center).as_vec3()
    };
    TriMesh::new(points.iter().map(place).collect(), triangles)
}

/// The 20 triples of corners at the smallest distance from one another, counter-clockwise from
/// outside.
fn icosahedron_faces(points: &[DVec3]) -> Vec<[u32; 3]> {
    let near = |a: usize, b: usize| points[a].dot(points[b]) > 0.4;
    let mut faces = vec![];
    for a in 0..points.len() {
        for b in a + 1..points.len() {
            for c in b + 1..points.len() {
                if near(a, b) && near(b, c) && near(c, a) {
                    let outward =
                        (points[b] - points[a]).cross(points[c] - points[a]).dot(points[a]) > 0.0;
                    let (b, c) = if outward { (b, c) } else { (c, b) };
                    faces.push([a as u32, b as u32, c as u32]);
                }
            }
        }
    }
    faces
}

/// A globe with two poles at which `meridians` triangles share one vertex. Its needle triangles and
/// poles are the hardest cases for a tracer.
pub fn globe(meridians: u32, parallels: u32) -> TriMesh {
    let mut mesh = TriMesh::new(vec![Vec3::Z], vec![]);
    for j in 1..parallels {
        for i in 0..meridians {
            let (theta, phi) = (
                f64::from(j) / f64::from(parallels) * TAU / 2.0,
                f64::from(i) / f64::from(meridians) * TAU,
            );
            let p = DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
            mesh.positions.push(p.as_vec3());
        }
    }
    mesh.positions.push(Vec3::NEG_Z);
    let south = mesh.positions.len() as u32 - 1;
    let at = |j: u32, i: u32| 1 + (j - 1) * meridians + i % meridians;
    for i in 0..meridians {
        mesh.indices.push([0, at(1, i), at(1, i + 1)]);
        mesh.indices.push([south, at(parallels - 1, i + 1), at(parallels - 1, i)]);
        for j in 1..parallels - 1 {
            mesh.indices.push([at(j, i), at(j + 1, i), at(j + 1, i + 1)]);
            mesh.indices.push([at(j, i), at(j + 1, i + 1), at(j, i + 1)]);
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether every edge is used once in each direction, so that the surface has no holes.
    fn is_closed(mesh: &TriMesh) -> bool {
        let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
        for &[a, b, c] in &mesh.indices {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                *edges.entry((from.min(to), from.max(to))).or_default() +=
                    if from < to { 1 } else { 100 };
            }
        }
        edges.values().all(|&n| n == 101)
    }

    #[test]
    fn leak_meshes_are_closed() {
        for (mesh, triangles) in [
            (crumpled_sphere(3, 0.0, DVec3::ZERO), 20 * 64),
            (crumpled_sphere(4, 0.3, DVec3::new(1000.0, 700.0, -1300.0)), 20 * 256),
            (globe(100, 50), 2 * 100 * 49),
        ] {
            assert_eq!(mesh.num_triangles(), triangles);
            assert!(is_closed(&mesh));
            assert_eq!(mesh.validate().skipped() + mesh.validate().zero_area, 0);
        }
    }

    #[test]
    fn pipes_are_clean_and_the_same_every_time() {
        let a = pipes(20);
        assert_eq!(a.num_triangles(), 20 * 2 * 24 * 8);
        assert_eq!(a.validate().skipped(), 0);
        assert_eq!(a, pipes(20));
    }
}
