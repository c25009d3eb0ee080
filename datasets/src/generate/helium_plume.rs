//! A puffing helium plume: helium rises from a disc of 1 m into air at rest, rolls up into rings
//! and breaks up. Represents the 227 x 302 x 302 simulation of table 5.1 of the thesis.
//!
//! The source follows the experiment of T. J. O'Hern et al., "Experimental study of a turbulent
//! buoyant helium plume", J. Fluid Mech. 544, 2005 (source 1 m, puffing about 1.4 times a second);
//! the neck at half a diameter and the rings are choices of this model. The flow is isothermal at
//! 298 K and 1 atm, so density and helium fraction determine each other: 0.164 (helium) to 1.185
//! kg/m³ (air). The index of refraction is not a function of the density alone, so the mass
//! fractions are included. The fields are smooth at the scale of a cell, so they are sampled at
//! points.

use super::flow::{Field, Fields, Flow, FlowError, names};
use super::plume::{Plume, Shape};
use super::turbulence::Displacement;
use glam::{DVec3, UVec3};
use rayon::prelude::*;

/// Number of points in table 5.1.
pub const THESIS_DIMS: UVec3 = UVec3::new(227, 302, 302);

const TEMPERATURE_K: f64 = 298.0;
const PRESSURE_PA: f64 = 101_325.0;
/// Molar mass, kg/mol.
const HELIUM: f64 = 0.004_002_6;
const AIR: f64 = 0.028_965_2;
const SHAPE: Shape = Shape {
    source_radius_m: 0.5,
    neck: 0.5,
    neck_height: 1.1,
    growth: 0.14,
    half_height: 3.2,
    rings: &[0.9, 2.3, 4.2, 6.4],
    displacement: 0.65,
};

/// Parameters of the plume.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HeliumPlume {
    /// Points over 3 m x 4 m x 4 m; z is up, the source in the middle of the floor.
    pub dims: UVec3,
    /// The seed of the random numbers; another seed gives another puff.
    pub seed: u64,
}

/// Density of a mixture of helium and air, kg/m³, from the mass fraction of helium.
fn density(helium: f64) -> f64 {
    PRESSURE_PA / (8.314_462_618 * TEMPERATURE_K * (helium / HELIUM + (1.0 - helium) / AIR))
}

impl HeliumPlume {
    /// Samples the density; with [`Fields::All`] also the mass fractions of helium and air.
    pub fn flow(&self, fields: Fields) -> Result<Flow, FlowError> {
        let mut flow =
            Flow::over(self.dims, DVec3::new(-1.5, -2.0, 0.0), DVec3::new(1.5, 2.0, 4.0))?;
        let plume = Plume::new(&flow, SHAPE, self.seed);
        let wanted = [(names::DENSITY, "kg/m³"), ("Y_He", "1")];
        let wanted = if fields == Fields::All { &wanted[..] } else { &wanted[..1] };
        let scratch = || (Displacement::default(), Vec::new());
        flow.fill(wanted, scratch, |(displacement, share), j, k, rows| {
            plume.share_row(displacement, j, k, share);
            // Volumes rise and mix, so the shares are mole fractions.
            for (i, &x) in share.iter().enumerate() {
                let x = x as f64;
                let y = x * HELIUM / (x * HELIUM + (1.0 - x) * AIR);
                rows[0][i] = density(y) as f32;
                if let Some(helium) = rows.get_mut(1) {
                    helium[i] = y as f32;
                }
            }
        });
        if let Some(helium) = flow.field("Y_He") {
            let values = helium.values.par_iter().map(|y| 1.0 - y).collect();
            flow.fields.push(Field { name: "Y_air", unit: "1", values });
        }
        Ok(flow)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::with_threads;

    #[test]
    fn helium_at_the_source_air_at_the_walls_and_mass_fractions_fit_the_density() {
        let flow = HeliumPlume { dims: UVec3::new(34, 45, 45), seed: 1 }.flow(Fields::All).unwrap();
        let (rho, he) = (flow.grid(names::DENSITY).unwrap(), flow.grid("Y_He").unwrap());
        assert!(he.at(17, 22, 0) > 0.95 && he.at(0, 0, 0) == 0.0, "{}", he.at(17, 22, 0));
        assert!((rho.at(0, 0, 0) - 1.185).abs() < 2e-3, "{}", rho.at(0, 0, 0));
        let (low, _) = rho.range().unwrap();
        assert!((low - 0.164).abs() < 0.02, "{low}");
        for (i, (&y, &r)) in he.values().iter().zip(rho.values()).enumerate() {
            assert!((density(y as f64) / r as f64 - 1.0).abs() < 1e-5, "{i}");
            let air = flow.field("Y_air").unwrap().values[i];
            assert!((0.0..=1.0).contains(&y) && y + air == 1.0);
        }
        // The plume necks: it is narrower half a metre up than at the floor.
        let wide = |k: u32| (0..45).filter(|&j| rho.at(17, j, k) < 0.9).count();
        assert!(wide(6) < wide(0), "{} {}", wide(6), wide(0));
    }

    #[test]
    fn same_bits_on_1_2_7_threads() {
        let plume = HeliumPlume { dims: UVec3::new(17, 22, 22), seed: 3 };
        let bits = |threads| {
            with_threads(threads, || {
                plume
                    .flow(Fields::All)
                    .unwrap()
                    .fields
                    .iter()
                    .map(|f| crate::testing::crc32_f32(&f.values))
                    .collect::<Vec<_>>()
            })
        };
        assert!(bits(1) == bits(2) && bits(1) == bits(7));
    }
}
