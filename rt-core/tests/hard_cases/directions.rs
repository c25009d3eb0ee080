//! Directions with zeros, denormals and tiny components; rays in the planes of faces and boxes.

use crate::common::*;
use crate::oracle::check;
use rt_core::glam::{DVec3, Vec3};
use rt_core::ray::Ray;

/// Directions with every combination of awkward components.
fn awkward() -> Vec<Vec3> {
    let values =
        [0.0, -0.0, 1e-30, -1e-30, f32::from_bits(1), -f32::from_bits(77), 1e-10, 1.0, -0.7];
    let mut all = Vec::new();
    for x in values {
        for y in values {
            for z in values {
                let d = Vec3::new(x, y, z);
                if d != Vec3::ZERO {
                    all.push(d);
                }
            }
        }
    }
    all
}

#[test]
fn zero_denormal_and_tiny_components_hit_what_the_oracle_says() {
    for mesh in [sphere(1, 1.0, DVec3::ZERO), cube(2), soup(60, 4)] {
        let mut rays = Vec::new();
        for d in awkward() {
            // From inside, and from outside towards the mesh.
            rays.push(Ray::new(Vec3::new(0.1, -0.2, 0.15), d));
            let long = d / d.abs().max_element();
            rays.push(Ray::new(Vec3::new(0.05, 0.1, -0.12) - long * 3.0, d));
        }
        for options in some_options() {
            let w = world(&mesh, &options);
            let hits = hits_all_ways(&w, &rays, &format!("{options:?}"));
            for (r, h) in rays.iter().zip(hits) {
                // t of directions below 1e-36 overflows in f32.
                if r.dir.abs().max_element() > 1e-35 {
                    check(&mesh, w.origin(), r, h, &format!("{options:?}"));
                }
            }
        }
    }
}

#[test]
fn scaling_a_direction_scales_t_and_nothing_else() {
    let mesh = sphere(2, 1.0, DVec3::ZERO);
    for options in some_options() {
        let w = world(&mesh, &options);
        let rays = inward_rays(300, 8);
        for exponent in [-120, -60, -20, 20, 60, 110] {
            let k = (exponent as f32).exp2();
            let long: Vec<Ray> = rays.iter().map(|r| Ray { dir: r.dir * k, ..*r }).collect();
            for (i, h) in hits_all_ways(&w, &long, "scaled").into_iter().enumerate() {
                let e = w.closest(&rays[i]);
                assert_eq!(
                    h.map(|h| (h.prim, h.u, h.v, h.t * k)),
                    e.map(|h| (h.prim, h.u, h.v, h.t)),
                    "{options:?} 2^{exponent}: {:?}",
                    rays[i]
                );
            }
        }
    }
}

/// Inside a closed cube of axis-aligned squares, every ray in one of its lattice planes must hit,
/// whatever the sign of its zeros.
#[test]
fn rays_in_box_planes_do_not_leak() {
    let mesh = cube(4);
    let mut rays = Vec::new();
    for i in 0..9 {
        for j in 0..9 {
            for k in 0..9 {
                let o = Vec3::new(i as f32, j as f32, k as f32) / 5.0 - 0.8;
                let on_lattice = Vec3::new(i as f32, j as f32, k as f32) / 8.0 - 0.5;
                for axis in 0..3 {
                    for s in [-1.0, 1.0] {
                        for zero in [0.0, -0.0] {
                            let mut d = [zero; 3];
                            d[axis] = s;
                            rays.push(Ray::new(on_lattice, Vec3::from_array(d)));
                            d[(axis + 1) % 3] = 0.5;
                            rays.push(Ray::new(on_lattice, Vec3::from_array(d)));
                            rays.push(Ray::new(o, Vec3::from_array(d)));
                        }
                    }
                }
            }
        }
    }
    for options in some_options() {
        let w = world(&mesh, &options);
        let hits = hits_all_ways(&w, &rays, &format!("{options:?}"));
        let exact = options.robustness == rt_core::bvh::Robustness::Watertight;
        let lost = hits.iter().filter(|h| h.is_none()).count();
        assert!(!exact || lost == 0, "{options:?}: {lost} of {} rays lost", rays.len());
        for (r, h) in rays.iter().zip(hits).step_by(13).filter(|(_, h)| h.is_some()) {
            check(&mesh, w.origin(), r, h, &format!("{options:?}"));
        }
    }
}

#[test]
fn rays_in_a_face_plane_hit_its_neighbours() {
    // Along the face z = 1 of a cube: the face is edge-on, but rays hit the sides at their upper
    // edges.
    let mesh = cube(1);
    for options in some_options() {
        let w = world(&mesh, &options);
        for y in [-0.9f32, -0.3, 0.2, 0.7] {
            for dy in [0.0f32, -0.0, 0.01] {
                let h = w.closest(&Ray::new(Vec3::new(-3.0, y, 1.0), Vec3::new(1.0, dy, 0.0)));
                let h = h.unwrap_or_else(|| panic!("{options:?}: nothing at y {y}"));
                assert!((h.t - 2.0).abs() < 1e-6, "{options:?}: {h:?}");
            }
        }
        // Just above the face, nothing is hit.
        assert!(w.closest(&Ray::new(Vec3::new(-3.0, 0.1, 1.0f32.next_up()), Vec3::X)).is_none());
    }
}
