//! A blunt re-entry body in a hypersonic wind tunnel: bow shock, shock layer, expansion at the
//! base, wake. Represents the 256³ data set of a re-entry vehicle in table 5.1 of the thesis.
//!
//! The body is a sphere-cone with a flat base at zero incidence. The flow combines exact relations,
//! correlations and models:
//! * the shock's shape and stand-off: Billig's correlation
//!   ([`bow_shock`](super::gas_dynamics::bow_shock)), with the attached cone's shock (Taylor and
//!   Maccoll) far away;
//! * the jump across it: Rankine and Hugoniot with the local shock angle;
//! * the stagnation point: Rayleigh's pitot formula; the surface: modified Newtonian pressure
//!   (after L. Lees, 1955), p = p∞ + (p02 - p∞) sin²φ, and the entropy of the stagnation
//!   streamline;
//! * in between: linear in the radius from shock to surface (a model; smooth, so that only the
//!   shock and the wake have sharp gradients);
//! * behind the base: a wake of hot thin gas at a third of the free stream's pressure that necks
//!   and recompresses, with a growing shear layer (a model; the pressure is of the order of base
//!   pressures in D. R. Chapman, NACA Report 1051, 1951).
//!
//! The defaults are of the order of the conditions in NASA Langley's 20-inch Mach 6 tunnel (p0 862
//! kPa, T0 500 K, which give 545 Pa, 61 K, 0.031 kg/m³). The densities range from 0.05 (wake) to 6
//! times that of the free stream.

use super::cell_average::LayeredFlow;
use super::flow::{Fields, Flow, FlowError};
use super::gas_dynamics::bow_shock::{BowShock, Nose};
use super::gas_dynamics::normal_shock::{jump, pitot_pressure, stagnation_density};
use super::gas_dynamics::taylor_maccoll::cone_flow;
use super::gas_dynamics::{FreeStream, GAMMA_AIR, GAS_CONSTANT_AIR};
use super::oblique_shock::fill_gas;
use super::revolve::revolve;
use glam::{DVec2, DVec3, UVec3};
use rt_core::mesh::TriMesh;

/// Parameters of the flow. The foremost point of the nose is the origin; the stream flows along x.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BluntBody {
    /// Air far upstream, at Mach 2 or faster (Billig's correlation).
    pub stream: FreeStream,
    /// Radius of the spherical nose.
    pub nose_radius_m: f64,
    /// Half angle of the cone behind the nose; small enough for an attached shock.
    pub half_angle_rad: f64,
    /// Radius of the base, larger than that of the nose.
    pub base_radius_m: f64,
}

impl Default for BluntBody {
    fn default() -> Self {
        BluntBody {
            stream: FreeStream::from_reservoir(6.0, 862e3, 500.0),
            nose_radius_m: 0.025,
            half_angle_rad: 25f64.to_radians(),
            base_radius_m: 0.05,
        }
    }
}

impl BluntBody {
    /// The bow shock.
    pub fn shock(&self) -> Result<BowShock, FlowError> {
        let far = cone_flow(GAMMA_AIR, self.stream.mach, self.half_angle_rad)?.shock_rad;
        Ok(BowShock::billig(Nose::Sphere, self.stream.mach, self.nose_radius_m, Some(far))?)
    }

    /// Samples density (with [`Fields::All`] also temperature, pressure and the gas fraction), over
    /// 7 nose radii along the stream and as many across.
    pub fn flow(&self, dims: UVec3, fields: Fields) -> Result<Flow, FlowError> {
        let layers = Layers::new(self)?;
        let r = self.base_radius_m.max(self.nose_radius_m);
        let low = DVec3::new(-0.4 * r, -1.75 * r, -1.75 * r);
        let mut flow = Flow::over(dims, low, low + 3.5 * r)?;
        fill_gas(&mut flow, &layers, fields);
        flow.body = Some(self.mesh());
        Ok(flow)
    }

    /// End of the sphere: (x, r).
    fn tangent_m(&self) -> DVec2 {
        let (sin, cos) = self.half_angle_rad.sin_cos();
        self.nose_radius_m * DVec2::new(1.0 - sin, cos)
    }

    /// Radius of the base, at least that of the junction of sphere and cone.
    fn base_m(&self) -> DVec2 {
        let t = self.tangent_m();
        let r = self.base_radius_m.max(t.y);
        DVec2::new(t.x + (r - t.y) / self.half_angle_rad.tan(), r)
    }

    fn mesh(&self) -> TriMesh {
        let (t, base) = (self.tangent_m(), self.base_m());
        let most = std::f64::consts::FRAC_PI_2 - self.half_angle_rad;
        let mut profile: Vec<DVec2> = (0..=32)
            .map(|i| {
                let (sin, cos) = (most * i as f64 / 32.0).sin_cos();
                self.nose_radius_m * DVec2::new(1.0 - cos, sin)
            })
            .collect();
        profile[32] = t;
        profile.extend((1..=8).map(|i| t.lerp(base, i as f64 / 8.0)));
        profile.push(DVec2::new(base.x, 0.0));
        revolve(&profile, 180)
    }
}

