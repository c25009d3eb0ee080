//! Small shapes and numbers for tests.

use crate::math::SplitMix64;
use crate::mesh::TriMesh;
use glam::Vec3;
use std::collections::HashMap;

/// [`SplitMix64`] in single precision.
pub(crate) struct Random(SplitMix64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Random(SplitMix64::new(seed))
    }

    pub(crate) fn bits(&mut self) -> u64 {
        self.0.bits()
    }

    /// Uniform in [0, 1).
    pub(crate) fn unit(&mut self) -> f32 {
        self.0.unit_f32()
    }

    /// Uniform on the unit sphere.
    pub(crate) fn direction(&mut self) -> Vec3 {
        let z = 2.0 * self.unit() - 1.0;
        let phi = std::f32::consts::TAU * self.unit();
        let r = (1.0 - z * z).max(0.0).sqrt();
        Vec3::new(r * phi.cos(), r * phi.sin(), z)
    }
}

/// Triangles of many sizes at random positions in the unit ball.
pub(crate) fn noise_soup(n: usize, seed: u64) -> TriMesh {
    let mut r = Random::new(seed);
    let mut mesh = TriMesh::default();
    for i in 0..n as u32 {
        let center = r.direction() * r.unit();
        let size = 0.3 * r.unit() * r.unit();
        for _ in 0..3 {
            let p = center + r.direction() * size;
            mesh.positions.push(p);
        }
        mesh.indices.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    mesh
}

/// A closed unit sphere: an icosahedron subdivided `level` times, rotated so that no edge lies in a
/// plane through an axis.
pub(crate) fn sphere(level: u32) -> TriMesh {
    let p = (1.0 + 5f64.sqrt()) / 2.0;
    let mut v: Vec<glam::DVec3> = Vec::new();
    for (a, b) in [(-1.0, p), (1.0, p), (-1.0, -p), (1.0, -p)] {
        v.push(glam::DVec3::new(a, b, 0.0));
    }
    for (a, b) in [(-1.0, p), (1.0, p), (-1.0, -p), (1.0, -p)] {
        v.push(glam::DVec3::new(0.0, a, b));
    }
    for (a, b) in [(p, -1.0), (p, 1.0), (-p, -1.0), (-p, 1.0)] {
        v.push(glam::DVec3::new(a, 0.0, b));
    }
    #[rustfmt::skip]
    let mut t: Vec<[u32; 3]> = vec![
        [0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11],
        [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6], [7, 1, 8],
        [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9],
        [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1],
    ];
    for _ in 0..level {
        let mut middle = HashMap::new();
        let mut next = Vec::with_capacity(4 * t.len());
        for q in &t {
            let m: [u32; 3] = std::array::from_fn(|k| {
                let (a, b) = (q[k].min(q[(k + 1) % 3]), q[k].max(q[(k + 1) % 3]));
                *middle.entry((a, b)).or_insert_with(|| {
                    v.push(v[a as usize].normalize() + v[b as usize].normalize());
                    v.len() as u32 - 1
                })
            });
            next.extend([[q[0], m[0], m[2]], [q[1], m[1], m[0]], [q[2], m[2], m[1]], m]);
        }
        t = next;
    }
    let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.2, 0.1);
    TriMesh::new(v.iter().map(|q| (turn * q.normalize()).as_vec3()).collect(), t)
}
