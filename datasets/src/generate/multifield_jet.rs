//! The combustion jet as five fields, for images of several quantities at once (section 5.7 of the
//! thesis): scalar dissipation `chi`, heat release `hr`, mixture fraction `mixfrac`, vorticity
//! `vort` and hydroxyl `Y_OH`. The density precedes them.
//!
//! Mixture fraction and density are those of [`combustion_jet`](super::combustion_jet). The others
//! follow from them as in laminar flamelets (N. Peters, "Laminar diffusion flamelet models in
//! non-premixed turbulent combustion", Prog. Energy Combust. Sci. 10, 1984): χ = 2 D |∇Z|². The
//! flame is a band of Z about the stoichiometric value. Its heat release grows with χ, and it is
//! extinct (no OH) where χ exceeds the quenching value. The vorticity is the curl of the jet's mean
//! velocity plus eddies that follow the displacements. Derivatives are central differences,
//! one-sided at the border.

use super::combustion_jet::{CombustionJet, SYNGAS};
use super::flow::{Field, Flow, FlowError, names};
use super::turbulence::Displacement;
use glam::DVec3;
use rayon::prelude::*;

/// Diffusivity of mass, m²/s: that of N2 in air at 450 K, so that most of the flame burns and its
/// most strained parts are extinct.
const DIFFUSIVITY: f64 = 4e-5;
/// Scalar dissipation at which the flame is extinguished, 1/s: 2000, the order of magnitude for
/// this fuel.
const QUENCHING: f64 = 2000.0;
/// Mass fraction of OH in a burning flame.
const HYDROXYL: f64 = 4e-3;
/// Heat release at χ = 1/s, W/m³; it grows with the square root of χ.
const HEAT_RELEASE: f64 = 1.5e8;
/// Mean velocity of the jet relative to the coflow, m/s.
const JET_SPEED: f64 = 190.0;
/// Velocity per displacement, in m/s per metre: eddies of a slot's size turn over about as fast as
/// the jet passes.
const EDDY_RATE: f64 = JET_SPEED / 1.4e-3;

/// Computes the six fields: the density, then the five in the order above.
pub fn multifield_jet(jet: CombustionJet) -> Result<Flow, FlowError> {
    let mut flow = jet.lattice()?;
    let mixing = jet.mixing(&flow);
    let table = SYNGAS.table();
    let wanted =
        [(names::DENSITY, "kg/m³"), ("mixfrac", "1"), ("u", "m/s"), ("v", "m/s"), ("w", "m/s")];
    let scratch = || (Displacement::default(), Vec::new());
    flow.fill(&wanted, scratch, |(d, z), j, k, rows| {
        mixing.mixture_row(d, j, k, z);
        for (i, &z) in z.iter().enumerate() {
            rows[0][i] = table.at(0, z);
            rows[1][i] = z;
            for c in 0..3 {
                // The jet moves in the opposite direction to the gas on both sides; eddies live
                // where the jet mixes.
                let eddies =
                    EDDY_RATE as f32 * d.rows[c][i] * (4.0 * z * (1.0 - z)).clamp(0.1, 1.0);
                rows[2 + c][i] =
                    if c == 0 { JET_SPEED as f32 * (z - 0.5) + eddies } else { eddies };
            }
        }
    });

    // Derivatives.
    let velocity: [Field; 3] = {
        let w = flow.fields.pop();
        let v = flow.fields.pop();
        let u = flow.fields.pop();
        match (u, v, w) {
            (Some(u), Some(v), Some(w)) => [u, v, w],
            _ => return Ok(flow), // unreachable: five fields were just filled
        }
    };
    let derivative =
        Differences { dims: flow.dims.to_array().map(|d| d as usize), spacing_m: flow.spacing_m };
    let z = &flow.fields[1].values;
    let chi: Vec<f32> = (0..z.len())
        .into_par_iter()
        .map(|at| (2.0 * DIFFUSIVITY * derivative.gradient(z, at).length_squared()) as f32)
        .collect();
    let vorticity: Vec<f32> = (0..z.len())
        .into_par_iter()
        .map(|at| {
            let [u, v, w] = [0, 1, 2].map(|c| derivative.gradient(&velocity[c].values, at));
            DVec3::new(w.y - v.z, u.z - w.x, v.x - u.y).length() as f32
        })
        .collect();
    // The flame.
    let stoichiometric = SYNGAS.stoichiometric();
    let band = |z: f32, width: f64| (-((z as f64 - stoichiometric) / width).powi(2)).exp();
    let burning = |chi: f32| 1.0 / (1.0 + (chi as f64 / QUENCHING).powi(4));
    let both = || z.par_iter().zip(&chi);
    let hydroxyl =
        both().map(|(&z, &chi)| (HYDROXYL * band(z, 0.12) * burning(chi)) as f32).collect();
    let heat = both()
        .map(|(&z, &chi)| {
            (HEAT_RELEASE * (chi as f64).sqrt() * band(z, 0.06) * burning(chi)) as f32
        })
        .collect();
    let field = |name, unit, values| Field { name, unit, values };
    let mixfrac = flow.fields.pop();
    flow.fields.push(field("chi", "1/s", chi));
    flow.fields.push(field("hr", "W/m³", heat));
    flow.fields.extend(mixfrac);
    flow.fields.push(field("vort", "1/s", vorticity));
    flow.fields.push(field("Y_OH", "1", hydroxyl));
    Ok(flow)
}

