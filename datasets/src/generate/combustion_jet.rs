//! A turbulent plane jet of fuel between two streams of oxidiser, burning in thin sheets.
//! Represents the combustion simulation of 480 x 720 x 100 points in table 5.1 of the thesis (a
//! temporally evolving jet: x along it, periodic; y across; z the span).
//!
//! Streams, pressure and slot follow E. R. Hawkes et al., "Scalar mixing in direct numerical
//! simulations of temporally evolving plane jet flames with skeletal CO/H2 kinetics", Proc.
//! Combust. Inst. 31, 2007: fuel 50 % CO, 10 % H2, 40 % N2 and oxidiser 25 % O2, 75 % N2 by volume,
//! both at 500 K and 1 atm, slot 1.37 mm. The mean mixture fraction is a smoothed top hat; rollers
//! and `turbulence` fold it; the gas follows from the `flame_sheet`. Ranges: 500 to about 2030 K,
//! density 0.19 to 0.71 kg/m³. The fields are smooth at the scale of a cell (the shortest
//! wavelength has six), so they are sampled at points.

use super::flame_sheet::{FlameSheet, Species};
use super::flow::{Fields, Flow, FlowError, names};
use super::turbulence::{Displacement, Turbulence, Vortex, Vortices};
use glam::{DVec3, UVec3};
use rt_core::math::SplitMix64;
use std::f64::consts::TAU;

/// Number of points in table 5.1.
pub const THESIS_DIMS: UVec3 = UVec3::new(480, 720, 100);

/// The streams.
pub(crate) const SYNGAS: FlameSheet<'static> = FlameSheet {
    species: &[
        Species { name: "Y_CO", molar_mass: 0.028_010, oxidiser: 0.0, fuel: 0.5511, made: -0.5511 },
        Species { name: "Y_H2", molar_mass: 0.002_016, oxidiser: 0.0, fuel: 0.0079, made: -0.0079 },
        Species { name: "Y_O2", molar_mass: 0.031_998, oxidiser: 0.2757, fuel: 0.0, made: -0.3775 },
        Species { name: "Y_N2", molar_mass: 0.028_014, oxidiser: 0.7243, fuel: 0.4410, made: 0.0 },
        Species { name: "Y_CO2", molar_mass: 0.044_010, oxidiser: 0.0, fuel: 0.0, made: 0.8659 },
        Species { name: "Y_H2O", molar_mass: 0.018_015, oxidiser: 0.0, fuel: 0.0, made: 0.0706 },
    ],
    temperatures_k: [500.0, 2100.0, 500.0],
    pressure_pa: 101_325.0,
};

/// Height of the slot from which the jet issues.
const SLOT_M: f64 = 1.37e-3;
/// Height of the domain; the other extents follow from the number of points.
const HEIGHT_M: f64 = 14.0 * SLOT_M;

/// Parameters of the jet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CombustionJet {
    /// Number of points; the spacing is 14 slots over `dims.y - 1` along all axes.
    pub dims: UVec3,
    /// The seed of the random numbers; another seed gives another jet of the same kind.
    pub seed: u64,
}

impl CombustionJet {
    /// Samples the density; with [`Fields::All`] also temperature, mixture fraction and the mass
    /// fractions of CO, H2, O2, N2, CO2 and H2O.
    pub fn flow(&self, fields: Fields) -> Result<Flow, FlowError> {
        let mut flow = self.lattice()?;
        let table = SYNGAS.table();
        let wanted = gas_fields(&SYNGAS, fields);
        let mixing = self.mixing(&flow);
        let scratch = || (Displacement::default(), Vec::new());
        flow.fill(&wanted, scratch, |(displacement, z), j, k, rows| {
            mixing.mixture_row(displacement, j, k, z);
            gas_row(&table, z, rows);
        });
        Ok(flow)
    }

