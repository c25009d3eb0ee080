//! Implements `schlieren render`: renders one image of a flow.

use super::scene_args::SceneArgs;
use super::words::in_options;
use crate::drawing::{Canvas, Overlay, draw_overlay};
use crate::output;
use crate::render::{Control, Layers, RenderError, RenderOutput, TestSection};
use crate::scene::{Scene, TechniqueSpec};
use clap::Args;
use datasets::cli::{Cancel, CommonArgs, Interrupted, UsageError};
use serde_json::{Value, json};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Options of `schlieren render`.
#[derive(Debug, Args)]
pub(super) struct RenderArgs {
    /// The flow: VTK (.vti .vtr .vts .vtu, parallel, .pvd, .series, legacy, .vtkhdf), PLOT3D,
    /// NetCDF (.nc), XDMF, Exodus II, CGNS (.cgns), Tecplot (.tec .plt .dat), EnSight (.case),
    /// NRRD, MetaImage, NumPy (.npy .npz), raw, a table of points (.csv .tsv .txt), or the folder
    /// of an AMReX plotfile, of an OpenFOAM case or of one of its times. FILE/TIME is a time of a
    /// file with several. Two-dimensional data need --span or --revolve
    file: Option<PathBuf>,
    /// Image as PNG
    #[arg(long, short, value_name = "PNG")]
    out: Option<PathBuf>,
    /// Image as OpenEXR: colour, deflection, displacement, phase, transmission, samples, error,
    /// absorption, emission and rotation of the medium, and every parameter
    #[arg(long, value_name = "EXR")]
    exr: Option<PathBuf>,
    /// Deflection map as NumPy array (height, width, 2) in rad
    #[arg(long, value_name = "NPY")]
    npy: Option<PathBuf>,
    /// With --technique bos: the background without the flow as PNG, for programs that correlate
    /// the two images
    #[arg(long, value_name = "PNG")]
    reference: Option<PathBuf>,
    /// Displacement as NumPy array (height, width, 2) in m of the test section, along right and up:
    /// with --technique bos that of the background's dots, as correlating the two pictures gives it
    #[arg(long, value_name = "NPY")]
    displacement: Option<PathBuf>,
    /// Draw vectors on the PNG, with a scale: arrows (over the picture) or lic (lines along them),
    /// of the deflection or the displacement [default: bos: displacement; else: deflection]
    #[arg(long, value_name = "arrows|lic[:deflection|:displacement]")]
    overlay: Option<Overlay>,
    /// Print the effective scene as TOML; render only if an output is given
    #[arg(long)]
    print_scene: bool,
    #[command(flatten)]
    scene: SceneArgs,
}

pub(super) fn render(common: CommonArgs, args: &RenderArgs) -> anyhow::Result<()> {
    let cancel = Cancel::on_ctrl_c()?;
    let mut outputs = Outputs::new(args.out.as_deref(), args.exr.as_deref(), args.npy.as_deref())?;
    let scene = args.scene.scene(args.file.as_deref())?;
    if let Some(path) = &args.reference {
        outputs.reference = Some(reference_path(path, &scene)?);
    }
    if let Some(path) = &args.displacement {
        check_ending("--displacement", path, "npy")?;
        outputs.displacement = Some(path);
    }
    if args.overlay.is_some() && outputs.png.is_none() {
        return Err(UsageError("--overlay draws on the PNG; give -o PNG".into()).into());
    }
    outputs.overlay = args.overlay;
    if args.print_scene {
        std::io::stdout().lock().write_all(scene.effective().to_toml()?.as_bytes())?;
    }
    if outputs.is_empty() {
        if args.print_scene {
            return Ok(());
        }
        return Err(UsageError("no output: give -o PNG, --exr EXR or --npy NPY".into()).into());
    }
    let summary = render_and_write(common, cancel, &scene, &outputs)?;
    if args.print_scene && !common.json {
        return Ok(());
    }
    common.result(&summary.json, || &summary.text)
}

/// The files to write.
#[derive(Debug, Clone, Copy)]
pub(super) struct Outputs<'a> {
    png: Option<&'a Path>,
    exr: Option<&'a Path>,
    npy: Option<&'a Path>,
    /// The background without the flow.
    reference: Option<&'a Path>,
    displacement: Option<&'a Path>,
    /// What is drawn on the PNG.
    overlay: Option<Overlay>,
}

