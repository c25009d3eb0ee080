//! Tests that plans keep the requested tolerance, or warn.

mod common;

use common::{blob, cube, grid, lopsided, oblique};
use glam::DVec3;
use schlieren::interpolate::Interpolant;
use schlieren::path::{Exit, LightPaths, PathQuantities, Start};
use schlieren::plan::{Mode, Plan, Request};
use schlieren::render::TestSection;
use schlieren::scene::Scene;
use schlieren::view::{Axis, View};

fn request(tolerance_rad: f64) -> Request {
    Request { tolerance_rad, ..Request::default() }
}

#[test]
fn weaker_tolerances_are_cheaper() {
    let field = blob(64, 1e-4, 0.12);
    let plans = [1e-2, 1e-4, 1e-7, 0.0].map(|t| Plan::new(&field, request(t)));
    assert_eq!(plans[0].mode, Mode::LineOfSight);
    assert_eq!(plans[2].mode, Mode::Paraxial);
    for p in plans.windows(2) {
        assert!(p[1].step_voxels <= p[0].step_voxels || p[0].mode == Mode::LineOfSight, "{p:?}");
    }
    assert_eq!(plans[3].interpolant, Interpolant::BSpline);
}

#[test]
fn strong_index_is_traced_in_full() {
    assert_eq!(Plan::new(&cube(16, |p| 0.33 * (1.0 - p.length())), request(1e-3)).mode, Mode::Full);
}

#[test]
fn what_is_forced_is_kept() {
    let field = blob(24, 1e-3, 0.15);
    for mode in [Mode::LineOfSight, Mode::Paraxial, Mode::Full] {
        let request = Request {
            mode: Some(mode),
            interpolant: Some(Interpolant::Trilinear),
            step_voxels: Some(0.7),
            ..request(1e-9)
        };
        let p = Plan::new(&field, request);
        assert_eq!((p.mode, p.interpolant, p.step_voxels), (mode, Interpolant::Trilinear, 0.7));
    }
}

/// Measured errors are within the bounds, and within the tolerance where the bound of the lattice's
/// own error permits it. (Where it does not, the plan's bounds show this.)
/// `the_tolerance_asked_for_is_got_or_a_warning_names_why_not` tests the errors against the truth.
#[test]
fn errors_are_within_bounds_and_bounds_within_tolerance_where_possible() {
    let fields =
        [blob(64, 1e-4, 0.12), blob(48, 1e-6, 0.15), cube(48, lopsided), blob(64, 1e-3, 0.15)];
    let mut possible = 0;
    for field in &fields {
        for tolerance in [1e-3, 1e-5, 1e-6, 1e-7, 1e-9] {
            for view in [View::along(Axis::X, DVec3::ZERO), oblique()] {
                let plan = Plan::new(
                    field,
                    Request { direction: Some(view.forward), ..request(tolerance) },
                );
                let b = plan.bounds;
                let achieved = plan.measure(field, view, 200);
                // Arithmetic in f32 adds 1e-6 of the deflection.
                let floor = 1e-6 * b.deflection_rad;
                assert!(
                    achieved.max_rad <= b.total_rad() + floor,
                    "{tolerance}: {plan:?} {achieved:?}"
                );
                if b.interpolation_rad <= 0.25 * tolerance && floor <= 0.25 * tolerance {
                    possible += 1;
                    assert!(b.total_rad() <= tolerance, "{tolerance}: {plan:?}");
                    assert!(achieved.max_rad <= tolerance, "{tolerance}: {plan:?} {achieved:?}");
                }
                assert!(achieved.rms_rad <= achieved.max_rad && achieved.rays > 100);
                assert!(achieved.resolution_rad.is_finite());
            }
        }
    }
    assert!(possible >= 12, "possible in {possible} of 40 cases only");
}

type Eps = fn(DVec3) -> f64;

/// Flows in a cube of 1 m with 49 nodes per side. Only the shock is steeper than the lattice can
/// resolve.
const FLOWS: [(&str, Eps); 6] = [
    // Has no second differences along the lattice's axes, and a gradient on all faces.
    ("saddle", |p| 1e-3 * p.x * p.y),
    ("oblique saddle", |p| 1e-3 * (p.x + 0.5 * p.z) * (p.y - 0.25 * p.x)),
    ("ring", |p| {
        1e-4 * (-((p.x.hypot(p.y) - 0.2).powi(2) + p.z * p.z) / (2.0 * 0.08 * 0.08)).exp()
    }),
    ("shear layer", |p| 2e-5 * (p.y / 0.08).tanh()),
    ("smeared shock", |p| 5e-5 * ((0.8 * p.x + 0.6 * p.y + 0.03) / 0.02).tanh()),
    ("blob", |p| 1e-4 * (-p.length_squared() / (2.0 * 0.12 * 0.12)).exp()),
];

