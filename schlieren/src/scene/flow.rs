//! The gas in scenes: a file and the meaning of its arrays.

use super::SceneError;
use crate::index::Gas;
use crate::index::conditions::Model;
use crate::index::multifield::{Rule, TransferFunction};
use crate::input::{Depth, Medium, Options, Outside, Quantity, Reference, Role};
use datasets::read::OpenOptions;
use datasets::resample::{Reconstruction, Resolution};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The file and the meaning of its arrays: a density, or temperature and pressure, or an index, or
/// electrons. In place of an array's name, a number gives a uniform value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlowSpec {
    /// Path of the file (VTI, VTR, VTS, VTU, PLOT3D, NRRD, NumPy, raw…) or OpenFOAM case.
    pub file: PathBuf,
    /// Density.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub density: Option<String>,
    /// kg/m³ per unit of the density. Where densities are relative to a solver's free stream, this
    /// is the free stream's density.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub density_unit_kg_m3: Option<f64>,
    /// Temperature in K (see `temperature_zero_k`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature: Option<String>,
    /// Added to the temperature: 273.15 when it is in °C.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature_zero_k: Option<f64>,
    /// Pressure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pressure: Option<String>,
    /// Pa per unit of the pressure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pressure_unit_pa: Option<f64>,
    /// Added to the pressure in Pa: 101325 when it is relative to the atmosphere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pressure_zero_pa: Option<f64>,
    /// Relative humidity, 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub humidity: Option<String>,
    /// CO2 in ppm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub co2_ppm: Option<String>,
    /// The refractivity n - 1 itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub n_minus_1: Option<String>,
    /// Free electrons per m³.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub electrons: Option<String>,
    /// Any arrays, each mapped to n - 1 by a curve (dissertation, section 5.7): an illustration,
    /// not physics.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub multifield: Option<MultifieldSpec>,
    /// Arrays of mass fractions with the gas of each; the rest is air.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub species: BTreeMap<String, String>,
    /// Formula for air by temperature and pressure.
    #[serde(default)]
    pub model: Model,
    /// Metres per unit of the file's coordinates.
    #[serde(default = "one")]
    pub length_unit_m: f64,
    /// Distance between points along x, y and z, in units of the file, where it does not say it
    /// (NumPy, raw, NRRD, MetaImage, NetCDF without coordinates).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spacing: Option<[f64; 3]>,
    /// Position of the first point of such a file, in its units.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<[f64; 3]>,
    /// For a table of points in no order: how many times as wide as the cells around it a place
    /// without points is a hole.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gap: Option<f64>,
    /// Depth to which two-dimensional data are extruded, in units of the file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub span: Option<f64>,
    /// Whether two-dimensional data are half of an axisymmetric flow, to be revolved about its
    /// axis.
    #[serde(default)]
    pub revolve: bool,
    /// Number of nodes along the longest axis when the data have to be resampled; chosen from the
    /// cells when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resample_nodes: Option<usize>,
    /// A node gets the mean over this many samples per axis of the box around it when the data have
    /// to be resampled; 1 takes the value at the node.
    #[serde(default = "one_sample")]
    pub resample_samples: usize,
    /// Whether light is traced through the cells of the mesh themselves, without a lattice.
    #[serde(default)]
    pub on_cells: bool,
    /// How values between the points of a mesh are computed when the data have to be resampled, or
    /// light is traced through cells.
    #[serde(default)]
    pub reconstruction: Reconstruction,
    /// Standard deviation of the smoothing of shocks, in nodes; 0 for none.
    #[serde(default)]
    pub smoothing_nodes: f64,
    /// Whether jumps from one node to the next become averages over cells.
    #[serde(default)]
    pub average_jumps: bool,
    /// What the region outside the mesh is: behind walls bodies and behind an open border gas
    /// (`auto`), or one of both, or blank, everywhere.
    #[serde(default)]
    pub outside: Outside,
    /// What cells hidden by the solver are.
    #[serde(default = "solid")]
    pub hidden: Role,
    /// n0 - 1 of the medium around the field; taken from the field's border when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference_n_minus_1: Option<f64>,
}

