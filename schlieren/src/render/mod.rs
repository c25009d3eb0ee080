//! Renders the image of a scene, with its layers and a report.
//!
//! ```
//! use glam::DVec3;
//! use schlieren::field::Field;
//! use schlieren::render::{Control, Layers, TestSection, render};
//! use schlieren::scene::Scene;
//!
//! // A warm Gaussian blob in air, 10 cm wide, behind a vertical knife.
//! let scene = Scene::from_toml("[flow]\nfile = \"\"\ndensity = \"-\"\n[film]\nsize = [32, 32]")?;
//! let blob = Field::from_fn([33; 3], [3e-3; 3], DVec3::splat(-48e-3), 1.00027, |p| {
//!     -2e-5 * (-p.length_squared() / (2.0 * 12e-3f64.powi(2))).exp()
//! })?;
//! let section = TestSection::of_fields(&scene, vec![blob], None)?;
//! let image = render(&scene, &section, Layers::NONE, &Control::default())?;
//! // Light is bent away from the warm middle: against the background of 1/2 the image is darker to
//! // the left of it and brighter to the right.
//! let [left, right] = [16 * 32 + 11, 16 * 32 + 20].map(|i: usize| image.pixels[i][0]);
//! assert!(left < 0.46 && right > 0.54, "{left} {right}");
//! assert!((image.pixels[0][0] - 0.5).abs() < 1e-3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod accuracy_warning;
mod apparent;
#[cfg(feature = "gpu")]
mod device_march;
mod device_work;
mod dispersion;
mod expose;
pub(crate) mod map;
mod margin;
mod media;
#[cfg(test)]
mod media_tests;
mod on_cells;
mod on_gpu;
mod paths;
mod planned;
mod read_ahead;
mod section;
#[cfg(test)]
mod tests;

pub(crate) use apparent::displacements as apparent_displacements;
pub use device_work::DeviceWork;
pub use map::Map;
pub use media::MediaMap;
pub use on_gpu::check_gpu;
pub use paths::{INTERPOLANTS, MARCHES};
pub use planned::PlannedPaths;
pub use read_ahead::ReadAhead;
#[cfg(feature = "serve")]
pub(crate) use read_ahead::{FileStamp, has_room_beside};
pub use section::TestSection;

use crate::cutoff::Rgb;
use crate::film::{Framing, Tally};
use crate::march::CellCounters;
use crate::path::{LightPaths, PathQuantities, SkipReport, Start};
use crate::scene::{Counters, Effects, Scene, SceneError, TechniqueSpec};
use crate::spectrum::filter_band;
use crate::technique::volume::ComparisonError;
use crate::technique::{Technique, bos, interferogram, schlieren, slice, volume};
use paths::Accuracy;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Errors of rendering.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The scene is invalid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The flow cannot be read.
    #[error(transparent)]
    Input(#[from] crate::input::InputError),
    /// The bodies cannot be read.
    #[error(transparent)]
    Solids(#[from] crate::solids::SolidsError),
    /// The view is invalid.
    #[error(transparent)]
    View(#[from] crate::view::ViewError),
    /// An image for comparison cannot be rendered.
    #[error(transparent)]
    Comparison(#[from] ComparisonError),
    /// The number of fields differs from the number of wavelengths.
    #[error("the scene has {wanted} wavelengths and {found} fields; give one field for each")]
    Fields {
        /// Number of wavelengths.
        wanted: usize,
        /// Number of fields.
        found: usize,
    },
    /// The program is built without the GPU march.
    #[error(
        "this program is built without the feature gpu; use --device cpu (march.device in a scene)"
    )]
    NoGpu,
    /// The GPU was requested but cannot compute this.
    #[cfg(feature = "gpu")]
    #[error(transparent)]
    Gpu(#[from] crate::gpu::GpuError),
    /// The scene names a property of the medium that the test section lacks.
    #[error(
        "the scene has media.{0} and the test section does not; read it from a file, or give it \
         with `TestSection::with_media`"
    )]
    NoMedia(&'static str),
    /// A name that does not exist.
    #[error("{key}: there is no `{name}`; there are: {names}")]
    Unknown {
        /// Path of the key in the scene.
        key: &'static str,
        /// The requested name.
        name: String,
        /// The valid names.
        names: String,
    },
    /// A cone filter would have to keep too many photons.
    #[error(
        "the cone filter keeps every photon, and {photons} are more than the {limit} it may keep; \
         use fewer samples or another filter"
    )]
    TooManyPhotons {
        /// Number of photons wanted.
        photons: u64,
        /// Largest number allowed.
        limit: u64,
    },
    /// Cancelled by the caller.
    #[error("cancelled")]
    Cancelled,
}

