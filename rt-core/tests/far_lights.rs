//! Rays towards lights are exact at both ends: at the surface, however far the light is, and at the
//! light, even when it lies on a surface.
#![cfg(feature = "render")]

mod scenes_common;
use rt_core::bvh::BuildOptions;
use rt_core::camera::Camera;
use rt_core::effects::Effects;
use rt_core::glam::{DMat3, DVec3, Vec3};
use rt_core::light::{Light, LightKind};
use rt_core::material::Material;
use rt_core::mesh::TriMesh;
use rt_core::render::RenderOptions;
use rt_core::scene::{Scene, SceneBuilder};
use rt_core::simd::SimdLevel;
use scenes_common::*;
use std::f64::consts::FRAC_PI_2;

/// Pixels per side. A pixel is 1/16 wide: the nearest centre is 1/32 from the blocker's edge, and
/// the blocker's shadow is off by at most the gap times the slope of the light.
const PIXELS: u32 = 64;
/// Distance from the floor to the surface that nearly touches it, in radii of the blocker.
const GAP: f64 = 1e-3;

/// Every kind of light with a position, at `distance` in direction `dir` (unit) from the scene,
/// without falloff.
fn lights(dir: DVec3, distance: f64) -> Vec<(&'static str, Light)> {
    let (at, size) = (dir * distance, 0.01 * distance);
    let (x, y) = dir.any_orthonormal_pair();
    let ring = LightKind::Ring {
        position: at,
        direction: -dir,
        inner_radius: 0.5 * size,
        radius: size,
        inner_rad: 1.5,
        outer_rad: 1.5,
    };
    let cone = LightKind::Cone { position: at, direction: -dir, inner_rad: 1.5, outer_rad: 1.5 };
    let quad = Light::quad(at - (x + y) * size, [y * (2.0 * size), x * (2.0 * size)]);
    let as_point = |kind| Light { kind, ..Light::point(at) };
    vec![
        ("point", Light::point(at)),
        ("sphere", Light::point(at).with_size(size).expect("a point may have a size")),
        ("spot", Light::spot(at, -dir, 1.5)),
        ("cone", as_point(cone)),
        ("disk", Light::disk(at, -dir, size)),
        ("ring", as_point(ring)),
        ("quad", Light { attenuation: [1.0, 0.0, 0.0], ..quad }),
    ]
}

/// A square of half edge `scale` just above a floor, viewed from between the two. `veil` adds a
/// translucent surface out of view, so that light is traced from layer to layer.
fn near_contact(scale: f64, light: Light, level: Option<SimdLevel>, veil: bool) -> (Scene, Camera) {
    let s = scale as f32;
    let mut b = SceneBuilder::new();
    b.build_options = BuildOptions { simd: level, ..BuildOptions::default() };
    b.mesh(floor(0.0, 10.0 * s), Material::matte([1.0; 3]));
    b.mesh(floor(GAP as f32 * s, s), Material::matte([1.0; 3]));
    if veil {
        let aside = quad(Vec3::new(9.0, 9.0, 1.0) * s, Vec3::X * 0.1 * s, Vec3::Y * 0.1 * s);
        b.mesh(aside, Material::matte([1.0; 3]).with_opacity(0.5));
    }
    b.light(light);
    let eye = DVec3::new(0.0, 0.0, 0.5 * GAP * scale);
    let depth = [0.0, 2.0 * scale];
    let camera = Camera::orthographic(eye, DVec3::ZERO, DVec3::Y, 4.0 * scale, 1.0, depth);
    (b.build().unwrap(), camera.unwrap())
}

