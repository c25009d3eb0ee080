//! Speed of ray marching through a field: ray-steps and photons per second at 256³ and 256 steps,
//! and a frame of the combustion jet.

use super::Context;
use super::test_section::{
    GTX_280_PHOTONS_PER_SEC, check_cancelled, fingerprint, flow, oblique, scene, tiles,
};
use crate::clock::Clock;
use crate::plot::{Axis, Plot, Point, Series};
use crate::record::{Record, Row};
use crate::runner::{Schedule, Timings, Variant, interleave};
use glam::DVec3;
use schlieren::field::Field;
use schlieren::film::Film;
use schlieren::film::photons::{Exposure, expose};
use schlieren::interpolate::Interpolant;
use schlieren::march::{BlankCells, Deviational, LineOfSight, Options};
use schlieren::path::{Exit, LightPaths, PathQuantities, Start};
use schlieren::render::{TestSection, framing, technique};
use schlieren::view::{Axis as ViewAxis, View};
use std::cell::RefCell;
use std::sync::atomic::AtomicBool;

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("what", "", "kernel and view");
    record.column("unit", "", "what is counted");
    record.column("threads", "", "threads");
    record.column("rate", "1/s", "count by median wall time");
    record.column("rate_low", "1/s", "slowest round");
    record.column("rate_high", "1/s", "fastest round");
    record.column(
        "rate_per_core",
        "1/s",
        "count by median CPU time of all threads: what a core that runs nothing else does",
    );
    record.column("bar", "1/s", "what it should reach on two idle cores");
    record.column("of_bar", "", "rate by bar");
    record.column("of_bar_idle", "", "rate of two cores by CPU time, by bar");
    record.notes.push(
        "Wall time on all threads; on a machine that others use, the rate per core (by CPU time) \
         is the steadier number. \
         of_bar compares what was seen, of_bar_idle two cores' worth of CPU time. Marches take 256 \
         steps of one voxel \
         through 256³ nodes, rays in tiles of 4 by 4 as the renderer sends them."
            .into(),
    );
    marches(context, record)?;
    check_cancelled(context)?;
    jet(context, record)?;
    plots(record);
    Ok(())
}

/// Adds a row for each variant; `count` is the amount of work of one run.
fn rows(record: &mut Record, timings: &Timings, counts: &[(f64, &str, Option<f64>)]) {
    for (v, (count, unit, bar)) in timings.variants.iter().zip(counts) {
        let (wall, cpu) = (v.summary(Clock::Wall), v.summary(Clock::ProcessCpu));
        let (rate, per_core) = (count / wall.median, count / cpu.median);
        record.rows.push(
            Row::new()
                .with("what", v.name.as_str())
                .with("unit", *unit)
                .with("threads", rayon::current_num_threads())
                .with("rate", rate)
                .with("rate_low", count / wall.high)
                .with("rate_high", count / wall.low)
                .with("rate_per_core", per_core)
                .with("bar", *bar)
                .with("of_bar", bar.map(|b| rate / b))
                .with("of_bar_idle", bar.map(|b| 2.0 * per_core / b)),
        );
    }
}

fn marches(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    let n = 256;
    context.report_step("a field of 256³ nodes")?;
    let blob = |p: DVec3| 1e-5 * (-p.length_squared() / (2.0 * 0.0144)).exp();
    let field = Field::from_fn([n; 3], [1.0 / (n - 1) as f64; 3], DVec3::splat(-0.5), 1.0, blob)?;
    let views =
        [("along an axis", View::along(ViewAxis::Z, DVec3::ZERO)), ("at 0.6 rad", oblique()?)];
    let quantities = PathQuantities { opd: false };
    for (view_name, view) in views {
        let rays = tiles(if context.quick { 192 } else { 256 }, 0.9);
        let photons = tiles(if context.quick { 1024 } else { 2048 }, 0.9);
        let mut marches = vec![];
        for (name, interpolant, bar) in [
            ("trilinear", Interpolant::Trilinear, Some(4e8)),
            ("trilinear gradients", Interpolant::TrilinearGradient, None),
            ("b-spline", Interpolant::BSpline, Some(6e7)),
        ] {
            context.report_step(format!("{name}, {view_name}"))?;
            let march = Deviational::new(
                &field,
                view,
                interpolant,
                Options { quantities, ..Options::default() },
            );
            marches.push((format!("{name}, {view_name}"), march, bar));
        }
        let los =
            LineOfSight::new(&field, view, Interpolant::BSpline, quantities, BlankCells::Opaque);
        // Work of one run, from the march's own counters.
        let mut counts = vec![];
        for (_, march, bar) in &marches {
            let mut exits = vec![Exit::UNDISTURBED; rays.len()];
            march.trace_parallel(&rays, &mut exits);
            counts.push((march.counters().ray_steps as f64, "ray-steps", *bar));
        }
        counts.push((photons.len() as f64, "photons", Some(3e7)));
        let mut variants: Vec<Variant<'_>> =
            marches.iter().map(|(name, march, _)| tracing(name, march, &rays)).collect();
        let los_name = format!("line of sight, {view_name}");
        variants.push(tracing(&los_name, &los, &photons));
        context.report_step(format!("tracing, {view_name}"))?;
        let timings = interleave(&context.schedule(Schedule::all_threads(), 6.0), &mut variants)?;
        rows(record, &timings, &counts);
    }
    Ok(())
}

