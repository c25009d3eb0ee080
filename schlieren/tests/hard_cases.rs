//! Rays and fields that break careless code, one test for each kind. (Lattices: hard_lattices.rs.)

mod common;

use common::{blob, cube, difference, grid, largest, lopsided, oblique, trace};
use glam::DVec3;
use schlieren::analytic::{Luneburg, Selfoc};
use schlieren::field::{Field, Node};
use schlieren::interpolate::{BSpline, Interpolant, Trilinear, TrilinearGradient};
use schlieren::march::{
    BlankCells, Deviational, Full, FullOptions, LineOfSight, Medium, Options, Pefrl, Scheme,
    Sharma, Verlet,
};
use schlieren::path::{Exit, LightPaths, PathQuantities, Start, Status};
use schlieren::view::{Axis, View};

const OPD: PathQuantities = PathQuantities { opd: true };
const INTERPOLANTS: [Interpolant; 3] =
    [Interpolant::BSpline, Interpolant::Trilinear, Interpolant::TrilinearGradient];

fn start(x: f64, y: f64) -> Start {
    Start { position_m: [x as f32, y as f32], tilt_rad: [0.0; 2] }
}

/// In a uniform gradient every ray in the field has the same deflection, also in a face or an edge
/// of the field or of a cell.
#[test]
fn rays_in_faces_and_edges_are_in_the_field() {
    // A power of two, so that f32 has the values at the nodes.
    let slope = 2f64.powi(-17);
    let field =
        Field::from_fn([9; 3], [0.125; 3], DVec3::splat(-0.5), 1.0, |p| slope * (p.x + 2.0 * p.y))
            .unwrap();
    let paths = |i| {
        Deviational::new(
            &field,
            View::along(Axis::Z, DVec3::ZERO),
            i,
            Options { quantities: OPD, ..Default::default() },
        )
    };
    let at = [-0.5, -0.375, 0.0, 0.0625, 0.5];
    for interpolant in INTERPOLANTS {
        for x in at {
            for y in at {
                let e = trace(&paths(interpolant), &[start(x, y)])[0];
                assert!(
                    (f64::from(e.deflection_rad[0]) - slope).abs() < 1e-6 * slope,
                    "{interpolant:?} {x} {y}: {:?}",
                    e.deflection_rad
                );
                assert!(
                    (f64::from(e.deflection_rad[1]) - 2.0 * slope).abs() < 2e-6 * slope,
                    "{interpolant:?} {x} {y}: {:?}",
                    e.deflection_rad
                );
                assert!((f64::from(e.opd_m) - slope * (x + 2.0 * y)).abs() < 1e-9);
            }
        }
        // Just outside the field.
        let e = trace(&paths(interpolant), &[start(0.5000001, 0.0), start(0.0, -0.51)]);
        assert!(e.iter().all(|e| e.deflection_rad == [0.0; 2] && e.opd_m == 0.0));
    }
}

/// Nodes that are rounded to f32 change the gradient in a face by at most eight times the rounding
/// per step: the sum of the spline's weights there.
#[test]
fn roundings_of_nodes_do_not_grow_in_faces() {
    let slope = 1e-5;
    let field =
        Field::from_fn([9; 3], [0.125; 3], DVec3::splat(-0.5), 1.0, |p| slope * (p.x + 2.0 * p.y))
            .unwrap();
    let rounding = 0.5 * f64::from((1.5 * slope as f32).next_up() - 1.5 * slope as f32);
    for interpolant in INTERPOLANTS {
        let view = View::along(Axis::Z, DVec3::ZERO);
        let paths = Deviational::new(&field, view, interpolant, Options::default());
        for x in [-0.5, -0.45, 0.0, 0.4, 0.5] {
            for y in [-0.5, -0.45, 0.0, 0.4, 0.5] {
                let e = trace(&paths, &[start(x, y)])[0];
                for (c, expected) in [(0, slope), (1, 2.0 * slope)] {
                    let error = (f64::from(e.deflection_rad[c]) - expected).abs();
                    let bound = 8.0 * rounding / 0.125 + 4e-7 * expected;
                    assert!(error < bound, "{interpolant:?} at {x}, {y}: {error} of {bound}");
                }
            }
        }
    }
}