/// Arrays with the curves that map them to n - 1.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MultifieldSpec {
    /// How the contributions of the arrays combine.
    #[serde(default)]
    pub rule: Rule,
    /// Curves by the names of arrays.
    pub fields: BTreeMap<String, CurveSpec>,
}

/// One array's curve.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurveSpec {
    /// Pairs of a value and its n - 1, with increasing values. Linear between them, constant
    /// beyond.
    pub knots: Vec<[f64; 2]>,
    /// Factor on the contribution; 0 leaves the array out.
    #[serde(default = "one")]
    pub weight: f64,
}

fn one() -> f64 {
    1.0
}

fn one_sample() -> usize {
    1
}

fn solid() -> Role {
    Role::Solid
}

impl Default for FlowSpec {
    fn default() -> Self {
        FlowSpec {
            file: PathBuf::new(),
            density: None,
            density_unit_kg_m3: None,
            temperature: None,
            temperature_zero_k: None,
            pressure: None,
            pressure_unit_pa: None,
            pressure_zero_pa: None,
            humidity: None,
            co2_ppm: None,
            n_minus_1: None,
            electrons: None,
            multifield: None,
            species: BTreeMap::new(),
            model: Model::Auto,
            length_unit_m: one(),
            spacing: None,
            gap: None,
            origin: None,
            span: None,
            revolve: false,
            resample_nodes: None,
            resample_samples: one_sample(),
            on_cells: false,
            reconstruction: Reconstruction::default(),
            smoothing_nodes: 0.0,
            average_jumps: false,
            outside: Outside::Auto,
            hidden: solid(),
            reference_n_minus_1: None,
        }
    }
}

/// Parses an array's name or a number.
fn quantity(text: &str) -> Quantity {
    let Ok(q) = text.parse::<Quantity>();
    q
}

impl FlowSpec {
    /// The same file and lattice, without the meaning of its arrays.
    #[must_use]
    pub fn without_medium(&self) -> FlowSpec {
        FlowSpec {
            file: self.file.clone(),
            length_unit_m: self.length_unit_m,
            spacing: self.spacing,
            gap: self.gap,
            origin: self.origin,
            span: self.span,
            revolve: self.revolve,
            resample_nodes: self.resample_nodes,
            resample_samples: self.resample_samples,
            on_cells: self.on_cells,
            reconstruction: self.reconstruction,
            smoothing_nodes: self.smoothing_nodes,
            average_jumps: self.average_jumps,
            outside: self.outside,
            hidden: self.hidden,
            ..FlowSpec::default()
        }
    }

