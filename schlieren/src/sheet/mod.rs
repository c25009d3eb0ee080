//! Contact sheets: one flow by all techniques, in one labelled picture.
//!
//! Light is traced once, through the corners of all pixels, and makes the panels of all techniques
//! that follow it: two knives, a colour filter, a dark field, a shadowgraph, two interferograms. A
//! second set of rays goes from the camera to the background of the BOS panels.
//!
//! The bench of each panel is chosen from what the rays measure, so that each shows something: a
//! slit, a spot, a distance. Its numbers stand below the panel, and as options of `schlieren
//! render`, which makes the panel's picture alone.
//!
//! ```
//! use glam::DVec3;
//! use schlieren::field::Field;
//! use schlieren::output::{write_canvas, write_sheet_exr};
//! use schlieren::render::{Control, TestSection};
//! use schlieren::scene::Scene;
//! use schlieren::sheet::{Panel, PanelBench, Sheet, compose, render_sheet};
//!
//! let scene = Scene::from_toml("[flow]\nfile = \"\"\ndensity = \"-\"\n[film]\nsize = [32, 32]")?;
//! let blob = Field::from_fn([33; 3], [3e-3; 3], DVec3::splat(-48e-3), 1.00027, |p| {
//!     -2e-5 * (-p.length_squared() / (2.0 * 12e-3f64.powi(2))).exp()
//! })?;
//! let section = TestSection::of_fields(&scene, vec![blob], None)?;
//! let sheet: Sheet = render_sheet(&scene, &section, &Control::default())?;
//! let PanelBench { slit_m, .. } = sheet.bench;
//! let Panel { name, labels, .. } = &sheet.panels[0];
//! assert!(*name == "knife-x" && labels[1].starts_with("slit") && slit_m > 1e-6);
//!
//! let folder = std::env::temp_dir();
//! let file = |end: &str| folder.join(format!("sheet-{}.{end}", std::process::id()));
//! write_canvas(&file("png"), &compose(&sheet, "a warm spot", 4))?;
//! write_sheet_exr(&file("exr"), &sheet, &scene, 0.0)?;
//! # for end in ["png", "exr"] { std::fs::remove_file(file(end))?; }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bench;
mod layout;
mod panels;
mod words;

pub(crate) use words::{PANEL_SIDE, refusal, scene_of_sheet, title};

pub use bench::PanelBench;
pub use layout::compose;

use crate::cutoff::Rgb;
use crate::film::traced::{corners, start_of_corner};
use crate::film::{Framing, trace_parallel_unless_cancelled};
use crate::path::{Exit, LightPaths, PathQuantities, Start, Status};
use crate::render::{Control, Map, NO_LIGHT, RenderError, Report, TestSection, framing};
use crate::scene::{Effects, Scene, TechniqueSpec};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Part of the image's longer side that also sends light, on each side of it.
const MARGIN: f64 = 0.03;
/// Part of the work up to the end of the light's rays, of which those of BOS are the rest.
const LIGHT_PART: f64 = 0.5;

/// A panel of a sheet.
#[derive(Debug, Clone)]
pub struct Panel {
    /// A short name: `knife-x`, `bos`...
    pub name: &'static str,
    /// The technique and the numbers of its bench, for readers.
    pub labels: [String; 2],
    /// Options of `schlieren render` that make this picture alone, besides those of the flow, the
    /// view and the frame; empty for panels without light.
    pub options: Vec<String>,
    /// Linear brightness, row by row from the top; `None` if the sheet was interrupted before.
    pub pixels: Option<Vec<Rgb>>,
}

/// A rendered sheet.
#[derive(Debug, Clone)]
pub struct Sheet {
    /// Positions of the pixels of each panel in the test section.
    pub framing: Framing,
    /// The panels, in the order of the sheet.
    pub panels: Vec<Panel>,
    /// The map of the light: deflection, displacement, phase and transmission at the pixels'
    /// centres.
    pub map: Map,
    /// The map of the rays of BOS; `None` if the sheet was interrupted before.
    pub background_map: Option<Map>,
    /// The numbers of the benches.
    pub bench: PanelBench,
    /// The report.
    pub report: Report,
    /// Whether the sheet was interrupted, so that panels are missing.
    pub interrupted: bool,
}

