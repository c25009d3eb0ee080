//! Shared by the benchmarks: a mesh, a camera, and rays in the order in which tiles generate them.
#![allow(dead_code, unreachable_pub, reason = "each benchmark uses its own part")]

use rt_core::bvh::World;
use rt_core::camera::Camera;
use rt_core::glam::{DVec3, Vec3};
use rt_core::mesh::{Attribute, TriMesh};
use rt_core::ray::{HitBlock, LANES, Ray, RayBlock};
use std::f32::consts::{PI, TAU};

/// Four wavy shells inside one another, about 260,000 triangles. As in nested isosurfaces,
/// triangles are small and some are hidden. Normals and scalars per vertex.
pub fn shells() -> TriMesh {
    let (n, m) = (128, 256);
    let mut mesh = TriMesh::default();
    for shell in 0..4 {
        let first = mesh.positions.len();
        for i in 0..=n {
            for j in 0..m {
                let (st, ct) = (PI * i as f32 / n as f32).sin_cos();
                let (sp, cp) = (TAU * j as f32 / m as f32).sin_cos();
                let d = Vec3::new(st * cp, st * sp, ct);
                let waves = (9.0 * d.x).sin() * (7.0 * d.y).sin() * (8.0 * d.z).sin();
                mesh.positions.push(d * (1.0 - 0.2 * shell as f32 + 0.25 * waves));
            }
        }
        let at = |i: usize, j: usize| (first + i * m + j % m) as u32;
        for (i, j) in (0..n).flat_map(|i| (0..m).map(move |j| (i, j))) {
            mesh.indices.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            mesh.indices.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    let mut normals = vec![Vec3::ZERO; mesh.positions.len()];
    for t in &mesh.indices {
        let [a, b, c] = t.map(|k| mesh.positions[k as usize]);
        t.iter().for_each(|k| normals[*k as usize] += (b - a).cross(c - a));
    }
    mesh.scalars = Some(Attribute::per_vertex(mesh.positions.iter().map(|p| p.length()).collect()));
    mesh.normals = Some(Attribute::per_vertex(normals));
    mesh
}

/// A bumpy plate of 800 triangles; `number` selects one of many.
pub fn bumpy(number: usize) -> TriMesh {
    let (n, place) = (20u32, number as f32);
    let corner = |k: u32| {
        let (x, y) = ((k % (n + 1)) as f32 / n as f32, (k / (n + 1)) as f32 / n as f32);
        Vec3::new(
            x + place % 32.0,
            y + (place / 32.0).floor(),
            0.2 * (9.0 * x + place).sin() * (7.0 * y).cos(),
        )
    };
    let mut mesh = TriMesh::new((0..(n + 1) * (n + 1)).map(corner).collect(), vec![]);
    for k in (0..n).flat_map(|j| (0..n).map(move |i| j * (n + 1) + i)) {
        mesh.indices.extend([[k, k + 1, k + n + 1], [k + 1, k + n + 2, k + n + 1]]);
    }
    mesh
}

/// A camera that sees all of the shells; they fill most of a square image.
pub fn camera() -> Camera {
    let eye = DVec3::new(3.1, 2.2, 4.0);
    Camera::perspective(eye, DVec3::ZERO, DVec3::Y, 0.5, 1.0, [0.1, 100.0]).expect("a sound camera")
}

/// Rays through the centres of `size` x `size` pixels along a Z-order curve, so that 16 are 4 x 4
/// pixels and 256 are 16 x 16. `size` is a power of two.
pub fn primary_rays(world: &World, size: u32) -> Vec<RayBlock> {
    let (eye, corner) = camera().world_ray([-1.0, 1.0]);
    let right = camera().world_ray([1.0, 1.0]).1 - corner;
    let down = camera().world_ray([-1.0, -1.0]).1 - corner;
    let even_bits = |i: u32| (0..16).fold(0, |v, b| v | (i >> (2 * b) & 1) << b);
    let rays: Vec<Ray> = (0..size * size)
        .map(|i| {
            let at = |v: u32| (v as f64 + 0.5) / size as f64;
            let dir = corner + right * at(even_bits(i)) + down * at(even_bits(i >> 1));
            Ray::new((eye - world.origin()).as_vec3(), dir.as_vec3())
        })
        .collect();
    RayBlock::from_rays(&rays)
}

/// Points that rays hit, moved slightly off the surface to the side the rays came from, with the
/// normal there.
pub fn points_met(world: &World, mesh: &TriMesh, rays: &[RayBlock]) -> Vec<(Vec3, Vec3)> {
    let mut hits = vec![HitBlock::MISS; rays.len()];
    world.closest_coherent(rays, &mut hits).expect("one each");
    let lanes =
        rays.iter().zip(&hits).flat_map(|(r, h)| (0..LANES).map(move |l| (r.get(l), h.get(l))));
    lanes
        .filter_map(|(ray, hit)| {
            let [a, b, c] = mesh.triangle(hit?.prim as usize);
            let n = (b - a).cross(c - a).normalize();
            let n = if n.dot(ray.dir) > 0.0 { -n } else { n };
            Some((ray.at(hit?.t) + n * 1e-4, n))
        })
        .collect()
}
