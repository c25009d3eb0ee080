//! Time at equal error against the dissertation's method (Euler, trilinear gradients), in one
//! process, in alternation.
//!
//! The baseline runs in two forms: implemented directly from the text (scalar, position and
//! direction in f32), and as its scheme in our own kernel (deviations, sixteen rays at a time),
//! which leaves only the difference of the method. For each step length of the baseline, our time
//! is that of the cheapest setting whose error is not larger.

use super::Context;
use super::test_section::{
    blob, blob_deflections, check_cancelled, error_of, fingerprint, oblique, tiles, traced,
};
use crate::baselines::thesis_schlieren::ThesisMarch;
use crate::plot::{Axis, Plot, Point, Series};
use crate::record::{Record, Row};
use crate::runner::{Ratio, Schedule, Variant, interleave};
use glam::DVec3;
use schlieren::field::Field;
use schlieren::interpolate::Interpolant;
use schlieren::march::{BlankCells, Deviational, LineOfSight, Options, Scheme};
use schlieren::path::{Exit, LightPaths, PathQuantities, Start};
use schlieren::view::{Axis as ViewAxis, View};
use std::cell::RefCell;

/// One of our settings; they are sorted by rising cost.
struct OurMarch<'a> {
    name: String,
    paths: Box<dyn LightPaths + 'a>,
    error: f64,
    secs: f64,
}

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("nodes", "", "along each side of the lattice");
    record.column("view", "", "where from: along an axis of the lattice, or 0.6 rad off");
    record.column("march", "", "implementation and method");
    record.column("step", "voxel", "step");
    record.column(
        "rms_error",
        "",
        "root mean square over rays, as part of the largest true deflection",
    );
    record.column("largest_error", "", "largest error, the same way");
    record.column(
        "time",
        "ns",
        "median CPU time of one thread for a ray; empty where only the error was taken",
    );
    record.column("ours", "", "our setting with at most that error that was fastest in a trial");
    record.column("our_error", "", "its rms error");
    record.column("our_time", "ns", "its time for a ray");
    record.notes.push(
        "A blob of eps 1e-4 and sigma 0.08 m in a cube of 1 m; the truth is an adaptive march in \
         f64. Ratios are the baseline's time by ours, in \
         turns on one thread by CPU time, at an error of ours that is not larger. `traced` takes \
         every ray through the volume; `line of sight` \
         reads a projection that is made before, and `projected anew` makes it inside the time. \
         Building the dissertation's texture and our \
         spline is outside. Signs and scales that the published code of the dissertation has wrong \
         are right here. Where no traced setting \
         reaches the baseline's error the record says so."
            .into(),
    );
    let lattices: &[usize] = if context.quick { &[64, 128] } else { &[64, 128, 256] };
    let views = [("axis", View::along(ViewAxis::Z, DVec3::ZERO)), ("0.6 rad", oblique()?)];
    for &n in lattices {
        let (gaussian, field) = blob(1e-4, n)?;
        for (view_name, view) in views {
            check_cancelled(context)?;
            context.report_step(format!("{n}³ nodes, {view_name}"))?;
            let starts = tiles(if context.quick { 64 } else { 128 }, 0.5);
            let truth = blob_deflections(&gaussian, &view, &starts)?;
            compare(context, record, &field, (view_name, view), &starts, &truth)?;
        }
    }
    record.notes.push(describe(&record.rows));
    plot(record);
    Ok(())
}

/// Describes the gain of the baseline from shorter steps.
fn describe(rows: &[Row]) -> String {
    let baseline = "dissertation's scheme in our kernel";
    let of = || rows.iter().filter(|r| r.text("march") == Some(baseline));
    let mut each = vec![];
    for coarse in of().filter(|r| r.number("step") == Some(16.0)) {
        let place =
            |r: &Row| (r.number("nodes").unwrap_or(0.0), r.text("view").unwrap_or("").to_string());
        let fine = of().find(|r| place(r) == place(coarse) && r.number("step") == Some(0.5));
        let error = |r: &Row| r.number("rms_error").unwrap_or(f64::NAN);
        if let Some(fine) = fine {
            let (nodes, view) = place(coarse);
            each.push(format!("{nodes}³, {view}: {:.1e} to {:.1e}", error(coarse), error(fine)));
        }
    }
    format!(
        "From steps of 16 voxels to steps of half a voxel the error of the {baseline} went from \
         and to: {}. What stays is its interpolant's.",
        each.join("; ")
    )
}

