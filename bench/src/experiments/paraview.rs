//! One node of figures 3.6 to 3.10: ParaView with llvmpipe against the same ParaView with ray
//! tracing by vtk-bridge.
//!
//! Both run as users run them: `pvbatch` with the same script, once with the variables that
//! `vtk-bridge env --paraview` prints and once without. The processes alternate, so both see the
//! same load of the machine. CPU seconds are those of the whole process, including all threads of
//! Mesa or of rt-core.

use super::Context;
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use crate::runner::{self, Ratio, VERDICT_ROUNDS};
use crate::stats::Summary;
use anyhow::{Context as _, bail};
use datasets::catalogue::{self, Data};
use datasets::cli::UsageError;
use datasets::generate::nested_wavelet::Size;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

const SCRIPT: &str = include_str!("paraview_frames.py");
/// The renderers, in the order of their turns.
const PROGRAMS: [&str; 2] = ["llvmpipe", "vtk-bridge"];

/// A data set and the number of its measurements.
struct Subject {
    data: &'static str,
    size: &'static str,
    frames: usize,
    rounds: usize,
}

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    let host = Host::find()?;
    columns(record);
    let (pixels, subjects): (u32, &[Subject]) = if context.quick {
        (384, &[Subject { data: "wavelet", size: "1M", frames: 3, rounds: 1 }])
    } else {
        let full = |data, size, frames| Subject { data, size, frames, rounds: VERDICT_ROUNDS };
        (
            1024,
            &[
                full("wavelet", "1M", 6),
                full("mixing-layer", "medium", 4),
                full("plasma", "medium", 4),
                full("wavelet", "4M", 6),
                full("wavelet", "16M", 4),
            ],
        )
    };
    record.notes.push(format!(
        "{}, {pixels} x {pixels} pixels, one colour, ParaView's light kit, no effects. A frame is \
         `Render(view)` after the camera was turned by 5 degrees; CPU seconds are user \
         and system time of the whole process. The first frame has extraction, normals, uploads \
         and acceleration structures in it. Programs take turns; both share \
         the machine with whatever else runs.",
        host.version
    ));
    let folder = Folder::new()?;
    for subject in subjects {
        let name = format!("{} {}", subject.data, subject.size);
        context.report_step(format!("{name}: data"))?;
        let order = order(subject, pixels, context.quick, &folder.0)?;
        let mut rounds = Vec::new();
        for round in 0..subject.rounds {
            let mut pair = vec![Value::Null; PROGRAMS.len()];
            for p in runner::order(PROGRAMS.len(), round) {
                let program = PROGRAMS[p];
                context.report_step(format!("{name}: {program}, round {}", round + 1))?;
                pair[p] = host.frames(program, &order, &folder.0)?;
            }
            rounds.push(pair);
        }
        rows(record, subject.data, &rounds)?;
    }
    plots(record);
    Ok(())
}

fn columns(record: &mut Record) {
    for (name, unit, meaning) in [
        ("data", "", "data set of the catalogue (`datasets list`)"),
        ("view", "", "camera of the catalogue"),
        ("triangles", "", "triangles, as ParaView counts them"),
        ("program", "", "renderer: Mesa's llvmpipe, or vtk-bridge in the same ParaView"),
        ("cpu", "s", "CPU seconds of a frame, median over all rounds"),
        ("cpu_low", "s", "smallest"),
        ("cpu_high", "s", "largest"),
        ("wall", "s", "wall time of a frame, median over all rounds"),
        ("wall_low", "s", "smallest"),
        ("wall_high", "s", "largest"),
        ("first", "s", "wall time of the first frame of the process, median over rounds"),
        ("first_cpu", "s", "CPU seconds of the first frame"),
        ("data_memory", "GB", "peak resident memory before the first frame: ParaView and the data"),
        ("peak", "GB", "peak resident memory of the process"),
        ("frames", "", "frames measured"),
        ("load", "", "load of the machine at the end of the process, largest of the rounds"),
    ] {
        record.column(name, unit, meaning);
    }
}

