//! Blend modes that are not a medium, and media that depend on gradients, against sums over many
//! small steps.
#![cfg(feature = "render")]

use rt_core::colormap::ColorMap;
use rt_core::glam::{DVec3, UVec3, Vec3};
use rt_core::grid::Grid;
use rt_core::ray::Ray;
use rt_core::transfer_function::TransferFunction;
use rt_core::volume::{
    Blend, GradientOpacity, Interpolation, Volume, VolumeLight, VolumeOptions, VolumeQuality,
    VolumeSample, VolumeShading, integrate_overlapping,
};
use std::sync::Arc;

const N: u32 = 12;
const QUALITY: VolumeQuality = VolumeQuality::Tolerance { levels: 0.1 };

fn grid() -> Arc<Grid> {
    let value = |i: u32| {
        let (x, y, z) = (i % N, i / N % N, i / N / N);
        let p = Vec3::new(x as f32, y as f32, z as f32);
        0.5 + 0.5 * (0.7 * p.x).sin() * (0.5 * p.y + 0.3 * p.z).cos()
    };
    let spacing = DVec3::new(1.0, 0.5, 2.0);
    Grid::new(UVec3::splat(N), DVec3::ZERO, spacing, (0..N * N * N).map(value).collect())
        .unwrap()
        .into()
}

/// Colours from blue to red, and a weight that grows with the scalar.
fn transfer() -> TransferFunction {
    let colors = ColorMap::new(vec![[0.0, 0.2, 1.0, 1.0], [1.0, 0.4, 0.0, 1.0]], [0.0, 1.0]);
    TransferFunction::new(colors, vec![[0.0, 0.0], [0.3, 0.1], [1.0, 0.8]]).unwrap()
}

fn volume(options: VolumeOptions) -> Volume {
    Volume::new(grid(), transfer(), options).unwrap()
}

fn rays() -> Vec<Ray> {
    let towards = |from: Vec3, to: Vec3| Ray::new(from, (to - from).normalize());
    (0..40)
        .map(|i| {
            let (a, b) = (i as f32 * 0.61, i as f32 * 0.37);
            let from = Vec3::new(5.5 + 20.0 * a.cos(), 2.75 + 20.0 * a.sin(), 11.0 + 9.0 * b.sin());
            towards(from, Vec3::new(5.5 + 2.0 * b.cos(), 2.75 + b.sin(), 11.0 + 3.0 * a.sin()))
        })
        .collect()
}

/// The scalars at many points along a ray, and the distance between them.
fn scalars(v: &Volume, ray: &Ray) -> (Vec<f32>, f64) {
    let size = v.bounds().max;
    let step = 1e-3f32;
    let points = (0..60_000).map(|i| ray.origin + ray.dir * (i as f32 * step));
    let inside = points.filter(|p| p.cmpge(Vec3::ZERO).all() && p.cmple(size).all());
    let index = |p: Vec3| p / v.grid().spacing().as_vec3();
    (inside.map(|p| v.grid().value(index(p))).collect(), step.into())
}

fn close(found: VolumeSample, expected: [f64; 4], by: f64, what: &str) {
    for (c, e) in expected.iter().enumerate() {
        assert!(
            (f64::from(found.rgba[c]) - e).abs() < by,
            "{what}: {:?}, not {expected:?}",
            found.rgba
        );
    }
}

