//! Gases with a formula, in a cube of 1 m around the origin, and the true deflections of rays
//! through them.

use glam::DVec3;
use schlieren::march::{DormandPrince, Medium, Ray};
use schlieren::path::Start;
use schlieren::view::View;

/// eps at a point.
pub(super) type Formula = fn(DVec3) -> f64;

/// A gas with a name and a formula.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gas {
    pub(super) name: &'static str,
    pub(super) eps: Formula,
}

const fn gas(name: &'static str, eps: Formula) -> Gas {
    Gas { name, eps }
}

/// A Gaussian of standard deviation `sigma` around `centre`, 1 in the middle.
fn bell(p: DVec3, centre: [f64; 3], sigma: f64) -> f64 {
    (-(p - DVec3::from(centre)).length_squared() / (2.0 * sigma * sigma)).exp()
}

/// Turned, so that nothing is parallel to a lattice.
fn along(p: DVec3) -> f64 {
    p.dot(DVec3::new(0.8, 0.5, 0.33)) / DVec3::new(0.8, 0.5, 0.33).length()
}

/// Smooth and steep flows, weak and strong, that end inside the cube or reach its faces.
pub(super) const GASES: [Gas; 30] = [
    gas("blob", |p| 1e-4 * bell(p, [0.0; 3], 0.12)),
    gas("small blob", |p| 1e-4 * bell(p, [0.02, -0.05, 0.1], 0.05)),
    gas("blob beside the middle", |p| 2e-5 * bell(p, [0.21, 0.17, -0.1], 0.09)),
    gas("two blobs", |p| 1e-5 * (bell(p, [0.2, 0.0, 0.0], 0.08) - bell(p, [-0.2, 0.05, 0.1], 0.1))),
    gas("faint blob", |p| 1e-7 * bell(p, [0.0; 3], 0.1)),
    gas("strong blob", |p| 1e-3 * bell(p, [0.0; 3], 0.12)),
    gas("blob of liquid", |p| 0.01 * bell(p, [0.0; 3], 0.15)),
    gas("ellipsoid", |p| 1e-4 * (-(p * DVec3::new(4.0, 7.0, 10.0)).length_squared() / 2.0).exp()),
    gas("ring", |p| {
        1e-4 * (-((p.x.hypot(p.y) - 0.2).powi(2) + p.z * p.z) / (2.0 * 0.08 * 0.08)).exp()
    }),
    gas("thin ring", |p| {
        1e-4 * (-((p.y.hypot(p.z) - 0.25).powi(2) + p.x * p.x) / (2.0 * 0.04 * 0.04)).exp()
    }),
    gas("shell", |p| 5e-5 * (-(p.length() - 0.25).powi(2) / (2.0 * 0.06 * 0.06)).exp()),
    gas("saddle", |p| 1e-3 * p.x * p.y),
    gas("oblique saddle", |p| 1e-3 * (p.x + 0.5 * p.z) * (p.y - 0.25 * p.x)),
    gas("linear", |p| 1e-3 * along(p)),
    gas("paraboloid", |p| 2e-4 * (1.0 - p.length_squared())),
    gas("cubic", |p| 5e-4 * (p.x.powi(3) - p.y * p.z * p.x + 0.3 * p.z.powi(2) * p.y)),
    gas("atmosphere", |p| 2.8e-4 * (-0.1 * (p.y + 0.5)).exp()),
    gas("warm wall", |p| 1e-4 * (-(p.y + 0.5) / 0.2).exp()),
    gas("hot wall", |p| 1e-4 * (-(p.y + 0.5) / 0.08).exp()),
    gas("shear layer", |p| 2e-5 * (p.y / 0.08).tanh()),
    gas("oblique shear layer", |p| 2e-5 * (along(p) / 0.1).tanh()),
    gas("wavy shear layer", |p| 2e-5 * ((p.y - 0.05 * (9.0 * p.x).sin()) / 0.1).tanh()),
    gas("smeared shock", |p| 5e-5 * ((0.8 * p.x + 0.6 * p.y + 0.03) / 0.03).tanh()),
    gas("steep shock", |p| 5e-5 * ((0.8 * p.x + 0.6 * p.y + 0.03) / 0.012).tanh()),
    gas("bow shock", |p| {
        let behind = (p.x + 0.2 - 0.8 * (p.y * p.y + p.z * p.z)) / 0.05;
        4e-5 * (1.0 + behind.tanh())
    }),
    gas("jet", |p| {
        let width = 0.06 + 0.08 * (p.x + 0.5);
        -8e-5 * (0.06 / width) * (-(p.y * p.y + p.z * p.z) / (2.0 * width * width)).exp()
    }),
    gas("vortex", |p| {
        // The density of a Lamb-Oseen vortex falls towards its axis about as a Gaussian.
        -3e-5 * (-((p.x - 0.3 * p.z).powi(2) + p.y * p.y) / (2.0 * 0.09 * 0.09)).exp()
    }),
    gas("standing wave", |p| 1e-6 * (14.0 * p.x).sin() * (11.0 * p.y).cos() * (7.0 * p.z).cos()),
    gas("oblique waves", |p| 5e-6 * (20.0 * along(p)).sin()),
    gas("turbulence", |p| {
        // Twelve waves with wave numbers from 5 to 18 per metre and falling amplitudes.
        let waves = (0..12).map(|i| {
            let t = f64::from(i);
            let k = 5.0 + 1.2 * t;
            let d = DVec3::new((2.4 * t).cos(), (2.4 * t).sin(), (1.7 * t).sin()).normalize();
            (k * p.dot(d) + 2.0 * t).sin() / k.powf(1.8)
        });
        2e-5 * waves.sum::<f64>()
    }),
];

