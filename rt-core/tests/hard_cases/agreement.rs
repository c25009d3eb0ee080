//! Packets, instruction sets and presets give the same bits as single rays, and these agree with
//! the oracle.

use crate::common::*;
use crate::oracle::{self, check};
use rt_core::bvh::{BuildOptions, BuildQuality, Geometry, Instance, Robustness, World};
use rt_core::glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use rt_core::math::SplitMix64;
use rt_core::mesh::TriMesh;
use rt_core::ray::Ray;
use rt_core::simd::SimdLevel;
use std::sync::Arc;

pub(crate) fn meshes() -> Vec<(&'static str, TriMesh)> {
    vec![
        ("sphere", sphere(3, 1.0, DVec3::ZERO)),
        ("slivers", torus(300, 5)),
        ("cube", cube(6)),
        ("soup", soup(700, 7)),
        ("needles", needles(300, 8)),
    ]
}

pub(crate) fn views() -> Vec<(&'static str, Vec<Ray>)> {
    let eye = Vec3::new(0.3, -2.0, 2.9);
    let tiles = camera(eye, Vec3::ZERO, 1.2, 3);
    let to_light = tiles
        .iter()
        .map(|r| Ray { origin: r.at(0.9), dir: -r.dir, t_min: 0.01, t_max: 0.85 })
        .collect();
    let mut all = vec![
        ("inside", camera(Vec3::new(0.1, 0.2, -0.3), Vec3::new(0.4, 1.0, 0.9), 1.0, 2)),
        ("far", camera(Vec3::new(3e5, -4e5, 8e5), Vec3::ZERO, 1.2, 2)),
        ("to a light", to_light),
        ("all directions", inward_rays(1500, 11)),
        ("along an axis", grid_along_z()),
        ("at vertices", at_lattice(eye)),
    ];
    // Octants change within a block; some lanes have no ray or an invalid one.
    let mut mixed = inward_rays(1000, 3);
    for (i, r) in mixed.iter_mut().enumerate() {
        match i % 11 {
            0 => r.dir.x = f32::NAN,
            1 => r.origin.y = f32::INFINITY,
            2 => r.t_max = -1.0,
            3 => r.dir = Vec3::ZERO,
            4 => r.t_min = f32::NAN,
            5 => r.t_max = f32::NAN,
            6 => r.dir *= 1e-30,
            7 => r.dir *= 1e25,
            _ => {}
        }
    }
    all.push(("mixed with broken rays", mixed));
    // The same within tiles, so that the other rays still form packets.
    let mut holes = tiles.clone();
    for (i, r) in holes.iter_mut().enumerate() {
        match i % 97 {
            0 => r.dir.z = f32::NAN,
            1..40 => r.t_max = -1.0,
            50 => r.origin.x = f32::NAN,
            60 => r.dir *= 1e-35,
            _ => {}
        }
    }
    all.push(("tiles with holes", holes));
    all.push(("tiles", tiles));
    all
}

/// Parallel rays along z from a lattice that contains the cubes' planes, with zeros of both signs.
fn grid_along_z() -> Vec<Ray> {
    (0..33 * 33)
        .map(|i| {
            let (x, y) = ((i % 33) as f32 / 12.0 - 4.0 / 3.0, (i / 33) as f32 / 12.0 - 4.0 / 3.0);
            let zero = if i % 2 == 0 { 0.0 } else { -0.0 };
            Ray::new(Vec3::new(x, y, 3.0), Vec3::new(zero, 0.0, -1.0))
        })
        .collect()
}

/// Rays from `eye` exactly at points of a lattice on which the cube has vertices and edges.
fn at_lattice(eye: Vec3) -> Vec<Ray> {
    (0..13 * 13)
        .map(|i| Vec3::new((i % 13) as f32 / 6.0 - 1.0, (i / 13) as f32 / 6.0 - 1.0, 1.0))
        .map(|p| Ray::new(eye, p - eye))
        .collect()
}

