//! The gas of a diffusion flame as a function of the mixture fraction: Burke and Schumann's flame
//! sheet.
//!
//! S. P. Burke and T. E. W. Schumann, "Diffusion flames", Ind. Eng. Chem. 20, 1928. With infinitely
//! fast chemistry, mass fractions and temperature are piecewise linear in the mixture fraction Z,
//! with a corner at the stoichiometric value. The density follows from p = ρ R T Σ Y/W. The corner
//! is rounded over a tenth of the range on either side, as finite reaction rates do.

/// A chemical species.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Species {
    /// Name of its mass fraction field.
    pub(crate) name: &'static str,
    /// Molar mass, kg/mol.
    pub(crate) molar_mass: f64,
    /// Mass fraction in the oxidiser stream.
    pub(crate) oxidiser: f64,
    /// Mass fraction in the fuel stream.
    pub(crate) fuel: f64,
    /// Mass produced (or, if negative, consumed) when one kilogram of the fuel stream burns
    /// completely.
    pub(crate) made: f64,
}

/// A fuel stream and an oxidiser stream that burn where they mix.
pub(crate) struct FlameSheet<'a> {
    pub(crate) species: &'a [Species],
    /// Temperatures of oxidiser, flame and fuel, K.
    pub(crate) temperatures_k: [f64; 3],
    pub(crate) pressure_pa: f64,
}

/// Molar gas constant, J/(mol K).
const GAS_CONSTANT: f64 = 8.314_462_618;
/// Number of entries of a [`Table`].
const ENTRIES: usize = 2048;

impl FlameSheet<'_> {
    /// The mixture fraction at which neither fuel nor oxygen remains.
    pub(crate) fn stoichiometric(&self) -> f64 {
        let Some(o2) = self.species.iter().find(|s| s.name == "Y_O2") else { return 1.0 };
        o2.oxidiser / (o2.oxidiser - o2.fuel - o2.made)
    }

    /// Density, temperature and mass fractions.
    pub(crate) fn at(&self, z: f64) -> Vec<f64> {
        // Rounded corner: the mean of the corner over a box in Z.
        let st = self.stoichiometric();
        let round = 0.1 * st.min(1.0 - st);
        let burnt = |z: f64| (z / st).min((1.0 - z) / (1.0 - st));
        let z = z.clamp(0.0, 1.0);
        let progress = if (z - st).abs() < round {
            let (low, high) = (burnt(st - round), burnt(st + round));
            // Integrals of both linear parts over z - round..z + round; exact for a piecewise
            // linear function.
            let t = (z - st) / round;
            let parabola = 1.0
                - 0.25 * (1.0 - low) * (1.0 - t).powi(2)
                - 0.25 * (1.0 - high) * (1.0 + t).powi(2);
            parabola.min(1.0)
        } else {
            burnt(z)
        };
        let [cold, flame, hot] = self.temperatures_k;
        let unburnt = |a: f64, b: f64| a + (b - a) * z;
        // Rise of the flame temperature above the mixing temperature, at the corner.
        let rise = flame - (cold + (hot - cold) * st);
        let temperature = unburnt(cold, hot) + rise * progress;
        let mut out = vec![0.0, temperature];
        out.extend(
            self.species
                .iter()
                .map(|s| (unburnt(s.oxidiser, s.fuel) + st * s.made * progress).max(0.0)),
        );
        let moles: f64 = self.species.iter().zip(&out[2..]).map(|(s, y)| y / s.molar_mass).sum();
        out[0] = self.pressure_pa / (GAS_CONSTANT * temperature * moles);
        out
    }

    /// Tabulates [`FlameSheet::at`] for the evaluation of rows.
    pub(crate) fn table(&self) -> Table {
        let columns = 2 + self.species.len();
        let mut values = vec![Vec::with_capacity(ENTRIES + 1); columns];
        for e in 0..=ENTRIES {
            for (column, v) in values.iter_mut().zip(self.at(e as f64 / ENTRIES as f64)) {
                column.push(v as f32);
            }
        }
        Table { columns: values }
    }
}

/// Density, temperature and mass fractions at equal steps of the mixture fraction, interpolated
/// linearly (error below 1e-3 of a column's range next to the corner, far below elsewhere).
pub(crate) struct Table {
    columns: Vec<Vec<f32>>,
}

impl Table {
    /// The value of a column at the given mixture fraction.
    pub(crate) fn at(&self, column: usize, z: f32) -> f32 {
        let t = z.clamp(0.0, 1.0) * ENTRIES as f32;
        let i = (t as usize).min(ENTRIES - 1);
        let [a, b] = [self.columns[column][i], self.columns[column][i + 1]];
        a + (b - a) * (t - i as f32)
    }
}

#[cfg(test)]
mod tests {
    use crate::generate::{coal_fire, combustion_jet, fire};

    #[test]
    fn mass_fractions_sum_to_one_and_are_never_negative() {
        for sheet in [combustion_jet::SYNGAS, fire::HEPTANE, coal_fire::VOLATILES] {
            for e in 0..=1000 {
                let state = sheet.at(e as f64 / 1000.0);
                let sum: f64 = state[2..].iter().sum();
                assert!((sum - 1.0).abs() < 2e-3, "{sum}");
                assert!(state[2..].iter().all(|&y| y > -2e-3), "{e}: {state:?}");
                assert!(state[0] > 0.05 && state[0] < 4.0, "{}", state[0]);
            }
        }
    }

    #[test]
    fn stoichiometric_values_of_the_literature() {
        // Heptane and air 0.062; the syngas of Hawkes et al. 2007 0.42.
        assert!((fire::HEPTANE.stoichiometric() - 0.062).abs() < 5e-4);
        assert!((combustion_jet::SYNGAS.stoichiometric() - 0.42).abs() < 3e-3);
    }

    #[test]
    fn corner_is_rounded_and_continuous() {
        let sheet = fire::HEPTANE;
        let st = sheet.stoichiometric();
        let hottest = sheet.at(st)[1];
        assert!(
            hottest < sheet.temperatures_k[1] && hottest > 0.93 * sheet.temperatures_k[1],
            "{hottest}"
        );
        let (mut last, mut slope) = (sheet.at(0.0)[1], None);
        for e in 1..=4000 {
            let now = sheet.at(e as f64 * 1e-4 * 0.5)[1];
            if let Some(s) = slope {
                let bend: f64 = (now - last) - s;
                assert!(bend.abs() < 0.5, "{e}: {bend}");
            }
            (slope, last) = (Some(now - last), now);
        }
        // Air at 0: 1.17 kg/m³ at 300 K.
        assert!((sheet.at(0.0)[0] - 1.17).abs() < 0.01, "{}", sheet.at(0.0)[0]);
    }
}
