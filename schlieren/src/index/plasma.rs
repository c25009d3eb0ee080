//! Computes the index of free electrons: n² = 1 − n_e/n_c, without collisions and magnetic field.
//!
//! At the critical density n_c = ε0 m_e ω²/e², the plasma frequency equals that of the light. Light
//! does not propagate at higher densities.

use super::IndexError;

/// n_c λ², in 1/m³ · µm²: ε0 m_e (2πc)²/e² with the constants of CODATA 2018.
const CRITICAL_M3_UM2: f64 = 1.114_854_2e27;

/// Critical electron density in 1/m³ for light of this wavelength in vacuum.
pub fn critical_density_m3(wavelength_um: f64) -> f64 {
    CRITICAL_M3_UM2 / (wavelength_um * wavelength_um)
}

/// n − 1 of free electrons with this density (1/m³); never positive. Computed as −x/(1 + √(1 − x)),
/// which avoids the cancellation in √(1 − x) − 1.
///
/// ```
/// use schlieren::index::plasma;
/// let thin = plasma::n_minus_1(1e20, 0.532)?;
/// assert!((thin / (-0.5 * 1e20 / plasma::critical_density_m3(0.532)) - 1.0).abs() < 1e-7);
/// assert!(plasma::n_minus_1(1e29, 0.532).is_err()); // light does not get through
/// # Ok::<(), schlieren::index::IndexError>(())
/// ```
pub fn n_minus_1(electrons_per_m3: f64, wavelength_um: f64) -> Result<f64, IndexError> {
    let x = electrons_per_m3 / critical_density_m3(wavelength_um);
    if !(0.0..1.0).contains(&x) {
        return Err(IndexError::Impossible {
            quantity: "electron density",
            value: electrons_per_m3,
            unit: "1/m^3",
            reason: "is not between 0 and the critical density of this wavelength",
            cure: "give it in 1/m^3 (1/cm^3 times 1e6), or use a shorter wavelength",
        });
    }
    Ok(-x / (1.0 + (1.0 - x).sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_critical_density_follows_from_the_constants_of_nature() {
        let (epsilon_0, electron_kg, charge, c) =
            (8.854_187_812_8e-12, 9.109_383_701_5e-31, 1.602_176_634e-19, 299_792_458.0);
        let omega = 2.0 * std::f64::consts::PI * c / 1e-6;
        let expected: f64 = epsilon_0 * electron_kg * omega * omega / (charge * charge);
        assert!((critical_density_m3(1.0) / expected - 1.0).abs() < 1e-7, "{expected}");
    }

    #[test]
    fn thin_plasma_keeps_all_its_digits() {
        // 1 − n computed as a difference would have 4 digits here.
        let x = 1e-12;
        let got = n_minus_1(x * critical_density_m3(1.0), 1.0).unwrap();
        assert!((got / (-0.5 * x * (1.0 + 0.25 * x)) - 1.0).abs() < 1e-15);
        assert!(n_minus_1(f64::NAN, 1.0).is_err() && n_minus_1(-1.0, 1.0).is_err());
    }
}
