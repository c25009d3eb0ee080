//! Plane oblique shocks: deflection θ, shock angle β, Mach number M.

use super::normal_shock::{Jump, jump};
use super::{GasError, bisect, check_supersonic};
use std::f64::consts::FRAC_PI_2;

/// Selects one of the two shocks that turn the stream by the same angle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Branch {
    /// The shallower shock, which wedges have.
    Weak,
    /// The steeper shock, with subsonic flow behind it.
    Strong,
}

/// An oblique shock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObliqueShock {
    /// Angle between stream and shock.
    pub shock_rad: f64,
    /// Angle by which the stream turns.
    pub deflection_rad: f64,
    /// Ratios across it.
    pub jump: Jump,
    /// Mach number of the stream behind it.
    pub mach_behind: f64,
}

/// The angle by which a shock at `shock_rad` turns the stream (NACA 1135 eq. 138): tan θ = 2 cot β
/// (M² sin²β - 1) / (M² (γ + cos 2β) + 2). Zero at the Mach angle and at 90 degrees, negative
/// (meaningless) below the Mach angle.
pub fn deflection_rad(gamma: f64, mach: f64, shock_rad: f64) -> f64 {
    let m2 = mach * mach;
    let s = shock_rad.sin();
    let numerator = 2.0 * (m2 * s * s - 1.0) * shock_rad.cos();
    (numerator / (s * (m2 * (gamma + (2.0 * shock_rad).cos()) + 2.0))).atan()
}

/// The Mach angle, which is the angle of an infinitely weak shock.
pub fn mach_angle_rad(mach: f64) -> f64 {
    (1.0 / mach).asin()
}

/// The largest deflection with an attached shock, and that shock's angle (NACA 1135 eq. 168).
pub fn detachment(gamma: f64, mach: f64) -> Result<(f64, f64), GasError> {
    check_supersonic(gamma, mach)?;
    let (g, m2) = (gamma, mach * mach);
    let root = ((g + 1.0) * (1.0 + 0.5 * (g - 1.0) * m2 + (g + 1.0) / 16.0 * m2 * m2)).sqrt();
    let shock = ((0.25 * (g + 1.0) * m2 - 1.0 + root) / (g * m2)).min(1.0).sqrt().asin();
    Ok((deflection_rad(gamma, mach, shock), shock))
}

/// Angle of the shock that turns the stream by `deflection_rad`. For zero deflection, it is the
/// Mach angle (weak) or 90 degrees (strong).
///
/// Found by bisection between Mach angle and detachment, or between detachment and 90 degrees; θ(β)
/// is monotonic on each interval. The cubic in tan β has a closed form, but it loses all digits for
/// small deflections (0/0). A test compares both.
pub fn shock_angle_rad(
    gamma: f64,
    mach: f64,
    deflection: f64,
    branch: Branch,
) -> Result<f64, GasError> {
    let (most, at_most) = detachment(gamma, mach)?;
    if !(0.0..FRAC_PI_2).contains(&deflection) {
        return Err(GasError::Angle {
            what: "the deflection",
            given_degrees: deflection.to_degrees(),
            least_degrees: 0.0,
            most_degrees: 90.0,
        });
    }
    if deflection > most {
        return Err(GasError::Detached {
            body: "a wedge",
            mach,
            given_degrees: deflection.to_degrees(),
            most_degrees: most.to_degrees(),
        });
    }
    let none = match branch {
        Branch::Weak => mach_angle_rad(mach),
        Branch::Strong => FRAC_PI_2,
    };
    if deflection == 0.0 {
        return Ok(none);
    }
    Ok(bisect(none, at_most, |shock| deflection_rad(gamma, mach, shock) - deflection))
}

