//! Direct volume rendering against closed forms and the slow reference.
#![cfg(feature = "render")]

mod shapes_common;

use glam::{DVec3, UVec3, Vec3};
use rt_core::colormap::ColorMap;
use rt_core::grid::Grid;
use rt_core::ray::Ray;
use rt_core::simd::SimdLevel;
use rt_core::transfer_function::TransferFunction;
use rt_core::volume::{
    Interpolation, Volume, VolumeError, VolumeOptions, VolumeQuality, VolumeSample, VolumeShading,
    integrate_overlapping, integrate_reference,
};
use shapes_common::Random;

const INF: f32 = f32::INFINITY;

fn grid(n: u32, spacing: f64, f: impl Fn(Vec3) -> f32) -> Grid {
    let at = |i: u32| Vec3::new((i % n) as f32, (i / n % n) as f32, (i / n / n) as f32);
    Grid::new(
        UVec3::splat(n),
        DVec3::ZERO,
        DVec3::splat(spacing),
        (0..n * n * n).map(|i| f(at(i))).collect(),
    )
    .unwrap()
}

fn single(color: [f32; 3]) -> ColorMap {
    ColorMap::new(vec![[color[0], color[1], color[2], 1.0]], [0.0, 1.0])
}

fn rainbow() -> ColorMap {
    ColorMap::new(
        vec![
            [0.0, 0.1, 1.0, 1.0],
            [0.0, 1.0, 0.2, 1.0],
            [1.0, 0.9, 0.0, 1.0],
            [1.0, 0.0, 0.1, 1.0],
        ],
        [-1.0, 1.0],
    )
}

fn volume(g: Grid, colors: ColorMap, extinction: &[[f32; 2]]) -> Volume {
    let tf = TransferFunction::new(colors, extinction.to_vec()).unwrap();
    Volume::new(g.into(), tf, VolumeOptions::default()).unwrap()
}

fn tolerance(levels: f32) -> VolumeQuality {
    VolumeQuality::Tolerance { levels }
}

fn over(front: &VolumeSample, back: &VolumeSample) -> [f32; 4] {
    std::array::from_fn(|c| front.rgba[c] + (1.0 - front.rgba[3]) * back.rgba[c])
}

fn worst(a: [f32; 4], b: [f64; 4]) -> f64 {
    (0..4).map(|c| (f64::from(a[c]) - b[c]).abs()).fold(0.0, f64::max)
}

/// Fields: a smooth one, and noise whose gradient reverses in every cell.
fn fields() -> [Grid; 2] {
    let mut rng = Random::new(1);
    let noise: Vec<f32> = (0..12 * 12 * 12).map(|_| rng.range(-1.0, 1.0)).collect();
    let smooth =
        |p: Vec3| (p.x * 0.9).sin() * (p.y * 0.7 + 0.3).cos() * (0.4 + 0.6 * (p.z * 0.5).sin());
    [grid(12, 1.0, smooth), grid(12, 1.0, |p| noise[(p.x + 12.0 * (p.y + 12.0 * p.z)) as usize])]
}

fn transfers() -> Vec<Vec<[f32; 2]>> {
    vec![
        vec![[-1.0, 0.0], [1.0, 0.5]], // ramp
        vec![[-1.0, 0.0], [0.1, 0.0], [0.1, 2.0], [0.4, 2.0], [0.4, 0.05]], // steps
        vec![[0.0, 0.0], [0.29, 0.0], [0.3, 30.0], [0.31, 0.0]], // thin shell
        vec![[-1.0, 5.0], [0.0, 0.0], [1.0, 5.0]], // dense
    ]
}

