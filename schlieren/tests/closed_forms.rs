//! Tests integrators against rays with a closed form.

use glam::DVec3;
use schlieren::analytic::{FishEye, Kepler, Linear, LinearSquare, Luneburg, Selfoc};
use schlieren::march::{
    DormandPrince, Euler, Integrator, Medium, Pefrl, Ray, RungeKutta4, Sharma, Verlet,
};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// A ray that enters the Luneburg lens along z at height b. On its surface n = 1, so the index does
/// not jump.
fn luneburg_start(b: f64) -> Ray {
    Ray::new(DVec3::new(b, 0.0, -(1.0 - b * b).sqrt()), DVec3::Z)
}

fn luneburg_error(integrator: &impl Integrator, steps: u32) -> f64 {
    let b = 0.6;
    let end = integrator.run(&Luneburg, &luneburg_start(b), FRAC_PI_2, steps);
    let (x, w) = Luneburg::ray(b, FRAC_PI_2);
    (end.position_m() - x).length().max((end.w() - w).length())
}

fn assert_order(integrator: &impl Integrator, name: &str, wanted: f64) {
    let order = (luneburg_error(integrator, 64) / luneburg_error(integrator, 128)).log2();
    assert!((order - wanted).abs() < 0.1, "{name}: observed order {order:.3}, wanted {wanted}");
}

#[test]
fn observed_orders_are_one_two_and_four() {
    assert_order(&Euler, "Euler", 1.0);
    assert_order(&Verlet, "Verlet", 2.0);
    assert_order(&Sharma, "Sharma", 4.0);
    assert_order(&RungeKutta4, "Runge-Kutta", 4.0);
    assert_order(&Pefrl, "PEFRL", 4.0);
    assert_eq!(
        (Euler::ORDER, Verlet::ORDER, Sharma::ORDER, RungeKutta4::ORDER, Pefrl::ORDER),
        (1, 2, 4, 4, 4)
    );
}

#[test]
fn luneburg_brings_all_parallel_rays_to_one_point_with_one_path() {
    for b in [0.0, 0.1, 0.5, 0.9, 0.99] {
        let start = luneburg_start(b);
        let end = Pefrl.run(&Luneburg, &start, FRAC_PI_2, 1000);
        assert!((end.position_m() - DVec3::Z).length() < 1e-11, "b = {b}");
        assert!((end.w() - DVec3::new(-b, 0.0, (1.0 - b * b).sqrt())).length() < 1e-11, "b = {b}");
        // From the plane z = -1 the optical path is 1 + pi/2 for every b: the free path before the
        // lens plus the path inside.
        let free = 1.0 + start.start_m.z;
        let path = free + end.tau_m + end.excess_m;
        assert!((path - (1.0 + FRAC_PI_2)).abs() < 1e-11, "b = {b}: {path}");
        // The path difference is the path minus the depth.
        let difference = end.path_difference_m();
        assert!((difference - (path - free - end.depth_m())).abs() < 1e-13, "b = {b}");
    }
}

#[test]
fn fish_eye_images_every_point_opposite_and_closes_its_circles() {
    let p = DVec3::new(0.6, 0.0, -0.3);
    for angle in [0.0, 0.7, 1.9, 3.3] {
        let direction = DVec3::new(f64::cos(angle), 0.2, f64::sin(angle)).normalize();
        let start = Ray::inside(&FishEye, p, direction);
        let image = p * (-1.0 / p.length_squared());
        // The optical path to the image is pi n0 a / 2 = pi.
        let path = |r: &Ray| r.tau_m + r.excess_m;
        let end = Pefrl.run_until(&FishEye, &start, 1e-3, 100_000, |r| path(r) - PI).unwrap();
        assert!((end.position_m() - image).length() < 1e-9, "{angle}: {}", end.position_m());
        let end = Pefrl.run_until(&FishEye, &start, 1e-3, 100_000, |r| path(r) - TAU).unwrap();
        assert!((end.position_m() - p).length() < 1e-9, "{angle}: {}", end.position_m());
        assert!((end.w() - start.w()).length() < 1e-9, "{angle}");
    }
}

