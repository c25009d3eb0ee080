//! Meshes, rays and checks that the tests share.

use glam::{DVec3, Vec3};
use rt_core::bvh::{BuildOptions, BuildQuality, Robustness, Storage, World};
use rt_core::glam;
use rt_core::math::SplitMix64;
use rt_core::mesh::TriMesh;
use rt_core::ray::{Hit, HitBlock, LANES, Ray, RayBlock};
use rt_core::simd::SimdLevel;
use std::collections::HashMap;

/// Every preset, robustness mode and storage at every instruction set.
pub(crate) fn all_options() -> Vec<BuildOptions> {
    let mut all = Vec::new();
    for quality in BuildQuality::ALL {
        for robustness in Robustness::ALL {
            for simd in SimdLevel::available() {
                for storage in Storage::ALL {
                    all.push(BuildOptions { quality, robustness, simd: Some(simd), storage });
                }
            }
        }
    }
    all
}

/// Every preset, robustness mode and storage, each at one instruction set in turn: enough where
/// only the tree matters.
pub(crate) fn some_options() -> Vec<BuildOptions> {
    let levels = SimdLevel::available();
    let modes = Robustness::ALL.iter().flat_map(|&r| BuildQuality::ALL.map(|q| (q, r)));
    modes
        .enumerate()
        .flat_map(|(i, (quality, robustness))| {
            let simd = Some(levels[(levels.len() + i - 1) % levels.len()]);
            Storage::ALL.map(|storage| BuildOptions { quality, robustness, simd, storage })
        })
        .collect()
}

pub(crate) fn world(mesh: &TriMesh, options: &BuildOptions) -> World {
    World::from_mesh(mesh.clone(), options).expect("a usable mesh")
}

/// The hits of single rays. Also checks that packets give the same bits, in order and sorted, and
/// that occlusion agrees.
pub(crate) fn hits_all_ways(world: &World, rays: &[Ray], what: &str) -> Vec<Option<Hit>> {
    let single: Vec<Option<Hit>> = rays.iter().map(|r| world.closest(r)).collect();
    let blocks = RayBlock::from_rays(rays);
    let (mut packets, mut sorted) =
        (vec![HitBlock::MISS; blocks.len()], vec![HitBlock::MISS; blocks.len()]);
    let (mut any, mut any_sorted) = (vec![0u16; blocks.len()], vec![0u16; blocks.len()]);
    world.closest_coherent(&blocks, &mut packets).expect("one each");
    world.closest_incoherent(&blocks, &mut sorted).expect("one each");
    world.occluded_coherent(&blocks, &mut any).expect("one each");
    world.occluded_incoherent(&blocks, &mut any_sorted).expect("one each");
    let (mut wrong, mut example) = ([0usize; 5], String::new());
    for (i, ray) in rays.iter().enumerate() {
        let (b, l) = (i / LANES, i % LANES);
        let (p, s) = (packets[b].get(l), sorted[b].get(l));
        let hit = single[i].is_some();
        let blocked = [world.occluded(ray), any[b] >> l & 1 == 1, any_sorted[b] >> l & 1 == 1];
        let bad = [
            bits(p) != bits(single[i]),
            bits(s) != bits(single[i]),
            blocked[0] != hit,
            blocked[1] != hit,
            blocked[2] != hit,
        ];
        for (w, b) in wrong.iter_mut().zip(bad) {
            *w += b as usize;
        }
        if bad.contains(&true) && example.is_empty() {
            example = format!(
                "ray {i} {ray:?}: single {:?}, packet {p:?}, sorted {s:?}, occluded (single, \
                 packet, sorted) {blocked:?}",
                single[i]
            );
        }
    }
    assert!(
        wrong == [0; 5],
        "{what}: of {} rays differ from the single closest hit: packet {}, sorted {}, occluded {}, \
         packet {}, sorted {}; {example}",
        rays.len(),
        wrong[0],
        wrong[1],
        wrong[2],
        wrong[3],
        wrong[4]
    );
    single
}

/// The bits of a hit, so that -0.0 differs from 0.0.
pub(crate) fn bits(h: Option<Hit>) -> Option<[u32; 5]> {
    h.map(|h| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.prim, h.instance])
}

/// An icosahedron subdivided `level` times, rotated so that no edge lies in a plane through an
/// axis: unit f64 positions and triangles.
pub(crate) fn icosphere(level: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let p = (1.0 + 5f64.sqrt()) / 2.0;
    let mut v: Vec<DVec3> = Vec::new();
    for k in 0..3 {
        for (a, b) in [(-1.0, p), (1.0, p), (-1.0, -p), (1.0, -p)] {
            let mut q = [0.0; 3];
            (q[k], q[(k + 1) % 3]) = (a, b);
            v.push(DVec3::from_array(q));
        }
    }
    // Faces are triples of vertices at distance two from one another.
    let near = |a: usize, b: usize| (v[a] - v[b]).length() < 2.1;
    let mut t: Vec<[u32; 3]> = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(a, c) {
                    let outward = (v[b] - v[a]).cross(v[c] - v[a]).dot(v[a]) > 0.0;
                    t.push(if outward { [a, b, c] } else { [a, c, b] }.map(|i| i as u32));
                }
            }
        }
    }
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
    (v.iter().map(|q| turn * q.normalize()).collect(), t)
}

