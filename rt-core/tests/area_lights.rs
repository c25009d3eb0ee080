//! Area lights against the irradiance of polygons and rings, and panoramas.
#![cfg(feature = "render")]

mod scenes_common;
use rt_core::camera::{Camera, CameraError, ThinLens};
use rt_core::frame::Layers;
use rt_core::glam::DVec3;
use rt_core::light::{Light, LightKind};
use rt_core::material::Material;
use rt_core::render::RenderOptions;
use rt_core::scene::{SceneBuilder, SceneError};
use scenes_common::*;
use std::f64::consts::PI;

/// Radiance of a white matte floor at the origin under `lights`, with this many shadow rays per
/// light.
fn floor_under(light: Light, rays: u32) -> f64 {
    let mut options = RenderOptions::new(8, 8);
    options.light_rays = rays;
    options.samples = 16;
    let s = scene(vec![(floor(0.0, 1.0), Material::matte([1.0; 3]))], vec![light]);
    mean_red(&draw(&s, &top_camera(9.0, 0.001), options))
}

/// Irradiance over π at the origin with normal z from a polygon of radiance 1 (Lambert 1760: half
/// the sum over the edges of the angle times the normal of the plane through edge and point).
fn polygon(corners: &[DVec3]) -> f64 {
    let n = corners.len();
    let edge = |i: usize| {
        let (a, b) = (corners[i].normalize(), corners[(i + 1) % n].normalize());
        a.dot(b).clamp(-1.0, 1.0).acos() * a.cross(b).normalize().z
    };
    ((0..n).map(edge).sum::<f64>() / (2.0 * PI)).abs()
}

#[test]
fn quadrangles_light_as_lambert_s_formula_says() {
    let cases = [
        (DVec3::new(-0.5, -0.5, 1.0), [DVec3::Y, DVec3::X]),
        (DVec3::new(0.4, -1.0, 0.7), [DVec3::new(0.1, 2.0, 0.2), DVec3::new(0.8, 0.3, 0.4)]),
    ];
    for (corner, edges @ [a, b]) in cases {
        let area = a.cross(b).length();
        let radiance_one = [(area / PI) as f32; 3];
        let light = Light::quad(corner, edges).with_color(radiance_one);
        let found = floor_under(light, 64);
        let expected = polygon(&[corner, corner + a, corner + a + b, corner + b]);
        assert!((found - expected).abs() < 0.004 * expected, "{found} instead of {expected}");
        // The back is dark unless it also emits.
        let back = Light::quad(corner, [b, a]).with_color(radiance_one);
        assert_eq!(floor_under(back, 4), 0.0);
        let kind = LightKind::Quad { corner, edges: [b, a], both_sides: true };
        let both = floor_under(Light { kind, ..back }, 64);
        assert!((both - expected).abs() < 0.004 * expected, "{both} instead of {expected}");
    }
}

#[test]
fn rings_light_as_a_disk_less_its_hole() {
    let h = 1.5;
    for (inner_radius, radius) in [(0.0, 1.0), (0.6, 1.0), (0.95, 2.0)] {
        let kind = LightKind::Ring {
            position: DVec3::new(0.0, 0.0, h),
            direction: -DVec3::Z,
            inner_radius,
            radius,
            inner_rad: 0.5 * PI,
            outer_rad: 0.5 * PI,
        };
        let area = PI * (radius * radius - inner_radius * inner_radius);
        let light = Light { kind, ..Light::quad(DVec3::ZERO, [DVec3::X, DVec3::Y]) };
        let found = floor_under(light.with_color([(area / PI) as f32; 3]), 64);
        let disk = |r: f64| r * r / (r * r + h * h);
        let expected = disk(radius) - disk(inner_radius);
        assert!((found - expected).abs() < 0.004 * expected, "{found} instead of {expected}");
    }
    // No light outside the cone.
    let kind = LightKind::Ring {
        position: DVec3::new(3.0, 0.0, h),
        direction: -DVec3::Z,
        inner_radius: 0.0,
        radius: 0.01,
        inner_rad: 0.2,
        outer_rad: 0.5,
    };
    assert_eq!(floor_under(Light { kind, ..Light::point(DVec3::ZERO) }, 4), 0.0);
}

