//! Shadows, ambient occlusion, reflection, refraction and transparency: closed forms, and counters
//! that stay at zero.
#![cfg(feature = "render")]

mod scenes_common;
use rt_core::effects::Effects;
use rt_core::environment::{Background, Environment};
use rt_core::glam::{DVec3, Vec3};
use rt_core::light::Light;
use rt_core::material::{Material, PbrForm, Sides, SurfaceModel};
use rt_core::mesh::Attribute;
use rt_core::render::RenderOptions;
use rt_core::scene::{AmbientOcclusion, SceneBuilder};
use rt_core::shapes::{Cylinders, Radii, Shape, Spheres, Tubes};
use scenes_common::*;
use std::sync::Arc;

fn options(n: u32) -> RenderOptions {
    RenderOptions::new(n, n)
}

// ---- Shadows

#[test]
fn shadow_of_a_square_is_where_geometry_says() {
    // A 2 x 2 square at height 1 under a point light at height 2 casts a shadow of 4 x 4.
    for light in [
        Light::point(DVec3::new(0.0, 0.0, 2.0)),
        Light::spot(DVec3::new(0.0, 0.0, 2.0), -DVec3::Z, 1.5),
    ] {
        let mut s = scene(
            vec![
                (floor(0.0, 10.0), Material::matte([1.0; 3])),
                (floor(1.0, 1.0), Material::matte([1.0; 3])),
            ],
            vec![light],
        );
        // Viewed from below the square's height: near plane at height 0.5.
        let c = rt_core::camera::Camera::orthographic(
            DVec3::new(0.0, 0.0, 0.5),
            DVec3::ZERO,
            DVec3::Y,
            8.0,
            1.0,
            [0.0, 2.0],
        )
        .unwrap();
        let o = draw(&s, &c, options(64));
        for y in 0..64 {
            for x in 0..64 {
                let at = |k: u32| (k as f64 + 0.5) / 8.0 - 4.0;
                let shadowed = at(x).abs() < 2.0 && at(y).abs() < 2.0;
                assert_eq!(o.frame.color_at(x, y)[0] == 0.0, shadowed, "pixel {x} {y}");
            }
        }
        assert!(o.report.rays.shadow > 0 && o.report.rays.shadow_blocked > 0);
        // Lights that cast no shadows cause no rays.
        s.lights[0].shadows = false;
        let o = draw(&s, &c, options(64));
        assert_eq!(o.report.rays.shadow, 0);
        assert!(!o.report.effects.contains(Effects::SHADOWS));
    }
}

#[test]
fn headlight_sends_no_shadow_rays() {
    let s = scene(
        vec![(sphere(Vec3::ZERO, 1.0, 16), Material::matte([1.0; 3]))],
        vec![Light::headlight()],
    );
    let o = draw(&s, &camera(DVec3::new(4.0, 0.0, 0.0), 0.6), options(32));
    let r = o.report.rays;
    assert_eq!(
        (r.shadow, r.ambient_occlusion, r.reflection, r.refraction, r.transparency, r.path),
        (0, 0, 0, 0, 0, 0)
    );
    assert_eq!(r.primary, 32 * 32);
    assert_eq!(r.total(), r.primary);
    assert!(o.report.effects.is_empty() && o.report.warnings.is_empty());
    // When it is requested to cast shadows, it does: in perspective, its light is parallel and the
    // eye's rays are not.
    let mut s = s;
    s.lights[0].shadows = true;
    assert!(draw(&s, &camera(DVec3::new(4.0, 0.0, 0.0), 0.6), options(32)).report.rays.shadow > 0);
}