fn expect_contact_shadow(what: &str, scene: &Scene, camera: &Camera, dir: DVec3) {
    let o = draw(scene, camera, RenderOptions::new(PIXELS, PIXELS));
    let mut wrong = 0;
    for y in 0..PIXELS {
        for x in 0..PIXELS {
            let at = |k: u32| (k as f64 + 0.5) / 16.0 - 2.0;
            // Rows go downwards. At the blocker's height the ray is at the pixel, moved by less
            // than 1/32.
            let shadowed = at(x).abs() < 1.0 && at(y).abs() < 1.0;
            let light = o.frame.color_at(x, y)[0];
            let right = if shadowed { light == 0.0 } else { light > 0.5 * dir.z as f32 };
            wrong += u32::from(!right);
        }
    }
    let rays = o.report.rays;
    assert_eq!(
        wrong,
        0,
        "{what}: pixels wrong of {}; {} rays, {} blocked",
        PIXELS * PIXELS,
        rays.shadow,
        { rays.shadow_blocked }
    );
}

#[test]
fn a_far_point_light_keeps_contact_shadows() {
    let distances = [1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e8, 1e12, 1e18, 1e24, 1e30];
    for dir in [DVec3::Z, DVec3::new(0.3, 0.2, 1.0).normalize()] {
        for scale in [1e-6, 1.0, 1e6] {
            for distance in distances {
                let (scene, camera) =
                    near_contact(scale, Light::point(dir * (distance * scale)), None, false);
                expect_contact_shadow(
                    &format!("radius {scale:e}, {distance:e} radii away"),
                    &scene,
                    &camera,
                    dir,
                );
            }
        }
    }
}

#[test]
fn far_lights_of_every_shape_keep_contact_shadows_at_every_level() {
    let dir = DVec3::new(0.3, 0.2, 1.0).normalize();
    for level in SimdLevel::available() {
        for veil in [false, true] {
            for distance in [3.0, 1e6, 1e30] {
                for (name, light) in lights(dir, distance) {
                    let (scene, camera) = near_contact(1.0, light, Some(level), veil);
                    let what = format!("{name}, {level:?}, veil {veil}, {distance:e} away");
                    expect_contact_shadow(&what, &scene, &camera, dir);
                }
            }
        }
    }
}

#[test]
fn a_small_model_on_a_huge_ground_keeps_its_shadow() {
    // The light is within the scene's radius, and 100 000 radii from the model.
    let dir = DVec3::new(0.3, 0.2, 1.0).normalize();
    let mut b = SceneBuilder::new();
    b.mesh(floor(-1.0, 1e6), Material::matte([1.0; 3]));
    b.mesh(floor(0.0, 10.0), Material::matte([1.0; 3]));
    b.mesh(floor(GAP as f32, 1.0), Material::matte([1.0; 3]));
    b.light(Light::point(dir * 1e5));
    let (_, camera) = near_contact(1.0, Light::headlight(), None, false);
    expect_contact_shadow("huge ground", &b.build().unwrap(), &camera, dir);
}

/// `mesh` rotated and scaled: planes in general position, whose rounded corners are not in the
/// plane.
fn transformed_mesh(mut mesh: TriMesh, turn: DMat3, scale: f64) -> TriMesh {
    for p in &mut mesh.positions {
        *p = (turn * p.as_dvec3() * scale).as_vec3();
    }
    mesh
}

