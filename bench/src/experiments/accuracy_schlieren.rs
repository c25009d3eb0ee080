//! Error against time of ray paths through a gas, by integrator, interpolant, step and precision,
//! on closed-form solutions. Also compares the requested tolerance with the measured error.

use super::Context;
use super::test_section::{
    blob, blob_deflections, check_cancelled, error_of, fingerprint, oblique, tiles, traced,
};
use crate::baselines::thesis_schlieren::ThesisMarch;
use crate::clock;
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use crate::runner::{Schedule, VERDICT_ROUNDS, Variant, interleave};
use glam::DVec3;
use schlieren::analytic::Luneburg;
use schlieren::field::Field;
use schlieren::interpolate::{BSpline, Interpolant, Interpolate, Trilinear, TrilinearGradient};
use schlieren::march::{
    BlankCells, CellExact, Deviational, DormandPrince, Euler, Full, FullOptions, Integrator,
    LineOfSight, Options, Pefrl, Ray, RungeKutta4, Scheme, Sharma, Verlet,
};
use schlieren::path::{LightPaths, PathQuantities, Start};
use schlieren::plan::{Mode, Plan, Request};
use schlieren::view::View;
use std::f64::consts::FRAC_PI_2;

const INTERPOLANTS: [(&str, Interpolant); 3] = [
    ("b-spline", Interpolant::BSpline),
    ("trilinear gradients", Interpolant::TrilinearGradient),
    ("trilinear", Interpolant::Trilinear),
];

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("part", "", "what is measured: `lattice`, `integrators` or `tolerance`");
    record.column("march", "", "integrator, and for the dissertation's own the form of its state");
    record.column("interpolant", "", "between the nodes");
    record.column("precision", "", "of the march's numbers");
    record.column("step", "voxel", "longest step");
    record.column("samples", "", "samples of the medium along a ray");
    record.column(
        "time",
        "ns",
        "CPU time of one thread for a ray: lattice and tolerance median \
                                 over rounds in turns, integrators fastest of three runs",
    );
    record.column(
        "rms_error",
        "",
        "root mean square over rays, as part of the largest true deflection (Luneburg: of the \
         radius)",
    );
    record.column("largest_error", "", "largest error, the same way");
    record.column(
        "order",
        "",
        "observed order: from this and the row before, at half as many samples",
    );
    record.column("amplitude", "", "largest eps of the blob");
    record.column("asked", "rad", "tolerance asked for");
    record.column("bound", "rad", "a-priori bound of all errors of the plan");
    record.column("estimated", "rad", "error that the plan measured itself (march and arithmetic)");
    record.column("got", "rad", "largest true error");
    record.column("kept", "", "whether what was got is within what was asked");
    for amplitude in [1e-5, 0.03] {
        lattice(context, record, amplitude)?;
    }
    integrators(context, record)?;
    tolerances(context, record)
}

/// Rays for timing, and rays for the comparison with the exact solution.
struct Rays {
    timed: Vec<Start>,
    compared: Vec<Start>,
    truth: Vec<[f64; 2]>,
}

impl Rays {
    /// A march that takes these rays.
    fn march_case<'a>(&'a self, paths: Box<dyn LightPaths + 'a>) -> MarchCase<'a> {
        MarchCase { rays: self, paths }
    }
}

/// Rays and the march that traces them.
struct MarchCase<'a> {
    rays: &'a Rays,
    paths: Box<dyn LightPaths + 'a>,
}

/// Alternates the cases on this thread. Returns for each the median time in ns per ray, the rms
/// error and the largest error.
fn measure_cases(quick: bool, cases: &[MarchCase<'_>]) -> anyhow::Result<Vec<(f64, f64, f64)>> {
    // The runs that determine the errors also serve as warm-up.
    let errors: Vec<(f64, f64)> = cases
        .iter()
        .map(|s| error_of(&traced(&*s.paths, &s.rays.compared), &s.rays.truth))
        .collect();
    let mut variants: Vec<Variant<'_>> = cases
        .iter()
        .enumerate()
        .map(|(i, s)| {
            Variant::new(i.to_string(), move || fingerprint(&traced(&*s.paths, &s.rays.timed)))
        })
        .collect();
    let timings = interleave(&rounds_of(quick), &mut variants)?;
    let times = timings.variants.iter().zip(cases);
    let ns = times.map(|(v, s)| v.summary(timings.clock).median * 1e9 / s.rays.timed.len() as f64);
    Ok(ns.zip(errors).map(|(ns, (rms, largest))| (ns, rms, largest)).collect())
}

/// The schedule of the timings in this experiment.
fn rounds_of(quick: bool) -> Schedule {
    let rounds = if quick { 3 } else { VERDICT_ROUNDS as u32 };
    Schedule { warmup_rounds: 0, rounds, min_rounds: rounds, ..Schedule::one_thread() }
}

fn steps(quick: bool) -> &'static [f64] {
    if quick {
        &[16.0, 8.0, 4.0, 2.0, 1.0, 0.5]
    } else {
        &[16.0, 8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.125]
    }
}

