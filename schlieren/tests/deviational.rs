//! Tests the f32 kernels against the f64 reference and closed forms.

mod common;

use common::{blob, cube, difference, grid, largest, lopsided, oblique, trace};
use fearless_simd::Level;
use glam::DVec3;
use schlieren::analytic::{Gaussian, abel};
use schlieren::field::Field;
use schlieren::interpolate::{BSpline, Interpolant, Interpolate, Trilinear, TrilinearGradient};
use schlieren::march::{
    Deviational, Euler, Full, FullOptions, Integrator, Options, Pefrl, Scheme, Verlet,
};
use schlieren::path::{LightPaths, PathQuantities};
use schlieren::view::{Axis, View};

const OPD: PathQuantities = PathQuantities { opd: true };
const INTERPOLANTS: [Interpolant; 3] =
    [Interpolant::BSpline, Interpolant::Trilinear, Interpolant::TrilinearGradient];

/// The reference: the same steps in f64 through the same interpolant.
fn reference<'a, I: Interpolate, G: Integrator>(
    field: &'a Field,
    interpolate: &'a I,
    g: G,
    view: View,
    step: f64,
) -> Full<'a, I, G> {
    Full::new(
        field,
        interpolate,
        g,
        view,
        FullOptions { step_voxels: step, quantities: OPD, ..Default::default() },
    )
}

/// Direct f32 marching loses 35 % of the deflection at 1e-6 in an oblique view, and all of it
/// below. The tolerance is eight roundings of f32; the remaining error comes from weights and
/// positions, not from sums.
#[test]
fn f32_keeps_its_digits_at_any_amplitude_in_an_oblique_view() {
    let starts = grid(16, 0.8);
    for amplitude in [1e-8, 1e-6, 1e-5, 1e-4, 1e-3] {
        let field = blob(128, amplitude, 0.12);
        let spline = BSpline::new(&field);
        let wanted = trace(&reference(&field, &spline, Verlet, oblique(), 1.0), &starts);
        for opd in [false, true] {
            let options = Options { quantities: PathQuantities { opd }, ..Default::default() };
            let got =
                trace(&Deviational::new(&field, oblique(), Interpolant::BSpline, options), &starts);
            let (rms, max) = difference(&got, &wanted);
            assert!(
                rms < 1e-7 && max < 5e-7,
                "amplitude {amplitude}: rms {rms:.1e}, max {max:.1e}"
            );
        }
    }
}

#[test]
fn many_steps_do_not_eat_digits() {
    let starts = grid(8, 0.8);
    let field = blob(64, 1e-6, 0.12);
    let spline = BSpline::new(&field);
    let wanted = trace(&reference(&field, &spline, Verlet, oblique(), 1.0 / 32.0), &starts);
    let options = Options { step_voxels: 1.0 / 32.0, ..Default::default() };
    let (rms, max) = difference(
        &trace(&Deviational::new(&field, oblique(), Interpolant::BSpline, options), &starts),
        &wanted,
    );
    // Tolerance for two thousand additions.
    assert!(rms < 5e-7 && max < 2e-6, "rms {rms:.1e}, max {max:.1e}");
}

#[test]
fn phase_is_right_within_a_thousandth_of_a_radian_of_three_thousand() {
    let field = blob(64, 1e-3, 0.12);
    let starts = grid(12, 0.6);
    let spline = BSpline::new(&field);
    let wave_number = std::f64::consts::TAU / 633e-9;
    for view in [View::along(Axis::Z, DVec3::ZERO), oblique()] {
        let wanted = trace(&reference(&field, &spline, Pefrl, view, 0.25), &starts);
        let options = Options { quantities: OPD, step_voxels: 0.25, ..Default::default() };
        let got = trace(&Deviational::new(&field, view, Interpolant::BSpline, options), &starts);
        let phase = |e: &schlieren::path::Exit| f64::from(e.opd_m) * wave_number;
        let largest = wanted.iter().map(phase).fold(0.0, f64::max);
        assert!(largest > 2800.0, "{largest}");
        let worst =
            got.iter().zip(&wanted).map(|(a, b)| (phase(a) - phase(b)).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-3, "{worst} rad");
    }
}

