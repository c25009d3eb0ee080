//! Invalid scenes and options are rejected, and settings without effect cause a warning. Messages
//! name the item, the value and a cure.
#![cfg(feature = "render")]

use rt_core::bvh::{BuildError, BuildOptions, Geometry, World};
use rt_core::camera::Camera;
use rt_core::colormap::ColorMap;
use rt_core::effects::Effects;
use rt_core::environment::{Background, Environment};
use rt_core::glam::{DVec3, Vec3};
use rt_core::light::{Light, LightKind, LightSizeError};
use rt_core::material::Material;
use rt_core::mesh::{Attribute, TriMesh};
use rt_core::render::{RenderOptions, render};
use rt_core::scene::{Appearance, Scene, SceneBuilder, SceneError};
use rt_core::shapes::{Radii, Spheres};
use rt_core::simd::SimdLevel;
use rt_core::texture::Texture;
use rt_core::transfer_function::{TransferFunction, TransferFunctionError};
use rt_core::volume::GradientOpacity;
use std::sync::Arc;
use std::time::Duration;

fn square(z: f32, half: f32) -> TriMesh {
    let corner = |x: f32, y: f32| Vec3::new(x * half, y * half, z);
    let corners = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    TriMesh::new(corners, vec![[0, 1, 2], [0, 2, 3]])
}

fn plain() -> Scene {
    let mut b = SceneBuilder::new();
    b.mesh(square(0.0, 1.0), Material::matte([0.5; 3]));
    b.light(Light::directional(DVec3::Z));
    b.build().unwrap()
}

fn camera() -> Camera {
    Camera::orthographic(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 2.0, 1.0, [0.1, 10.0])
        .unwrap()
}

/// Asserts that the check rejects the scene by name, and so does every frame.
#[track_caller]
fn refused(change: impl FnOnce(&mut Scene), what: &str, field: &str, value: &str) {
    let mut scene = plain();
    change(&mut scene);
    let error = scene.check().expect_err("it cannot be drawn");
    let words = error.to_string();
    assert!(
        words.contains(what)
            && words.contains(field)
            && words.contains(value)
            && words.contains("must be"),
        "{words}"
    );
    assert!(render(&scene, &camera(), &RenderOptions::new(4, 4)).is_err(), "{words}");
}

fn image(change: impl Fn(usize) -> [f32; 4]) -> Arc<Texture> {
    Arc::new(Texture::from_linear(4, 3, (0..12).map(change).collect()).unwrap())
}

#[test]
fn an_environment_that_no_light_can_come_from_is_refused() {
    for bad in [f32::NAN, f32::INFINITY, -0.5] {
        let value = format!("{bad:?}");
        let radiance = [0.5, bad, 0.5];
        refused(
            |s| s.environment = Some(Environment::Constant(radiance)),
            "environment",
            "radiance",
            &value,
        );
        for top_is_bad in [false, true] {
            let [bottom, top] =
                if top_is_bad { [[0.1; 3], radiance] } else { [radiance, [0.1; 3]] };
            let field = if top_is_bad { "top" } else { "bottom" };
            let sky = Environment::Gradient { bottom, top, up: Vec3::Z };
            refused(|s| s.environment = Some(sky), "environment", field, &value);
        }
        let image_of =
            |scale| Environment::Image { image: image(|_| [0.5; 4]), up: Vec3::Y, scale };
        let shown = bad.to_string();
        refused(|s| s.environment = Some(image_of(bad)), "environment", "scale", &shown);
        let broken = image(|i| if i == 7 { [0.5, 0.5, bad, 1.0] } else { [0.5; 4] });
        let sky = Environment::Image { image: broken, up: Vec3::Y, scale: 1.0 };
        refused(|s| s.environment = Some(sky), "environment", "image", "(3, 1)");
    }
}