    /// The quantities that determine the index.
    ///
    /// # Errors
    /// If the arrays do not belong together, or one is missing.
    pub fn medium(&self) -> Result<Medium, SceneError> {
        let wrong = |reason: String| SceneError::Flow { reason };
        let species = || -> Result<Vec<(Quantity, Gas)>, SceneError> {
            let gas = |(array, gas): (&String, &String)| match gas.parse::<Gas>() {
                Ok(gas) => Ok((quantity(array), gas)),
                Err(e) => Err(wrong(format!("species `{array}`: {e}"))),
            };
            self.species.iter().map(gas).collect()
        };
        if self.revolve && self.span.is_some() {
            return Err(wrong("flow.span and flow.revolve are alternatives; keep one".into()));
        }
        let given = [
            ("density", self.density.is_some()),
            ("temperature", self.temperature.is_some()),
            ("n_minus_1", self.n_minus_1.is_some()),
            ("electrons", self.electrons.is_some()),
            ("multifield", self.multifield.is_some()),
        ];
        let named: Vec<&str> = given.iter().filter(|g| g.1).map(|g| g.0).collect();
        let [only] = named[..] else {
            return Err(wrong(match named.len() {
                0 => "no quantity sets the index; name the array of flow.density, or those of \
                      flow.temperature and flow.pressure"
                    .into(),
                _ => {
                    let keys: Vec<String> = named.iter().map(|n| format!("flow.{n}")).collect();
                    format!("{} are alternatives; keep one", keys.join(" and "))
                }
            }));
        };

        // Keys of another alternative have no effect, so they are refused.
        let by_state = only == "temperature";
        let by_gas = by_state || only == "density";
        for (key, present, belongs) in [
            ("density_unit_kg_m3", self.density_unit_kg_m3.is_some(), only == "density"),
            ("pressure", self.pressure.is_some(), by_state),
            ("pressure_unit_pa", self.pressure_unit_pa.is_some(), by_state),
            ("pressure_zero_pa", self.pressure_zero_pa.is_some(), by_state),
            ("temperature_zero_k", self.temperature_zero_k.is_some(), by_state),
            ("humidity", self.humidity.is_some(), by_state),
            ("co2_ppm", self.co2_ppm.is_some(), by_state),
            ("species", !self.species.is_empty(), by_gas),
            ("model", self.model != Model::Auto, by_state),
        ] {
            if present && !belongs {
                return Err(wrong(format!(
                    "flow.{key} has no effect with flow.{only}; omit one of them"
                )));
            }
        }

        let text = |t: &Option<String>| t.as_deref().map(quantity);
        Ok(match only {
            "density" => Medium::Density {
                density: text(&self.density)
                    .unwrap_or(Quantity::constant(f64::NAN))
                    .scaled(self.density_unit_kg_m3.unwrap_or(1.0)),
                species: species()?,
            },
            "temperature" => {
                let Some(pressure) = text(&self.pressure) else {
                    return Err(wrong(
                        "flow.temperature needs flow.pressure: an array, or one value in Pa for \
                         the whole field, such as 101325"
                            .into(),
                    ));
                };
                Medium::TemperaturePressure {
                    temperature: text(&self.temperature)
                        .unwrap_or(Quantity::constant(f64::NAN))
                        .shifted(self.temperature_zero_k.unwrap_or(0.0)),
                    pressure: pressure
                        .scaled(self.pressure_unit_pa.unwrap_or(1.0))
                        .shifted(self.pressure_zero_pa.unwrap_or(0.0)),
                    humidity: text(&self.humidity).unwrap_or(Quantity::constant(0.0)),
                    co2_ppm: text(&self.co2_ppm).unwrap_or(Quantity::constant(450.0)),
                    species: species()?,
                }
            }
            "multifield" => self.multifield_medium()?,
            "n_minus_1" => {
                Medium::NMinus1(text(&self.n_minus_1).unwrap_or(Quantity::constant(f64::NAN)))
            }
            _ => Medium::Electrons(text(&self.electrons).unwrap_or(Quantity::constant(f64::NAN))),
        })
    }

    fn multifield_medium(&self) -> Result<Medium, SceneError> {
        let spec = self.multifield.clone().unwrap_or_default();
        let mut parts = Vec::new();
        for (array, curve) in &spec.fields {
            let wrong = |reason: String| SceneError::Flow {
                reason: format!("multifield `{array}`: {reason}"),
            };
            if !curve.weight.is_finite() {
                return Err(wrong(format!("weight {} is not a finite number", curve.weight)));
            }
            // An array with zero weight is not read.
            if curve.weight != 0.0 {
                let knots = curve.knots.iter().map(|k| (k[0], k[1])).collect();
                let function = TransferFunction::new(knots).map_err(|e| wrong(e.to_string()))?;
                parts.push((Quantity::array(array), function, curve.weight));
            }
        }
        if parts.is_empty() {
            let reason =
                "multifield: no array has a weight other than 0; give at least one curve".into();
            return Err(SceneError::Flow { reason });
        }
        Ok(Medium::Multifield { parts, rule: spec.rule })
    }