#[test]
fn every_interpolant_and_scheme_agrees_with_its_f64_reference() {
    let field = cube(40, lopsided);
    let starts = grid(16, 0.7);
    let (spline, line, gradient) =
        (BSpline::new(&field), Trilinear::new(&field), TrilinearGradient::new(&field));
    fn check(
        field: &Field,
        interpolate: &impl Interpolate,
        interpolant: Interpolant,
        starts: &[schlieren::path::Start],
        tolerance: f64,
    ) {
        for scheme in [Scheme::Verlet, Scheme::Euler] {
            let options = Options { scheme, quantities: OPD, ..Default::default() };
            // Along an axis all rays have the same steps in kernel and reference.
            let view = View::along(Axis::Y, DVec3::ZERO);
            let got = trace(&Deviational::new(field, view, interpolant, options), starts);
            let wanted = match scheme {
                Scheme::Verlet => trace(&reference(field, interpolate, Verlet, view, 1.0), starts),
                Scheme::Euler => trace(&reference(field, interpolate, Euler, view, 1.0), starts),
            };
            let (_, max) = difference(&got, &wanted);
            assert!(max < tolerance, "{interpolant:?} {scheme:?}: {max:.1e}");
            let displacement = |e: &schlieren::path::Exit| {
                DVec3::new(e.displacement_m[0].into(), e.displacement_m[1].into(), 0.0)
            };
            let scale = wanted.iter().map(|e| displacement(e).length()).fold(0.0, f64::max);
            for (a, b) in got.iter().zip(&wanted) {
                assert!(
                    (displacement(a) - displacement(b)).length() < 10.0 * tolerance * scale,
                    "{interpolant:?} {scheme:?}"
                );
                assert_eq!(a.exit_depth_m, b.exit_depth_m);
            }
        }
    }
    check(&field, &spline, Interpolant::BSpline, &starts, 5e-7);
    // The gradient of trilinear eps jumps between cells, so a point rounded into the next cell has
    // another gradient.
    check(&field, &line, Interpolant::Trilinear, &starts, 5e-4);
    check(&field, &gradient, Interpolant::TrilinearGradient, &starts, 1e-6);
}

#[test]
fn all_instruction_sets_agree() {
    let field = cube(40, lopsided);
    let starts = grid(20, 0.9);
    let best = Level::new();
    #[cfg(target_arch = "x86_64")]
    let levels = [best.as_sse2().map(Level::Sse2), best.as_avx2().map(Level::Avx2)];
    #[cfg(not(target_arch = "x86_64"))]
    let levels = [Some(best)];
    for interpolant in INTERPOLANTS {
        let options = Options { quantities: OPD, ..Default::default() };
        let wanted =
            trace(&Deviational::with_level(&field, oblique(), interpolant, options, best), &starts);
        for level in levels.into_iter().flatten() {
            let got = trace(
                &Deviational::with_level(&field, oblique(), interpolant, options, level),
                &starts,
            );
            // Levels without fused multiply-add have an additional rounding.
            let tolerance = if interpolant == Interpolant::Trilinear { 5e-4 } else { 1e-6 };
            let (_, max) = difference(&got, &wanted);
            assert!(max < tolerance, "{interpolant:?} {level:?}: {max:.1e}");
        }
    }
}