#[test]
fn an_up_that_is_not_of_unit_length_is_refused() {
    for up in [
        Vec3::ZERO,
        Vec3::Z * 2.0,
        Vec3::new(0.0, f32::NAN, 1.0),
        Vec3::X * 0.99,
        Vec3::splat(1e30),
    ] {
        let sky = Environment::Gradient { bottom: [0.0; 3], top: [1.0; 3], up };
        refused(|s| s.environment = Some(sky), "environment", "up", &up.x.to_string());
        let sky = Environment::Image { image: image(|_| [0.5; 4]), up, scale: 1.0 };
        refused(|s| s.environment = Some(sky), "environment", "up", "normalise");
    }
}

/// The axes around `up` are derived from `up` itself, so no choice of `up` is degenerate. Along
/// every axis and close to every axis, all directions have a finite radiance, the poles have the
/// colours of the panorama's top and bottom, and a turn around `up` passes every column.
#[test]
fn an_environment_may_stand_along_any_axis() {
    let picture = image(|i| [[0.25, 0.5, 1.0][i / 4], (i % 4) as f32, 0.0, 1.0]);
    let mut ups = Vec::new();
    for axis in [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z] {
        ups.extend([axis, (axis + Vec3::new(1e-4, -2e-4, 1e-7)).normalize()]);
    }
    for up in ups {
        let sky = Environment::Image { image: picture.clone(), up, scale: 1.0 };
        let mut scene = plain();
        scene.environment = Some(sky.clone());
        scene.check().unwrap();
        assert!((sky.radiance(up).x - 1.0).abs() < 1e-6, "{up}");
        assert!((sky.radiance(-up).x - 0.25).abs() < 1e-6, "{up}");
        let side = up.any_orthonormal_vector();
        let around: Vec<f32> = (0..64)
            .map(|k| {
                let turn = rt_core::glam::Quat::from_axis_angle(up, k as f32 * 0.098_174_77);
                let seen = sky.radiance(turn * side);
                assert!(seen.is_finite(), "{up}");
                seen.y
            })
            .collect();
        let (low, high) = around.iter().fold((9f32, -9f32), |(l, h), v| (l.min(*v), h.max(*v)));
        assert!(low < 0.2 && high > 2.8, "{up}: {low} to {high}");
    }
}

#[test]
fn a_background_that_is_no_color_is_refused() {
    let nan = f32::NAN;
    refused(
        |s| s.background = Background::Constant([0.0, nan, 0.0, 1.0]),
        "background",
        "color",
        "NaN",
    );
    refused(
        |s| s.background = Background::Constant([0.0, 0.0, 0.0, 1.5]),
        "background",
        "alpha",
        "1.5",
    );
    let (bottom, top) = ([0.0; 3], [f32::INFINITY; 3]);
    refused(|s| s.background = Background::Gradient { bottom, top }, "background", "top", "inf");
}

#[test]
fn colors_that_are_nan_are_refused_wherever_they_come_from() {
    let nan = f32::NAN;
    let with = |m: Material| move |s: &mut Scene| s.materials[0] = m;
    let broken = image(|i| if i == 5 { [0.5, 0.5, 0.5, f32::INFINITY] } else { [0.5; 4] });
    refused(with(Material::matte([1.0; 3]).textured(broken)), "material 0", "texture", "(1, 1)");
    let map =
        |colors| Material::matte([1.0; 3]).colored_by_scalars(ColorMap::new(colors, [0.0, 1.0]));
    refused(with(map(vec![[1.0; 4], [0.0, nan, 0.0, 1.0]])), "material 0", "color map", "place 1");
    let mut empty = ColorMap::new(vec![], [0.0, 1.0]);
    empty.colors.clear();
    let by_empty = Material::matte([1.0; 3]).colored_by_scalars(empty);
    refused(with(by_empty), "material 0", "color map", "without colours");
    let log = ColorMap { log: true, ..ColorMap::new(vec![[1.0; 4]], [0.0, 1.0]) };
    refused(
        with(Material::matte([1.0; 3]).colored_by_scalars(log)),
        "material 0",
        "range",
        "[0.0, 1.0]",
    );
    let own = || Attribute::per_vertex(vec![[1.0; 4], [1.0; 4], [1.0, nan, 1.0, 1.0], [1.0; 4]]);
    let look = Appearance::new(0).with_colors(own());
    refused(|s| s.appearances[0] = look, "appearance 0", "colors", "place 2");
    let mut mesh = square(0.0, 1.0);
    mesh.colors = Some(own());
    let mut b = SceneBuilder::new();
    b.mesh(mesh, Material::matte([1.0; 3]));
    let words = b.build().err().expect("a colour is NaN").to_string();
    assert!(words.contains("geometry 0") && words.contains("place 2"), "{words}");
    let colors = ColorMap { nan_color: [nan; 4], ..ColorMap::new(vec![[1.0; 4]], [0.0, 1.0]) };
    let error = TransferFunction::new(colors, vec![[0.0, 1.0]]).unwrap_err();
    assert!(matches!(error, TransferFunctionError::Colors { .. }), "{error}");
    let mut colors = ColorMap::new(vec![], [0.0, 1.0]);
    colors.colors.clear();
    assert!(TransferFunction::new(colors, vec![[0.0, 1.0]]).is_err());
}

