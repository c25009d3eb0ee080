//! A heptane pool fire: a pool of 0.3 m burns in air. Represents the 293³ heptane fire of table 5.1
//! of the thesis.
//!
//! `plume` models the mixing and `flame_sheet` the combustion: C7H16 + 11 O2 = 7 CO2 + 8 H2O,
//! stoichiometric mixture fraction 0.062. The flame's temperature is set to 1500 K, well below the
//! adiabatic one of about 2270 K, because soot radiates; this is the order of magnitude of pool
//! fires of this size. Ranges: 300 to 1500 K, density 0.23 to 3.3 kg/m³ (heptane's heavy vapour at
//! its boiling point, just above the pool). The fields are smooth at the scale of a cell except at
//! the flame sheet's rounded corner, so they are sampled at points.

use super::combustion_jet::{gas_fields, gas_row};
use super::flame_sheet::{FlameSheet, Species};
use super::flow::{Fields, Flow, FlowError};
use super::plume::{Plume, Shape};
use super::turbulence::Displacement;
use glam::{DVec3, UVec3};

/// Number of points in table 5.1.
pub const THESIS_DIMS: UVec3 = UVec3::splat(293);

/// The streams.
pub(crate) const HEPTANE: FlameSheet<'static> = FlameSheet {
    species: &[
        Species { name: "Y_C7H16", molar_mass: 0.100_20, oxidiser: 0.0, fuel: 1.0, made: -1.0 },
        Species { name: "Y_O2", molar_mass: 0.031_998, oxidiser: 0.2314, fuel: 0.0, made: -3.5128 },
        Species { name: "Y_N2", molar_mass: 0.028_014, oxidiser: 0.7686, fuel: 0.0, made: 0.0 },
        Species { name: "Y_CO2", molar_mass: 0.044_010, oxidiser: 0.0, fuel: 0.0, made: 3.0745 },
        Species { name: "Y_H2O", molar_mass: 0.018_015, oxidiser: 0.0, fuel: 0.0, made: 1.4383 },
    ],
    temperatures_k: [300.0, 1500.0, 371.6],
    pressure_pa: 101_325.0,
};

const SHAPE: Shape = Shape {
    source_radius_m: 0.15,
    neck: 0.55,
    neck_height: 1.4,
    growth: 0.13,
    half_height: 0.7,
    rings: &[1.1, 2.5, 4.3, 6.2],
    displacement: 0.75,
};

/// Parameters of the fire.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fire {
    /// Points over 1 m x 1 m x 1 m; z is up, the pool in the middle of the floor.
    pub dims: UVec3,
    /// The seed of the random numbers; another seed gives another state of the same fire.
    pub seed: u64,
}

impl Fire {
    /// Samples the density; with [`Fields::All`] also temperature, mixture fraction and the mass
    /// fractions of C7H16, O2, N2, CO2 and H2O.
    pub fn flow(&self, fields: Fields) -> Result<Flow, FlowError> {
        let mut flow =
            Flow::over(self.dims, DVec3::new(-0.5, -0.5, 0.0), DVec3::new(0.5, 0.5, 1.0))?;
        let plume = Plume::new(&flow, SHAPE, self.seed);
        let table = HEPTANE.table();
        let scratch = || (Displacement::default(), Vec::new());
        flow.fill(&gas_fields(&HEPTANE, fields), scratch, |(displacement, z), j, k, rows| {
            plume.share_row(displacement, j, k, z);
            gas_row(&table, z, rows);
        });
        Ok(flow)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::flow::names;
    use crate::testing::with_threads;

    #[test]
    fn flame_stands_above_the_pool_in_cold_air() {
        let flow = Fire { dims: UVec3::splat(44), seed: 1 }.flow(Fields::All).unwrap();
        let t = flow.grid(names::TEMPERATURE).unwrap();
        let (cold, hot) = t.range().unwrap();
        assert!(cold > 299.0 && hot > 1300.0 && hot <= 1500.0, "{cold} {hot}");
        assert!(t.at(0, 0, 20) < 301.0);
        let (low, high) = flow.field(names::DENSITY).unwrap().range().unwrap();
        assert!(low > 0.2 && low < 0.3 && high > 2.5 && high < 3.4, "{low} {high}");
        // Hot gas reaches the upper half of the domain.
        assert!((0..44).any(|i| (0..44).any(|j| t.at(i, j, 30) > 800.0)));
    }

    #[test]
    fn same_bits_on_1_2_7_threads() {
        let bits = |threads| {
            with_threads(threads, || {
                let flow = Fire { dims: UVec3::splat(18), seed: 3 }.flow(Fields::All).unwrap();
                flow.fields.iter().map(|f| crate::testing::crc32_f32(&f.values)).collect::<Vec<_>>()
            })
        };
        assert!(bits(1) == bits(2) && bits(1) == bits(7));
    }
}