/// Cancels rendering and reports its progress.
pub struct Control<'a> {
    /// Set it to stop rendering soon.
    pub cancel: &'a AtomicBool,
    /// Receives the fraction done, 0..=1, from any thread, in increasing order.
    pub progress: &'a (dyn Fn(f64) + Sync),
}

impl Default for Control<'_> {
    /// Runs to the end without reporting progress.
    fn default() -> Self {
        static NEVER: AtomicBool = AtomicBool::new(false);
        Control { cancel: &NEVER, progress: &|_| {} }
    }
}

/// What to compute besides the image. Nothing else is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[allow(clippy::struct_excessive_bools, reason = "independent wishes")]
pub struct Layers {
    /// Deflection, displacement and transmission of rays through the pixels' centres.
    pub map: bool,
    /// The phase of the same rays.
    pub phase: bool,
    /// Photons per pixel.
    pub counts: bool,
    /// The image's noise.
    pub noise: bool,
    /// The error of deflections. The plan is refined until that is within the tolerance
    /// ([`crate::plan::Plan::within_tolerance`]), and a warning says if it cannot be. With
    /// [`Layers::map`] this is done in any case.
    pub accuracy: bool,
}

impl Layers {
    /// The image alone.
    pub const NONE: Layers =
        Layers { map: false, phase: false, counts: false, noise: false, accuracy: false };
    /// All layers.
    pub const ALL: Layers =
        Layers { map: true, phase: true, counts: true, noise: true, accuracy: true };
}

/// An image with its layers and report. Images and layers are stored row by row from the top.
#[derive(Debug, Clone)]
pub struct RenderOutput {
    /// Positions of the pixels in the test section.
    pub framing: Framing,
    /// Linear brightness, with 1 for white: energy times exposure. Grey images have three equal
    /// channels.
    pub pixels: Vec<Rgb>,
    /// Whether the channels can differ.
    pub colored: bool,
    /// The deflection map, with [`Layers::map`].
    pub map: Option<Map>,
    /// The media's layers, with [`Layers::map`] when the scene has media.
    pub media: Option<MediaMap>,
    /// Photons per pixel, with [`Layers::counts`] when the film was exposed by photons.
    pub counts: Option<Vec<u32>>,
    /// Estimated error of each pixel's brightness from the limited number of photons, with
    /// [`Layers::noise`]: half the difference between two halves of the photons, for the first
    /// wavelength and the strongest channel. `None` for images without noise.
    pub noise: Option<Vec<f32>>,
    /// The report.
    pub report: Report,
}