#[test]
fn lists_that_were_emptied_after_their_making_have_a_defined_value() {
    for log in [false, true] {
        let mut map = ColorMap { log, ..ColorMap::new(vec![], [1.0, 2.0]) };
        assert_eq!(map.lookup(1.5), [1.0; 4], "as made");
        map.colors.clear();
        let looked_up = [f32::NEG_INFINITY, 1.0, 1.5, 7.0].map(|v| map.lookup(v));
        assert_eq!(looked_up, [[1.0; 4]; 4], "log {log}: white, as `new` makes of no colours");
        assert_eq!(map.lookup(f32::NAN), map.nan_color);
    }
    let opacity = GradientOpacity { factors: [].into(), steepest: 2.0 };
    let factors = [0.0, 1.0, 9.0, f64::NAN].map(|steepness| opacity.at(steepness));
    assert_eq!(factors, [1.0; 4], "no factors change nothing");
}

#[test]
fn numbers_of_lights_that_give_no_light_are_refused() {
    let light = |l: Light| move |s: &mut Scene| s.lights[0] = l;
    let lamp = Light::point(DVec3::new(0.0, 0.0, 2.0));
    for (attenuation, value) in [([0.0; 3], "[0.0, 0.0, 0.0]"), ([1.0, -0.5, 0.0], "-0.5")] {
        refused(light(Light { attenuation, ..lamp }), "light 0", "attenuation", value);
    }
    refused(light(Light::point(DVec3::X * 1e39)), "light 0", "position", "1e37");
    refused(light(Light::directional(DVec3::X * 1e-200)), "light 0", "to_light", "1e-150");
    refused(light(Light::directional(DVec3::X * 1e200)), "light 0", "to_light", "1e-150");
    let huge = Light::spot(DVec3::Z, DVec3::X * 1e200, 0.5);
    refused(light(huge), "light 0", "direction", "1e-150");
}

#[test]
fn attributes_of_shapes_must_fit_and_worlds_cannot_be_swapped() {
    let balls = || Arc::new(Spheres::new(vec![Vec3::ZERO, Vec3::X], Radii::Common(0.3)).unwrap());
    let mut b = SceneBuilder::new();
    b.shape(balls(), Material::matte([1.0; 3]));
    let mut scene = b.build().unwrap();
    for n in [1, 3] {
        scene.appearances[0] =
            Appearance::new(0).with_colors(Attribute::per_vertex(vec![[1.0; 4]; n]));
        let expected =
            SceneError::AttributeLength { appearance: 0, field: "colors", expected: 2, found: n };
        assert_eq!(scene.check(), Err(expected));
    }
    scene.appearances[0] = Appearance::new(0).with_colors(Attribute::per_vertex(vec![[1.0; 4]; 2]));
    scene.check().unwrap();
    let two = vec![Geometry::Shape(balls()), Geometry::Shape(balls())];
    let instances = scene.world.instances().to_vec();
    scene.world = Arc::new(World::build(two, instances, &BuildOptions::default()).unwrap());
    let error = scene.check().unwrap_err();
    assert_eq!(error, SceneError::OtherWorld { expected: 1, found: 2 });
    assert!(error.to_string().contains("Scene::new"), "{error}");
}

