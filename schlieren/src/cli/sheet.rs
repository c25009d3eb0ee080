//! Implements `schlieren sheet`: one flow by all techniques, in one labelled picture.

use super::flow_args::FlowArgs;
use super::march_args::{FrameArgs, MarchArgs, ViewArgs};
use super::words::in_options;
use crate::drawing::Canvas;
use crate::output;
use crate::render::{Control, RenderError, TestSection};
use crate::scene::Scene;
use crate::sheet::{PANEL_SIDE, compose, refusal, render_sheet, scene_of_sheet, title};
use clap::Args;
use datasets::cli::{Cancel, CommonArgs, Interrupted, UsageError};
use serde_json::json;
use std::path::PathBuf;
use std::time::Instant;

/// Options of `schlieren sheet`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  schlieren sheet flow.vti --density rho -o sheet.png
  schlieren sheet flow.vtu --density rho --view y --exr panels.exr --json

Light is traced once for all techniques. The bench of each panel is chosen so that the panel shows
the flow; its numbers stand below it, and --json has the options of `schlieren render` for each.
Ctrl-C keeps the panels that are finished.")]
pub(super) struct SheetArgs {
    /// The flow, as for `schlieren render`
    file: Option<PathBuf>,
    /// The sheet as PNG
    #[arg(long, short, value_name = "PNG")]
    out: Option<PathBuf>,
    /// The panels as layers of an OpenEXR file, with deflection, displacements and phase
    #[arg(long, value_name = "EXR")]
    exr: Option<PathBuf>,
    /// Panels in a row
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=12))]
    columns: u32,
    /// A scene as TOML whose flow, view, bodies and march are taken; options change it
    #[arg(long, value_name = "TOML")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    flow: FlowArgs,
    #[command(flatten)]
    view: ViewArgs,
    /// Width and height of each panel [default: 320 pixels for the longer side of the flow]
    #[command(flatten)]
    frame: FrameArgs,
    #[command(flatten)]
    march: MarchArgs,
}

impl SheetArgs {
    fn scene(&self) -> anyhow::Result<Scene> {
        let from = match &self.scene {
            Some(path) => Scene::open(path)?,
            None => Scene::default(),
        };
        let mut s = scene_of_sheet(from);
        if let Some(file) = &self.file {
            s.flow.file.clone_from(file);
        }
        if s.flow.file.as_os_str().is_empty() {
            return Err(UsageError("no flow: give a file, or a scene that names one".into()).into());
        }
        self.flow.apply(&mut s)?;
        self.view.apply(&mut s);
        self.frame.apply(&mut s);
        self.march.apply(&mut s)?;
        let cure = "give --wavelength one, or use `schlieren render`";
        if let Some(text) = refusal(&s, cure) {
            return Err(UsageError(text).into());
        }
        s.check().map_err(|e| match self.scene {
            None => UsageError(e.to_string()).into(),
            Some(_) => anyhow::Error::from(e),
        })?;
        Ok(s)
    }
}

pub(super) fn sheet(common: CommonArgs, args: &SheetArgs) -> anyhow::Result<()> {
    let cancel = Cancel::on_ctrl_c()?;
    for (path, ending, flag) in [(&args.out, "png", "-o"), (&args.exr, "exr", "--exr")] {
        let wrong = |p: &&PathBuf| !p.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending));
        if let Some(path) = path.as_ref().filter(wrong) {
            let text = format!("{flag} `{}` does not end in .{ending}", path.display());
            return Err(UsageError(text).into());
        }
    }
    if args.out.is_none() && args.exr.is_none() {
        return Err(UsageError("no output: give -o PNG or --exr EXR".into()).into());
    }
    let mut scene = args.scene()?;
    let start = Instant::now();
    let section = TestSection::open(&scene, |what| common.note(0, what))?;
    cancel.check()?;
    if args.frame.size.is_none() {
        let [w, h] = section.sides_m();
        let pixels = |side: f64| ((PANEL_SIDE * side / w.max(h)).round() as u32).max(48);
        scene.film.size = [pixels(w), pixels(h)];
    }

    let bar = common.progress(1000, "sheet");
    let progress = |part: f64| bar.set_position((1000.0 * part) as u64);
    let control = Control { cancel: cancel.flag(), progress: &progress };
    let sheet = match render_sheet(&scene, &section, &control) {
        Err(RenderError::Cancelled) => return Err(Interrupted.into()),
        other => other?,
    };
    drop(bar);
    let elapsed_secs = start.elapsed().as_secs_f64();
    let title = title(&scene, &sheet);
    if let Some(path) = &args.out {
        let canvas: Canvas = compose(&sheet, &title, args.columns as usize);
        output::write_canvas(path, &canvas)?;
    }
    if let Some(path) = &args.exr {
        output::write_sheet_exr(path, &sheet, &scene, elapsed_secs)?;
    }
    for w in &sheet.report.warnings {
        common.warn(in_options(w));
    }
    let r = &sheet.report;
    let panels: Vec<_> = sheet
        .panels
        .iter()
        .map(|p| json!({ "name": p.name, "labels": p.labels, "options": p.options, "finished": p.pixels.is_some() }))
        .collect();
    let json = json!({
        "file": scene.flow.file,
        "size": scene.film.size,
        "pixel_m": r.pixel_m,
        "panels": panels,
        "bench": sheet.bench,
        "counters": r.counters,
        "march": r.march,
        "tolerance_rad": scene.march.tolerance_rad,
        "deflection_error_rad": r.deflection_error_rad,
        "resolution_error_rad": r.resolution_error_rad,
        "mesh_error_rad": r.mesh_error_rad,
        "largest_deflection_rad": r.largest_deflection_rad,
        "outside": section.input.as_ref().and_then(|i| i.outside.clone()),
        "interrupted": sheet.interrupted,
        "seconds": elapsed_secs,
        "warnings": r.warnings,
        "output": args.out,
        "exr": args.exr,
    });
    let finished = sheet.panels.iter().filter(|p| p.pixels.is_some()).count();
    common.result(&json, || {
        let names: Vec<String> =
            [&args.out, &args.exr].into_iter().flatten().map(|p| p.display().to_string()).collect();
        format!(
            "{}: {finished} panels of {} rays, deflections up to {:.3e} rad; {elapsed_secs:.2} s",
            names.join(", "),
            r.counters.rays,
            r.largest_deflection_rad.unwrap_or(0.0),
        )
    })?;
    if sheet.interrupted { Err(Interrupted.into()) } else { Ok(()) }
}