/// Report of how an image was rendered.
#[derive(Debug, Clone, Default, serde::Serialize)]
#[non_exhaustive]
pub struct Report {
    /// Effects that the scene needs.
    pub effects: Effects,
    /// Counts of work by kind.
    pub counters: Counters,
    /// Photons by outcome, over all wavelengths.
    pub tally: Tally,
    /// Description of the march.
    pub march: String,
    /// Measured error of deflections due to march and interpolation, when there is a map.
    pub deflection_error_rad: Option<f64>,
    /// Estimated error of deflections due to the flow's own lattice.
    pub resolution_error_rad: Option<f64>,
    /// Estimated error of deflections due to the mesh that the flow comes from.
    pub mesh_error_rad: Option<f64>,
    /// Largest deflection through a pixel's centre, when there is a map.
    pub largest_deflection_rad: Option<f64>,
    /// Largest error of the bodies' silhouettes, because they are computed with straight rays.
    /// Present when there are bodies and a map.
    pub silhouette_error_px: Option<f64>,
    /// Effect of skipping uniform gas (`march.skip_rad`) on the light of the first wavelength, or
    /// on the map for techniques without light.
    #[serde(rename = "left_out")]
    pub skip_report: Option<SkipReport>,
    /// The work on the cells of a mesh, for the first wavelength and the map; `None` on a lattice.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cells: Option<CellCounters>,
    /// The work of the GPU, if one took part.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub device: Option<DeviceWork>,
    /// Lowest and highest channel value of the image.
    pub levels: [f32; 2],
    /// Width of the margin around the image, in pixels, that also sent light.
    pub margin_px: u32,
    /// Side of a pixel in the test section.
    pub pixel_m: f64,
    /// Warnings about the image, one sentence each.
    pub warnings: Vec<String>,
}

impl Report {
    /// Adds a warning about a device that failed while tracing.
    fn add_traced(&mut self, paths: &dyn LightPaths) {
        let new = paths.device_warning().filter(|t| !self.warnings.contains(t));
        self.warnings.extend(new);
    }

    /// Notes the work of paths on cells.
    fn add_cells(&mut self, planned: &PlannedPaths<'_>) {
        if let (None, Some(work)) = (self.cells, &planned.cell_work) {
            self.cells = Some(work.counters());
        }
    }

    /// Notes the work of a GPU.
    fn add_device(&mut self, planned: &PlannedPaths<'_>) {
        #[cfg(feature = "gpu")]
        if let Some(paths) = &planned.on_device {
            self.device.get_or_insert_default().add(&paths.counters());
        }
        #[cfg(not(feature = "gpu"))]
        let _ = planned;
    }

    pub(crate) fn add_plan(&mut self, planned: &PlannedPaths<'_>) {
        self.march.clone_from(&planned.description);
        self.deflection_error_rad = planned.error_rad;
        self.resolution_error_rad = planned.resolution_error_rad;
        self.mesh_error_rad = planned.mesh_error_rad;
        self.warnings.extend(planned.warnings.iter().cloned());
    }
}

/// Renders the scene's image of a test section. The result does not depend on the number of
/// threads.
///
/// # Errors
/// If the scene is invalid, does not fit the test section, or needs a GPU that is not available, or
/// if rendering is cancelled.
pub fn render(
    scene: &Scene,
    section: &TestSection,
    layers: Layers,
    control: &Control<'_>,
) -> Result<RenderOutput, RenderError> {
    scene.check()?;
    let framing = framing(scene, section);
    let exposure = scene.exposure();
    let mut r = RenderOutput {
        framing,
        pixels: Vec::new(),
        colored: false,
        map: None,
        media: None,
        counts: None,
        noise: None,
        report: Report {
            effects: Effects::required_by(scene),
            pixel_m: framing.pixel_m,
            warnings: section.warnings.clone(),
            ..Report::default()
        },
    };

    // Techniques for comparison trace no light, but the deflection map does.
    let against_light = matches!(scene.technique, TechniqueSpec::Bos { .. });
    let grey = |v: Vec<f32>| v.into_iter().map(|v| [v * exposure as f32; 3]).collect();
    let mut first = None;
    match scene.technique {
        TechniqueSpec::Volume { strength } => {
            r.pixels = grey(volume::volume(&section.fields[0], &section.view, &framing, strength)?);
        }
        TechniqueSpec::Slice { strength, depth_m } => {
            r.pixels =
                grey(slice::slice(&section.fields[0], &section.view, &framing, depth_m, strength)?);
        }
        _ => first = expose::expose_lines(scene, section, layers, control, &mut r)?,
    }
    let measured = first.is_some();
    let chosen = first.as_ref().and_then(|planned| planned.choice);
    if control.cancel.load(Ordering::Relaxed) {
        return Err(RenderError::Cancelled);
    }

    if let Some(planned) = &first {
        media::add_emission(scene, section, planned, layers, &mut r)?;
    }
    if scene.march.skip_rad > 0.0 && !measured && !layers.map {
        let name = scene.technique.name();
        r.report.warnings.push(format!(
            "march.skip_rad has no effect with technique {name}, which does not trace light"
        ));
    }
    if layers.map {
        // Reuses the image's own paths when they have the wanted quantities. The optical path is
        // not computed for photons that do not need it.
        let planned = match first.filter(|p| p.paths.quantities().opd || !layers.phase) {
            Some(planned) => planned,
            None => {
                let accuracy = match chosen {
                    Some(choice) => Accuracy::Known(choice),
                    None => Accuracy::measured(!measured),
                };
                let quantities = PathQuantities { opd: layers.phase };
                section.paths_of(scene, 0, quantities, against_light, accuracy)?
            }
        };
        add_map(scene, section, &planned, control, &mut r)?;
        media::add_map(scene, section, &planned, &mut r)?;
    }
    media::warn(scene, layers, &mut r.report.warnings);
    r.report.levels = levels(&r.pixels);
    warn_about_image(scene, &mut r.report);
    (control.progress)(1.0);
    Ok(r)
}

