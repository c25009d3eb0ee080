//! Tolerances asked for, and errors got.

mod common;

use common::{blob, cube, lopsided, oblique};
use glam::DVec3;
use schlieren::interpolate::Interpolant;
use schlieren::plan::{Mode, Plan, Request};
use schlieren::view::{Axis, View};

fn ask(tolerance_rad: f64) -> Request {
    Request { tolerance_rad, ..Request::default() }
}

#[test]
fn weaker_tolerances_are_cheaper() {
    let field = blob(64, 1e-4, 0.12);
    let plans = [1e-2, 1e-4, 1e-7, 0.0].map(|t| Plan::new(&field, ask(t)));
    assert_eq!(plans[0].mode, Mode::LineOfSight);
    assert_eq!(plans[2].mode, Mode::Paraxial);
    for p in plans.windows(2) {
        assert!(p[1].step_voxels <= p[0].step_voxels || p[0].mode == Mode::LineOfSight, "{p:?}");
    }
    assert_eq!(plans[3].interpolant, Interpolant::BSpline);
}

#[test]
fn strong_index_is_traced_in_full() {
    assert_eq!(Plan::new(&cube(16, |p| 0.33 * (1.0 - p.length())), ask(1e-3)).mode, Mode::Full);
}

#[test]
fn what_is_forced_is_kept() {
    let field = blob(24, 1e-3, 0.15);
    for mode in [Mode::LineOfSight, Mode::Paraxial, Mode::Full] {
        let request = Request {
            mode: Some(mode),
            interpolant: Some(Interpolant::Trilinear),
            step_voxels: Some(0.7),
            ..ask(1e-9)
        };
        let p = Plan::new(&field, request);
        assert_eq!((p.mode, p.interpolant, p.step_voxels), (mode, Interpolant::Trilinear, 0.7));
    }
}

/// Bounds that are within the tolerance must hold for what is measured. (Where no bound is within it, the plan says so by its bounds.)
#[test]
fn errors_are_within_bounds_and_bounds_within_tolerance_where_possible() {
    let fields = [blob(64, 1e-4, 0.12), blob(48, 1e-6, 0.15), cube(48, lopsided), blob(64, 1e-3, 0.15)];
    for field in &fields {
        for tolerance in [1e-3, 1e-5, 1e-6, 1e-7, 1e-9] {
            let plan = Plan::new(field, ask(tolerance));
            let b = plan.bounds;
            for view in [View::along(Axis::X, DVec3::ZERO), oblique()] {
                let achieved = plan.measure(field, view, 200);
                let bound = b.bending_rad + b.interpolation_rad + b.step_rad;
                // Arithmetic in f32 adds 1e-6 of the deflection; the oblique projection a spline of its own.
                let floor = 1e-6 * b.deflection_rad;
                let oblique = if plan.mode == Mode::LineOfSight { b.interpolation_rad } else { 0.0 };
                assert!(achieved.max_rad <= bound + floor + oblique, "{tolerance}: {plan:?} {achieved:?}");
                assert!(achieved.rms_rad <= achieved.max_rad && achieved.rays > 100);
                assert!(achieved.resolution_rad.is_finite());
            }
        }
    }
}

/// Steps shorter than what the lattice can tell are wasted.
#[test]
fn coarse_lattices_do_not_ask_for_short_steps() {
    let field = blob(16, 1e-3, 0.08);
    let plan = Plan::new(&field, ask(1e-9));
    assert_eq!(plan.mode, Mode::Paraxial);
    assert!(plan.bounds.interpolation_rad > 1e-9 && plan.step_voxels >= 0.5, "{plan:?}");
    assert!(Plan::new(&field, ask(0.0)).step_voxels < plan.step_voxels);
}
