//! Error against time of light's way through a gas on the CPU in double and single precision, and
//! on a GPU in single precision: the same march, interpolants and steps.

use super::Context;
use super::test_section::{
    blob, blob_deflections, check_cancelled, error_of, fingerprint, oblique, tiles,
};
use crate::clock::Clock;
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use crate::runner::{Schedule, Variant, interleave};
use schlieren::gpu::{Gpu, GpuError, GpuOptions, GpuPaths};
use schlieren::interpolate::{BSpline, Interpolant, Trilinear};
use schlieren::march::{Deviational, Full, FullOptions, Options, Verlet};
use schlieren::path::{Exit, LightPaths, Start};
use std::sync::Arc;

/// Largest eps of the blob: a gas.
const AMPLITUDE: f64 = 1e-5;

const DOUBLE: &str = "CPU, f64";
const SINGLE: &str = "CPU, f32";
const GPU: &str = "GPU, f32";

/// Interpolants for which the GPU has a kernel.
const INTERPOLANTS: [(&str, Interpolant); 2] =
    [("b-spline", Interpolant::BSpline), ("trilinear", Interpolant::Trilinear)];

struct Sizes {
    /// Nodes per axis.
    nodes: usize,
    /// Rows and columns of rays that are timed, and of those that are compared with the truth.
    timed: usize,
    compared: usize,
    steps: &'static [f64],
}

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    let sizes = if context.quick {
        Sizes { nodes: 64, timed: 64, compared: 16, steps: &[8.0, 2.0, 0.5] }
    } else {
        Sizes {
            nodes: 128,
            timed: 256,
            compared: 32,
            steps: &[16.0, 8.0, 4.0, 2.0, 1.0, 0.5, 0.25],
        }
    };
    compare(context, record, Gpu::shared(), &sizes)
}