/// A blob on a lattice, viewed obliquely: every march, interpolant and step.
fn lattice(context: &mut Context<'_>, record: &mut Record, amplitude: f64) -> anyhow::Result<()> {
    let n = if context.quick { 96 } else { 128 };
    context.report_step(format!("closed form on a lattice, amplitude {amplitude:e}"))?;
    let (gaussian, field) = blob(amplitude, n)?;
    let view = oblique()?;
    // The same rays are compared for all. The f64 marches trace one ray at a time and take ten
    // times as long, so fewer rays are timed for them.
    let compared = tiles(if context.quick { 16 } else { 32 }, 0.5);
    let truth = blob_deflections(&gaussian, &view, &compared)?;
    let few = Rays { timed: compared.clone(), compared, truth };
    let fast =
        Rays { timed: tiles(64, 0.5), compared: few.compared.clone(), truth: few.truth.clone() };
    if amplitude < 1e-3 {
        record.notes.push(format!(
            "Lattice: blobs of eps 1e-5 (a gas) and 0.03 (a liquid) and sigma 0.08 m in a cube of \
             1 m, {n}³ nodes (sigma is {:.1} voxels), seen 0.6 \
             rad off its axes. The truth is an adaptive march in f64 through the blob itself. f32 \
             marches carry deviations, sixteen rays at a time; \
             f64 marches take one ray at a time; the cell-exact one ends its steps on the faces of \
             cells and takes three Gauss points in each, so that what it \
             has left of error is the interpolant's. The dissertation's march carries position and \
             direction in f32.",
            0.08 * (n - 1) as f64
        ));
    }
    // Build the splines first: settings borrow them.
    let spline = BSpline::new(&field);
    let linear = Trilinear::new(&field);
    let gradients = TrilinearGradient::new(&field);
    let mut named: Vec<(&str, &str, &str, Option<f64>)> = vec![];
    let mut cases: Vec<MarchCase<'_>> = vec![];
    let los = LineOfSight::new(
        &field,
        view,
        Interpolant::BSpline,
        PathQuantities::default(),
        BlankCells::Opaque,
    );
    named.push(("line of sight", "b-spline", "f32", None));
    cases.push(fast.march_case(Box::new(los)));
    for (name, interpolant) in INTERPOLANTS {
        for &step_voxels in steps(context.quick) {
            check_cancelled(context)?;
            for (march, scheme) in [("Verlet", Scheme::Verlet), ("Euler", Scheme::Euler)] {
                let options = Options { scheme, step_voxels, ..Options::default() };
                named.push((march, name, "f32", Some(step_voxels)));
                cases.push(fast.march_case(Box::new(Deviational::new(
                    &field,
                    view,
                    interpolant,
                    options,
                ))));
            }
            let options = FullOptions { step_voxels, ..FullOptions::default() };
            let full = FullMarches { field: &field, view, options };
            let all = match interpolant {
                Interpolant::BSpline => full.all(&spline),
                Interpolant::Trilinear => full.all(&linear),
                Interpolant::TrilinearGradient => full.all(&gradients),
            };
            for (march, paths) in all {
                named.push((march, name, "f64", Some(step_voxels)));
                cases.push(few.march_case(paths));
            }
        }
    }
    for &step in steps(context.quick) {
        named.push(("dissertation", "trilinear gradients", "f32", Some(step)));
        cases.push(few.march_case(Box::new(ThesisMarch::new(&field, view, step))));
    }
    context.report_step(format!("amplitude {amplitude:e}: {} settings in turns", cases.len()))?;
    let results = measure_cases(context.quick, &cases)?;

    let mut curves: Vec<Series> = vec![];
    let mut add =
        |march: &str, interpolant: &str, precision: &str, step: Option<f64>, m: (f64, f64, f64)| {
            record.rows.push(
                Row::new()
                    .with("part", "lattice")
                    .with("march", march)
                    .with("interpolant", interpolant)
                    .with("precision", precision)
                    .with("step", step)
                    .with("time", m.0)
                    .with("rms_error", m.1)
                    .with("largest_error", m.2)
                    .with("amplitude", amplitude),
            );
            let name = format!("{march}, {interpolant}, {precision}");
            match curves.iter_mut().find(|s| s.name == name) {
                Some(s) => s.points.extend(Series::new("", vec![(m.0, m.1)]).points),
                None => curves.push(Series::new(name, vec![(m.0, m.1)])),
            }
        };
    for ((march, interpolant, precision, step), m) in named.into_iter().zip(results) {
        add(march, interpolant, precision, step, m);
    }
    // All curves are in the rows; the plot has those that answer a question.
    const SHOWN: [&str; 11] = [
        "line of sight, b-spline, f32",
        "Verlet, b-spline, f32",
        "Euler, b-spline, f32",
        "Verlet, b-spline, f64",
        "Sharma, b-spline, f64",
        "PEFRL, b-spline, f64",
        "cell-exact, b-spline, f64",
        "Verlet, trilinear gradients, f32",
        "Euler, trilinear gradients, f32",
        "Verlet, trilinear, f32",
        "dissertation, trilinear gradients, f32",
    ];
    let mut plot = Plot::lines(
        &format!("Error against time on a lattice, eps {amplitude}"),
        Axis::log("CPU time of a ray", "ns"),
        Axis::log("rms error / largest deflection", ""),
    );
    plot.series.extend(SHOWN.iter().filter_map(|s| curves.iter().find(|c| c.name == *s).cloned()));
    record.plots.push(plot);
    record.notes.push(describe_lattice(&record.rows, amplitude));
    Ok(())
}

