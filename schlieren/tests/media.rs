//! Tests absorption, emission and rotation along rays against closed forms.

use glam::DVec3;
use schlieren::analytic::erf;
use schlieren::field::{Field, Node};
use schlieren::interpolate::{BSpline, Interpolant};
use schlieren::march::{BlankCells, Deviational, Full, FullOptions, Options, Pefrl};
use schlieren::media::{
    AttenuatedPaths, Bend, Media, MediaIntegrals, MediaIntegrator, Property, Volume,
};
use schlieren::path::{Exit, LightPaths, Start, Status};
use schlieren::view::{Axis, View};
use std::sync::Arc;

const EVERY_BEND: [Bend; 3] = [Bend::Straight, Bend::Paraxial, Bend::Full];

/// A box of uniform gas, 0.4 x 0.3 x 0.2 m.
fn uniform_box() -> Field {
    let at = DVec3::new(0.1, -0.2, 0.3);
    Field::from_fn([33, 25, 17], [0.0125; 3], at, 1.0003, |_| 1e-4).unwrap()
}

fn start(x: f64, y: f64) -> Start {
    Start { position_m: [x as f32, y as f32], tilt_rad: [0.0; 2] }
}

fn along(integrator: &MediaIntegrator<'_>, starts: &[Start]) -> Vec<MediaIntegrals> {
    let mut out = vec![MediaIntegrals::default(); starts.len()];
    integrator.integrate(starts, None, &mut out);
    let mut parallel = out.clone();
    integrator.integrate_parallel(starts, None, &mut parallel);
    assert_eq!(out, parallel);
    out
}

fn integrator<'a>(
    field: &'a Field,
    view: View,
    media: &'a Media,
    bend: Bend,
) -> MediaIntegrator<'a> {
    MediaIntegrator::new(field, view, media, &Property::ALL, bend, 1.0, BlankCells::Opaque)
}

#[test]
fn an_even_slab_absorbs_emits_and_turns_by_its_closed_forms() {
    let field = uniform_box();
    let (alpha, j, rho) = (7.0, 2.0, -1.5);
    let uniform = |v| Volume::uniform(v, &field).unwrap();
    let media = Media::default()
        .with(Property::Absorption, uniform(alpha))
        .with(Property::Emission, uniform(j))
        .with(Property::Rotation, uniform(rho));
    for (axis, depth) in [(Axis::X, 0.4), (Axis::Y, 0.3), (Axis::Z, 0.2f64)] {
        let view = View::along(axis, field.centre_m());
        for bend in EVERY_BEND {
            let w = integrator(&field, view, &media, bend);
            for c in along(&w, &[start(0.0, 0.0), start(0.031, -0.042)]) {
                assert!(
                    (c.transmission(None) - (-alpha * depth).exp()).abs() < 1e-6,
                    "{axis:?} {bend:?} {c:?}"
                );
                assert!((f64::from(c.optical_depth) / (alpha * depth) - 1.0).abs() < 1e-6);
                let emission = j / alpha * (1.0 - (-alpha * depth).exp());
                assert!(
                    (f64::from(c.emission) / emission - 1.0).abs() < 2e-6,
                    "{bend:?} {c:?} {emission}"
                );
                assert!(
                    (f64::from(c.rotation_rad) / (rho * depth) - 1.0).abs() < 1e-6,
                    "{bend:?} {c:?}"
                );
            }
            // Outside the field the integrals are zero.
            assert_eq!(along(&w, &[start(0.5, 0.0)]), [MediaIntegrals::default()]);
        }
    }
}

#[test]
fn malus_passes_half_at_45_degrees_and_nothing_crossed() {
    let c = |rotation_rad| MediaIntegrals { rotation_rad, ..MediaIntegrals::default() };
    let at = |c: MediaIntegrals, deg: f64| c.transmission(Some(deg.to_radians()));
    assert!((at(c(0.0), 45.0) - 0.5).abs() < 1e-15);
    assert!(at(c(0.0), 90.0) < 1e-30 && (at(c(0.0), 180.0) - 1.0).abs() < 1e-15);
    // Rotated towards the analyser, and away from it.
    assert!(
        (at(c(0.3), 45.0) - (45f64.to_radians() - f64::from(0.3f32)).cos().powi(2)).abs() < 1e-15
    );
    assert!(at(c(0.3), 45.0) > at(c(-0.3), 45.0));
    let foggy = MediaIntegrals { optical_depth: 2.0, ..c(0.0) };
    assert!((at(foggy, 60.0) - 0.25 * (-2f64).exp()).abs() < 1e-15);
}

