//! Tests the projection along the line of sight against the march and closed forms.

mod common;

use common::{blob, cube, difference, grid, largest, lopsided, oblique, trace};
use glam::DVec3;
use schlieren::analytic::Gaussian;
use schlieren::field::{Field, Node};
use schlieren::interpolate::Interpolant;
use schlieren::march::{BlankCells, Deviational, LineOfSight, Options};
use schlieren::path::{Exit, Jacobian, LightPaths, PathQuantities, Status};
use schlieren::view::{Axis, View};

const OPD: PathQuantities = PathQuantities { opd: true };

fn sight(field: &Field, view: View) -> LineOfSight {
    LineOfSight::new(field, view, Interpolant::BSpline, OPD, BlankCells::Opaque)
}

fn marched(field: &Field, view: View) -> Deviational<'_> {
    Deviational::new(
        field,
        view,
        Interpolant::BSpline,
        Options { quantities: OPD, step_voxels: 0.25, ..Default::default() },
    )
}

/// In gas so thin that rays stay straight, both are the same integral.
#[test]
fn very_weak_gas_looks_as_marched_from_any_side() {
    let field = cube(64, |p| 1e-5 * lopsided(p));
    let starts = grid(24, 0.75);
    for view in [Axis::X, Axis::Y, Axis::Z].map(|a| View::along(a, DVec3::ZERO)) {
        let (got, wanted) =
            (trace(&sight(&field, view), &starts), trace(&marched(&field, view), &starts));
        let (_, max) = difference(&got, &wanted);
        assert!(max < 2e-6, "{view:?}: {max:.1e}");
        let scale = wanted.iter().map(|e| e.opd_m.abs()).fold(0.0, f32::max);
        assert!(got.iter().zip(&wanted).all(|(a, b)| (a.opd_m - b.opd_m).abs() < 2e-6 * scale));
        assert!(got.iter().zip(&wanted).all(|(a, b)| a.exit_depth_m == b.exit_depth_m));
    }
    // Oblique projections are sampled a second time, which adds the second spline's error.
    let (got, wanted) =
        (trace(&sight(&field, oblique()), &starts), trace(&marched(&field, oblique()), &starts));
    let (rms, max) = difference(&got, &wanted);
    assert!(rms < 2e-4 && max < 2e-3, "rms {rms:.1e} max {max:.1e}");
}

#[test]
fn straight_rays_are_off_by_an_amount_of_order_eps() {
    let starts = grid(16, 0.6);
    let error = |amplitude: f64| {
        let field = blob(64, amplitude, 0.12);
        let view = View::along(Axis::Z, DVec3::ZERO);
        difference(&trace(&sight(&field, view), &starts), &trace(&marched(&field, view), &starts)).1
    };
    let (small, large) = (error(1e-4), error(1e-3));
    assert!(large > 5e-5 && large < 5e-3, "{large:.1e}");
    assert!((large / small - 10.0).abs() < 1.0, "{large:.1e} {small:.1e}");
}

/// The deflection is proportional to eps: to the last bit for powers of two, because the
/// computation has only products and sums.
#[test]
fn linearity_bit_exact() {
    let starts = grid(20, 0.9);
    for view in [View::along(Axis::X, DVec3::ZERO), oblique()] {
        let wanted = trace(&sight(&cube(32, lopsided), view), &starts);
        for k in [-3, -9, 4] {
            let factor = f64::from(k).exp2();
            let got = trace(&sight(&cube(32, |p| factor * lopsided(p)), view), &starts);
            for (a, b) in got.iter().zip(&wanted) {
                assert_eq!(a.deflection_rad, b.deflection_rad.map(|u| u * factor as f32));
                assert_eq!(a.opd_m, b.opd_m * factor as f32);
            }
        }
    }
}

