//! Computes the index of mixtures of gases given by mass fractions: n − 1 = ρ Σ Yᵢ Kᵢ.
//!
//! The dissertation (eq. 5.5) weights K by volume fractions, which makes the contrast of helium in
//! air wrong by 12 % at a mole fraction of 0.1. Mass fractions are the correct weights: ρ Yᵢ is the
//! density of species i, and each species contributes Kᵢ times its own density.

use super::gladstone_dale::{Gas, R_CODATA_2018};
use super::{IndexError, OutOfRange};

/// Mass fractions whose sum differs from 1 by at most this are scaled to 1 without a warning.
/// Single precision and the transport equations of solvers cause such errors.
pub const SUM_TOLERANCE: f64 = 1e-3;

/// A mixture of gases at one wavelength, prepared for evaluation at many points.
#[derive(Debug, Clone, PartialEq)]
pub struct Mixture {
    names: Vec<String>,
    gases: Vec<Gas>,
    k_m3_per_kg: Vec<f64>,
    /// 1/M in mol/kg; NaN if unknown.
    inverse_molar_mass: Vec<f64>,
    balance_k: f64,
    balance_inverse_molar_mass: f64,
    warnings: Vec<OutOfRange>,
}

/// The constants of a mixture at one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blend {
    /// Gladstone-Dale constant, m³/kg.
    pub k_m3_per_kg: f64,
    /// Molar mass, kg/mol; NaN if that of a species is unknown.
    pub molar_mass_kg: f64,
    /// Sum of the given fractions.
    pub sum: f64,
}

impl Mixture {
    /// Creates a mixture from species with the names of their fields. `balance` is the gas of the
    /// remaining fraction (usually [`Gas::AIR`]). Without species, the mixture is the pure balance
    /// gas.
    pub fn new(
        species: &[(String, Gas)],
        balance: &Gas,
        wavelength_um: f64,
    ) -> Result<Self, IndexError> {
        let constants = |gas: &Gas| -> Result<(f64, f64), IndexError> {
            Ok((gas.k_m3_per_kg(wavelength_um)?, 1.0 / gas.molar_mass_kg().unwrap_or(f64::NAN)))
        };
        let all = species.iter().map(|(_, g)| constants(g)).collect::<Result<Vec<_>, _>>()?;
        let (balance_k, balance_inverse_molar_mass) = constants(balance)?;
        let gases = species.iter().map(|(_, g)| g).chain([balance]);
        Ok(Mixture {
            names: species.iter().map(|(n, _)| n.clone()).collect(),
            gases: species.iter().map(|(_, g)| g.clone()).collect(),
            k_m3_per_kg: all.iter().map(|x| x.0).collect(),
            inverse_molar_mass: all.iter().map(|x| x.1).collect(),
            balance_k,
            balance_inverse_molar_mass,
            warnings: gases.filter_map(|g| g.out_of_range(wavelength_um)).collect(),
        })
    }

    /// Formulas that are used outside their measured wavelengths.
    pub fn warnings(&self) -> &[OutOfRange] {
        &self.warnings
    }

    /// Number of species, without the balance.
    pub fn len(&self) -> usize {
        self.gases.len()
    }
    /// Whether there are no species besides the balance.
    pub fn is_empty(&self) -> bool {
        self.gases.is_empty()
    }

    /// Checks that every species has a molar mass, which the density from temperature and pressure
    /// needs. The error names the first one without.
    pub fn check_molar_masses(&self) -> Result<(), IndexError> {
        match self.inverse_molar_mass.iter().position(|m| m.is_nan()) {
            Some(i) => Err(IndexError::NoMolarMass { name: self.names[i].clone() }),
            None => Ok(()),
        }
    }

    /// The constants of the mixture for these mass fractions. The balance gas fills the sum up
    /// to 1. Fractions with a larger sum are scaled down, and negative ones (overshoots of a
    /// solver) count as 0; [`Blend::sum`] shows whether that happened.
    pub fn blend(&self, mass_fractions: &[f64]) -> Blend {
        debug_assert_eq!(mass_fractions.len(), self.len());
        let (mut k, mut inverse, mut sum) = (0.0, 0.0, 0.0);
        for (i, &y) in mass_fractions.iter().enumerate() {
            // `y < 0` instead of `y.max(0)`, so that NaN stays NaN and the point is masked.
            let y = if y < 0.0 { 0.0 } else { y };
            sum += y;
            k += y * self.k_m3_per_kg[i];
            if y != 0.0 {
                inverse += y * self.inverse_molar_mass[i];
            }
        }
        // A remainder within the tolerance is an error of the fractions, not a trace of air.
        let scale = if sum > 1.0 - SUM_TOLERANCE { 1.0 / sum } else { 1.0 };
        let balance_fraction = if sum > 1.0 - SUM_TOLERANCE { 0.0 } else { 1.0 - sum };
        let inverse = inverse * scale
            + if balance_fraction > 0.0 {
                balance_fraction * self.balance_inverse_molar_mass
            } else {
                0.0
            };
        Blend {
            k_m3_per_kg: k * scale + balance_fraction * self.balance_k,
            molar_mass_kg: 1.0 / inverse,
            sum,
        }
    }

    /// [`Self::blend`] for user input: fails unless each fraction is from 0 to 1 and their sum is
    /// at most 1.
    pub fn try_blend(&self, mass_fractions: &[f64]) -> Result<Blend, IndexError> {
        let sum: f64 = mass_fractions.iter().sum();
        let bad = mass_fractions.iter().any(|y| !(0.0..=1.0).contains(y));
        if bad || sum > 1.0 + SUM_TOLERANCE {
            return Err(IndexError::Fractions {
                species: self.names.join(", "),
                sum,
                cure: "each mass fraction must be from 0 to 1 and their sum at most 1",
            });
        }
        Ok(self.blend(mass_fractions))
    }
}