/// α = α0 exp(-r²/2s²): τ = α0 s √(2π) exp(-b²/2s²) erf(h/(s√2)).
#[test]
fn a_gaussian_absorber_is_its_error_function_from_every_side() {
    let (sigma, alpha0, half) = (0.02, 30.0, 0.05);
    let n = 81;
    let h = 2.0 * half / f64::from(n - 1);
    let field = Field::from_fn([n as usize; 3], [h; 3], DVec3::splat(-half), 1.0, |_| 0.0).unwrap();
    let smoke = |p: DVec3| alpha0 * (-p.length_squared() / (2.0 * sigma * sigma)).exp();
    // On a lattice of its own, which is finer and not aligned.
    let volume = Volume::from_fn([101; 3], [1.05e-3; 3], DVec3::splat(-0.0525), smoke).unwrap();
    let media = Media::default().with(Property::Absorption, volume);
    let closed = |b: f64, half: f64| {
        let across = (-b * b / (2.0 * sigma * sigma)).exp();
        alpha0 * sigma * std::f64::consts::TAU.sqrt() * across * erf(half / (sigma * 2f64.sqrt()))
    };
    let starts: Vec<Start> = (-8..=8).map(|i| start(f64::from(i) * 0.004, 0.001)).collect();
    for bend in EVERY_BEND {
        for axis in [Axis::X, Axis::Y, Axis::Z] {
            let view = View::along(axis, DVec3::ZERO);
            for (s, c) in starts.iter().zip(along(&integrator(&field, view, &media, bend), &starts))
            {
                let [x, y] = s.position_m.map(f64::from);
                let expected = closed(x.hypot(y), half);
                // The trilinear error is h²/8σ² = 3.4e-4 of the largest value for each of the two
                // axes across the light.
                let largest = closed(0.0, half);
                assert!(
                    (f64::from(c.optical_depth) - expected).abs() < 7e-4 * largest,
                    "{bend:?} {axis:?} {c:?} {expected}"
                );
            }
        }
        // Oblique views have the same integrals, but rays leave the box elsewhere, at 2.5 σ or
        // farther: 1 % of the middle's value is outside.
        let view = View::from_angles_deg(34.0, 21.0, DVec3::ZERO).unwrap();
        for (s, c) in starts.iter().zip(along(&integrator(&field, view, &media, bend), &starts)) {
            let b = f64::from(s.position_m[0]).hypot(f64::from(s.position_m[1]));
            let error = (f64::from(c.optical_depth) - closed(b, 10.0 * sigma)).abs();
            assert!(error < 0.013 * closed(0.0, half), "{bend:?} {c:?}");
        }
    }
}

#[test]
fn views_turned_with_the_smoke_agree() {
    // The same smoke with exchanged axes, seen along the exchanged axis.
    let half = DVec3::new(0.04, 0.05, 0.06);
    let smoke = |p: DVec3| 5.0 + 40.0 * p.x + 300.0 * p.y * p.z + 90.0 * p.z;
    let make = |turn: fn(DVec3) -> DVec3, back: fn(DVec3) -> DVec3| {
        let size = turn(half) * 2.0;
        let dims = (size / 2.5e-3).round().as_usizevec3().to_array().map(|n| n + 1);
        let field = Field::from_fn(dims, [2.5e-3; 3], -turn(half), 1.0, |_| 0.0).unwrap();
        let v = Volume::from_fn(dims, [2.5e-3; 3], -turn(half), |p| smoke(back(p))).unwrap();
        (field, Media::default().with(Property::Absorption, v))
    };
    let (a, smoke_a) = make(|p| p, |p| p);
    let (b, smoke_b) = make(|p| DVec3::new(p.z, p.x, p.y), |p| DVec3::new(p.y, p.z, p.x));
    let starts: Vec<Start> =
        (-6..=6).map(|i| start(f64::from(i) * 0.005, f64::from(i) * 0.003)).collect();
    for (light_a, up_a) in [(DVec3::Z, DVec3::Y), (DVec3::new(0.5, 0.3, 0.8), DVec3::Y)] {
        let turn = |p: DVec3| DVec3::new(p.z, p.x, p.y);
        let view_a = View::new(light_a, up_a, DVec3::ZERO).unwrap();
        let view_b = View::new(turn(light_a), turn(up_a), DVec3::ZERO).unwrap();
        for bend in EVERY_BEND {
            let one = along(&integrator(&a, view_a, &smoke_a, bend), &starts);
            let other = along(&integrator(&b, view_b, &smoke_b, bend), &starts);
            for (p, q) in one.iter().zip(&other) {
                assert!(
                    (p.optical_depth - q.optical_depth).abs() < 1e-6 * 0.6,
                    "{bend:?} {p:?} {q:?}"
                );
            }
        }
    }
}