fn compare(
    context: &mut Context<'_>,
    record: &mut Record,
    gpu: Result<Arc<Gpu>, GpuError>,
    sizes: &Sizes,
) -> anyhow::Result<()> {
    record.column("device", "", "what marches, and the precision of its numbers");
    record.column("adapter", "", "the GPU and its driver");
    record.column("interpolant", "", "between the nodes");
    record.column("step", "voxel", "longest step");
    record.column(
        "time",
        "ns",
        "wall time of all threads for a ray, with the way to the device and back; median over the \
         rounds",
    );
    record.column("time_low", "ns", "fastest round");
    record.column("time_high", "ns", "slowest round");
    record.column("rounds", "", "rounds; all devices and steps of an interpolant took turns");
    record.column("rms_error", "rad", "root mean square error of the deflection");
    record.column("largest_error", "rad", "largest error of the deflection");
    record.column("from_f64", "rad", "largest difference from the march in f64 of the same step");
    record.column("from_cpu", "rad", "largest difference of the GPU from the CPU, both in f32");
    let (gaussian, field) = blob(AMPLITUDE, sizes.nodes)?;
    let view = oblique()?;
    let compared = tiles(sizes.compared, 0.5);
    let timed = tiles(sizes.timed, 0.5);
    let truth = blob_deflections(&gaussian, &view, &compared)?;
    let scale = truth.iter().map(|t| t[0].hypot(t[1])).fold(0.0, f64::max);
    record.notes.push(format!(
        "A blob of eps {AMPLITUDE:e} and sigma 0.08 m in a cube of 1 m, {}³ nodes, seen 0.6 rad \
         off its axes; the largest deflection is {scale:.2e} rad. The truth is an adaptive march in \
         f64 through the blob itself. f32 marches carry deviations; the f64 march takes one ray at \
         a time. All threads trace {}² rays.",
        sizes.nodes, sizes.timed
    ));
    let gpu = match gpu {
        Ok(gpu) => {
            let software = if gpu.is_software() {
                " Its driver runs on the CPU: its errors are those of any device, its times are \
                 those of no GPU."
            } else {
                ""
            };
            record.notes.push(format!("The GPU is {}.{software}", gpu.name()));
            Some(gpu)
        }
        Err(e) => {
            record.missing.push(format!("the rows of the GPU: {e}"));
            None
        }
    };
    let (spline, linear) = (BSpline::new(&field), Trilinear::new(&field));
    for (interpolant_name, interpolant) in INTERPOLANTS {
        check_cancelled(context)?;
        let mut cases: Vec<(&str, f64, Box<dyn LightPaths + '_>)> = vec![];
        for &step_voxels in sizes.steps {
            let options = FullOptions { step_voxels, ..FullOptions::default() };
            cases.push((
                DOUBLE,
                step_voxels,
                match interpolant {
                    Interpolant::BSpline => {
                        Box::new(Full::new(&field, &spline, Verlet, view, options))
                    }
                    _ => Box::new(Full::new(&field, &linear, Verlet, view, options)),
                },
            ));
            let options = Options { step_voxels, ..Options::default() };
            let single = Deviational::new(&field, view, interpolant, options);
            cases.push((SINGLE, step_voxels, Box::new(single)));
            if let Some(gpu) = &gpu {
                let options = GpuOptions { step_voxels, ..GpuOptions::default() };
                let paths = GpuPaths::new(Arc::clone(gpu), &field, view, interpolant, options)?;
                cases.push((GPU, step_voxels, Box::new(paths)));
            }
        }
        context.report_step(format!("{interpolant_name}: {} settings in turns", cases.len()))?;
        let exits: Vec<Vec<Exit>> = cases.iter().map(|c| traced(&*c.2, &compared)).collect();
        for (device, _, paths) in &cases {
            if let Some(warning) = paths.device_warning() {
                anyhow::bail!("{device}: {warning}");
            }
        }
        let mut variants: Vec<Variant<'_>> = cases
            .iter()
            .map(|(device, step, paths)| {
                let (name, timed) = (format!("{device}, {step}"), &timed);
                Variant::new(name, move || fingerprint(&traced(&**paths, timed)))
            })
            .collect();
        let schedule = context.schedule(Schedule::all_threads(), 3.0);
        let timings = interleave(&schedule, &mut variants)?;
        drop(variants);
        let per_ray = 1e9 / timed.len() as f64;
        let found = |name: &str, step: f64| {
            let at = cases.iter().position(|c| c.0 == name && c.1 == step);
            at.map(|i| exits[i].as_slice())
        };
        for (((device, step, _), own), v) in cases.iter().zip(&exits).zip(&timings.variants) {
            let (rms, largest) = error_of(own, &truth);
            let time = v.summary(Clock::Wall);
            let from = |other: &str| {
                found(other, *step).filter(|_| *device != other).map(|o| difference(own, o))
            };
            let name = gpu.as_ref().filter(|_| *device == GPU).map(|g| g.name());
            record.rows.push(
                Row::new()
                    .with("device", *device)
                    .with("adapter", name)
                    .with("interpolant", interpolant_name)
                    .with("step", *step)
                    .with("time", time.median * per_ray)
                    .with("time_low", time.low * per_ray)
                    .with("time_high", time.high * per_ray)
                    .with("rounds", v.samples.len())
                    .with("rms_error", rms * scale)
                    .with("largest_error", largest * scale)
                    .with("from_f64", from(DOUBLE))
                    .with("from_cpu", from(SINGLE).filter(|_| *device == GPU)),
            );
        }
    }
    record.plots.push(plot(&record.rows));
    record.notes.push(describe(&record.rows, scale));
    Ok(())
}

/// Traces all rays on all threads.
fn traced(paths: &dyn LightPaths, starts: &[Start]) -> Vec<Exit> {
    let mut exits = vec![Exit::UNDISTURBED; starts.len()];
    paths.trace_parallel(starts, &mut exits);
    exits
}

/// The largest difference of two deflections of the same ray.
fn difference(a: &[Exit], b: &[Exit]) -> f64 {
    let off = |(a, b): (&Exit, &Exit)| {
        let [x, y] =
            [0, 1].map(|c| f64::from(a.deflection_rad[c]) - f64::from(b.deflection_rad[c]));
        x.hypot(y)
    };
    a.iter().zip(b).map(off).fold(0.0, |m, d| if d.is_nan() || d > m { d } else { m })
}

fn plot(rows: &[Row]) -> Plot {
    let mut plot = Plot::lines(
        "CPU and GPU: error against time",
        Axis::log("time of a ray, all threads", "ns"),
        Axis::log("rms error of the deflection", "rad"),
    );
    for (interpolant, _) in INTERPOLANTS {
        for device in [DOUBLE, SINGLE, GPU] {
            let of = |r: &&Row| {
                r.text("device") == Some(device) && r.text("interpolant") == Some(interpolant)
            };
            let points: Vec<(f64, f64)> = rows
                .iter()
                .filter(of)
                .filter_map(|r| r.number("time").zip(r.number("rms_error")))
                .collect();
            if !points.is_empty() {
                plot.series.push(Series::new(format!("{device}, {interpolant}"), points));
            }
        }
    }
    plot
}

/// How far devices and precisions are apart, as parts of the largest deflection.
fn describe(rows: &[Row], scale: f64) -> String {
    let largest = |column: &str, device: &str, interpolant: &str| {
        let of = |r: &&Row| {
            r.text("device") == Some(device) && r.text("interpolant") == Some(interpolant)
        };
        let found = rows.iter().filter(of).filter_map(|r| r.number(column));
        found.reduce(f64::max).map_or("not measured".into(), |v| format!("{:.1e}", v / scale))
    };
    let words = INTERPOLANTS.map(|(interpolant, _)| {
        format!(
            "{interpolant}: CPU f32 from f64 {}, GPU f32 from f64 {}, GPU from CPU in f32 {}",
            largest("from_f64", SINGLE, interpolant),
            largest("from_f64", GPU, interpolant),
            largest("from_cpu", GPU, interpolant)
        )
    });
    format!(
        "Largest differences over all steps, as parts of the largest deflection: {}. The f64 march \
         bends the ray, the f32 marches deviate from a straight one, which leaves out the square of \
         eps.",
        words.join("; ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;

    #[test]
    fn without_a_gpu_the_cpu_is_measured_and_the_record_says_what_is_missing() {
        let mut record = Record::new("accuracy-gpu", "", 5, true, Machine::describe());
        let mut progress = |_: &str, _: Option<f64>| Ok(());
        let mut context = Context::new(true, None, &mut progress);
        let sizes = Sizes { nodes: 32, timed: 8, compared: 8, steps: &[2.0, 0.5] };
        let none = Err(GpuError::NoAdapter("Vulkan finds no device".into()));
        compare(&mut context, &mut record, none, &sizes).unwrap();
        assert!(record.missing.iter().any(|m| m.contains("no GPU")), "{:?}", record.missing);
        assert_eq!(record.rows.len(), 8);
        for r in &record.rows {
            assert_ne!(r.text("device"), Some(GPU));
            // Single precision is no worse than the lattice: a few per cent of 1e-5 rad.
            assert!(r.number("rms_error").is_some_and(|e| e < 2e-6), "{r:?}");
            let from = r.number("from_f64");
            assert_eq!(from.is_some(), r.text("device") == Some(SINGLE));
            assert!(from.is_none_or(|d| d > 0.0 && d < 1e-8), "{r:?}");
        }
        assert_eq!(record.plots[0].series.len(), 4);
        assert!(record.notes.iter().any(|n| n.contains("GPU f32 from f64 not measured")));
        assert!(record.unexplained_columns().is_empty());
    }

    #[test]
    fn a_broken_deflection_is_not_a_small_difference() {
        let bad = Exit { deflection_rad: [f32::NAN, 0.0], ..Exit::UNDISTURBED };
        assert!(difference(&[bad, Exit::UNDISTURBED], &[Exit::UNDISTURBED; 2]).is_nan());
        let off = Exit { deflection_rad: [3.0, 4.0], ..Exit::UNDISTURBED };
        assert_eq!(difference(&[Exit::UNDISTURBED, off], &[Exit::UNDISTURBED; 2]), 5.0);
    }
}
