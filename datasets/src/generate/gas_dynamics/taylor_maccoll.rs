//! Supersonic flow about a circular cone at zero incidence, which is constant on every cone about
//! the axis.
//!
//! G. I. Taylor and J. W. Maccoll, "The air pressure on a cone moving at high speeds", Proc. R.
//! Soc. A 139, 1933. With velocities u (along the ray from the apex) and v (across it, towards
//! growing angle) in units of the largest possible velocity, and a = (γ-1)/2 · (1 - u² - v²), the
//! speed of sound squared:
//!
//! ```text
//! u' = v,   v' = (u v² - a (2 u + v cot θ)) / (a - v²),   ' = d/dθ
//! ```
//!
//! integrated with RK4 from the shock (where the oblique jump gives u and v) towards the axis until
//! v = 0, which is the cone's surface. Steps are equal in ln tan(θ/2), so slender cones, where the
//! solution varies like ln θ, need no special treatment. Behind weak shocks, where a - v² is nearly
//! zero, the steps are shorter.

use super::normal_shock::{Jump, jump};
use super::theta_beta_m::{deflection_rad, mach_angle_rad};
use super::{GasError, bisect, check_supersonic, isentropic};
use std::f64::consts::FRAC_PI_2;

/// RK4 steps per unit of ln tan(θ/2). Halving it changes the shock angles of the golden table in
/// the eighth digit.
const STEPS_PER_UNIT: f64 = 500.0;
/// Half angles below this (0.006 degrees) count as no cone.
const LEAST_CONE_RAD: f64 = 1e-4;

/// The flow between shock and cone.
#[derive(Debug, Clone, PartialEq)]
pub struct ConeFlow {
    /// Half angle of the cone.
    pub cone_rad: f64,
    /// Half angle of the shock.
    pub shock_rad: f64,
    /// Ratio of specific heats.
    pub gamma: f64,
    /// Mach number of the free stream.
    pub mach: f64,
    /// Ratios across the shock.
    pub jump: Jump,
    /// Samples from the shock to the cone.
    samples: Vec<Sample>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Sample {
    angle_rad: f64,
    /// u and v.
    velocity: [f64; 2],
}

/// The gas at one angle. Ratios are to the free stream.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConeState {
    /// Local Mach number.
    pub mach: f64,
    /// Density.
    pub density: f64,
    /// Pressure.
    pub pressure: f64,
    /// Temperature.
    pub temperature: f64,
    /// Velocity along the axis and away from it, over that of the free stream.
    pub velocity: [f64; 2],
}

/// The flow about a cone of half angle `cone_rad`, on the weak branch, which is observed in
/// experiments.
pub fn cone_flow(gamma: f64, mach: f64, cone_rad: f64) -> Result<ConeFlow, GasError> {
    check_supersonic(gamma, mach)?;
    let least = 0.1f64.to_radians();
    if !(least..FRAC_PI_2).contains(&cone_rad) {
        return Err(GasError::Angle {
            what: "the cone's half angle",
            given_degrees: cone_rad.to_degrees(),
            least_degrees: least.to_degrees(),
            most_degrees: 90.0,
        });
    }
    let (most, at_most) = detachment(gamma, mach)?;
    if cone_rad > most {
        return Err(GasError::Detached {
            body: "a cone",
            mach,
            given_degrees: cone_rad.to_degrees(),
            most_degrees: most.to_degrees(),
        });
    }
    let shock_rad =
        bisect(mach_angle_rad(mach), at_most, |shock| cone_of_shock(gamma, mach, shock) - cone_rad);
    let mut samples = Vec::new();
    integrate(gamma, mach, shock_rad, 1.0, |s| samples.push(s));
    let jump = jump(gamma, (mach * shock_rad.sin()).max(1.0));
    Ok(ConeFlow { cone_rad, shock_rad, gamma, mach, jump, samples })
}

/// The largest half angle of a cone with an attached shock, and that shock's angle.
pub fn detachment(gamma: f64, mach: f64) -> Result<(f64, f64), GasError> {
    check_supersonic(gamma, mach)?;
    // Golden-section search: the cone angle has a single maximum as a function of the shock angle.
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    let (mut low, mut high) = (mach_angle_rad(mach), FRAC_PI_2);
    while high - low > 1e-7 {
        let (a, b) = (high - ratio * (high - low), low + ratio * (high - low));
        if cone_of_shock(gamma, mach, a) < cone_of_shock(gamma, mach, b) {
            low = a
        } else {
            high = b
        }
    }
    let shock = 0.5 * (low + high);
    Ok((cone_of_shock(gamma, mach, shock), shock))
}

