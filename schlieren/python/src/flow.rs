//! The data of a flow, and what is rendered of it.

use crate::output::Output;
use crate::sheet::SheetOutput;
use crate::work::run;
use crate::{data, errors};
use datasets::model::Dataset;
use datasets::read::OpenOptions;
use datasets::write::{VtkOptions, write_vtk};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use schlieren::input::contents_of_dataset;
use schlieren::render::{Control, Layers, RenderError, TestSection, render};
use schlieren::scene::Scene;
use schlieren::sheet::render_sheet;
use schlieren::solids::Solids;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, TryLockError};
use std::time::Instant;

/// The data of a flow.
#[pyclass(frozen, module = "schlieren._schlieren")]
pub(crate) struct Flow {
    data: Dataset,
    /// What the reader of its file repaired or left out.
    notes: Vec<String>,
    /// The last test section, which the next image takes if it can. Out of here while an image is
    /// rendered, so that no thread waits for another.
    kept: Mutex<Option<Kept>>,
}

struct Kept {
    /// What the section was made for.
    of: String,
    section: TestSection,
}

/// The part of a scene that a test section is made from, besides the view.
fn made_for(scene: &Scene) -> serde_json::Result<String> {
    let media = scene.media.quantities();
    let media: Vec<String> = media.iter().map(|(p, q)| format!("{p:?} {q:?}")).collect();
    let wavelengths = &scene.light.wavelengths_nm;
    serde_json::to_string(&(&scene.flow, wavelengths, &scene.solids.files, media))
}

/// The scene from the JSON form of a scene file.
fn scene_of(text: &str) -> PyResult<Scene> {
    let scene: Scene =
        serde_json::from_str(text).map_err(|e| PyValueError::new_err(e.to_string()))?;
    scene.check().map_err(|e| errors::of(&e))?;
    Ok(scene)
}

impl Flow {
    fn of(data: Dataset, notes: Vec<String>) -> Flow {
        Flow { data, notes, kept: Mutex::new(None) }
    }

    /// The place of the kept section; `None` while another thread has it. It is never waited for:
    /// in a forked child that thread may not exist, and the place is then locked for ever.
    fn place(&self) -> Option<MutexGuard<'_, Option<Kept>>> {
        match self.kept.try_lock() {
            Ok(place) => Some(place),
            Err(TryLockError::Poisoned(place)) => Some(place.into_inner()),
            Err(TryLockError::WouldBlock) => None,
        }
    }

    fn take_kept(&self) -> Option<Kept> {
        self.place()?.take()
    }

    /// The test section for a scene; the one kept if it is of the same flow and light.
    fn section(&self, scene: &Scene) -> PyResult<(String, TestSection)> {
        // Scenes come from JSON, so they can be written as JSON.
        let of = made_for(scene).unwrap_or_default();
        if let Some(mut kept) = self.take_kept().filter(|k| k.of == of) {
            let centre_m = kept.section.centre_m();
            kept.section.view = scene.view.direction.view(centre_m).map_err(|e| errors::of(&e))?;
            return Ok((of, kept.section));
        }
        let (solids, more) = match &scene.solids.files[..] {
            [] => (None, Vec::new()),
            files => {
                let opened = Solids::open(files).map_err(RenderError::from);
                let (solids, warnings) = opened.map_err(|e| errors::of_render(&e))?;
                (Some(solids), warnings)
            }
        };
        let made = TestSection::of_dataset(scene, &self.data, solids);
        let mut section = made.map_err(|e| errors::of_render(&e))?.with_caches();
        section.warnings.splice(0..0, self.notes.iter().cloned());
        section.warnings.extend(more);
        Ok((of, section))
    }

    fn keep(&self, of: String, section: TestSection) {
        if let Some(mut place) = self.place() {
            *place = Some(Kept { of, section });
        }
    }
}

#[pymethods]
impl Flow {
    #[new]
    fn new(dictionary: &Bound<'_, PyDict>) -> PyResult<Flow> {
        Ok(Flow::of(data::dataset(dictionary)?, Vec::new()))
    }