struct Layers {
    stream: FreeStream,
    shock: BowShock,
    nose_radius_m: f64,
    half_angle_rad: f64,
    tangent_m: DVec2,
    base_m: DVec2,
    /// Pressure and density at the stagnation point, over the free stream's.
    stagnation: [f64; 2],
}

/// Pressure in the wake, over that of the free stream.
const WAKE_PRESSURE: f64 = 0.35;
/// Temperature in the wake, over that of the reservoir.
const WAKE_TEMPERATURE: f64 = 0.85;
/// Radius of the wake's neck relative to the base, and its position in base radii behind the base.
const NECK: [f64; 2] = [0.42, 1.7];

impl Layers {
    fn new(body: &BluntBody) -> Result<Layers, FlowError> {
        let mach = body.stream.mach;
        Ok(Layers {
            stream: body.stream,
            shock: body.shock()?,
            nose_radius_m: body.nose_radius_m,
            half_angle_rad: body.half_angle_rad,
            tangent_m: body.tangent_m(),
            base_m: body.base_m(),
            stagnation: [pitot_pressure(GAMMA_AIR, mach)?, stagnation_density(GAMMA_AIR, mach)?],
        })
    }

    /// Position of the front surface at radius `r`.
    fn front_x_m(&self, r: f64) -> f64 {
        if r <= self.tangent_m.y {
            let n = self.nose_radius_m;
            n - (n * n - r * r).max(0.0).sqrt()
        } else {
            self.tangent_m.x + (r - self.tangent_m.y) / self.half_angle_rad.tan()
        }
    }

    /// Radius of body or wake, and the surface's angle to the stream; 0 and 90 degrees on the axis
    /// upstream of the nose.
    fn inner(&self, x: f64) -> (f64, f64) {
        if x <= 0.0 {
            (0.0, std::f64::consts::FRAC_PI_2)
        } else if x < self.tangent_m.x {
            let n = self.nose_radius_m;
            ((2.0 * n * x - x * x).sqrt(), ((n - x) / n).asin())
        } else if x < self.base_m.x {
            (
                self.tangent_m.y + (x - self.tangent_m.x) * self.half_angle_rad.tan(),
                self.half_angle_rad,
            )
        } else {
            let s = (x - self.base_m.x) / (self.base_m.y * NECK[1]);
            let necked = 1.0 - (1.0 - NECK[0]) * smooth(s);
            (self.base_m.y * (necked + 0.06 * (s - 1.0).max(0.0)), 0.0)
        }
    }

    /// Radius of the shock at `x`, 0 before it.
    fn shock_r_m(&self, x: f64) -> f64 {
        let t = self.shock.far_angle_rad.tan();
        let root = 1.0 + (x + self.shock.stand_off_m).max(0.0) * t * t / self.shock.vertex_radius_m;
        (root * root - 1.0).sqrt() * self.shock.vertex_radius_m / t
    }

    /// Pressure and density at the inner edge of the shock layer, over the free stream's.
    fn inner_state(&self, x: f64, angle: f64) -> [f64; 2] {
        let [p0, rho0] = self.stagnation;
        let newton = |angle: f64| 1.0 + (p0 - 1.0) * angle.sin().powi(2);
        // Behind the base the gas expands to the wake's pressure; at the neck it is compressed to
        // that of the free stream.
        let behind = (x - self.base_m.x) / self.base_m.y;
        let p = if behind <= 0.0 {
            newton(angle)
        } else {
            let cone = newton(self.half_angle_rad);
            cone + (self.wake_pressure(x) - cone) * smooth(behind / 0.35)
        };
        [p, rho0 * (p / p0).powf(1.0 / GAMMA_AIR)]
    }

    /// Pressure within the wake, over the free stream's.
    fn wake_pressure(&self, x: f64) -> f64 {
        let behind = (x - self.base_m.x) / self.base_m.y;
        WAKE_PRESSURE + (1.0 - WAKE_PRESSURE) * smooth((behind - 0.7 * NECK[1]) / (0.6 * NECK[1]))
    }
}