/// Describes what determines the error on a lattice: rms errors by interpolant, by integrator, and
/// of the dissertation's march by step.
fn describe_lattice(rows: &[Row], amplitude: f64) -> String {
    let find = |march: &str, interpolant: &str, precision: &str, step: f64| {
        let here = |r: &&Row| {
            r.text("part") == Some("lattice")
                && r.number("amplitude") == Some(amplitude)
                && r.text("march") == Some(march)
                && r.text("interpolant") == Some(interpolant)
                && r.text("precision") == Some(precision)
                && r.number("step") == Some(step)
        };
        let error = rows.iter().find(here).and_then(|r| r.number("rms_error"));
        error.map_or("not measured".into(), |e| format!("{e:.1e}"))
    };
    let by_interpolant =
        INTERPOLANTS.map(|(i, _)| format!("{i} {}", find("Verlet", i, "f32", 1.0)));
    let by_march =
        ["Euler", "Verlet", "PEFRL"].map(|m| format!("{m} {}", find(m, "b-spline", "f64", 1.0)));
    let by_step = [16.0, 1.0, 0.5].map(|s| {
        format!("{} at steps of {s}", find("dissertation", "trilinear gradients", "f32", s))
    });
    format!(
        "eps {amplitude:e}, rms errors at steps of a voxel: by interpolant (Verlet, f32) {}; by \
         integrator (b-spline, f64) {}. The dissertation's march: \
         {} voxels.",
        by_interpolant.join(", "),
        by_march.join(", "),
        by_step.join(", ")
    )
}

/// The marches in f64 over one interpolant.
struct FullMarches<'a> {
    field: &'a Field,
    view: View,
    options: FullOptions,
}

impl<'a> FullMarches<'a> {
    fn one<I: Interpolate, G: Integrator + 'a>(
        &self,
        i: &'a I,
        integrator: G,
    ) -> Box<dyn LightPaths + 'a> {
        Box::new(Full::new(self.field, i, integrator, self.view, self.options))
    }

    fn all<I: Interpolate>(&self, i: &'a I) -> Vec<(&'static str, Box<dyn LightPaths + 'a>)> {
        let mut all = vec![
            ("Euler", self.one(i, Euler)),
            ("Verlet", self.one(i, Verlet)),
            ("Sharma", self.one(i, Sharma)),
            ("RK4", self.one(i, RungeKutta4)),
            ("PEFRL", self.one(i, Pefrl)),
        ];
        // The steps of this integrator end at the cells' faces, regardless of the requested step.
        if self.options.step_voxels == 1.0 {
            all.push(("cell-exact", self.one(i, CellExact::new(self.field))));
        }
        all
    }
}

