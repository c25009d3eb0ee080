//! Frames are shaded with the world's instruction set, and every one gives the same bits.
#![cfg(feature = "render")]

mod scenes_common;
use rt_core::bvh::BuildOptions;
use rt_core::colormap::ColorMap;
use rt_core::environment::Environment;
use rt_core::frame::Layers;
use rt_core::glam::{DVec3, UVec3, Vec3};
use rt_core::grid::Grid;
use rt_core::light::Light;
use rt_core::material::Material;
use rt_core::render::RenderOptions;
use rt_core::scene::{AmbientOcclusion, Scene, SceneBuilder};
use rt_core::simd::SimdLevel;
use rt_core::transfer_function::TransferFunction;
use rt_core::volume::{Volume, VolumeOptions, VolumeShading};
use scenes_common::*;

const N: u32 = 48;

/// Draws the scene that `make` builds at each level.
fn expect_same_bits(
    what: &str,
    options: &RenderOptions,
    make: impl Fn(Option<SimdLevel>) -> Scene,
) {
    let camera = camera(DVec3::new(6.0, 1.0, 2.0), 0.6);
    let best = draw(&make(None), &camera, options.clone());
    let colors = |o: &rt_core::render::RenderOutput| -> Vec<[u32; 4]> {
        o.frame.color.iter().map(|c| c.map(f32::to_bits)).collect()
    };
    assert!(best.frame.color.iter().any(|c| c[0] > 0.1 && c[0] < 0.9), "{what}: something to see");
    for level in SimdLevel::available() {
        let o = draw(&make(Some(level)), &camera, options.clone());
        assert_eq!(colors(&o), colors(&best), "{what}: {}", level.name());
        assert_eq!(o.frame.depth, best.frame.depth, "{what}: {}", level.name());
    }
}

fn builder(level: Option<SimdLevel>) -> SceneBuilder {
    let mut b = SceneBuilder::new();
    b.build_options = BuildOptions { simd: level, ..BuildOptions::default() };
    b
}

#[test]
fn surfaces_have_the_same_bits_with_every_instruction_set() {
    let ball = |y: f32| sphere(Vec3::new(0.0, y, 0.0), 0.5, 16);
    let make = |clear: bool| {
        move |level| {
            let mut b = builder(level);
            b.mesh(floor(-0.6, 4.0), Material::pbr([0.8, 0.7, 0.6], 0.0, 0.4));
            b.mesh(ball(0.9), Material::phong([0.6, 0.7, 0.8], 0.4, 30.0));
            b.mesh(ball(-0.9), Material::metal([0.9, 0.6, 0.3], 0.3));
            b.mesh(ball(0.0), Material::matte([0.3, 0.5, 0.9]));
            if clear {
                b.mesh(sphere(Vec3::new(1.5, 0.4, 0.0), 0.4, 12), Material::dielectric(1.5));
                let veil = quad(Vec3::new(2.0, -0.5, 0.0), Vec3::Y * 0.5, Vec3::Z * 0.5);
                b.mesh(veil, Material::matte([0.9, 0.2, 0.2]).with_opacity(0.5));
            }
            b.light(Light::point(DVec3::new(3.0, 2.0, 4.0)));
            b.light(Light::spot(DVec3::new(2.0, -3.0, 3.0), DVec3::new(-2.0, 3.0, -3.0), 0.5));
            b.light(Light::disk(DVec3::new(0.0, 0.0, 5.0), DVec3::NEG_Z, 0.6));
            b.light(Light::ambient([0.2; 3]));
            let mut scene = b.build().unwrap();
            let up = Vec3::Z;
            scene.environment =
                Some(Environment::Gradient { bottom: [0.1; 3], top: [0.5, 0.6, 0.8], up });
            scene.ambient_occlusion = Some(AmbientOcclusion { distance: 2.0, rays: 8 });
            scene
        }
    };
    let options = RenderOptions { layers: Layers::ALL, ..RenderOptions::new(N, N) };
    expect_same_bits("opaque", &options, make(false));
    expect_same_bits("glass and a veil", &options, make(true));
    let paths = RenderOptions { path_tracing: true, samples: 2, ..options };
    expect_same_bits("paths", &paths, make(true));
}

#[test]
fn volumes_have_the_same_bits_with_every_instruction_set() {
    let n = 20;
    let values = (0..n * n * n).map(|i| {
        let p = Vec3::new((i % n) as f32, (i / n % n) as f32, (i / n / n) as f32);
        0.5 + 0.25 * ((0.6 * p.x).sin() * (0.5 * p.y).cos() + (0.8 * p.z).sin())
    });
    let (origin, spacing) = (DVec3::splat(-1.0), DVec3::splat(2.0 / f64::from(n - 1)));
    let grid = Grid::new(UVec3::splat(n), origin, spacing, values.collect()).unwrap();
    let grid = std::sync::Arc::new(grid);
    let colors = ColorMap::new(
        vec![[0.1, 0.2, 1.0, 1.0], [0.9, 1.0, 0.1, 1.0], [1.0, 0.1, 0.1, 1.0]],
        [0.0, 1.0],
    );
    // Knots that many cells contain.
    let opacity = [[0.3, 0.0], [0.45, 0.3], [0.5, 0.05], [0.62, 0.6], [0.7, 0.1]];
    let transfer = TransferFunction::from_opacity(colors, &opacity, 0.2).unwrap();
    let lit = VolumeShading {
        ambient: 0.2,
        diffuse: 0.7,
        specular: 0.5,
        shininess: 12.0,
        ..VolumeShading::default()
    };
    for shading in [None, Some(lit)] {
        for sample_distance in [None, Some(0.05)] {
            let options = VolumeOptions { shading, sample_distance, ..VolumeOptions::default() };
            let make = |level| {
                let volume = Volume::new(grid.clone(), transfer.clone(), options.clone()).unwrap();
                let mut b = builder(level);
                b.mesh(floor(-1.1, 2.0), Material::matte([0.7; 3]));
                b.light(Light::point(DVec3::new(3.0, 2.0, 4.0)));
                b.volume(volume.with_simd_level(level).unwrap());
                b.build().unwrap()
            };
            let what = format!("lit {}, samples {sample_distance:?}", shading.is_some());
            expect_same_bits(&what, &RenderOptions::new(N, N), make);
        }
    }
}
