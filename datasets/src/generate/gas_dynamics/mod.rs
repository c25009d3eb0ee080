//! Steady compressible flow of a perfect gas, in closed form or by one ordinary differential
//! equation. The shocks of these flows are known exactly, so images of them can be checked by
//! measurement.
//!
//! | module | what | source |
//! |---|---|---|
//! | [`isentropic`] | density, pressure and temperature from the Mach number | NACA 1135 (1953) eq. 43-45 |
//! | [`normal_shock`](mod@normal_shock) | Rankine-Hugoniot ratios, Rayleigh's pitot formula | NACA 1135 eq. 93-99 |
//! | [`theta_beta_m`] | plane oblique shocks, weak and strong, and when they detach | NACA 1135 eq. 139a, 168 |
//! | [`prandtl_meyer`] | expansion around a corner | NACA 1135 eq. 171c |
//! | [`taylor_maccoll`] | the flow about a circular cone at zero incidence | Taylor and Maccoll 1933 |
//! | [`bow_shock`] | stand-off and shape of a detached shock | Billig 1967, J. Spacecraft and Rockets 4(6) |
//!
//! Angles are in radians, from the direction of the free stream. `gamma` is the ratio of specific
//! heats; it must be between 1 (exclusive) and 2.
//!
//! ```
//! use datasets::generate::gas_dynamics::theta_beta_m::{Branch, shock_angle_rad};
//! let shock = shock_angle_rad(1.4, 2.0, 10f64.to_radians(), Branch::Weak)?;
//! assert!((shock.to_degrees() - 39.31393184).abs() < 1e-8);
//! # Ok::<(), datasets::generate::gas_dynamics::GasError>(())
//! ```

pub mod bow_shock;
pub mod isentropic;
pub mod normal_shock;
pub mod prandtl_meyer;
pub mod taylor_maccoll;
pub mod theta_beta_m;

/// Why a flow does not exist.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GasError {
    /// Shocks and expansions need a supersonic stream.
    #[error("the Mach number is {mach}; it must be finite and greater than {least}")]
    Mach {
        /// The given Mach number.
        mach: f64,
        /// The value that it must exceed.
        least: f64,
    },
    /// The ratio of specific heats is not that of a gas.
    #[error(
        "the ratio of specific heats is {gamma}; it must be greater than 1 and at most 2 (air: 1.4)"
    )]
    Gamma {
        /// The given ratio.
        gamma: f64,
    },
    /// An angle outside its range.
    #[error(
        "{what} is {given_degrees} degrees; it must be from {least_degrees} to {most_degrees} \
         degrees"
    )]
    Angle {
        /// Name of the angle.
        what: &'static str,
        /// The given angle.
        given_degrees: f64,
        /// Smallest allowed angle.
        least_degrees: f64,
        /// Largest allowed angle.
        most_degrees: f64,
    },
    /// The body is too blunt for an attached shock.
    #[error(
        "at Mach {mach} the shock detaches from {body} of more than {most_degrees:.4} degrees \
         (half angle), and this has \
         {given_degrees} degrees; give a smaller angle or a higher Mach number, or use a blunt body"
    )]
    Detached {
        /// "a wedge" or "a cone".
        body: &'static str,
        /// Mach number of the free stream.
        mach: f64,
        /// The requested half angle.
        given_degrees: f64,
        /// Largest half angle with an attached shock.
        most_degrees: f64,
    },
}

/// Air as a perfect gas.
pub const GAMMA_AIR: f64 = 1.4;
/// Specific gas constant of dry air, J/(kg K): 8314.46 / 28.9652.
pub const GAS_CONSTANT_AIR: f64 = 287.05;

/// Undisturbed stream of air.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FreeStream {
    /// Mach number.
    pub mach: f64,
    /// Pressure, Pa.
    pub pressure_pa: f64,
    /// Temperature, K.
    pub temperature_k: f64,
}

impl FreeStream {
    /// The stream of a wind tunnel whose reservoir has this pressure and temperature.
    pub fn from_reservoir(mach: f64, pressure_pa: f64, temperature_k: f64) -> Self {
        FreeStream {
            mach,
            pressure_pa: pressure_pa * isentropic::pressure(GAMMA_AIR, mach),
            temperature_k: temperature_k * isentropic::temperature(GAMMA_AIR, mach),
        }
    }

    /// Density, kg/m³, by the perfect gas law.
    pub fn density(&self) -> f64 {
        self.pressure_pa / (GAS_CONSTANT_AIR * self.temperature_k)
    }
}

fn check_gamma(gamma: f64) -> Result<(), GasError> {
    if gamma > 1.0 && gamma <= 2.0 { Ok(()) } else { Err(GasError::Gamma { gamma }) }
}

/// Checks that the gas is valid and the stream supersonic.
fn check_supersonic(gamma: f64, mach: f64) -> Result<(), GasError> {
    check_gamma(gamma)?;
    if mach.is_finite() && mach > 1.0 { Ok(()) } else { Err(GasError::Mach { mach, least: 1.0 }) }
}

/// Finds the zero of a continuous `f` that changes sign between `low` and `high` (in either order;
/// it may be zero at `high`), to the last bit that bisection resolves.
fn bisect(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    let positive_at_low = f(low) > 0.0;
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low.min(high) || middle >= low.max(high) {
            return middle;
        }
        if (f(middle) > 0.0) == positive_at_low { low = middle } else { high = middle }
    }
}