/// A Luneburg lens without a lattice: the integrators in f64, with their orders.
fn integrators(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    context.report_step("integrators on the Luneburg lens")?;
    record.notes.push(
        "Integrators: 101 rays through a quarter turn of a Luneburg lens, f64, no lattice; the \
         error is that of the place they reach. \
         By theory orders are 1 for Euler, 2 for Verlet, 4 for Sharma, RK4 and PEFRL; the column \
         has what was observed. The adaptive Dormand-Prince is \
         the reference of everything else."
            .into(),
    );
    let mut plot = Plot::lines(
        "Integrators on the Luneburg lens",
        Axis::log("samples along a ray", ""),
        Axis::log("rms error / radius", ""),
    );
    plot.series.push(order_curve("Euler", Euler, record));
    plot.series.push(order_curve("Verlet", Verlet, record));
    plot.series.push(order_curve("Sharma", Sharma, record));
    plot.series.push(order_curve("RK4", RungeKutta4, record));
    plot.series.push(order_curve("PEFRL", Pefrl, record));
    // The adaptive integrator has a tolerance instead of a step.
    let mut points = vec![];
    for exponent in [4, 6, 8, 10, 12] {
        let march = DormandPrince { tolerance: 10f64.powi(-exponent), longest_step_m: 1.0 };
        let mut samples = 0;
        let m = lens(|b| {
            let run = march.run(&Luneburg, &entry_ray(b), FRAC_PI_2);
            samples = run.map_or(0, |r| r.samples);
            run.map_or(DVec3::NAN, |r| r.ray.position_m())
        });
        points.push((f64::from(samples), m.1));
        record.rows.push(integrator_row("Dormand-Prince", f64::from(samples), m));
    }
    plot.series.push(Series::new("Dormand-Prince", points));
    record.plots.push(plot);
    Ok(())
}

fn order_curve<G: Integrator>(name: &str, integrator: G, record: &mut Record) -> Series {
    let mut points: Vec<(f64, f64)> = vec![];
    for steps in [8, 16, 32, 64, 128, 256, 512] {
        let m = lens(|b| integrator.run(&Luneburg, &entry_ray(b), FRAC_PI_2, steps).position_m());
        let samples = f64::from(steps * G::SAMPLES);
        let before = points.last().map(|p| p.1);
        points.push((samples, m.1));
        let order = before.filter(|_| m.1 > 1e-13).map(|b| (b / m.1).log2());
        record.rows.push(integrator_row(name, samples, m).with("order", order));
    }
    Series::new(name, points)
}

fn integrator_row(name: &str, samples: f64, (ns, rms, largest): (f64, f64, f64)) -> Row {
    Row::new()
        .with("part", "integrators")
        .with("march", name)
        .with("interpolant", "none")
        .with("precision", "f64")
        .with("samples", samples)
        .with("time", ns)
        .with("rms_error", rms)
        .with("largest_error", largest)
}

/// The ray that enters the lens along z at height `b`.
fn entry_ray(b: f64) -> Ray {
    let (at, w) = Luneburg::ray(b, 0.0);
    Ray::new(at, w)
}

/// Time per ray, and rms and largest error of the position after a quarter turn.
fn lens(mut end: impl FnMut(f64) -> DVec3) -> (f64, f64, f64) {
    let heights: Vec<f64> = (-50..=50).map(|i| f64::from(i) * 0.018).collect();
    let mut ends = vec![];
    let secs = (0..3)
        .map(|_| {
            let (places, time) =
                clock::measure(|| heights.iter().map(|b| end(*b)).collect::<Vec<DVec3>>());
            ends = places;
            time.thread_cpu_secs
        })
        .fold(f64::INFINITY, f64::min);
    let off =
        heights.iter().zip(&ends).map(|(b, e)| (*e - Luneburg::ray(*b, FRAC_PI_2).0).length());
    let (squares, largest) = off.fold((0.0, 0.0f64), |(s, l), o| (s + o * o, l.max(o)));
    let n = heights.len() as f64;
    (secs * 1e9 / n, (squares / n).sqrt(), largest)
}

