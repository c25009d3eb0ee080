//! Path tracing, depth of field and the convergence of samples, against closed forms.
#![cfg(feature = "render")]

mod scenes_common;
use rt_core::camera::ThinLens;
use rt_core::effects::Effects;
use rt_core::environment::{Background, Environment};
use rt_core::glam::{DVec3, Vec3};
use rt_core::light::Light;
use rt_core::material::{Material, SurfaceModel};
use rt_core::render::RenderOptions;
use rt_core::sampler::Sampling;
use scenes_common::*;

fn path(n: u32, samples: u32) -> RenderOptions {
    RenderOptions {
        path_tracing: true,
        samples,
        max_bounces: Some(1000),
        min_contribution: 0.0,
        ..RenderOptions::new(n, n)
    }
}

#[test]
fn white_furnace_returns_what_it_gets() {
    // In a uniform environment of radiance 1, a body that absorbs nothing is invisible. For convex
    // bodies, one bounce suffices. Tolerances: matte surfaces and mirrors are exact per sample up
    // to rounding; glass needs many bounces, where roulette adds noise; single-scattering
    // microfacets lose the light that would scatter twice (below 2 % at roughness 0.3).
    for (name, m, low, high) in [
        ("matte", Material::matte([1.0; 3]), 0.99999, 1.00001),
        ("mirror", Material::metal([1.0; 3], 0.0), 0.99999, 1.00001),
        ("glass", Material::dielectric(1.5), 0.98, 1.02),
        ("rough metal", Material::metal([1.0; 3], 0.3), 0.98, 1.00001),
        ("pbr", Material::pbr([1.0; 3], 0.0, 0.3), 0.96, 1.01),
    ] {
        let mut s =
            scene(vec![(sphere(Vec3::ZERO, 1.0, 32), Material { flat: true, ..m })], vec![]);
        s.environment = Some(Environment::Constant([1.0; 3]));
        s.background = Background::Environment;
        let o = draw(&s, &camera(DVec3::new(4.0, 0.0, 1.0), 0.4), path(24, 64));
        let mean = mean_red(&o);
        assert!(mean >= low && mean <= high, "{name}: {mean}");
    }
}

#[test]
fn closed_furnace_sums_the_geometric_series() {
    // Inside a closed matte body of albedo a that emits 1 - a everywhere, radiance is (1-a)/(1-a) =
    // 1 from every point.
    for albedo in [0.3f32, 0.8] {
        let m = Material::matte([albedo; 3]).with_emission([1.0 - albedo; 3]);
        let s = scene(vec![(sphere(Vec3::ZERO, 1.0, 12), Material { flat: true, ..m })], vec![]);
        let c = rt_core::camera::Camera::perspective(
            DVec3::new(0.3, 0.1, 0.0),
            DVec3::X,
            DVec3::Z,
            1.0,
            1.0,
            [1e-3, 10.0],
        )
        .unwrap();
        let o = draw(&s, &c, path(24, 128));
        let mean = mean_red(&o);
        // About 5 standard errors of 73 thousand paths at the higher albedo.
        assert!((mean - 1.0).abs() < 0.01, "albedo {albedo}: {mean}");
    }
}

#[test]
fn path_tracer_agrees_with_local_shading_on_direct_light() {
    // A convex matte body under lamps, with nothing to bounce to: both integrators give the same
    // image.
    let s = scene(
        vec![(sphere(Vec3::ZERO, 1.0, 24), Material::matte([0.8, 0.5, 0.3]))],
        vec![
            Light::directional(DVec3::new(1.0, 1.0, 1.0)),
            Light::point(DVec3::new(3.0, -2.0, 1.0)).with_color([0.5; 3]),
        ],
    );
    let c = camera(DVec3::new(4.0, 0.0, 1.0), 0.6);
    let local = draw(&s, &c, RenderOptions::new(32, 32));
    let traced = draw(&s, &c, path(32, 1));
    assert!(difference(&local, &traced) < 1e-6);
    assert!(traced.report.rays.path > 0 && local.report.rays.path == 0);
}

