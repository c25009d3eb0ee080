//! Meshes and worlds that are empty, invalid or without volume.

use crate::common::*;
use crate::oracle::check;
use rt_core::bvh::{BuildError, BuildOptions, Geometry, Instance, Robustness, StreamError, World};
use rt_core::glam::{DAffine3, DMat3, DVec3, Vec3};
use rt_core::math::SplitMix64;
use rt_core::mesh::TriMesh;
use rt_core::ray::{HitBlock, NO_HIT, Ray, RayBlock};
use std::sync::Arc;

#[test]
fn worlds_without_anything_are_missed() {
    let rays = inward_rays(300, 1);
    for options in all_options() {
        let nothing = World::build(Vec::new(), Vec::new(), &options).expect("an empty world");
        assert!(nothing.bounds().is_empty());
        assert!(hits_all_ways(&nothing, &rays, "nothing").iter().all(Option::is_none));
        let empty = world(&TriMesh::default(), &options);
        assert!(hits_all_ways(&empty, &rays, "no triangles").iter().all(Option::is_none));
        // An empty mesh does not affect the other meshes.
        let geometries = vec![
            Geometry::Mesh(Arc::new(TriMesh::default())),
            Geometry::Mesh(Arc::new(sphere(1, 1.0, DVec3::ZERO))),
        ];
        let place = |geometry| Instance { geometry, world_from_object: DAffine3::IDENTITY };
        let w =
            World::build(geometries, vec![place(0), place(1), place(0)], &options).expect("fine");
        let hits = hits_all_ways(&w, &rays, "empty ones among others");
        assert!(
            hits.iter().flatten().count() > 200 && hits.iter().flatten().all(|h| h.instance == 1)
        );
        let (ray, moved) = nothing.ray_from_world(DVec3::new(1e9, 0.0, 0.0), DVec3::X);
        assert_eq!((nothing.closest(&ray), moved), (None, 0.0));
    }
}

#[test]
fn one_triangle() {
    let mesh = TriMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
    let rays = inward_rays(700, 2);
    for options in all_options() {
        let w = world(&mesh, &options);
        let hits = hits_all_ways(&w, &rays, "one triangle");
        assert!(hits.iter().flatten().count() > 30);
        for (r, h) in rays.iter().zip(hits) {
            check(&mesh, w.origin(), r, h, "one triangle");
        }
    }
}

#[test]
fn triangles_without_area_are_counted_and_harm_nothing() {
    let mut mesh = sphere(2, 1.0, DVec3::ZERO);
    let good = mesh.num_triangles();
    let rays = inward_rays(1500, 3);
    let mut r = SplitMix64::new(5);
    let clean = mesh.clone();
    for i in 0..500u32 {
        let n = mesh.positions.len() as u32;
        let p = (r.direction() * r.unit()).as_vec3();
        // Points, and segments of every length: the third corner is one of the others or exactly
        // between them.
        let q = if i % 3 == 0 { p } else { Vec3::new(p.x + 2.0, p.y, p.z) };
        let third = if i % 3 == 2 { Vec3::new(p.x + 1.0, p.y, p.z) } else { p };
        mesh.positions.extend([p, q, third]);
        mesh.indices.push([n, n + 1, n + 2]);
    }
    mesh.indices.extend([[0, 0, 0], [1, 1, 2], [2, 3, 2]]);
    assert!(mesh.validate().zero_area >= 300, "{:?}", mesh.validate());
    assert_eq!(mesh.validate().skipped(), 0);
    for options in some_options() {
        let (w, c) = (world(&mesh, &options), world(&clean, &options));
        let hits = hits_all_ways(&w, &rays, "with degenerate triangles");
        for (i, h) in hits.iter().enumerate() {
            assert_eq!(bits(*h), bits(c.closest(&rays[i])), "{options:?}: {:?}", rays[i]);
        }
        assert_eq!(w.report().primitives, good + 503);
    }
}

#[test]
fn nan_infinite_and_missing_vertices_are_reported_and_the_rest_is_rendered() {
    let clean = sphere(3, 1.0, DVec3::ZERO);
    let mut mesh = clean.clone();
    let n = mesh.positions.len() as u32;
    mesh.positions.extend([
        Vec3::splat(f32::NAN),
        Vec3::new(f32::INFINITY, 0.0, 0.0),
        Vec3::new(0.0, f32::NEG_INFINITY, 0.0),
        Vec3::new(0.0, 0.0, f32::NAN),
    ]);
    for k in 0..4 {
        mesh.indices.push([0, 1, n + k]);
        mesh.indices.push([n + k; 3]);
    }
    mesh.indices.extend([[0, 1, n + 4], [u32::MAX, 0, 1], [0, u32::MAX - 1, 5]]);
    let report = mesh.validate();
    assert_eq!((report.non_finite, report.index_out_of_range, report.skipped()), (8, 3, 11));
    let rays = inward_rays(1000, 4);
    for options in all_options() {
        let (w, c) = (world(&mesh, &options), world(&clean, &options));
        assert_eq!((w.report().skipped, w.report().primitives), (11, clean.num_triangles()));
        for (i, h) in hits_all_ways(&w, &rays, "broken vertices").iter().enumerate() {
            assert_eq!(bits(*h), bits(c.closest(&rays[i])), "{options:?}: {:?}", rays[i]);
        }
    }
    let all_broken = TriMesh::new(vec![Vec3::splat(f32::NAN); 3], vec![[0, 1, 2]; 50]);
    for options in some_options() {
        let w = world(&all_broken, &options);
        assert_eq!((w.report().skipped, w.report().primitives), (50, 0));
        assert_eq!(w.closest(&rays[0]), None);
    }
}

