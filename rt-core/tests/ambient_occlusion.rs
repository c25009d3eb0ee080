//! Ambient occlusion: closed forms, opacity, and warnings when there is no light to occlude.
#![cfg(feature = "render")]

mod scenes_common;
use rt_core::glam::{DVec3, Vec3};
use rt_core::light::Light;
use rt_core::material::Material;
use rt_core::render::RenderOptions;
use rt_core::scene::AmbientOcclusion;
use scenes_common::*;

fn options(n: u32) -> RenderOptions {
    RenderOptions::new(n, n)
}

fn ambient_scene(
    parts: Vec<(rt_core::mesh::TriMesh, Material)>,
    distance: f64,
    rays: u32,
) -> rt_core::scene::Scene {
    let mut s = scene(parts, vec![Light::ambient([1.0; 3])]);
    s.ambient_occlusion = Some(AmbientOcclusion { distance, rays });
    s
}

#[test]
fn ambient_occlusion_of_a_plane_is_none() {
    let s = ambient_scene(vec![(floor(0.0, 5.0), Material::matte([0.5; 3]))], f64::INFINITY, 16);
    let o = draw(&s, &top_camera(5.0, 4.0), options(32));
    assert_eq!(o.report.rays.ambient_occlusion, 16 * 32 * 32);
    assert_eq!(o.report.rays.ambient_occlusion_blocked, 0);
    assert!(o.frame.color.iter().all(|p| (p[0] - 0.5).abs() < 1e-6));
}

#[test]
fn ambient_occlusion_next_to_a_wall_is_its_form_factor() {
    // The wall x = 0 has height 1 and (nearly) infinite width. Seen from a floor point at distance
    // a, it covers a fraction of (1 - a/sqrt(a²+1))/2.
    let wall = quad(Vec3::new(0.0, 0.0, 0.5), Vec3::Y * 2000.0, Vec3::Z * 0.5);
    let parts =
        vec![(floor(0.0, 3000.0), Material::matte([1.0; 3])), (wall, Material::matte([1.0; 3]))];
    let s = ambient_scene(parts.clone(), f64::INFINITY, 1024);
    let o = draw(&s, &top_camera(5.0, 4.0), options(16));
    for x in [8, 9, 11, 15] {
        let a = (x as f64 + 0.5) / 4.0 - 2.0;
        let expected = 1.0 - 0.5 * (1.0 - a / (a * a + 1.0).sqrt());
        let found = o.frame.color_at(x, 5)[0] as f64;
        assert!((found - expected).abs() < 5e-3, "a = {a}: {found} instead of {expected}");
    }
    // With a range shorter than the distance to the wall, occlusion vanishes.
    let near = draw(&ambient_scene(parts, 0.1, 64), &top_camera(5.0, 4.0), options(16));
    assert!((near.frame.color_at(15, 5)[0] - 1.0).abs() < 1e-6);
}

#[test]
fn ambient_occlusion_sees_opacity() {
    // A ceiling of opacity 0.25 over everything blocks a quarter of the light. An invisible one
    // blocks nothing.
    for (opacity, expected) in [(0.25f32, 0.75f32), (0.0, 1.0)] {
        let ceiling = (floor(0.01, 1000.0), Material::matte([1.0; 3]).with_opacity(opacity));
        let s = ambient_scene(
            vec![(floor(0.0, 1000.0), Material::matte([1.0; 3])), ceiling],
            f64::INFINITY,
            64,
        );
        // Viewed from between floor and ceiling.
        let c = rt_core::camera::Camera::orthographic(
            DVec3::new(0.0, 0.0, 0.005),
            DVec3::ZERO,
            DVec3::Y,
            0.001,
            1.0,
            [0.0, 1.0],
        )
        .unwrap();
        let o = draw(&s, &c, options(8));
        let found = o.frame.color_at(4, 4)[0];
        assert!((found - expected).abs() < 0.01, "opacity {opacity}: {found}");
    }
}

#[test]
fn ambient_occlusion_without_ambient_light_is_reported() {
    let mut s = scene(vec![(floor(0.0, 1.0), Material::matte([1.0; 3]))], vec![Light::headlight()]);
    s.ambient_occlusion = Some(AmbientOcclusion { distance: 1.0, rays: 4 });
    let o = draw(&s, &top_camera(2.0, 1.0), options(8));
    assert_eq!(o.report.rays.ambient_occlusion, 0);
    assert!(
        o.report.warnings.iter().any(|w| w.contains("ambient occlusion changes no pixel")),
        "{:?}",
        o.report.warnings
    );
}
