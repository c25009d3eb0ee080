//! Light that is seen from a viewer's place, which parallel projections may have too.
#![cfg(feature = "render")]

mod scenes_common;
use rt_core::camera::Camera;
use rt_core::effects::Effects;
use rt_core::glam::{DVec3, Vec3};
use rt_core::light::Light;
use rt_core::material::{Material, PbrForm, PhongForm, SurfaceModel};
use rt_core::render::{RenderOptions, render};
use rt_core::scene::{AmbientOcclusion, Scene};
use scenes_common::*;

const PIXELS: u32 = 48;
const VIEWER: DVec3 = DVec3::new(0.4, -0.3, 3.0);
/// Towards a light from the side.
const TO_LIGHT: DVec3 = DVec3::new(0.36, 0.48, 0.8);

fn shiny(highlight: PhongForm, mirror: f32) -> Material {
    Material {
        model: SurfaceModel::Phong {
            ambient: 0.0,
            diffuse: 0.25,
            specular: [0.5; 3],
            tinted: false,
            shininess: 6.0,
            highlight,
            mirror,
        },
        ..Material::matte([1.0; 3])
    }
}

/// A square of 4 x 4 that fills the image.
fn lit_floor(material: Material, shadows: bool) -> Scene {
    let light = Light { shadows, ..Light::directional(TO_LIGHT) };
    let mut s = scene(vec![(floor(0.0, 4.0), material)], vec![light]);
    s.ambient_occlusion = None;
    s
}

/// The floor's point under a pixel's centre.
fn at(x: u32, y: u32) -> DVec3 {
    let across = |k: u32| (f64::from(k) + 0.5) / f64::from(PIXELS) * 4.0 - 2.0;
    DVec3::new(across(x), -across(y), 0.0)
}

/// Greatest distance of a picture's red from `expected` of the direction to the viewer, and the
/// spread of the latter.
fn off(scene: &Scene, expected: impl Fn(DVec3) -> f64) -> (f64, f64) {
    let camera = top_camera(5.0, 4.0).with_viewer(Some(VIEWER));
    let o = draw(scene, &camera, RenderOptions::new(PIXELS, PIXELS));
    let (mut worst, mut least, mut most) = (0.0f64, f64::INFINITY, 0.0f64);
    for (x, y) in (0..PIXELS * PIXELS).map(|k| (k % PIXELS, k / PIXELS)) {
        let value = expected((VIEWER - at(x, y)).normalize());
        worst = worst.max((f64::from(o.frame.color_at(x, y)[0]) - value).abs());
        (least, most) = (least.min(value), most.max(value));
    }
    (worst, most - least)
}

#[test]
fn highlights_of_parallel_projections_are_where_the_viewer_sees_them() {
    for (form, cosine) in [
        (
            PhongForm::Mirrored,
            (|v| DVec3::new(-TO_LIGHT.x, -TO_LIGHT.y, TO_LIGHT.z).dot(v)) as fn(DVec3) -> f64,
        ),
        (PhongForm::HalfVector, |v| (v + TO_LIGHT).normalize().z),
    ] {
        let expected = |v| 0.25 * TO_LIGHT.z + 0.5 * cosine(v).max(0.0).powi(6);
        for shadows in [false, true] {
            let (worst, spread) = off(&lit_floor(shiny(form, 0.0), shadows), expected);
            assert!(worst < 2e-6 && spread > 0.1, "{form:?}, shadows {shadows}: {worst}, {spread}");
        }
        // Occlusion and layers go another way through the code.
        let mut pale = lit_floor(Material { opacity: 0.5, ..shiny(form, 0.0) }, false);
        let (worst, spread) = off(&pale, |v| 0.5 * expected(v));
        assert!(worst < 2e-6 && spread > 0.05, "{form:?}, translucent: {worst}, {spread}");
        pale.materials[0].opacity = 1.0;
        pale.ambient_occlusion = Some(AmbientOcclusion { distance: 2.0, rays: 4 });
        pale.lights.push(Light::ambient([1e-30; 3]));
        let (worst, _) = off(&pale, expected);
        assert!(worst < 2e-6, "{form:?}, with occlusion: {worst}");
    }
}

#[test]
fn light_that_the_viewer_carries_comes_from_its_place() {
    let form = PbrForm::Vtk { min_divisor: 1e-3, headlight: true };
    let pbr = |sample: SurfaceModel| Material { model: sample, ..Material::matte([1.0; 3]) };
    let model = SurfaceModel::Pbr { metallic: 0.0, roughness: 0.5, specular: 0.0, form };
    // Without a coat, a dielectric is matte: the cosine is that of the viewer.
    let mut s = lit_floor(pbr(model), false);
    s.lights = vec![Light::headlight()];
    let (worst, spread) = off(&s, |v| v.z);
    assert!(worst < 2e-6 && spread > 0.1, "{worst}, {spread}");
}

#[test]
fn mirrors_keep_to_the_rays() {
    // A mirror that looks at a wall: the reflected ray goes straight up, wherever the viewer is.
    let mirror = shiny(PhongForm::Mirrored, 1.0);
    let unlit = Material { model: SurfaceModel::Unlit, ..Material::matte([0.7; 3]) };
    let ceiling = quad(Vec3::new(0.0, 0.0, 9.0), Vec3::X * 1.0, Vec3::Y * 4.0);
    let s = scene(vec![(floor(0.0, 4.0), mirror), (ceiling, unlit)], vec![]);
    let camera = top_camera(5.0, 4.0);
    let picture = |c: &Camera| draw(&s, c, RenderOptions::new(PIXELS, PIXELS));
    let (by_rays, by_viewer) = (picture(&camera), picture(&camera.with_viewer(Some(VIEWER))));
    assert!(by_rays.report.effects.contains(Effects::REFLECTION), "{:?}", by_rays.report.effects);
    assert_eq!(difference(&by_rays, &by_viewer), 0.0);
    assert!(mean_red(&by_rays) > 0.1);
}

#[test]
fn a_viewer_at_the_eye_changes_nothing_and_one_nowhere_is_refused() {
    let s = lit_floor(shiny(PhongForm::HalfVector, 0.0), true);
    let eye = DVec3::new(1.0, 2.0, 3.0);
    let c = camera(eye, 0.8);
    let options = RenderOptions::new(PIXELS, PIXELS);
    let [by_rays, by_viewer] = [c, c.with_viewer(Some(eye))].map(|c| draw(&s, &c, options.clone()));
    assert!(difference(&by_rays, &by_viewer) < 1e-5);
    let fault = render(&s, &c.with_viewer(Some(DVec3::NAN)), &options).unwrap_err();
    assert!(fault.to_string().contains("viewer"), "{fault}");
}