#[test]
fn a_light_on_a_surface_is_not_hidden_by_it() {
    // A room with a floor and a ceiling. The lights are in the plane of the ceiling, of size 0 and
    // with an area. The sphere hangs below the ceiling; otherwise half of it would be above.
    let turns = [
        DMat3::IDENTITY,
        DMat3::from_axis_angle(DVec3::new(0.6, -0.8, 0.0), 0.7) * DMat3::from_rotation_z(0.3),
    ];
    for turn in turns {
        for scale in [1e-6, 1.0, 1e6] {
            for (name, light) in lights(DVec3::Z, 3.0) {
                // The ceiling is exactly at the light, and a thousandth above it.
                for below in [0.0, 1e-3] {
                    let mut b = SceneBuilder::new();
                    b.mesh(
                        transformed_mesh(floor(0.0, 6.0), turn, scale),
                        Material::matte([1.0; 3]),
                    );
                    let hangs = if name == "sphere" { light.size() as f32 } else { 0.0 };
                    let ceiling = floor(3.0 + hangs + below as f32, 6.0);
                    b.mesh(transformed_mesh(ceiling, turn, scale), Material::matte([1.0; 3]));
                    b.light(transformed_light(light, turn, scale));
                    let scene = b.build().unwrap();
                    let eye = turn * DVec3::new(0.0, 0.0, 1.5) * scale;
                    let camera = Camera::orthographic(
                        eye,
                        DVec3::ZERO,
                        turn * DVec3::Y,
                        8.0 * scale,
                        1.0,
                        [0.0, 3.0 * scale],
                    );
                    let o = draw(&scene, &camera.unwrap(), RenderOptions::new(32, 32));
                    let rays = o.report.rays;
                    assert!(rays.shadow > 0);
                    let what = format!("{name} {below} below the ceiling, scale {scale:e}");
                    assert_eq!(rays.shadow_blocked, 0, "{what}: of {} rays", rays.shadow);
                }
            }
        }
    }
}

#[test]
fn flat_lights_are_not_hidden_by_their_own_plane_however_flat_they_fall() {
    // A wall that ends a thousandth below the ceiling. Light from a panel in the ceiling reaches
    // its top at an elevation of 1/3000.
    for scale in [1e-6, 1.0, 1e6] {
        for (name, light) in lights(DVec3::Z, 3.0) {
            let light = match light.kind {
                LightKind::Disk { .. } | LightKind::Quad { .. } => light,
                // The widest cone of a ring, which includes light at grazing angles.
                LightKind::Ring { position, direction, inner_radius, radius, .. } => {
                    let (inner_rad, outer_rad) = (FRAC_PI_2, FRAC_PI_2);
                    let kind = LightKind::Ring {
                        position,
                        direction,
                        inner_radius,
                        radius,
                        inner_rad,
                        outer_rad,
                    };
                    Light { kind, ..light }
                }
                _ => continue,
            };
            let turn = DMat3::from_axis_angle(DVec3::new(0.6, -0.8, 0.0), 0.7);
            let mut b = SceneBuilder::new();
            b.mesh(transformed_mesh(floor(3.0, 6.0), turn, scale), Material::matte([1.0; 3]));
            let wall = quad(Vec3::new(3.0, 0.0, 1.999), Vec3::Y, Vec3::Z);
            b.mesh(transformed_mesh(wall, turn, scale), Material::matte([1.0; 3]));
            b.light(transformed_light(light, turn, scale));
            let scene = b.build().unwrap();
            let (eye, target) = (DVec3::new(2.0, 0.0, 2.9), DVec3::new(3.0, 0.0, 2.9));
            let camera = Camera::orthographic(
                turn * eye * scale,
                turn * target * scale,
                turn * DVec3::Z,
                0.19 * scale,
                1.0,
                [0.0, 2.0 * scale],
            );
            let o = draw(&scene, &camera.unwrap(), RenderOptions::new(32, 32));
            assert!(o.report.rays.shadow > 1000, "{name}: {:?}", o.report.rays);
            assert_eq!(o.report.rays.shadow_blocked, 0, "{name}, scale {scale:e}");
        }
    }
}

#[test]
fn what_is_just_before_a_light_hides_it() {
    // A shade a thousandth below the light, with a near and a far light, at both ends of the ray:
    // the floor is dark.
    for distance in [3.0, 1e3, 1e6] {
        let mut b = SceneBuilder::new();
        b.mesh(floor(0.0, 1.0), Material::matte([1.0; 3]));
        let shade = distance * (1.0 - 1e-3);
        b.mesh(floor(shade as f32, 1.0), Material::matte([1.0; 3]));
        b.light(Light::point(DVec3::new(0.0, 0.0, distance)));
        let scene = b.build().unwrap();
        let o = draw(&scene, &top_camera(1.0, 1.0), RenderOptions::new(32, 32));
        assert!(o.frame.color.iter().all(|p| p[0] == 0.0), "a light {distance} away");
    }
}