#[test]
fn colour_bleeds_only_with_path_tracing() {
    let wall = quad(Vec3::new(0.0, 0.0, 1.0), Vec3::Y * 2.0, Vec3::Z);
    let s = scene(
        vec![
            (floor(0.0, 2.0), Material::matte([1.0; 3])),
            (wall, Material::matte([1.0, 0.0, 0.0])),
        ],
        vec![Light::directional(DVec3::new(0.5, 0.0, 1.0))],
    );
    let c = rt_core::camera::Camera::orthographic(
        DVec3::new(0.1, 0.0, 4.0),
        DVec3::new(0.1, 0.0, 0.0),
        DVec3::Y,
        0.1,
        1.0,
        [0.0, 8.0],
    )
    .unwrap();
    let local = draw(&s, &c, RenderOptions::new(8, 8)).frame.color_at(4, 4);
    let traced = draw(&s, &c, path(8, 256)).frame.color_at(4, 4);
    assert_eq!(local[0], local[1]);
    assert!(traced[0] > traced[1] + 0.1, "{traced:?}");
}

#[test]
fn opacity_by_chance_has_the_mean_of_opacity_by_layers() {
    let s = scene(
        vec![
            (floor(1.0, 5.0), Material::unlit([1.0; 3]).with_opacity(0.3)),
            (floor(0.0, 5.0), Material::unlit([0.2; 3])),
        ],
        vec![],
    );
    let c = top_camera(5.0, 2.0);
    let o = draw(&s, &c, path(16, 256));
    // 65536 independent choices of variance 0.3 * 0.7 * 0.8².
    assert!(
        (mean_red(&o) - 0.44).abs() < 5.0 * (0.1344f64 / 65536.0).sqrt() + 1e-4,
        "{}",
        mean_red(&o)
    );
}

#[test]
fn ambient_occlusion_equals_the_path_tracer_s_first_bounce() {
    // A corner with black walls: the unblocked part of the hemisphere sees the ambient light, in
    // both integrators.
    let wall = quad(Vec3::new(0.0, 0.0, 1.0), Vec3::Y * 50.0, Vec3::Z);
    let parts = || {
        vec![
            (floor(0.0, 50.0), Material::matte([0.5; 3])),
            (wall.clone(), Material::matte([0.0; 3])),
        ]
    };
    let mut s = scene(parts(), vec![Light::ambient([1.0; 3])]);
    s.ambient_occlusion =
        Some(rt_core::scene::AmbientOcclusion { distance: f64::INFINITY, rays: 256 });
    let c = rt_core::camera::Camera::orthographic(
        DVec3::new(0.5, 0.0, 4.0),
        DVec3::new(0.5, 0.0, 0.0),
        DVec3::Y,
        0.8,
        1.0,
        [0.0, 8.0],
    )
    .unwrap();
    let occlusion = draw(&s, &c, RenderOptions::new(8, 8));
    let traced = draw(&s, &c, path(8, 1024));
    assert!(
        (mean_red(&occlusion) - mean_red(&traced)).abs() < 2e-3,
        "{} {}",
        mean_red(&occlusion),
        mean_red(&traced)
    );
    assert_eq!(traced.report.rays.ambient_occlusion, 0);
}

#[test]
fn russian_roulette_and_bounces_do_not_change_the_mean_of_glass() {
    // Absorbing glass slab, head on: local (Whitted) shading against path tracing.
    let mut bottom = floor(0.0, 50.0);
    bottom.indices.iter_mut().for_each(|t| t.swap(0, 1));
    let glass = Material {
        model: SurfaceModel::Dielectric { ior: 1.5, absorption: [0.3; 3] },
        ..Material::matte([1.0; 3])
    };
    let s = scene(
        vec![
            (floor(1.0, 50.0), glass.clone()),
            (bottom, glass),
            (floor(-1.0, 50.0), Material::unlit([1.0; 3])),
        ],
        vec![],
    );
    let c = top_camera(5.0, 0.01);
    let whitted = draw(
        &s,
        &c,
        RenderOptions { min_contribution: 0.0, max_bounces: Some(12), ..RenderOptions::new(8, 8) },
    );
    let traced = draw(&s, &c, path(8, 2048));
    // Series of reflections between the faces: T² a / (1 - R² a²) with R = 0.04, T = 0.96, a =
    // e^-0.3. The rest leaves to the sky.
    let a = (-0.3f64).exp();
    let expected = 0.96 * 0.96 * a / (1.0 - 0.0016 * a * a);
    assert!((mean_red(&whitted) - expected).abs() < 1e-4, "{} {expected}", mean_red(&whitted));
    assert!((mean_red(&traced) - expected).abs() < 5e-3, "{} {expected}", mean_red(&traced));
}