/// The same gas with exchanged axes, seen along the exchanged axes, gives the same exits.
#[test]
fn views_along_all_axes_agree() {
    let starts = grid(16, 0.9);
    let straight = cube(48, lopsided);
    let along_z = View::along(Axis::Z, DVec3::ZERO);
    // x' = y, y' = z, z' = x: right (x), up (y) and forward (z) become z', x' and y'.
    let turned = cube(48, |p| lopsided(DVec3::new(p.z, p.x, p.y)));
    let along = View { right: DVec3::Z, up: DVec3::X, forward: DVec3::Y, centre_m: DVec3::ZERO };
    // A view rotated by half a turn about the light: right and up change sign.
    let half = View { right: -DVec3::X, up: -DVec3::Y, forward: DVec3::Z, centre_m: DVec3::ZERO };
    for interpolant in INTERPOLANTS {
        let options = Options { quantities: OPD, ..Default::default() };
        let wanted = trace(&Deviational::new(&straight, along_z, interpolant, options), &starts);
        let got = trace(&Deviational::new(&turned, along, interpolant, options), &starts);
        assert!(difference(&got, &wanted).1 < 1e-6, "{interpolant:?}");
        let mirrored: Vec<_> = starts
            .iter()
            .map(|s| schlieren::path::Start { position_m: s.position_m.map(|p| -p), ..*s })
            .collect();
        let mut got = trace(&Deviational::new(&straight, half, interpolant, options), &mirrored);
        for e in &mut got {
            e.deflection_rad = e.deflection_rad.map(|u| -u);
        }
        assert!(difference(&got, &wanted).1 < 1e-6, "{interpolant:?}");
    }
    // From behind: in weak gas, light in the opposite direction has the same deflection in space.
    let behind = View { right: -DVec3::X, up: DVec3::Y, forward: -DVec3::Z, centre_m: DVec3::ZERO };
    let weak = cube(48, |p| 1e-4 * lopsided(p));
    let wanted =
        trace(&Deviational::new(&weak, along_z, Interpolant::BSpline, Options::default()), &starts);
    let seen: Vec<_> = starts
        .iter()
        .map(|s| schlieren::path::Start { position_m: [-s.position_m[0], s.position_m[1]], ..*s })
        .collect();
    let mut got =
        trace(&Deviational::new(&weak, behind, Interpolant::BSpline, Options::default()), &seen);
    for e in &mut got {
        e.deflection_rad[0] *= -1.0;
    }
    assert!(difference(&got, &wanted).1 < 1e-6);
}

/// Denser gas on the right deflects light to the right in the image, and denser gas above deflects
/// it upwards.
#[test]
fn light_bends_towards_dense_gas_in_the_image() {
    for axis in [Axis::X, Axis::Y, Axis::Z] {
        let view = View::along(axis, DVec3::ZERO);
        for (towards, c) in [(view.right, 0), (view.up, 1)] {
            let field = cube(16, |p| 1e-4 * p.dot(towards));
            let e = trace(
                &Deviational::new(&field, view, Interpolant::BSpline, Options::default()),
                &grid(1, 0.1),
            )[0];
            assert!((e.deflection_rad[c] - 1e-4).abs() < 1e-9, "{axis:?}: {:?}", e.deflection_rad);
            assert!(e.deflection_rad[1 - c].abs() < 1e-10);
            // Half of u times the length of 1 m.
            assert!((e.displacement_m[c] - 0.5e-4).abs() < 1e-9);
        }
    }
}

#[test]
fn gaussian_blob_is_the_closed_form_to_first_order() {
    let (amplitude, sigma_m) = (1e-5, 0.08);
    let g = Gaussian { amplitude, sigma_m };
    let field = blob(96, amplitude, sigma_m);
    let starts = grid(24, 0.8);
    let paths = Deviational::new(
        &field,
        View::along(Axis::Z, DVec3::ZERO),
        Interpolant::BSpline,
        Options { quantities: OPD, ..Default::default() },
    );
    let exits = trace(&paths, &starts);
    let scale = largest(&exits);
    for (s, e) in starts.iter().zip(&exits) {
        let [x, y] = s.position_m.map(f64::from);
        let u = g.deflection_rad(x, y, 0.5);
        for c in 0..2 {
            // Errors: 4e-5 from interpolation, eps sigma/L from bending.
            assert!((f64::from(e.deflection_rad[c]) - u[c]).abs() < 1e-4 * scale, "{s:?}");
        }
        let path = g.path_difference_m(x, y, 0.5);
        let off = (f64::from(e.opd_m) - path).abs() / g.path_difference_m(0.0, 0.0, 0.5);
        // Errors: 1e-6 from interpolation, and a few times 1e-5 from the terms of second order, the
        // squares of eps and of the deflection.
        assert!(off < 5e-5, "{off:.1e}");
    }
}

