//! The range of t is half-open and exact: `t_min <= t < t_max`.

use crate::agreement::placements;
use crate::common::*;
use rt_core::bvh::{Geometry, Instance, World};
use rt_core::glam::DVec3;
use rt_core::ray::Ray;
use std::sync::Arc;

fn check_limits(w: &World, rays: &[Ray], what: &str) {
    let free = hits_all_ways(w, rays, what);
    let with = |f: &dyn Fn(&Ray, f32) -> Ray| -> Vec<Ray> {
        rays.iter().zip(&free).map(|(r, h)| h.map_or(*r, |h| f(r, h.t))).collect()
    };
    // A range that ends exactly at the hit has no hit; one step later it has the same hit. A range
    // that starts exactly there has the same hit; one step later it has a hit behind.
    let up_to = hits_all_ways(w, &with(&|r, t| Ray { t_max: t, ..*r }), what);
    let beyond = hits_all_ways(w, &with(&|r, t| Ray { t_max: t.next_up(), ..*r }), what);
    let from = hits_all_ways(w, &with(&|r, t| Ray { t_min: t, ..*r }), what);
    let behind = hits_all_ways(w, &with(&|r, t| Ray { t_min: t.next_up(), ..*r }), what);
    let mut hits = 0;
    for (i, h) in free.iter().enumerate() {
        let Some(f) = h else { continue };
        hits += 1;
        assert_eq!(up_to[i], None, "{what}: {:?} with t_max {} still hits", rays[i], f.t);
        assert_eq!(
            bits(beyond[i]),
            bits(*h),
            "{what}: {:?} with t_max just beyond {}",
            rays[i],
            f.t
        );
        assert_eq!(bits(from[i]), bits(*h), "{what}: {:?} with t_min {}", rays[i], f.t);
        assert!(
            behind[i].is_none_or(|b| b.t > f.t),
            "{what}: {:?} with t_min just beyond {}",
            rays[i],
            f.t
        );
    }
    assert!(hits > 50, "{what}: only {hits} hits");
}

#[test]
fn limits_are_exact_on_one_mesh() {
    for mesh in [sphere(2, 1.0, DVec3::ZERO), cube(3), soup(300, 6)] {
        for options in some_options() {
            let w = world(&mesh, &options);
            check_limits(&w, &inward_rays(700, 9), &format!("{options:?}"));
        }
    }
}

#[test]
fn limits_are_exact_far_away_and_on_instances() {
    let far: Vec<Ray> =
        inward_rays(700, 10).iter().map(|r| Ray::new(r.origin * 3e5, -r.origin * 3e5)).collect();
    let one = sphere(2, 1.0, DVec3::ZERO);
    let instances: Vec<Instance> = placements(30, 2, 1.0)
        .iter()
        .map(|&world_from_object| Instance { geometry: 0, world_from_object })
        .collect();
    for options in some_options() {
        check_limits(&world(&one, &options), &far, &format!("far, {options:?}"));
        let w =
            World::build(vec![Geometry::Mesh(Arc::new(one.clone()))], instances.clone(), &options)
                .expect("invertible");
        check_limits(&w, &inward_rays(700, 9), &format!("instances, {options:?}"));
        check_limits(&w, &far, &format!("far instances, {options:?}"));
    }
}

#[test]
fn limits_are_exact_for_tiny_and_huge_directions() {
    for options in some_options() {
        let w = world(&sphere(1, 1.0, DVec3::ZERO), &options);
        for length in [1e-42f32, 1e-38, 1e-20, 1e-5, 1e5, 1e20, 1e36] {
            // Distances from about 10⁻³⁰ to 3, so that t is in range for most lengths and
            // underflows or overflows for the others.
            let rays: Vec<Ray> = inward_rays(96, 3)
                .iter()
                .map(|r| Ray { dir: r.dir.normalize() * length, t_min: 1e-30, ..*r })
                .collect();
            for (r, h) in rays.iter().zip(hits_all_ways(&w, &rays, "lengths")) {
                let Some(h) = h else {
                    // Misses are allowed only where the distance, 2 to 3, divided by the length
                    // exceeds the range of f32.
                    assert!(length < 1e-37 || !w.occluded(r), "{options:?}: {r:?}");
                    continue;
                };
                assert!(h.t >= r.t_min && h.t < r.t_max, "{options:?}: {r:?}: {h:?}");
                let at_end = Ray { t_max: h.t, ..*r };
                assert_eq!(w.closest(&at_end), None, "{options:?}: {at_end:?}");
                let from = Ray { t_min: h.t, ..*r };
                assert_eq!(bits(w.closest(&from)), bits(Some(h)), "{options:?}: {from:?}");
            }
        }
    }
}

#[test]
fn empty_and_reversed_ranges_hit_nothing() {
    let w = world(&sphere(1, 1.0, DVec3::ZERO), &Default::default());
    let rays: Vec<Ray> = inward_rays(320, 3)
        .into_iter()
        .enumerate()
        .map(|(i, r)| match i % 4 {
            0 => Ray { t_min: 0.5, t_max: 0.5, ..r },
            1 => Ray { t_min: 2.0, t_max: 1.0, ..r },
            2 => Ray { t_max: 0.0, ..r },
            _ => Ray { t_min: f32::INFINITY, ..r },
        })
        .collect();
    assert!(hits_all_ways(&w, &rays, "empty ranges").iter().all(Option::is_none));
}
