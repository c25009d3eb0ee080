//! Ratios to the reservoir values in isentropic flow.

/// T / T0 (NACA 1135 eq. 43).
pub fn temperature(gamma: f64, mach: f64) -> f64 {
    1.0 / (1.0 + 0.5 * (gamma - 1.0) * mach * mach)
}

/// p / p0 (NACA 1135 eq. 44).
pub fn pressure(gamma: f64, mach: f64) -> f64 {
    temperature(gamma, mach).powf(gamma / (gamma - 1.0))
}

/// ρ / ρ0 (NACA 1135 eq. 45).
pub fn density(gamma: f64, mach: f64) -> f64 {
    temperature(gamma, mach).powf(1.0 / (gamma - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_of_naca_1135() {
        // NACA 1135, table I, M = 1 and M = 2.
        for (mach, p, rho, t) in [(1.0, 0.5283, 0.6339, 0.8333), (2.0, 0.1278, 0.2300, 0.5556)] {
            assert!((pressure(1.4, mach) - p).abs() < 5e-5);
            assert!((density(1.4, mach) - rho).abs() < 5e-5);
            assert!((temperature(1.4, mach) - t).abs() < 5e-5);
        }
    }
}