/// The oblique shock of a wedge of half angle `deflection`.
pub fn oblique_shock(
    gamma: f64,
    mach: f64,
    deflection: f64,
    branch: Branch,
) -> Result<ObliqueShock, GasError> {
    let shock_rad = shock_angle_rad(gamma, mach, deflection, branch)?;
    let jump = jump(gamma, (mach * shock_rad.sin()).max(1.0));
    let mach_behind = jump.normal_mach_behind / (shock_rad - deflection).sin();
    Ok(ObliqueShock { shock_rad, deflection_rad: deflection, jump, mach_behind })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// Explicit solution of the cubic (Emanuel, "Gasdynamics: Theory and Applications", 1986;
    /// Anderson, "Modern Compressible Flow", eq. 4.19): exact but ill-conditioned for small angles.
    fn closed_form(gamma: f64, mach: f64, deflection: f64, branch: Branch) -> f64 {
        let (m2, t) = (mach * mach, deflection.tan());
        let a = 1.0 + 0.5 * (gamma - 1.0) * m2;
        let b = 1.0 + 0.5 * (gamma + 1.0) * m2;
        let lambda = ((m2 - 1.0).powi(2) - 3.0 * a * b * t * t).sqrt();
        let chi = ((m2 - 1.0).powi(3) - 9.0 * a * (a + 0.25 * (gamma + 1.0) * m2 * m2) * t * t)
            / lambda.powi(3);
        let delta = if branch == Branch::Weak { 1.0 } else { 0.0 };
        let phase = (4.0 * PI * delta + chi.clamp(-1.0, 1.0).acos()) / 3.0;
        ((m2 - 1.0 + 2.0 * lambda * phase.cos()) / (3.0 * a * t)).atan()
    }

    #[test]
    fn both_branches_agree_with_the_cubic() {
        for gamma in [1.2, 1.4, 5.0 / 3.0] {
            for mach in [1.1, 2.0, 5.0, 25.0] {
                let most = detachment(gamma, mach).unwrap().0;
                for part in [0.1, 0.5, 0.9, 0.999] {
                    for branch in [Branch::Weak, Branch::Strong] {
                        let found = shock_angle_rad(gamma, mach, part * most, branch).unwrap();
                        let exact = closed_form(gamma, mach, part * most, branch);
                        assert!(
                            (found - exact).abs() < 1e-9,
                            "{gamma} {mach} {part} {branch:?}: {found} {exact}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn detachment_is_the_largest_deflection() {
        // NACA 1135, chart 2: M = 2 detaches at 22.97 degrees, with a shock of 64.67 degrees.
        let (most, shock) = detachment(1.4, 2.0).unwrap();
        assert!(
            (most.to_degrees() - 22.97).abs() < 0.01 && (shock.to_degrees() - 64.67).abs() < 0.01
        );
        for d in [-1e-4, 1e-4] {
            assert!(deflection_rad(1.4, 2.0, shock + d) < most);
        }
        assert!(shock_angle_rad(1.4, 2.0, most, Branch::Weak).is_ok());
        let error =
            shock_angle_rad(1.4, 2.0, 23f64.to_radians(), Branch::Weak).unwrap_err().to_string();
        assert!(error.contains("22.97") && error.contains("smaller angle"), "{error}");
    }

    #[test]
    fn vanishing_deflection_is_a_mach_wave_without_loss_of_digits() {
        let mach_angle = mach_angle_rad(3.0);
        assert_eq!(shock_angle_rad(1.4, 3.0, 0.0, Branch::Weak).unwrap(), mach_angle);
        // dβ/dθ at θ = 0 is (γ+1)/4 · M²/(M²-1) (linear theory).
        let tiny = 1e-7;
        let slope = (shock_angle_rad(1.4, 3.0, tiny, Branch::Weak).unwrap() - mach_angle) / tiny;
        assert!((slope - 0.6 * 9.0 / 8.0).abs() < 1e-4, "{slope}");
    }

    #[test]
    fn strong_shocks_leave_subsonic_and_weak_ones_mostly_supersonic_flow() {
        let [weak, strong] = [Branch::Weak, Branch::Strong]
            .map(|b| oblique_shock(1.4, 2.0, 10f64.to_radians(), b).unwrap());
        assert!((weak.mach_behind - 1.6405).abs() < 1e-4, "{}", weak.mach_behind);
        assert!(strong.mach_behind < 1.0 && strong.jump.density > weak.jump.density);
    }
}