impl ConeFlow {
    /// The gas on the cone of half angle `angle_rad` about the axis: the free stream outside the
    /// shock, and the cone's surface within the cone.
    pub fn state(&self, angle_rad: f64) -> ConeState {
        if angle_rad > self.shock_rad {
            return ConeState {
                mach: self.mach,
                density: 1.0,
                pressure: 1.0,
                temperature: 1.0,
                velocity: [1.0, 0.0],
            };
        }
        let [u, v] = self.velocity(angle_rad.max(self.cone_rad));
        let (g, q2) = (self.gamma, u * u + v * v);
        let free = isentropic::temperature(g, self.mach);
        let temperature = (1.0 - q2) / free;
        let isentropic_pressure = temperature.powf(g / (g - 1.0)) * self.jump.total_pressure;
        let (sin, cos) = angle_rad.max(self.cone_rad).sin_cos();
        let scale = 1.0 / (1.0 - free).sqrt();
        ConeState {
            mach: (2.0 / (g - 1.0) * q2 / (1.0 - q2)).sqrt(),
            density: isentropic_pressure / temperature,
            pressure: isentropic_pressure,
            temperature,
            velocity: [(u * cos - v * sin) * scale, (u * sin + v * cos) * scale],
        }
    }

    /// Cubic Hermite interpolation between the integrator's steps; the differential equation gives
    /// the derivatives.
    fn velocity(&self, angle_rad: f64) -> [f64; 2] {
        let i = self
            .samples
            .partition_point(|s| s.angle_rad > angle_rad)
            .clamp(1, self.samples.len() - 1);
        let [a, b] = [self.samples[i - 1], self.samples[i]];
        let (h, [da, db]) = (
            b.angle_rad - a.angle_rad,
            [a, b].map(|s| derivative(self.gamma, s.angle_rad, s.velocity)),
        );
        let t = (angle_rad - a.angle_rad) / h;
        let (t2, t3) = (t * t, t * t * t);
        [0, 1].map(|c| {
            (2.0 * t3 - 3.0 * t2 + 1.0) * a.velocity[c]
                + (t3 - 2.0 * t2 + t) * h * da[c]
                + (3.0 * t2 - 2.0 * t3) * b.velocity[c]
                + (t3 - t2) * h * db[c]
        })
    }
}

/// d(u, v)/dθ.
fn derivative(gamma: f64, angle_rad: f64, [u, v]: [f64; 2]) -> [f64; 2] {
    let a = 0.5 * (gamma - 1.0) * (1.0 - u * u - v * v);
    [v, (u * v * v - a * (2.0 * u + v / angle_rad.tan())) / (a - v * v)]
}

/// The step (in s, towards the axis) that changes (a - v²)² by at most 4 %, or the usual step where
/// that is longer. Zero behind a Mach wave.
fn step_at(gamma: f64, now: Sample) -> f64 {
    let [u, v] = now.velocity;
    let a = 0.5 * (gamma - 1.0) * (1.0 - u * u - v * v);
    let room = a - v * v;
    if room < 1e-9 * a {
        return 0.0;
    }
    let slope = derivative(gamma, now.angle_rad, now.velocity)[1];
    -(1.0 / STEPS_PER_UNIT).min(0.02 * room / (v * slope * now.angle_rad.sin()).abs())
}