const NODES: usize = 49;

/// eps and its gradient at the nearest point of the cube: outside, values are continued from the
/// faces, as in all marches.
fn sample(eps: Eps, at: DVec3) -> (f64, DVec3) {
    let at = at.clamp(DVec3::splat(-0.5), DVec3::splat(0.5));
    // Central differences of fourth order: 1e-12 of the gradient, far below all tolerances.
    let h = 1e-3;
    let along = |axis: DVec3| {
        let e = |k: f64| eps(at + k * h * axis);
        (8.0 * (e(1.0) - e(-1.0)) - (e(2.0) - e(-2.0))) / (12.0 * h)
    };
    (eps(at), DVec3::from(DVec3::AXES.map(along)))
}

/// Deflection and optical path difference of the ray of a start, by RK4 in `f64` with the flow's
/// own formula and without a lattice: position and optical momentum p = n t over dtau = ds / n,
/// from the entry to the exit plane.
fn truth(eps: Eps, view: &View, start: &Start) -> Option<([f64; 2], f64)> {
    const STEPS: usize = 800;
    let [x, y] = start.position_m.map(f64::from);
    let at = view.centre_m + view.right * x + view.up * y;
    let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
    for c in 0..3 {
        let d = view.forward[c];
        if d == 0.0 {
            (near, far) = if at[c].abs() > 0.5 { (0.0, 0.0) } else { (near, far) };
        } else {
            let (a, b) = ((-0.5 - at[c]) / d, (0.5 - at[c]) / d);
            (near, far) = (near.max(a.min(b)), far.min(a.max(b)));
        }
    }
    if near >= far {
        return None;
    }
    // In deviations: the ray's position is at + tau w + xi, its momentum w + u.
    let (entry, w) = (at + near * view.forward, view.forward);
    let (mut xi, mut u) = (DVec3::ZERO, sample(eps, entry).0 * w);
    let mut path = 0.0;
    let rate = |tau: f64, xi: DVec3, u: DVec3| {
        let (e, g) = sample(eps, entry + tau * w + xi);
        // n² - w_z: the optical path minus that of light in the reference medium along w.
        (u, (1.0 + e) * g, e * (2.0 + e) - u.dot(w))
    };
    let step = |tau: f64, dt: f64, xi: &mut DVec3, u: &mut DVec3, path: &mut f64| {
        let a = rate(tau, *xi, *u);
        let b = rate(tau + 0.5 * dt, *xi + 0.5 * dt * a.0, *u + 0.5 * dt * a.1);
        let c = rate(tau + 0.5 * dt, *xi + 0.5 * dt * b.0, *u + 0.5 * dt * b.1);
        let d = rate(tau + dt, *xi + dt * c.0, *u + dt * c.1);
        let sum = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| dt / 6.0 * (a + 2.0 * (b + c) + d);
        *xi += sum(a.0, b.0, c.0, d.0);
        *u += sum(a.1, b.1, c.1, d.1);
        *path += dt / 6.0 * (a.2 + 2.0 * (b.2 + c.2) + d.2);
    };
    let dt = (far - near) / STEPS as f64;
    for k in 0..STEPS {
        step(k as f64 * dt, dt, &mut xi, &mut u, &mut path);
    }
    // Back to the exit plane.
    let rest = -xi.dot(w) / (1.0 + u.dot(w));
    step(far - near, rest, &mut xi, &mut u, &mut path);
    Some(([u.dot(view.right), u.dot(view.up)], path))
}

/// Largest errors of deflections and of optical paths (0 when not wanted) against the truth.
fn errors(
    paths: &dyn LightPaths,
    starts: &[Start],
    truths: &[Option<([f64; 2], f64)>],
) -> [f64; 2] {
    let mut exits = vec![Exit::UNDISTURBED; starts.len()];
    paths.trace(starts, &mut exits);
    let (mut angle, mut path) = (0.0f64, 0.0f64);
    for (exit, truth) in exits.iter().zip(truths) {
        let Some((deflection, opd)) = truth else { continue };
        let d = [0, 1].map(|c| f64::from(exit.deflection_rad[c]) - deflection[c]);
        let d = d[0].hypot(d[1]);
        assert!(d.is_finite());
        angle = angle.max(d);
        if paths.quantities().opd {
            path = path.max((f64::from(exit.opd_m) - opd).abs());
        }
    }
    [angle, path]
}

