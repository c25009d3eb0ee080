//! Implements `schlieren index`: computes the index of refraction for conditions on the command
//! line or in a table.

use super::units;
use crate::index::Gas;
use crate::index::conditions::{Conditions, Model, compute};
use crate::index::csv;
use clap::Args;
use datasets::cli::{CommonArgs, UsageError};
use std::io::Write as _;
use std::path::PathBuf;

/// Options of `schlieren index`.
#[derive(Debug, Args)]
pub(super) struct IndexArgs {
    /// A table with the columns lambda_um, T_C, p_Pa, RH_frac, CO2_ppm; printed with n_minus_1
    /// added
    #[arg(long, value_name = "CSV", conflicts_with_all = ["wavelength_nm", "temperature_c", "pressure_pa", "humidity", "co2_ppm", "density", "species", "model"])]
    csv: Option<PathBuf>,
    /// Vacuum wavelength
    #[arg(long, value_name = "NM", default_value_t = 633.0)]
    wavelength_nm: f64,
    /// Temperature
    #[arg(long, value_name = "C", default_value_t = 20.0, allow_hyphen_values = true)]
    temperature_c: f64,
    /// Pressure
    #[arg(long, value_name = "PA", default_value_t = 101_325.0)]
    pressure_pa: f64,
    /// Relative humidity, 0 to 1
    #[arg(long, value_name = "PART", default_value_t = 0.0)]
    humidity: f64,
    /// CO2 content
    #[arg(long, value_name = "PPM", default_value_t = 450.0)]
    co2_ppm: f64,
    /// Density in kg/m³, in place of the one that follows from temperature and pressure
    #[arg(long, value_name = "KG_M3")]
    density: Option<f64>,
    /// A gas and its mass fraction, GAS=0.1; the rest is air; may be repeated
    #[arg(long, value_name = "GAS=FRACTION", value_parser = units::species)]
    species: Vec<(String, String)>,
    /// Formula: auto, ciddor or gladstone-dale
    #[arg(long, value_name = "NAME", default_value = "auto")]
    model: Model,
}

pub(super) fn index(common: CommonArgs, args: &IndexArgs) -> anyhow::Result<()> {
    if let Some(path) = &args.csv {
        let table = csv::compute(path)?;
        for w in table.warnings() {
            common.warn(w);
        }
        if common.json {
            for n in table.n_minus_1() {
                common.result(&serde_json::json!({ "n_minus_1": n }), || "")?;
            }
            return Ok(());
        }
        let mut text = Vec::new();
        table.write(&mut text)?;
        std::io::stdout().lock().write_all(&text)?;
        return Ok(());
    }
    let species = args.species.iter().map(|(gas, part)| {
        let gas: Gas = gas.parse().map_err(|e| UsageError(format!("--species: {e}")))?;
        let part: f64 = part.parse().map_err(|_| {
            UsageError(format!(
                "--species {gas}={part}: `{part}` is not a mass fraction; give a \
                                number from 0 to 1"
            ))
        })?;
        Ok((gas, part))
    });
    let conditions = Conditions {
        wavelength_nm: args.wavelength_nm,
        temperature_c: args.temperature_c,
        pressure_pa: args.pressure_pa,
        humidity: args.humidity,
        co2_ppm: args.co2_ppm,
        species: species.collect::<Result<_, UsageError>>()?,
        density_kg_m3: args.density,
        model: args.model,
    };
    let result = compute(&conditions).map_err(|e| UsageError(e.to_string()))?;
    for w in &result.warnings {
        common.warn(w);
    }
    common.result(&result, || format!("n - 1 = {:.11e}", result.n_minus_1))
}