/// Input of the script: data, cameras, sizes.
fn order(subject: &Subject, pixels: u32, quick: bool, folder: &Path) -> anyhow::Result<Value> {
    let entry = catalogue::find(subject.data)?;
    let views = entry.views().into_iter().map(|v| {
        json!({
            "name": v.name.as_str(),
            "eye": v.eye.to_array(), "target": v.target.to_array(), "up": v.up.to_array(),
            "angle": v.vertical_fov_degrees, "inside": v.name == "RMI",
        })
    });
    let views: Vec<Value> = views.collect();
    let mut order = json!({ "pixels": pixels, "frames": subject.frames, "views": views, "isovalues": [], "points": 201 });
    if let Some(size) =
        Size::ALL.into_iter().find(|s| subject.data == "wavelet" && s.name() == subject.size)
    {
        order["isovalues"] = json!(size.isovalues());
        if quick {
            order["points"] = json!(101);
        }
    } else {
        let file = folder.join(format!("{}.ply", subject.data));
        let options = datasets::isosurface::Options { normals: true, scalars: false };
        let Data::Mesh(mesh) = entry.generate(subject.size, options, &mut |_, _| true)? else {
            bail!("{} is not made of triangles", subject.data);
        };
        datasets::write::write_ply(&file, &mesh)?;
        order["file"] = json!(file);
    }
    Ok(order)
}

/// Rows and ratios of one data set from all rounds; each round has one result per program.
fn rows(record: &mut Record, data: &str, rounds: &[Vec<Value>]) -> anyhow::Result<()> {
    let first = rounds.first().and_then(|r| r.first()).context("no round was measured")?;
    let views: Vec<String> =
        first["views"].as_object().into_iter().flatten().map(|(n, _)| n.clone()).collect();
    let triangles = first["triangles"].as_u64().unwrap_or(0);
    let list = |v: &Value| -> Vec<f64> {
        v.as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
    };
    for view in &views {
        for (p, program) in PROGRAMS.iter().enumerate() {
            let of = |name: &str| -> Vec<f64> {
                rounds.iter().flat_map(|r| list(&r[p]["views"][view.as_str()][name])).collect()
            };
            let once = |name: &str| -> Vec<f64> {
                rounds.iter().filter_map(|r| r[p][name].as_f64()).collect()
            };
            let (cpu, wall) = (of("cpu"), of("wall"));
            let low = |v: &[f64]| v.iter().copied().fold(f64::INFINITY, f64::min);
            let high = |v: &[f64]| v.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            record.rows.push(
                Row::new()
                    .with("data", data)
                    .with("view", view.as_str())
                    .with("triangles", triangles)
                    .with("program", *program)
                    .with("cpu", median(&cpu))
                    .with("cpu_low", low(&cpu))
                    .with("cpu_high", high(&cpu))
                    .with("wall", median(&wall))
                    .with("wall_low", low(&wall))
                    .with("wall_high", high(&wall))
                    .with("first", median(&once("first_secs")))
                    .with("first_cpu", median(&once("first_cpu_secs")))
                    .with("data_memory", median(&once("data_gb")))
                    .with("peak", high(&once("peak_gb")))
                    .with("frames", cpu.len())
                    .with("load", high(&once("load"))),
            );
        }
        for name in ["cpu", "wall"] {
            let per_round = |r: &Vec<Value>| {
                let [baseline, ours] =
                    [0, 1].map(|p| median(&list(&r[p]["views"][view.as_str()][name])));
                baseline / ours
            };
            let what =
                if name == "cpu" { "CPU seconds of a frame" } else { "wall time of a frame" };
            record.ratios.extend(ratio(
                format!("{what}, {data} {view}, {triangles} triangles"),
                rounds.iter().map(per_round).collect(),
            ));
        }
    }
    for (name, what) in [("first_secs", "first frame"), ("peak_gb", "peak memory")] {
        let of = |r: &Vec<Value>, p: usize| r[p][name].as_f64().unwrap_or(f64::NAN);
        let each = rounds.iter().map(|r| of(r, 0) / of(r, 1)).collect();
        record.ratios.extend(ratio(format!("{what}, {data}, {triangles} triangles"), each));
    }
    Ok(())
}

/// The median; NaN for no values, which a record shows as missing.
fn median(values: &[f64]) -> f64 {
    Summary::of(values).map_or(f64::NAN, |s| s.median)
}

fn ratio(name: String, rounds: Vec<f64>) -> Option<Ratio> {
    Ratio::of_rounds(format!("vtk-bridge: {name}"), "ParaView with llvmpipe", &rounds)
}