/// Smooth step: 0 below 0, 1 above 1.
fn smooth(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

impl LayeredFlow for Layers {
    const QUANTITIES: usize = 3;

    fn r_m(&self, y_m: f64, z_m: f64) -> f64 {
        y_m.hypot(z_m)
    }

    fn jumps_m(&self, r: f64) -> [f64; 4] {
        let shock = self.shock.x_m(r);
        if r < self.base_m.y {
            [shock, self.front_x_m(r), self.base_m.x, f64::NAN]
        } else {
            [shock, f64::NAN, f64::NAN, f64::NAN]
        }
    }

    fn at(&self, x: f64, r: f64, out: &mut [f64]) -> bool {
        let free = [self.stream.density(), self.stream.temperature_k, self.stream.pressure_pa];
        if x < self.shock.x_m(r) {
            out.copy_from_slice(&free);
            return true;
        }
        // Shock layer: from the state behind the shock at this x to that at its inner edge.
        let (outer_r, (inner_r, angle)) = (self.shock_r_m(x), self.inner(x));
        let normal_mach = (self.stream.mach * self.shock.angle_rad(outer_r).sin()).max(1.0);
        let behind = jump(GAMMA_AIR, normal_mach);
        let inner = self.inner_state(x, angle);
        let t = ((r - inner_r) / (outer_r - inner_r).max(1e-12)).clamp(0.0, 1.0);
        // Upstream of the nose, the layer is crossed along x on the axis.
        let t = if x < 0.0 { t.max(-x / self.shock.stand_off_m) } else { t };
        let mut p = inner[0] + (behind.pressure - inner[0]) * t;
        let mut rho = inner[1] + (behind.density - inner[1]) * t;
        // The wake.
        if x > self.base_m.x {
            let behind_base = x - self.base_m.x;
            let layer = 0.04 * self.base_m.y + 0.09 * behind_base;
            let outside = smooth(0.5 + (r - inner_r) / layer);
            let reservoir = self.stream.temperature_k
                * (1.0 + 0.5 * (GAMMA_AIR - 1.0) * self.stream.mach.powi(2));
            // The wake cools by mixing downstream.
            let core = WAKE_TEMPERATURE * reservoir / (1.0 + 0.12 * behind_base / self.base_m.y);
            let wake = self.wake_pressure(x);
            p = wake + (p - wake) * outside;
            let wake = wake * self.stream.temperature_k / core;
            rho = wake + (rho - wake) * outside;
        }
        p *= free[2];
        rho *= free[0];
        out.copy_from_slice(&[rho, p / (GAS_CONSTANT_AIR * rho), p]);
        !(r < self.base_m.y && x > self.front_x_m(r) && x < self.base_m.x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::flow::names;
    use crate::testing::{open_or_flipped_edges, with_threads};

    #[test]
    fn stand_off_on_the_axis_is_billigs_to_a_tenth_of_a_cell() {
        let body = BluntBody::default();
        let flow = body.flow(UVec3::new(91, 37, 37), Fields::Density).unwrap();
        let density = flow.grid(names::DENSITY).unwrap();
        let free = body.stream.density() as f32;
        let stand_off = body.shock().unwrap().stand_off_m;
        // The box cut by the shock: the excess of its mean gives the shock's position.
        let row: Vec<f32> = (0..91).map(|i| density.at(i, 18, 18)).collect();
        let cut = row.iter().position(|&v| v > 1.001 * free).unwrap();
        let layer = jump(1.4, 6.0).density as f32;
        let part = (row[cut] - free) / (free * (layer - 1.0));
        let h = flow.spacing_m.x;
        let found = -(flow.position_m(cut as u32, 0, 0).x + (0.5 - part as f64) * h);
        // The box is 4 mm wide, over which the curved shock recedes by 0.1 mm.
        assert!((found - stand_off).abs() < 0.1 * h, "{found} {stand_off} {h}");
    }

    #[test]
    fn density_is_between_wake_and_stagnation_point_and_jumps_by_six_at_most() {
        let body = BluntBody::default();
        let flow = body.flow(UVec3::splat(33), Fields::All).unwrap();
        let free = body.stream.density();
        let (low, high) = flow.field(names::DENSITY).unwrap().range().unwrap();
        let most = stagnation_density(1.4, 6.0).unwrap();
        assert!(
            low as f64 > 0.03 * free && (high as f64) < 1.0001 * most * free,
            "{low} {high} of {free}"
        );
        assert!(high as f64 > 4.0 * free);
        let (_, hottest) = flow.field(names::TEMPERATURE).unwrap().range().unwrap();
        assert!(hottest < 501.0, "nothing is hotter than the reservoir: {hottest}");
    }

    #[test]
    fn surface_layer_meets_shock_continuously_and_body_is_closed() {
        let body = BluntBody::default();
        let layers = Layers::new(&body).unwrap();
        for x in [0.001, 0.02, 0.05, 0.1] {
            let r = layers.shock_r_m(x);
            assert!((layers.shock.x_m(r) - x).abs() < 1e-12, "{x}");
            let (mut inside, mut outside) = ([0.0; 3], [0.0; 3]);
            layers.at(x + 1e-9, r, &mut inside);
            layers.at(x - 1e-9, r, &mut outside);
            let angle = layers.shock.angle_rad(r);
            let exact = jump(1.4, 6.0 * angle.sin());
            assert!((inside[0] / outside[0] - exact.density).abs() < 1e-5);
            assert!((inside[2] / outside[2] - exact.pressure).abs() < 1e-4);
        }
        assert_eq!(open_or_flipped_edges(&body.mesh().indices), 0);
    }

    #[test]
    fn same_bits_on_1_2_7_threads() {
        let make = |threads| {
            with_threads(threads, || {
                let flow = BluntBody::default().flow(UVec3::splat(14), Fields::All).unwrap();
                flow.fields.iter().map(|f| crate::testing::crc32_f32(&f.values)).collect::<Vec<_>>()
            })
        };
        assert!(make(1) == make(2) && make(1) == make(7));
    }
}
