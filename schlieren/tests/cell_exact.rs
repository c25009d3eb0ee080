//! Tests the cell-exact march against closed forms, against itself, and against the adaptive march,
//! which does not notice kinks.

mod common;

use common::{blob, cube, grid, lopsided, oblique};
use glam::DVec3;
use schlieren::analytic::{Gaussian, Luneburg};
use schlieren::field::Field;
use schlieren::interpolate::{BSpline, Interpolate, Trilinear, TrilinearGradient};
use schlieren::march::{
    CellExact, DormandPrince, Integrator, InterpolatedMedium, LineIntegrals, Medium, Points, Ray,
};
use std::f64::consts::FRAC_PI_2;

/// A lattice on which steps are split; its values do not matter.
fn lattice(n: usize, half_m: f64) -> CellExact {
    let h = 2.0 * half_m / (n - 1) as f64;
    CellExact::new(&Field::from_fn([n; 3], [h; 3], DVec3::splat(-half_m), 1.0, |_| 0.0).unwrap())
}

/// Noise: neighbouring nodes are uncorrelated, so every face is a kink.
fn noise(dims: [usize; 3]) -> Field {
    let spacing = dims.map(|n| 1.0 / (n - 1) as f64);
    Field::from_fn(dims, spacing, DVec3::splat(-0.5), 1.0, |p| {
        1e-5 * (1e4 * (p.x * 12.9898 + p.y * 78.233 + p.z * 37.719)).sin()
    })
    .unwrap()
}

/// Lines through the cube: oblique, along an axis, in a plane of nodes, and along the diagonal.
fn lines() -> Vec<(DVec3, DVec3, f64)> {
    let through = |from: DVec3, to: DVec3| (from, (to - from).normalize(), (to - from).length());
    vec![
        through(DVec3::new(-0.5, -0.31, 0.17), DVec3::new(0.5, 0.23, -0.41)),
        through(DVec3::new(0.13, 0.5, -0.07), DVec3::new(0.13, -0.5, -0.07)),
        through(DVec3::new(-0.5, -0.5, -0.2), DVec3::new(0.5, 0.5, -0.2)),
        through(DVec3::splat(-0.5), DVec3::splat(0.5)),
    ]
}

fn all_points(
    cells: &CellExact,
    medium: &impl Medium,
    line: (DVec3, DVec3, f64),
) -> [LineIntegrals; 3] {
    [Points::Two, Points::Three, Points::Five]
        .map(|p| cells.line_of_sight(medium, line.0, line.1, line.2, p))
}

/// Along a line a trilinear function is a cubic polynomial and its gradient a quadratic one, so two
/// points are exact.
#[test]
fn two_points_integrate_trilinear_cells_to_rounding() {
    let field = noise([13, 9, 11]);
    let cells = CellExact::new(&field);
    let (eps, gradients) = (Trilinear::new(&field), TrilinearGradient::new(&field));
    for line in lines() {
        let medium = InterpolatedMedium::new(&field, &eps);
        let [two, three, five] = all_points(&cells, &medium, line);
        let scale = 1e-5 * 13.0;
        for other in [three, five] {
            assert!((two.slope - other.slope).length() < 1e-14 * scale, "{two:?} {other:?}");
            assert!((two.path_m - other.path_m).abs() < 1e-15 * 1e-5 * 10.0);
        }
        // eps is continuous, so the integral of its derivative along the line is its difference
        // between the ends. Rays in a plane of nodes have no defined slope across it, but one along
        // it.
        let end = line.0 + line.1 * line.2;
        let gained = medium.sample(end).0 - medium.sample(line.0).0;
        assert!(
            (two.slope.dot(line.1) - gained).abs() < 1e-14 * scale,
            "{} {gained}",
            two.slope.dot(line.1)
        );

        let medium = InterpolatedMedium::new(&field, &gradients);
        let [two, _, five] = all_points(&cells, &medium, line);
        assert!((two.slope - five.slope).length() < 1e-14 * scale, "{two:?} {five:?}");
    }
}

