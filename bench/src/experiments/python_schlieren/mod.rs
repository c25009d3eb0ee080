//! The same photograph from Python, of a numpy array, and by the program, of the array's file. The
//! processes take turns, and their results are compared bit for bit.

use super::Context;
use super::python_process;
use crate::record::{Record, Row};
use crate::runner::{Ratio, VERDICT_ROUNDS};
use crate::stats::Summary;
use anyhow::Context as _;
use serde::Deserialize;
use serde_json::json;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

const SCRIPT: &str = include_str!("photograph.py");
/// In the order of their turns.
const TRACERS: [&str; 2] = ["the program", "from Python"];

/// What both print.
#[derive(Deserialize)]
struct Printed {
    seconds: Parts,
}

/// Seconds of the parts of a run.
#[derive(Deserialize)]
struct Parts {
    #[serde(default)]
    import: f64,
    read: f64,
    render: f64,
}

/// One run.
struct Run {
    parts: Parts,
    /// From the start of the process to its end.
    process: f64,
}

/// What to photograph, and where things go.
struct Subject {
    nodes: usize,
    pixels: u32,
    flow: PathBuf,
    folder: PathBuf,
}

/// Size of the lattice, m.
const WIDTH_M: f64 = 0.1;
const TOLERANCE_RAD: f64 = 1e-7;

impl Subject {
    fn spacing(&self) -> f64 {
        WIDTH_M / (self.nodes - 1) as f64
    }

    fn image(&self, tracer: &str) -> PathBuf {
        self.folder.join(format!("{tracer}.png"))
    }

    fn map(&self, tracer: &str) -> PathBuf {
        self.folder.join(format!("{tracer}.npy"))
    }
}

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("tracer", "", "the program `schlieren`, or the Python package of the same name");
    record.column("nodes", "", "nodes of the lattice along each axis");
    record.column("pixels", "", "width and height of the image");
    record.column("render", "s", "the image and the deflection map, median over the rounds");
    record.column("render_low", "s", "fastest round");
    record.column("render_high", "s", "slowest round");
    record.column("read", "s", "reading the array from its file, and making a flow of it");
    record.column("import", "s", "importing numpy and the package");
    record.column("process", "s", "from the start of the process to its end, files written");
    record.notes.push(format!(
        "A warm ball in air, density in float32 on a lattice of {WIDTH_M} m; schlieren with a \
         knife edge, tolerance {TOLERANCE_RAD:e} rad, image and deflection map. Wall time, all \
         threads."
    ));
    let python = crate::opengl::find("RTSV_SCHLIEREN_PYTHON", "target/wheels/schlieren/bin/python");
    let beside = std::env::current_exe().ok().map(|p| p.with_file_name("schlieren"));
    let program = std::env::var_os("RTSV_SCHLIEREN_PROGRAM").map(PathBuf::from).or(beside);
    let program = program.filter(|p| p.is_file());
    if python.is_none() {
        record.missing.push(
            "a Python with schlieren: run `cargo xtask wheels`, or name one in \
             RTSV_SCHLIEREN_PYTHON"
                .to_owned(),
        );
    }
    if program.is_none() {
        record.missing.push(
            "the program `schlieren` beside this one: build it with the same profile, or name it \
             in RTSV_SCHLIEREN_PROGRAM"
                .to_owned(),
        );
    }
    let (Some(python), Some(program)) = (python, program) else { return Ok(()) };
    let (nodes, pixels, rounds) =
        if context.quick { (65, 128, 1) } else { (256, 512, VERDICT_ROUNDS) };
    let folder = tempfile::tempdir()?;
    let flow = folder.path().join("flow.npy");
    write_ball(&flow, nodes)?;
    let subject = Subject { nodes, pixels, flow, folder: folder.path().to_owned() };
    let mut runs: [Vec<Run>; 2] = Default::default();
    for round in 0..rounds {
        for turn in 0..TRACERS.len() {
            let i = (round + turn) % TRACERS.len();
            context.report_step(format!("{}, round {}", TRACERS[i], round + 1))?;
            runs[i].push(match i {
                0 => by_program(&program, &subject)?,
                _ => from_python(&python, &subject)?,
            });
        }
    }
    let same = |path: &dyn Fn(&str) -> PathBuf| -> anyhow::Result<bool> {
        let [a, b] = TRACERS.map(|t| std::fs::read(path(t)).context(t));
        Ok(a? == b?)
    };
    let (images, maps) = (same(&|t| subject.image(t))?, same(&|t| subject.map(t))?);
    anyhow::ensure!(images && maps, "the program and Python differ: images {images}, maps {maps}");
    record.notes.push("Images and deflection maps of both have the same bytes.".into());
    for (tracer, runs) in TRACERS.iter().zip(&runs) {
        record.rows.extend(row(&subject, tracer, runs));
    }
    let ratios = |part: fn(&Run) -> f64| {
        let pairs = runs[0].iter().zip(&runs[1]);
        pairs.map(|(program, python)| part(program) / part(python)).collect::<Vec<f64>>()
    };
    let rendering = ratios(|r| r.parts.render);
    let reading_too = ratios(|r| r.parts.read + r.parts.render);
    let process = ratios(|r| r.process);
    for (name, rounds) in
        [("render", rendering), ("read and render", reading_too), ("whole process", process)]
    {
        record.ratios.extend(Ratio::of_rounds(name, TRACERS[0], &rounds));
    }
    Ok(())
}

