//! Triangles ten thousand times as long as they are wide, in all directions: their boxes say little
//! about them, and a ray that enters a box mostly misses what is inside.

use crate::common::*;
use crate::oracle::check;
use rt_core::glam::{DVec3, Vec3};
use rt_core::math::SplitMix64;
use rt_core::mesh::TriMesh;
use rt_core::ray::Ray;

const ASPECT: f64 = 1e4;

/// Strips of two slivers each, which share their long edge, around random points.
fn strips(count: usize, random: &mut SplitMix64) -> TriMesh {
    let mut mesh = TriMesh::default();
    for _ in 0..count {
        let middle = random.direction() * random.unit();
        let along = random.direction() * (0.3 + 0.7 * random.unit());
        let across = along.cross(random.direction()).normalize() * (along.length() / ASPECT);
        let first = mesh.positions.len() as u32;
        let corners = [-along - across, along - across, along + across, -along + across];
        mesh.positions.extend(corners.map(|c| (middle + c).as_vec3()));
        mesh.indices.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    mesh
}

/// Rays at points of the strips, some of them on the long edge, from every side; many graze.
fn rays(mesh: &TriMesh, count: usize, random: &mut SplitMix64) -> Vec<Ray> {
    let ray = |k: usize, random: &mut SplitMix64| {
        let triangle = (random.unit() * mesh.num_triangles() as f64) as usize;
        let [a, b, c] = mesh.triangle(triangle).map(Vec3::as_dvec3);
        let (u, v) = (random.unit(), if k.is_multiple_of(4) { 0.0 } else { random.unit() });
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let target = a + (c - a) * u + (b - a) * v;
        let normal = (b - a).cross(c - a).normalize();
        let tilt = [1.0, 1e-2, 1e-4][k % 3];
        let from = (random.direction() + normal * tilt).normalize();
        let origin: DVec3 = target + from * (0.5 + random.unit());
        Ray::new(origin.as_vec3(), (target - origin).as_vec3())
    };
    (0..count).map(|k| ray(k, random)).collect()
}

#[test]
fn slivers_at_every_angle() {
    let mut random = SplitMix64::new(41);
    let mesh = strips(400, &mut random);
    let rays = rays(&mesh, 1200, &mut random);
    let mut reference: Option<Vec<_>> = None;
    for options in all_options() {
        let world = world(&mesh, &options);
        let hits = hits_all_ways(&world, &rays, &format!("{options:?}"));
        if options.robustness != rt_core::bvh::Robustness::Watertight {
            continue;
        }
        // The tree, its splits and the instruction set decide no hit.
        let found: Vec<_> = hits.iter().map(|h| bits(*h)).collect();
        match &reference {
            Some(first) => assert!(*first == found, "{options:?} differs from the first options"),
            None => {
                let hit = hits.iter().flatten().count();
                assert!(hit > 300, "{hit} of {} rays hit", rays.len());
                for (ray, h) in rays.iter().zip(&hits) {
                    check(&mesh, world.origin(), ray, *h, "slivers");
                }
                reference = Some(found);
            }
        }
    }
}
