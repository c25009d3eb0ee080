//! The index of refraction for conditions in arrays.

use crate::errors;
use crate::work::run_for;
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rayon::prelude::*;
use rt_core_python_work::{Length, Stop};
use schlieren::index::conditions::{Conditions, IndexResult, Model, compute};
use schlieren::index::{Gas, IndexError};

/// Calls with fewer conditions are short.
const MANY: usize = 1 << 12;

type Floats<'py> = PyReadonlyArray1<'py, f64>;

/// n - 1 for each, and the formula and the warnings of all.
type Answer<'py> = (Bound<'py, PyArray1<f64>>, String, Vec<String>);

/// n - 1 for conditions, all arrays being of one length. `species` are gases with mass fractions.
#[pyfunction]
pub(crate) fn index<'py>(
    py: Python<'py>,
    wavelength_nm: Floats<'py>,
    temperature_c: Floats<'py>,
    pressure_pa: Floats<'py>,
    humidity: Floats<'py>,
    co2_ppm: Floats<'py>,
    density_kg_m3: Option<Floats<'py>>,
    species: Vec<(String, Floats<'py>)>,
    model: &str,
) -> PyResult<Answer<'py>> {
    let refused = |text: String| PyValueError::new_err(text);
    let model: Model = model.parse().map_err(|e| refused(format!("model: {e}")))?;
    let [wavelength, temperature, pressure, humid, co2] =
        [&wavelength_nm, &temperature_c, &pressure_pa, &humidity, &co2_ppm];
    let (wavelength, temperature) = (wavelength.as_slice()?, temperature.as_slice()?);
    let (pressure, humid, co2) = (pressure.as_slice()?, humid.as_slice()?, co2.as_slice()?);
    let density = density_kg_m3.as_ref().map(|d| d.as_slice()).transpose()?;
    let mut gases: Vec<(Gas, &[f64])> = Vec::new();
    for (gas, fractions) in &species {
        let gas = gas.parse().map_err(|e| refused(format!("species: {e}")))?;
        gases.push((gas, fractions.as_slice()?));
    }
    let count = wavelength.len();
    let of = |i: usize| -> Result<IndexResult, IndexError> {
        compute(&Conditions {
            wavelength_nm: wavelength[i],
            temperature_c: temperature[i],
            pressure_pa: pressure[i],
            humidity: humid[i],
            co2_ppm: co2[i],
            species: gases.iter().map(|(gas, part)| (gas.clone(), part[i])).collect(),
            density_kg_m3: density.map(|d| d[i]),
            model,
        })
    };
    let all = |_: &Stop| (0..count).into_par_iter().map(of).collect::<Result<Vec<_>, _>>();
    let length = if count < MANY { Length::Short } else { Length::Long };
    let found = run_for(py, length, 0, all)?;
    let found = found.map_err(|e| errors::of(&e))?;
    let mut warnings: Vec<String> = Vec::new();
    let mut formula = String::new();
    for result in &found {
        for text in &result.warnings {
            // Thousands of points would say the same with other numbers.
            if warnings.len() < 8 && !warnings.contains(text) {
                warnings.push(text.clone());
            }
        }
        if formula.is_empty() {
            formula = serde_json::to_string(&result.model).map_err(|e| errors::of(&e))?;
        }
    }
    let values = PyArray1::from_vec(py, found.iter().map(|r| r.n_minus_1).collect());
    Ok((values, formula.trim_matches('"').to_owned(), warnings))
}
