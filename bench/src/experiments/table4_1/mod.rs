//! Table 4.1: frames of unmodified OpenGL programs, by a software rasteriser and by ray tracing.

mod subjects;

use super::Context;
use crate::opengl::{Backend, Cost, Display, Drawing, Program, Session, Tools, write};
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use crate::runner::{Ratio, order};
use crate::stats::Summary;
use datasets::cli::UsageError;
use datasets::view::View;
use std::path::Path;
use subjects::Subject;

/// Width and height of the programs' windows.
const SIZE_PX: u32 = 1024;
/// The column `view` of frames from all around.
const AROUND: &str = "around";
const BACKENDS: [Backend; 3] = [Backend::Llvmpipe, Backend::Serial, Backend::Asynchronous];

/// The backends that differ for a program. ParaView and VTK draw into framebuffer objects, which
/// are never presented one frame late. One million triangles suffice to measure the effect of
/// pipelined presentation.
fn backends(program: Program, triangles: usize) -> &'static [Backend] {
    match program {
        Program::Gmsh | Program::Geomview if triangles < 2_000_000 => &BACKENDS,
        _ => &BACKENDS[..2],
    }
}

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column(
        "program",
        "",
        "an unmodified program; it turns the model by a few degrees from frame to frame",
    );
    record.column("data", "", "data set whose triangles are in its file, as `datasets` names it");
    record.column("triangles", "", "triangles in its file");
    record.column(
        "view",
        "",
        "from where: `around` it, all of it in sight; or a view of the data set, to and fro by a \
         degree, by programs that can be told",
    );
    record.column("backend", "", "renderer: Mesa's llvmpipe, or gluray in mode match");
    record.column("fps", "1/s", "frames a second by the median frame");
    record.column("time", "ms", "median wall time of a frame");
    record.column("time_low", "ms", "fastest frame or group of frames");
    record.column("time_high", "ms", "slowest");
    record.column(
        "cpu",
        "ms",
        "CPU time of a frame, of the program's process with all its threads",
    );
    record.column(
        "first",
        "s",
        "start to first frame: the file, the program's preparations, the hierarchy",
    );
    record.column("memory", "GiB", "the most the process held");
    record.column(
        "speedup",
        "",
        "wall time of llvmpipe's frames over that of these, group by group",
    );
    record.column("cpu_speedup", "", "the same of CPU time");
    record.column("load", "", "load of the machine when the program's frames had been measured");
    record.notes.push(
        "gluray gives each frame to the driver or to rays, whichever is cheaper, except one frame \
         late: there all are rays'."
            .into(),
    );
    record.notes.push(format!(
        "Windows of {SIZE_PX} x {SIZE_PX} pixels on an X server without a screen. The programs \
         take turns, a group of frames each, where two of them fit \
         into memory; of 16 million triangles they run one after the other, so their ratios decide \
         nothing. `one frame late` shows each frame while the next is asked for \
         (section 4.1.2); ParaView and VTK draw into framebuffer objects, where gluray is never \
         late."
    ));
    let mut missing = Vec::new();
    let tools = Tools::find().map_err(|m| missing.extend(m)).ok();
    let programs: Vec<Program> = Program::ALL
        .into_iter()
        .filter(|p| p.find().map_err(|m| missing.push(m)).is_ok())
        .collect();
    let Some(tools) = tools.filter(|_| !programs.is_empty()) else {
        return Err(UsageError(format!(
            "table4.1 needs programs that are not here:\n  {}",
            missing.join("\n  ")
        ))
        .into());
    };
    record.missing.extend(missing);
    let display = Display::start(&tools.xvfb)?;
    let dir = tempfile::tempdir()?;
    if context.thesis {
        record.notes.push("The largest data sets that a program has room for (--thesis).".into());
    }
    let setup = ProgramSetup { tools: &tools, display: &display, dir: dir.path() };
    for i in 0..subjects::count(context) {
        context.part(record, &subjects::name(context.thesis, i), |context, record| {
            let Some(subject) = subjects::subject(context, record, i)? else { return Ok(()) };
            for &program in &programs {
                for view in &subject.views {
                    if view.is_none() || program.takes_a_view() {
                        measure(context, record, &setup, program, &subject, view.as_ref())?;
                    }
                }
            }
            Ok(())
        })?;
    }
    record.plots.push(plot(record));
    Ok(())
}

