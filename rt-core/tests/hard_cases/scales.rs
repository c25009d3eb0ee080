//! Large and small meshes, and rays from far away.

use crate::agreement::placements;
use crate::common::*;
use crate::oracle::check;
use rt_core::bvh::{BuildOptions, Geometry, Instance, Robustness, World};
use rt_core::glam::{DAffine3, DVec3, Vec3};
use rt_core::math::SplitMix64;
use rt_core::mesh::TriMesh;
use rt_core::ray::Ray;
use rt_core::robustness::{LeakTest, QueryKind, RayOrigins, RayTarget};
use std::sync::Arc;

fn scaled(mesh: &TriMesh, k: f32) -> TriMesh {
    TriMesh { positions: mesh.positions.iter().map(|p| *p * k).collect(), ..mesh.clone() }
}

#[test]
fn meshes_from_1e_minus_30_to_1e30_are_hit_like_those_of_size_one() {
    let unit = sphere(2, 1.0, DVec3::ZERO);
    let rays = camera(Vec3::new(0.3, -2.0, 2.9), Vec3::ZERO, 1.2, 2);
    for options in some_options() {
        let one = world(&unit, &options);
        for exponent in [-30, -20, -12, -9, -6, -3, 3, 6, 9, 12, 20, 30] {
            // A power of two near the power of ten. Then the numbers differ only in their
            // exponents.
            let k = ((10f32).powi(exponent).log2().round()).exp2();
            let w = world(&scaled(&unit, k), &options);
            let scaled_rays: Vec<Ray> =
                rays.iter().map(|r| Ray { origin: r.origin * k, ..*r }).collect();
            let what = format!("size {k:e}, {options:?}");
            for (i, h) in hits_all_ways(&w, &scaled_rays, &what).into_iter().enumerate() {
                let expected = one.closest(&rays[i]);
                assert_eq!(h.map(|h| h.prim), expected.map(|h| h.prim), "{what}: ray {i}");
                if let (Some(h), Some(e)) = (h, expected) {
                    assert!((h.t / k / e.t - 1.0).abs() < 1e-6, "{what}: {h:?} is not {e:?}");
                }
            }
            // The same with directions as long as the mesh is large: t does not change.
            for (r, s) in rays.iter().zip(&scaled_rays) {
                let long = Ray { dir: r.dir * k, ..*s };
                let (h, e) = (w.closest(&long), one.closest(r));
                assert_eq!(h.map(|h| (h.prim, h.t)), e.map(|h| (h.prim, h.t)), "{what}: {long:?}");
            }
        }
    }
}

#[test]
fn meshes_of_any_size_are_watertight() {
    for exponent in [-30, -9, -5, 5, 9, 30] {
        let radius = (10f64).powi(exponent);
        for offset in [0.0, 1e3] {
            let center = DVec3::new(1.0, 0.7, -1.3) * radius * offset;
            let mesh = sphere(3, radius, center);
            let w = World::from_mesh(mesh.clone(), &BuildOptions::default()).expect("closed");
            for aim in RayTarget::ALL {
                for query in QueryKind::ALL {
                    let start = RayOrigins::Ball { center, radius: 0.6 * radius };
                    let c =
                        LeakTest { world: &w, mesh: &mesh, start, aim, seed: 3 }.count(query, 4096);
                    assert_eq!(
                        (c.leaks, c.occlusion_leaks),
                        (0, 0),
                        "radius {radius:e}, offset {offset}: {c:?}"
                    );
                }
            }
        }
    }
}

/// A camera this many sizes away sees the same triangles as one three sizes away in the same
/// direction with the same perspective, as the f64 oracle computes them.
#[test]
fn cameras_1e6_and_1e9_away_lose_nothing() {
    let mesh = sphere(2, 1.0, DVec3::ZERO);
    for options in some_options() {
        let w = world(&mesh, &options);
        for distance in [1e6, 1e9] {
            let eye = DVec3::new(0.6, -0.48, 0.64) * distance;
            let (mut hits, mut rays) = (0, Vec::new());
            for i in 0..400 {
                let (x, y) = ((i % 20) as f64 / 10.0 - 0.95, (i / 20) as f64 / 10.0 - 0.95);
                let target = DVec3::new(x, y, 0.0);
                let (ray, moved) = w.ray_from_world(eye, (target - eye) / distance);
                // The oracle gets the moved ray. Its origin is compared with the line in f64.
                let o = ray.origin.as_dvec3() + w.origin();
                let off = (o - eye).cross(target - eye).length() / (target - eye).length();
                assert!(
                    off < 1e-6,
                    "distance {distance}: the moved ray starts {off} beside the line"
                );
                assert!(moved > 0.9 * distance, "the ray starts near the mesh");
                let found = w.closest(&ray);
                hits += found.is_some() as usize;
                check(&mesh, w.origin(), &ray, found, "far camera");
                rays.push(ray);
            }
            // The square from -0.95 to 0.95 around the unit sphere's centre, viewed at an angle of
            // 50 degrees.
            assert!(hits > 250, "distance {distance}: {hits} of 400 hit");
            hits_all_ways(&w, &rays, "far camera");
        }
    }
}

