//! Computes the refractive index of gases as n − 1, because n itself would lose most digits for
//! air.
//!
//! | module | index of | valid for |
//! |---|---|---|
//! | [`ciddor`] | moist air from temperature, pressure, humidity and CO2 | −40…100 °C, 300…1690 nm |
//! | [`gladstone_dale`] | any gas from its density, with dispersion | gases far from their absorption lines |
//! | [`mixture`] | gases by mass fraction, and their density from temperature and pressure | ideal gases, including flames |
//! | [`plasma`] | free electrons | below the critical density |
//! | [`multifield`] | any fields through transfer functions (dissertation, section 5.7) | illustration, not physics |
//! | [`conditions`], [`csv`] | one set or a table of conditions, as `schlieren index` computes | |
//!
//! Units: formulas take vacuum wavelengths in micrometres (`wavelength_um`; user input is in nm).
//! Temperatures are in °C in Ciddor's equation and in K elsewhere, pressures in Pa, densities in
//! kg/m³, humidity and fractions from 0 to 1, CO2 in µmol/mol (ppm).

pub mod ciddor;
pub mod conditions;
pub mod csv;
pub mod gladstone_dale;
pub mod mixture;
pub mod multifield;
pub mod plasma;

pub use gladstone_dale::Gas;
pub use mixture::Mixture;

use std::fmt;

/// Why an index cannot be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IndexError {
    /// A value that no gas can have, or at which the formula is undefined.
    #[error("{quantity} {value} {unit} {reason}; {cure}")]
    Impossible {
        /// The quantity, by the name of its option or column.
        quantity: &'static str,
        /// The value.
        value: f64,
        /// Its unit; empty for fractions.
        unit: &'static str,
        /// What is wrong with the value.
        reason: &'static str,
        /// How to correct it.
        cure: &'static str,
    },
    /// No gas has this name.
    #[error(
        "no gas `{name}`; known gases: {known}; or give its Gladstone-Dale constant in cm^3/g as a \
         number, such as NAME=0.42"
    )]
    UnknownGas {
        /// The requested name.
        name: String,
        /// All known names.
        known: String,
    },
    /// The fractions do not define a mixture.
    #[error("the mass fractions of {species} sum to {sum}; {cure}")]
    Fractions {
        /// The names of the species.
        species: String,
        /// Their sum.
        sum: f64,
        /// How to correct it.
        cure: &'static str,
    },
    /// The density of a gas of unknown molar mass is needed.
    #[error(
        "gas `{name}` has no molar mass, so its density does not follow from temperature and \
         pressure; give a density field, or the molar mass as NAME=K@M with M in g/mol, such as \
         `{name}=0.42@77.9`"
    )]
    NoMolarMass {
        /// The gas.
        name: String,
    },
}

/// A value outside the measured range of a formula. The result is still computed; callers should
/// warn the user.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct OutOfRange {
    /// The formula, by its author or gas.
    pub formula: &'static str,
    /// The quantity that is out of range.
    pub quantity: &'static str,
    /// The value that lies farthest outside.
    pub value: f64,
    /// The measured range.
    pub range: [f64; 2],
    /// Unit of value and range.
    pub unit: &'static str,
    /// What to do instead.
    pub cure: &'static str,
}

impl fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let OutOfRange { formula, quantity, value, range: [low, high], unit, cure } = self;
        write!(f, "{formula}: {quantity} {value} {unit} is outside {low}..{high} {unit}; {cure}")
    }
}