fn rays(rng: &mut Random, n: usize) -> Vec<Ray> {
    let mut all = Vec::new();
    for k in 0..n {
        let target = 5.5 + 5.0 * rng.cube();
        let origin = 5.5 + [20.0, 3.0][k % 2] * rng.unit_vector();
        all.push(Ray::new(origin, (target - origin) * [1.0, 0.01, 50.0][k % 3]));
    }
    // In grid planes, along grid lines and diagonals, with both signs of zero.
    for z in [0.0f32, -0.0] {
        all.push(Ray::new(Vec3::new(-3.0, 4.0, 7.0), Vec3::new(1.0, z, -z)));
        all.push(Ray::new(Vec3::new(14.0, 0.0, 11.0), Vec3::new(-0.5, z, z)));
        all.push(Ray::new(Vec3::new(-1.0, -1.0, 3.5), Vec3::new(1.0, 1.0, z)));
        all.push(Ray::new(Vec3::splat(-2.0), Vec3::ONE));
    }
    all
}

#[test]
fn a_homogeneous_medium_follows_beer_and_lambert_at_all_scales() {
    for spacing in [1e-6f64, 1e-3, 1.0, 1e3, 1e6] {
        let sigma = (0.3 / spacing) as f32;
        let v = volume(
            grid(9, spacing, |_| 0.5),
            single([0.2, 0.5, 1.0]),
            &[[0.0, sigma], [1.0, sigma]],
        );
        let h = spacing as f32;
        for (dir, path) in [
            (Vec3::X, 8.0),
            (Vec3::new(0.0, -0.0, -4.0), 8.0),
            (Vec3::new(1.0, 1.0, 0.0), 8.0 * 2f64.sqrt()),
        ] {
            let ray = Ray::new(h * (Vec3::splat(4.0) - 10.0 * dir), h * dir);
            let s = v.integrate(&ray, 0.0, INF, &tolerance(0.01));
            let alpha = 1.0 - (-0.3 * path).exp();
            assert!(
                worst(s.rgba, [0.2 * alpha, 0.5 * alpha, alpha, alpha]) < 1e-5,
                "{spacing} {dir}: {:?}",
                s.rgba
            );
            // Half of the light is gone after ln 2 / 0.3 = 2.31 cells.
            let entry = 10.0 - 0.5 * path / f64::from(dir.length());
            let half = entry + 2f64.ln() / 0.3 / f64::from(dir.length());
            assert!((f64::from(s.depth) - half).abs() < 1e-4 * half, "{} {half}", s.depth);
        }
    }
}

#[test]
fn a_linear_ramp_has_its_closed_form() {
    // Scalar x on 0..=8, extinction 0.1·x, so the optical thickness from 0 to L is 0.05·L².
    let v = volume(grid(9, 1.0, |p| p.x), single([1.0; 3]), &[[0.0, 0.0], [8.0, 0.8]]);
    let ray = Ray::new(Vec3::new(-1.0, 3.3, 4.4), Vec3::X);
    for end in [1.5f32, 3.0, 6.25, 9.0] {
        let s = v.integrate(&ray, 0.0, end, &tolerance(0.1));
        let alpha = 1.0 - (-0.05 * (f64::from(end) - 1.0).powi(2)).exp();
        assert!((f64::from(s.rgba[3]) - alpha).abs() < 2e-6, "{end}: {} {alpha}", s.rgba[3]);
    }
}

#[test]
fn errors_stay_below_the_tolerance() {
    let mut rng = Random::new(2);
    let rays = rays(&mut rng, 12);
    for (f, g) in fields().into_iter().enumerate() {
        for (k, tf) in transfers().iter().enumerate() {
            let v = volume(g.clone(), rainbow(), tf);
            let references: Vec<_> =
                rays.iter().map(|r| integrate_reference(&v, r, 0.0, INF, 1.0 / 3000.0)).collect();
            let mut samples = Vec::new();
            for levels in [4.0, 1.0, 0.25, 0.06] {
                let mut error = 0f64;
                let mut count = 0;
                for (ray, exact) in rays.iter().zip(&references) {
                    let s = v.integrate(ray, 0.0, INF, &tolerance(levels));
                    error = error.max(worst(s.rgba, *exact));
                    count += s.samples;
                }
                // The reference's own error: its steps are 1/2000 voxel, worst at steps of the
                // transfer function.
                let allowed = f64::from(levels) / 255.0 + 2e-4;
                assert!(
                    error <= allowed,
                    "field {f} transfer {k} levels {levels}: {error} > {allowed}"
                );
                println!(
                    "field {f} tf {k}: {levels} levels, worst {:.4} levels, {} samples/ray",
                    error * 255.0,
                    count / rays.len() as u32
                );
                samples.push(count);
            }
            assert!(
                samples[3] > samples[0],
                "a tighter tolerance must take more samples: {samples:?}"
            );
        }
    }
}