#[test]
fn soft_light_has_a_penumbra_of_the_right_width() {
    // A half plane x < 0 at height 1, a disk light of radius 0.5 at height 2: the penumbra on the
    // floor is |x| < 0.5.
    let blocker = quad(Vec3::new(-10.0, 0.0, 1.0), Vec3::X * 10.0, Vec3::Y * 20.0);
    let light = Light::point(DVec3::new(0.0, 0.0, 2.0)).with_size(0.5).unwrap();
    let s = scene(
        vec![(floor(0.0, 30.0), Material::matte([1.0; 3])), (blocker, Material::matte([1.0; 3]))],
        vec![light],
    );
    let c = rt_core::camera::Camera::orthographic(
        DVec3::new(0.0, 0.0, 0.5),
        DVec3::ZERO,
        DVec3::Y,
        2.0,
        1.0,
        [0.0, 2.0],
    )
    .unwrap();
    let o = draw(&s, &c, RenderOptions { light_rays: 256, ..options(32) });
    assert!(o.report.effects.contains(Effects::SOFT_SHADOWS));
    let row = |x: u32| o.frame.color_at(x, 16)[0];
    assert_eq!(row(4), 0.0, "x = -0.72 is in the umbra");
    let full = |x: u32| {
        let at = (x as f64 + 0.5) / 16.0 - 1.0;
        (2.0 / (4.0 + at * at).sqrt()) as f32
    };
    // The mean over a disk is 1 - r²/(4 d²) of the value at its centre, 1.3 % less.
    assert!((row(28) - full(28)).abs() < 0.02, "x = 0.78 sees the whole light: {}", row(28));
    // At x = 0 the edge cuts the disk in half.
    let middle = 0.5 * (row(15) + row(16));
    assert!((middle / full(16) - 0.5).abs() < 0.03, "{middle}");
    let hard = draw(&s, &c, RenderOptions { effects: Some(Effects::SHADOWS), ..options(32) });
    assert!(
        hard.frame.color.iter().all(|p| p[0] == 0.0 || p[0] > 0.8),
        "hard shadows have two values"
    );
    assert!(hard.report.left_out.contains(Effects::SOFT_SHADOWS));
}

// ---- Reflection and refraction

#[test]
fn mirror_shows_the_environment_in_the_mirror_direction() {
    let mut s = scene(vec![(floor(0.0, 50.0), Material::metal([1.0; 3], 0.0))], vec![]);
    s.environment = Some(Environment::Gradient { bottom: [0.0; 3], top: [1.0; 3], up: Vec3::Z });
    let c = camera(DVec3::new(-3.0, 0.0, 3.0), 0.2);
    let o = draw(&s, &c, options(33));
    // At 45 degrees the mirrored ray rises with sin 45°: radiance 0.5 + 0.5 sin 45°. With Schlick's
    // approximation, white metal reflects everything.
    let expected = 0.5 + 0.5 * std::f32::consts::FRAC_1_SQRT_2;
    assert!((o.frame.color_at(16, 16)[0] - expected).abs() < 1e-4);
    assert_eq!(o.report.rays.reflection, 33 * 33);
    assert_eq!((o.report.rays.refraction, o.report.rays.shadow), (0, 0));
}

#[test]
fn no_reflection_rays_at_specular_zero() {
    let phong = |mirror| {
        let mut m = Material::phong([0.5; 3], 0.5, 20.0);
        if let SurfaceModel::Phong { mirror: k, .. } = &mut m.model {
            *k = mirror;
        }
        m
    };
    let c = camera(DVec3::new(4.0, 0.0, 1.0), 0.6);
    let body = || sphere(Vec3::ZERO, 1.0, 12);
    let dull = Material {
        model: SurfaceModel::Pbr {
            metallic: 0.0,
            roughness: 0.5,
            specular: 0.0,
            form: PbrForm::Gltf,
        },
        ..Material::matte([0.5; 3])
    };
    for (m, reflects) in [
        (phong(0.0), false),
        (phong(0.3), true),
        (dull, false),
        (Material::pbr([0.5; 3], 0.0, 0.5), true),
    ] {
        let mut s = scene(vec![(body(), m)], vec![Light::headlight()]);
        s.environment = Some(Environment::Constant([0.2; 3]));
        assert_eq!(draw(&s, &c, options(16)).report.rays.reflection > 0, reflects);
    }
}

#[test]
fn rays_of_mirrors_that_are_left_out_are_counted_and_cost_at_most_their_share() {
    // Two mirrors of reflectance 0.1 face each other, each emits 1: the series 1/(1 - 0.1).
    let mut m = Material::phong([0.0; 3], 0.0, 1.0).with_emission([1.0; 3]);
    if let SurfaceModel::Phong { mirror, .. } = &mut m.model {
        *mirror = 0.1;
    }
    let s = scene(vec![(floor(0.0, 100.0), m.clone()), (floor(2.0, 100.0), m)], vec![]);
    let c = top_camera(1.0, 0.1);
    let at = |min_contribution| {
        let o = draw(&s, &c, RenderOptions { min_contribution, ..options(4) });
        (o.frame.color_at(2, 2)[0], o.report.rays)
    };
    let (all, rays) = at(0.0);
    assert!((all - 1.0 / 0.9).abs() < 1e-6 && rays.cut_at_min_contribution == 0, "{all}");
    assert_eq!(rays.cut_at_max_bounces, 16, "after eight reflections");
    let (most, rays) = at(0.005);
    // The third reflection ray is not sent. The missing radiance is 0.001 times the radiance that
    // it would have found.
    assert_eq!((rays.cut_at_min_contribution, rays.cut_at_max_bounces), (16, 0));
    assert!(((all - most) - 0.001 * all).abs() < 1e-6, "{all} {most}");
}