#[test]
fn projections_agree_with_many_small_steps() {
    for ray in rays() {
        for blend in [Blend::Maximum, Blend::Minimum, Blend::Average, Blend::Additive] {
            let v = volume(VolumeOptions { blend: blend.clone(), ..VolumeOptions::default() });
            let (values, step) = scalars(&v, &ray);
            let (tf, length) = (v.transfer_function(), values.len() as f64 * step);
            let look = |s: f32| (tf.extinction(s.into()), tf.colors().lookup(s));
            let sum: [f64; 3] = std::array::from_fn(|c| {
                values.iter().map(|&s| look(s).0 * f64::from(look(s).1[c]) * step).sum()
            });
            let pick = |s: f32| {
                let (a, color) = look(s);
                [0, 1, 2, 3].map(|c| if c == 3 { a } else { a * f64::from(color[c]) })
            };
            let opaque = |c: [f64; 3]| [c[0].min(1.0), c[1].min(1.0), c[2].min(1.0), 1.0];
            let expected = match blend {
                Blend::Maximum => pick(values.iter().copied().fold(f32::NEG_INFINITY, f32::max)),
                Blend::Minimum => pick(values.iter().copied().fold(f32::INFINITY, f32::min)),
                Blend::Average => opaque(sum.map(|s| s / length)),
                _ => opaque(sum),
            };
            let found = v.integrate(&ray, 0.0, f32::INFINITY, &QUALITY);
            close(found, expected, 2e-3, &format!("{blend:?}"));
        }
    }
}

#[test]
fn surfaces_of_given_values_lie_one_behind_the_other() {
    let values = [0.35, 0.6, 0.8];
    let v = volume(VolumeOptions {
        blend: Blend::Isosurfaces(values.into()),
        ..VolumeOptions::default()
    });
    let mut met = 0;
    for ray in rays() {
        let (along, _) = scalars(&v, &ray);
        let (mut rgb, mut through) = ([0.0; 3], 1.0);
        for w in along.windows(2) {
            for s in values.iter().filter(|s| (w[0] < **s) != (w[1] < **s)) {
                met += 1;
                let (a, color) = (
                    v.transfer_function().extinction((*s).into()),
                    v.transfer_function().colors().lookup(*s),
                );
                (0..3).for_each(|c| rgb[c] += through * a * f64::from(color[c]));
                through *= 1.0 - a;
            }
        }
        let found = v.integrate(&ray, 0.0, f32::INFINITY, &QUALITY);
        close(found, [rgb[0], rgb[1], rgb[2], 1.0 - through], 3e-3, "surfaces");
    }
    assert!(met > 100, "{met}");
}

#[test]
fn a_surface_in_front_of_a_projection_ends_it() {
    let v = volume(VolumeOptions { blend: Blend::Maximum, ..VolumeOptions::default() });
    let ray = Ray::new(Vec3::new(-1.0, 2.6, 7.3), Vec3::X);
    let whole = v.integrate(&ray, 0.0, f32::INFINITY, &QUALITY).rgba;
    assert!(v.integrate(&ray, 0.0, 1.2, &QUALITY).rgba[3] < whole[3]);
    assert_eq!(v.integrate(&ray, 0.0, 0.9, &QUALITY), VolumeSample::CLEAR);
    let beside = Ray::new(Vec3::new(-1.0, 50.0, 7.3), Vec3::X);
    for blend in [Blend::Maximum, Blend::Average, Blend::Additive] {
        let v = volume(VolumeOptions { blend, ..VolumeOptions::default() });
        assert_eq!(v.integrate(&beside, 0.0, f32::INFINITY, &QUALITY), VolumeSample::CLEAR);
    }
}

#[test]
fn the_nearest_points_value_can_be_projected() {
    let interpolation = Interpolation::Nearest;
    let v =
        volume(VolumeOptions { blend: Blend::Maximum, interpolation, ..VolumeOptions::default() });
    // Along the points of one row.
    let ray = Ray::new(Vec3::new(-1.0, 1.5, 8.0), Vec3::X);
    let largest = (0..N).map(|i| v.grid().at(i, 3, 4)).fold(f32::NEG_INFINITY, f32::max);
    let expected = v.transfer_function().extinction(largest.into());
    assert!(
        (f64::from(v.integrate(&ray, 0.0, f32::INFINITY, &QUALITY).rgba[3]) - expected).abs()
            < 1e-6
    );
}

/// The gradient of this grid is the same everywhere.
fn ramp(options: VolumeOptions) -> Volume {
    let values = (0..8 * 8 * 8).map(|i| 0.1 * (i % 8) as f32).collect();
    let grid = Grid::new(UVec3::splat(8), DVec3::ZERO, DVec3::splat(2.0), values).unwrap();
    let white = ColorMap::new(vec![[1.0; 4]], [0.0, 1.0]);
    Volume::new(grid.into(), TransferFunction::new(white, vec![[0.0, 0.2]]).unwrap(), options)
        .unwrap()
}