#[test]
fn fixed_steps_converge_to_the_reference_and_miss_thin_shells_when_coarse() {
    let mut rng = Random::new(3);
    let rays = rays(&mut rng, 8);
    let [smooth, _] = fields();
    let ramp = volume(smooth.clone(), rainbow(), &transfers()[0]);
    let error = |v: &Volume, q: &VolumeQuality| {
        rays.iter()
            .map(|r| {
                worst(v.integrate(r, 0.0, INF, q).rgba, integrate_reference(v, r, 0.0, INF, 0.001))
            })
            .fold(0.0, f64::max)
    };
    let (coarse, fine) = (
        error(&ramp, &VolumeQuality::Step { voxels: 1.0 }),
        error(&ramp, &VolumeQuality::Step { voxels: 0.05 }),
    );
    assert!(fine < 1e-4 && coarse < 0.05, "{coarse} {fine}");
    let shell = volume(smooth, rainbow(), &transfers()[2]);
    let (stepped, adaptive) =
        (error(&shell, &VolumeQuality::Step { voxels: 0.5 }), error(&shell, &tolerance(1.0)));
    assert!(stepped > 0.1 && adaptive < 1.2 / 255.0, "{stepped} {adaptive}");
}

#[test]
fn pieces_compose_to_the_whole_with_surfaces_between() {
    let mut rng = Random::new(4);
    for g in fields() {
        let v = volume(g, rainbow(), &transfers()[1]);
        for ray in rays(&mut rng, 30) {
            let q = tolerance(0.2);
            let whole = v.integrate(&ray, 0.0, INF, &q);
            let length = ray.dir.length();
            let cut = rng.range(15.0, 25.0) / length;
            let (a, b) = (v.integrate(&ray, 0.0, cut, &q), v.integrate(&ray, cut, INF, &q));
            let both = over(&a, &b);
            assert!(
                worst(both, whole.rgba.map(f64::from)) < 0.6 / 255.0,
                "{both:?} {:?}",
                whole.rgba
            );
            // The ray's own range applies, too.
            let limited = v.integrate(&ray.with_t_max(cut), 0.0, INF, &q);
            assert_eq!(limited, a);
            // The same call gives the same bits.
            assert_eq!(v.integrate(&ray, 0.0, cut, &q), a);
        }
    }
}

#[test]
fn empty_space_costs_no_samples_and_opaque_media_end_the_ray() {
    let ball = |p: Vec3| 1.0 - (p - 20.0).length() / 8.0;
    let g = grid(41, 1.0, ball);
    let v = volume(g.clone(), rainbow(), &[[0.0, 0.0], [0.2, 0.05]]);
    let r = v.report();
    assert!(r.macrocells == 125 && r.macrocells_clear > 60, "{r:?}");
    let q = VolumeQuality::default();
    assert_eq!(
        v.integrate(&Ray::new(Vec3::new(-5.0, 3.0, 3.0), Vec3::X), 0.0, INF, &q),
        VolumeSample::CLEAR
    );
    let through = v.integrate(&Ray::new(Vec3::new(-5.0, 20.2, 20.3), Vec3::X), 0.0, INF, &q);
    assert!(through.samples > 0 && through.rgba[3] > 0.3);
    let dense = volume(g, rainbow(), &[[0.0, 0.0], [0.2, 50.0]]);
    let stopped = dense.integrate(&Ray::new(Vec3::new(-5.0, 20.2, 20.3), Vec3::X), 0.0, INF, &q);
    assert!(stopped.rgba[3] > 0.999 && stopped.rgba[3] < 1.0, "{stopped:?} {through:?}");
    assert!(
        stopped.depth > 17.0 && stopped.depth < 18.5,
        "in front of the ball: {}",
        stopped.depth
    );
}