/// The degree of the spline along an oblique line is 9.
#[test]
fn five_points_integrate_splines_to_rounding() {
    let field = noise([13, 9, 11]);
    let (cells, spline) = (CellExact::new(&field), BSpline::new(&field));
    let medium = InterpolatedMedium::new(&field, &spline);
    for line in lines() {
        let [two, three, five] = all_points(&cells, &medium, line);
        let gained = medium.sample(line.0 + line.1 * line.2).0 - medium.sample(line.0).0;
        let off = |s: &LineIntegrals| (s.slope.dot(line.1) - gained).abs() / (13.0 * 1e-5);
        assert!(off(&five) < 1e-14, "{:e}", off(&five));
        // Only along an axis is it a cubic polynomial.
        if line.1.abs().max_element() < 0.99 {
            assert!(
                off(&two) > off(&three) && off(&three) > off(&five),
                "{:e} {:e}",
                off(&two),
                off(&three)
            );
        }
    }
}

/// Closed form for the blob: OPD = A s √(2π) erf(h/(s√2)) exp(-b²/2s²), and its slope. Halving the
/// cells divides the error by 2⁶.
#[test]
fn straight_lines_through_a_gaussian_are_the_closed_form() {
    let g = Gaussian { amplitude: 1e-4, sigma_m: 0.12 };
    let (from, length_m) = (DVec3::new(0.07, -0.05, -0.5), 1.0);
    let path_m = g.path_difference_m(0.07, -0.05, 0.5);
    let slope = -DVec3::new(0.07, -0.05, 0.0) / (0.12 * 0.12) * path_m;
    let error = |n: usize| {
        let s = lattice(n, 0.5).line_of_sight(&g, from, DVec3::Z, length_m, Points::Three);
        assert_eq!(s.pieces as usize, n - 1);
        ((s.slope - slope).length() / slope.length()).max((s.path_m - path_m).abs() / path_m)
    };
    // The errors of the rule cancel except at the ends, where the blob has nearly vanished, so at
    // first they fall even faster.
    let errors = [5, 9, 17, 33].map(error);
    assert!(errors[0] / errors[1] > 64.0, "{errors:?}");
    assert!(errors[1..].windows(2).all(|e| e[0] / e[1] > 48.0), "{errors:?}");
    assert!(error(65) < 1e-12);
    // Through the spline of the blob, the interpolant's own error remains
    // (`interpolation_errors_are_those_on_record`: 7.5e-6 for a sigma of ten voxels; here it is
    // 14).
    let field = blob(121, g.amplitude, g.sigma_m);
    let (cells, spline) = (CellExact::new(&field), BSpline::new(&field));
    let s = cells.line_of_sight(
        &InterpolatedMedium::new(&field, &spline),
        from,
        DVec3::Z,
        length_m,
        Points::Three,
    );
    assert!(
        (s.slope - slope).length() < 1e-5 * slope.length(),
        "{:e}",
        (s.slope - slope).length() / slope.length()
    );
}

/// Bent rays: a quarter turn of a Luneburg lens ends in one point. The order is 6.
#[test]
fn bent_rays_are_the_closed_form_at_order_six() {
    let error = |n: usize| {
        let cells = lattice(n, 1.3);
        let off = |i: i32| {
            let b = 0.037 + 0.17 * f64::from(i);
            let (at, w) = Luneburg::ray(b, 0.0);
            let end = cells.run(&Luneburg, &Ray::new(at, w), FRAC_PI_2, 1);
            assert!((end.tau_m - FRAC_PI_2).abs() < 1e-14);
            (end.position_m() - Luneburg::ray(b, FRAC_PI_2).0).length()
        };
        ((-5..5).map(|i| off(i).powi(2)).sum::<f64>() / 10.0).sqrt()
    };
    let [coarse, fine] = [error(17), error(33)];
    let order = (coarse / fine).log2();
    assert!(fine < 2e-12 && (order - 6.0).abs() < 0.2, "{coarse:e} {fine:e}: order {order}");
}

fn relative(a: DVec3, b: DVec3, scale: f64) -> f64 {
    (a - b).length() / scale
}

/// Results of the cell-exact and of the adaptive march for a ray of an oblique view through the
/// unit cube.
struct Both {
    u: DVec3,
    adaptive: DVec3,
    /// The adaptive march's own estimate of its error.
    estimate: f64,
}

fn both<I: Interpolate>(
    field: &Field,
    i: &I,
    tolerance: f64,
    longest_step_m: f64,
    steps: u32,
) -> Vec<Both> {
    let medium = InterpolatedMedium::new(field, i);
    let cells = CellExact::new(field);
    let view = oblique();
    let adaptive = DormandPrince { tolerance, longest_step_m };
    let one = |s: &schlieren::path::Start| {
        let [x, y] = s.position_m.map(f64::from);
        let begin =
            Ray::inside(&medium, view.right * x + view.up * y - view.forward * 0.35, view.forward);
        let run = adaptive.run(&medium, &begin, 0.7).unwrap();
        Both {
            u: cells.run(&medium, &begin, 0.7, steps).u,
            adaptive: run.ray.u,
            estimate: run.error,
        }
    };
    grid(4, 0.5).iter().map(one).collect()
}