#[test]
fn a_camera_whose_depth_range_is_nan_is_refused() {
    let camera = camera().with_depth_range([0.0, f64::NAN]);
    let words = render(&plain(), &camera, &RenderOptions::new(4, 4)).unwrap_err().to_string();
    assert!(words.contains("depth_range[1]") && words.contains("NaN"), "{words}");
}

// ---- Requests without effect

#[test]
fn an_instruction_set_that_the_machine_lacks_is_refused_by_name() {
    let all =
        [SimdLevel::Sse2, SimdLevel::Sse42, SimdLevel::Avx2, SimdLevel::Avx512, SimdLevel::Neon];
    let available = SimdLevel::available();
    let mut lacking = 0;
    for level in all {
        let options = BuildOptions { simd: Some(level), ..BuildOptions::default() };
        let built = World::from_mesh(square(0.0, 1.0), &options);
        if available.contains(&level) {
            assert!(built.is_ok(), "{level:?}");
            continue;
        }
        lacking += 1;
        let error = built.err().expect("no such instruction set");
        assert!(matches!(error, BuildError::Level(e) if e.wanted == level), "{error}");
        let words = error.to_string();
        assert!(words.contains(level.name()), "{words}");
        available.iter().for_each(|a| assert!(words.contains(a.name()), "{words}"));
    }
    // No machine has the instruction sets of both ARM and x86.
    assert!(lacking > 0);
}

#[test]
fn a_size_that_a_light_cannot_have_is_refused() {
    let (place, down) = (DVec3::new(1.0, 2.0, 3.0), DVec3::NEG_Z);
    let kind = LightKind::Cone { position: place, direction: down, inner_rad: 0.1, outer_rad: 0.3 };
    let cone = Light { kind, ..Light::directional(DVec3::Z) };
    assert_eq!(cone.with_size(0.5), Err(LightSizeError::Cone));
    assert_eq!(Light::ambient([1.0; 3]).with_size(0.5), Err(LightSizeError::Ambient));
    assert!(LightSizeError::Cone.to_string().contains("Ring"), "{}", LightSizeError::Cone);
    assert_eq!(Light::quad(place, [DVec3::ZERO; 2]).with_size(0.5), Err(LightSizeError::Quad));
    // All others get the requested size.
    let quad = Light::quad(place, [DVec3::X * 2.0, DVec3::Y * 0.5]);
    let ring = LightKind::Ring {
        position: place,
        direction: down,
        inner_radius: 0.5,
        radius: 1.0,
        inner_rad: 0.2,
        outer_rad: 0.4,
    };
    for light in [
        Light::directional(DVec3::Z),
        Light::point(place),
        Light::spot(place, down, 0.3),
        Light::disk(place, down, 1.0),
        Light { kind: ring, ..quad },
        quad,
    ] {
        assert_eq!(light.with_size(0.25).unwrap().size(), 0.25, "{light:?}");
    }
    let LightKind::Quad { corner, edges, .. } = quad.with_size(0.25).unwrap().kind else {
        panic!()
    };
    assert_eq!(edges, [DVec3::X * 0.5, DVec3::Y * 0.125]);
    assert_eq!(
        corner + 0.5 * (edges[0] + edges[1]),
        place + DVec3::new(1.0, 0.25, 0.0),
        "the middle"
    );
}