/// Checks that the scene has a background, and the name of its file.
fn reference_path<'p>(path: &'p Path, scene: &Scene) -> Result<&'p Path, UsageError> {
    if !matches!(scene.technique, TechniqueSpec::Bos { .. }) {
        return Err(UsageError(format!(
            "--reference is the background of --technique bos; {} has none",
            scene.technique.name()
        )));
    }
    check_ending("--reference", path, "png")?;
    Ok(path)
}

fn check_ending(flag: &str, path: &Path, ending: &str) -> Result<(), UsageError> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending)) {
        return Ok(());
    }
    Err(UsageError(format!("{flag} `{}` does not end in .{ending}", path.display())))
}

impl<'a> Outputs<'a> {
    /// Checks the file names before time is spent on an image that cannot be written.
    pub(super) fn new(
        png: Option<&'a Path>,
        exr: Option<&'a Path>,
        npy: Option<&'a Path>,
    ) -> Result<Self, UsageError> {
        for (path, ending, flag) in
            [(png, "png", "-o"), (exr, "exr", "--exr"), (npy, "npy", "--npy")]
        {
            path.map_or(Ok(()), |p| check_ending(flag, p, ending))?;
        }
        Ok(Outputs { png, exr, npy, reference: None, displacement: None, overlay: None })
    }

    pub(super) fn is_empty(&self) -> bool {
        self.files().iter().all(Option::is_none)
    }

    fn files(&self) -> [Option<&'a Path>; 5] {
        [self.png, self.exr, self.npy, self.reference, self.displacement]
    }

    fn names(&self) -> String {
        let names = self.files().into_iter().flatten().map(|p| p.display().to_string());
        names.collect::<Vec<_>>().join(", ")
    }
}

/// Summary of a written image, as text and as JSON.
pub(super) struct RenderSummary {
    pub(super) json: Value,
    pub(super) text: String,
}

/// Reads the flow, renders it and writes the files.
fn render_and_write(
    common: CommonArgs,
    cancel: Cancel,
    scene: &Scene,
    outputs: &Outputs<'_>,
) -> anyhow::Result<RenderSummary> {
    let start = Instant::now();
    let mut section = TestSection::open(scene, |what| common.note(0, what))?;
    let read_secs = start.elapsed().as_secs_f64();
    draw_and_write(common, cancel, (scene, &mut section, read_secs), outputs)
}