impl Blend {
    /// Density of an ideal gas, kg/m³.
    pub fn density_kg_m3(&self, temperature_k: f64, pressure_pa: f64) -> f64 {
        pressure_pa * self.molar_mass_kg / (R_CODATA_2018 * temperature_k)
    }
    /// n − 1 = K ρ.
    pub fn n_minus_1(&self, density_kg_m3: f64) -> f64 {
        self.k_m3_per_kg * density_kg_m3
    }
}

/// Converts mole (volume) fractions to mass fractions. The mole fractions must sum to 1 within
/// [`SUM_TOLERANCE`].
pub fn mass_from_mole_fractions(gases: &[(f64, Gas)]) -> Result<Vec<f64>, IndexError> {
    let sum: f64 = gases.iter().map(|g| g.0).sum();
    if !(1.0 - SUM_TOLERANCE..=1.0 + SUM_TOLERANCE).contains(&sum) {
        let species = gases.iter().map(|g| g.1.to_string()).collect::<Vec<_>>().join(", ");
        return Err(IndexError::Fractions { species, sum, cure: "mole fractions must sum to 1" });
    }
    let masses = gases
        .iter()
        .map(|(x, g)| match g.molar_mass_kg() {
            Some(m) => Ok(x * m),
            None => Err(IndexError::NoMolarMass { name: g.to_string() }),
        })
        .collect::<Result<Vec<f64>, _>>()?;
    let total: f64 = masses.iter().sum();
    Ok(masses.into_iter().map(|m| m / total).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn helium_in_air() -> Mixture {
        Mixture::new(&[("He".into(), "He".parse().unwrap())], &Gas::AIR, 0.633).unwrap()
    }

    #[test]
    fn refractivities_of_moles_add_at_equal_temperature_and_pressure() {
        // Independent check: n − 1 = Σ X (n − 1) of the pure gases at the same T and p.
        let m = helium_in_air();
        for x in [0.0, 0.1, 0.5, 0.9, 1.0] {
            let he: Gas = "He".parse().unwrap();
            let y = mass_from_mole_fractions(&[(x, he), (1.0 - x, Gas::AIR)]).unwrap();
            let at = |y: f64| {
                let b = m.blend(&[y]);
                b.n_minus_1(b.density_kg_m3(293.15, 101_325.0))
            };
            let (got, expected) = (at(y[0]), x * at(1.0) + (1.0 - x) * at(0.0));
            // Fractions within SUM_TOLERANCE of 1 are treated as a pure gas; these are farther
            // from 1.
            assert!((got / expected - 1.0).abs() < 1e-12, "X = {x}: {got} {expected}");
        }
    }

    #[test]
    fn weighting_by_volume_as_in_the_dissertation_would_be_wrong_by_twelve_per_cent() {
        let m = helium_in_air();
        let y = mass_from_mole_fractions(&[(0.1, "He".parse().unwrap()), (0.9, Gas::AIR)]).unwrap();
        let b = m.blend(&[y[0]]);
        let rho = b.density_kg_m3(293.15, 101_325.0);
        let (k_he, k_air) = (m.blend(&[1.0]).k_m3_per_kg, m.blend(&[0.0]).k_m3_per_kg);
        let air = m.blend(&[0.0]);
        let background = air.n_minus_1(air.density_kg_m3(293.15, 101_325.0));
        let (right, dissertation) =
            (background - b.n_minus_1(rho), background - (0.1 * k_he + 0.9 * k_air) * rho);
        let error = dissertation / right - 1.0;
        assert!((0.11..0.14).contains(&error), "{error}");
    }

    #[test]
    fn fractions_that_do_not_sum_to_one() {
        let species = [
            ("N2".to_string(), "N2".parse().unwrap()),
            ("CO2".to_string(), "CO2".parse().unwrap()),
        ];
        let m = Mixture::new(&species, &Gas::AIR, 0.589).unwrap();
        let whole = m.blend(&[0.6, 0.4]);
        for scaled in [m.blend(&[1.2, 0.8]), m.blend(&[0.5997, 0.3998])] {
            assert!((scaled.k_m3_per_kg / whole.k_m3_per_kg - 1.0).abs() < 1e-12);
            assert!((scaled.molar_mass_kg / whole.molar_mass_kg - 1.0).abs() < 1e-12);
        }
        assert_eq!(m.blend(&[1.2, 0.8]).sum, 2.0);
        assert_eq!(m.blend(&[-0.1, 1.0]), m.blend(&[0.0, 1.0]));
        assert!(m.blend(&[f64::NAN, 0.5]).k_m3_per_kg.is_nan());
        let half = m.blend(&[0.5, 0.0]);
        let air = Gas::AIR.k_m3_per_kg(0.589).unwrap();
        let n2 = Gas::Known(2).k_m3_per_kg(0.589).unwrap();
        assert!((half.k_m3_per_kg - 0.5 * (air + n2)).abs() < 1e-18);
        assert!(m.try_blend(&[0.8, 0.4]).unwrap_err().to_string().contains("N2, CO2 sum to 1.2"));
    }

    #[test]
    fn a_gas_without_molar_mass_serves_with_density_only() {
        let m =
            Mixture::new(&[("AsH3".into(), "0.42".parse().unwrap())], &Gas::AIR, 0.633).unwrap();
        assert!(m.check_molar_masses().unwrap_err().to_string().contains("`AsH3=0.42@77.9`"));
        assert!((m.blend(&[1.0]).n_minus_1(2.0) - 0.84e-3).abs() < 1e-15);
        assert!(m.blend(&[0.5]).molar_mass_kg.is_nan());
    }
}