#[test]
fn selfoc_keeps_its_pitch_for_five_periods() {
    let g = 0.3;
    let fibre = Selfoc { gradient_per_m: g };
    let (x0, slope) = (0.2, 0.05);
    let start =
        Ray::inside(&fibre, DVec3::new(x0, 0.0, 0.0), DVec3::new(slope, 0.0, 1.0).normalize());
    let w = start.w();
    for (steps, tolerance, end) in [
        (4096, 3e-5, Verlet.run(&fibre, &start, 5.0 * TAU / g, 4096)),
        (512, 1e-6, Pefrl.run(&fibre, &start, 5.0 * TAU / g, 512)),
        (2048, 1e-6, Sharma.run(&fibre, &start, 5.0 * TAU / g, 2048)),
    ] {
        assert!((end.position_m().x - x0).abs() < tolerance, "{steps}: {}", end.position_m());
        assert!((end.w().x - w.x).abs() < tolerance, "{steps}");
        assert!((end.position_m().z / (w.z * end.tau_m) - 1.0).abs() < 1e-12);
    }
    // Euler gains energy in every period.
    let end = Euler.run(&fibre, &start, 5.0 * TAU / g, 4096);
    assert!((end.position_m().x - x0).abs() > 1e-2);
}

#[test]
fn verlet_is_exact_where_n_squared_is_linear() {
    for a in [1e-8, -1e-3, 0.3] {
        let medium = LinearSquare { slope_per_m: a };
        let start = Ray::new(DVec3::ZERO, DVec3::Z);
        for steps in [1, 7, 1000] {
            let end = Verlet.run(&medium, &start, 2.0, steps);
            // y = a tau^2 / 2, z = tau.
            assert!((end.xi_m.y / (0.5 * a * 4.0) - 1.0).abs() < 1e-13, "a = {a}, {steps} steps");
            assert!((end.u.y / (2.0 * a) - 1.0).abs() < 1e-13, "a = {a}, {steps} steps");
            assert_eq!(end.xi_m.z, 0.0);
        }
    }
}

#[test]
fn mirages_are_catenaries() {
    let a = 0.2;
    let medium = Linear { slope_per_m: a };
    let end = Pefrl.run(&medium, &Ray::new(DVec3::ZERO, DVec3::Z), 3.0, 400);
    // The ray is horizontal at the start with n = 1, so C = 1 and y = (cosh(a z) - 1) / a.
    let (y, z) = (end.position_m().y, end.position_m().z);
    assert!((y - ((a * z).cosh() - 1.0) / a).abs() < 1e-11, "{y}");
}

#[test]
fn kepler_hyperbolas_turn_by_two_arctangents() {
    let medium = Kepler { strength_m: 0.05 };
    let b = 0.2;
    let far = 1e4;
    // |w| = 1 at infinity. Starting from far away omits a deflection of k / far.
    let start = Ray::new(DVec3::new(b, 0.0, -far), DVec3::Z);
    let start = Ray { u: DVec3::Z * medium.sample(start.start_m).0, ..start };
    let run = DormandPrince { tolerance: 1e-13, longest_step_m: far }
        .run(&medium, &start, 2.0 * far)
        .unwrap();
    let w = run.ray.w();
    let turned = f64::atan2(-w.x, w.z);
    // On each side, half of sin(angle) k/far of the deflection is missing.
    assert!(
        (turned - medium.deflection_rad(b)).abs() < 3.0 * 0.05 / far,
        "{turned} {}",
        medium.deflection_rad(b)
    );
    // Bouguer's invariant is conserved.
    let l = run.ray.position_m().cross(w);
    let l0 = start.start_m.cross(start.w());
    assert!((l - l0).length() < 1e-8 * l0.length().max(1.0), "{l} {l0}");
}

