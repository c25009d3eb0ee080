//! Lights at the eye and along the view: shadow rays are omitted only where the eye cannot see a
//! shadow.
#![cfg(feature = "render")]

mod scenes_common;
use rt_core::camera::{Camera, ThinLens};
use rt_core::effects::Effects;
use rt_core::glam::{DVec3, Vec3};
use rt_core::light::{Light, LightFrame, LightKind};
use rt_core::material::Material;
use rt_core::render::{RenderOptions, RenderOutput};
use rt_core::scene::Scene;
use scenes_common::*;

const EYE: DVec3 = DVec3::new(0.0, 0.0, 4.0);

/// Lights along the view, with shadows.
fn along_view() -> Light {
    Light { shadows: true, ..Light::headlight() }
}

fn at_eye() -> Light {
    Light::point(DVec3::ZERO).in_camera_frame()
}

/// A square of half edge 1/4 at height 1 above a floor, next to the middle of the image.
fn square_above_floor(light: Light) -> Scene {
    let square = quad(Vec3::new(1.0, 0.0, 1.0), Vec3::X * 0.25, Vec3::Y * 0.25);
    scene(
        vec![(floor(0.0, 10.0), Material::matte([1.0; 3])), (square, Material::matte([1.0; 3]))],
        vec![light],
    )
}

fn perspective() -> Camera {
    Camera::perspective(EYE, DVec3::ZERO, DVec3::Y, 1.0, 1.0, [0.01, 100.0]).unwrap()
}

fn parallel() -> Camera {
    Camera::orthographic(EYE, DVec3::ZERO, DVec3::Y, 4.0, 1.0, [0.0, 8.0]).unwrap()
}

#[test]
fn a_directional_headlight_casts_the_shadows_that_a_perspective_eye_sees() {
    let n = 64;
    let s = square_above_floor(along_view());
    assert!(Effects::required_by(&s).contains(Effects::SHADOWS));
    let o = draw(&s, &perspective(), RenderOptions::new(n, n));
    let mut dark = 0;
    for y in 0..n {
        for x in 0..n {
            // Positions where the pixel's ray intersects the square's height and the floor, in
            // units of the tangent.
            let at = |k: u32| ((k as f64 + 0.5) / n as f64 * 2.0 - 1.0) * 0.5f64.tan();
            let (tx, ty) = (at(x), at(y));
            let inside = |x: f64, y: f64| (x - 1.0).abs() < 0.25 && y.abs() < 0.25;
            let shadowed = !inside(3.0 * tx, 3.0 * ty) && inside(4.0 * tx, 4.0 * ty);
            assert_eq!(o.frame.color_at(x, y)[0] == 0.0, shadowed, "pixel {x} {y}");
            dark += u32::from(shadowed);
        }
    }
    assert!(dark > 20, "the test looks at a shadow: {dark} pixels");
    assert!(o.report.rays.shadow_blocked > 0);
}

#[test]
fn light_along_the_camera_rays_sends_no_shadow_rays_from_what_they_meet_first() {
    for (camera, light) in [(perspective(), at_eye()), (parallel(), along_view())] {
        let o = draw(&square_above_floor(light), &camera, RenderOptions::new(32, 32));
        let r = o.report.rays;
        assert_eq!(r.total(), r.primary);
        assert!(
            o.report.effects.is_empty() && o.report.warnings.is_empty(),
            "{:?}",
            o.report.warnings
        );
        assert!(o.frame.color.iter().all(|p| p[0] > 0.0), "no shadow can be seen");
        // When requested by name, a warning says that they have no effect.
        let asked = RenderOptions { effects: Some(Effects::SHADOWS), ..RenderOptions::new(32, 32) };
        let warnings = draw(&square_above_floor(light), &camera, asked).report.warnings;
        assert!(warnings.iter().any(|w| w.starts_with("shadows changes no pixel")), "{warnings:?}");
    }
    // For the other two, shadows are visible.
    for (camera, light) in [(perspective(), along_view()), (parallel(), at_eye())] {
        let o = draw(&square_above_floor(light), &camera, RenderOptions::new(32, 32));
        assert!(o.report.rays.shadow_blocked > 0);
    }
}

/// The same light in world space, where no shadow ray is omitted.
fn in_world(light: Light) -> Light {
    let kind = match light.kind {
        // The camera looks along -z with y up: its axes are the world's.
        LightKind::Point { position, radius } => {
            LightKind::Point { position: EYE + position, radius }
        }
        other => other,
    };
    Light { kind, frame: LightFrame::World, ..light }
}

fn compare(
    what: &str,
    make: impl Fn(Light) -> Scene,
    camera: &Camera,
    options: &RenderOptions,
    shows: bool,
) {
    let mut blocked = 0;
    for light in [at_eye(), along_view()] {
        let draw = |light| -> RenderOutput { draw(&make(light), camera, options.clone()) };
        let (eye, world) = (draw(light), draw(in_world(light)));
        assert!(eye.report.rays.shadow <= world.report.rays.shadow, "{what}");
        let d = difference(&eye, &world);
        assert!(d < 1e-6, "{what}, {:?}: the pictures differ by {d}", light.kind);
        blocked += eye.report.rays.shadow_blocked;
    }
    assert_eq!(blocked > 0, shows, "{what}: {blocked} shadow rays blocked");
}

#[test]
fn lights_at_the_eye_give_the_image_of_the_same_lights_in_the_world() {
    let plain = RenderOptions::new(48, 48);
    for camera in [perspective(), parallel()] {
        compare("local", square_above_floor, &camera, &plain, true);
    }
    // A mirror shows what the light at the eye does not reach. No ray hits the mirror's edges:
    // there the camera's ray might miss what the ray to the light hits.
    let with_mirror = |light| {
        let mirror = quad(Vec3::new(1.2, 0.0, 2.0), Vec3::Y * 1.9, Vec3::Z * 2.0);
        let square = quad(Vec3::new(0.5, 0.0, 1.0), Vec3::X * 0.25, Vec3::Y * 0.5);
        let parts = vec![
            (floor(0.0, 10.0), Material::matte([1.0; 3])),
            (square, Material::matte([1.0; 3])),
            (mirror, Material::metal([1.0; 3], 0.0)),
        ];
        scene(parts, vec![light])
    };
    compare("mirror", with_mirror, &perspective(), &plain, true);
    // Light through a translucent surface is dimmed by the same factor as the eye's view.
    let with_veil = |light| {
        scene(
            vec![
                (floor(0.0, 10.0), Material::matte([1.0; 3])),
                (floor(1.0, 0.5), Material::matte([1.0; 3]).with_opacity(0.25)),
            ],
            vec![light],
        )
    };
    for camera in [perspective(), parallel()] {
        compare("veil", with_veil, &camera, &plain, true);
        let paths = RenderOptions { path_tracing: true, samples: 4, ..plain.clone() };
        compare("veil, paths", with_veil, &camera, &paths, true);
        compare("paths", square_above_floor, &camera, &paths, true);
    }
    // Rays through a lens do not start at the light.
    let lens = ThinLens { aperture_radius: 0.3, focus_distance: 4.0 };
    let camera = perspective().with_lens(lens).unwrap();
    let options = RenderOptions { samples: 8, ..plain };
    compare("lens", square_above_floor, &camera, &options, true);
}
