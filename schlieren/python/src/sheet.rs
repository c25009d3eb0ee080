//! A contact sheet: its panels, and its picture.

use crate::errors;
use crate::work::run;
use numpy::PyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use schlieren::input;
use schlieren::output::{write_canvas, write_sheet_exr};
use schlieren::scene::Scene;
use schlieren::sheet::{Sheet, compose};
use serde_json::json;
use std::path::PathBuf;

/// A rendered sheet.
#[pyclass(frozen, module = "schlieren._schlieren")]
pub(crate) struct SheetOutput {
    sheet: Sheet,
    scene: Scene,
    input: Option<input::Report>,
    seconds: f64,
}

/// Name, two labels, options of the program, and the pixels of three channels.
type Panel<'py> = (&'static str, [String; 2], Vec<String>, Bound<'py, PyAny>);

impl SheetOutput {
    pub(crate) fn new(
        sheet: Sheet,
        scene: Scene,
        input: Option<input::Report>,
        seconds: f64,
    ) -> SheetOutput {
        SheetOutput { sheet, scene, input, seconds }
    }
}

#[pymethods]
impl SheetOutput {
    /// Width and height of a panel in pixels.
    #[getter]
    fn size(&self) -> (u32, u32) {
        (self.sheet.framing.width, self.sheet.framing.height)
    }

    /// The panels, row by row from the top.
    fn panels<'py>(&self, py: Python<'py>) -> Vec<Panel<'py>> {
        let panel = |p: &schlieren::sheet::Panel| {
            let pixels: Vec<f32> = p.pixels.iter().flatten().flatten().copied().collect();
            let array = PyArray1::from_vec(py, pixels).into_any();
            (p.name, p.labels.clone(), p.options.clone(), array)
        };
        self.sheet.panels.iter().map(panel).collect()
    }

    /// The report, as JSON.
    fn report(&self) -> PyResult<String> {
        let r = &self.sheet.report;
        let report = json!({
            "bench": self.sheet.bench,
            "pixel_m": r.pixel_m,
            "march": r.march,
            "tolerance_rad": self.scene.march.tolerance_rad,
            "deflection_error_rad": r.deflection_error_rad,
            "largest_deflection_rad": r.largest_deflection_rad,
            "counters": r.counters,
            "outside": self.input.as_ref().and_then(|i| i.outside.clone()),
            "seconds": self.seconds,
            "warnings": r.warnings,
        });
        serde_json::to_string(&report).map_err(|e| errors::of(&e))
    }

    /// Writes a file; its ending is `png` or `exr`.
    fn write(
        &self,
        py: Python<'_>,
        path: PathBuf,
        ending: &str,
        title: &str,
        columns: usize,
    ) -> PyResult<()> {
        let written = run(py, 0, |_| match ending {
            "png" => write_canvas(&path, &compose(&self.sheet, title, columns)).map(drop),
            _ => write_sheet_exr(&path, &self.sheet, &self.scene, self.seconds),
        })?;
        written.map_err(|e| errors::of_output(&e))
    }
}

/// Checks the name of an overlay.
pub(crate) fn overlay(text: &str) -> PyResult<schlieren::drawing::Overlay> {
    text.parse().map_err(|e: schlieren::drawing::OverlayError| PyValueError::new_err(e.to_string()))
}