#[test]
fn directions_with_zeros_and_the_long_diagonal() {
    let field = cube(24, |_| 1e-4);
    for d in
        [DVec3::X, -DVec3::Y, DVec3::new(1.0, 1.0, 0.0), DVec3::new(0.0, -1.0, 1e-300), DVec3::ONE]
    {
        let view = View::new(d, DVec3::Z, DVec3::ZERO).unwrap();
        let e = trace(
            &Deviational::new(
                &field,
                view,
                Interpolant::BSpline,
                Options { quantities: OPD, ..Default::default() },
            ),
            &[start(0.0, 0.0)],
        )[0];
        // In uniform gas the path is eps times the chord.
        let d = d.normalize();
        let chord = 1.0 / d.abs().max_element();
        assert!((f64::from(e.opd_m) / (1e-4 * chord) - 1.0).abs() < 1e-6, "{d}: {}", e.opd_m);
        assert!(e.deflection_rad.iter().all(|u| u.abs() < 1e-11), "{d}: {:?}", e.deflection_rad);
    }
}

#[test]
fn starts_that_are_not_numbers_or_far_away_do_no_harm() {
    let field = cube(16, lopsided);
    let odd = [f32::NAN, f32::INFINITY, -f32::INFINITY, 1e30, -1e30];
    let mut starts: Vec<Start> =
        odd.iter().map(|v| Start { position_m: [*v, 0.0], tilt_rad: [0.0; 2] }).collect();
    starts.extend(odd.iter().map(|v| Start { position_m: [0.01, 0.02], tilt_rad: [*v, 0.0] }));
    starts.push(start(0.01, 0.02));
    for interpolant in INTERPOLANTS {
        for view in [View::along(Axis::X, DVec3::ZERO), oblique()] {
            let paths = Deviational::new(&field, view, interpolant, Options::default());
            let e = trace(&paths, &starts);
            let alone = trace(&paths, &starts[10..])[0];
            assert_eq!(e[10].deflection_rad, alone.deflection_rad);
            assert!(e[..5].iter().all(|e| e.deflection_rad == [0.0; 2]));
        }
    }
    assert!(
        trace(&Deviational::new(&field, oblique(), Interpolant::BSpline, Options::default()), &[])
            .is_empty()
    );
}

#[test]
fn power_of_two_strides_and_their_neighbours_agree_with_the_reference() {
    let starts = grid(12, 0.8);
    let view = View::along(Axis::Z, DVec3::ZERO);
    for n in [62, 63, 64, 65, 126, 128] {
        let field = cube(n, lopsided);
        let options = FullOptions { step_voxels: 1.0, ..Default::default() };
        let spline =
            trace(&Full::new(&field, &BSpline::new(&field), Verlet, view, options), &starts);
        let line =
            trace(&Full::new(&field, &Trilinear::new(&field), Verlet, view, options), &starts);
        let gradient = trace(
            &Full::new(&field, &TrilinearGradient::new(&field), Verlet, view, options),
            &starts,
        );
        for (interpolant, wanted, tolerance) in [
            (Interpolant::BSpline, spline, 5e-7),
            (Interpolant::Trilinear, line, 5e-4),
            (Interpolant::TrilinearGradient, gradient, 1e-6),
        ] {
            let got =
                trace(&Deviational::new(&field, view, interpolant, Options::default()), &starts);
            let (_, max) = difference(&got, &wanted);
            assert!(max < tolerance, "{interpolant:?} {n}: {max:.1e}");
        }
    }
}

#[test]
fn two_nodes_are_a_field() {
    let field = Field::from_fn([2; 3], [1.0; 3], DVec3::splat(-0.5), 1.0, |p| 1e-5 * p.x).unwrap();
    for interpolant in INTERPOLANTS {
        let e = trace(
            &Deviational::new(
                &field,
                View::along(Axis::Z, DVec3::ZERO),
                interpolant,
                Options::default(),
            ),
            &grid(3, 0.9),
        );
        assert!(
            e.iter()
                .all(|e| (e.deflection_rad[0] - 1e-5).abs() < 1e-11
                    && e.deflection_rad[1].abs() < 1e-12),
            "{interpolant:?}"
        );
    }
    let sight = LineOfSight::new(
        &field,
        View::along(Axis::Z, DVec3::ZERO),
        Interpolant::BSpline,
        OPD,
        BlankCells::Opaque,
    );
    assert!(
        trace(&sight, &grid(3, 0.9)).iter().all(|e| (e.deflection_rad[0] - 1e-5).abs() < 1e-11)
    );
}