/// The errors of the interpolants for a blob are those in the table of `interpolate`.
#[test]
fn interpolation_errors_are_those_on_record() {
    // sigma = 10 voxels.
    let n = 101;
    let g = Gaussian { amplitude: 1e-8, sigma_m: 0.1 };
    let field = blob(n, g.amplitude, g.sigma_m);
    let starts = grid(24, 0.6);
    let scale = g.deflection_rad(0.1, 0.0, 0.5)[0].abs();
    let mut on_record = vec![];
    for interpolant in INTERPOLANTS {
        let exits = trace(
            &Deviational::new(
                &field,
                View::along(Axis::Z, DVec3::ZERO),
                interpolant,
                Options { quantities: OPD, ..Default::default() },
            ),
            &starts,
        );
        let (mut u2, mut p2) = (0.0, 0.0);
        for (s, e) in starts.iter().zip(&exits) {
            let [x, y] = s.position_m.map(f64::from);
            let u = g.deflection_rad(x, y, 0.5);
            u2 +=
                (0..2).map(|c| (f64::from(e.deflection_rad[c]) - u[c]).powi(2)).sum::<f64>() / 2.0;
            p2 += (f64::from(e.opd_m) - g.path_difference_m(x, y, 0.5)).powi(2);
        }
        let n = starts.len() as f64;
        on_record
            .push(((u2 / n).sqrt() / scale, (p2 / n).sqrt() / g.path_difference_m(0.0, 0.0, 0.5)));
    }
    let [spline, line, gradient] = on_record[..] else { unreachable!() };
    assert!(spline.0 < 2e-5 && spline.1 < 1e-6, "B-spline {spline:?}");
    assert!(gradient.0 > 1e-3 && gradient.0 < 5e-3, "trilinear of gradients {gradient:?}");
    assert!(line.0 > 5e-3 && line.0 < 2e-2, "trilinear {line:?}");
}

#[test]
fn cylinders_are_abel_pairs() {
    let (radius, a) = (0.35, 1e-6);
    for m in [2u32, 3] {
        let field = cube(128, |p| {
            a * (1.0 - (p.x * p.x + p.z * p.z) / (radius * radius)).max(0.0).powi(m as i32)
        });
        let starts = grid(20, 0.8);
        let paths = Deviational::new(
            &field,
            View::along(Axis::Z, DVec3::ZERO),
            Interpolant::BSpline,
            Options { quantities: OPD, ..Default::default() },
        );
        let exits = trace(&paths, &starts);
        let scale = largest(&exits);
        for (s, e) in starts.iter().zip(&exits) {
            let x = f64::from(s.position_m[0]);
            assert!(
                (f64::from(e.opd_m) - a * abel::power(x, radius, m)).abs() < 1e-3 * a * radius,
                "m = {m}, x = {x}"
            );
            assert!(
                (f64::from(e.deflection_rad[0]) - a * abel::power_slope(x, radius, m)).abs()
                    < 1e-2 * scale,
                "m = {m}, x = {x}"
            );
            assert!(f64::from(e.deflection_rad[1]).abs() < 1e-6 * scale);
        }
    }
}