/// Lowest and highest channel value.
fn levels(pixels: &[Rgb]) -> [f32; 2] {
    let none = [f32::INFINITY, f32::NEG_INFINITY];
    let of_part =
        |part: &[Rgb]| part.iter().flatten().fold(none, |[l, h], v| [l.min(*v), h.max(*v)]);
    let both = |a: [f32; 2], b: [f32; 2]| [a[0].min(b[0]), a[1].max(b[1])];
    pixels.par_chunks(1 << 13).map(of_part).reduce(|| none, both)
}

/// Positions of the pixels: the scene's field of view, or the whole field.
pub fn framing(scene: &Scene, section: &TestSection) -> Framing {
    let [width, height] = scene.film.size;
    let fitted = Framing::fitted(width, height, section.sides_m());
    let pixel_m = scene.film.field_of_view_m.map_or(fitted.pixel_m, |v| v / f64::from(width));
    Framing { pixel_m, center_m: scene.film.center_m, ..fitted }
}

/// The technique for line `line` of the spectrum.
///
/// # Errors
/// If the image of a filter cannot be read.
pub fn technique(
    scene: &Scene,
    line: usize,
    framing: &Framing,
    n0: f64,
    sample_source: bool,
) -> Result<Technique, RenderError> {
    let (optics, lines) = (scene.optics(), scene.lines());
    Ok(match &scene.technique {
        TechniqueSpec::Schlieren { cutoff } => {
            let s = schlieren::Schlieren::new(optics, &cutoff.cutoff()?, sample_source);
            let several = lines.len() > 1;
            Technique::Schlieren(if several {
                s.with_band(filter_band(lines[line].wavelength_nm))
            } else {
                s
            })
        }
        TechniqueSpec::Interferogram { visibility, fringe_spacing_m, fringe_angle_deg } => {
            let fringes = fringe_spacing_m.map(|spacing_m| interferogram::Fringes {
                spacing_m,
                angle_deg: fringe_angle_deg.unwrap_or(0.0),
            });
            let wavelength_m = lines[line].wavelength_nm * 1e-9;
            Technique::Interferogram(interferogram::Interferogram::new(
                optics,
                wavelength_m,
                *visibility,
                fringes,
                n0,
            ))
        }
        TechniqueSpec::Bos { dot_diameter_m, dot_spacing_m, seed } => {
            let diameter_m = dot_diameter_m
                .unwrap_or(3.0 * framing.pixel_m)
                .min(dot_spacing_m.unwrap_or(f64::INFINITY));
            let spacing_m = dot_spacing_m.unwrap_or(2.0 * diameter_m);
            Technique::Bos(bos::Bos::new(optics, bos::Dots { diameter_m, spacing_m, seed: *seed }))
        }
        TechniqueSpec::Shadowgraph {}
        | TechniqueSpec::Volume { .. }
        | TechniqueSpec::Slice { .. } => Technique::Shadowgraph(optics),
    })
}