/// With a gas of eps = 2.7e-4 everywhere and a disturbance a thousand times smaller, the constant
/// must not cost the disturbance its digits.
#[test]
fn a_large_constant_does_not_drown_a_small_signal() {
    let starts = grid(12, 0.8);
    let (alone, drowned) = (
        blob(64, 2.7e-7, 0.12),
        cube(64, |p| 2.7e-4 + 2.7e-7 * (-p.length_squared() / (2.0 * 0.0144)).exp()),
    );
    let trace = |f: &Field| {
        trace(&Deviational::new(f, oblique(), Interpolant::BSpline, Options::default()), &starts)
    };
    let (rms, max) = difference(&trace(&drowned), &trace(&alone));
    // Storing eps in f32 has an error of 6e-8 of 1000 times the signal at each node. A slope of the
    // signal per node is a tenth of it, so the error is 6e-4, averaged over a hundred nodes and
    // more.
    assert!(rms < 5e-4 && max < 3e-3, "rms {rms:.1e}, max {max:.1e}");
}

#[test]
fn nan_cells_are_dark_or_continued_as_requested() {
    let n = 33;
    let mut eps: Vec<f32> = cube(n, |p| 1e-5 * p.x).eps().to_vec();
    // A NaN block in the middle.
    for k in 14..19 {
        for j in 14..19 {
            for i in 14..19 {
                eps[i + n * (j + n * k)] = f32::NAN;
            }
        }
    }
    let field = Field::new([n; 3], [1.0 / 32.0; 3], DVec3::splat(-0.5), eps, 1.0, None).unwrap();
    assert_eq!((field.not_finite(), field.count(Node::Blank)), (125, 125));
    for scheme in [Scheme::Verlet, Scheme::Euler] {
        for (blank, transmission) in [(BlankCells::Opaque, 0.0), (BlankCells::Continued, 1.0)] {
            let options = Options { blank, scheme, ..Default::default() };
            let e = trace(
                &Deviational::new(
                    &field,
                    View::along(Axis::Z, DVec3::ZERO),
                    Interpolant::BSpline,
                    options,
                ),
                &[start(0.0, 0.01), start(0.3, 0.3)],
            );
            assert_eq!((e[0].status, e[0].transmission), (Status::Masked, transmission));
            assert_eq!((e[1].status, e[1].transmission), (Status::Free, 1.0));
            assert!((e[1].deflection_rad[0] - 1e-5).abs() < 1e-10);
            assert!(e.iter().all(|e| e.deflection_rad.iter().all(|u| u.is_finite())));
        }
    }
}

#[test]
fn what_skipping_leaves_out_is_within_its_bound_and_counted() {
    // A small blob in a large box of uniform gas.
    let field = blob(97, 1e-4, 0.04);
    let starts = grid(40, 0.95);
    let view = View::along(Axis::Z, DVec3::ZERO);
    let plain = Deviational::new(
        &field,
        view,
        Interpolant::BSpline,
        Options { quantities: OPD, ..Default::default() },
    );
    let wanted = trace(&plain, &starts);
    assert_eq!(plain.counters().ray_steps_skipped, 0);
    assert!(plain.bricks().is_none());
    for tolerance in [1e-9, 1e-7] {
        let options = Options {
            quantities: OPD,
            skip_rad: tolerance,
            skip_opd_m: 1e-10,
            ..Default::default()
        };
        let paths = Deviational::new(&field, view, Interpolant::BSpline, options);
        let got = trace(&paths, &starts);
        let worst = difference(&got, &wanted).1 * largest(&wanted);
        let c = paths.counters();
        assert!(worst <= tolerance, "{worst:.1e} > {tolerance:.1e}");
        assert!(c.skipped_femtorad as f64 <= tolerance * 1e15 * 1.001);
        assert!(c.ray_steps_skipped > c.ray_steps, "{c:?}");
        assert_eq!((c.rays, c.rays_in_field), (1600, 1600));
        let opd =
            got.iter().zip(&wanted).map(|(a, b)| (a.opd_m - b.opd_m).abs()).fold(0.0, f32::max);
        assert!(opd < 13.0 * 1e-10, "{opd:.1e}");
        // A brick of 512 voxels stores four numbers.
        assert!(paths.bricks().unwrap().memory_bytes() * 16 < field.memory_bytes());
    }
}

