//! Faint light is not omitted silently: unbiased paths, light through many layers, reflectors whose
//! rays are omitted.
#![cfg(feature = "render")]

mod scenes_common;
use rt_core::camera::Camera;
use rt_core::effects::Effects;
use rt_core::environment::Environment;
use rt_core::glam::{DVec3, Vec3};
use rt_core::light::Light;
use rt_core::material::{Material, PbrForm, SurfaceModel};
use rt_core::render::RenderOptions;
use scenes_common::*;

/// Radiance of the emitter.
const EMITTED: f64 = 1e4;

/// Mean of the pixels inside a closed matte body of this albedo that emits [`EMITTED`] everywhere,
/// divided by the value of the geometric series, E / (1 - albedo). Only path tracing is requested.
fn furnace(albedo: f32, samples: u32, seed: u64) -> (f64, u64) {
    let m = Material::matte([albedo; 3]).with_emission([EMITTED as f32; 3]);
    let s = scene(vec![(sphere(Vec3::ZERO, 1.0, 12), Material { flat: true, ..m })], vec![]);
    let c =
        Camera::perspective(DVec3::new(0.3, 0.1, 0.0), DVec3::X, DVec3::Z, 1.0, 1.0, [1e-3, 10.0]);
    let options = RenderOptions { path_tracing: true, samples, seed, ..RenderOptions::new(8, 8) };
    let o = draw(&s, &c.unwrap(), options);
    assert!(o.report.warnings.is_empty(), "{:?}", o.report.warnings);
    (mean_red(&o) * (1.0 - albedo as f64) / EMITTED, o.report.rays.path)
}

#[test]
fn the_path_tracer_is_unbiased_in_a_furnace_of_albedo_0_999() {
    let (mean, bounces) = furnace(0.999, 64, 0);
    // The sum over a geometrically distributed number of bounces has a standard deviation of its
    // mean: 5 standard errors of 4096 paths.
    assert!(
        (mean - 1.0).abs() < 5.0 / 4096f64.sqrt(),
        "{mean} of the closed form, {bounces} bounces"
    );
}

#[test]
fn the_path_tracer_keeps_faint_paths_to_bright_emitters() {
    // Without roulette before the fourth bounce, a path has the first terms of the series exactly.
    // The remaining terms are 1e-8 to 1e-4 of it.
    for (albedo, tolerance) in [(0.01f32, 1e-6), (0.05, 2e-5), (0.3, 0.01)] {
        let (mean, _) = furnace(albedo, 64, 0);
        assert!((mean - 1.0).abs() < tolerance, "albedo {albedo}: {mean} of the closed form");
    }
}

#[test]
fn light_through_many_layers_is_not_dropped() {
    // Nine layers of opacity 0.6 transmit 2.6e-4 of a light of 1e4.
    for path_tracing in [false, true] {
        let mut parts = vec![(floor(0.0, 10.0), Material::matte([1.0; 3]))];
        for k in 0..9 {
            parts.push((
                floor(2.0 + 0.1 * k as f32, 10.0),
                Material::matte([0.0; 3]).with_opacity(0.6),
            ));
        }
        let light = Light::point(DVec3::new(0.0, 0.0, 5.0)).with_color([1e4; 3]);
        let s = scene(parts, vec![light]);
        let options = RenderOptions { path_tracing, ..RenderOptions::new(5, 5) };
        let o = draw(&s, &top_camera(1.0, 0.01), options);
        let expected = 1e4 * 0.4f64.powi(9);
        let found = o.frame.color_at(2, 2)[0] as f64;
        assert!(
            (found / expected - 1.0).abs() < 1e-4,
            "paths {path_tracing}: {found}, expected {expected}"
        );
    }
}

#[test]
fn reflectors_whose_rays_are_left_out_are_not_black() {
    let pbr = |roughness| Material {
        model: SurfaceModel::Pbr { metallic: 1.0, roughness, specular: 0.04, form: PbrForm::Gltf },
        ..Material::matte([0.8; 3])
    };
    let mirrors = Effects::REFLECTION;
    let gloss = Effects::GLOSSY_REFLECTION;
    for (name, material, own, other) in [
        ("rough metal", Material::metal([0.8; 3], 0.4), gloss, mirrors),
        ("smooth metal", Material::metal([0.8; 3], 0.0), mirrors, gloss),
        ("nearly smooth metal", Material::metal([0.8; 3], 5e-4), mirrors, gloss),
        ("rough pbr", pbr(0.4), gloss, mirrors),
        ("smooth pbr", pbr(0.0), mirrors, gloss),
        ("nearly smooth pbr", pbr(5e-4), mirrors, gloss),
    ] {
        // A second body needs the other kind of reflection rays.
        let beside = Material::metal([0.8; 3], if own == gloss { 0.0 } else { 0.4 });
        let mut s = scene(
            vec![
                (sphere(Vec3::ZERO, 1.0, 12), material),
                (quad(Vec3::X * 9.0, Vec3::Y, Vec3::Z), beside),
            ],
            vec![],
        );
        s.environment = Some(Environment::Constant([1.0; 3]));
        let c = camera(DVec3::new(0.0, -4.0, 1.0), 0.2);
        let at = |effects| {
            let o = draw(&s, &c, RenderOptions { effects, ..RenderOptions::new(9, 9) });
            o.frame.color_at(4, 4)[0]
        };
        assert!(Effects::required_by(&s).contains(own | other), "{name}");
        for (which, effects) in [
            ("all", None),
            ("its own", Some(own)),
            ("the other", Some(other)),
            ("none", Some(Effects::NONE)),
        ] {
            let found = at(effects);
            assert!(
                (0.7..=1.0).contains(&found),
                "{name} with {which} of the reflections: {found}"
            );
        }
    }
}