#[test]
fn another_transfer_function_makes_other_blocks_empty() {
    let mut v = volume(grid(17, 1.0, |p| p.x), rainbow(), &[[12.0, 0.0], [13.0, 1.0]]);
    assert_eq!(v.report().macrocells_clear, 4);
    v.set_transfer_function(
        TransferFunction::new(rainbow(), vec![[0.0, 1.0], [1.0, 0.0]]).unwrap(),
    );
    assert_eq!(v.report().macrocells_clear, 4);
    let s = v.integrate(&Ray::new(Vec3::new(-1.0, 3.0, 3.0), Vec3::X), 0.0, INF, &tolerance(0.1));
    assert!((f64::from(s.rgba[3]) - (1.0 - (-0.5f64).exp())).abs() < 1e-4);
}

#[test]
fn nan_values_are_transparent_and_counted() {
    let mut g = grid(9, 1.0, |_| 0.5);
    let i = g.index(4, 4, 4);
    g.values_mut()[i] = f32::NAN;
    let v = volume(g, single([1.0; 3]), &[[0.0, 0.1]]);
    assert_eq!(v.report().cells_non_finite, 8);
    let s = v.integrate(&Ray::new(Vec3::new(-1.0, 4.5, 4.5), Vec3::X), 0.0, INF, &tolerance(0.1));
    assert!(
        (f64::from(s.rgba[3]) - (1.0 - (-0.6f64).exp())).abs() < 1e-5,
        "six of eight cells: {}",
        s.rgba[3]
    );
    let none = volume(grid(4, 1.0, |_| f32::NAN), single([1.0; 3]), &[[0.0, 0.1]]);
    assert_eq!((none.report().cells_non_finite, none.report().macrocells_clear), (27, 1));
}

#[test]
fn rays_that_miss_or_make_no_sense_are_clear() {
    let v = volume(grid(5, 1.0, |_| 1.0), single([1.0; 3]), &[[0.0, 1.0]]);
    let q = VolumeQuality::default();
    let ray = Ray::new(Vec3::new(-1.0, 2.0, 2.0), Vec3::X);
    for (r, t0, t1) in [
        (Ray::new(Vec3::new(-1.0, 9.0, 2.0), Vec3::X), 0.0, INF),
        (Ray::new(Vec3::new(-1.0, 2.0, 2.0), -Vec3::X), 0.0, INF),
        (Ray::new(Vec3::NAN, Vec3::X), 0.0, INF),
        (Ray::new(Vec3::ZERO, Vec3::ZERO), 0.0, INF),
        (ray, 0.0, 1.0),
        (ray, 5.0, INF),
        (ray, 3.0, 2.0),
        (ray, f32::NAN, f32::NAN),
    ] {
        let s = v.integrate(&r, t0, t1, &q);
        // A NaN limit is no limit: the ray's own range remains.
        if t0.is_nan() { assert!(s.rgba[3] > 0.9) } else { assert_eq!(s, VolumeSample::CLEAR) }
    }
    // A tolerance of zero or NaN means the tightest one, not an endless loop.
    for levels in [0.0, -1.0, f32::NAN] {
        assert!(
            (v.integrate(&ray, 0.0, INF, &tolerance(levels)).rgba[3] - 0.981_684_4).abs() < 1e-6
        );
    }
}