#[test]
fn gradient_opacity_scales_the_extinction() {
    let ray = Ray::new(Vec3::new(3.0, -1.0, 4.0), Vec3::Y);
    // 0.05 per world unit, a quarter of the steepest.
    for (factors, expected) in [(vec![0.0, 1.0], 0.25f64), (vec![1.0, 0.0], 0.75), (vec![0.5], 0.5)]
    {
        let gradient_opacity = Some(GradientOpacity { factors: factors.into(), steepest: 0.2 });
        let v = ramp(VolumeOptions { gradient_opacity, ..VolumeOptions::default() });
        let opacity = 1.0 - (-0.2 * expected * 14.0).exp();
        let found = v.integrate(&ray, 0.0, f32::INFINITY, &QUALITY);
        close(found, [opacity; 4], 1e-5, "gradient opacity");
    }
}

#[test]
fn lights_of_several_colors_add_up() {
    let lights = vec![
        VolumeLight { direction: Some(Vec3::X), color: [0.5, 0.0, 0.0] },
        VolumeLight { direction: Some(Vec3::new(-1.0, 1.0, 0.0)), color: [0.0, 0.4, 0.0] },
        VolumeLight { direction: None, color: [0.0, 0.0, 0.9] },
    ];
    let shading = Some(VolumeShading { ambient: 0.1, diffuse: 0.8, ..VolumeShading::default() });
    let v = ramp(VolumeOptions { shading, lights, ..VolumeOptions::default() });
    let ray = Ray::new(Vec3::new(3.0, -1.0, 4.0), Vec3::Y);
    let found = v.integrate(&ray, 0.0, f32::INFINITY, &QUALITY);
    let a = 1.0 - (-0.2f64 * 14.0).exp();
    // The light at the viewer points along the ray, at right angles to the gradient.
    let factor = [0.1 + 0.8 * 0.5, 0.1 + 0.8 * 0.4 * 0.5f64.sqrt(), 0.1];
    close(found, [a * factor[0], a * factor[1], a * factor[2], a], 1e-4, "three lights");
}

#[test]
fn projections_and_media_are_put_one_behind_the_other() {
    let projection = volume(VolumeOptions { blend: Blend::Maximum, ..VolumeOptions::default() });
    let medium = volume(VolumeOptions::default());
    let ray = Ray::new(Vec3::new(-3.0, 2.6, 7.3), Vec3::X);
    let behind = Ray::new(Vec3::new(-30.0, 2.6, 7.3), Vec3::X);
    let [front, back] = [
        projection.integrate(&ray, 0.0, f32::INFINITY, &QUALITY),
        medium.integrate(&behind, 0.0, f32::INFINITY, &QUALITY),
    ];
    let both = integrate_overlapping(
        &[(&medium, behind), (&projection, ray)],
        0.0,
        f32::INFINITY,
        &QUALITY,
    );
    let through = 1.0 - front.rgba[3];
    let expected: [f64; 4] =
        std::array::from_fn(|c| f64::from(front.rgba[c] + through * back.rgba[c]));
    close(both, expected, 1e-6, "two volumes");
}

#[test]
fn bad_options_are_named() {
    let fault =
        |options: VolumeOptions| Volume::new(grid(), transfer(), options).unwrap_err().to_string();
    let lights = vec![VolumeLight { direction: Some(Vec3::ZERO), color: [1.0; 3] }];
    assert!(fault(VolumeOptions { lights, ..VolumeOptions::default() }).contains("lights"));
    let gradient_opacity = Some(GradientOpacity { factors: Vec::new().into(), steepest: 1.0 });
    assert!(
        fault(VolumeOptions { gradient_opacity, ..VolumeOptions::default() })
            .contains("gradient opacity")
    );
    let blend = Blend::Isosurfaces([f32::NAN].into());
    assert!(fault(VolumeOptions { blend, ..VolumeOptions::default() }).contains("isosurface"));
}