#[test]
fn f32_origins_1e6_and_1e9_away_hit_what_f64_says() {
    let mesh = sphere(2, 1.0, DVec3::ZERO);
    for options in some_options() {
        let w = world(&mesh, &options);
        for distance in [1e6f32, 1e9] {
            let mut r = SplitMix64::new(17);
            let mut rays = Vec::new();
            for _ in 0..300 {
                // Directions whose f32 rounding still hits the mesh: along the axes, or aimed and
                // kept if they hit.
                let o = (r.direction().as_vec3()) * distance;
                let aim = (r.direction() * 0.5).as_vec3();
                rays.push(Ray::new(o, aim - o));
                rays.push(Ray::new(Vec3::new(aim.x, aim.y, distance), -Vec3::Z));
            }
            let hits = hits_all_ways(&w, &rays, "far origins");
            assert!(hits[1..].iter().step_by(2).all(Option::is_some), "rays along the axis hit");
            for (ray, h) in rays.iter().zip(hits) {
                // The barycentrics give the position: the point is on the ray to the mesh's
                // precision, although t is not.
                let (o, d) = (ray.origin.as_dvec3() + w.origin(), ray.dir.as_dvec3());
                let miss = (-o).cross(d).length() / d.length();
                match h {
                    None => assert!(miss > 0.94, "{ray:?} passes {miss} from the centre"),
                    Some(h) => {
                        let [a, b, c] = mesh.triangle(h.prim as usize).map(|p| p.as_dvec3());
                        let p = a + (b - a) * h.u as f64 + (c - a) * h.v as f64;
                        let off = (p - o).cross(d).length() / d.length();
                        assert!(off < 3e-6, "{ray:?}: {h:?} is {off} beside the ray");
                        assert!(
                            (p - o).dot(d) / d.length() < distance as f64 * 1.8,
                            "the near side"
                        );
                        let nearer = p.dot(d);
                        assert!(nearer <= 1e-3 * d.length(), "{ray:?}: {h:?} is on the far side");
                    }
                }
            }
        }
    }
}

#[test]
fn a_mesh_at_1e9_is_traced_around_its_own_place() {
    let center = DVec3::new(1e9, -3e9, 2e9);
    let mesh = sphere(3, 1.0, center);
    for robustness in Robustness::ALL {
        let w = world(&mesh, &BuildOptions { robustness, ..Default::default() });
        let (ray, _) = w.ray_from_world(center + DVec3::new(0.1, 0.2, 5.0), -DVec3::Z);
        let h = w.closest(&ray).expect("straight at it");
        // Coordinates of 1e9 have steps of 1.2e-7 in f64.
        let exact = 5.0 - (1.0f64 - 0.05).sqrt();
        assert!((h.t as f64 - exact).abs() < 0.02, "{h:?} at {exact}");
    }
}

#[test]
fn instances_far_from_one_another_keep_their_shape() {
    // A small sphere at 1e7 together with one of size 1e7.
    let mesh = Arc::new(sphere(3, 1.0, DVec3::ZERO));
    let small = DVec3::new(3e7, 1e7, 0.0);
    let instances = vec![
        Instance { geometry: 0, world_from_object: DAffine3::from_scale(DVec3::splat(1e7)) },
        Instance { geometry: 0, world_from_object: DAffine3::from_translation(small) },
    ];
    for options in some_options() {
        let w = World::build(vec![Geometry::Mesh(mesh.clone())], instances.clone(), &options)
            .expect("fine");
        // The f32 grid at 3e7 has steps of 2. The eye is on the grid, 8 away, and looks along z.
        let eye = w.render_from_world(small + DVec3::new(0.0, 0.0, 8.0));
        let h = w.closest(&Ray::new(eye, -Vec3::Z)).expect("straight at the small one");
        assert_eq!(h.instance, 1, "{options:?}");
        assert!((h.t - 7.0).abs() < 0.01, "{options:?}: {h:?}");
        let tile = camera(eye, eye - Vec3::Z * 8.0, 1.5, 1);
        let hits = hits_all_ways(&w, &tile, "beside a large one");
        assert!(hits.iter().flatten().filter(|h| h.instance == 1).count() > 60, "{options:?}");
    }
}

#[test]
fn spread_out_instances_packets_equal_single_rays() {
    let mesh = Arc::new(sphere(2, 1.0, DVec3::ZERO));
    for spread in [1e3, 1e6] {
        let places = placements(40, 21, spread);
        let instances: Vec<Instance> = places
            .iter()
            .map(|&world_from_object| Instance { geometry: 0, world_from_object })
            .collect();
        for options in some_options() {
            let w = World::build(vec![Geometry::Mesh(mesh.clone())], instances.clone(), &options)
                .expect("fine");
            let mut rays = Vec::new();
            let mut r = SplitMix64::new(4);
            for i in 0..1500 {
                let at = w.render_from_world(places[i % places.len()].translation);
                let from = w.render_from_world(
                    places[(r.bits() % places.len() as u64) as usize].translation,
                ) + Vec3::new(0.5, 1.5, 2.0);
                let aim = at + (r.direction() * 0.3).as_vec3();
                rays.push(Ray::new(from, aim - from));
            }
            let hits = hits_all_ways(&w, &rays, &format!("spread {spread}, {options:?}"));
            assert!(hits.iter().flatten().count() > 300);
        }
    }
}