    /// The lattice without fields.
    pub(crate) fn lattice(&self) -> Result<Flow, FlowError> {
        let h = HEIGHT_M / self.dims.y.max(2).saturating_sub(1) as f64;
        let high = (self.dims.as_dvec3() - 1.0).max(DVec3::ONE) * h;
        Flow::over(self.dims, -0.5 * high, 0.5 * high)
    }

    /// The mixing of fuel and oxidiser.
    pub(crate) fn mixing(&self, flow: &Flow) -> Mixing {
        let mut random = SplitMix64::new(self.seed);
        let length = flow.spacing_m.x * (flow.dims.x - 1) as f64;
        // Rollers on both faces, staggered, about 3 slots apart. Images to the left and right make
        // them periodic.
        let count = (length / (3.0 * SLOT_M)).round().max(1.0);
        let mut rollers = Vec::new();
        for n in 0..count as u32 {
            for side in [-1.0, 1.0] {
                let stagger = if side > 0.0 { 0.5 } else { 0.0 };
                let x = (n as f64 + stagger + random.between(-0.15, 0.15)) / count * length
                    - 0.5 * length;
                let y = side * (1.65 + random.between(-0.15, 0.15)) * SLOT_M;
                let (size, turn) = (random.between(0.7, 1.1) * SLOT_M, random.between(2.5, 5.0));
                for image in [-1.0, 0.0, 1.0] {
                    let center_m = [x + image * length, y];
                    rollers.push(Vortex { center_m, size_m: size, turn_rad: -side * turn });
                }
            }
        }
        let braid = [0, 1, 2].map(|_| random.between(0.0, TAU));
        Mixing {
            turbulence: Turbulence::new(flow, 3.0 * SLOT_M, self.seed),
            rollers: Vortices(rollers),
            braid,
            origin_m: flow.origin_m,
            spacing_m: flow.spacing_m,
            dims: flow.dims,
        }
    }
}

/// The mixture fraction of the jet.
pub(crate) struct Mixing {
    turbulence: Turbulence,
    rollers: Vortices,
    braid: [f64; 3],
    origin_m: DVec3,
    spacing_m: DVec3,
    dims: UVec3,
}

impl Mixing {
    /// Computes the mixture fraction along a row; `d` holds the displacements afterwards.
    pub(crate) fn mixture_row(&self, d: &mut Displacement, j: u32, k: u32, z: &mut Vec<f32>) {
        self.turbulence.displace_row(d, j, k, |_| (2.5 * SLOT_M, 0.45));
        z.clear();
        z.extend((0..self.dims.x as usize).map(|i| {
            let p = self.origin_m + self.spacing_m * DVec3::new(i as f64, j as f64, k as f64);
            let q = p + DVec3::new(d.rows[0][i] as f64, d.rows[1][i] as f64, d.rows[2][i] as f64);
            self.mean(q) as f32
        }));
    }

    /// The mean field, before the turbulent displacement.
    fn mean(&self, p: DVec3) -> f64 {
        // The rollers meander along the span.
        let [a, b, c] = self.braid;
        let wander = 0.25
            * SLOT_M
            * ((TAU * p.z / (2.6 * SLOT_M) + a).sin()
                + 0.6 * (TAU * p.z / (1.1 * SLOT_M) + b).sin());
        let [x, y] =
            self.rollers.origin_of([p.x + wander, p.y + 0.3 * wander * (c + p.x / SLOT_M).cos()]);
        // The jet has widened to 3.2 slots; its mixing layers are 0.4 slots thick, and its core is
        // diluted.
        let edge = |y: f64| 0.5 * (1.0 + (y / (0.4 * SLOT_M)).tanh());
        let dilution = 0.85 - 0.15 * (TAU * x / (4.1 * SLOT_M)).sin();
        dilution * edge(y + 1.6 * SLOT_M) * edge(1.6 * SLOT_M - y)
    }
}