#[test]
fn overlapping_media_add_their_extinction() {
    let q = tolerance(0.25);
    let make = |color, sigma| volume(grid(9, 1.0, |_| 0.5), single(color), &[[0.0, sigma]]);
    let (red, blue) = (make([1.0, 0.0, 0.0], 0.1), make([0.0, 0.0, 1.0], 0.3));
    let ray = Ray::new(Vec3::new(-4.0, 4.0, 4.0), Vec3::X);
    // At the same position: a mixture in the ratio 1 : 3.
    let s = integrate_overlapping(&[(&red, ray), (&blue, ray)], 0.0, INF, &q);
    let alpha = 1.0 - (-0.4f64 * 8.0).exp();
    assert!(worst(s.rgba, [0.25 * alpha, 0.0, 0.75 * alpha, alpha]) < 0.5 / 255.0, "{:?}", s.rgba);
    assert!((s.depth - (4.0 + 2f32.ln() / 0.4)).abs() < 1e-3, "{}", s.depth);
    // The order does not matter.
    let t = integrate_overlapping(&[(&blue, ray), (&red, ray)], 0.0, INF, &q);
    assert!(worst(s.rgba, t.rgba.map(f64::from)) < 1e-6);
    // Half overlapping, blue shifted by 4: three segments.
    let shifted = Ray::new(ray.origin - Vec3::X * 4.0, ray.dir);
    let s = integrate_overlapping(&[(&red, ray), (&blue, shifted)], 0.0, INF, &q);
    let (a, b, c) = (1.0 - (-0.4f64).exp(), 1.0 - (-1.6f64).exp(), 1.0 - (-1.2f64).exp());
    let (ta, tb) = (1.0 - a, (1.0 - a) * (1.0 - b));
    let exact = [a + ta * b * 0.25, 0.0, ta * b * 0.75 + tb * c, 1.0 - tb * (1.0 - c)];
    assert!(worst(s.rgba, exact) < 0.5 / 255.0, "{:?} {exact:?}", s.rgba);
    // Disjoint: composited one over the other.
    let far = Ray::new(ray.origin - Vec3::X * 20.0, ray.dir);
    let s = integrate_overlapping(&[(&blue, far), (&red, ray)], 0.0, INF, &q);
    let exact = over(&red.integrate(&ray, 0.0, INF, &q), &blue.integrate(&far, 0.0, INF, &q));
    assert!(worst(s.rgba, exact.map(f64::from)) < 0.5 / 255.0);
    assert_eq!(integrate_overlapping(&[], 0.0, INF, &q), VolumeSample::CLEAR);
}

#[test]
fn two_copies_of_a_varied_medium_equal_one_of_twice_the_extinction() {
    let mut rng = Random::new(6);
    let [g, _] = fields();
    let ramp = [[-1.0f32, 0.0], [1.0, 0.3]];
    let double = ramp.map(|p| [p[0], 2.0 * p[1]]);
    let (one, two) = (volume(g.clone(), rainbow(), &ramp), volume(g, rainbow(), &double));
    let q = tolerance(1.0);
    for ray in rays(&mut rng, 10) {
        let both = integrate_overlapping(&[(&one, ray), (&one, ray)], 0.0, INF, &q);
        let exact = integrate_reference(&two, &ray, 0.0, INF, 0.002);
        assert!(worst(both.rgba, exact) < 1.0 / 255.0, "{:?} {exact:?}", both.rgba);
    }
}

#[test]
fn shading_follows_the_gradient() {
    let tf = || TransferFunction::new(single([1.0; 3]), vec![[0.0, 0.2]]).unwrap();
    let make = |light, g: Grid| {
        let shading = Some(VolumeShading {
            ambient: 0.25,
            diffuse: 0.75,
            light,
            half_gradient: 1e-6,
            ..VolumeShading::default()
        });
        Volume::new(g.into(), tf(), VolumeOptions { shading, ..VolumeOptions::default() }).unwrap()
    };
    let q = tolerance(0.1);
    let brightness = |v: &Volume, ray: &Ray| {
        let s = v.integrate(ray, 0.0, INF, &q);
        s.rgba[0] / s.rgba[3]
    };
    let along = Ray::new(Vec3::new(-1.0, 4.0, 4.0), Vec3::X);
    let slanted = Ray::new(
        Vec3::new(4.0, 4.0, 4.0) - 10.0 * Vec3::new(0.5, 0.75f32.sqrt(), 0.0),
        Vec3::new(0.5, 0.75f32.sqrt(), 0.0),
    );
    let ramp = || grid(9, 1.0, |p| p.x);
    // Headlight: full brightness along the gradient, cos 60° = ½ across.
    assert!((brightness(&make(None, ramp()), &along) - 1.0).abs() < 1e-4);
    assert!((brightness(&make(None, ramp()), &slanted) - 0.625).abs() < 1e-4);
    // A fixed light perpendicular to the gradient leaves the ambient part.
    assert!((brightness(&make(Some(Vec3::Y * 3.0), ramp()), &along) - 0.25).abs() < 1e-4);
    // Without a gradient there is no shading.
    assert!((brightness(&make(None, grid(9, 1.0, |_| 0.5)), &along) - 1.0).abs() < 1e-5);
}