#[test]
fn blob_and_its_second_derivatives_are_the_closed_form() {
    let g = Gaussian { amplitude: 1e-6, sigma_m: 0.08 };
    let field = blob(100, g.amplitude, g.sigma_m);
    let starts = grid(20, 0.8);
    let paths = sight(&field, View::along(Axis::Z, DVec3::ZERO));
    let mut exits = vec![Exit::UNDISTURBED; starts.len()];
    let mut jacobians = vec![Jacobian::default(); starts.len()];
    paths.trace_with_jacobians(&starts, &mut exits, &mut jacobians);
    let scale = largest(&exits);
    let second = g.jacobian_per_m(0.0, 0.0, 0.5)[0].abs();
    for ((s, e), j) in starts.iter().zip(&exits).zip(&jacobians) {
        let [x, y] = s.position_m.map(f64::from);
        let u = g.deflection_rad(x, y, 0.5);
        let [xx, xy, yy] = g.jacobian_per_m(x, y, 0.5);
        for c in 0..2 {
            assert!((f64::from(e.deflection_rad[c]) - u[c]).abs() < 1e-4 * scale);
        }
        assert!(
            (f64::from(e.opd_m) - g.path_difference_m(x, y, 0.5)).abs()
                < 1e-5 * g.path_difference_m(0.0, 0.0, 0.5)
        );
        let got = j.deflection_per_m.map(|r| r.map(f64::from));
        for (a, b) in [(got[0][0], xx), (got[0][1], xy), (got[1][0], xy), (got[1][1], yy)] {
            assert!((a - b).abs() < 2e-3 * second);
        }
    }
}

/// In an oblique projection the box has the shape of a prism, but light enters and leaves through
/// windows normal to it.
#[test]
fn uniform_gas_in_an_oblique_box_is_no_prism() {
    let field = cube(32, |_| 1e-4);
    let e = trace(&sight(&field, oblique()), &grid(16, 0.5));
    assert!(e.iter().all(|e| e.deflection_rad.iter().all(|u| u.abs() < 1e-10)), "{}", largest(&e));
    assert!(e.iter().all(|e| e.opd_m > 1e-5));
}

#[test]
fn photons_beside_the_field_are_free() {
    let field = cube(16, |_| 1e-4);
    for view in [View::along(Axis::Y, DVec3::ZERO), oblique()] {
        let mut starts = grid(2, 0.1);
        starts[0].position_m = [3.0, 0.0];
        starts[1].position_m = [f32::NAN, 0.0];
        starts[2].position_m = [0.0, -1e30];
        let e = trace(&sight(&field, view), &starts);
        for e in &e[..3] {
            assert_eq!((e.deflection_rad, e.opd_m, e.status), ([0.0; 2], 0.0, Status::Free));
        }
        assert!(e[3].opd_m > 0.9e-4);
    }
}

#[test]
fn solids_throw_shadows_from_every_side() {
    let n = 33;
    let mut nodes = vec![Node::Gas; n * n * n];
    let at = |i: usize| i as f64 / (n - 1) as f64 - 0.5;
    for (o, node) in nodes.iter_mut().enumerate() {
        let p = DVec3::new(at(o % n), at(o / n % n), at(o / n / n));
        if p.length() < 0.2 {
            *node = Node::Solid;
        }
    }
    let h = 1.0 / (n - 1) as f64;
    let field =
        Field::new([n; 3], [h; 3], DVec3::splat(-0.5), vec![1e-5; n * n * n], 1.0, Some(nodes))
            .unwrap();
    let starts = grid(40, 0.9);
    for view in [View::along(Axis::X, DVec3::ZERO), oblique()] {
        let (a, b) = (trace(&sight(&field, view), &starts), trace(&marched(&field, view), &starts));
        let (mut dark, mut differ) = (0, 0);
        for ((s, a), b) in starts.iter().zip(&a).zip(&b) {
            let r = f64::from(s.position_m[0].hypot(s.position_m[1]));
            // The body's surface is known within a voxel.
            if r < 0.2 - 1.5 * h {
                assert_eq!((a.status, a.transmission), (Status::Blocked, 0.0), "{s:?}");
                assert_eq!((b.status, b.transmission), (Status::Blocked, 0.0), "{s:?}");
                dark += 1;
            } else if r > 0.2 + 1.5 * h {
                assert_eq!((a.status, a.transmission), (Status::Free, 1.0), "{s:?}");
                assert_eq!((b.status, b.transmission), (Status::Free, 1.0), "{s:?}");
            }
            differ += usize::from(a.status != b.status);
        }
        assert!(dark > 100 && differ < starts.len() / 20, "{dark} {differ}");
    }
}
