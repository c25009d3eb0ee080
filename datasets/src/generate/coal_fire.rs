//! A round jet flame of coal volatiles in hot air, as in a pulverised-coal furnace. Represents the
//! 402 x 162 x 162 coal fire of table 5.1 of the thesis.
//!
//! The jet leaves a pipe of 50 mm along x into air of 600 K. Mean field: a top hat that turns into
//! the self-similar Gaussian of a round jet, Z = 5 d/x · exp(-(r/b)²), b = 0.12 x (the form after
//! S. B. Pope, "Turbulent Flows", 2000, ch. 5; the constants are of the order of measured ones);
//! eddies grow with x. The volatiles (CH4, CO, CO2 in N2) burn at the `flame_sheet` at up to 1900
//! K. Char and ash, which block light in a real flame, are left out. Density 0.18 to 0.6 kg/m³. The
//! fields are smooth at the scale of a cell except at the flame sheet's rounded corner, so they are
//! sampled at points.

use super::combustion_jet::{gas_fields, gas_row};
use super::flame_sheet::{FlameSheet, Species};
use super::flow::{Fields, Flow, FlowError};
use super::turbulence::{Displacement, Turbulence, Vortex, Vortices};
use glam::{DVec3, UVec3};
use rt_core::math::SplitMix64;

/// Number of points in table 5.1.
pub const THESIS_DIMS: UVec3 = UVec3::new(402, 162, 162);

/// The streams.
pub(crate) const VOLATILES: FlameSheet<'static> = FlameSheet {
    species: &[
        Species { name: "Y_CH4", molar_mass: 0.016_043, oxidiser: 0.0, fuel: 0.20, made: -0.20 },
        Species { name: "Y_CO", molar_mass: 0.028_010, oxidiser: 0.0, fuel: 0.15, made: -0.15 },
        Species { name: "Y_O2", molar_mass: 0.031_998, oxidiser: 0.2314, fuel: 0.0, made: -0.8835 },
        Species { name: "Y_N2", molar_mass: 0.028_014, oxidiser: 0.7686, fuel: 0.60, made: 0.0 },
        Species { name: "Y_CO2", molar_mass: 0.044_010, oxidiser: 0.0, fuel: 0.05, made: 0.7843 },
        Species { name: "Y_H2O", molar_mass: 0.018_015, oxidiser: 0.0, fuel: 0.0, made: 0.4492 },
    ],
    temperatures_k: [600.0, 1900.0, 500.0],
    pressure_pa: 101_325.0,
};

/// Diameter of the pipe.
const PIPE_M: f64 = 0.05;
const LENGTH_M: f64 = 1.5;
/// Width over length: 161 / 401 spacings.
const WIDTH_M: f64 = LENGTH_M * 161.0 / 401.0;

/// Parameters of the flame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CoalFire {
    /// Points over 1.5 m x 0.6 m x 0.6 m; the pipe ends at x = 0, on the axis y = z = 0.
    pub dims: UVec3,
    /// The seed of the random numbers; another seed gives another flame of the same kind.
    pub seed: u64,
}

impl CoalFire {
    /// Samples the density; with [`Fields::All`] also temperature, mixture fraction and the mass
    /// fractions of CH4, CO, O2, N2, CO2 and H2O.
    pub fn flow(&self, fields: Fields) -> Result<Flow, FlowError> {
        let side = 0.5 * WIDTH_M;
        let mut flow =
            Flow::over(self.dims, DVec3::new(0.0, -side, -side), DVec3::new(LENGTH_M, side, side))?;
        let turbulence = Turbulence::new(&flow, 0.24, self.seed);
        let mut random = SplitMix64::new(self.seed);
        // Vortex rings of the shear layer near the pipe, which double in size as they pair.
        let mut rings = Vec::new();
        let mut x = 0.7 * PIPE_M;
        while x < 8.0 * PIPE_M {
            let size_m = 0.14 * PIPE_M + 0.12 * x;
            let center_m = [x + random.between(-0.1, 0.1) * size_m, 0.5 * PIPE_M + 0.05 * x];
            rings.push(Vortex { center_m, size_m, turn_rad: random.between(2.0, 3.5) });
            x += 2.2 * size_m;
        }
        let rings = Vortices(rings);
        let (origin, spacing, n) = (flow.origin_m, flow.spacing_m, self.dims.x as usize);
        let table = VOLATILES.table();
        let scratch = || (Displacement::default(), Vec::new());
        flow.fill(&gas_fields(&VOLATILES, fields), scratch, |(d, z), j, k, rows| {
            turbulence.displace_row(d, j, k, |i| {
                let x = spacing.x * i as f64;
                (1.6 * width_m(x), 0.5 * (x / (2.0 * PIPE_M)).min(1.0))
            });
            z.clear();
            z.extend((0..n).map(|i| {
                let p = origin + spacing * DVec3::new(i as f64, j as f64, k as f64);
                let q =
                    p + DVec3::new(d.rows[0][i] as f64, d.rows[1][i] as f64, d.rows[2][i] as f64);
                let [x, r] = rings.origin_of([q.x, q.y.hypot(q.z)]);
                mean(x, r) as f32
            }));
            gas_row(&table, z, rows);
        });
        Ok(flow)
    }
}

/// Width of the jet.
fn width_m(x: f64) -> f64 {
    0.5 * PIPE_M + 0.12 * (x - 2.0 * PIPE_M).max(0.0)
}

/// Mean mixture fraction, before the turbulent displacement.
fn mean(x: f64, r: f64) -> f64 {
    let x = x.max(0.0);
    let axis = (5.0 * PIPE_M / x.max(1e-9)).min(1.0);
    let sharpness = 2.0 + 14.0 * (-x / (1.5 * PIPE_M)).exp();
    axis * (-(r.abs() / width_m(x)).powf(sharpness)).exp()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::flow::names;
    use crate::testing::with_threads;

    #[test]
    fn flame_widens_downstream_and_fuel_comes_from_the_pipe() {
        let flow = CoalFire { dims: UVec3::new(101, 41, 41), seed: 1 }.flow(Fields::All).unwrap();
        let (z, t) =
            (flow.grid(names::MIXTURE_FRACTION).unwrap(), flow.grid(names::TEMPERATURE).unwrap());
        assert!(z.at(0, 20, 20) > 0.99 && z.at(0, 30, 20) < 1e-3);
        let (cold, hot) = t.range().unwrap();
        assert!(cold >= 499.0 && hot > 1700.0 && hot <= 1900.0, "{cold} {hot}");
        let wide = |i: u32| (0..41).filter(|&j| t.at(i, j, 20) > 800.0).count();
        assert!(wide(60) > 2 * wide(8), "{} {}", wide(8), wide(60));
        let (low, high) = flow.field(names::DENSITY).unwrap().range().unwrap();
        assert!(low > 0.17 && high < 0.75, "{low} {high}");
    }

    #[test]
    fn same_bits_on_1_2_7_threads() {
        let bits = |threads| {
            with_threads(threads, || {
                let flow =
                    CoalFire { dims: UVec3::new(30, 18, 18), seed: 3 }.flow(Fields::All).unwrap();
                flow.fields.iter().map(|f| crate::testing::crc32_f32(&f.values)).collect::<Vec<_>>()
            })
        };
        assert!(bits(1) == bits(2) && bits(1) == bits(7));
    }
}