#[test]
fn refracted_ray_leaves_where_snell_says() {
    // A slab 0 <= z <= 1 of index 1.5 over a floor at z = -1e-3 striped in x: a 45° ray enters at x
    // = 0 and arrives shifted.
    let slab_top = floor(1.0, 100.0);
    let mut bottom = floor(0.0, 100.0);
    bottom.indices.iter_mut().for_each(|t| t.swap(0, 1));
    let mut ground = quad(Vec3::new(0.0, 0.0, -0.001), Vec3::X * 100.0, Vec3::Y * 100.0);
    ground.colors = Some(Attribute::per_vertex(
        ground.positions.iter().map(|p| [p.x + 200.0, 0.0, 0.0, 1.0]).collect(),
    ));
    let glass = Material::dielectric(1.5);
    let s = scene(
        vec![(slab_top, glass.clone()), (bottom, glass), (ground, Material::unlit([1.0; 3]))],
        vec![],
    );
    // A thin parallel beam at 45° that meets the top at x = 0.
    let c = rt_core::camera::Camera::orthographic(
        DVec3::new(-4.0, 0.0, 5.0),
        DVec3::new(0.0, 0.0, 1.0),
        DVec3::Y,
        1e-4,
        1.0,
        [0.0, 100.0],
    )
    .unwrap();
    let only_through = Effects::REFRACTION;
    let o = draw(&s, &c, RenderOptions { effects: Some(only_through), ..options(5) });
    let sin_t = std::f64::consts::FRAC_1_SQRT_2 / 1.5;
    let x = sin_t / (1.0 - sin_t * sin_t).sqrt() + 0.001;
    // Fresnel loss at both faces; reflection rays are not requested.
    let (ci, ct) = (std::f64::consts::FRAC_1_SQRT_2, (1.0 - sin_t * sin_t).sqrt());
    let rp = (1.5 * ci - ct) / (1.5 * ci + ct);
    let rs = (ci - 1.5 * ct) / (ci + 1.5 * ct);
    let through = (1.0 - 0.5 * (rp * rp + rs * rs)).powi(2);
    let found = o.frame.color_at(2, 2)[0] as f64 / through - 200.0;
    assert!((found - x).abs() < 1e-3, "{found} instead of {x}");
    assert_eq!(o.report.rays.reflection, 0);
    assert_eq!(o.report.rays.refraction, 2 * 25);
}

#[test]
fn total_internal_reflection_turns_the_ray_back() {
    // From inside glass (ior 1.5) at 60°: total internal reflection, the mirrored ray sees the
    // inside.
    let mut face = floor(1.0, 100.0);
    face.colors = None;
    let ground = floor(0.0, 100.0);
    let s =
        scene(vec![(face, Material::dielectric(1.5)), (ground, Material::unlit([0.7; 3]))], vec![]);
    let c = camera(DVec3::new(0.0, 0.0, 0.5), 0.1);
    let _ = c;
    let dir = DVec3::new(60f64.to_radians().sin(), 0.0, 60f64.to_radians().cos());
    let eye = DVec3::new(0.0, 0.0, 0.5);
    let c = rt_core::camera::Camera::perspective(eye, eye + dir, DVec3::Z, 0.05, 1.0, [1e-3, 1e3])
        .unwrap();
    let o = draw(&s, &c, options(8));
    assert!(o.frame.color.iter().all(|p| p[0] == 0.7), "{:?}", o.frame.color_at(4, 4));
    assert_eq!(o.report.rays.refraction, 0);
    assert_eq!(o.report.rays.reflection, 64);
}