/// A weak plane layer of any profile deflects light by d(eps) tan(angle of incidence), whatever its
/// thickness.
#[test]
fn planar_jump_turns_light_like_a_prism() {
    let jump = 8e-4;
    for (degrees, thickness_voxels) in [(30.0f64, 4.0), (60.0, 4.0), (30.0, 8.0)] {
        let n = 96;
        let phi = degrees.to_radians();
        let normal = DVec3::new(phi.sin(), 0.0, phi.cos());
        let width = thickness_voxels / 2.0 / (n - 1) as f64;
        let field = cube(n, |p| 0.5 * jump * (1.0 + (p.dot(normal) / width).tanh()));
        let paths = Deviational::new(
            &field,
            View::along(Axis::Z, DVec3::ZERO),
            Interpolant::BSpline,
            Options { step_voxels: 0.25, ..Default::default() },
        );
        for e in trace(&paths, &grid(8, 0.05)) {
            let wanted = jump * phi.tan();
            let got = f64::from(e.deflection_rad[0]);
            assert!(
                (got / wanted - 1.0).abs() < 5e-3,
                "{degrees} degrees, {thickness_voxels} voxels: {got} for {wanted}"
            );
        }
    }
}

#[test]
fn spacing_may_differ_along_the_axes() {
    let starts = grid(16, 0.7);
    let view = oblique();
    let fine = cube(97, lopsided);
    let wanted =
        trace(&Deviational::new(&fine, view, Interpolant::BSpline, Options::default()), &starts);
    for dims in [[97, 49, 65], [49, 97, 81]] {
        let spacing = dims.map(|n: usize| 1.0 / (n - 1) as f64);
        let field = Field::from_fn(dims, spacing, DVec3::splat(-0.5), 1.0, lopsided).unwrap();
        let got = trace(
            &Deviational::new(&field, view, Interpolant::BSpline, Options::default()),
            &starts,
        );
        let (_, max) = difference(&got, &wanted);
        // Error of interpolation at sigma = 4 voxels.
        assert!(max < 2e-3, "{dims:?}: {max:.1e}");
    }
}

#[test]
fn fields_of_a_nanometre_and_of_a_thousand_kilometres_bend_light_alike() {
    let n = 40;
    let starts = grid(8, 0.7);
    let wanted = trace(
        &Deviational::new(&cube(n, lopsided), oblique(), Interpolant::BSpline, Options::default()),
        &starts,
    );
    for unit in [1e-9, 1e-3, 1e3, 1e6] {
        let h = unit / (n - 1) as f64;
        let field =
            Field::from_fn([n; 3], [h; 3], DVec3::splat(-0.5 * unit), 1.0, |p| lopsided(p / unit))
                .unwrap();
        let scaled: Vec<_> = starts
            .iter()
            .map(|s| schlieren::path::Start {
                position_m: s.position_m.map(|p| (f64::from(p) * unit) as f32),
                ..*s
            })
            .collect();
        let got = trace(
            &Deviational::new(
                &field,
                oblique(),
                Interpolant::BSpline,
                Options { quantities: OPD, ..Default::default() },
            ),
            &scaled,
        );
        let (_, max) = difference(&got, &wanted);
        assert!(max < 2e-6, "{unit} m: {max:.1e}");
        assert!(
            got.iter()
                .all(|e| e.opd_m.is_finite() && f64::from(e.displacement_m[0].abs()) < 1e-3 * unit)
        );
    }
}

/// A field far from the origin of coordinates gives the same result, because coordinates are f64.
#[test]
fn huge_offset_origin() {
    let n = 40;
    let far = DVec3::new(3e6, -7e6, 1e7);
    let field =
        Field::from_fn([n; 3], [1.0 / (n - 1) as f64; 3], far - DVec3::splat(0.5), 1.0, |p| {
            lopsided(p - far)
        })
        .unwrap();
    let starts = grid(8, 0.7);
    let wanted = trace(
        &Deviational::new(&cube(n, lopsided), oblique(), Interpolant::BSpline, Options::default()),
        &starts,
    );
    let view = View { centre_m: far, ..oblique() };
    let (_, max) = difference(
        &trace(&Deviational::new(&field, view, Interpolant::BSpline, Options::default()), &starts),
        &wanted,
    );
    assert!(max < 1e-5, "{max:.1e}");
}