/// A wall of smoke hides a glowing slab behind it from one side, but not from the other.
#[test]
fn emission_is_dimmed_by_what_lies_between_it_and_the_eye() {
    let field = uniform_box();
    let (z0, h) = (0.3, 0.0125);
    let smoke = Volume::from_fn([2, 2, 17], [0.4, 0.3, h], field.origin_m(), |p| {
        if p.z < z0 + 4.5 * h { 40.0 } else { 0.0 }
    });
    let glow = Volume::from_fn([2, 2, 17], [0.4, 0.3, h], field.origin_m(), |p| {
        if p.z > z0 + 10.5 * h { 3.0 } else { 0.0 }
    });
    let media = Media::default()
        .with(Property::Absorption, smoke.unwrap())
        .with(Property::Emission, glow.unwrap());
    let forward = View::along(Axis::Z, field.centre_m());
    let backward = View { right: -forward.right, forward: -forward.forward, ..forward };
    for bend in EVERY_BEND {
        let seen = |v| along(&integrator(&field, v, &media, bend), &[start(0.01, 0.02)])[0];
        // Smoke is 4.5 steps deep, with half of the ramp at its end. Nodes 11 to 16 glow: five
        // steps and half of the ramp.
        let (depth, glow) = (40.0 * h * 4.5, 3.0 * h * 5.5);
        let (through, free) = (seen(forward), seen(backward));
        assert!((f64::from(free.optical_depth) - depth).abs() < 1e-5 * depth, "{bend:?} {free:?}");
        assert!((f64::from(free.emission) - glow).abs() < 1e-5 * glow, "{bend:?} {free:?}");
        assert!(
            (f64::from(through.emission) - glow * (-depth).exp()).abs() < 1e-5 * glow,
            "{bend:?} {through:?}"
        );
    }
}

#[test]
fn integrals_end_at_bodies_and_where_requested() {
    let (n, h) = (21, 0.01);
    let dims = [n; 3];
    let mut nodes = vec![Node::Gas; n * n * n];
    for (i, node) in nodes.iter_mut().enumerate() {
        if (10..14).contains(&(i / (n * n))) {
            *node = Node::Solid;
        }
    }
    let walled =
        Field::new(dims, [h; 3], DVec3::ZERO, vec![0.0; n * n * n], 1.0, Some(nodes)).unwrap();
    let open = Field::from_fn(dims, [h; 3], DVec3::ZERO, 1.0, |_| 0.0).unwrap();
    let media = Media::default().with(Property::Absorption, Volume::uniform(2.0, &open).unwrap());
    let view = View::along(Axis::Z, open.centre_m());
    for bend in EVERY_BEND {
        // The nearest node is in the body from half a step before node 10 on. A step counts as a
        // whole or not at all.
        let c = along(&integrator(&walled, view, &media, bend), &[start(0.0, 0.0)])[0];
        assert!((c.optical_depth - 2.0 * 0.095).abs() < 2.0 * 0.0051, "{bend:?} {c:?}");
        let mut out = [MediaIntegrals::default(); 2];
        integrator(&open, view, &media, bend).integrate(
            &[start(0.0, 0.0); 2],
            Some(&[-0.063, -0.4]),
            &mut out,
        );
        assert!((out[0].optical_depth - 2.0 * 0.037).abs() < 1e-6, "{bend:?} {out:?}");
        assert_eq!(out[1], MediaIntegrals::default());
    }
}

