//! Gives the arrays of a file their meaning and units.

use super::InputError;
use super::lattice::SamplePoints;
use crate::index::multifield::{Multifield, Rule, TransferFunction};
use crate::index::{Gas, IndexError};
use datasets::model::{ColorBy, Dataset};
use std::convert::Infallible;
use std::str::FromStr;

/// An array of the file, or one number everywhere. A scale and an offset convert it to the required
/// unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Quantity {
    /// Where the values come from.
    pub source: Source,
    /// SI units per unit of the file.
    pub scale: f64,
    /// Added after scaling: 273.15 for temperatures in °C, 101325 for gauge pressures.
    pub offset: f64,
}

/// Where a quantity comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// An array, named as in [`ColorBy`] (`velocity:x` takes a component).
    Array(String),
    /// One value everywhere.
    Constant(f64),
}

impl Quantity {
    /// One value everywhere, in SI.
    pub fn constant(value: f64) -> Self {
        Quantity { source: Source::Constant(value), scale: 1.0, offset: 0.0 }
    }
    /// An array in SI.
    pub fn array(name: impl Into<String>) -> Self {
        Quantity { source: Source::Array(name.into()), scale: 1.0, offset: 0.0 }
    }
    /// Multiplies the scale by `scale`.
    pub fn scaled(mut self, scale: f64) -> Self {
        self.scale *= scale;
        self
    }
    /// Adds `offset`, which applies after scaling.
    pub fn shifted(mut self, offset: f64) -> Self {
        self.offset += offset;
        self
    }
}

impl FromStr for Quantity {
    type Err = Infallible;
    /// Parses a number as a constant, and anything else as the name of an array.
    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(match text.trim().parse::<f64>() {
            Ok(x) => Quantity::constant(x),
            Err(_) => Quantity::array(text),
        })
    }
}

/// The quantities that determine the index.
#[derive(Debug, Clone, PartialEq)]
pub enum Medium {
    /// Gas given by its density: Gladstone-Dale.
    Density {
        /// Density, kg/m³.
        density: Quantity,
        /// Mass fractions and what they are of; the rest is air.
        species: Vec<(Quantity, Gas)>,
    },
    /// Gas given by its state: Ciddor for air, otherwise Gladstone-Dale with the density of an
    /// ideal gas.
    TemperaturePressure {
        /// K.
        temperature: Quantity,
        /// Pa.
        pressure: Quantity,
        /// Relative humidity, 0 to 1.
        humidity: Quantity,
        /// CO2, ppm.
        co2_ppm: Quantity,
        /// Mass fractions and what they are of; the rest is air.
        species: Vec<(Quantity, Gas)>,
    },
    /// n − 1 itself.
    NMinus1(Quantity),
    /// Free electrons, 1/m³.
    Electrons(Quantity),
    /// Any fields through transfer functions (dissertation, section 5.7).
    Multifield {
        /// Field, curve, weight.
        parts: Vec<(Quantity, TransferFunction, f64)>,
        /// How they combine.
        rule: Rule,
    },
}

/// Values of a quantity at all points.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Column {
    /// One value for all points.
    Constant(f64),
    /// One value per point.
    Values(Vec<f64>),
}

impl Column {
    pub(super) fn at(&self, i: usize) -> f64 {
        match self {
            Column::Constant(x) => *x,
            Column::Values(v) => v[i],
        }
    }
}

impl Medium {
    /// Air with its density in kg/m³ from this array.
    pub fn density(array: impl Into<String>) -> Self {
        Medium::Density { density: Quantity::array(array), species: Vec::new() }
    }
    /// Dry air with 450 ppm CO2, given by temperature (K) and pressure (Pa).
    pub fn temperature_pressure(temperature: Quantity, pressure: Quantity) -> Self {
        Medium::TemperaturePressure {
            temperature,
            pressure,
            humidity: Quantity::constant(0.0),
            co2_ppm: Quantity::constant(450.0),
            species: Vec::new(),
        }
    }