#[test]
fn the_tolerance_asked_for_is_got_or_a_warning_names_why_not() {
    let (mut straight, mut bent, mut got, mut warned, mut for_nothing) = (0, 0, 0, 0, 0);
    for (name, eps) in FLOWS {
        let field = cube(NODES, eps);
        for (axis, view) in [
            ("x", View::along(Axis::X, DVec3::ZERO)),
            ("z", View::along(Axis::Z, DVec3::ZERO)),
            ("oblique", oblique()),
        ] {
            let starts = grid(11, 1.1);
            let truths: Vec<_> = starts.iter().map(|s| truth(eps, &view, s)).collect();
            let longest_m = (field.size_m() / view.forward.abs()).min_element();
            for opd in [false, true] {
                // The best result with this lattice: everything refined, in f64.
                let finest = Request {
                    mode: Some(Mode::Full),
                    interpolant: Some(Interpolant::BSpline),
                    step_voxels: Some(0.25),
                    quantities: PathQuantities { opd },
                    ..request(0.0)
                };
                let of_lattice =
                    errors(&*Plan::new(&field, finest).paths(&field, view), &starts, &truths);
                for tolerance in [1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9] {
                    let mut scene =
                        Scene::from_toml("[flow]\nfile = \"\"\ndensity = \"-\"").unwrap();
                    scene.march.tolerance_rad = tolerance;
                    let mut section =
                        TestSection::of_fields(&scene, vec![field.clone()], None).unwrap();
                    section.view = view;
                    let planned =
                        section.paths(&scene, 0, PathQuantities { opd }, false, true).unwrap();
                    let [angle, path] = errors(&*planned.paths, &starts, &truths);
                    let what = format!(
                        "{name} along {axis}, {tolerance:e} asked: {angle:.1e} rad, {path:.1e} m \
                         got by {}; the lattice's {:.1e} rad, {:.1e} m; {:?}",
                        planned.description, of_lattice[0], of_lattice[1], planned.warnings
                    );
                    if planned.description.starts_with("line-of-sight") {
                        straight += 1;
                    } else {
                        bent += 1;
                    }
                    // An error of the optical path of the tolerance times the path length has
                    // slopes of the tolerance.
                    let kept = angle <= tolerance && path <= tolerance * longest_m;
                    // f32 keeps deflections within 1e-6 of the largest, which is 1e-3 rad in these
                    // flows: the plan has to find out that f64 is needed.
                    let can = of_lattice[0] <= 0.5 * tolerance
                        && of_lattice[1] <= 0.5 * tolerance * longest_m;
                    assert!(kept || !can, "the lattice can: {what}");
                    let named = |w: &String| {
                        w.contains("lattice") && w.contains(&format!("{tolerance:.1e}"))
                    };
                    let is_warned = planned.warnings.iter().any(named);
                    assert!(kept || is_warned, "no warning: {what}");
                    got += usize::from(kept);
                    warned += usize::from(is_warned);
                    for_nothing += usize::from(is_warned && angle < 0.05 * tolerance);
                }
            }
        }
    }
    // All cases occur, and no warning is unnecessary.
    assert!(
        straight >= 30 && bent >= 60 && got >= 120 && warned >= 20,
        "{straight} {bent} {got} {warned}"
    );
    assert!(for_nothing == 0, "{for_nothing} of {warned} warnings for nothing");
}

#[test]
fn a_plan_that_misses_its_tolerance_is_refined_until_it_keeps_it() {
    use schlieren::march::FieldCache;
    let mut refined = [0; 3];
    let view = oblique();
    for (name, eps) in FLOWS {
        let (field, cache) = (cube(NODES, eps), FieldCache::default());
        for tolerance in [1e-6, 1e-8] {
            let asked = Request { direction: Some(view.forward), ..request(tolerance) };
            let good = Plan::new(&field, asked);
            // The bounds of these flows hold. Coarser plans are what a bound that fails would make.
            let [straight, linear, long] = [
                Plan { mode: Mode::LineOfSight, ..good },
                Plan { mode: Mode::Paraxial, interpolant: Interpolant::Trilinear, ..good },
                Plan { mode: Mode::Paraxial, step_voxels: 16.0, ..good },
            ];
            for plan in [straight, linear, long] {
                let before = plan.measure(&field, view, 200);
                let (chosen, after) = plan.within_tolerance(&field, view, 200, &cache);
                let what = format!("{name}, {tolerance:e}: {plan:?} {before:?}, {chosen:?}");
                let of_flow = before.of_flow_rad();
                let goal = (tolerance - of_flow).max(0.1 * of_flow);
                assert!(chosen.request == asked && after.max_rad <= goal, "{after:?} of {what}");
                assert_eq!(chosen == plan, before.max_rad <= goal, "{what}");
                refined[chosen.mode as usize] += usize::from(chosen != plan);
                // What it says is what it does.
                assert_eq!(chosen.measure(&field, view, 200), after, "{what}");
            }
        }
    }
    assert!(refined[Mode::Paraxial as usize] >= 6, "{refined:?}");
}