fn compare(
    context: &Context<'_>,
    record: &mut Record,
    field: &Field,
    (view_name, view): (&str, View),
    starts: &[Start],
    truth: &[[f64; 2]],
) -> anyhow::Result<()> {
    let n = field.dims()[0];
    let mut traced_ours = ours(field, view);
    trial(&mut traced_ours, starts, truth)?;
    let los = || {
        LineOfSight::new(
            field,
            view,
            Interpolant::BSpline,
            PathQuantities::default(),
            BlankCells::Opaque,
        )
    };
    let projected = los();
    let (los_error, _) = error_of(&traced(&projected, starts), truth);
    let base = || Row::new().with("nodes", n).with("view", view_name);
    for o in &traced_ours {
        let row = base().with("march", format!("ours: {}", o.name)).with("rms_error", o.error);
        record.rows.push(row.with("time", o.secs * 1e9 / starts.len() as f64));
    }
    record.rows.push(base().with("march", "ours: line of sight").with("rms_error", los_error));

    for step in [16.0, 8.0, 4.0, 2.0, 1.0, 0.5] {
        check_cancelled(context)?;
        let scalar = ThesisMarch::new(field, view, step);
        let options = Options { scheme: Scheme::Euler, step_voxels: step, ..Options::default() };
        let kernel = Deviational::new(field, view, Interpolant::TrilinearGradient, options);
        let baselines: [(&str, &dyn LightPaths); 2] = [
            ("dissertation, from the text", &scalar),
            ("dissertation's scheme in our kernel", &kernel),
        ];
        for (baseline, paths) in baselines {
            let (rms, largest) = error_of(&traced(paths, starts), truth);
            let best = traced_ours
                .iter()
                .filter(|o| o.error <= rms)
                .min_by(|a, b| a.secs.total_cmp(&b.secs));
            let what = format!("{n}³, {view_name}, step {step}");
            let Some(best) = best else {
                record.missing.push(format!(
                    "{baseline}, {what}: its error of {rms:.1e} is below that of every traced setting \
                     of ours"
                ));
                continue;
            };
            let mut variants =
                vec![tracing("baseline", paths, starts), tracing("traced", &*best.paths, starts)];
            if los_error <= rms {
                variants.push(tracing("line of sight", &projected, starts));
                variants.push(Variant::new("line of sight, projected anew", || {
                    fingerprint(&traced(&los(), starts))
                }));
            }
            let timings =
                interleave(&context.schedule(Schedule::one_thread(), 0.5), &mut variants)?;
            let ns =
                |name: &str| timings.summary(name).map(|s| s.median * 1e9 / starts.len() as f64);
            record.rows.push(
                base()
                    .with("march", baseline)
                    .with("step", step)
                    .with("rms_error", rms)
                    .with("largest_error", largest)
                    .with("time", ns("baseline"))
                    .with("ours", best.name.as_str())
                    .with("our_error", best.error)
                    .with("our_time", ns("traced")),
            );
            for variant in ["traced", "line of sight", "line of sight, projected anew"] {
                if let Some(r) = timings.ratio(variant, "baseline") {
                    record.ratios.push(Ratio {
                        name: format!("{what}: {variant}"),
                        baseline: baseline.into(),
                        ..r
                    });
                }
            }
        }
    }
    Ok(())
}