/// A gas in the cube. Outside, values are continued from the faces, as in all marches.
struct InCube(Formula);

impl Medium for InCube {
    fn sample(&self, at_m: DVec3) -> (f64, DVec3) {
        let at = at_m.clamp(DVec3::splat(-0.5), DVec3::splat(0.5));
        // Central differences of fourth order. Their error is about h⁴/30 times a fifth
        // derivative: 1e-7 of the gradient in the steepest flow.
        let h = 2e-4;
        let slope = |axis: DVec3| {
            let e = |k: f64| (self.0)(at + k * h * axis);
            (8.0 * (e(1.0) - e(-1.0)) - (e(2.0) - e(-2.0))) / (12.0 * h)
        };
        ((self.0)(at), DVec3::from(DVec3::AXES.map(slope)))
    }
}

/// The deflection of each ray by the formula, without a lattice: an adaptive march in f64 from the
/// face where the ray enters to the one where the undisturbed ray leaves. `None` beside the cube.
pub(super) fn deflections(eps: Formula, view: &View, starts: &[Start]) -> Vec<Option<[f64; 2]>> {
    use rayon::prelude::*;
    let medium = InCube(eps);
    let march = DormandPrince { tolerance: 1e-14, longest_step_m: 0.01 };
    let one = |start: &Start| {
        let [x, y] = start.position_m.map(f64::from);
        let at = view.centre_m + view.right * x + view.up * y;
        let (near, far) = crossing(at, view.forward)?;
        let length = far - near;
        let mut ray = Ray::inside(&medium, at + near * view.forward, view.forward);
        // In tau, the plane where the undisturbed ray leaves is nearer or farther by eps. The last
        // part begins where that is known, and a straight step puts right what is left: its square
        // times the second derivative, which is below 1e-12.
        let to_plane = |ray: &Ray| (length - ray.depth_m()) / ray.w().dot(view.forward);
        ray = march.run(&medium, &ray, 0.95 * length)?.ray;
        ray = march.run(&medium, &ray, to_plane(&ray))?.ray;
        let (eps, gradient) = medium.sample(ray.position_m());
        let u = ray.u + to_plane(&ray) * (1.0 + eps) * gradient;
        Some([u.dot(view.right), u.dot(view.up)])
    };
    starts.par_iter().map(one).collect()
}

/// Where a line enters and leaves the cube, as distances along it.
fn crossing(at: DVec3, direction: DVec3) -> Option<(f64, f64)> {
    let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
    for c in 0..3 {
        if direction[c] == 0.0 {
            if at[c].abs() > 0.5 {
                return None;
            }
            continue;
        }
        let (a, b) = ((-0.5 - at[c]) / direction[c], (0.5 - at[c]) / direction[c]);
        (near, far) = (near.max(a.min(b)), far.min(a.max(b)));
    }
    (near < far).then_some((near, far))
}

#[cfg(test)]
mod tests {
    use super::*;
    use schlieren::view::Axis;

    #[test]
    fn a_paraboloid_bends_rays_by_its_formula() {
        // Weak: the gradient along the straight ray times its length, to 1e-3 of it.
        let view = View::along(Axis::Z, DVec3::ZERO);
        let start = Start { position_m: [0.2, -0.1], tilt_rad: [0.0; 2] };
        let paraboloid = GASES.iter().find(|g| g.name == "paraboloid").unwrap();
        let got = deflections(paraboloid.eps, &view, &[start])[0].unwrap();
        let at = view.right * 0.2 - view.up * 0.1;
        let expected = [view.right, view.up].map(|axis| -2.0 * 2e-4 * at.dot(axis));
        for c in 0..2 {
            assert!(
                (got[c] - expected[c]).abs() < 1e-3 * expected[c].abs(),
                "{got:?} {expected:?}"
            );
        }
        let beside = Start { position_m: [0.7, 0.0], tilt_rad: [0.0; 2] };
        assert_eq!(deflections(paraboloid.eps, &view, &[beside]), [None]);
    }

    #[test]
    fn gases_have_names_of_their_own_and_finite_values() {
        for (i, g) in GASES.iter().enumerate() {
            assert!(GASES[..i].iter().all(|o| o.name != g.name), "{} twice", g.name);
            for p in [DVec3::splat(-0.5), DVec3::ZERO, DVec3::new(0.5, -0.2, 0.1)] {
                assert!((g.eps)(p).is_finite(), "{} at {p}", g.name);
            }
        }
    }
}
