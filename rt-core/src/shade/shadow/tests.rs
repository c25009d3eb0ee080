//! Light through layers: tests which rays need their next hit, and that the image is the same as
//! when all rays ask for it.

use crate::bvh::{BuildOptions, Geometry};
use crate::camera::Camera;
use crate::effects::Effects;
use crate::frame::Layers;
use crate::light::Light;
use crate::material::{Material, Sides};
use crate::mesh::{Attribute, TriMesh};
use crate::ray_stats::RayStats;
use crate::render::RenderOptions;
use crate::scene::{AmbientOcclusion, Appearance, Scene, SceneBuilder};
use crate::shade::{FrameContext, TILE, TileArea, TileLayers, Workspace, render_tile};
use crate::shapes::{Radii, Spheres};
use crate::simd::SimdLevel;
use crate::test_shapes::sphere;
use glam::{DAffine3, DVec3, Vec3};
use std::sync::Arc;

fn square(z: f32, half: f32) -> TriMesh {
    let corner = |x: f32, y: f32| Vec3::new(x * half, y * half, z);
    TriMesh::new(
        vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
        vec![[0, 1, 2], [0, 2, 3]],
    )
}

fn camera() -> Camera {
    let eye = DVec3::new(1.5, -4.0, 3.0);
    Camera::perspective(eye, DVec3::new(0.0, 0.0, 0.5), DVec3::Z, 0.8, 1.0, [0.1, 100.0]).unwrap()
}

/// A floor and balls, all opaque but for what `change` does.
fn builder(simd: Option<SimdLevel>, balls: usize) -> SceneBuilder {
    let mut b = SceneBuilder::new();
    b.build_options = BuildOptions { simd, ..BuildOptions::default() };
    b.mesh(square(0.0, 3.0), Material::matte([0.8; 3]));
    let (g, m) =
        (b.geometry(Geometry::Mesh(Arc::new(sphere(2)))), b.material(Material::matte([0.6; 3])));
    for k in 0..balls {
        let (a, r) = (k as f64 * 0.9, 0.6 + 1.5 * k as f64 / balls as f64);
        let place = DVec3::new(r * a.cos(), r * a.sin(), 0.5 + 0.1 * (k % 3) as f64);
        let small = DAffine3::from_scale_rotation_translation(
            DVec3::splat(0.3),
            glam::DQuat::IDENTITY,
            place,
        );
        b.instance(g, small, Appearance::new(m));
    }
    b.light(Light::point(DVec3::new(1.0, 1.0, 4.0)));
    b.light(Light::directional(DVec3::new(-0.4, 0.2, 1.0)).with_size(0.05).unwrap());
    b.light(Light::ambient([0.3; 3]));
    b.ambient_occlusion = Some(AmbientOcclusion { distance: 1.0, rays: 5 });
    b
}

/// A pane, a ball of glass, a shape with alpha, a mesh with alpha at some corners, a side that is
/// not drawn.
fn see_through_things(b: &mut SceneBuilder) {
    b.mesh(square(1.6, 0.9), Material::matte([0.9, 0.5, 0.4]).with_opacity(0.4));
    b.mesh(square(1.2, 0.7), Material::matte([1.0; 3]).with_sides(Sides::BackOnly));
    let glass = b.material(Material::dielectric(1.5));
    let ball = b.geometry(Geometry::Mesh(Arc::new(sphere(3))));
    let place = DAffine3::from_scale_rotation_translation(
        DVec3::splat(0.5),
        glam::DQuat::IDENTITY,
        DVec3::new(-0.8, 0.3, 0.8),
    );
    b.instance(ball, place, Appearance::new(glass));
    let centers = vec![Vec3::new(0.8, -0.5, 1.1), Vec3::new(0.3, 0.9, 1.3)];
    let spheres = Spheres::new(centers, Radii::Common(0.3)).unwrap();
    let colors = vec![[0.2, 0.9, 0.3, 0.5], [0.9, 0.9, 0.2, 1.0]];
    b.shape(Arc::new(spheres.with_colors(colors).unwrap()), Material::matte([1.0; 3]));
    let mut leaf = square(2.0, 0.5);
    leaf.colors =
        Some(Attribute::per_vertex((0..4).map(|k| [0.7, 0.7, 0.7, k as f32 / 3.0]).collect()));
    b.mesh(leaf, Material::matte([1.0; 3]));
}

