//! A rendered image, its layers and its report.

use crate::errors;
use crate::work::run;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use schlieren::drawing::{Canvas, draw_overlay};
use schlieren::input;
use schlieren::output::{encode_png, write_canvas, write_exr, write_npy, write_png};
use schlieren::render::RenderOutput;
use schlieren::scene::Scene;
use serde_json::json;
use std::path::PathBuf;

/// A rendered image.
#[pyclass(frozen, module = "schlieren._schlieren")]
pub(crate) struct Output {
    rendered: RenderOutput,
    scene: Scene,
    /// How the field was made.
    input: Option<input::Report>,
    /// Nodes of the field along its axes.
    dims: Option<[usize; 3]>,
    /// For making the field, and for rendering.
    seconds: [f64; 2],
}

/// Name and numbers of a layer.
type Layer<'py> = (&'static str, Bound<'py, PyAny>);

impl Output {
    pub(crate) fn new(
        rendered: RenderOutput,
        scene: Scene,
        input: Option<input::Report>,
        dims: Option<[usize; 3]>,
        seconds: [f64; 2],
    ) -> Output {
        Output { rendered, scene, input, dims, seconds }
    }
}

#[pymethods]
impl Output {
    /// Width and height in pixels.
    #[getter]
    fn size(&self) -> (u32, u32) {
        (self.rendered.framing.width, self.rendered.framing.height)
    }

    /// Side of a pixel in the test section.
    #[getter]
    fn pixel_m(&self) -> f64 {
        self.rendered.framing.pixel_m
    }

    /// Middle of the image, along right and up.
    #[getter]
    fn center_m(&self) -> [f64; 2] {
        self.rendered.framing.center_m
    }

    /// The layers that were rendered, row by row from the top.
    fn layers<'py>(&self, py: Python<'py>) -> Vec<Layer<'py>> {
        let r = &self.rendered;
        let mut found: Vec<Layer<'py>> = Vec::new();
        let pixels: Vec<f32> = match r.colored {
            true => r.pixels.iter().flatten().copied().collect(),
            false => r.pixels.iter().map(|p| p[0]).collect(),
        };
        let mut add = |name, values: Vec<f32>| {
            if !values.is_empty() {
                found.push((name, PyArray1::from_vec(py, values).into_any()));
            }
        };
        add("brightness", pixels);
        if let Some(m) = &r.map {
            add("deflection_rad", m.deflection_rad.as_flattened().to_vec());
            add("displacement_m", m.displacement_m.as_flattened().to_vec());
            add("apparent_displacement_m", m.apparent_m.as_flattened().to_vec());
            add("phase_waves", m.waves.clone());
            add("transmission", m.transmission.clone());
        }
        if let Some(m) = &r.media {
            add("optical_depth", m.optical_depth.clone());
            add("emission", m.emission.clone());
            add("rotation_rad", m.rotation_rad.clone());
        }
        add("noise", r.noise.clone().unwrap_or_default());
        if let Some(counts) = &r.counts {
            found.push(("photons", PyArray1::from_slice(py, counts).into_any()));
        }
        found
    }

    /// The report, as JSON.
    fn report(&self) -> PyResult<String> {
        let r = &self.rendered.report;
        let input = self.input.as_ref();
        let report = json!({
            "technique": self.scene.technique.name(),
            "grid": self.dims,
            "outside": input.and_then(|i| i.outside.clone()),
            "index_formula": input.map(|i| i.formula),
            "reference_n_minus_1": input.map(|i| i.reference_n_minus_1),
            "n_minus_1_range": input.map(|i| i.n_minus_1_range),
            "density_range_kg_m3": input.and_then(|i| i.density_range_kg_m3),
            "march": r.march,
            "tolerance_rad": self.scene.march.tolerance_rad,
            "deflection_error_rad": r.deflection_error_rad,
            "resolution_error_rad": r.resolution_error_rad,
            "mesh_error_rad": r.mesh_error_rad,
            "largest_deflection_rad": r.largest_deflection_rad,
            "silhouette_error_px": r.silhouette_error_px,
            "levels": r.levels,
            "effects": r.effects,
            "counters": r.counters,
            "photons": r.tally,
            "margin_px": r.margin_px,
            "left_out": r.skip_report,
            "field_seconds": self.seconds[0],
            "render_seconds": self.seconds[1],
            "warnings": r.warnings,
        });
        serde_json::to_string(&report).map_err(|e| errors::of(&e))
    }

    /// The scene with every default, as a scene file.
    fn scene(&self) -> PyResult<String> {
        self.scene.effective().to_toml().map_err(|e| errors::of(&e))
    }

    /// The bytes of a PNG file.
    fn png<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let encoded = run(py, 0, |_| encode_png(&self.rendered))?;
        let (bytes, _) = encoded.map_err(|e| errors::of_output(&e))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Writes a file; its ending is `png`, `exr` or `npy`. An overlay is drawn on a PNG file.
    #[pyo3(signature = (path, ending, overlay=None))]
    fn write(
        &self,
        py: Python<'_>,
        path: PathBuf,
        ending: &str,
        overlay: Option<&str>,
    ) -> PyResult<()> {
        let overlay = overlay.map(crate::sheet::overlay).transpose()?;
        let written = run(py, 0, |_| match (ending, overlay, &self.rendered.map) {
            ("png", Some(overlay), Some(map)) => {
                let (width, height) = self.size();
                let mut canvas = Canvas {
                    width: width as usize,
                    height: height as usize,
                    pixels: self.rendered.pixels.clone(),
                };
                draw_overlay(&mut canvas, map, overlay);
                write_canvas(&path, &canvas).map(drop)
            }
            ("png", ..) => write_png(&path, &self.rendered).map(drop),
            ("npy", ..) => write_npy(&path, &self.rendered),
            _ => write_exr(&path, &self.rendered, &self.scene, self.seconds.iter().sum()),
        })?;
        written.map_err(|e| errors::of_output(&e))
    }
}
