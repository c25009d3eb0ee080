//! Memory and time of the ways to store trees, on this machine: bytes per triangle, and times of
//! compact storage by those of plain storage, measured in turns on one thread.
//!
//! `cargo run --release -p rt-core --example storage -- 200`: the number of cells along an edge of
//! the lattice whose isosurfaces are traced.

use rt_core::glam::{DVec3, Vec3};
use rt_core::math::orthonormal_basis;
use rt_core::prelude::*;
use rt_core::ray::{HitBlock, RayBlock};
use rt_core::sampler::{Sampler, Sampling, cosine_hemisphere};
use std::time::Instant;

fn main() {
    let cells = std::env::args().nth(1).and_then(|n| n.parse().ok()).unwrap_or(160);
    let mesh = waves(cells);
    println!("{} triangles, {} vertices", mesh.indices.len(), mesh.positions.len());
    let worlds = Storage::ALL.map(|storage| {
        let options = BuildOptions { storage, ..BuildOptions::default() };
        World::from_mesh(mesh.clone(), &options).expect("a sound mesh")
    });
    for (storage, world) in Storage::ALL.iter().zip(&worlds) {
        let (report, n) = (world.report(), mesh.indices.len() as f64);
        println!(
            "{}: {:.2} bytes per triangle, built in {:.2} s",
            storage.name(),
            report.bytes as f64 / n,
            report.total.as_secs_f64()
        );
    }

    let rays = primary(512);
    let blocks = RayBlock::from_rays(&rays);
    let mut hits = vec![HitBlock::MISS; blocks.len()];
    worlds[0].closest_coherent(&blocks, &mut hits).expect("one each");
    let mut around = Vec::new();
    for (i, ray) in rays.iter().enumerate() {
        let Some(hit) = hits[i / 16].get(i % 16) else { continue };
        let [a, b, c] = mesh.triangle(hit.prim as usize);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let normal = if normal.dot(ray.dir) > 0.0 { -normal } else { normal };
        let (x, y) = orthonormal_basis(normal);
        let point = ray.at(hit.t) + normal * 1e-4;
        for k in 0..8 {
            let s = Sampler::new(Sampling::Sobol, 0, i as u32, 0, 0).square_of(0, k, 8);
            let d = cosine_hemisphere(s);
            around.push(Ray::new(point, x * d.x + y * d.y + normal * d.z));
        }
    }
    let scattered: Vec<Ray> = (0..1 << 16)
        .map(|i| {
            let s = |k: u32| Sampler::new(Sampling::Random, 0, i, k, 0).square_of(0, 0, 1);
            let point = |k: u32| Vec3::new(s(k)[0], s(k)[1], s(k + 9)[0]) * 2.0 - 1.0;
            let origin = point(1);
            Ray::new(origin, point(3) - origin)
        })
        .collect();
    let (around, scattered) = (RayBlock::from_rays(&around), RayBlock::from_rays(&scattered));

    compare("primary, packets", &worlds, |world| {
        world.closest_coherent(&blocks, &mut hits).expect("one each");
    });
    compare("primary, single rays", &worlds, |world| {
        rays.iter().for_each(|ray| {
            std::hint::black_box(world.closest(ray));
        });
    });
    let mut masks = vec![0; around.len()];
    compare("ambient occlusion, blocks", &worlds, |world| {
        world.occluded_incoherent(&around, &mut masks).expect("one each");
    });
    let mut hits = vec![HitBlock::MISS; scattered.len()];
    compare("random ends, blocks", &worlds, |world| {
        world.closest_incoherent(&scattered, &mut hits).expect("one each");
    });
}

/// The median of the ratios of times, and of the times with plain storage.
fn compare(name: &str, worlds: &[World; 2], mut work: impl FnMut(&World)) {
    let mut measured: Vec<(f64, f64)> = (0..9)
        .map(|_| {
            let [plain, compact] = worlds.each_ref().map(|world| {
                let start = Instant::now();
                work(world);
                start.elapsed().as_secs_f64()
            });
            (compact / plain, plain)
        })
        .collect();
    measured.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (ratio, seconds) = measured[measured.len() / 2];
    println!("{name}: {ratio:.2} ({:.1} ms with plain storage)", seconds * 1e3);
}

/// Rays of a camera, in tiles of 16 x 16 pixels.
fn primary(size: u32) -> Vec<Ray> {
    let eye = DVec3::new(1.9, 1.4, 2.6).as_vec3();
    let forward = -eye.normalize();
    let right = forward.cross(Vec3::Y).normalize();
    let up = right.cross(forward);
    let tiles = size / 16;
    let pixel = |i: u32| {
        let (tile, k) = (i / 256, i % 256);
        let (x, y) = (tile % tiles * 16 + k % 16, tile / tiles * 16 + k / 16);
        let s = |v: u32| 0.42 * (2.0 * (v as f32 + 0.5) / size as f32 - 1.0);
        Ray::new(eye, forward + right * s(x) + up * s(y))
    };
    (0..size * size).map(pixel).collect()
}

/// An isosurface of waves in the cube from -1 to 1, by marching tetrahedra: every vertex lies on an
/// edge of the lattice or on a diagonal, and is shared.
fn waves(cells: u32) -> TriMesh {
    let n = cells + 1;
    let at = |i: u32| 2.0 * i as f32 / cells as f32 - 1.0;
    let value = |p: Vec3| {
        (7.0 * p.x).sin() * (6.0 * p.y).cos()
            + (5.0 * p.z).sin() * (8.0 * p.x).cos()
            + 0.7 * (9.0 * p.y).sin() * (7.0 * p.z).cos()
    };
    let corner = |i: u32| Vec3::new(at(i % n), at(i / n % n), at(i / n / n));
    let values: Vec<f32> = (0..n * n * n).map(|i| value(corner(i))).collect();
    // Kuhn's six tetrahedra: paths along the axes from one corner of the cell to the opposite one.
    let steps = [1, n, n * n];
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let mut mesh = TriMesh::default();
    let mut vertices = std::collections::HashMap::new();
    for cell in 0..n * n * n {
        if cell % n == cells || cell / n % n == cells || cell / n / n == cells {
            continue;
        }
        for order in orders {
            let mut tet = [cell; 4];
            for k in 0..3 {
                tet[k + 1] = tet[k] + steps[order[k]];
            }
            let (inside, outside): (Vec<u32>, Vec<u32>) =
                tet.iter().partition(|&&i| values[i as usize] < 0.0);
            let mut cut = |a: u32, b: u32| {
                let edge = (a.min(b), a.max(b));
                *vertices.entry(edge).or_insert_with(|| {
                    let [u, v] = [values[edge.0 as usize], values[edge.1 as usize]];
                    let (p, q) = (corner(edge.0), corner(edge.1));
                    mesh.positions.push(p + (q - p) * (u / (u - v)));
                    mesh.positions.len() as u32 - 1
                })
            };
            let triangles: Vec<[u32; 3]> = match (inside.as_slice(), outside.as_slice()) {
                (&[a], &[b, c, d]) | (&[b, c, d], &[a]) => {
                    vec![[cut(a, b), cut(a, c), cut(a, d)]]
                }
                (&[a, b], &[c, d]) => {
                    let quad = [cut(a, c), cut(a, d), cut(b, d), cut(b, c)];
                    vec![[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]
                }
                _ => continue,
            };
            mesh.indices.extend(triangles);
        }
    }
    mesh
}
