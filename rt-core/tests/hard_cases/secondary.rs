//! Secondary rays must not hit the surface they start from, at any scale and from any camera.

use crate::common::*;
use rt_core::bvh::{Geometry, Instance, World};
use rt_core::glam::{DAffine3, DMat3, DQuat, DVec3};
use rt_core::robustness::SelfShadowTest;
use rt_core::scene::Scene;
use std::sync::Arc;

fn shadows(world: World, camera_radii: f32, rays: usize) -> (u64, u64) {
    let scene = Scene::new(world);
    let c = SelfShadowTest { scene: &scene, camera_radii, seed: 1 }.count(rays);
    (c.rays, c.blocked)
}

#[test]
fn no_false_self_shadow_at_any_size_place_or_camera_distance() {
    for radius in [1e-9, 1e-4, 1.0, 1e4, 1e9] {
        for offset in [0.0, 1e3] {
            for camera_radii in [3.0, 1000.0] {
                let center = DVec3::new(1.0, 0.7, -1.3) * radius * offset;
                let w = world(&sphere(4, radius, center), &Default::default());
                let (rays, blocked) = shadows(w, camera_radii, 8192);
                assert!(rays > 5000, "only {rays} rays");
                assert_eq!(
                    blocked, 0,
                    "of {rays}: radius {radius:e}, offset {offset}, camera {camera_radii}"
                );
            }
        }
    }
}

#[test]
fn no_false_self_shadow_without_recentering() {
    // Positions in f32 far from zero, where the f32 grid is coarse.
    for offset in [10.0f32, 100.0] {
        let mut mesh = sphere(3, 1.0, DVec3::ZERO);
        for p in &mut mesh.positions {
            *p += offset;
        }
        let (rays, blocked) = shadows(world(&mesh, &Default::default()), 3.0, 8192);
        // The rounded sphere is not quite convex; allow for the coarseness of the grid.
        assert!(rays > 5000 && blocked == 0, "{blocked} of {rays} at offset {offset}");
    }
}

#[test]
fn no_false_self_shadow_on_transformed_instances() {
    let turn = DMat3::from_quat(DQuat::from_euler(rt_core::glam::EulerRot::XYZ, 0.5, 1.0, -0.3));
    for scale in [
        DVec3::ONE,
        DVec3::new(-1.0, 1.0, 1.0),
        DVec3::new(1.0, 0.01, 3.0),
        DVec3::splat(1e-6),
        DVec3::splat(1e7),
    ] {
        for translation in [DVec3::ZERO, DVec3::new(40.0, -70.0, 20.0) * scale.length()] {
            let place = DAffine3 { matrix3: turn * DMat3::from_diagonal(scale), translation };
            let geometry = Geometry::Mesh(Arc::new(sphere(4, 1.0, DVec3::ZERO)));
            let w = World::build(
                vec![geometry],
                vec![Instance { geometry: 0, world_from_object: place }],
                &Default::default(),
            )
            .expect("invertible");
            let (rays, blocked) = shadows(w, 3.0, 8192);
            assert!(rays > 1000, "only {rays} rays");
            assert_eq!(blocked, 0, "of {rays}: {place:?}");
        }
    }
}