#[test]
fn a_highlight_is_added_and_flat_places_keep_only_ambient_light_when_shading_never_fades() {
    let make = |g: Grid| {
        let shading = VolumeShading {
            ambient: 0.1,
            diffuse: 0.6,
            specular: 0.2,
            shininess: 10.0,
            ..Default::default()
        };
        let options = VolumeOptions { shading: Some(shading), ..VolumeOptions::default() };
        let tf = TransferFunction::new(single([0.5; 3]), vec![[0.0, 0.2]]).unwrap();
        Volume::new(g.into(), tf, options).unwrap()
    };
    let brightness = |v: &Volume, dir: Vec3| {
        let s =
            v.integrate(&Ray::new(Vec3::splat(4.0) - 10.0 * dir, dir), 0.0, INF, &tolerance(0.1));
        s.rgba[0] / s.rgba[3]
    };
    let ramp = make(grid(9, 1.0, |p| p.x));
    assert!((brightness(&ramp, Vec3::X) - (0.5 * 0.7 + 0.2)).abs() < 1e-4);
    // 60°: cos = ½, and ½^10 of the highlight.
    let slanted = Vec3::new(0.5, 0.75f32.sqrt(), 0.0);
    assert!((brightness(&ramp, slanted) - (0.5 * (0.1 + 0.6 * 0.5) + 0.2 / 1024.0)).abs() < 1e-4);
    assert!((brightness(&make(grid(9, 1.0, |_| 0.5)), Vec3::X) - 0.05).abs() < 1e-5);
}

#[test]
fn nearest_values_are_boxes_around_points_cut_at_the_bounds() {
    let tf = TransferFunction::new(single([1.0; 3]), vec![[0.0, 0.0], [1.0, 1.0]]).unwrap();
    let options =
        VolumeOptions { interpolation: Interpolation::Nearest, ..VolumeOptions::default() };
    // Values 0, 1, 0.25 along x: half a box, a box, half a box.
    let g = Grid::new(
        UVec3::new(3, 3, 3),
        DVec3::ZERO,
        DVec3::splat(2.0),
        (0..27).map(|i| [0.0, 1.0, 0.25][i % 3]).collect(),
    );
    let v = Volume::new(g.unwrap().into(), tf, options).unwrap();
    let along = |y: f32| {
        v.integrate(&Ray::new(Vec3::new(-1.0, y, 1.5), Vec3::X), 0.0, INF, &tolerance(0.1)).rgba[3]
    };
    for y in [0.0, 0.9, 2.3, 4.0] {
        assert!((along(y) - (1.0 - (-(2.0f32 + 0.25)).exp())).abs() < 1e-5, "{y}: {}", along(y));
    }
    assert_eq!(along(4.1), 0.0, "beyond the bounds");
    let across = v
        .integrate(&Ray::new(Vec3::new(3.5, -9.0, 1.0), Vec3::Y), 0.0, INF, &tolerance(0.1))
        .rgba[3];
    assert!((across - (1.0 - (-1.0f32).exp())).abs() < 1e-5, "{across}");
}