    /// The flow in a file.
    #[staticmethod]
    #[pyo3(signature = (path, spacing=None, origin=None))]
    fn open(
        py: Python<'_>,
        path: PathBuf,
        spacing: Option<[f64; 3]>,
        origin: Option<[f64; 3]>,
    ) -> PyResult<Flow> {
        let open = OpenOptions { spacing, origin, ..OpenOptions::default() };
        let read = run(py, 0, |_| schlieren::input::dataset(&path, &open))?;
        let (data, notes) = read.map_err(|e| errors::of_input(&e))?;
        Ok(Flow::of(data, notes))
    }

    /// What the flow holds, as JSON.
    fn contents(&self, py: Python<'_>) -> PyResult<String> {
        let contents = run(py, 0, |_| contents_of_dataset(&self.data))?;
        serde_json::to_string(&contents).map_err(|e| errors::of(&e))
    }

    /// Writes the data as a file of VTK.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let written = run(py, 0, |_| write_vtk(&path, &self.data, VtkOptions::default()))?;
        written.map_err(|e| errors::of_write(&e)).map(drop)
    }

    /// Forgets what is kept for further images.
    fn forget(&self) {
        self.take_kept();
    }

    /// Renders a scene. `layers`: map, phase, counts, noise.
    fn render(
        &self,
        py: Python<'_>,
        scene: &str,
        layers: (bool, bool, bool, bool),
        threads: usize,
    ) -> PyResult<Output> {
        let scene = scene_of(scene)?;
        let (map, phase, counts, noise) = layers;
        let layers = Layers { map, phase, counts, noise, accuracy: true };
        let work = |stop: &rt_core_python_work::Stop| -> PyResult<Output> {
            let start = Instant::now();
            let (of, section) = self.section(&scene)?;
            let read_secs = start.elapsed().as_secs_f64();
            let flag = stop.flag();
            let control = Control { cancel: &flag, ..Control::default() };
            let rendered = render(&scene, &section, layers, &control);
            if matches!(rendered, Err(RenderError::Cancelled)) {
                stop.note();
            }
            let rendered = rendered.map_err(|e| errors::of_render(&e))?;
            let seconds = [read_secs, start.elapsed().as_secs_f64() - read_secs];
            let input = section.input.clone();
            let dims = section.grid();
            self.keep(of, section);
            Ok(Output::new(rendered, scene, input, dims, seconds))
        };
        run(py, threads, work)?
    }

    /// Renders the panels of a contact sheet.
    fn sheet(&self, py: Python<'_>, scene: &str, threads: usize) -> PyResult<SheetOutput> {
        let scene = scene_of(scene)?;
        let work = |stop: &rt_core_python_work::Stop| -> PyResult<SheetOutput> {
            let start = Instant::now();
            let (of, section) = self.section(&scene)?;
            let flag = stop.flag();
            let control = Control { cancel: &flag, ..Control::default() };
            let rendered = render_sheet(&scene, &section, &control);
            let cut = rendered.as_ref().map_or(true, |s| s.interrupted);
            if cut && flag.load(std::sync::atomic::Ordering::Relaxed) {
                stop.note();
            }
            let sheet = rendered.map_err(|e| errors::of_render(&e))?;
            let input = section.input.clone();
            self.keep(of, section);
            Ok(SheetOutput::new(sheet, scene, input, start.elapsed().as_secs_f64()))
        };
        run(py, threads, work)?
    }

    /// The ray of one point of the image, as JSON.
    fn probe(
        &self,
        py: Python<'_>,
        scene: &str,
        pixel: [f64; 2],
        threads: usize,
    ) -> PyResult<String> {
        let scene = scene_of(scene)?;
        let work = |_: &rt_core_python_work::Stop| -> PyResult<schlieren::probe::Probe> {
            let (of, section) = self.section(&scene)?;
            let found = schlieren::probe::probe(&scene, &section, pixel);
            self.keep(of, section);
            found.map_err(|e| errors::of_render(&e))
        };
        let found = run(py, threads, work)??;
        serde_json::to_string(&found).map_err(|e| errors::of(&e))
    }
}

/// The times of a collection, or of a list of files, each with its file.
#[pyfunction]
pub(crate) fn series(paths: Vec<PathBuf>) -> PyResult<Vec<(f64, PathBuf)>> {
    let steps = schlieren::input::series(&paths).map_err(|e| errors::of_input(&e))?;
    Ok(steps.into_iter().map(|step| (step.time, step.path)).collect())
}