#[test]
fn thin_lens_is_sharp_at_the_focus_distance_only() {
    // Edge of a half plane at distance d from a lens of radius r focused at f: its image is blurred
    // over r |d - f| / f on each side.
    let (r, f) = (0.2, 4.0);
    let c = rt_core::camera::Camera::perspective(
        DVec3::new(0.0, 0.0, 4.0),
        DVec3::ZERO,
        DVec3::Y,
        0.5,
        1.0,
        [0.1, 100.0],
    )
    .unwrap()
    .with_lens(ThinLens { aperture_radius: r, focus_distance: f })
    .unwrap();
    for (z, blur) in [(0.0f32, 0.0), (2.0, r * 0.5), (-4.0, r)] {
        let s = scene(
            vec![(
                quad(Vec3::new(-50.0, 0.0, z), Vec3::X * 50.0, Vec3::Y * 50.0),
                Material::unlit([1.0; 3]),
            )],
            vec![],
        );
        let o = draw(&s, &c, RenderOptions { samples: 256, ..RenderOptions::new(64, 64) });
        assert!(o.report.effects.contains(Effects::DEPTH_OF_FIELD));
        let d = 4.0 - z as f64;
        let pixel = 2.0 * d * 0.25f64.tan() / 64.0;
        let row: Vec<f32> = (0..64).map(|x| o.frame.color_at(x, 32)[3]).collect();
        let partial = row.iter().filter(|v| **v > 0.0 && **v < 1.0).count() as f64;
        let expected = 2.0 * blur / pixel;
        assert!(
            (partial - expected).abs() <= 2.0,
            "z = {z}: {partial} pixels instead of {expected}: {row:?}"
        );
        // A pinhole camera has no blur.
        let sharp = RenderOptions { effects: Some(Effects::NONE), ..RenderOptions::new(64, 64) };
        let o = draw(&s, &c, sharp);
        assert!(o.frame.color.iter().all(|p| p[3] == 0.0 || p[3] == 1.0));
    }
}

#[test]
fn several_samples_average_over_the_pixel() {
    // An edge at a quarter of a pixel: coverage 0.25, where one sample gives 0.
    let s = scene(
        vec![(
            quad(Vec3::new(-4.75, 0.0, 0.0), Vec3::X * 5.0, Vec3::Y * 50.0),
            Material::unlit([1.0; 3]),
        )],
        vec![],
    );
    let c = top_camera(5.0, 8.0);
    assert_eq!(draw(&s, &c, RenderOptions::new(8, 8)).frame.color_at(4, 4)[3], 0.0);
    let o = draw(&s, &c, RenderOptions { samples: 16, ..RenderOptions::new(8, 8) });
    assert!((o.frame.color_at(4, 4)[3] - 0.25).abs() < 0.001);
}

#[test]
fn low_discrepancy_samples_converge_faster_than_random_ones() {
    // Soft shadow: root mean square error against 4096 random samples per pixel, at 16 and 256
    // rays.
    let blocker = quad(Vec3::new(-10.0, 0.0, 1.0), Vec3::X * 10.0, Vec3::Y * 20.0);
    let s = scene(
        vec![(floor(0.0, 30.0), Material::matte([1.0; 3])), (blocker, Material::matte([1.0; 3]))],
        vec![Light::point(DVec3::new(0.0, 0.0, 2.0)).with_size(0.5).unwrap()],
    );
    let c = rt_core::camera::Camera::orthographic(
        DVec3::new(0.0, 0.0, 0.5),
        DVec3::ZERO,
        DVec3::Y,
        1.0,
        1.0,
        [0.0, 2.0],
    )
    .unwrap();
    let shot = |sampling, light_rays, seed| {
        draw(&s, &c, RenderOptions { sampling, light_rays, seed, ..RenderOptions::new(16, 16) })
    };
    let truth = shot(Sampling::Sobol, 16384, 99);
    let error = |sampling, n| {
        let o = shot(sampling, n, 1);
        let sum: f64 = truth
            .frame
            .color
            .iter()
            .zip(&o.frame.color)
            .map(|(a, b)| ((a[0] - b[0]) as f64).powi(2))
            .sum();
        (sum / 256.0).sqrt()
    };
    let (r16, r256) = (error(Sampling::Random, 16), error(Sampling::Random, 256));
    let (s16, s256) = (error(Sampling::Sobol, 16), error(Sampling::Sobol, 256));
    // Random: 1/sqrt(16) = 0.25 (0.18 to 0.35 for 256 pixels). Sobol: near n^-3/4 behind an edge,
    // 0.125.
    assert!(r256 / r16 > 0.18 && r256 / r16 < 0.35, "random {r16} {r256}");
    assert!(s256 / s16 < 0.18, "sobol {s16} {s256}");
    assert!(s256 < 0.4 * r256, "{s256} {r256}");
}