#[test]
fn packets_and_levels_equal_single_rays_bit_for_bit() {
    let views = views();
    for (mesh_name, mesh) in meshes() {
        for robustness in Robustness::ALL {
            for (k, quality) in BuildQuality::ALL.into_iter().enumerate() {
                for (name, rays) in &views {
                    let mut first: Option<Vec<_>> = None;
                    for (l, simd) in SimdLevel::available().into_iter().enumerate() {
                        // Each preset at two levels, so that all levels occur over the presets.
                        if (k + l) % 2 == 1 {
                            continue;
                        }
                        let options = BuildOptions {
                            quality,
                            robustness,
                            simd: Some(simd),
                            ..Default::default()
                        };
                        let w = world(&mesh, &options);
                        let what = format!("{mesh_name}, {name}, {options:?}");
                        let hits: Vec<_> =
                            hits_all_ways(&w, rays, &what).into_iter().map(bits).collect();
                        match &first {
                            None => first = Some(hits),
                            Some(f) => assert!(*f == hits, "{what}: differs from the first level"),
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn presets_give_the_same_bits() {
    // The order of the leaves must not decide the result.
    for (mesh_name, mesh) in meshes() {
        for robustness in Robustness::ALL {
            let worlds = BuildQuality::ALL.map(|quality| {
                world(&mesh, &BuildOptions { quality, robustness, ..Default::default() })
            });
            for (name, rays) in views() {
                for (i, r) in rays.iter().enumerate() {
                    let h = worlds.each_ref().map(|w| bits(w.closest(r)));
                    assert!(
                        h.iter().all(|x| *x == h[0]),
                        "{mesh_name}, {name}, {robustness:?}, ray {i} {r:?}: {h:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn single_rays_agree_with_the_f64_oracle() {
    let mut worst = 0f64;
    for (mesh_name, mesh) in meshes() {
        for options in some_options() {
            let w = world(&mesh, &options);
            for (name, rays) in views() {
                let what = format!("{mesh_name}, {name}, {options:?}");
                for r in rays.iter().step_by(29).filter(|r| r.is_valid()) {
                    worst =
                        worst.max(check(&mesh, w.origin(), r, w.closest(r), &what).unwrap_or(0.0));
                }
            }
        }
    }
    println!("largest error of t: {worst:.2} roundings");
}

/// Random invertible transforms of every kind.
pub(crate) fn placements(n: usize, seed: u64, spread: f64) -> Vec<DAffine3> {
    let mut r = SplitMix64::new(seed);
    (0..n)
        .map(|i| {
            let turn = DMat3::from_quat(DQuat::from_axis_angle(r.direction(), 6.0 * r.unit()));
            let mut scale = DVec3::splat(0.3);
            match i % 5 {
                1 => scale.x = -0.3,
                2 => scale = DVec3::new(0.01, 0.3, 1.0),
                3 => scale = DVec3::new(0.5, -0.1, -0.002),
                _ => {}
            }
            let matrix3 =
                if i % 7 == 0 { DMat3::IDENTITY } else { turn } * DMat3::from_diagonal(scale);
            DAffine3 { matrix3, translation: r.direction() * r.unit() * spread }
        })
        .collect()
}

#[test]
fn many_instances_packets_equal_single_rays_and_the_oracle() {
    let geometries = [sphere(2, 1.0, DVec3::ZERO), cube(3), soup(40, 3)];
    let places = placements(60, 9, 1.5);
    let instances: Vec<Instance> = places
        .iter()
        .enumerate()
        .map(|(i, &world_from_object)| Instance { geometry: i % 3, world_from_object })
        .collect();
    let mut worst = 0f64;
    for options in some_options() {
        let all = geometries.iter().map(|m| Geometry::Mesh(Arc::new(m.clone()))).collect();
        let w = World::build(all, instances.clone(), &options).expect("invertible");
        for (name, rays) in views() {
            let hits = hits_all_ways(&w, &rays, &format!("instances, {name}, {options:?}"));
            for (r, h) in rays.iter().zip(&hits).step_by(61).filter(|(r, _)| r.is_valid()) {
                let error = check_instances(&w, &geometries, &instances, r, *h, name);
                worst = worst.max(error.unwrap_or(0.0));
            }
        }
    }
    println!("largest error of t: {worst:.2} of what rounding may make");
}

/// Checks that the hit is where the f64 reference puts it and that no other hit is certainly
/// nearer. Both allow for the rounding error of t ([`oracle::PlaneIntersection::t_error`]), as for
/// one mesh. That error grows with the coordinates, the slant and the slenderness of the triangle;
/// transforming the rays adds no more. Returns the error of t as a fraction of the allowed error,
/// or `None` for a miss. (The largest is 0.35.)
fn check_instances(
    w: &World,
    geometries: &[TriMesh],
    instances: &[Instance],
    ray: &Ray,
    found: Option<rt_core::ray::Hit>,
    what: &str,
) -> Option<f64> {
    let (o, d) = (ray.origin.as_dvec3() + w.origin(), ray.dir.as_dvec3());
    let far = o.length() > 100.0;
    let corners = |inst: &Instance, i: usize| {
        let place = |p: Vec3| inst.world_from_object.transform_point3(p.as_dvec3());
        geometries[inst.geometry].triangle(i).map(place)
    };
    // The largest t that the nearest hit may have with any rounding.
    let (mut nearest, mut which) = (f64::INFINITY, 0);
    for (k, inst) in instances.iter().enumerate() {
        for i in 0..geometries[inst.geometry].num_triangles() {
            let Some(x) = oracle::intersect_plane(corners(inst, i), o, d) else { continue };
            // Certainly inside, even when the ray moves by 10⁻⁵ (see below).
            let inside = x.depth > 1e-5 * x.depth_per_length;
            let (low, high) = (x.t - x.t_error, x.t + x.t_error);
            let in_range = low >= ray.t_min as f64 && high < ray.t_max as f64;
            if inside && in_range && high < nearest {
                (nearest, which) = (high, k);
            }
        }
    }
    let Some(h) = found else {
        assert!(
            nearest == f64::INFINITY,
            "{what}: {ray:?} misses, but hits instance {which} at {nearest}"
        );
        return None;
    };
    assert!(
        (h.t as f64) <= nearest,
        "{what}: {ray:?}: {h:?} lies behind instance {which} at {nearest}"
    );
    let inst = &instances[h.instance as usize];
    let [a, b, c] = corners(inst, h.prim as usize);
    let p = a + (b - a) * h.u as f64 + (c - a) * h.v as f64;
    // The distance of the hit point from the ray.
    let off = (p - o).cross(d).length() / d.length();
    let limit = if far { 2e-5 } else { 1e-5 };
    assert!(off < limit, "{what}: {ray:?}: {h:?}: the hit point is {off} beside the ray");
    let x = oracle::intersect_plane([a, b, c], o, d)
        .unwrap_or_else(|| panic!("{what}: {ray:?}: {h:?} is parallel to the ray, or no triangle"));
    let error = (h.t as f64 - x.t).abs() / x.t_error;
    assert!(
        error <= 1.0,
        "{what}: {ray:?}: {h:?} should have t {}: {error} times the allowed error",
        x.t
    );
    Some(error)
}