#[test]
fn lights_beyond_single_precision_are_refused() {
    let scene = |position| {
        let mut b = SceneBuilder::new();
        b.mesh(floor(0.0, 1.0), Material::matte([1.0; 3]));
        b.light(Light::point(position));
        b.build().map(|_| ())
    };
    assert!(scene(DVec3::new(0.0, 0.0, 1e37)).is_ok());
    let error = scene(DVec3::new(0.0, 0.0, 1e39)).unwrap_err().to_string();
    assert!(error.contains("position") && error.contains("directional"), "{error}");
}

/// The light of the rotated and scaled scene.
fn transformed_light(light: Light, turn: DMat3, scale: f64) -> Light {
    let place = |p: DVec3| turn * p * scale;
    let kind = match light.kind {
        LightKind::Point { position, radius } => {
            LightKind::Point { position: place(position), radius: radius * scale }
        }
        LightKind::Spot { position, direction, cutoff_rad, exponent, radius } => LightKind::Spot {
            position: place(position),
            direction: turn * direction,
            cutoff_rad,
            exponent,
            radius: radius * scale,
        },
        LightKind::Cone { position, direction, inner_rad, outer_rad } => LightKind::Cone {
            position: place(position),
            direction: turn * direction,
            inner_rad,
            outer_rad,
        },
        LightKind::Disk { position, direction, radius } => LightKind::Disk {
            position: place(position),
            direction: turn * direction,
            radius: radius * scale,
        },
        LightKind::Ring { position, direction, inner_radius, radius, inner_rad, outer_rad } => {
            LightKind::Ring {
                position: place(position),
                direction: turn * direction,
                inner_radius: inner_radius * scale,
                radius: radius * scale,
                inner_rad,
                outer_rad,
            }
        }
        LightKind::Quad { corner, edges, both_sides } => {
            LightKind::Quad { corner: place(corner), edges: edges.map(place), both_sides }
        }
        other => other,
    };
    Light { kind, ..light }
}

#[test]
fn shadow_rays_find_no_false_blockers_at_any_scale_or_offset() {
    // A convex body lit from the eye's side: every lit point must be lit, at sizes 1e-15 to 1e15
    // and far from the origin.
    for (scale, offset) in
        [(1.0, 0.0), (1e-15, 0.0), (1e15, 0.0), (1e-3, 1.0), (1.0, 1000.0), (1.0, -12345.678)]
    {
        let center = Vec3::splat(offset as f32);
        let mesh = sphere(center, scale as f32, 24);
        let c = DVec3::splat(offset);
        for light in [
            Light::point(c + DVec3::new(5.0, 3.0, 2.0) * scale),
            Light::directional(DVec3::new(5.0, 3.0, 2.0)),
        ] {
            let s = scene(
                vec![(mesh.clone(), Material { flat: true, ..Material::matte([1.0; 3]) })],
                vec![light],
            );
            let eye = c + DVec3::new(4.0, 2.0, 1.0) * scale;
            let camera = rt_core::camera::Camera::perspective(
                eye,
                c,
                DVec3::Z,
                0.6,
                1.0,
                [0.01 * scale, 100.0 * scale],
            )
            .unwrap();
            let with = draw(&s, &camera, RenderOptions::new(96, 96));
            let without = draw(
                &s,
                &camera,
                RenderOptions { effects: Some(Effects::NONE), ..RenderOptions::new(96, 96) },
            );
            assert!(
                with.report.rays.shadow > 2000,
                "scale {scale} offset {offset}: {:?}",
                with.report.rays
            );
            assert_eq!(with.report.rays.shadow_blocked, 0, "scale {scale} offset {offset}");
            // The loops without and with rays use the normal in f32 and in f64.
            assert!(difference(&with, &without) < 1e-6);
        }
    }
}