/// Describes how many plans met the requested tolerance, and how far the bounds exceed the measured
/// error.
fn describe_tolerances(rows: &[Row]) -> String {
    let plans: Vec<&Row> = rows.iter().filter(|r| r.text("part") == Some("tolerance")).collect();
    let kept = |r: &&&Row| r.text("kept") == Some("yes");
    let within = |r: &&&Row| r.number("bound").zip(r.number("asked")).is_some_and(|(b, a)| b <= a);
    let over: Vec<f64> = plans
        .iter()
        .filter_map(|r| r.number("bound").zip(r.number("got")))
        .filter(|(_, got)| *got > 0.0)
        .map(|(bound, got)| bound / got)
        .collect();
    let (low, high) = over.iter().fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(*v), h.max(*v)));
    format!(
        "Of {} plans {} kept the tolerance asked; of the {} whose own bound is within it {} did. \
         Bounds are {low:.1} to {high:.0} times the error got.",
        plans.len(),
        plans.iter().filter(kept).count(),
        plans.iter().filter(within).count(),
        plans.iter().filter(within).filter(kept).count()
    )
}

/// Plans for tolerances from coarse to fine: requested tolerance, error bound and measured error.
fn tolerances(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    let n = if context.quick { 64 } else { 128 };
    record.notes.push(format!(
        "Tolerance: plans for blobs of three amplitudes on {n}³ nodes. A plan's bound adds up \
         worst cases."
    ));
    let mut plot = Plot::lines(
        "Tolerance asked against error got",
        Axis::log("tolerance asked", "rad"),
        Axis::log("largest error got", "rad"),
    );
    let mut time = Plot::lines(
        "What a tolerance costs",
        Axis::log("tolerance asked", "rad"),
        Axis::log("CPU time of a ray", "ns"),
    );
    let starts = tiles(if context.quick { 32 } else { 64 }, 0.5);
    let view = oblique()?;
    let mut asked_line = vec![];
    for amplitude in [1e-6, 1e-5, 1e-4] {
        check_cancelled(context)?;
        context.report_step(format!("plans for an amplitude of {amplitude:e}"))?;
        let (gaussian, field) = blob(amplitude, n)?;
        let truth = blob_deflections(&gaussian, &view, &starts)?;
        let rays = Rays { timed: starts.clone(), compared: starts.clone(), truth: truth.clone() };
        let scale = truth.iter().map(|t| t[0].hypot(t[1])).fold(0.0, f64::max);
        let (mut got_points, mut time_points) = (vec![], vec![]);
        let exponents: Vec<i32> = (3..=10).collect();
        let plan_for = |e: &i32| {
            Plan::new(&field, Request { tolerance_rad: 10f64.powi(-e), ..Request::default() })
        };
        let plans: Vec<Plan> = exponents.iter().map(plan_for).collect();
        let cases: Vec<MarchCase<'_>> =
            plans.iter().map(|p| rays.march_case(p.paths(&field, view))).collect();
        let results = measure_cases(context.quick, &cases)?;
        for ((exponent, plan), (ns, rms, largest)) in exponents.into_iter().zip(&plans).zip(results)
        {
            let asked = 10f64.powi(-exponent);
            let b = plan.bounds;
            let got = largest * scale;
            got_points.push((asked, got));
            time_points.push((asked, ns));
            asked_line.push((asked, asked));
            let march = match plan.mode {
                Mode::LineOfSight => "line of sight",
                Mode::Paraxial => "Verlet",
                Mode::Full => "PEFRL",
            };
            let name = INTERPOLANTS.iter().find(|i| i.1 == plan.interpolant).map_or("", |i| i.0);
            record.rows.push(
                Row::new()
                    .with("part", "tolerance")
                    .with("march", march)
                    .with("interpolant", name)
                    .with("precision", if plan.mode == Mode::Full { "f64" } else { "f32" })
                    .with("step", plan.step_voxels)
                    .with("time", ns)
                    .with("rms_error", rms)
                    .with("largest_error", largest)
                    .with("amplitude", amplitude)
                    .with("asked", asked)
                    .with("bound", b.bending_rad + b.interpolation_rad + b.step_rad)
                    .with("estimated", plan.measure(&field, view, 256).max_rad)
                    .with("got", got)
                    .with("kept", if got <= asked { "yes" } else { "no" }),
            );
        }
        plot.series.push(Series::new(format!("amplitude {amplitude:e}"), got_points));
        time.series.push(Series::new(format!("amplitude {amplitude:e}"), time_points));
    }
    record.notes.push(describe_tolerances(&record.rows));
    asked_line.truncate(8);
    plot.series.push(Series::new("what was asked", asked_line));
    record.plots.push(plot);
    record.plots.push(time);
    Ok(())
}