/// In n(r), |x cross w| is constant. The symplectic integrators conserve it to rounding however
/// long their steps are.
#[test]
fn bouguer_is_kept_by_symplectic_integrators_at_any_step() {
    let start =
        Ray::inside(&FishEye, DVec3::new(0.5, 0.1, 0.2), DVec3::new(0.3, 0.8, 0.4).normalize());
    let invariant = |r: &Ray| r.position_m().cross(r.w());
    for steps in [50, 500] {
        for end in
            [Verlet.run(&FishEye, &start, 6.0, steps), Pefrl.run(&FishEye, &start, 6.0, steps)]
        {
            assert!((invariant(&end) - invariant(&start)).length() < 1e-13);
        }
    }
    let rk = RungeKutta4.run(&FishEye, &start, 6.0, 50);
    assert!((invariant(&rk) - invariant(&start)).length() > 1e-9);
}

/// In n(y), the components of w along the layers are constant (Snell), also through a jump that a
/// step cannot resolve.
#[test]
fn snell_invariants_are_exact_in_layers() {
    struct Layers;
    impl Medium for Layers {
        fn sample(&self, at_m: DVec3) -> (f64, DVec3) {
            // A tanh profile of 1 mm thickness.
            let t = (at_m.y / 1e-3).tanh();
            (0.2 * t, DVec3::Y * (0.2 * (1.0 - t * t) / 1e-3))
        }
    }
    let start =
        Ray::inside(&Layers, DVec3::new(0.0, -0.5, 0.0), DVec3::new(0.3, 0.8, 0.1).normalize());
    let end = Pefrl.run(&Layers, &start, 1.5, 20_000);
    assert!(end.position_m().y > 0.1);
    assert!((end.w().x - start.w().x).abs() < 1e-14 && (end.w().z - start.w().z).abs() < 1e-14);
    // The component across the layers follows from |w| = n.
    let across = (1.2f64.powi(2) - end.w().x.powi(2) - end.w().z.powi(2)).sqrt();
    assert!((end.w().y - across).abs() < 1e-5, "{} {across}", end.w().y);
}

#[test]
fn total_reflection_turns_back_at_the_angle_of_incidence() {
    // n falls from 1 to sqrt(1 - 0.8) over 1 m, so a ray at 60 degrees from the normal cannot reach
    // the end.
    let medium = LinearSquare { slope_per_m: -0.4 };
    let start = Ray::new(DVec3::ZERO, DVec3::new(f64::sin(PI / 3.0), f64::cos(PI / 3.0), 0.0));
    let end = Verlet
        .run_until(&medium, &start, 1e-3, 100_000, |r| {
            if r.tau_m > 0.1 { -r.position_m().y } else { -1.0 }
        })
        .unwrap();
    assert!(
        (end.w() - DVec3::new(f64::sin(PI / 3.0), -f64::cos(PI / 3.0), 0.0)).length() < 1e-12,
        "{}",
        end.w()
    );
}

/// Reversed and marched for the same number of steps, symplectic schemes return to the start within
/// rounding, at any step.
#[test]
fn trace_back_returns_to_the_start() {
    let start = luneburg_start(0.7);
    for steps in [20, 200] {
        for (name, end, back) in [
            ("Verlet", Verlet.run(&Luneburg, &start, 1.3, steps), 0),
            ("PEFRL", Pefrl.run(&Luneburg, &start, 1.3, steps), 1),
        ] {
            let turned = Ray { u: -end.w() - DVec3::Z, ..Ray::new(end.position_m(), DVec3::Z) };
            let home = match back {
                0 => Verlet.run(&Luneburg, &turned, 1.3, steps),
                _ => Pefrl.run(&Luneburg, &turned, 1.3, steps),
            };
            assert!((home.position_m() - start.start_m).length() < 1e-13, "{name}, {steps} steps");
            assert!((home.w() + start.w()).length() < 1e-13, "{name}, {steps} steps");
        }
    }
}

#[test]
fn dormand_prince_reaches_its_tolerance() {
    let (x, _) = Luneburg::ray(0.6, FRAC_PI_2);
    for tolerance in [1e-6, 1e-9, 1e-12] {
        let run = DormandPrince { tolerance, longest_step_m: 1.0 }
            .run(&Luneburg, &luneburg_start(0.6), FRAC_PI_2)
            .unwrap();
        let error = (run.ray.position_m() - x).length();
        assert!(error < 20.0 * tolerance, "{error} for {tolerance}");
        assert!(run.samples < 2000);
        assert_eq!(run.ray.tau_m, FRAC_PI_2);
    }
}