fn plots(record: &mut Record) {
    for (column, title, label, unit) in [
        ("cpu", "CPU seconds of a frame, ParaView on one node", "CPU seconds per frame", "s"),
        ("wall", "Wall time of a frame, ParaView on one node", "time per frame", "s"),
        ("first", "First frame, ParaView on one node", "time of the first frame", "s"),
        ("peak", "Peak memory, ParaView on one node", "peak resident memory", "GB"),
    ] {
        let mut plot = Plot::lines(title, Axis::log("triangles", ""), Axis::log(label, unit));
        for program in PROGRAMS {
            for data in ["wavelet", "mixing-layer", "plasma"] {
                let of =
                    |r: &&Row| r.text("program") == Some(program) && r.text("data") == Some(data);
                let mut views: Vec<&str> =
                    record.rows.iter().filter(of).filter_map(|r| r.text("view")).collect();
                views.dedup();
                views.sort_unstable();
                views.dedup();
                for view in views {
                    let here =
                        record.rows.iter().filter(of).filter(|r| r.text("view") == Some(view));
                    let points: Vec<(f64, f64)> =
                        here.filter_map(|r| r.number("triangles").zip(r.number(column))).collect();
                    plot.series.push(Series::new(format!("{program}, {data} {view}"), points));
                }
            }
        }
        record.plots.push(plot);
    }
}

/// The programs that the experiment needs on the machine.
struct Host {
    pvbatch: PathBuf,
    bridge: PathBuf,
    version: String,
    display: Display,
}

impl Host {
    fn find() -> anyhow::Result<Host> {
        let pvbatch = program("RTSV_PVBATCH", "pvbatch").ok_or_else(|| {
            UsageError(
                "pvbatch is not here: install ParaView (Debian: `apt-get install paraview \
                        python3-paraview`), or name it in RTSV_PVBATCH"
                    .into(),
            )
        })?;
        let xvfb = program("RTSV_XVFB", "Xvfb").ok_or_else(|| {
            UsageError(
                "Xvfb is not here: install it (Debian: `apt-get install xvfb`), or name it in \
                 RTSV_XVFB"
                    .into(),
            )
        })?;
        let beside = std::env::current_exe().ok().map(|p| p.with_file_name("vtk-bridge"));
        let bridge = std::env::var_os("RTSV_VTK_BRIDGE")
            .map(PathBuf::from)
            .or(beside)
            .filter(|p| p.is_file());
        let bridge = bridge.ok_or_else(|| {
            UsageError(
                "the program `vtk-bridge` is not beside this one: `cargo build -p \
                        vtk-bridge` (with the same --release), or name it in \
                        RTSV_VTK_BRIDGE"
                    .into(),
            )
        })?;
        let output =
            Command::new(&pvbatch).arg("--version").output().context("pvbatch --version")?;
        let text = [output.stdout, output.stderr].concat();
        let version = String::from_utf8_lossy(&text)
            .lines()
            .next()
            .unwrap_or("ParaView")
            .replace("paraview version", "ParaView");
        Ok(Host { pvbatch, bridge, version, display: Display::start(&xvfb)? })
    }

    /// Runs the script and returns its measurements.
    fn frames(&self, drawn_by: &str, order: &Value, folder: &Path) -> anyhow::Result<Value> {
        let (script, file) = (folder.join("frames.py"), folder.join("order.json"));
        std::fs::write(&script, SCRIPT)?;
        std::fs::write(&file, order.to_string())?;
        let ours = drawn_by == PROGRAMS[1];
        let line = if ours {
            "exports=$(\"$1\" env --paraview --prefix \"$2\") || exit 97; eval \"$exports\"; shift \
             2; exec \"$@\""
        } else {
            "shift 2; exec \"$@\""
        };
        let mut command = Command::new("sh");
        command.args(["-c", line, "sh"]).arg(&self.bridge).arg(folder.join("bridge"));
        command.arg(&self.pvbatch).arg(&script).arg(&file);
        command
            .env("DISPLAY", &self.display.name)
            .env_remove("VTK_AUTOLOAD_PATH")
            .env_remove("PV_PLUGIN_PATH");
        for (name, _) in
            std::env::vars_os().filter(|(n, _)| n.to_string_lossy().starts_with("RTV_"))
        {
            command.env_remove(name);
        }
        // Rays are measured also where vtk-bridge would leave the frame to OpenGL.
        command.env("RTV_ALWAYS_TRACE", "1");
        let out = command.output().context("sh")?;
        let stdout = String::from_utf8_lossy(&out.stdout);
        let errors = String::from_utf8_lossy(&out.stderr);
        let last = || {
            errors
                .lines()
                .rev()
                .find(|l| !l.trim().is_empty())
                .unwrap_or("it printed nothing")
                .to_owned()
        };
        let Some(line) = stdout.lines().find_map(|l| l.strip_prefix("RESULT ")) else {
            bail!("pvbatch with {drawn_by} ended with {}: {}", out.status, last());
        };
        let result: Value = serde_json::from_str(line)?;
        let renderer = result["renderer"].as_str().unwrap_or_default();
        anyhow::ensure!(
            (renderer == "vtkRtvRenderer") == ours,
            "{drawn_by} was measured with the renderer {renderer}: {}; `vtk-bridge doctor` says \
             what is wrong",
            last()
        );
        Ok(result)
    }
}