#[test]
fn glass_absorbs_by_beer_and_lambert() {
    // Head on through 2 units: two interfaces of 4 % and exp(-2 sigma).
    let (mut top, mut bottom) = (floor(2.0, 50.0), floor(0.0, 50.0));
    top.origin = DVec3::ZERO;
    bottom.indices.iter_mut().for_each(|t| t.swap(0, 1));
    let sigma = [0.1f32, 0.7, 0.0];
    let glass = Material {
        model: SurfaceModel::Dielectric { ior: 1.5, absorption: sigma },
        ..Material::matte([1.0; 3])
    };
    let s = scene(
        vec![(top, glass.clone()), (bottom, glass), (floor(-1.0, 50.0), Material::unlit([1.0; 3]))],
        vec![],
    );
    let o = draw(
        &s,
        &top_camera(5.0, 0.001),
        RenderOptions { effects: Some(Effects::REFRACTION), ..options(4) },
    );
    let p = o.frame.color_at(1, 1);
    for c in 0..3 {
        let expected = 0.96f32 * 0.96 * (-2.0 * sigma[c]).exp();
        assert!((p[c] - expected).abs() < 1e-5, "channel {c}: {} {expected}", p[c]);
    }
}

// ---- Transparency

#[test]
fn opacity_layers_compose_with_over_in_order() {
    // Red 0.5 over green 0.25 over blue 1.
    let layers =
        [(3.0, [1.0, 0.0, 0.0], 0.5), (2.0, [0.0, 1.0, 0.0], 0.25), (1.0, [0.0, 0.0, 1.0], 1.0)];
    let order = [[0, 1, 2], [2, 1, 0], [1, 2, 0]];
    for o in order {
        let parts = o
            .iter()
            .map(|&k| {
                (floor(layers[k].0, 5.0), Material::unlit(layers[k].1).with_opacity(layers[k].2))
            })
            .collect();
        let out = draw(&scene(parts, vec![]), &top_camera(5.0, 4.0), options(16));
        assert!(
            out.frame.color.iter().all(|p| *p == [0.5, 0.125, 0.375, 1.0]),
            "{:?}",
            out.frame.color_at(3, 3)
        );
        assert_eq!(out.report.rays.transparency, 2 * 256);
    }
}

#[test]
fn alpha_of_transparent_pixels_is_coverage_and_color_is_premultiplied() {
    let s = scene(vec![(floor(0.0, 1.0), Material::unlit([0.8; 3]).with_opacity(0.5))], vec![]);
    let o = draw(&s, &top_camera(5.0, 4.0), options(16));
    assert_eq!(o.frame.color_at(8, 8), [0.4, 0.4, 0.4, 0.5]);
    assert_eq!(o.frame.color_at(0, 0), [0.0; 4]);
    let mut s = s;
    s.background = Background::Constant([1.0, 0.0, 0.0, 1.0]);
    let o = draw(&s, &top_camera(5.0, 4.0), options(16));
    assert_eq!(o.frame.color_at(8, 8), [0.9, 0.4, 0.4, 1.0]);
}

#[test]
fn shared_edges_and_vertices_are_met_once() {
    // A grid of transparent squares whose edges and vertices lie exactly on pixel centres: each
    // layer counts once.
    let n = 16;
    let mut mesh = rt_core::mesh::TriMesh::default();
    for j in 0..=n {
        for i in 0..=n {
            mesh.positions.push(Vec3::new(
                i as f32 - 7.5,
                j as f32 - 7.5,
                0.1 * ((i * 7 + j * 3) % 5) as f32,
            ));
        }
    }
    for j in 0..n {
        for i in 0..n {
            let a = (j * (n + 1) + i) as u32;
            let (b, c, d) = (a + 1, a + n as u32 + 2, a + n as u32 + 1);
            mesh.indices.extend([[a, b, c], [a, c, d]]);
        }
    }
    let s = scene(vec![(mesh, Material::unlit([1.0; 3]).with_opacity(0.5))], vec![]);
    for c in [top_camera(20.0, 14.0), top_camera(20.0, 7.0)] {
        let o = draw(&s, &c, options(14));
        assert!(
            o.frame.color.iter().all(|p| p[3] == 0.5),
            "{:?}",
            o.frame.color.iter().map(|p| p[3]).collect::<Vec<_>>()
        );
    }
}

#[test]
fn coplanar_layers_are_one_surface_of_the_lowest_id() {
    let m = |c| Material::unlit(c).with_opacity(0.5);
    let s = scene(
        vec![(floor(0.0, 3.0), m([1.0, 0.0, 0.0])), (floor(0.0, 3.0), m([0.0, 1.0, 0.0]))],
        vec![],
    );
    let o = draw(&s, &top_camera(5.0, 4.0), options(16));
    assert!(
        o.frame.color.iter().all(|p| *p == [0.5, 0.0, 0.0, 0.5]),
        "{:?}",
        o.frame.color_at(5, 5)
    );
}