#[test]
fn what_a_ray_collects_does_not_depend_on_the_rays_beside_it() {
    // Rays with long chords, with short ones across a corner, and rays that miss, in one packet and
    // alone.
    let field = Field::from_fn([33, 25, 17], [0.0125; 3], DVec3::ZERO, 1.0003, |x| {
        1e-4 * (9.0 * x.x * x.y).sin()
    })
    .unwrap();
    let smoke: Vec<f32> = (0..33 * 25 * 17).map(|i| 1.0 + (i % 7) as f32).collect();
    let volume = Volume::new([33, 25, 17], [0.0125; 3], DVec3::ZERO, smoke, None).unwrap();
    let media = Media::default().with(Property::Absorption, volume);
    let view = View::from_angles_deg(34.0, 17.0, field.centre_m()).unwrap();
    let starts: Vec<Start> =
        (0..48).map(|i| start(-0.3 + 0.0125 * f64::from(i), 0.004 * f64::from(i % 5))).collect();
    for bend in EVERY_BEND {
        let w = integrator(&field, view, &media, bend);
        let together = along(&w, &starts);
        assert!(together.iter().filter(|c| c.optical_depth > 0.1).count() > 16);
        assert!(together.iter().any(|c| c.optical_depth == 0.0));
        for (s, c) in starts.iter().zip(&together) {
            assert_eq!(along(&w, &[*s]), [*c], "{bend:?} {s:?}");
        }
    }
}

/// SELFOC, n² = n0² (1 - g² r²): x = x0 cos(g τ), z = w_z τ, ds = (n/n0) dτ, so the path is longer
/// than the rod by a closed integral.
#[test]
fn in_strong_index_the_way_is_the_bent_one() {
    let (g, x0, length): (f64, f64, f64) = (3.0, 0.12, 1.0);
    let n = [65, 65, 129];
    let h = [0.4 / 64.0, 0.4 / 64.0, length / 128.0];
    let eps = |p: DVec3| (1.0 - g * g * (p.x * p.x + p.y * p.y)).sqrt() - 1.0;
    let rod = Field::from_fn(n, h, DVec3::new(-0.2, -0.2, 0.0), 1.5, eps).unwrap();
    let media = Media::default()
        .with(Property::Absorption, Volume::uniform(1.0, &rod).unwrap())
        // A ramp across the light: the integral depends on the position of the ray.
        .with(
            Property::Rotation,
            Volume::from_fn([33, 2, 2], [0.0125, 0.4, length], rod.origin_m(), |p| p.x).unwrap(),
        );
    let view = View::along(Axis::Z, rod.centre_m());

    // The ray enters along z, so w_z = n(x0)/n0 is constant.
    let w_z = (1.0 - g * g * x0 * x0).sqrt();
    let tau = length / w_z;
    let steps = 20_000;
    let (mut path, mut ramp) = (0.0, 0.0);
    for i in 0..steps {
        let x = x0 * (g * (f64::from(i) + 0.5) / f64::from(steps) * tau).cos();
        let ds = (1.0 - g * g * x * x).sqrt() * tau / f64::from(steps);
        path += ds;
        ramp += x * ds;
    }
    assert!(path > 1.02 * length, "the test must tell bent from straight: {path}");
    let collect = |bend| {
        let w =
            MediaIntegrator::new(&rod, view, &media, &Property::ALL, bend, 0.5, BlankCells::Opaque);
        along(&w, &[start(x0, 0.0)])[0]
    };
    let full = collect(Bend::Full);
    // The spline of the rod gives relative errors of the position of 1e-5.
    assert!((f64::from(full.optical_depth) - path).abs() < 3e-5 * path, "{full:?} {path}");
    assert!((f64::from(full.rotation_rad) - ramp).abs() < 1e-4 * x0, "{full:?} {ramp}");
    // With trilinear gradients and leapfrog the ray is also bent, with an error of half a per cent
    // of the excursion.
    let paraxial = collect(Bend::Paraxial);
    assert!((f64::from(paraxial.optical_depth) - path).abs() < 1e-3 * path, "{paraxial:?} {path}");
    assert!((f64::from(paraxial.rotation_rad) - ramp).abs() < 5e-3 * x0, "{paraxial:?} {ramp}");
    let straight = collect(Bend::Straight);
    assert!((f64::from(straight.optical_depth) - length).abs() < 1e-6);
}