/// Our settings, traced.
fn ours(field: &Field, view: View) -> Vec<OurMarch<'_>> {
    let mut list = vec![];
    for (name, interpolant) in [
        ("Verlet, b-spline", Interpolant::BSpline),
        ("Verlet, trilinear gradients", Interpolant::TrilinearGradient),
        ("Verlet, trilinear", Interpolant::Trilinear),
    ] {
        for step_voxels in [16.0, 8.0, 4.0, 2.0, 1.0, 0.5] {
            let options = Options { step_voxels, ..Options::default() };
            let paths = Box::new(Deviational::new(field, view, interpolant, options));
            list.push(OurMarch {
                name: format!("{name}, step {step_voxels}"),
                paths,
                error: f64::INFINITY,
                secs: f64::INFINITY,
            });
        }
    }
    list
}

/// Determines the errors of all settings, and their times in one alternating trial.
fn trial(ours: &mut [OurMarch<'_>], starts: &[Start], truth: &[[f64; 2]]) -> anyhow::Result<()> {
    // The runs that determine the errors also serve as warm-up.
    let schedule =
        Schedule { warmup_rounds: 0, rounds: 2, min_rounds: 2, ..Schedule::one_thread() };
    for o in ours.iter_mut() {
        (o.error, _) = error_of(&traced(&*o.paths, starts), truth);
    }
    let mut variants: Vec<Variant<'_>> =
        ours.iter().map(|o| tracing(&o.name, &*o.paths, starts)).collect();
    let timings = interleave(&schedule, &mut variants)?;
    drop(variants);
    for (o, timed) in ours.iter_mut().zip(&timings.variants) {
        o.secs = timed.summary(timings.clock).low;
    }
    Ok(())
}

fn tracing<'a>(name: &str, paths: &'a dyn LightPaths, starts: &'a [Start]) -> Variant<'a> {
    let exits = std::rc::Rc::new(RefCell::new(vec![Exit::UNDISTURBED; starts.len()]));
    let seen = exits.clone();
    Variant::checked(
        name,
        move || paths.trace(starts, &mut exits.borrow_mut()),
        move || fingerprint(&seen.borrow()),
    )
}

/// Bars of the ratios, and error against time on the finest lattice.
fn plot(record: &mut Record) {
    let (from_text, in_kernel) =
        ("dissertation, from the text", "dissertation's scheme in our kernel");
    let mut bars = Plot::bars(
        "The dissertation's time / ours, traced, at an error that is not larger",
        Axis::log("ratio, above 1 ours is faster", ""),
        vec![],
    );
    bars.mark = Some(1.0);
    for baseline in [from_text, in_kernel] {
        let mut series = Series::new(format!("against the {baseline}"), vec![]);
        for r in
            record.ratios.iter().filter(|r| r.baseline == baseline && r.name.ends_with(": traced"))
        {
            let what = r.name.split(": ").next().unwrap_or_default().to_string();
            let x = bars.categories.iter().position(|c| *c == what).unwrap_or_else(|| {
                bars.categories.push(what);
                bars.categories.len() - 1
            });
            series.points.push(Point { x: x as f64, y: r.value, range: Some((r.low, r.high)) });
        }
        bars.series.push(series);
    }
    record.plots.push(bars);

    let finest = record.rows.iter().filter_map(|r| r.number("nodes")).fold(0.0, f64::max);
    for view in ["axis", "0.6 rad"] {
        let mut lines = Plot::lines(
            &format!("Error against time, {finest}³ nodes, {view}"),
            Axis::log("CPU time of a ray", "ns"),
            Axis::log("rms error / largest deflection", ""),
        );
        for r in &record.rows {
            let here = r.number("nodes") == Some(finest) && r.text("view") == Some(view);
            let (Some(march), Some(x), Some(y), true) =
                (r.text("march"), r.number("time"), r.number("rms_error"), here)
            else {
                continue;
            };
            let name = march.split(", step").next().unwrap_or(march).to_string();
            let point = Point { x, y, range: None };
            match lines.series.iter_mut().find(|s| s.name == name) {
                Some(s) => s.points.push(point),
                None => lines.series.push(Series { name, points: vec![point] }),
            }
        }
        record.plots.push(lines);
    }
}