#[test]
fn singular_and_broken_transforms_are_refused_by_number() {
    let mesh = Geometry::Mesh(Arc::new(sphere(0, 1.0, DVec3::ZERO)));
    let flat = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
    let nan = DAffine3::from_translation(DVec3::new(f64::NAN, 0.0, 0.0));
    let dependent = DAffine3 {
        matrix3: DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::new(1.0, 1.0, 0.0)),
        translation: DVec3::ZERO,
    };
    for bad in [flat, nan, dependent] {
        let instances = vec![
            Instance { geometry: 0, world_from_object: DAffine3::IDENTITY },
            Instance { geometry: 0, world_from_object: bad },
        ];
        match World::build(vec![mesh.clone()], instances, &BuildOptions::default()) {
            Err(BuildError::SingularTransform { instance: 1, .. }) => {}
            Err(e) => panic!("{bad:?}: {e}"),
            Ok(_) => panic!("{bad:?} was accepted"),
        }
    }
    let stray = vec![Instance { geometry: 1, world_from_object: DAffine3::IDENTITY }];
    let e =
        World::build(vec![mesh], stray, &BuildOptions::default()).err().expect("no such geometry");
    assert_eq!(e, BuildError::NoSuchGeometry { instance: 0, geometry: 1, count: 1 });
}

/// Triangles at 2^(k/steps), each as large as its distance from the origin. Splits by cost separate
/// one primitive at a time.
fn powers_of_two(exponents: std::ops::Range<i32>, steps: f32) -> TriMesh {
    let mut mesh = TriMesh::default();
    for k in exponents {
        let x = (k as f32 / steps).exp2();
        let n = mesh.positions.len() as u32;
        mesh.positions.extend([Vec3::new(x, 0.0, 0.0), Vec3::new(x, x, 0.0), Vec3::new(x, 0.0, x)]);
        mesh.indices.push([n, n + 1, n + 2]);
    }
    mesh
}

#[test]
fn adversarial_spacing_does_not_overflow_the_stack() {
    let mesh = powers_of_two(-480..480, 16.0);
    // From the left, through all of them. The nearest is the smallest that reaches the ray's
    // height.
    let heights: Vec<f32> = (-200..400).map(|k| 0.3 * (k as f32 / 16.0).exp2()).collect();
    let rays: Vec<Ray> =
        heights.iter().map(|&h| Ray::new(Vec3::new(-1.0, h, h), Vec3::X)).collect();
    for options in some_options() {
        let w = world(&mesh, &options);
        if options.robustness == Robustness::Fast {
            // Without exact decisions, a triangle smaller than the rounding of its distance
            // collapses to a point or a sliver and may be hit falsely. Whether its box is visited
            // then depends on the tree. The fast mode only guarantees to return a result.
            assert!(
                rays.iter().all(|r| w.closest(r).is_some()),
                "{options:?}: every ray meets a large triangle"
            );
            continue;
        }
        for (r, h) in rays.iter().zip(hits_all_ways(&w, &rays, "powers of two")) {
            check(&mesh, w.origin(), r, h, "powers of two").expect("a hit");
        }
    }
}

/// A wider range than products of two lengths can have in f32: triangles that are too small may be
/// missed, but no false hit may occur.
#[test]
fn sizes_over_the_whole_range_of_f32_give_no_false_hits() {
    let mesh = powers_of_two(-120..120, 1.0);
    let rays: Vec<Ray> = (-100..100)
        .map(|k| {
            let h = 0.3 * (k as f32).exp2();
            Ray::new(Vec3::new(-1.0, h, h), Vec3::X)
        })
        .collect();
    for options in some_options().into_iter().filter(|o| o.robustness == Robustness::Watertight) {
        let w = world(&mesh, &options);
        for (r, h) in rays.iter().zip(hits_all_ways(&w, &rays, "the whole range")) {
            let Some(h) = h else { continue };
            let [a, b, c] = mesh.triangle(h.prim as usize);
            assert!(
                h.u >= 0.0 && h.v >= 0.0 && h.u + h.v <= 1.0 + 1e-5,
                "{options:?}: {r:?}: {h:?}"
            );
            assert!(
                (r.at(h.t).x / a.x - 1.0).abs() < 1e-3 || a.x < 1e-6,
                "{options:?}: {r:?}: {h:?} at {a} {b} {c}"
            );
        }
        assert!(w.closest(&rays[190]).is_some(), "{options:?}: a large one is hit");
    }
}

#[test]
fn slices_of_different_length_are_refused_with_both_lengths() {
    let w = world(&sphere(1, 1.0, DVec3::ZERO), &BuildOptions::default());
    let blocks = RayBlock::from_rays(&inward_rays(64, 6));
    for n in [0, 2, 7] {
        let (mut hits, mut masks) = (vec![HitBlock::MISS; n], vec![0u16; n]);
        let refusal = StreamError { rays: 4, answers: n };
        let expected = Err(refusal);
        assert_eq!(w.closest_coherent(&blocks, &mut hits), expected);
        assert_eq!(w.closest_incoherent(&blocks, &mut hits), expected);
        assert_eq!(w.occluded_coherent(&blocks, &mut masks), expected);
        assert_eq!(w.occluded_incoherent(&blocks, &mut masks), expected);
        assert!(hits.iter().all(|h| *h == HitBlock::MISS) && masks.iter().all(|m| *m == 0));
        let words = refusal.to_string();
        assert!(
            words.contains("4 blocks of rays") && words.contains(&format!("of {n}")),
            "{words}"
        );
    }
    let mut hits = vec![HitBlock::MISS; 4];
    w.closest_coherent(&blocks, &mut hits).unwrap();
    assert!(hits.iter().any(|h| h.prim.iter().any(|&p| p != NO_HIT)));
    w.closest_coherent(&[], &mut []).unwrap();
}