#[test]
fn tilted_beams_are_seen_from_their_own_direction() {
    let field = cube(48, |p| 1e-3 * lopsided(p));
    let mut starts = grid(8, 0.6);
    for s in &mut starts {
        s.tilt_rad = [0.02, -0.01];
    }
    let got = trace(
        &Deviational::new(
            &field,
            View::along(Axis::Z, DVec3::ZERO),
            Interpolant::BSpline,
            Options::default(),
        ),
        &starts,
    );
    // Compares each ray with the axial ray of a view in its own direction.
    for (s, e) in starts.iter().zip(&got) {
        let beam = View::along(Axis::Z, DVec3::ZERO).beam(s.tilt_rad);
        let at = DVec3::new(s.position_m[0].into(), s.position_m[1].into(), 0.0);
        let view = View { right: beam[0], up: beam[1], forward: beam[2], centre_m: at };
        let alone = trace(
            &Deviational::new(&field, view, Interpolant::BSpline, Options::default()),
            &[Default::default()],
        )[0];
        for c in 0..2 {
            assert!(
                (alone.deflection_rad[c] - e.deflection_rad[c]).abs() < 1e-6 * largest(&got) as f32
            );
        }
    }
}

#[test]
fn path_is_not_computed_unless_wanted() {
    let field = blob(16, 1e-4, 0.1);
    let e = trace(
        &Deviational::new(&field, oblique(), Interpolant::BSpline, Options::default()),
        &grid(4, 0.5),
    );
    assert!(e.iter().all(|e| e.opd_m.is_nan()));
}

#[test]
fn number_of_threads_and_neighbours_do_not_matter() {
    let field = cube(32, lopsided);
    let starts = grid(70, 0.9);
    let paths = Deviational::new(
        &field,
        View::along(Axis::Z, DVec3::ZERO),
        Interpolant::BSpline,
        Options::default(),
    );
    let one = trace(&paths, &starts);
    let mut many = one.clone();
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| paths.trace_parallel(&starts, &mut many));
        assert_eq!(
            one.iter().map(|e| e.deflection_rad).collect::<Vec<_>>(),
            many.iter().map(|e| e.deflection_rad).collect::<Vec<_>>()
        );
    }
}

#[test]
fn jacobians_are_the_closed_form() {
    let g = Gaussian { amplitude: 1e-6, sigma_m: 0.1 };
    let field = blob(80, g.amplitude, g.sigma_m);
    let starts = grid(8, 0.5);
    let paths = Deviational::new(
        &field,
        View::along(Axis::Z, DVec3::ZERO),
        Interpolant::BSpline,
        Options::default(),
    );
    let mut exits = vec![schlieren::path::Exit::UNDISTURBED; starts.len()];
    let mut jacobians = vec![schlieren::path::Jacobian::default(); starts.len()];
    paths.trace_with_jacobians(&starts, &mut exits, &mut jacobians);
    let scale = g.jacobian_per_m(0.0, 0.0, 0.5)[0].abs();
    for (s, j) in starts.iter().zip(&jacobians) {
        let [x, y] = s.position_m.map(f64::from);
        let [xx, xy, yy] = g.jacobian_per_m(x, y, 0.5);
        let got = j.deflection_per_m.map(|r| r.map(f64::from));
        for (a, b) in [(got[0][0], xx), (got[0][1], xy), (got[1][0], xy), (got[1][1], yy)] {
            assert!((a - b).abs() < 2e-3 * scale, "{s:?}: {a} {b}");
        }
    }
}