/// Renders the panels of a sheet. The scene's technique and film are not read, apart from the
/// frame; its first wavelength is that of the light.
///
/// When `control` cancels while the rays of BOS are traced, the panels that are finished are
/// returned.
///
/// # Errors
/// As [`crate::render::render`]; [`RenderError::Cancelled`] before any panel is finished.
pub fn render_sheet(
    scene: &Scene,
    section: &TestSection,
    control: &Control<'_>,
) -> Result<Sheet, RenderError> {
    let scene = Scene {
        technique: TechniqueSpec::default(),
        sampling: None,
        light: crate::scene::LightSpec {
            wavelengths_nm: scene.light.wavelengths_nm[..1].to_vec(),
            ..Default::default()
        },
        ..scene.clone()
    };
    scene.check()?;
    let frame = framing(&scene, section);
    let margin = margin_px(&frame);
    let wide =
        Framing { width: frame.width + 2 * margin, height: frame.height + 2 * margin, ..frame };
    let mut report = Report {
        effects: Effects { phase: true, ..Effects::required_by(&scene) },
        pixel_m: frame.pixel_m,
        warnings: section.warnings.clone(),
        ..Report::default()
    };

    // The light, once for all techniques that follow it.
    let planned = section.paths(&scene, 0, PathQuantities { opd: true }, false, true)?;
    report.add_plan(&planned);
    let part = |done: f64| (control.progress)(LIGHT_PART * done);
    let exits = traced(&*planned.paths, section, &wide, control, &part)?;
    report.counters.rays += exits.len() as u64;
    report.counters.phase_rays += exits.len() as u64;
    let bench = PanelBench::chosen(&wide, margin, &exits, section.depth_m());
    let (mut panels, map) =
        panels::of_light(&scene, section, &bench, &wide, margin, exits, &planned)?;
    report.largest_deflection_rad = Some(map.largest_deflection_rad);
    if map.dark == map.transmission.len() {
        report.warnings.push(NO_LIGHT.into());
    }

    // The rays from the camera to a background, for BOS.
    let back = panels::scene_of_bos(&scene, &bench);
    let against = section.paths(&back, 0, PathQuantities::default(), true, false)?;
    let part = |done: f64| (control.progress)(LIGHT_PART + (1.0 - LIGHT_PART) * done);
    let (background_map, interrupted) =
        match traced(&*against.paths, section, &frame, control, &part) {
            Ok(exits) => {
                report.counters.rays += exits.len() as u64;
                (Some(panels::of_background(&back, &bench, &frame, &exits, &mut panels)), false)
            }
            Err(RenderError::Cancelled) => {
                panels::without_background(&bench, &mut panels);
                (None, true)
            }
            Err(other) => return Err(other),
        };
    let levels = panels.iter().filter_map(|p| p.pixels.as_ref()).flatten().flatten();
    report.levels =
        levels.fold([f32::INFINITY, f32::NEG_INFINITY], |[l, h], v| [l.min(*v), h.max(*v)]);
    Ok(Sheet { framing: frame, panels, map, background_map, bench, report, interrupted })
}

fn margin_px(frame: &Framing) -> u32 {
    ((f64::from(frame.width.max(frame.height)) * MARGIN).ceil() as u32).max(2)
}

/// Traces the rays through the corners of all pixels. Rays that meet a body are blocked.
fn traced(
    paths: &dyn LightPaths,
    section: &TestSection,
    frame: &Framing,
    control: &Control<'_>,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Vec<Exit>, RenderError> {
    let starts: Vec<Start> = (0..corners(frame)).map(|k| start_of_corner(frame, k)).collect();
    let mut exits = vec![Exit::UNDISTURBED; starts.len()];
    let done = AtomicUsize::new(0);
    let count = starts.len() as f64;
    let add = |rays: usize| {
        progress((done.fetch_add(rays, Ordering::Relaxed) + rays) as f64 / count);
    };
    if !trace_parallel_unless_cancelled(paths, &starts, &mut exits, control.cancel, &add) {
        return Err(RenderError::Cancelled);
    }
    if let Some(bodies) = &section.solids {
        let view = paths.view();
        exits.par_iter_mut().zip(&starts).for_each(|(exit, start)| {
            if bodies.block(view, start) {
                *exit = Exit { transmission: 0.0, status: Status::Blocked, ..Exit::UNDISTURBED };
            }
        });
    }
    Ok(exits)
}