#[test]
fn a_light_of_highlights_alone_casts_shadows() {
    // A plate above a floor; light straight down gives only highlights.
    let light = Light {
        highlight_color: Some([1.0; 3]),
        ..Light::directional(DVec3::Z).with_color([0.0; 3])
    };
    let draw = |light: Light| {
        let mut b = SceneBuilder::new();
        b.mesh(square(0.0, 3.0), Material::phong([0.0; 3], 1.0, 1.0));
        b.mesh(square(1.0, 0.5), Material::unlit([0.0; 3]));
        b.light(light);
        let scene = b.build().unwrap();
        // Viewed from the side, so that the floor under the plate is visible.
        let eye = DVec3::new(0.0, -3.0, 0.6);
        let c = Camera::perspective(eye, DVec3::ZERO, DVec3::Z, 0.3, 1.0, [0.1, 20.0]).unwrap();
        let o = render(&scene, &c, &RenderOptions::new(33, 33)).unwrap();
        (o.frame.color_at(16, 16)[0], o.report.rays.shadow_blocked)
    };
    let (dark, blocked) = draw(light);
    let (bright, none) = draw(light.without_shadows());
    assert!(bright > 0.05, "the highlight is there without shadows: {bright}");
    assert_eq!((dark, none), (0.0, 0));
    assert!(blocked > 0);
    // Without any light, no ray is sent.
    assert_eq!(draw(Light { highlight_color: Some([0.0; 3]), ..light }).1, 0);
}

#[test]
fn effects_that_change_no_pixel_are_reported_by_name() {
    let warned = |scene: &Scene, options: &RenderOptions, words: &[&str]| {
        let report = render(scene, &camera(), options).unwrap().report;
        for w in words {
            assert!(report.warnings.iter().any(|r| r.contains(w)), "{w}: {:?}", report.warnings);
        }
        report.warnings.len()
    };
    let options = RenderOptions::new(4, 4);
    assert_eq!(warned(&plain(), &options, &[]), 0);
    // Attenuation without a distance.
    let mut scene = plain();
    scene.lights[0].attenuation = [0.0, 0.0, 1.0];
    warned(&scene, &options, &["light 0 is directional", "its attenuation changes nothing"]);
    // Colours and scalars that the material does not use.
    let mut scene = plain();
    let colors = Attribute::per_vertex(vec![[1.0; 4]; 4]);
    scene.appearances[0] =
        Appearance::new(0).with_colors(colors).with_scalars(Attribute::per_vertex(vec![0.0; 4]));
    assert_eq!(
        warned(&scene, &options, &["material 0 maps no scalars, but instance 0 has scalars"]),
        1
    );
    scene.materials[0] =
        Material::matte([1.0; 3]).colored_by_scalars(ColorMap::new(vec![], [0.0, 1.0]));
    assert_eq!(warned(&scene, &options, &["instance 0 has colours of its own"]), 1);
    // Textures on a shape.
    let mut b = SceneBuilder::new();
    let balls = Spheres::new(vec![Vec3::ZERO], Radii::Common(0.3)).unwrap();
    b.shape(Arc::new(balls), Material::matte([1.0; 3]).textured(image(|_| [0.5; 4])));
    b.light(Light::directional(DVec3::Z));
    let scene = b.build().unwrap();
    warned(
        &scene,
        &options,
        &["material 0 has a texture, but instance 0 has no texture coordinates"],
    );
    // Limits that cannot be reached.
    let o = RenderOptions { depth_min_opacity: 0.5, ..options.clone() };
    warned(&plain(), &o, &["depth_min_opacity 0.5 changes nothing"]);
    let o = RenderOptions { max_error_levels: Some(1.0), samples: 4, ..options.clone() };
    warned(&plain(), &o, &["max_error_levels changes nothing"]);
    let o = RenderOptions { time_limit: Some(Duration::from_secs(9)), ..options.clone() };
    warned(&plain(), &o, &["time_limit changes nothing"]);
    let o = RenderOptions { max_error_levels: Some(1e-9), samples: 5, ..options };
    let effects = Some(Effects::NONE);
    assert_eq!(warned(&plain(), &RenderOptions { effects, ..o }, &[]), 1);
}