fn add_map(
    scene: &Scene,
    section: &TestSection,
    planned: &PlannedPaths<'_>,
    control: &Control<'_>,
    r: &mut RenderOutput,
) -> Result<(), RenderError> {
    let blocked = |s: &Start| section.solids.as_ref().is_some_and(|b| b.block(&section.view, s));
    let wavelength_m = scene.light.wavelengths_nm[0] * 1e-9;
    let n0 = section.n0(0);
    let (paths, optics) = (&*planned.paths, scene.optics());
    let mut m = map::map(paths, &optics, &r.framing, wavelength_m, n0, blocked, control.cancel)
        .ok_or(RenderError::Cancelled)?;
    if matches!(scene.technique, TechniqueSpec::Bos { .. }) {
        m.apparent_m = apparent::displacements(&r.framing, &m.displacement_m, &m.transmission);
    }
    let report = &mut r.report;
    if report.march.is_empty() {
        report.add_plan(planned);
    }
    report.add_cells(planned);
    report.skip_report = report.skip_report.or(planned.paths.skip_report());
    report.add_traced(&*planned.paths);
    report.counters.map_rays += m.transmission.len() as u64;
    report.counters.phase_rays += m.waves.len() as u64;
    report.counters.solid_queries +=
        if section.solids.is_some() { m.transmission.len() as u64 } else { 0 };
    report.largest_deflection_rad = Some(m.largest_deflection_rad);
    if section.solids.is_some() {
        let error_px = m.largest_displacement_m / r.framing.pixel_m;
        report.silhouette_error_px = Some(error_px);
        if error_px > 0.5 {
            report.warnings.push(format!(
                "rays are displaced by up to {error_px:.1} pixels, but bodies are tested against \
                 straight rays: silhouettes can be off by that much; mark the bodies' cells as \
                 solid in the flow's file"
            ));
        }
    }
    if matches!(scene.technique, TechniqueSpec::Interferogram { .. }) && !m.waves.is_empty() {
        let pairs = interferogram::unresolved_pairs(&m.waves, r.framing.width as usize);
        if pairs > 0 {
            report.warnings.push(format!(
                "the phase changes by more than half a wave between {pairs} pairs of neighbouring \
                 pixels: fringes there are finer than pixels and turn grey; use more pixels or a \
                 smaller field of view"
            ));
        }
    }
    r.map = Some(m);
    Ok(())
}

/// The warning about a flow that is dark from this side.
pub(crate) const NO_LIGHT: &str = "no light passes the flow: every ray that enters it meets blank or solid cells; set the role \
     of nodes outside the mesh (flow.outside) and of hidden cells (flow.hidden), or view it from \
     another side";

/// Warns about images that show nothing: they are correct but rarely wanted.
fn warn_about_image(scene: &Scene, report: &mut Report) {
    let [low, high] = report.levels;
    // One step of an 8-bit image at half brightness, in linear light.
    let visible = 0.004 * high.max(0.1);
    if high - low < visible && !matches!(scene.technique, TechniqueSpec::Bos { .. }) {
        let cure = match scene.technique {
            TechniqueSpec::Schlieren { .. } => {
                "a smaller source (light.source), a longer collimator (lenses.collimator_m) or a \
                 smaller opening of the cut-off make it more sensitive"
            }
            TechniqueSpec::Shadowgraph {} => {
                "a film farther away (film.focus_m) makes it more sensitive"
            }
            TechniqueSpec::Interferogram { .. } => {
                "the optical path differs by less than a fringe; finite fringes \
                 (technique.fringe_spacing_m) show less"
            }
            _ => "a larger technique.strength shows more",
        };
        report
            .warnings
            .push(format!("the image is uniform ({low:.4} to {high:.4} of white): {cure}"));
    }
    if report.tally.blocked_in_field > 0 && report.largest_deflection_rad == Some(0.0) {
        report.warnings.push(NO_LIGHT.into());
    }
    if report.tally.not_a_number > 0 {
        report.warnings.push(format!(
            "{} photons returned NaN and were discarded; please report this",
            report.tally.not_a_number
        ));
    }
}