    /// What the file does not say itself.
    pub fn open_options(&self) -> OpenOptions {
        OpenOptions { time: None, spacing: self.spacing, origin: self.origin, gap: self.gap }
    }

    /// Options for reading the file as a field for light of this wavelength.
    ///
    /// # Errors
    /// As [`FlowSpec::medium`].
    pub fn options(&self, wavelength_nm: f64) -> Result<Options, SceneError> {
        let border = Reference::Border;
        Ok(Options {
            file: self.open_options(),
            wavelength_nm,
            model: self.model,
            length_unit_m: self.length_unit_m,
            resolution: self.resample_nodes.map_or(Resolution::Auto, Resolution::Longest),
            depth: if self.revolve { Some(Depth::Revolve) } else { self.span.map(Depth::Span) },
            samples_per_axis: self.resample_samples,
            reconstruction: self.reconstruction,
            smoothing_nodes: self.smoothing_nodes,
            average_jumps: self.average_jumps,
            outside: self.outside,
            hidden: self.hidden,
            reference: self
                .reference_n_minus_1
                .map_or(border, |n_minus_1| Reference::Given { n_minus_1 }),
            ..Options::new(self.medium()?)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flow(text: &str) -> Result<Medium, String> {
        let spec: FlowSpec =
            toml::from_str(&format!("file = \"a.vti\"\n{text}")).map_err(|e| e.to_string())?;
        spec.medium().map_err(|e| e.to_string())
    }

    #[test]
    fn alternatives_and_lacks_are_named() {
        for (text, word) in [
            ("", "no quantity sets the index"),
            (
                "density = \"rho\"\ntemperature = \"T\"",
                "flow.density and flow.temperature are alternatives",
            ),
            ("temperature = \"T\"", "flow.temperature needs flow.pressure"),
            ("density = \"rho\"\nhumidity = \"0.5\"", "flow.humidity has no effect"),
            ("n_minus_1 = \"n\"\nspecies = { Y = \"He\" }", "flow.species has no effect"),
            ("density = \"rho\"\nspecies = { Y = \"unobtainium\" }", "unobtainium"),
            ("multifield = { fields = {} }", "no array has a weight"),
            ("multifield = { fields = { T = { knots = [[2, 0], [1, 0]] } } }", "multifield `T`"),
            (
                "density = \"rho\"\nmultifield = { fields = { T = { knots = [[0, 0]] } } }",
                "alternatives",
            ),
        ] {
            let message = flow(text).unwrap_err();
            assert!(message.contains(word), "{text}: {message}");
        }
    }

    #[test]
    fn curves_reach_the_medium_and_weightless_ones_do_not() {
        let m = flow(
            "multifield = { rule = \"largest\", fields = { T = { knots = [[300, 0], [2000, -2e-4]] \
             }, Z = { knots = [[0, 0]], weight = 0.0 } } }",
        );
        let Ok(Medium::Multifield { parts, rule }) = m else { panic!("{m:?}") };
        assert_eq!((parts.len(), rule), (1, Rule::Largest));
        assert!((parts[0].1.at(1150.0) + 1e-4).abs() < 1e-18);
    }

    #[test]
    fn units_reach_the_medium() {
        let m = flow(
            "temperature = \"T\"\ntemperature_zero_k = 273.15\npressure \
             = \"3.25\"\npressure_unit_pa = 100.0\npressure_zero_pa = 101000.0",
        );
        let Ok(Medium::TemperaturePressure { temperature, pressure, .. }) = m else {
            panic!("{m:?}")
        };
        assert_eq!((temperature.offset, pressure.scale), (273.15, 100.0));
        assert_eq!(pressure.offset, 101_000.0);
        assert_eq!(pressure.source, crate::input::Source::Constant(3.25));
    }
}
