//! Computes the index for one set of conditions, as `schlieren index --wavelength-nm 633 …` does.

use super::ciddor::{Ciddor, MoistAir, ZERO_CELSIUS_K};
use super::{Gas, IndexError, Mixture};
use serde::Serialize;

/// Which formula.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Model {
    /// Ciddor for air within its temperature range, Gladstone-Dale for species and other
    /// temperatures.
    #[default]
    Auto,
    /// [`super::ciddor`], with a warning outside its range.
    Ciddor,
    /// [`super::gladstone_dale`] with the density of an ideal gas.
    GladstoneDale,
}

impl std::str::FromStr for Model {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        match s {
            "auto" => Ok(Model::Auto),
            "ciddor" => Ok(Model::Ciddor),
            "gladstone-dale" => Ok(Model::GladstoneDale),
            other => Err(format!("no model `{other}`; known: auto, ciddor, gladstone-dale")),
        }
    }
}

/// A state of gas and light.
#[derive(Debug, Clone, PartialEq)]
pub struct Conditions {
    /// Vacuum wavelength, nm.
    pub wavelength_nm: f64,
    /// Temperature, °C.
    pub temperature_c: f64,
    /// Pressure, Pa.
    pub pressure_pa: f64,
    /// Relative humidity, 0 to 1.
    pub humidity: f64,
    /// CO2, ppm.
    pub co2_ppm: f64,
    /// Gases by mass fraction; the rest is air. Empty for air.
    pub species: Vec<(Gas, f64)>,
    /// Density in kg/m³, which replaces the density that follows from temperature and pressure.
    pub density_kg_m3: Option<f64>,
    /// Which formula.
    pub model: Model,
}

impl Default for Conditions {
    /// 633 nm, 20 °C, 101325 Pa, dry air with 450 ppm CO2.
    fn default() -> Self {
        let air = MoistAir::default();
        Conditions {
            wavelength_nm: 633.0,
            temperature_c: air.temperature_c,
            pressure_pa: air.pressure_pa,
            humidity: air.relative_humidity,
            co2_ppm: air.co2_ppm,
            species: Vec::new(),
            density_kg_m3: None,
            model: Model::Auto,
        }
    }
}

/// The result. Its fields are the keys of `--json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct IndexResult {
    /// n − 1.
    pub n_minus_1: f64,
    /// n, for readers; it has fewer digits than n − 1.
    pub n: f64,
    /// The formula used: `ciddor` or `gladstone-dale`.
    pub model: Model,
    /// Density, for Gladstone-Dale.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub density_kg_m3: Option<f64>,
    /// Gladstone-Dale constant of the mixture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gladstone_dale_m3_per_kg: Option<f64>,
    /// See [`Conditions`].
    pub wavelength_nm: f64,
    /// See [`Conditions`].
    pub temperature_c: f64,
    /// See [`Conditions`].
    pub pressure_pa: f64,
    /// See [`Conditions`].
    pub humidity: f64,
    /// See [`Conditions`].
    pub co2_ppm: f64,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

