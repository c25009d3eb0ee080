//! Meshes of stretched triangles: a terrain from a survey with dense profiles, and slivers.

use glam::{DVec3, Vec3};
use rt_core::math::SplitMix64;
use rt_core::mesh::TriMesh;
use std::sync::Arc;

/// Points along one side of a cell divided by those along the other.
const STRETCH: f64 = 100.0;

/// A height field over a square whose cells are 100 times as long as wide, y upwards: profiles that
/// lie far apart, each measured densely. It has about `triangles` triangles.
pub fn terrain(triangles: u32) -> Arc<TriMesh> {
    let rows = (f64::from(triangles) / 2.0 / STRETCH).sqrt().max(2.0) as u32;
    let columns = (f64::from(rows) * STRETCH) as u32;
    let mut random = SplitMix64::new(3);
    let waves: Vec<[f64; 4]> = (0..24)
        .map(|k| {
            let frequency = 1.5f64.powi(k / 2);
            let angle = random.between(0.0, std::f64::consts::TAU);
            let phase = random.between(0.0, std::f64::consts::TAU);
            [frequency * angle.cos(), frequency * angle.sin(), phase, 0.25 / frequency]
        })
        .collect();
    let height = |x: f64, z: f64| -> f64 {
        waves.iter().map(|[fx, fz, phase, a]| a * (5.0 * (fx * x + fz * z) + phase).sin()).sum()
    };
    let mut positions = Vec::with_capacity(((rows + 1) * (columns + 1)) as usize);
    for j in 0..=rows {
        for i in 0..=columns {
            let x = 2.0 * f64::from(i) / f64::from(columns) - 1.0;
            let z = 2.0 * f64::from(j) / f64::from(rows) - 1.0;
            positions.push(DVec3::new(x, 0.3 * height(x, z), z).as_vec3());
        }
    }
    let at = |i: u32, j: u32| j * (columns + 1) + i;
    let cells = (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j)));
    let indices = cells.flat_map(|(i, j)| {
        [[at(i, j), at(i, j + 1), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i + 1, j)]]
    });
    Arc::new(TriMesh::new(positions, indices.collect()))
}

/// Triangles ten thousand times as long as wide, in all directions. Their boxes are nearly empty,
/// and no order of the triangles helps.
pub fn slivers(count: u32) -> Arc<TriMesh> {
    let mut random = SplitMix64::new(9);
    let mut positions: Vec<Vec3> = Vec::with_capacity(3 * count as usize);
    for _ in 0..count {
        let middle = DVec3::new(
            random.between(-1.0, 1.0),
            random.between(-1.0, 1.0),
            random.between(-1.0, 1.0),
        );
        let along = random.direction();
        let across = along.cross(random.direction()).normalize_or(along.any_orthonormal_vector());
        let length = 0.05 + 0.25 * random.unit();
        let corners = [-0.5 * along, 0.5 * along, 0.5 * along + 1e-4 * across];
        positions.extend(corners.map(|c| (middle + length * c).as_vec3()));
    }
    Arc::new(TriMesh::new(positions, (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terrain_and_slivers_are_as_stretched_as_they_say() {
        let mesh = terrain(20_000);
        assert!((15_000..=20_000).contains(&mesh.num_triangles()), "{}", mesh.num_triangles());
        let [a, b, c] = mesh.triangle(0);
        let (long, wide) = ((b - a).z.abs(), (c - b).x.abs());
        assert!((99.0..101.0).contains(&(long / wide)), "{long} by {wide}");
        let slivers = slivers(500);
        assert_eq!(slivers.validate().skipped() + slivers.validate().zero_area, 0);
        for t in 0..500 {
            let [a, b, c] = slivers.triangle(t);
            let aspect = (b - a).length() / (c - b).length();
            assert!((9_000.0..11_000.0).contains(&aspect), "{aspect}");
        }
    }
}
