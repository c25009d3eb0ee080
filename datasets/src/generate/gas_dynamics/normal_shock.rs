//! The jump across a normal shock (Rankine-Hugoniot), and the stagnation pressure behind it.

use super::{GasError, check_gamma, isentropic};

/// Ratios of the values behind a shock to those in front of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jump {
    /// Density.
    pub density: f64,
    /// Pressure.
    pub pressure: f64,
    /// Temperature.
    pub temperature: f64,
    /// Total pressure, which measures the loss.
    pub total_pressure: f64,
    /// Mach number of the normal velocity component behind the shock.
    pub normal_mach_behind: f64,
}

/// The jump for a stream that meets the shock at right angles with `normal_mach` (NACA 1135 eq.
/// 93-99). At exactly 1 all ratios are 1. Below 1 there is no shock, which is an error.
pub fn normal_shock(gamma: f64, normal_mach: f64) -> Result<Jump, GasError> {
    check_gamma(gamma)?;
    if !(normal_mach.is_finite() && normal_mach >= 1.0) {
        return Err(GasError::Mach { mach: normal_mach, least: 1.0 });
    }
    Ok(jump(gamma, normal_mach))
}

/// [`normal_shock`] for arguments known to be valid.
pub(crate) fn jump(gamma: f64, normal_mach: f64) -> Jump {
    let (g, m2) = (gamma, normal_mach * normal_mach);
    let density = (g + 1.0) * m2 / ((g - 1.0) * m2 + 2.0);
    let pressure = (2.0 * g * m2 - (g - 1.0)) / (g + 1.0);
    let behind2 = ((g - 1.0) * m2 + 2.0) / (2.0 * g * m2 - (g - 1.0));
    Jump {
        density,
        pressure,
        temperature: pressure / density,
        total_pressure: density.powf(g / (g - 1.0)) * pressure.powf(-1.0 / (g - 1.0)),
        normal_mach_behind: behind2.sqrt(),
    }
}

/// Stagnation pressure behind a normal shock, over the static pressure in front of it: Rayleigh's
/// pitot formula (NACA 1135 eq. 100).
pub fn pitot_pressure(gamma: f64, mach: f64) -> Result<f64, GasError> {
    let j = normal_shock(gamma, mach)?;
    Ok(j.pressure / isentropic::pressure(gamma, j.normal_mach_behind))
}

/// Stagnation density behind a normal shock, over the density in front of it.
pub fn stagnation_density(gamma: f64, mach: f64) -> Result<f64, GasError> {
    let j = normal_shock(gamma, mach)?;
    Ok(j.density / isentropic::density(gamma, j.normal_mach_behind))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_of_naca_1135() {
        // NACA 1135, table II: M, p2/p1, rho2/rho1, M2, total pressure ratio, p1/pt2.
        for (m, p, rho, behind, loss, pitot) in [
            (2.0, 4.500, 2.667, 0.5774, 0.7209, 0.1773),
            (3.0, 10.33, 3.857, 0.4752, 0.3283, 0.08291),
            (5.0, 29.00, 5.000, 0.4152, 0.06172, 0.03062),
        ] {
            let j = normal_shock(1.4, m).unwrap();
            assert!((j.pressure / p - 1.0).abs() < 5e-4);
            assert!((j.density / rho - 1.0).abs() < 2e-4);
            assert!((j.normal_mach_behind - behind).abs() < 5e-5);
            assert!((j.total_pressure / loss - 1.0).abs() < 2e-4);
            assert!((pitot_pressure(1.4, m).unwrap() * pitot - 1.0).abs() < 2e-4);
        }
        // The bluntfin data set, Mach 2.95: 3.811 across the shock, 4.261 at rest.
        assert!((normal_shock(1.4, 2.95).unwrap().density - 3.811).abs() < 5e-4);
        assert!((stagnation_density(1.4, 2.95).unwrap() - 4.261).abs() < 5e-4);
    }

    #[test]
    fn mass_momentum_and_energy_are_conserved() {
        let (gamma, mach) = (1.3, 2.7);
        let j = normal_shock(gamma, mach).unwrap();
        // Units: density 1, speed of sound 1 in front, so p = 1/gamma.
        let (u1, p1) = (mach, 1.0 / gamma);
        let u2 = j.normal_mach_behind * j.temperature.sqrt();
        assert!((u1 - j.density * u2).abs() < 1e-13, "mass");
        let momentum = p1 + u1 * u1 - (p1 * j.pressure + j.density * u2 * u2);
        assert!(momentum.abs() < 1e-13 * u1 * u1, "momentum {momentum}");
        let enthalpy = |t: f64, u: f64| t / (gamma - 1.0) + 0.5 * u * u;
        assert!(
            (enthalpy(1.0, u1) - enthalpy(j.temperature, u2)).abs() < 1e-13 * u1 * u1,
            "energy"
        );
    }

    #[test]
    fn mach_one_is_no_jump_and_subsonic_or_nan_no_shock() {
        let j = normal_shock(1.4, 1.0).unwrap();
        assert_eq!((j.density, j.pressure, j.normal_mach_behind), (1.0, 1.0, 1.0));
        for bad in [0.999, -3.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(normal_shock(1.4, bad), Err(GasError::Mach { .. })), "{bad}");
        }
        assert!(matches!(normal_shock(1.0, 2.0), Err(GasError::Gamma { .. })));
    }
}