/// Colours (as bits) and counters of an image of four tiles. With `marked`, every instance counts
/// as possibly transmissive, so that every light ray is traced for its closest hit, layer by layer.
fn draw(scene: &Scene, options: &RenderOptions, marked: bool) -> (Vec<[u32; 4]>, RayStats) {
    let mut effects = Effects::required_by(scene);
    if options.path_tracing {
        effects = effects.without(Effects::AMBIENT_OCCLUSION) | Effects::PATH_TRACING;
    }
    let mut context = FrameContext::new(scene, &camera(), options, effects);
    if marked {
        context.transmissive.fill(true);
    }
    let (mut colors, mut stats) = (Vec::new(), RayStats::default());
    for tile in 0..4 {
        let (x, y) = (tile % 2 * TILE, tile / 2 * TILE);
        let area = TileArea { x, y, width: TILE, height: TILE, sample: 0 };
        let mut out = TileLayers::new(Layers::COLOR, 1.0, options.samples > 1);
        let mut work = Workspace::default();
        for sample in 0..options.samples {
            stats += render_tile(&context, &area, &mut out, &mut work, sample);
        }
        colors.extend(out.color.iter().map(|c| c.map(f32::to_bits)));
    }
    (colors, stats)
}

#[test]
fn light_through_layers_has_the_bits_of_closest_hits_alone() {
    let levels = SimdLevel::available();
    assert!(!levels.is_empty());
    // Few instances go in packets, many one by one.
    for (balls, level) in levels.iter().map(|l| (5, Some(*l))).chain([(40, None)]) {
        let mut b = builder(level, balls);
        see_through_things(&mut b);
        let scene = b.build().unwrap();
        for path_tracing in [false, true] {
            let options = RenderOptions {
                path_tracing,
                samples: 2,
                ..RenderOptions::new(2 * TILE, 2 * TILE)
            };
            let (picture, counted) = draw(&scene, &options, false);
            let (expected, all) = draw(&scene, &options, true);
            let differ = picture.iter().zip(&expected).filter(|(a, b)| a != b).count();
            assert_eq!(differ, 0, "{balls} balls at {level:?}, path tracing {path_tracing}");
            assert_eq!(counted.shadow_blocked, all.shadow_blocked, "{level:?}");
            assert_eq!(
                counted.ambient_occlusion_blocked, all.ambient_occlusion_blocked,
                "{level:?}"
            );
            assert_eq!(counted.primary, all.primary);
            assert!(all.shadow_blocked > 500 && counted.light_lookups > 100, "{counted:?}");
            assert!(counted.light_closest < all.light_closest, "{counted:?} of {all:?}");
            assert!(counted.light_lookups < all.light_lookups, "{counted:?} of {all:?}");
        }
    }
}

#[test]
fn one_transparent_instance_does_not_make_every_light_ray_look_for_its_closest_hit() {
    let options = RenderOptions::new(2 * TILE, 2 * TILE);
    let opaque = builder(None, 12).build().unwrap();
    let (_, before) = draw(&opaque, &options, false);
    assert_eq!((before.light_closest, before.light_lookups), (0, 0));
    // A pane where no light ray and no camera ray comes.
    let mut b = builder(None, 12);
    b.mesh(square(-9.0, 0.1), Material::matte([1.0; 3]).with_opacity(0.5));
    let scene = b.build().unwrap();
    let (_, after) = draw(&scene, &options, false);
    let (_, all) = draw(&scene, &options, true);
    assert!(Effects::required_by(&scene).contains(Effects::TRANSPARENCY));
    // Rays that something opaque ends are not asked again, and nothing is looked up.
    let sent = all.shadow + all.ambient_occlusion;
    let ended = all.shadow_blocked + all.ambient_occlusion_blocked;
    assert_eq!(after.shadow + after.ambient_occlusion, sent);
    assert_eq!(after.shadow_blocked + after.ambient_occlusion_blocked, ended);
    assert_eq!(after.light_lookups, 0, "surfaces looked up through which no light passes");
    assert_eq!(after.light_closest, sent - ended);
    assert_eq!((all.light_closest, all.light_lookups), (sent, ended));
    assert!(ended > 1000, "{all:?}");
}

#[test]
fn an_opaque_surface_blocks_light_where_a_transparent_one_coincides() {
    // A decal with the lower number on an opaque plate: whichever of the two is hit first, no light
    // may pass through the plate.
    for decal_first in [true, false] {
        let mut b = SceneBuilder::new();
        b.mesh(square(0.0, 3.0), Material::matte([1.0; 3]));
        let decal = Material::matte([1.0; 3]).with_opacity(0.25);
        let plate = Material::matte([1.0; 3]);
        let order = if decal_first { [decal, plate] } else { [plate, decal] };
        order.into_iter().for_each(|m| {
            b.mesh(square(1.0, 1.0), m);
        });
        b.light(Light::directional(DVec3::Z));
        let scene = b.build().unwrap();
        let mut options = RenderOptions::new(2 * TILE, 2 * TILE);
        options.max_bounces = Some(1);
        let (_, stats) = draw(&scene, &options, false);
        assert!(stats.shadow_blocked > 50, "{stats:?}");
        assert_eq!(stats.light_lookups, 0, "decal first: {decal_first}: {stats:?}");
    }
}