/// The integrator's rays end where the march's rays do. The rotation is x near the exit, so that
/// its integral gives the position of the ray there.
#[test]
fn the_walk_goes_where_the_march_goes() {
    let (n, half, sigma) = (65, 0.05, 0.015);
    let warm = |p: DVec3| -2e-3 * (-p.length_squared() / (2.0 * sigma * sigma)).exp();
    let field =
        Field::from_fn([n; 3], [2.0 * half / (n - 1) as f64; 3], DVec3::splat(-half), 1.0, warm)
            .unwrap();
    let view = View::along(Axis::Z, DVec3::ZERO);
    let s = start(0.015, 0.0);
    let fine = FullOptions { step_voxels: 0.25, ..FullOptions::default() };
    let spline = BSpline::new(&field);
    let mut exit = [Exit::UNDISTURBED];
    Full::new(&field, &spline, Pefrl, view, fine).trace(&[s], &mut exit);
    // A rotation only in the last 5 mm, proportional to x: its integral gives x there.
    let last = 5e-3;
    let at_end = |p: DVec3| if p.z > half - last { p.x } else { 0.0 };
    let v =
        Volume::from_fn([3, 3, 801], [half, half, 2.0 * half / 800.0], DVec3::splat(-half), at_end)
            .unwrap();
    let media = Media::default().with(Property::Rotation, v);
    let place = |bend| {
        let w = MediaIntegrator::new(
            &field,
            view,
            &media,
            &Property::ALL,
            bend,
            1.0,
            BlankCells::Opaque,
        );
        let reference = MediaIntegrator::new(
            &field,
            view,
            &media,
            &Property::ALL,
            Bend::Straight,
            1.0,
            BlankCells::Opaque,
        );
        let [bent, straight] = [&w, &reference].map(|w| f64::from(along(w, &[s])[0].rotation_rad));
        0.015 * bent / straight
    };
    // Mean position of the ray over the last 5 mm, from its displacement and deflection at the
    // exit.
    let expected = 0.015 + f64::from(exit[0].displacement_m[0])
        - 0.5 * last * f64::from(exit[0].deflection_rad[0]);
    let moved = expected - 0.015;
    assert!(moved > 1e-4, "{moved}");
    for bend in [Bend::Paraxial, Bend::Full] {
        let off = (place(bend) - expected).abs();
        // Trilinear gradients at h/σ = 0.1 have an error of a few per cent of the displacement.
        assert!(off < 0.03 * moved, "{bend:?}: {off:e} of {moved:e}");
    }
}

#[test]
fn paths_keep_all_but_the_transmission_bit_by_bit() {
    let (n, half, sigma) = (33, 0.05, 0.015);
    let warm = |p: DVec3| -1e-4 * (-p.length_squared() / (2.0 * sigma * sigma)).exp();
    let field =
        Field::from_fn([n; 3], [2.0 * half / (n - 1) as f64; 3], DVec3::splat(-half), 1.0, warm)
            .unwrap();
    let view = View::from_angles_deg(20.0, 10.0, DVec3::ZERO).unwrap();
    let media =
        Media::default().with(Property::Absorption, Volume::uniform(4000.0, &field).unwrap());
    let march =
        || Box::new(Deviational::new(&field, view, Interpolant::BSpline, Options::default()));
    let starts: Vec<Start> = (-20..=20).map(|i| start(f64::from(i) * 0.004, 0.003)).collect();
    let mut plain = vec![Exit::UNDISTURBED; starts.len()];
    let mut dimmed = plain.clone();
    march().trace(&starts, &mut plain);
    let rays = Arc::default();
    let w = integrator(&field, view, &media, Bend::Paraxial);
    let through = AttenuatedPaths::new(march(), w, None, rays);
    through.trace(&starts, &mut dimmed);
    assert_eq!(through.rays(), starts.len() as u64);
    let mut dark = 0;
    for (p, d) in plain.iter().zip(&dimmed) {
        assert_eq!(
            (p.deflection_rad, p.displacement_m, p.exit_depth_m),
            (d.deflection_rad, d.displacement_m, d.exit_depth_m)
        );
        assert_eq!(d.status, Status::Free);
        // However thick the smoke, light that is not blocked stays above 0, because 0 means
        // blocked.
        assert!(d.transmission > 0.0 && d.transmission <= 1.0);
        dark += usize::from(d.transmission < 1e-30);
    }
    assert!(dark > 10, "{dark}");
    let mut jacobians = vec![Default::default(); starts.len()];
    let mut again = plain.clone();
    through.trace_with_jacobians(&starts, &mut again, &mut jacobians);
    assert!(again.iter().zip(&dimmed).all(|(a, b)| a.transmission == b.transmission));
}
