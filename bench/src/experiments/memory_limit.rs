//! Frames of a stored mesh by a program that may hold a quarter of the file: a control group limits
//! all of its memory, the pages of the file that the system keeps for it included.
//! [`super::stored_files`] limits what the program keeps by itself.

use super::Context;
use crate::control_group::ControlGroup;
use crate::record::{Record, Row};
use crate::runner::{Ratio, VERDICT_ROUNDS, order};
use crate::stats::Summary;
use crate::stored_data::store_wavelet;
use anyhow::Context as _;
use datasets::catalogue;
use datasets::view::View;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Passes over the image of one program: a sample a pixel each, the first of which reads most.
const PASSES: u32 = 16;
/// Parts of the file's size that the program may hold.
const QUARTER: u64 = 4;
/// What a program takes at least: its code, the image, and the tree over the pages.
const LEAST: u64 = 128 << 20;

/// Bytes for triangles that wait to be stored.
const STORING: usize = 2 << 30;

/// What limits the program.
const LIMITED: &str = "a quarter of the file";
const UNLIMITED: &str = "none";

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("triangles", "", "triangles of the wavelet surfaces");
    record.column("file", "MB", "size of the file");
    record.column("view", "", "view of the data set");
    record.column("limit", "", "memory that the program may hold");
    record.column("limit_bytes", "MB", "the same in bytes; empty: that of the machine");
    record.column("peak", "MB", "the most that the limited programs held, pages of files included");
    record.column("time", "ms", "median over the rounds: the program's rendering by its passes");
    record.column("time_low", "ms", "fastest round");
    record.column("time_high", "ms", "slowest round");
    record.column("reads", "", "pages of the mesh that the program read, in the last round");
    record.column("differs", "", "rounds whose image is not that of the first without a limit");
    let (millions, pixels, rounds) = match (context.quick, context.thesis) {
        (true, _) => (2, 256, 2),
        (false, false) => (64, 1024, VERDICT_ROUNDS),
        (false, true) => (256, 1024, VERDICT_ROUNDS),
    };
    record.notes.push(format!(
        "`bench render` of a stored mesh, {pixels} x {pixels} pixels and {PASSES} samples a pixel, \
         headlight, with and without a limit in turns. It chooses by itself how many bytes of \
         pages it keeps. The limit counts what the system keeps of the file too, and before each \
         limited program the system is told to keep none of it. Its time is that of rendering, \
         with the reading, divided by the samples."
    ));
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("wavelet.rtmesh");
    let stored = store_wavelet(&file, millions, STORING, &mut |surface| {
        context.report_share(format!("storing {}", surface.label), 0.7 * surface.share)
    })?;
    let (triangles, bytes) = (stored.triangles, stored.bytes);
    let limit = (bytes / QUARTER).max(LEAST);
    if limit > bytes / QUARTER {
        record.missing.push(format!(
            "a limit of a quarter of this file, which a program does not start in; it is {} MB",
            LEAST >> 20
        ));
    }
    let group = ControlGroup::with_memory(limit);
    if let Err(why) = &group {
        record.missing.push(format!("frames with limited memory: {why}"));
    }
    let group = group.ok();
    for view in catalogue::find("wavelet")?.views() {
        context.part(record, &view.name, |context, record| {
            let scene = Scene { file: &file, camera: camera(folder.path(), &view)?, pixels };
            let mut frames = [Frames::default(), Frames::default()];
            for round in 0..rounds {
                context.report_step(format!("{}, round {} of {rounds}", view.name, round + 1))?;
                for which in order(if group.is_some() { 2 } else { 1 }, round) {
                    let group = group.as_ref().filter(|_| which == 1);
                    frames[which].add(scene.draw(group)?);
                }
            }
            let [free, limited] = &frames;
            let first = free.images.first().cloned().unwrap_or_default();
            for (frames, name) in [(free, UNLIMITED), (limited, LIMITED)] {
                let Some(time) = Summary::of(&frames.secs) else { continue };
                let mut row = Row::new()
                    .with("triangles", triangles)
                    .with("file", bytes as f64 / 1e6)
                    .with("view", view.name.as_str())
                    .with("limit", name);
                if name == LIMITED {
                    row = row.with("limit_bytes", limit as f64 / 1e6);
                    let peak = group.as_ref().and_then(ControlGroup::peak_bytes);
                    row = row.with("peak", peak.map(|bytes| bytes as f64 / 1e6));
                }
                let ms = 1e3 / f64::from(PASSES);
                record.rows.push(
                    row.with("time", time.median * ms)
                        .with("time_low", time.low * ms)
                        .with("time_high", time.high * ms)
                        .with("reads", frames.reads)
                        .with("differs", frames.images.iter().filter(|i| **i != first).count()),
                );
            }
            let per_round: Vec<f64> =
                free.secs.iter().zip(&limited.secs).map(|(f, l)| f / l).collect();
            let name = format!("{}: memory for {LIMITED}", view.name);
            record.ratios.extend(Ratio::of_rounds(name, "without a limit", &per_round));
            Ok(())
        })?;
    }
    Ok(())
}