#[test]
fn agrees_with_the_adaptive_march_where_the_interpolant_is_smooth() {
    // Sigma is four voxels and more. (With 2.7 voxels, the error of three points per cell is 2e-9.)
    let field = cube(49, |p| 30.0 * lopsided(p));
    let spline = BSpline::new(&field);
    let rays = both(&field, &spline, 1e-15, 0.25 / 48.0, 1);
    let scale = rays.iter().map(|r| r.u.length()).fold(0.0, f64::max);
    assert!(scale > 1e-3, "{scale}");
    let worst = rays.iter().map(|r| relative(r.adaptive, r.u, scale)).fold(0.0, f64::max);
    assert!(worst < 1e-9, "{worst:e}");
    // The result does not depend on where steps end: parts of cells are integrated more accurately
    // than whole ones.
    let cut = both(&field, &spline, 1e-9, 1.0, 17);
    let worst = rays.iter().zip(&cut).map(|(a, b)| relative(a.u, b.u, scale)).fold(0.0, f64::max);
    assert!(worst < 2e-10, "{worst:e}");
}

/// With steps of four voxels over a trilinear field, the adaptive march accepts its steps with a
/// small estimate, but its error is many times larger.
#[test]
fn adaptive_estimates_are_fooled_by_kinks() {
    let field = cube(33, lopsided);
    let trilinear = Trilinear::new(&field);
    let voxel_m = 1.0 / 32.0;
    for (tolerance, longest_voxels) in [(1e-7, 4.0), (1e-8, 1.0)] {
        let rays = both(&field, &trilinear, tolerance, longest_voxels * voxel_m, 1);
        let fooled = rays.iter().filter(|r| (r.adaptive - r.u).length() > 2.0 * r.estimate).count();
        assert!(2 * fooled >= rays.len(), "tolerance {tolerance:e}: {fooled} of {}", rays.len());
    }
    // The adaptive march with steps of a hundredth of a voxel agrees with the cell-exact one, which
    // confirms the latter.
    let rays = both(&field, &trilinear, 1e-15, 0.01 * voxel_m, 1);
    let scale = rays.iter().map(|r| r.u.length()).fold(0.0, f64::max);
    let worst = rays.iter().map(|r| relative(r.adaptive, r.u, scale)).fold(0.0, f64::max);
    assert!(worst < 2e-4, "{worst:e}");
}

/// A ridge of a trilinear eps along the ray bends it inwards from both sides. The march must reach
/// its end there too.
#[test]
fn a_ray_on_a_ridge_does_not_stand_still() {
    for strength in [1e-5, 0.05] {
        let field = cube(9, |p| -strength * (p.x.abs() + p.y.abs()));
        let trilinear = Trilinear::new(&field);
        let medium = InterpolatedMedium::new(&field, &trilinear);
        let begin = Ray::inside(&medium, DVec3::new(0.0, 0.0, -0.5), DVec3::Z);
        let end = CellExact::new(&field).step(&medium, &begin, 0.25);
        assert_eq!(end.tau_m, 0.25);
        assert!(end.xi_m.length() < 1e-9 && end.u.length() < 1e-5, "{strength}: {end:?}");
    }
}

#[test]
fn steps_that_are_no_steps_do_no_harm() {
    let field = cube(5, lopsided);
    let trilinear = Trilinear::new(&field);
    let medium = InterpolatedMedium::new(&field, &trilinear);
    let begin = Ray::inside(&medium, DVec3::ZERO, DVec3::X);
    for step in [0.0, -1.0, f64::NAN] {
        assert_eq!(CellExact::new(&field).step(&medium, &begin, step), begin);
    }
    let nan = Ray { u: DVec3::NAN, ..begin };
    assert!(!CellExact::new(&field).step(&medium, &nan, 1.0).u.is_finite());
    // Far outside the lattice, values are continued from its surface.
    let beside = Ray::new(DVec3::new(9.0, 9.0, 9.0), DVec3::X);
    assert!((CellExact::new(&field).step(&medium, &beside, 5.0).depth_m() - 5.0).abs() < 1e-3);
}