/// Renders a flow for which an image has waited `read_secs`, and writes the files.
pub(super) fn draw_and_write(
    common: CommonArgs,
    cancel: Cancel,
    (scene, section, read_secs): (&Scene, &mut TestSection, f64),
    outputs: &Outputs<'_>,
) -> anyhow::Result<RenderSummary> {
    let start = Instant::now();
    cancel.check()?;

    let layers = Layers {
        map: outputs.exr.is_some()
            || outputs.npy.is_some()
            || outputs.displacement.is_some()
            || outputs.overlay.is_some()
            || common.json,
        phase: outputs.exr.is_some(),
        counts: outputs.exr.is_some(),
        noise: outputs.exr.is_some(),
        accuracy: true,
    };
    let bar = common.progress(1000, scene.technique.name());
    let rendered = {
        let progress = |part: f64| bar.set_position((1000.0 * part) as u64);
        let control = Control { cancel: cancel.flag(), progress: &progress };
        match crate::render::render(scene, section, layers, &control) {
            Err(RenderError::Cancelled) => return Err(Interrupted.into()),
            other => other?,
        }
    };
    drop(bar);
    let render_secs = start.elapsed().as_secs_f64();
    if let Some(path) = outputs.reference {
        let flow = section.take_flow()?;
        let control = Control { cancel: cancel.flag(), ..Control::default() };
        let background = crate::render::render(scene, section, Layers::NONE, &control);
        (section.fields, section.cells) = flow;
        match background {
            Err(RenderError::Cancelled) => return Err(Interrupted.into()),
            other => output::write_png(path, &other?)?,
        };
    }
    let elapsed_secs = read_secs + start.elapsed().as_secs_f64();
    let overlay_scale = write(outputs, scene, &rendered, elapsed_secs)?;
    for w in &rendered.report.warnings {
        common.warn(in_options(w));
    }
    let r = &rendered.report;
    let json = json!({
        "file": scene.flow.file,
        "technique": scene.technique.name(),
        "size": scene.film.size,
        "pixel_m": r.pixel_m,
        "grid": section.grid(),
        "cells": cells_json(section, &rendered),
        "n0_minus_1": section.input.as_ref().map(|i| i.reference_n_minus_1),
        "index_formula": section.input.as_ref().map(|i| i.formula),
        "march": r.march,
        "tolerance_rad": scene.march.tolerance_rad,
        "deflection_error_rad": r.deflection_error_rad,
        "resolution_error_rad": r.resolution_error_rad,
        "mesh_error_rad": r.mesh_error_rad,
        "left_out": r.skip_report,
        "largest_deflection_rad": r.largest_deflection_rad,
        "levels": r.levels,
        "effects": r.effects,
        "counters": r.counters,
        "photons": r.tally,
        "device": r.device,
        "margin_px": r.margin_px,
        "silhouette_error_px": r.silhouette_error_px,
        "seconds": { "read": read_secs, "render": render_secs },
        "warnings": r.warnings,
        "output": outputs.png,
        "exr": outputs.exr,
        "npy": outputs.npy,
        "reference": outputs.reference,
        "displacement": outputs.displacement,
        "overlay": outputs.overlay.map(|o| json!({ "style": o.style, "scale": overlay_scale })),
        "outside": section.input.as_ref().and_then(|i| i.outside.clone()),
        "jumps": section.input.as_ref().and_then(|i| i.jumps).map(|j| j.jumps),
    });
    let deflection = r
        .largest_deflection_rad
        .map_or(String::new(), |d| format!(", deflections up to {d:.3e} rad"));
    let crossed = r.cells.map_or(String::new(), |c| {
        format!(" through {:.0} cells each", c.cells_crossed as f64 / c.rays.max(1) as f64)
    });
    let text = format!(
        "{}: {}{deflection}; {} rays{crossed}; read {read_secs:.2} s, render {render_secs:.2} s",
        outputs.names(),
        described(scene),
        r.counters.rays + r.counters.map_rays,
    );
    Ok(RenderSummary { json, text })
}

/// The cells and the work on them; null on a lattice.
fn cells_json(section: &TestSection, rendered: &RenderOutput) -> Value {
    let Some(of) = section.input.as_ref().and_then(|i| i.cells.as_ref()) else {
        return Value::Null;
    };
    json!({
        "cells": of.cells,
        "hidden": of.hidden,
        "without_value": of.without_value,
        "left_out": of.left_out,
        "folded": of.folded,
        "border_faces": of.border_faces,
        "fitted_points": of.fit.fitted,
        "limited_points": of.fit.limited,
        "work": rendered.report.cells,
    })
}

fn described(scene: &Scene) -> String {
    match &scene.technique {
        TechniqueSpec::Schlieren { cutoff } => format!("schlieren, {}", cutoff.name()),
        other => other.name().to_string(),
    }
}

fn write(
    outputs: &Outputs<'_>,
    scene: &Scene,
    rendered: &RenderOutput,
    elapsed_secs: f64,
) -> anyhow::Result<Option<f64>> {
    let mut scale = None;
    match (outputs.png, outputs.overlay, &rendered.map) {
        (Some(path), Some(overlay), Some(map)) => {
            let [width, height] = scene.film.size.map(|n| n as usize);
            let mut canvas = Canvas { width, height, pixels: rendered.pixels.clone() };
            scale = Some(draw_overlay(&mut canvas, map, overlay));
            output::write_canvas(path, &canvas)?;
        }
        (Some(path), ..) => {
            output::write_png(path, rendered)?;
        }
        _ => {}
    }
    if let Some(path) = outputs.displacement {
        output::write_displacement(path, rendered)?;
    }
    if let Some(path) = outputs.exr {
        output::write_exr(path, rendered, scene, elapsed_secs)?;
    }
    if let Some(path) = outputs.npy {
        output::write_npy(path, rendered)?;
    }
    Ok(scale)
}