/// Computes n − 1 for `conditions`.
///
/// ```
/// use schlieren::index::conditions::{Conditions, IndexResult, compute};
/// // A row of NIST's table: 40 C, 120 kPa, 75 % humidity.
/// let (temperature_c, pressure_pa) = (40.0, 120e3);
/// let moist =
///     Conditions { temperature_c, pressure_pa, humidity: 0.75, ..Default::default() };
/// let result: IndexResult = compute(&moist)?;
/// assert!((result.n_minus_1 - 2.99418e-4).abs() < 1e-9 && result.warnings.is_empty());
/// # Ok::<(), schlieren::index::IndexError>(())
/// ```
pub fn compute(conditions: &Conditions) -> Result<IndexResult, IndexError> {
    let c = conditions;
    let wavelength_um = c.wavelength_nm * 1e-3;
    let ciddor = Ciddor::new(wavelength_um)?;
    let air = MoistAir {
        temperature_c: c.temperature_c,
        pressure_pa: c.pressure_pa,
        relative_humidity: c.humidity,
        co2_ppm: c.co2_ppm,
    };
    let mut warnings = Vec::new();
    let outside = ciddor.out_of_range(&air);
    let too_hot = outside.iter().any(|o| o.quantity == "temperature");
    let plain_air = c.species.is_empty() && c.density_kg_m3.is_none();
    let model = match c.model {
        Model::Auto if plain_air && !too_hot => Model::Ciddor,
        Model::Auto => Model::GladstoneDale,
        forced => forced,
    };
    let (n_minus_1, density_kg_m3, k) = match model {
        Model::Ciddor => {
            if !plain_air {
                return Err(IndexError::Impossible {
                    quantity: "model ciddor with",
                    value: c.species.len() as f64,
                    unit: "species",
                    reason: "or a density is a contradiction: Ciddor's equation is for air by \
                             temperature and pressure",
                    cure: "omit the model, or use gladstone-dale",
                });
            }
            warnings.extend(outside.iter().map(ToString::to_string));
            (ciddor.n_minus_1(&air)?, None, None)
        }
        _ => {
            // Checks the ranges of temperature and pressure. Humidity does not apply to a mixture
            // given by mass fractions.
            let dry = MoistAir { relative_humidity: 0.0, ..air };
            ciddor.n_minus_1(&dry)?;
            if c.humidity != 0.0 {
                warnings.push(format!(
                    "humidity {} is not used by Gladstone-Dale; give water vapour as a species, \
                     H2O with its mass fraction",
                    c.humidity
                ));
            }
            if c.model == Model::Auto && plain_air {
                warnings.push(format!(
                    "{} C is outside -40..100 C, where Ciddor's equation holds: Gladstone-Dale \
                     with air of the density of an ideal gas is used",
                    c.temperature_c
                ));
            }
            let named: Vec<_> = c.species.iter().map(|(g, _)| (g.to_string(), g.clone())).collect();
            let mixture = Mixture::new(&named, &Gas::AIR, wavelength_um)?;
            warnings.extend(mixture.warnings().iter().map(ToString::to_string));
            let fractions: Vec<f64> = c.species.iter().map(|s| s.1).collect();
            let blend = mixture.try_blend(&fractions)?;
            let density = match c.density_kg_m3 {
                Some(given) if given >= 0.0 && given.is_finite() => given,
                Some(given) => {
                    return Err(IndexError::Impossible {
                        quantity: "density",
                        value: given,
                        unit: "kg/m^3",
                        reason: "is not a density",
                        cure: "give it in kg/m^3",
                    });
                }
                None => {
                    mixture.check_molar_masses()?;
                    blend.density_kg_m3(c.temperature_c + ZERO_CELSIUS_K, c.pressure_pa)
                }
            };
            (blend.n_minus_1(density), Some(density), Some(blend.k_m3_per_kg))
        }
    };
    Ok(IndexResult {
        n_minus_1,
        n: 1.0 + n_minus_1,
        model,
        density_kg_m3,
        gladstone_dale_m3_per_kg: k,
        wavelength_nm: c.wavelength_nm,
        temperature_c: c.temperature_c,
        pressure_pa: c.pressure_pa,
        humidity: c.humidity,
        co2_ppm: c.co2_ppm,
        warnings,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn automatic_choice_of_the_formula() {
        let cold = compute(&Conditions::default()).unwrap();
        assert_eq!((cold.model, cold.warnings.len()), (Model::Ciddor, 0));
        let flame = compute(&Conditions { temperature_c: 1500.0, ..Default::default() }).unwrap();
        assert_eq!((flame.model, flame.warnings.len()), (Model::GladstoneDale, 1));
        let forced =
            Conditions { temperature_c: 1500.0, model: Model::Ciddor, ..Default::default() };
        assert!(
            compute(&forced).unwrap().warnings[0]
                .contains("temperature 1500 C is outside -40..100 C")
        );
        // For dry air at room temperature, both agree except for the compressibility, 4e-4.
        let gd =
            compute(&Conditions { model: Model::GladstoneDale, ..Default::default() }).unwrap();
        let ratio = gd.n_minus_1 / cold.n_minus_1;
        assert!((ratio - 1.0).abs() < 6e-4 && ratio != 1.0, "{ratio}");
    }

    #[test]
    fn helium_and_refusals() {
        let helium = vec![("He".parse().unwrap(), 1.0)];
        let he = compute(&Conditions { species: helium.clone(), ..Default::default() }).unwrap();
        assert!(
            (he.n_minus_1 - 3.25e-5).abs() < 1e-7 && he.density_kg_m3.unwrap() > 0.166,
            "{he:?}"
        );
        let text =
            compute(&Conditions { species: helium, model: Model::Ciddor, ..Default::default() });
        assert!(text.unwrap_err().to_string().contains("contradiction"));
        let humid = Conditions { humidity: 0.5, model: Model::GladstoneDale, ..Default::default() };
        assert!(compute(&humid).unwrap().warnings[0].contains("humidity 0.5 is not used"));
        assert!(compute(&Conditions { density_kg_m3: Some(-1.0), ..Default::default() }).is_err());
        assert!(
            compute(&Conditions {
                temperature_c: -300.0,
                model: Model::GladstoneDale,
                ..Default::default()
            })
            .is_err()
        );
    }

    #[test]
    fn json_has_the_promised_keys() {
        let json = serde_json::to_value(compute(&Conditions::default()).unwrap()).unwrap();
        assert_eq!(json["model"], "ciddor");
        assert!(json["n_minus_1"].as_f64().unwrap() > 2.7e-4);
        assert!(json.get("density_kg_m3").is_none());
    }
}