/// A program from its environment variable or the search path.
fn program(variable: &str, name: &str) -> Option<PathBuf> {
    if let Some(named) = std::env::var_os(variable) {
        return Some(PathBuf::from(named)).filter(|p| p.is_file());
    }
    let path = std::env::var_os("PATH")?;
    std::env::split_paths(&path).map(|d| d.join(name)).find(|p| p.is_file())
}

/// An X server that runs as long as this value exists.
struct Display {
    name: String,
    server: Child,
}

impl Display {
    fn start(xvfb: &Path) -> anyhow::Result<Display> {
        // -noreset: otherwise the server resets when its last client leaves, which breaks the next
        // client.
        let mut server = Command::new(xvfb)
            .args([
                "-displayfd",
                "1",
                "-noreset",
                "-nolisten",
                "tcp",
                "-screen",
                "0",
                "1280x1280x24",
            ])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .with_context(|| xvfb.display().to_string())?;
        let mut number = String::new();
        let stdout = server.stdout.as_mut().context("Xvfb has no output")?;
        std::io::BufRead::read_line(&mut std::io::BufReader::new(stdout), &mut number)?;
        let number: u32 = number.trim().parse().context("Xvfb did not start")?;
        Ok(Display { name: format!(":{number}"), server })
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        // An error here cannot be handled.
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// A folder for data and files of the bridge, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new() -> anyhow::Result<Folder> {
        let path = std::env::temp_dir().join(format!("bench-paraview-{}", std::process::id()));
        std::fs::create_dir_all(&path).with_context(|| path.display().to_string())?;
        Ok(Folder(path))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_become_rows_with_medians_and_ratios_above_one_where_we_are_faster() {
        let result = |cpu: [f64; 3], first: f64| {
            json!({
                "triangles": 1000, "first_secs": first, "first_cpu_secs": first, "peak_gb": 1.0, "data_gb": 0.5, "load": 2.0,
                "views": { "RMO": { "cpu": cpu, "wall": cpu } }
            })
        };
        let rounds = vec![
            vec![result([2.0, 4.0, 3.0], 9.0), result([0.5, 0.25, 0.3], 3.0)],
            vec![result([3.0, 3.0, 3.0], 8.0), result([0.3, 0.3, 0.2], 4.0)],
        ];
        let mut record = Record::new("paraview", "", 3, true, crate::machine::Machine::describe());
        columns(&mut record);
        rows(&mut record, "mixing-layer", &rounds).unwrap();
        assert_eq!(record.rows.len(), 2);
        assert_eq!(record.rows[0].number("cpu"), Some(3.0));
        assert_eq!(record.rows[1].number("cpu_low"), Some(0.2));
        let cpu = &record.ratios[0];
        assert!(cpu.name.contains("CPU seconds") && (cpu.value - 10.0).abs() < 1e-9, "{cpu:?}");
        let first = record.ratios.iter().find(|r| r.name.contains("first frame")).unwrap();
        assert!((first.low - 2.0).abs() < 1e-9 && (first.high - 3.0).abs() < 1e-9);
        assert!(record.unexplained_columns().is_empty());
        plots(&mut record);
        assert!(
            record.plots.iter().all(|p| !p.series.is_empty() && p.to_svg().contains("triangles"))
        );
    }

    #[test]
    fn every_subject_is_in_the_catalogue_with_views() {
        for data in ["wavelet", "mixing-layer", "plasma"] {
            assert!(!catalogue::find(data).unwrap().views().is_empty(), "{data}");
        }
        let names: Vec<String> =
            catalogue::find("mixing-layer").unwrap().views().into_iter().map(|v| v.name).collect();
        assert!(
            names.contains(&"RMO".to_owned()) && names.contains(&"RMI".to_owned()),
            "{names:?}"
        );
    }
}