fn by_program(program: &Path, subject: &Subject) -> anyhow::Result<Run> {
    let tracer = TRACERS[0];
    let size = format!("{0}x{0}", subject.pixels);
    let spacing = [subject.spacing().to_string().as_str(); 3].join(",");
    let start = Instant::now();
    let output = Command::new(program)
        .arg("render")
        .arg(&subject.flow)
        .args(["--density", "flow", "--spacing", &spacing, "--size", &size])
        .args(["--tolerance", &TOLERANCE_RAD.to_string(), "--quiet", "--json", "-o"])
        .arg(subject.image(tracer))
        .arg("--npy")
        .arg(subject.map(tracer))
        .stdin(Stdio::null())
        .output()
        .with_context(|| program.display().to_string())?;
    let process = start.elapsed().as_secs_f64();
    let said = String::from_utf8_lossy(&output.stderr);
    anyhow::ensure!(output.status.success(), "{}: {}: {said}", program.display(), output.status);
    let printed: Printed = serde_json::from_slice(&output.stdout)?;
    Ok(Run { parts: printed.seconds, process })
}

fn from_python(python: &Path, subject: &Subject) -> anyhow::Result<Run> {
    let tracer = TRACERS[1];
    let order = json!({
        "flow": subject.flow,
        "spacing": subject.spacing(),
        "size": subject.pixels,
        "tolerance": TOLERANCE_RAD,
        "image": subject.image(tracer),
        "map": subject.map(tracer),
    });
    let start = Instant::now();
    let printed: Printed = python_process::run(python, SCRIPT, &order)?;
    Ok(Run { parts: printed.seconds, process: start.elapsed().as_secs_f64() })
}

fn row(subject: &Subject, tracer: &str, runs: &[Run]) -> Option<Row> {
    let summary =
        |of: &dyn Fn(&Run) -> f64| Summary::of(&runs.iter().map(of).collect::<Vec<f64>>());
    let render = summary(&|r| r.parts.render)?;
    Some(
        Row::new()
            .with("tracer", tracer)
            .with("nodes", subject.nodes)
            .with("pixels", subject.pixels)
            .with("render", render.median)
            .with("render_low", render.low)
            .with("render_high", render.high)
            .with("read", summary(&|r| r.parts.read)?.median)
            .with("import", summary(&|r| r.parts.import)?.median)
            .with("process", summary(&|r| r.process)?.median),
    )
}

/// Writes the density of air with a warm ball, kg/m³, as a numpy file in C order.
fn write_ball(path: &Path, nodes: usize) -> anyhow::Result<()> {
    let file = std::fs::File::create(path).with_context(|| path.display().to_string())?;
    let mut file = std::io::BufWriter::new(file);
    let mut header = format!(
        "{{'descr': '<f4', 'fortran_order': False, 'shape': ({nodes}, {nodes}, {nodes}), }}"
    );
    // The header ends with a line break, at a multiple of 64 bytes with the ten before it.
    let padding = (64 - (10 + header.len() + 1) % 64) % 64;
    header.extend(std::iter::repeat_n(' ', padding));
    header.push('\n');
    file.write_all(b"\x93NUMPY\x01\x00")?;
    file.write_all(&u16::try_from(header.len())?.to_le_bytes())?;
    file.write_all(header.as_bytes())?;
    let at = |i: usize| 2.0 * i as f64 / (nodes - 1) as f64 - 1.0;
    for i in 0..nodes {
        for j in 0..nodes {
            for k in 0..nodes {
                let squared = at(i).powi(2) + at(j).powi(2) + at(k).powi(2);
                let density = 1.2 - 0.05 * (-8.0 * squared).exp();
                file.write_all(&(density as f32).to_le_bytes())?;
            }
        }
    }
    Ok(file.flush()?)
}