#[test]
fn full_march_focuses_a_luneburg_lens_on_a_lattice() {
    // The lens in a box, with n = 1 outside the lens. The slope of n jumps at its surface, and the
    // spline smooths this.
    let n = 96;
    let h = 2.4 / (n - 1) as f64;
    let lens = |p: DVec3| if p.length() < 1.0 { Luneburg.sample(p).0 } else { 0.0 };
    let field = Field::from_fn([n; 3], [h; 3], DVec3::splat(-1.2), 1.0, lens).unwrap();
    let spline = BSpline::new(&field);
    let view = View::along(Axis::Z, DVec3::ZERO);
    let paths = Full::new(
        &field,
        &spline,
        Sharma,
        view,
        FullOptions { quantities: OPD, ..Default::default() },
    );
    let starts: Vec<Start> = [-0.8, -0.4, 0.2, 0.6].into_iter().map(|b| start(b, 0.0)).collect();
    for (s, e) in starts.iter().zip(trace(&paths, &starts)) {
        let b = f64::from(s.position_m[0]);
        assert_eq!(e.status, Status::Free);
        assert!((f64::from(e.deflection_rad[0]) + b).abs() < 5e-3, "{b}: {:?}", e.deflection_rad);
        // From the exit plane at 1.2 back to the focus at 1.
        let slope = -b / (1.0 - b * b).sqrt();
        let x = b + f64::from(e.displacement_m[0]) - 0.2 * slope;
        assert!(x.abs() < 1e-2, "{b}: {x}");
    }
}

#[test]
fn rays_that_turn_back_are_turned() {
    // n^2 falls so fast along the light that the light cannot reach the far side.
    let field = Field::from_fn([33; 3], [1.0 / 32.0; 3], DVec3::splat(-0.5), 1.0, |p| {
        (1.0 - 0.7 * (p.z + 0.5) - 0.7 * (p.x + 0.5)).max(0.04).sqrt() - 1.0
    })
    .unwrap();
    let spline = BSpline::new(&field);
    let view = View::new(DVec3::new(0.9, 0.0, 0.44), DVec3::Y, DVec3::ZERO).unwrap();
    let e = trace(&Full::new(&field, &spline, Pefrl, view, FullOptions::default()), &grid(6, 0.3));
    assert!(e.iter().any(|e| e.status == Status::Turned && e.transmission == 0.0), "{:?}", e[0]);
    assert!(e.iter().all(|e| e.deflection_rad.iter().all(|u| u.is_finite())));
}

#[test]
fn full_and_deviational_agree_where_both_hold() {
    let fibre = Selfoc { gradient_per_m: 0.05 };
    let field = cube(48, |p| fibre.sample(p).0);
    let spline = BSpline::new(&field);
    let starts = grid(8, 0.5);
    let view = View::along(Axis::Z, DVec3::ZERO);
    let wanted = trace(
        &Full::new(
            &field,
            &spline,
            Pefrl,
            view,
            FullOptions { quantities: OPD, ..Default::default() },
        ),
        &starts,
    );
    let got = trace(
        &Deviational::new(
            &field,
            view,
            Interpolant::BSpline,
            Options { quantities: OPD, ..Default::default() },
        ),
        &starts,
    );
    assert!(difference(&got, &wanted).1 < 1e-5);
    for (s, e) in starts.iter().zip(&got) {
        // x = x0 cos(g t) with the path parameter t = z / w_z, where w_z is the index at the entry
        // of the ray.
        let [x, y] = s.position_m.map(f64::from);
        let w_z = (1.0 - 0.0025 * (x * x + y * y)).sqrt();
        let u = -x * 0.05 * (0.05 / w_z).sin();
        assert!(
            (f64::from(e.deflection_rad[0]) - u).abs() < 1e-5 * 0.05 * 0.05,
            "{} {u}",
            e.deflection_rad[0]
        );
    }
}

#[test]
fn parallel_tracing_takes_any_number_of_rays() {
    let field = cube(16, lopsided);
    let paths = Deviational::new(&field, oblique(), Interpolant::Trilinear, Options::default());
    for count in [0, 1, 15, 16, 17, 31, 33, 1025] {
        let starts: Vec<Start> = grid(33, 0.9).into_iter().take(count).collect();
        let mut exits = vec![Exit::UNDISTURBED; starts.len()];
        paths.trace_parallel(&starts, &mut exits);
        assert_eq!(exits.len(), starts.len());
    }
}
