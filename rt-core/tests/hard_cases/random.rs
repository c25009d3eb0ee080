//! Random soups, transforms and rays: nothing panics, every query agrees, and the oracle agrees.
//! `PROPTEST_CASES=10000` searches longer.

use crate::common::*;
use crate::oracle::check;
use proptest::prelude::*;
use rt_core::bvh::{BuildOptions, BuildQuality, Geometry, Instance, Robustness, Storage, World};
use rt_core::glam::{DAffine3, DMat3, DVec3, Vec3};
use rt_core::mesh::TriMesh;
use rt_core::ray::Ray;
use std::sync::Arc;

/// Any f32, biased towards values that cause trouble.
fn wild() -> impl Strategy<Value = f32> + Clone {
    prop_oneof![
        4 => -2.0f32..2.0,
        1 => prop_oneof![Just(0.0), Just(-0.0), Just(1.0), Just(-1.0), Just(0.5)],
        1 => any::<f32>(),
        1 => any::<u32>().prop_map(f32::from_bits),
    ]
}

/// Coordinates on a coarse lattice or anywhere: many ties, shared edges and coplanar triangles.
fn tame() -> impl Strategy<Value = f32> + Clone {
    prop_oneof![(-4i32..=4).prop_map(|i| i as f32 / 4.0), -1.0f32..1.0]
}

fn vec3(of: impl Strategy<Value = f32> + Clone) -> impl Strategy<Value = Vec3> {
    (of.clone(), of.clone(), of).prop_map(|(x, y, z)| Vec3::new(x, y, z))
}

fn mesh(
    of: impl Strategy<Value = f32> + Clone,
    indices: std::ops::Range<u32>,
) -> impl Strategy<Value = TriMesh> {
    (
        prop::collection::vec(vec3(of), 1..40),
        prop::collection::vec(prop::array::uniform3(indices), 0..60),
    )
        .prop_map(|(positions, indices)| TriMesh::new(positions, indices))
}

fn ray(of: impl Strategy<Value = f32> + Clone) -> impl Strategy<Value = Ray> {
    (vec3(of.clone()), vec3(of.clone()), of.clone(), of).prop_map(|(origin, dir, a, b)| {
        let t_max = if b > 1.5 { f32::INFINITY } else { 10.0 * b.abs() };
        Ray { origin, dir, t_min: 0.1 * a.abs().min(1e30), t_max }
    })
}

fn options() -> impl Strategy<Value = BuildOptions> {
    let choices = (0..BuildQuality::ALL.len(), any::<bool>(), any::<bool>());
    choices.prop_map(|(q, exact, compact)| BuildOptions {
        quality: BuildQuality::ALL[q],
        robustness: if exact { Robustness::Watertight } else { Robustness::Fast },
        simd: None,
        storage: if compact { Storage::Compact } else { Storage::Plain },
    })
}

fn transform() -> impl Strategy<Value = DAffine3> {
    prop::array::uniform12(-2.0f64..2.0).prop_map(|m| DAffine3 {
        matrix3: DMat3::from_cols_slice(&m[..9]),
        translation: DVec3::from_slice(&m[9..]),
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn lattice_soups_agree_with_the_oracle_in_every_query(
        mesh in mesh(tame(), 0..40),
        rays in prop::collection::vec(ray(tame()), 1..200),
        options in options(),
    ) {
        let w = world(&mesh, &options);
        prop_assert_eq!(w.report().skipped, mesh.validate().skipped());
        let hits = hits_all_ways(&w, &rays, "soup");
        for (r, h) in rays.iter().zip(hits).filter(|(r, _)| r.is_valid()) {
            check(&mesh, w.origin(), r, h, "soup");
        }
    }

    #[test]
    fn any_bits_at_all_do_not_panic(
        mesh in mesh(wild(), 0..45),
        rays in prop::collection::vec(ray(wild()), 1..100),
        options in options(),
        place in transform(),
    ) {
        let w = world(&mesh, &options);
        prop_assert_eq!(w.report().skipped, mesh.validate().skipped());
        for r in &rays {
            if let Some(h) = w.closest(r) {
                prop_assert!(h.t >= r.t_min && h.t < r.t_max, "{:?} {:?}", r, h);
                prop_assert!((h.prim as usize) < mesh.num_triangles(), "{:?} {:?}", r, h);
            }
        }
        hits_all_ways(&w, &rays, "any bits");
        let instances = vec![
            Instance { geometry: 0, world_from_object: place },
            Instance { geometry: 0, world_from_object: DAffine3::IDENTITY },
        ];
        if let Ok(w) = World::build(vec![Geometry::Mesh(Arc::new(mesh))], instances, &options) {
            for r in &rays {
                let _ = (w.closest(r), w.occluded(r));
            }
        }
    }

    #[test]
    fn random_instances_agree_in_every_query(
        mesh in mesh(tame(), 0..40),
        places in prop::collection::vec(transform(), 1..12),
        rays in prop::collection::vec(ray(tame()), 1..200),
        options in options(),
    ) {
        let instances = places.iter().map(|&world_from_object| Instance { geometry: 0, world_from_object }).collect();
        match World::build(vec![Geometry::Mesh(Arc::new(mesh))], instances, &options) {
            Ok(w) => {
                hits_all_ways(&w, &rays, "instances");
            }
            Err(e) => prop_assert!(e.to_string().contains("determinant"), "{}", e),
        }
    }
}