/// Names and units of a flame's fields, as [`gas_row`] fills them.
pub(crate) fn gas_fields(
    sheet: &FlameSheet<'_>,
    fields: Fields,
) -> Vec<(&'static str, &'static str)> {
    let mut all = vec![(names::DENSITY, "kg/m³")];
    if fields == Fields::All {
        all.extend([(names::TEMPERATURE, "K"), (names::MIXTURE_FRACTION, "1")]);
        all.extend(sheet.species.iter().map(|s| (s.name, "1")));
    }
    all
}

/// Computes a row of density and, if requested, temperature, mixture fraction and mass fractions.
pub(crate) fn gas_row(table: &super::flame_sheet::Table, z: &[f32], rows: &mut [&mut [f32]]) {
    for (r, row) in rows.iter_mut().enumerate() {
        for (v, &z) in row.iter_mut().zip(z) {
            *v = match r {
                0 | 1 => table.at(r, z),
                2 => z,
                _ => table.at(r - 1, z),
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::with_threads;

    const SMALL: CombustionJet = CombustionJet { dims: UVec3::new(48, 72, 10), seed: 1 };

    #[test]
    fn jet_burns_in_sheets_between_unburnt_streams() {
        let flow =
            CombustionJet { dims: UVec3::new(96, 144, 12), seed: 1 }.flow(Fields::All).unwrap();
        let (low, high) = flow.field(names::DENSITY).unwrap().range().unwrap();
        assert!(low > 0.13 && low < 0.2 && high > 0.6 && high < 0.75, "{low} {high}");
        let (cold, hot) = flow.field(names::TEMPERATURE).unwrap().range().unwrap();
        assert!(cold >= 499.9 && hot > 1900.0 && hot <= 2100.0, "{cold} {hot}");
        let z = flow.grid(names::MIXTURE_FRACTION).unwrap();
        // Pure oxidiser far from the jet, mostly fuel inside it.
        for i in 0..96 {
            assert!(z.at(i, 0, 5) < 1e-3 && z.at(i, 143, 5) < 1e-3);
        }
        let core = (0..96).map(|i| z.at(i, 72, 5)).sum::<f32>() / 96.0;
        assert!(core > 0.6, "{core}");
        // Folding: lines across the jet cross the flame more often than twice.
        let crossings = |i: u32, k: u32| {
            (1..144).filter(|&j| (z.at(i, j, k) > 0.42) != (z.at(i, j - 1, k) > 0.42)).count()
        };
        let most = (0..96).map(|i| crossings(i, 6)).max().unwrap();
        assert!(most >= 4, "{most}");
    }

    #[test]
    fn more_points_show_finer_structure() {
        // The steepest density gradient per metre grows with the resolution.
        let steepest = |dims: UVec3| {
            let flow = CombustionJet { dims, seed: 1 }.flow(Fields::Density).unwrap();
            let d = flow.grid(names::DENSITY).unwrap();
            let rows = (1..dims.y).flat_map(|j| (0..dims.x).map(move |i| (i, j)));
            let squares =
                rows.map(|(i, j)| (d.at(i, j, 2) - d.at(i, j - 1, 2)).powi(2) as f64).sum::<f64>();
            (squares / (dims.x * dims.y) as f64).sqrt() / flow.spacing_m.y
        };
        let [coarse, fine] = [UVec3::new(48, 72, 5), UVec3::new(192, 288, 5)].map(steepest);
        assert!(fine > 1.3 * coarse, "{coarse} {fine}");
    }

    #[test]
    fn same_bits_on_1_2_7_threads_and_density_alone_is_the_same_density() {
        let bits = |threads, fields| {
            with_threads(threads, || {
                crate::testing::crc32_f32(&SMALL.flow(fields).unwrap().fields[0].values)
            })
        };
        let one = bits(1, Fields::All);
        assert!(one == bits(2, Fields::All) && one == bits(7, Fields::Density));
        assert_eq!(SMALL.flow(Fields::Density).unwrap().fields.len(), 1);
        assert_eq!(SMALL.flow(Fields::All).unwrap().fields.len(), 9);
    }
}