/// One RK4 step of `step` in s = ln tan(θ/2); dθ = sin θ ds.
fn rk4(gamma: f64, from: Sample, step: f64) -> Sample {
    let start = [from.angle_rad, from.velocity[0], from.velocity[1]];
    let slope = |[t, u, v]: [f64; 3]| {
        let [du, dv] = derivative(gamma, t, [u, v]);
        [t.sin(), t.sin() * du, t.sin() * dv]
    };
    let at = |k: [f64; 3], h: f64| [0, 1, 2].map(|i| start[i] + h * k[i]);
    let k1 = slope(start);
    let k2 = slope(at(k1, 0.5 * step));
    let k3 = slope(at(k2, 0.5 * step));
    let k4 = slope(at(k3, step));
    let end = [0, 1, 2].map(|i| start[i] + step / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
    Sample { angle_rad: end[0], velocity: [end[1], end[2]] }
}

/// Integrates from the shock to the cone with steps divided by `refinement`, and passes every step
/// to `keep`. Returns the cone's angle.
fn integrate(
    gamma: f64,
    mach: f64,
    shock_rad: f64,
    refinement: f64,
    mut keep: impl FnMut(Sample),
) -> f64 {
    // Behind the shock.
    let normal_mach = (mach * shock_rad.sin()).max(1.0);
    let turn = deflection_rad(gamma, mach, shock_rad).max(0.0);
    let mach_behind = jump(gamma, normal_mach).normal_mach_behind / (shock_rad - turn).sin();
    let speed = (1.0 - isentropic::temperature(gamma, mach_behind)).sqrt();
    let (sin, cos) = (shock_rad - turn).sin_cos();
    let mut now = Sample { angle_rad: shock_rad, velocity: [speed * cos, -speed * sin] };
    keep(now);
    // Towards the axis.
    while now.angle_rad > LEAST_CONE_RAD {
        let step = step_at(gamma, now) / refinement;
        if step == 0.0 {
            return 0.0; // a Mach wave: no disturbance, no cone
        }
        let next = rk4(gamma, now, step);
        if next.velocity[1] >= 0.0 {
            // The fraction of the step after which v = 0.
            let part = bisect(0.0, step, |h| rk4(gamma, now, h).velocity[1]);
            let end = rk4(gamma, now, part);
            keep(end);
            return end.angle_rad;
        }
        now = next;
        keep(now);
    }
    0.0
}

fn cone_of_shock(gamma: f64, mach: f64, shock_rad: f64) -> f64 {
    integrate(gamma, mach, shock_rad, 1.0, |_| ())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twice_as_many_steps_change_nothing() {
        for (mach, shock) in [(3.0, 29.6f64), (2.0, 60.0), (1.5, 42.0), (2.0, 30.05)] {
            let [once, twice] =
                [1.0, 2.0].map(|r| integrate(1.4, mach, shock.to_radians(), r, |_| ()));
            assert!(once > 0.0 && (once - twice).abs() < 1e-8, "{mach} {shock}: {once} {twice}");
        }
    }

    #[test]
    fn surface_values_of_naca_1135() {
        // Kopal's tables through NACA 1135, charts 5-7, and Sims (NASA SP-3004): M = 2, cone of 10
        // degrees: surface Mach number 1.834, pressure ratio 1.292.
        let flow = cone_flow(1.4, 2.0, 10f64.to_radians()).unwrap();
        let surface = flow.state(flow.cone_rad);
        assert!((surface.mach - 1.834).abs() < 2e-3, "{}", surface.mach);
        assert!((surface.pressure - 1.292).abs() < 2e-3, "{}", surface.pressure);
        // Slip condition: the stream follows the surface.
        let [along, across] = surface.velocity;
        assert!((across.atan2(along) - flow.cone_rad).abs() < 1e-9);
    }

    #[test]
    fn state_jumps_at_the_shock_only_and_grows_towards_the_cone() {
        let flow = cone_flow(1.4, 3.0, 20f64.to_radians()).unwrap();
        let outside = flow.state(flow.shock_rad + 1e-9);
        let inside = flow.state(flow.shock_rad);
        assert_eq!(outside.density, 1.0);
        assert!(
            (inside.density - flow.jump.density).abs() < 1e-10,
            "{} {}",
            inside.density,
            flow.jump.density
        );
        assert!((inside.pressure - flow.jump.pressure).abs() < 1e-10);
        let mut last = inside.density;
        for i in 1..=100 {
            let angle = flow.shock_rad + (flow.cone_rad - flow.shock_rad) * i as f64 / 100.0;
            let now = flow.state(angle).density;
            assert!(now > last && now < 1.25 * flow.jump.density, "{i}");
            last = now;
        }
        assert_eq!(flow.state(0.0).density, flow.state(flow.cone_rad).density);
    }

    #[test]
    fn detached_and_needle_cones_are_refused_with_the_limit() {
        // NACA 1135, chart 5: at Mach 2 the shock detaches from a cone of about 40.7 degrees.
        let most = detachment(1.4, 2.0).unwrap().0.to_degrees();
        assert!((most - 40.7).abs() < 0.1, "{most}");
        let error = cone_flow(1.4, 2.0, 0.75).unwrap_err();
        assert!(matches!(error, GasError::Detached { body: "a cone", .. }), "{error}");
        assert!(cone_flow(1.4, 2.0, 0.0).is_err() && cone_flow(1.4, 0.9, 0.2).is_err());
        let slender = cone_flow(1.4, 2.0, 0.5f64.to_radians()).unwrap();
        assert!(
            (slender.shock_rad - mach_angle_rad(2.0)).abs() < 1e-4,
            "{}",
            slender.shock_rad.to_degrees()
        );
    }
}