#[test]
fn shapes_with_alpha_in_their_colours_are_looked_through() {
    // Two spheres one behind the other, the front one red and half transparent. The same with
    // cylinders and tubes.
    let colors = |alpha: f32| vec![[0.0, 0.0, 1.0, 1.0], [1.0, 0.0, 0.0, alpha]];
    let centers = vec![Vec3::ZERO, Vec3::new(0.0, 0.0, 2.0)];
    let ends = || vec![Vec3::new(-1.0, 0.0, 2.0), Vec3::new(1.0, 0.0, 2.0)];
    for alpha in [1.0, 0.5] {
        let red = vec![[1.0, 0.0, 0.0, alpha]; 2];
        let spheres =
            Spheres::new(centers.clone(), Radii::Common(0.5)).unwrap().with_colors(colors(alpha));
        let cylinder =
            Cylinders::new(ends(), Radii::Common(0.5), false).unwrap().with_colors(red.clone());
        let tube = Tubes::new(ends(), &[0, 2], Radii::Common(0.5)).unwrap().with_colors(red);
        let shapes: [(Arc<dyn Shape>, bool); 3] = [
            (Arc::new(spheres.unwrap()), false),
            (Arc::new(cylinder.unwrap()), true),
            (Arc::new(tube.unwrap()), true),
        ];
        for (k, (shape, needs_back)) in shapes.into_iter().enumerate() {
            let mut b = SceneBuilder::new();
            b.shape(shape, Material::unlit([1.0; 3]));
            if needs_back {
                b.mesh(floor(0.0, 3.0), Material::unlit([0.0, 0.0, 1.0]));
            }
            let s = b.build().unwrap();
            assert_eq!(
                Effects::required_by(&s).contains(Effects::TRANSPARENCY),
                alpha < 1.0,
                "shape {k}"
            );
            let o = draw(&s, &top_camera(5.0, 4.0), options(9));
            // Rays hit the red one where they enter and where they leave.
            let red = if alpha < 1.0 { 0.75 } else { 1.0 };
            assert_eq!(o.frame.color_at(4, 4), [red, 0.0, 1.0 - red, 1.0], "shape {k}");
            assert_eq!(o.report.rays.opacity_ignored, 0);
            assert!(o.report.warnings.is_empty(), "{:?}", o.report.warnings);
        }
    }
}

#[test]
fn culled_sides_let_rays_pass() {
    let front = floor(1.0, 3.0);
    let mut back = floor(1.0, 3.0);
    back.indices.iter_mut().for_each(|t| t.swap(0, 1));
    for (mesh, sides, visible) in [
        (front.clone(), Sides::FrontOnly, true),
        (back.clone(), Sides::FrontOnly, false),
        (front, Sides::BackOnly, false),
        (back, Sides::BackOnly, true),
    ] {
        let s = scene(
            vec![
                (mesh, Material::unlit([1.0; 3]).with_sides(sides)),
                (floor(0.0, 3.0), Material::unlit([0.25; 3])),
            ],
            vec![],
        );
        let o = draw(&s, &top_camera(5.0, 4.0), options(8));
        assert_eq!(o.frame.color_at(4, 4)[0], if visible { 1.0 } else { 0.25 });
    }
}

#[test]
fn transparent_blocker_dims_light_by_its_opacity() {
    let glassy = (floor(1.0, 1.0), Material::matte([1.0; 3]).with_opacity(0.75));
    let s = scene(
        vec![(floor(0.0, 5.0), Material::matte([1.0; 3])), glassy],
        vec![Light::directional(DVec3::Z)],
    );
    let c = rt_core::camera::Camera::orthographic(
        DVec3::new(0.0, 0.0, 0.5),
        DVec3::ZERO,
        DVec3::Y,
        4.0,
        1.0,
        [0.0, 2.0],
    )
    .unwrap();
    let o = draw(&s, &c, options(16));
    assert_eq!(o.frame.color_at(8, 8)[0], 0.25);
    assert_eq!(o.frame.color_at(0, 0)[0], 1.0);
}

// ---- Every effect