#[test]
fn what_is_forced_is_not_refined() {
    use schlieren::march::FieldCache;
    let field = blob(48, 1e-4, 0.12);
    let forced = Request {
        mode: Some(Mode::Paraxial),
        interpolant: Some(Interpolant::Trilinear),
        step_voxels: Some(8.0),
        ..request(1e-9)
    };
    let plan = Plan::new(&field, forced);
    let cache = FieldCache::default();
    let (chosen, error) = plan.within_tolerance(&field, oblique(), 100, &cache);
    assert!(chosen == plan && error.max_rad > 1e-9, "{chosen:?} {error:?}");
}

/// A plan that used only differences along the lattice's axes, which are zero for a saddle, would
/// choose straight rays at any tolerance.
#[test]
fn a_saddle_is_not_free_of_curvature() {
    let field = cube(NODES, FLOWS[0].1);
    let plan = Plan::new(&field, Request { direction: Some(DVec3::Z), ..request(1e-9) });
    assert_eq!(plan.mode, Mode::Paraxial, "{plan:?}");
    assert!(
        (plan.derivative_bounds.second / (1e-3 * 2f64.sqrt()) - 1.0).abs() < 1e-3,
        "{:?}",
        plan.derivative_bounds
    );
}

/// Steps much shorter than the lattice's resolution are wasted.
#[test]
fn coarse_lattices_do_not_ask_for_short_steps() {
    let field = blob(16, 1e-3, 0.08);
    let plan = Plan::new(&field, request(1e-9));
    assert_eq!(plan.mode, Mode::Paraxial);
    assert!(plan.bounds.interpolation_rad > 1e-9 && plan.step_voxels >= 0.5, "{plan:?}");
    assert!(Plan::new(&field, request(0.0)).step_voxels < plan.step_voxels);
}

/// Largest deflection error of the spline, and its estimate, in a cube with `nodes` per side.
fn resolution(nodes: usize, eps: Eps, view: View) -> [f64; 2] {
    let field = cube(nodes, eps);
    let starts = grid(15, 0.999);
    let truths: Vec<_> = starts.iter().map(|s| truth(eps, &view, s)).collect();
    let finest = Request {
        mode: Some(Mode::Full),
        interpolant: Some(Interpolant::BSpline),
        step_voxels: Some(0.25),
        ..request(0.0)
    };
    let plan = Plan::new(&field, finest);
    let error = errors(&*plan.paths(&field, view), &starts, &truths)[0];
    [error, plan.measure(&field, view, 400).resolution_rad]
}

#[test]
fn the_error_of_a_lattice_is_estimated_within_its_order_of_magnitude() {
    let wall_layer: Eps = |p| 1e-4 * (-(p.y + 0.5) / 0.06).exp();
    let small_blob: Eps = |p| 1e-4 * (-p.length_squared() / (2.0 * 0.04 * 0.04)).exp();
    let waves: Eps = |p| 1e-5 * (25.0 * (p.x + 0.3 * p.y)).sin();
    for (name, eps) in [
        ("shear layer", FLOWS[3].1),
        ("blob", FLOWS[5].1),
        ("wall layer", wall_layer),
        ("small blob", small_blob),
        ("waves", waves),
    ] {
        // Lattices with an odd number of nodes have a half, those with an even number have none.
        for nodes in [40, 41] {
            for view in [View::along(Axis::Z, DVec3::ZERO), oblique()] {
                let [error, estimate] = resolution(nodes, eps, view);
                let ratio = estimate / error;
                assert!(
                    (0.5..12.0).contains(&ratio),
                    "{name}, {nodes} nodes, {:?}: {estimate:.1e} for {error:.1e}",
                    view.forward
                );
            }
        }
    }
}

#[test]
fn what_a_lattice_has_exactly_is_not_called_unresolved() {
    let linear: Eps = |p| 1e-4 * (p.x + 2.0 * p.y);
    for nodes in [40, 41] {
        let field = cube(nodes, linear);
        let view = View::along(Axis::Z, DVec3::ZERO);
        let m = Plan::new(&field, request(1e-9)).measure(&field, view, 200);
        assert!(m.resolution_rad < 1e-9, "{nodes} nodes: {m:?}");
    }
}

/// Between two nodes a jump may be anywhere, and no interpolant knows where.
#[test]
fn jumps_from_node_to_node_are_not_underestimated() {
    let jump: Eps = |p| if 0.8 * p.x + 0.6 * p.y + 0.03 > 0.0 { 5e-5 } else { -5e-5 };
    for nodes in [40, 49] {
        for view in [View::along(Axis::X, DVec3::ZERO), View::along(Axis::Z, DVec3::ZERO)] {
            let [error, estimate] = resolution(nodes, jump, view);
            assert!(estimate > 0.8 * error, "{nodes} nodes: {estimate:.1e} for {error:.1e}");
        }
    }
}