#[test]
fn useless_input_is_refused_with_the_cure() {
    let tf = TransferFunction::new(single([1.0; 3]), vec![[0.0, 1.0]]).unwrap();
    let flat = Grid::new(UVec3::new(4, 1, 4), DVec3::ZERO, DVec3::ONE, vec![0.0; 16]).unwrap();
    assert!(matches!(
        Volume::new(flat.into(), tf.clone(), VolumeOptions::default()),
        Err(VolumeError::NoCells { .. })
    ));
    let shading = Some(VolumeShading { ambient: 2.0, diffuse: 0.5, ..VolumeShading::default() });
    let e = Volume::new(
        grid(3, 1.0, |_| 0.0).into(),
        tf,
        VolumeOptions { shading, ..VolumeOptions::default() },
    )
    .unwrap_err();
    assert!(e.to_string().contains("ambient is 2"));
}

#[test]
fn bounds_and_origin_are_the_grids() {
    let g = grid(5, 0.5, |_| 0.0);
    let origin = DVec3::new(1e9, -4.0, 0.25);
    let g = Grid::new(g.dims(), origin, g.spacing(), g.into_values()).unwrap();
    let v = volume(g, single([1.0; 3]), &[[0.0, 1.0]]);
    assert_eq!(v.origin(), DVec3::new(1e9, -4.0, 0.25));
    let b = v.bounds();
    assert!(
        b.min.cmplt(Vec3::ZERO).all()
            && b.max.cmpgt(Vec3::splat(2.0)).all()
            && (b.extent() - 2.0).length() < 1e-5
    );
}

/// A table of 1,024 entries, as VTK hands them on: curved colours and a curved opacity.
fn table() -> TransferFunction {
    let at = |i: usize| i as f32 / 1023.0;
    let color = |f: f32| [f, 0.5 + 0.5 * (4.0 * f).sin(), (1.0 - f) * (1.0 - f), 1.0];
    let colors = ColorMap::new((0..1024).map(|i| color(at(i))).collect(), [-1.0, 1.0]);
    let sigma = |f: f32| -(1.0 - 0.4 * f * f).ln();
    let points = (0..1024).map(|i| [2.0 * at(i) - 1.0, sigma(at(i))]).collect();
    TransferFunction::new(colors, points).unwrap()
}

#[test]
fn tables_with_many_entries_stay_within_the_tolerance() {
    for (n, grid) in fields().into_iter().enumerate() {
        let v = Volume::new(grid.into(), table(), VolumeOptions::default()).unwrap();
        for ray in rays(&mut Random::new(8), 40) {
            let exact = integrate_reference(&v, &ray, 0.0, INF, 1.0 / 256.0);
            // At 0.05 levels the table's own knots are integrated.
            for levels in [0.5, 0.05] {
                let s = v.integrate(&ray, 0.0, INF, &tolerance(levels));
                let off = 255.0 * worst(s.rgba, exact);
                assert!(off <= f64::from(levels), "field {n}: {off} of {levels}, {ray:?}");
            }
        }
    }
}

#[test]
fn volumes_have_the_same_bits_with_every_instruction_set() {
    let shading = VolumeShading {
        ambient: 0.3,
        diffuse: 0.6,
        specular: 0.4,
        shininess: 20.0,
        ..VolumeShading::default()
    };
    for grid in fields() {
        for shading in [None, Some(shading)] {
            for points in transfers() {
                let tf = TransferFunction::new(rainbow(), points).unwrap();
                let options = VolumeOptions { shading, ..VolumeOptions::default() };
                let best = Volume::new(grid.clone().into(), tf, options).unwrap();
                for level in SimdLevel::available() {
                    let v = best.clone().with_simd_level(Some(level)).unwrap();
                    for ray in rays(&mut Random::new(9), 30) {
                        let [a, b] =
                            [&best, &v].map(|v| v.integrate(&ray, 0.0, INF, &tolerance(0.5)));
                        assert_eq!(a.rgba.map(f32::to_bits), b.rgba.map(f32::to_bits), "{level:?}");
                        assert_eq!((a.depth, a.samples), (b.depth, b.samples), "{level:?}");
                    }
                }
            }
        }
    }
}
