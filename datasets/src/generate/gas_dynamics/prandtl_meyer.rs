//! Isentropic expansion around a corner (Prandtl and Meyer).

use super::{GasError, bisect, check_supersonic};
use std::f64::consts::FRAC_PI_2;

/// The angle ν through which a sonic stream turns to reach `mach` (NACA 1135 eq. 171c).
pub fn angle_rad(gamma: f64, mach: f64) -> Result<f64, GasError> {
    if mach == 1.0 {
        return Ok(0.0);
    }
    check_supersonic(gamma, mach)?;
    Ok(unchecked_angle_rad(gamma, mach))
}

fn unchecked_angle_rad(gamma: f64, mach: f64) -> f64 {
    let k = ((gamma + 1.0) / (gamma - 1.0)).sqrt();
    let b = (mach * mach - 1.0).max(0.0).sqrt();
    k * (b / k).atan() - b.atan()
}

/// The turning angle at which the gas expands to vacuum.
pub fn largest_angle_rad(gamma: f64) -> f64 {
    (((gamma + 1.0) / (gamma - 1.0)).sqrt() - 1.0) * FRAC_PI_2
}

/// The Mach number after a sonic stream has turned by `angle`.
pub fn mach(gamma: f64, angle: f64) -> Result<f64, GasError> {
    super::check_gamma(gamma)?;
    let most = largest_angle_rad(gamma);
    if !(0.0..most).contains(&angle) {
        return Err(GasError::Angle {
            what: "the turn of the stream",
            given_degrees: angle.to_degrees(),
            least_degrees: 0.0,
            most_degrees: most.to_degrees(),
        });
    }
    let mut high = 2.0;
    while unchecked_angle_rad(gamma, high) <= angle {
        high *= 2.0;
        if high > 1e15 {
            return Ok(high); // within rounding of the vacuum
        }
    }
    Ok(bisect(1.0, high, |m| unchecked_angle_rad(gamma, m) - angle))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_of_naca_1135() {
        for (m, degrees) in [(1.0, 0.0), (2.0, 26.3798), (3.0, 49.7573), (5.0, 76.9202)] {
            assert!((angle_rad(1.4, m).unwrap().to_degrees() - degrees).abs() < 1e-4);
        }
        assert!((largest_angle_rad(1.4).to_degrees() - 130.4541).abs() < 1e-4);
    }

    #[test]
    fn inverse_to_thirteen_digits_from_sonic_to_nearly_vacuum() {
        for m in [1.0, 1.0001, 1.5, 4.0, 60.0, 1e4] {
            let back = mach(1.4, angle_rad(1.4, m).unwrap()).unwrap();
            // ν is flat at both ends: its rounding error, 1e-16, limits the inverse.
            let tolerance = 1e-13 + 1e-15 * m * m + if m < 1.01 { 1e-9 } else { 0.0 };
            assert!((back / m - 1.0).abs() < tolerance, "{m}: {back}");
        }
        assert!(matches!(mach(1.4, 2.4), Err(GasError::Angle { .. })), "beyond the vacuum");
        assert!(angle_rad(1.4, 0.5).is_err());
    }
}