#[test]
fn lights_without_an_area_are_named() {
    let mut b = SceneBuilder::new();
    b.light(Light::quad(DVec3::ZERO, [DVec3::X, DVec3::X * 2.0]));
    let mesh = floor(0.0, 1.0);
    b.mesh(mesh, Material::matte([1.0; 3]));
    let Err(SceneError::OutOfRange { what, field, .. }) = b.build().and_then(|s| s.check()) else {
        panic!("a quadrangle without an area")
    };
    assert_eq!((what, field), ("light", "edge 1 x edge 2"));
}

#[test]
fn panoramas_see_all_around() {
    // Balls at distance 4 along the axes, each of a different colour. The view goes along -y, up is
    // z.
    let eye = DVec3::new(1.0, 2.0, 3.0);
    let around = [
        (-DVec3::Y, [0.5, 0.5]),
        (-DVec3::X, [0.75, 0.5]),
        (DVec3::X, [0.25, 0.5]),
        (DVec3::Y, [0.0, 0.5]),
        (DVec3::Z, [0.5, 1.0]),
        (-DVec3::Z, [0.5, 0.0]),
    ];
    let color = |i: usize| [i as f32 / 8.0, 1.0 - i as f32 / 8.0, 0.5];
    let parts = around
        .iter()
        .enumerate()
        .map(|(i, (d, _))| (sphere((eye + *d * 4.0).as_vec3(), 1.0, 32), Material::unlit(color(i))))
        .collect();
    let s = scene(parts, vec![]);
    let whole =
        Camera::omnidirectional(eye, eye - DVec3::Y, DVec3::Z, [[0.0; 2], [1.0; 2]]).unwrap();
    let (w, h) = (64, 32);
    let mut options = RenderOptions::new(w, h);
    options.layers = Layers::COLOR | Layers::DISTANCE | Layers::DEPTH;
    let out = draw(&s, &whole, options.clone()).frame;
    for (i, (_, [x, y])) in around.iter().enumerate() {
        let column = ((x * f64::from(w)) as u32).min(w - 1);
        let row = (((1.0 - y) * f64::from(h)) as u32).min(h - 1);
        assert_eq!(
            out.color_at(column, row)[..3],
            color(i),
            "ball {i} in column {column}, row {row}"
        );
        let at = (row * w + column) as usize;
        assert!((out.distance[at] - 3.0).abs() < 0.05, "ball {i}: {}", out.distance[at]);
        assert!(
            (f64::from(out.depth[at]) - (1.0 - 1.0 / (1.0 + f64::from(out.distance[at])))).abs()
                < 1e-6
        );
    }
    // A ball of angular radius asin(1/4) covers its solid angle.
    let (fine_w, fine_h) = (512, 256);
    let fine = draw(&s, &whole, RenderOptions::new(fine_w, fine_h)).frame;
    let pixel = (PI / f64::from(fine_h)) * (2.0 * PI / f64::from(fine_w));
    let covered: f64 = (0..fine_h)
        .flat_map(|y| (0..fine_w).map(move |x| (x, y)))
        .filter(|&(x, y)| fine.color_at(x, y)[3] > 0.0)
        .map(|(_, y)| ((f64::from(y) + 0.5) / f64::from(fine_h) * PI).sin() * pixel)
        .sum();
    let expected = 6.0 * 2.0 * PI * (1.0 - (1.0f64 / 4.0).asin().cos());
    assert!((covered - expected).abs() < 0.02 * expected, "{covered} sr instead of {expected}");
    // A part of it emits only that part, also with bounces and samples.
    let part =
        Camera::omnidirectional(eye, eye - DVec3::Y, DVec3::Z, [[0.5, 0.25], [1.0, 0.75]]).unwrap();
    let crop = draw(
        &s,
        &part,
        RenderOptions { layers: Layers::COLOR, ..RenderOptions::new(w / 2, h / 2) },
    )
    .frame;
    for y in 0..h / 2 {
        for x in 0..w / 2 {
            assert_eq!(crop.color_at(x, y), out.color_at(x + w / 2, y + h / 4), "{x}, {y}");
        }
    }
    let lens = ThinLens { aperture_radius: 0.1, focus_distance: 1.0 };
    assert_eq!(whole.with_lens(lens), Err(CameraError::LensOnParallel));
    assert!(Camera::omnidirectional(eye, eye, DVec3::Z, [[0.0; 2], [1.0; 2]]).is_err());
    assert!(
        Camera::omnidirectional(eye, eye + DVec3::X, DVec3::Z, [[0.0; 2], [0.0, 1.0]]).is_err()
    );
    assert!(whole.eye() == Some(eye) && (whole.forward() + DVec3::Y).length() < 1e-12);
}