/// A sphere of radius `radius` around `center`.
pub(crate) fn sphere(level: u32, radius: f64, center: DVec3) -> TriMesh {
    let (v, t) = icosphere(level);
    let v: Vec<DVec3> = v.iter().map(|p| center + *p * radius).collect();
    TriMesh::from_f64_positions(&v, t)
}

/// A torus around the z axis with the radii 1 and 0.4, made of `n` by `m` quads split in two.
pub(crate) fn torus(n: u32, m: u32) -> TriMesh {
    let mut v = Vec::new();
    for i in 0..n {
        for j in 0..m {
            let (a, b) = (i as f64 / n as f64, j as f64 / m as f64);
            let ((sa, ca), (sb, cb)) =
                ((a * std::f64::consts::TAU).sin_cos(), (b * std::f64::consts::TAU).sin_cos());
            v.push(DVec3::new((1.0 + 0.4 * cb) * ca, (1.0 + 0.4 * cb) * sa, 0.4 * sb).as_vec3());
        }
    }
    let at = |i: u32, j: u32| (i % n) * m + j % m;
    let t = (0..n * m).flat_map(|q| {
        let (i, j) = (q / m, q % m);
        [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]
    });
    TriMesh::new(v, t.collect())
}

/// The cube from -1 to 1 with `n` by `n` quads per side, each split in two. Every edge except the
/// diagonals is parallel to an axis, where boxes touch it.
pub(crate) fn cube(n: u32) -> TriMesh {
    let mut mesh = TriMesh::default();
    let mut index: HashMap<[u32; 3], u32> = HashMap::new();
    for axis in 0..3 {
        for side in [0, n] {
            for q in 0..n * n {
                let (i, j) = (q / n, q % n);
                let [a, b, c, d] =
                    [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| {
                        let mut k = [0; 3];
                        (k[axis], k[(axis + 1) % 3], k[(axis + 2) % 3]) = (side, i, j);
                        *index.entry(k).or_insert_with(|| {
                            mesh.positions
                                .push(Vec3::from_array(k.map(|x| 2.0 * x as f32 / n as f32 - 1.0)));
                            mesh.positions.len() as u32 - 1
                        })
                    });
                let quad = if side == n { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] };
                mesh.indices.extend(quad);
            }
        }
    }
    mesh
}

/// Triangles of many sizes at random positions in the unit ball.
pub(crate) fn soup(n: usize, seed: u64) -> TriMesh {
    let mut r = SplitMix64::new(seed);
    let mut mesh = TriMesh::default();
    for i in 0..n as u32 {
        let center = r.direction() * r.unit();
        let size = 0.3 * r.unit() * r.unit();
        for _ in 0..3 {
            mesh.positions.push((center + r.direction() * size).as_vec3());
        }
        mesh.indices.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    mesh
}

/// Rays from a sphere of radius 3 at the unit ball.
pub(crate) fn inward_rays(n: usize, seed: u64) -> Vec<Ray> {
    let mut r = SplitMix64::new(seed);
    (0..n)
        .map(|_| {
            let o = (r.direction() * 3.0).as_vec3();
            Ray::new(o, (r.direction() * r.unit()).as_vec3() - o)
        })
        .collect()
}

/// Tiles of sixteen by sixteen pixels of a pinhole camera at `eye`, looking at a square of half
/// size `half` around `at`.
pub(crate) fn camera(eye: Vec3, at: Vec3, half: f32, tiles: u32) -> Vec<Ray> {
    let forward = (at - eye).normalize();
    let right = forward.any_orthonormal_vector();
    let up = right.cross(forward);
    let n = 16 * tiles;
    let mut rays = Vec::new();
    for tile in 0..tiles * tiles {
        for i in 0..256 {
            let (x, y) = ((tile % tiles) * 16 + i % 16, (tile / tiles) * 16 + i / 16);
            let s = |k: u32| half * (2.0 * (k as f32 + 0.5) / n as f32 - 1.0);
            rays.push(Ray::new(eye, at + right * s(x) + up * s(y) - eye));
        }
    }
    rays
}

/// Triangles whose height is 10⁻³ to 10⁻⁸ of their length.
pub(crate) fn needles(n: usize, seed: u64) -> TriMesh {
    let mut r = SplitMix64::new(seed);
    let mut mesh = TriMesh::default();
    for i in 0..n as u32 {
        let a = r.direction() * r.unit();
        let along = r.direction();
        let across = along.cross(r.direction()).normalize() * (10f64).powf(-3.0 - 5.0 * r.unit());
        mesh.positions.extend([a, a + along, a + along * r.unit() + across].map(|p| p.as_vec3()));
        mesh.indices.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    mesh
}