/// Central differences on the lattice.
struct Differences {
    dims: [usize; 3],
    spacing_m: DVec3,
}

impl Differences {
    fn gradient(&self, values: &[f32], at: usize) -> DVec3 {
        let [nx, ny, _] = self.dims;
        let index = [at % nx, at / nx % ny, at / (nx * ny)];
        let stride = [1, nx, nx * ny];
        DVec3::from_array([0, 1, 2].map(|a| {
            let low = if index[a] > 0 { at - stride[a] } else { at };
            let high = if index[a] + 1 < self.dims[a] { at + stride[a] } else { at };
            let steps = ((high - low) / stride[a]) as f64;
            (values[high] as f64 - values[low] as f64) / (steps * self.spacing_m[a])
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::with_threads;
    use glam::UVec3;

    #[test]
    fn five_fields_behind_the_density_and_flame_where_it_is_stoichiometric() {
        let jet = CombustionJet { dims: UVec3::new(48, 72, 10), seed: 1 };
        let flow = multifield_jet(jet).unwrap();
        assert_eq!(
            flow.fields.iter().map(|f| f.name).collect::<Vec<_>>(),
            ["density", "chi", "hr", "mixfrac", "vort", "Y_OH"]
        );
        let same = jet.flow(crate::generate::flow::Fields::Density).unwrap();
        assert_eq!(flow.fields[0], same.fields[0]);
        let [z, oh, hr] = ["mixfrac", "Y_OH", "hr"].map(|n| &flow.field(n).unwrap().values);
        let (mut burning, mut total) = (0.0, 0.0);
        for ((&z, &oh), &hr) in z.iter().zip(oh).zip(hr) {
            total += oh;
            burning += if (z - 0.42).abs() < 0.2 { oh } else { 0.0 };
            assert!(hr >= 0.0 && (0.0..=0.004).contains(&oh));
        }
        assert!(burning > 0.9 * total && total > 0.0, "{burning} of {total}");
        let chi = flow.field("chi").unwrap().range().unwrap();
        assert!(chi.0 >= 0.0 && chi.1 > 100.0, "{chi:?}");
        assert!(flow.field("vort").unwrap().range().unwrap().1 > 1e4);
    }

    #[test]
    fn same_bits_on_1_2_7_threads() {
        let bits = |threads| {
            with_threads(threads, || {
                let flow =
                    multifield_jet(CombustionJet { dims: UVec3::new(16, 24, 8), seed: 3 }).unwrap();
                flow.fields.iter().map(|f| crate::testing::crc32_f32(&f.values)).collect::<Vec<_>>()
            })
        };
        assert!(bits(1) == bits(2) && bits(1) == bits(7));
    }
}