/// Writes the view as a camera for `bench render`.
fn camera(folder: &Path, view: &View) -> anyhow::Result<PathBuf> {
    let path = folder.join(format!("{}.json", view.name));
    let text = serde_json::json!({
        "eye": view.eye.to_array(),
        "target": view.target.to_array(),
        "up": view.up.to_array(),
        "vertical_fov_degrees": view.vertical_fov_degrees,
    });
    std::fs::write(&path, text.to_string())?;
    Ok(path)
}

/// Rounds of one program.
#[derive(Default)]
struct Frames {
    secs: Vec<f64>,
    images: Vec<Vec<u8>>,
    reads: u64,
}

impl Frames {
    fn add(&mut self, drawn: Drawn) {
        self.secs.push(drawn.secs);
        self.images.push(drawn.image);
        self.reads = drawn.reads;
    }
}

struct Drawn {
    secs: f64,
    image: Vec<u8>,
    reads: u64,
}

struct Scene<'a> {
    file: &'a Path,
    camera: PathBuf,
    pixels: u32,
}

impl Scene<'_> {
    fn draw(&self, group: Option<&ControlGroup>) -> anyhow::Result<Drawn> {
        let this = std::env::current_exe()?;
        let mut command = match group {
            Some(group) => {
                forget(self.file)?;
                group.command(&this)
            }
            None => Command::new(&this),
        };
        let png = self.file.with_extension("png");
        command.arg("render").arg(self.file).arg("-o").arg(&png);
        command.arg("--camera").arg(&self.camera);
        command.args(["--size", &format!("{0}x{0}", self.pixels)]);
        command.args(["--samples", &PASSES.to_string(), "--json", "--quiet"]);
        let output = command.stdin(Stdio::null()).output()?;
        let said = || {
            let [out, err] = [&output.stdout, &output.stderr].map(|b| String::from_utf8_lossy(b));
            format!("bench render: {}: {out}{err}", output.status)
        };
        anyhow::ensure!(output.status.success(), said());
        let object: Value = serde_json::from_slice(&output.stdout).with_context(said)?;
        let secs = object["seconds"]["render"].as_f64().with_context(said)?;
        let reads = object["stored"]["page_reads"].as_u64().with_context(said)?;
        Ok(Drawn { secs, image: std::fs::read(&png)?, reads })
    }
}

/// Tells the system that the file's pages are not needed: those that another program has read
/// would be free of charge for the limited one.
fn forget(file: &Path) -> anyhow::Result<()> {
    let open = std::fs::File::open(file)?;
    open.sync_all()?;
    rustix::fs::fadvise(&open, 0, None, rustix::fs::Advice::DontNeed)?;
    Ok(())
}