/// One run traces all rays in parallel; the exits are inspected outside the measured time.
fn tracing<'a>(name: &str, paths: &'a dyn LightPaths, starts: &'a [Start]) -> Variant<'a> {
    let exits = std::rc::Rc::new(RefCell::new(vec![Exit::UNDISTURBED; starts.len()]));
    let seen = exits.clone();
    Variant::checked(
        name,
        move || paths.trace_parallel(starts, &mut exits.borrow_mut()),
        move || fingerprint(&seen.borrow()),
    )
}

/// A frame of 512² pixels with 10 photons each, of the combustion jet, by line of sight:
/// corresponds to the 13 frames per second of figure 5.11.
fn jet(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    context.report_step("combustion jet 480x720x100")?;
    let field = flow("combustion-jet", "thesis")?;
    check_cancelled(context)?;
    let scene = scene("[technique]\nkind = \"schlieren\"")?;
    let section = TestSection::of_fields(&scene, vec![field], None)?;
    let (field, view) = (&section.fields[0], section.view);
    let framing = framing(&scene, &section);
    let technique = technique(&scene, 0, &framing, field.n0(), false)?;
    let los = |f: &Field| {
        LineOfSight::new(
            f,
            view,
            Interpolant::BSpline,
            PathQuantities::default(),
            BlankCells::Opaque,
        )
    };
    let held = los(field);
    let never = AtomicBool::new(false);
    let frame = |paths: &LineOfSight| {
        let exposure = Exposure {
            paths,
            technique: &technique,
            solids: None,
            sampling: rt_core::sampler::Sampling::Sobol,
            seed: 0,
            margin_px: 0,
            tilted_beams: false,
        };
        let film = Film::<1>::new(framing, false);
        let done = expose(&exposure, std::slice::from_ref(&film), 0..10, false, &never, &|_| {});
        let light: f64 = film.to_pixels(10.0).iter().map(|p| f64::from(p[0])).sum();
        (done.map_or(0, |d| d.tally.sent), light.to_bits())
    };
    let photons = frame(&held).0 as f64;
    let mut variants = vec![
        Variant::new("jet frame, view held", || frame(&held).1),
        Variant::new("jet frame, new view every frame", || frame(&los(field)).1),
    ];
    context.report_step("frames of the jet")?;
    let timings = interleave(&context.schedule(Schedule::all_threads(), 6.0), &mut variants)?;
    let bar = Some(GTX_280_PHOTONS_PER_SEC);
    rows(record, &timings, &[(photons, "photons", bar), (photons, "photons", bar)]);
    for v in &timings.variants {
        let (wall, cpu) = (v.summary(Clock::Wall).median, v.summary(Clock::ProcessCpu).median);
        record.notes.push(format!(
            "{} (480x720x100 nodes, 512² pixels, 10 photons each, knife, whole exposure): {:.1} \
             frames/s seen, {:.1} by the CPU \
             time of two cores; the dissertation's GTX 280 reached 13.",
            v.name,
            1.0 / wall,
            2.0 / cpu
        ));
    }
    Ok(())
}

fn plots(record: &mut Record) {
    for (unit, title) in
        [("ray-steps", "Ray-steps per second, 256³, 256 steps"), ("photons", "Photons per second")]
    {
        let of_unit = || record.rows.iter().filter(|r| r.text("unit") == Some(unit));
        let names: Vec<String> =
            of_unit().filter_map(|r| r.text("what").map(String::from)).collect();
        let mut plot = Plot::bars(title, Axis::log("rate", "1/s"), names);
        let mut series = [
            Series::new("all threads, wall time", vec![]),
            Series::new("two cores by CPU time", vec![]),
            Series::new("bar", vec![]),
        ];
        for (i, r) in of_unit().enumerate() {
            let at = |y: Option<f64>, range| y.map(|y| Point { x: i as f64, y, range });
            let range = r.number("rate_low").zip(r.number("rate_high"));
            series[0].points.extend(at(r.number("rate"), range));
            series[1].points.extend(at(r.number("rate_per_core").map(|c| 2.0 * c), None));
            series[2].points.extend(at(r.number("bar"), None));
        }
        plot.series.extend(series);
        record.plots.push(plot);
    }
}