struct ProgramSetup<'a> {
    tools: &'a Tools,
    display: &'a Display,
    dir: &'a Path,
}

/// Measurements of one backend.
#[derive(Default)]
struct Measurement {
    first_secs: f64,
    groups: Vec<Cost>,
    peak_bytes: Option<u64>,
}

fn measure(
    context: &mut Context<'_>,
    record: &mut Record,
    setup: &ProgramSetup<'_>,
    program: Program,
    subject: &Subject,
    view: Option<&View>,
) -> anyhow::Result<()> {
    let mesh = &subject.mesh;
    let n = mesh.num_triangles();
    let of = Rows { program, data: subject.data, triangles: n, view };
    let name = of.name();
    let data = setup.dir.join(format!("{n}")).with_extension(program.format().extension());
    context.report_step(format!("{name}: data"))?;
    write(mesh, program.format(), &data)?;
    let drawing = Drawing { data: &data, size_px: SIZE_PX, view };
    // CPU time has a resolution of 1/100 s; groups of frames take much longer than that.
    let (groups, frames) = match (context.quick, n) {
        (true, _) => (3, 5),
        (_, ..2_000_000) => (7, 6),
        (_, ..8_000_000) => (5, 3),
        _ => (5, 2),
    };
    // The best hierarchy is built in the background during some frames; only the steady state is
    // measured.
    let settle = if context.quick { 4 } else { 6 };
    let together = n < 8_000_000;
    let backends = backends(program, n);
    let mut all: Vec<Measurement> = backends.iter().map(|_| Measurement::default()).collect();
    let start = |backend: Backend, measurement: &mut Measurement| -> anyhow::Result<Session> {
        let dir = setup.dir.join(format!("{}-{backend:?}-{n}", program.name().replace(' ', "-")));
        let begun = std::time::Instant::now();
        let mut s = Session::start(
            program,
            backend,
            Some(&setup.tools.gluray),
            setup.display,
            &dir,
            drawing,
        )?;
        measurement.first_secs = begun.elapsed().as_secs_f64();
        s.frames(if backend == Backend::Llvmpipe { 1 } else { settle })?;
        if backend != Backend::Llvmpipe && !is_built_once(n) {
            // Builds of the best hierarchy continue in the background. They take about one second
            // per million triangles and core.
            std::thread::sleep(std::time::Duration::from_secs_f64(2.0 + n as f64 / 4e5));
        }
        Ok(s)
    };
    if together {
        let mut sessions = Vec::new();
        for (backend, m) in backends.iter().copied().zip(&mut all) {
            context.report_step(format!("{name}: starting {}", backend.name()))?;
            sessions.push(start(backend, m)?);
        }
        for round in 0..groups {
            context.report_step(format!("{name}: group {} of {groups}", round + 1))?;
            for i in order(backends.len(), round) {
                all[i].groups.push(per_frame(sessions[i].frames(frames)?, frames));
            }
        }
        for ((backend, s), m) in backends.iter().copied().zip(sessions).zip(&mut all) {
            m.peak_bytes = s.peak_bytes();
            check(program, backend, s.end()?)?;
        }
    } else {
        for (backend, m) in backends.iter().copied().zip(&mut all) {
            context.report_step(format!("{name}: {}", backend.name()))?;
            let mut s = start(backend, m)?;
            for _ in 0..groups {
                m.groups.push(per_frame(s.frames(frames)?, frames));
            }
            m.peak_bytes = s.peak_bytes();
            check(program, backend, s.end()?)?;
        }
    }
    std::fs::remove_file(&data)?;
    for (i, backend) in backends.iter().copied().enumerate() {
        record.rows.push(of.row(backend, &all[0], &all[i]));
        if i > 0 {
            record.ratios.extend(of.ratio(backend, (&all[0], &all[i]), together));
        }
    }
    Ok(())
}

/// Whether a mesh is too small for a second build.
fn is_built_once(triangles: usize) -> bool {
    triangles < 20_000
}

