//! Volumes in images: before, between and behind surfaces.
#![cfg(feature = "render")]

mod scenes_common;
use rt_core::colormap::ColorMap;
use rt_core::effects::Effects;
use rt_core::glam::{DVec3, UVec3};
use rt_core::grid::Grid;
use rt_core::light::Light;
use rt_core::material::Material;
use rt_core::render::{RenderError, RenderOptions, render};
use rt_core::scene::SceneBuilder;
use rt_core::transfer_function::TransferFunction;
use rt_core::volume::{Volume, VolumeOptions, VolumeShading};
use scenes_common::*;

/// White fog in a box of 4 x 4 x `height`: half of the light passes one unit of length.
fn fog(origin: DVec3, height: f64) -> Volume {
    let grid =
        Grid::new(UVec3::splat(2), origin, DVec3::new(4.0, 4.0, height), vec![0.5; 8]).unwrap();
    let white = ColorMap::new(vec![[1.0; 4]], [0.0, 1.0]);
    Volume::new(
        grid.into(),
        TransferFunction::from_opacity(white, &[[0.0, 0.5]], 1.0).unwrap(),
        VolumeOptions::default(),
    )
    .unwrap()
}

#[test]
fn fog_in_front_of_behind_and_between_surfaces() {
    // Fog from z = 0 to 2 (a quarter passes); an unlit black floor at z = 1 or -1, opaque or not.
    for (z, opacity, expected) in [
        (-1.0, 1.0, [0.75, 1.0]),
        (1.0, 1.0, [0.5, 1.0]),
        // 0.5 fog, then half of the floor (black), then half of the rest of the fog, and nothing
        // behind.
        (1.0, 0.5, [0.5 + 0.25 * 0.5, 0.5 + 0.25 + 0.25 * 0.5]),
        (3.0, 1.0, [0.0, 1.0]),
    ] {
        let mut b = SceneBuilder::new();
        b.mesh(floor(z, 5.0), Material::unlit([0.0; 3]).with_opacity(opacity));
        b.volume(fog(DVec3::new(-2.0, -2.0, 0.0), 2.0));
        let o = draw(&b.build().unwrap(), &top_camera(6.0, 2.0), RenderOptions::new(8, 8));
        let p = o.frame.color_at(4, 4);
        assert!(
            (p[0] - expected[0]).abs() < 1e-3 && (p[3] - expected[1]).abs() < 1e-3,
            "z = {z}: {p:?}"
        );
        assert!(o.report.effects.contains(Effects::VOLUMES));
        assert_eq!(o.report.rays.volume > 0, z < 2.0);
    }
}

#[test]
fn volume_alone_is_drawn_at_any_offset() {
    for offset in [0.0, 3e7] {
        let mut b = SceneBuilder::new();
        b.volume(fog(DVec3::new(offset - 2.0, -2.0, 0.0), 2.0));
        let at = DVec3::X * offset;
        let c = rt_core::camera::Camera::perspective(
            at + DVec3::Z * 9.0,
            at,
            DVec3::Y,
            0.1,
            1.0,
            [0.1, 100.0],
        )
        .unwrap();
        let o = draw(&b.build().unwrap(), &c, RenderOptions::new(8, 8));
        assert!(
            o.frame.color.iter().all(|p| (p[3] - 0.75).abs() < 3e-3),
            "{:?}",
            o.frame.color_at(4, 4)
        );
    }
}

#[test]
fn unsupported_and_partial_requests_are_named() {
    let mut b = SceneBuilder::new();
    b.mesh(floor(-1.0, 5.0), Material::matte([1.0; 3]));
    b.light(Light::directional(DVec3::Z));
    b.volume(fog(DVec3::new(-2.0, -2.0, 0.0), 2.0));
    let s = b.build().unwrap();
    let options = RenderOptions { path_tracing: true, ..RenderOptions::new(8, 8) };
    let e = render(&s, &top_camera(6.0, 2.0), &options).unwrap_err();
    assert!(matches!(e, RenderError::Unsupported { what: "path tracing", .. }), "{e}");
    let o = draw(&s, &top_camera(6.0, 2.0), RenderOptions::new(8, 8));
    assert!(
        o.report.warnings.iter().any(|w| w.contains("volumes cast no shadows")),
        "{:?}",
        o.report.warnings
    );
    // Left out: the image equals that without the volume.
    let o = draw(
        &s,
        &top_camera(6.0, 2.0),
        RenderOptions { effects: Some(Effects::SHADOWS), ..RenderOptions::new(8, 8) },
    );
    assert_eq!(o.frame.color_at(4, 4), [1.0; 4]);
    assert_eq!(o.report.rays.volume, 0);
    assert!(o.report.warnings.iter().any(|w| w.starts_with("volumes left out")));
}

/// Waves in a box of 4 x 4 x 2, lit from the viewer.
fn lit_waves(sample_distance: Option<f64>) -> Volume {
    let dims = UVec3::new(17, 17, 9);
    let values = (0..dims.element_product()).map(|i| {
        let [x, y, z] = [i % 17, i / 17 % 17, i / 289].map(|n| n as f32);
        0.5 + 0.3 * (0.7 * x).sin() * (0.5 * y).cos() + 0.2 * (0.6 * z).sin()
    });
    let corner = DVec3::new(-2.0, -2.0, 0.0);
    let grid = Grid::new(dims, corner, DVec3::splat(0.25), values.collect()).unwrap();
    let colors = ColorMap::new(vec![[0.1, 0.3, 0.9, 1.0], [0.9, 0.4, 0.1, 1.0]], [0.0, 1.0]);
    let transfer =
        TransferFunction::from_opacity(colors, &[[0.0, 0.0], [0.4, 0.0], [1.0, 0.6]], 1.0);
    let shading = Some(VolumeShading { ambient: 0.3, diffuse: 0.6, ..VolumeShading::default() });
    let options = VolumeOptions { shading, sample_distance, ..VolumeOptions::default() };
    Volume::new(grid.into(), transfer.unwrap(), options).unwrap()
}

/// Samples are taken for a wavefront at a time, and once more behind a translucent surface.
#[test]
fn samples_in_frames_converge_to_the_integral_with_any_number_of_threads() {
    let image = |sample_distance, threads| {
        let mut b = SceneBuilder::new();
        let floor = floor(1.0, 1.5);
        b.mesh(floor, Material::unlit([0.2, 0.9, 0.2]).with_opacity(0.5));
        b.volume(lit_waves(sample_distance));
        let scene = b.build().unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let frame = || draw(&scene, &top_camera(6.0, 2.0), RenderOptions::new(67, 45)).frame;
        pool.install(frame).color
    };
    let integrated = image(None, 1);
    let fine = image(Some(0.002), 2);
    for (a, b) in integrated.iter().zip(&fine) {
        for c in 0..4 {
            // Half a level from the integral, one from the light that a ray leaves behind.
            assert!((a[c] - b[c]).abs() < 1.7 / 255.0, "{a:?} {b:?}");
        }
    }
    let coarse = image(Some(0.25), 1);
    assert_eq!(coarse, image(Some(0.25), 3));
    assert_ne!(coarse, integrated, "the distance is used");
}