#[test]
fn omitting_any_one_effect_changes_the_image_and_zeroes_its_counter() {
    let mut s = scene(
        vec![
            (floor(-1.0, 4.0), Material::pbr([0.8, 0.7, 0.6], 0.0, 0.4)),
            (sphere(Vec3::new(0.0, 0.9, 0.0), 0.7, 16), Material::dielectric(1.5)),
            (sphere(Vec3::new(0.0, -0.9, 0.0), 0.7, 16), Material::metal([0.9, 0.6, 0.3], 0.0)),
            (
                sphere(Vec3::new(1.2, 0.0, 0.0), 0.5, 16),
                Material::matte([0.3, 0.5, 0.9]).with_opacity(0.6),
            ),
        ],
        vec![
            Light::point(DVec3::new(3.0, 2.0, 4.0)).with_size(0.4).unwrap(),
            Light::ambient([0.2; 3]),
        ],
    );
    s.ambient_occlusion = Some(AmbientOcclusion { distance: 2.0, rays: 4 });
    s.background = Background::Constant([0.5, 0.6, 0.7, 1.0]);
    let lens = rt_core::camera::ThinLens { aperture_radius: 0.2, focus_distance: 5.0 };
    let c = camera(DVec3::new(6.0, 1.0, 2.0), 0.6).with_lens(lens).unwrap();
    let all = Effects::required_by(&s) | Effects::required_by_camera(&c);
    assert_eq!(
        all,
        Effects::ALL[..8].iter().fold(Effects::NONE, |a, (e, _)| a | *e),
        "everything but volumes and paths"
    );
    let full = draw(&s, &c, options(48));
    for (effect, name) in &Effects::ALL[..8] {
        let mut asked = all.without(*effect);
        if *effect == Effects::SHADOWS {
            asked = asked.without(Effects::SOFT_SHADOWS);
        }
        let o = draw(&s, &c, RenderOptions { effects: Some(asked), ..options(48) });
        assert!(difference(&full, &o) > 0.01, "{name} changes nothing");
        assert!(
            o.report.warnings.iter().any(|w| w.starts_with(name) && w.contains("left out")),
            "{name}"
        );
        let r = o.report.rays;
        let count = match *name {
            "shadows" => r.shadow,
            "ambient occlusion" => r.ambient_occlusion,
            "refraction" => r.refraction,
            "transparency" => r.transparency,
            _ => 0,
        };
        assert_eq!(count, 0, "{name}");
    }
    let asked = all.without(Effects::REFLECTION | Effects::GLOSSY_REFLECTION | Effects::REFRACTION);
    let o = draw(&s, &c, RenderOptions { effects: Some(asked), ..options(48) });
    assert_eq!(o.report.rays.reflection, 0);
}

// ---- Requests

#[test]
fn every_effect_asked_for_in_vain_is_reported_by_name() {
    let s = scene(vec![(floor(0.0, 3.0), Material::matte([1.0; 3]))], vec![Light::headlight()]);
    let every =
        Effects::ALL.iter().fold(Effects::NONE, |a, (e, _)| a | *e).without(Effects::PATH_TRACING);
    let plain = draw(&s, &top_camera(5.0, 4.0), options(8));
    let o = draw(&s, &top_camera(5.0, 4.0), RenderOptions { effects: Some(every), ..options(8) });
    assert_eq!(difference(&plain, &o), 0.0);
    for name in every.names() {
        assert!(
            o.report.warnings.iter().any(|w| w.starts_with(name)),
            "{name}: {:?}",
            o.report.warnings
        );
    }
    // Requested and needed, but no blocker is in view.
    let s = scene(
        vec![(floor(0.0, 3.0), Material::matte([1.0; 3]))],
        vec![Light::directional(DVec3::Z)],
    );
    let o = draw(
        &s,
        &top_camera(5.0, 4.0),
        RenderOptions { effects: Some(Effects::SHADOWS), ..options(8) },
    );
    assert!(
        o.report.warnings.iter().any(|w| w.starts_with("shadows changed no pixel")),
        "{:?}",
        o.report.warnings
    );
}

#[test]
fn effect_left_out_is_reported_and_opaque() {
    let s = scene(vec![(floor(0.0, 3.0), Material::unlit([1.0; 3]).with_opacity(0.5))], vec![]);
    let o = draw(
        &s,
        &top_camera(5.0, 4.0),
        RenderOptions { effects: Some(Effects::NONE), ..options(8) },
    );
    assert_eq!(o.frame.color_at(4, 4), [1.0; 4]);
    assert!(
        o.report.warnings.iter().any(|w| w.starts_with("transparency left out")),
        "{:?}",
        o.report.warnings
    );
    assert_eq!(o.report.rays.transparency, 0);
}