fn per_frame(c: Cost, frames: u32) -> Cost {
    Cost { wall_secs: c.wall_secs / f64::from(frames), cpu_secs: c.cpu_secs / f64::from(frames) }
}

/// The reason in gluray's report for frames that the driver draws for less.
const CHEAPER: &str = "a frame that costs the driver less than rays";

/// Fails if the driver drew frames that gluray should have traced.
fn check(
    program: Program,
    backend: Backend,
    report: Option<serde_json::Value>,
) -> anyhow::Result<()> {
    if backend == Backend::Llvmpipe {
        return Ok(());
    }
    let report = report.unwrap_or_default();
    let traced = report["traced_draws"].as_u64().unwrap_or(0);
    let faults = report["faults"].as_array().map_or(0, Vec::len);
    anyhow::ensure!(
        (traced > 0 || report["passed_reasons"][CHEAPER].is_u64()) && faults == 0,
        "{}: {traced} draws traced, {faults} faults; `passed_reasons`: {}",
        program.name(),
        report["passed_reasons"]
    );
    Ok(())
}

fn each(native: &Measurement, ours: &Measurement, of: impl Fn(&Cost) -> f64) -> Vec<f64> {
    native.groups.iter().zip(&ours.groups).map(|(n, o)| of(n) / of(o)).collect()
}

/// What the rows of one comparison are about.
struct Rows<'a> {
    program: Program,
    data: &'static str,
    triangles: usize,
    view: Option<&'a View>,
}

impl Rows<'_> {
    fn view(&self) -> &str {
        self.view.map_or(AROUND, |view| &view.name)
    }

    fn name(&self) -> String {
        let Rows { program, data, triangles, .. } = self;
        format!("{}, {data}, {triangles} triangles, {}", program.name(), self.view())
    }

    fn row(&self, backend: Backend, native: &Measurement, m: &Measurement) -> Row {
        let of =
            |f: &dyn Fn(&Cost) -> f64| Summary::of(&m.groups.iter().map(f).collect::<Vec<_>>());
        let row = Row::new()
            .with("program", self.program.name())
            .with("data", self.data)
            .with("triangles", self.triangles)
            .with("view", self.view())
            .with("backend", backend.name());
        let (Some(wall), Some(cpu)) = (of(&|c| c.wall_secs), of(&|c| c.cpu_secs)) else {
            return row;
        };
        let median =
            |of: &dyn Fn(&Cost) -> f64| Summary::of(&each(native, m, of)).map(|s| s.median);
        row.with("fps", 1.0 / wall.median)
            .with("time", wall.median * 1e3)
            .with("time_low", wall.low * 1e3)
            .with("time_high", wall.high * 1e3)
            .with("cpu", cpu.median * 1e3)
            .with("first", m.first_secs)
            .with("memory", m.peak_bytes.map(|b| b as f64 / f64::from(1 << 30)))
            .with("speedup", median(&|c| c.wall_secs))
            .with("cpu_speedup", median(&|c| c.cpu_secs))
            .with("load", crate::machine::load())
    }

    fn ratio(
        &self,
        backend: Backend,
        (native, ours): (&Measurement, &Measurement),
        in_turns: bool,
    ) -> Option<Ratio> {
        let name = format!("{}, {}", self.name(), backend.name());
        let ratio =
            Ratio::of_rounds(name, Backend::Llvmpipe.name(), &each(native, ours, |c| c.wall_secs))?;
        Some(Ratio { in_turns, ..ratio })
    }
}

fn plot(record: &Record) -> Plot {
    let mut plot = Plot::lines(
        "Frames of programs",
        Axis::log("triangles", ""),
        Axis::log("frames a second", "1/s"),
    );
    for program in Program::ALL {
        for backend in BACKENDS {
            let of = record.rows.iter().filter(|r| {
                r.text("program") == Some(program.name())
                    && r.text("backend") == Some(backend.name())
                    && r.text("view") == Some(AROUND)
            });
            let points: Vec<(f64, f64)> =
                of.filter_map(|r| r.number("triangles").zip(r.number("fps"))).collect();
            if !points.is_empty() {
                plot.series
                    .push(Series::new(format!("{}, {}", program.name(), backend.name()), points));
            }
        }
    }
    plot
}