    /// The quantities in the order that [`super::evaluate`] expects.
    fn quantities(&self) -> Vec<&Quantity> {
        match self {
            Medium::Density { density, species } => {
                [density].into_iter().chain(species.iter().map(|s| &s.0)).collect()
            }
            Medium::TemperaturePressure { temperature, pressure, humidity, co2_ppm, species } => {
                let fixed = [temperature, pressure, humidity, co2_ppm];
                fixed.into_iter().chain(species.iter().map(|s| &s.0)).collect()
            }
            Medium::NMinus1(q) | Medium::Electrons(q) => vec![q],
            Medium::Multifield { parts, .. } => parts.iter().map(|p| &p.0).collect(),
        }
    }

    /// Names of the required arrays.
    pub fn arrays(&self) -> Vec<&str> {
        let names = self.quantities().into_iter().filter_map(|q| match &q.source {
            Source::Array(name) => Some(name.as_str()),
            Source::Constant(_) => None,
        });
        names.collect()
    }

    /// Names of the arrays, for messages.
    pub(super) fn describe(&self) -> String {
        let names = self.arrays().iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ");
        if names.is_empty() { "constants".into() } else { names }
    }

    pub(super) fn multifield(&self) -> Option<Multifield> {
        match self {
            Medium::Multifield { parts, rule } => Some(Multifield {
                parts: parts.iter().map(|(_, curve, weight)| (curve.clone(), *weight)).collect(),
                rule: *rule,
            }),
            _ => None,
        }
    }

    /// Species with the names of their fields.
    pub(super) fn species(&self) -> Vec<(String, Gas)> {
        match self {
            Medium::Density { species, .. } | Medium::TemperaturePressure { species, .. } => {
                species
                    .iter()
                    .map(|(q, gas)| {
                        let name = match &q.source {
                            Source::Array(name) => name.clone(),
                            Source::Constant(_) => gas.to_string(),
                        };
                        (name, gas.clone())
                    })
                    .collect()
            }
            _ => Vec::new(),
        }
    }

    /// The values of all quantities at the points.
    pub(super) fn columns(
        &self,
        data: &Dataset,
        points: &SamplePoints,
    ) -> Result<Vec<Column>, InputError> {
        let quantities = self.quantities();
        if quantities.iter().all(|q| matches!(q.source, Source::Constant(_))) {
            return Err(InputError::Option {
                what: "no array of the file is used, so the index would be the same everywhere"
                    .into(),
                cure: "name the array of density, or those of temperature and pressure",
            });
        }
        quantities
            .into_iter()
            .map(|q| {
                if !(q.scale != 0.0 && q.scale.is_finite() && q.offset.is_finite()) {
                    return Err(InputError::Index(IndexError::Impossible {
                        quantity: "unit scale",
                        value: q.scale,
                        unit: "",
                        reason: "is zero or not finite",
                        cure: "give SI units per unit of the file",
                    }));
                }
                Ok(match &q.source {
                    Source::Constant(x) => Column::Constant(x * q.scale + q.offset),
                    Source::Array(name) => {
                        let color = ColorBy::find(data, name)?;
                        if !matches!(self, Medium::Multifield { .. }) {
                            refuse_vector(data, name, &color)?;
                        }
                        let mut values = points.values(data, &color);
                        if (q.scale, q.offset) != (1.0, 0.0) {
                            values.iter_mut().for_each(|v| *v = *v * q.scale + q.offset);
                        }
                        Column::Values(values)
                    }
                })
            })
            .collect()
    }
}

/// Refuses an array of several components where one number is meant. Its magnitude is hardly ever
/// a density or a temperature.
fn refuse_vector(data: &Dataset, name: &str, color: &ColorBy) -> Result<(), InputError> {
    let array = data.leaves().into_iter().filter_map(|d| d.attributes()).find_map(|a| {
        if color.per_point { a.point_array(&color.name) } else { a.cell_array(&color.name) }
    });
    match array.map_or(1, |a| a.components) {
        // `U:magnitude` asks for it.
        1 => Ok(()),
        _ if color.component.is_some() || color.name != name => Ok(()),
        n => Err(InputError::Vector { name: name.into(), components: n }),
    }
}
