//! A cone at zero incidence in a supersonic stream: the solution of Taylor and Maccoll as cell
//! averages.
//!
//! The apex is the origin, the axis is x. The flow is exact up to the end of the cone, where the
//! lattice ends.

use super::cell_average::LayeredFlow;
use super::flow::{Fields, Flow, FlowError};
use super::gas_dynamics::taylor_maccoll::{ConeFlow, cone_flow};
use super::gas_dynamics::{FreeStream, GAMMA_AIR};
use super::oblique_shock::fill_gas;
use super::revolve::revolve;
use glam::{DVec2, DVec3, UVec3};

/// Parameters of the flow. The default is a cone of 20 degrees at Mach 3 in a tunnel with a
/// reservoir at 700 kPa and 300 K.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cone {
    /// Air far upstream.
    pub stream: FreeStream,
    /// Half of the angle at the apex.
    pub half_angle_rad: f64,
    /// Length along the axis.
    pub length_m: f64,
}

impl Default for Cone {
    fn default() -> Self {
        Cone {
            stream: FreeStream::from_reservoir(3.0, 7e5, 300.0),
            half_angle_rad: 20f64.to_radians(),
            length_m: 0.1,
        }
    }
}

impl Cone {
    /// The exact solution.
    pub fn solution(&self) -> Result<ConeFlow, FlowError> {
        Ok(cone_flow(GAMMA_AIR, self.stream.mach, self.half_angle_rad)?)
    }

    /// Computes density (with [`Fields::All`] also temperature, pressure and the gas fraction). The
    /// lattice reaches from a fifth of the length before the apex to the end of the cone, and as
    /// far sideways as the shock.
    pub fn flow(&self, dims: UVec3, fields: Fields) -> Result<Flow, FlowError> {
        let layers = Layers { stream: self.stream, cone: self.solution()? };
        let side = self.length_m * layers.cone.shock_rad.tan() * 1.1;
        let low = DVec3::new(-0.2 * self.length_m, -side, -side);
        let mut flow = Flow::over(dims, low, DVec3::new(self.length_m, side, side))?;
        fill_gas(&mut flow, &layers, fields);
        let l = self.length_m;
        let base = DVec2::new(l, l * self.half_angle_rad.tan());
        flow.body = Some(revolve(&[DVec2::ZERO, base, DVec2::new(l, 0.0)], 180));
        Ok(flow)
    }
}

struct Layers {
    stream: FreeStream,
    cone: ConeFlow,
}

impl LayeredFlow for Layers {
    const QUANTITIES: usize = 3;

    fn r_m(&self, y_m: f64, z_m: f64) -> f64 {
        y_m.hypot(z_m)
    }

    fn jumps_m(&self, r: f64) -> [f64; 4] {
        [r / self.cone.shock_rad.tan(), r / self.cone.cone_rad.tan(), f64::NAN, f64::NAN]
    }

    fn at(&self, x: f64, r: f64, out: &mut [f64]) -> bool {
        let angle = r.atan2(x);
        let state = self.cone.state(angle);
        out[0] = self.stream.density() * state.density;
        out[1] = self.stream.temperature_k * state.temperature;
        out[2] = self.stream.pressure_pa * state.pressure;
        angle >= self.cone.cone_rad
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::flow::names;
    use crate::testing::with_threads;

    #[test]
    fn shock_and_surface_are_where_the_exact_solution_has_them() {
        let cone = Cone::default();
        let exact = cone.solution().unwrap();
        let flow = cone.flow(UVec3::new(61, 41, 41), Fields::All).unwrap();
        let (density, gas) =
            (flow.grid(names::DENSITY).unwrap(), flow.grid(names::GAS_FRACTION).unwrap());
        let h = flow.spacing_m;
        let mut checked = 0;
        for k in 0..41 {
            for j in 0..41 {
                for i in 0..61 {
                    let p = flow.position_m(i, j, k);
                    let r = p.y.hypot(p.z);
                    let reach = h.length();
                    let value = density.at(i, j, k) as f64 / cone.stream.density();
                    // Boxes that no surface crosses have the exact value (boxes are small and the
                    // field is smooth), except at the apex.
                    let distance = |angle: f64| (r * angle.cos() - p.x * angle.sin()).abs();
                    if distance(exact.shock_rad) < reach
                        || distance(exact.cone_rad) < reach
                        || p.length() < 4.0 * reach
                    {
                        assert!(
                            value.is_nan() || (0.999..1.25 * exact.jump.density).contains(&value)
                        );
                        continue;
                    }
                    checked += 1;
                    let angle = r.atan2(p.x);
                    if angle < exact.cone_rad {
                        assert!(value.is_nan() && gas.at(i, j, k) == 0.0);
                    } else {
                        let expected = exact.state(angle).density;
                        assert!(
                            (value - expected).abs() < 4e-3 * expected,
                            "{i} {j} {k}: {value} {expected}"
                        );
                        assert_eq!(gas.at(i, j, k), 1.0);
                    }
                }
            }
        }
        assert!(checked > 50_000, "{checked}");
    }

    #[test]
    fn same_bits_on_1_2_7_threads() {
        let make = |threads| {
            with_threads(threads, || {
                let flow = Cone::default().flow(UVec3::splat(14), Fields::All).unwrap();
                flow.fields.iter().map(|f| crate::testing::crc32_f32(&f.values)).collect::<Vec<_>>()
            })
        };
        assert!(make(1) == make(2) && make(1) == make(7));
    }
}
