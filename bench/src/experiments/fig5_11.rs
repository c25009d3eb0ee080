//! Figure 5.11: photons per second by technique, on the combustion jet of 480x720x100, along
//! straight lines of sight and with ray tracing.

use super::Context;
use super::test_section::{
    GTX_280_PHOTONS_PER_SEC, check_cancelled, flow, image, render_image, scene,
};
use crate::clock::Clock;
use crate::plot::{Axis, Plot, Point, Series};
use crate::record::{Record, Row};
use crate::runner::{Schedule, Variant, interleave};
use rt_core::sampler::Sampling;
use schlieren::field::Field;
use schlieren::film::Film;
use schlieren::film::photons::{Exposure, expose};
use schlieren::media::{Media, Property, Volume};
use schlieren::path::{LightPaths, PathQuantities};
use schlieren::render::{TestSection, framing, technique};
use schlieren::scene::Scene;
use schlieren::technique::Technique;
use std::sync::atomic::AtomicBool;

/// Techniques of the figure, as scenes.
const TECHNIQUES: [(&str, &str); 9] = [
    ("shadowgraph", "[technique]\nkind = \"shadowgraph\""),
    ("schlieren, knife", "[technique]\nkind = \"schlieren\""),
    // This pair shows the cost of absorption, and that scenes without it pay nothing.
    (
        "schlieren, knife, smoke",
        "[technique]\nkind = \"schlieren\"\n[media]\nabsorption = \"smoke\"",
    ),
    (
        "schlieren, circle",
        "[technique]\nkind = \"schlieren\"\ncutoff = { kind = \"circle\", radius_m = 2e-4 }",
    ),
    (
        "schlieren, complemented circle",
        "[technique]\nkind = \"schlieren\"\ncutoff = { kind = \"complemented-circle\", radius_m = \
         2e-4 }",
    ),
    (
        "schlieren, colour",
        "[technique]\nkind = \"schlieren\"\ncutoff = { kind = \"color\", radius_m = 5e-4 }",
    ),
    ("interferogram, infinite fringe", "[technique]\nkind = \"interferogram\""),
    (
        "interferogram, finite fringe",
        "[technique]\nkind = \"interferogram\"\nfringe_spacing_m = 2e-3",
    ),
    ("BOS", "[technique]\nkind = \"bos\""),
];

const PIXELS: u32 = 512;
const LOS: &str = "line of sight";
const TRACED: &str = "traced";

/// What a technique needs from light paths: backward tracing, the optical path, smoke.
type Needs = (bool, bool, bool);

/// A technique ready to be exposed.
struct Bench {
    name: &'static str,
    scene: Scene,
    technique: Technique,
    needs: Needs,
}

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("technique", "", "what is made of the light");
    record.column(
        "march",
        "",
        "by line of sight (one projection), or every photon through the \
                                volume (Verlet, b-spline, a step a voxel)",
    );
    record.column(
        "photons",
        "",
        "photons of a run: 512² pixels, 10 each by line of sight, 1 traced",
    );
    record.column("rate", "Mphoton/s", "photons by median wall time on all threads, start to film");
    record.column("rate_per_core", "Mphoton/s", "photons by CPU time of all threads");
    record.column("frames", "1/s", "frames of 512² pixels with 10 photons each, by that rate");
    record.column(
        "of_gtx280",
        "",
        "rate by the 34.1 Mphoton/s (13 frames) that the dissertation reports for its GTX 280",
    );
    record.column(
        "picture",
        "s",
        "wall time of a whole image with the field in memory: plan, \
                                   projection or spline, 16 photons a pixel or beams",
    );
    let threads = rayon::current_num_threads();
    record.notes.push(format!(
        "Everything a photon needs: low-discrepancy start, path through the gas, technique, film. \
         Wall time on {threads} threads; the rate per core \
         is by CPU time and is what an idle core does. The projection of line of sight and the \
         spline of the march are made once for a view and \
         are not in the rates; `picture` is a whole `schlieren render` without reading the file. \
         Smoke (absorption, on the flow's \
         own lattice) stands in the test section of every row; only the row that calls for it \
         walks through it."
    ));
    let (size, dims) = ("thesis", "480x720x100");
    context.report_step(format!("combustion jet {dims}"))?;
    let field = flow("combustion-jet", size)?;
    check_cancelled(context)?;
    let first = scene(TECHNIQUES[0].1)?;
    let mut section = TestSection::of_fields(&first, vec![field], None)?;
    let smoke = smoke(&section.fields[0])?;
    section = section.with_media(smoke);
    section.warnings.clear();
    let mut benches = vec![];
    for (name, toml) in TECHNIQUES {
        let scene = scene(toml)?;
        let framing = framing(&scene, &section);
        let technique = technique(&scene, 0, &framing, section.fields[0].n0(), false)?;
        let needs = (technique.samples_from_film(), technique.needs_opd(), !scene.media.is_empty());
        benches.push(Bench { name, scene, technique, needs });
    }

    for (march, method, passes) in [(LOS, "line-of-sight", 10), (TRACED, "verlet", 1)] {
        // Light paths that several techniques share are computed once.
        let mut shared: Vec<(Needs, Box<dyn LightPaths + '_>)> = vec![];
        for b in &benches {
            if shared.iter().any(|s| s.0 == b.needs) {
                continue;
            }
            check_cancelled(context)?;
            context.report_step(format!("preparing {march} for {}", b.name))?;
            let mut scene = b.scene.clone();
            scene.march.method = Some(method.into());
            scene.march.interpolant = Some("b-spline".into());
            scene.march.step_voxels = Some(1.0).filter(|_| march == TRACED);
            let planned =
                section.paths(&scene, 0, PathQuantities { opd: b.needs.1 }, b.needs.0, false)?;
            shared.push((b.needs, planned.paths));
        }
        let mut variants: Vec<Variant<'_>> = vec![];
        for b in &benches {
            let Some((_, paths)) = shared.iter().find(|s| s.0 == b.needs) else { continue };
            let (section, paths) = (&section, &**paths);
            variants.push(Variant::new(b.name, move || exposed(b, section, paths, passes)));
        }
        context.report_step(format!("photons by technique, {march}"))?;
        let timings = interleave(&context.schedule(Schedule::all_threads(), 8.0), &mut variants)?;
        drop(variants);
        let photons = f64::from(PIXELS * PIXELS * passes);
        for v in &timings.variants {
            let (wall, cpu) = (v.summary(Clock::Wall).median, v.summary(Clock::ProcessCpu).median);
            let rate = photons / wall;
            record.rows.push(
                Row::new()
                    .with("technique", v.name.as_str())
                    .with("march", march)
                    .with("photons", photons)
                    .with("rate", rate / 1e6)
                    .with("rate_per_core", photons / cpu / 1e6)
                    .with("frames", rate / f64::from(PIXELS * PIXELS * 10))
                    .with("of_gtx280", rate / GTX_280_PHOTONS_PER_SEC),
            );
        }
    }
    images(context, record, &section)?;
    plot(record);
    Ok(())
}

/// Smoke whose density follows the disturbance of the gas, on the flow's own lattice: at most 2 per
/// metre.
fn smoke(field: &Field) -> anyhow::Result<Media> {
    let largest = field.eps().iter().fold(f32::MIN_POSITIVE, |m, e| m.max(e.abs()));
    let values = field.eps().iter().map(|e| 2.0 * e.abs() / largest).collect();
    let volume = Volume::new(field.dims(), field.spacing_m(), field.origin_m(), values, None)?;
    Ok(Media::default().with(Property::Absorption, volume))
}

/// Makes one exposure; returns the light on the film.
fn exposed(b: &Bench, section: &TestSection, paths: &dyn LightPaths, passes: u32) -> u64 {
    let never = AtomicBool::new(false);
    let framing = framing(&b.scene, section);
    let exposure = Exposure {
        paths,
        technique: &b.technique,
        solids: None,
        sampling: Sampling::Sobol,
        seed: 0,
        margin_px: 0,
        tilted_beams: false,
    };
    fn light<const C: usize>(
        e: &Exposure<'_>,
        film: Film<C>,
        passes: u32,
        never: &AtomicBool,
    ) -> u64 {
        expose(e, std::slice::from_ref(&film), 0..passes, false, never, &|_| {});
        film.to_pixels(f64::from(passes))
            .iter()
            .flatten()
            .map(|v| f64::from(*v))
            .sum::<f64>()
            .to_bits()
    }
    if b.technique.is_colored() {
        light(&exposure, Film::<3>::new(framing, false), passes, &never)
    } else {
        light(&exposure, Film::<1>::new(framing, false), passes, &never)
    }
}

/// Complete images by line of sight, the comparisons without photons, and one whose march is chosen
/// by the default tolerance.
fn images(
    context: &mut Context<'_>,
    record: &mut Record,
    section: &TestSection,
) -> anyhow::Result<()> {
    let los = "[march]\nmethod = \"line-of-sight\"";
    let mut list: Vec<(String, String)> = vec![];
    for (name, toml) in TECHNIQUES {
        list.push((name.into(), format!("{toml}\n{los}")));
    }
    for name in ["slice", "volume"] {
        list.push((name.into(), format!("[technique]\nkind = \"{name}\"")));
    }
    list.push(("schlieren, knife, to 1e-7 rad".into(), TECHNIQUES[1].1.into()));
    if context.quick {
        // Two techniques represent all.
        list.retain(|(name, _)| name == TECHNIQUES[1].0 || name == "slice");
    }
    for (name, toml) in list {
        context.report_step(format!("image: {name}"))?;
        let scene = scene(&toml)?;
        let start = std::time::Instant::now();
        let rendered = render_image(context, &scene, section)?;
        let secs = start.elapsed().as_secs_f64();
        let march = rendered.report.march.as_str();
        record.rows.push(
            Row::new().with("technique", name.as_str()).with("march", march).with("picture", secs),
        );
        let march = if march.is_empty() { "no light" } else { march };
        let caption = format!("{name}: combustion jet, 512² pixels, {secs:.2} s; {march}");
        record.images.push(image(&name, caption, &rendered)?);
    }
    Ok(())
}

fn plot(record: &mut Record) {
    let names: Vec<String> = TECHNIQUES.iter().map(|t| t.0.to_string()).collect();
    let mut plot = Plot::bars(
        "Photons per second by technique",
        Axis::log("photons on all threads", "1/s"),
        names.clone(),
    );
    for (march, column, suffix) in [
        (LOS, "rate", ""),
        (LOS, "rate_per_core", ", one core by CPU time"),
        (TRACED, "rate", ""),
        (TRACED, "rate_per_core", ", one core by CPU time"),
    ] {
        let of_march = record.rows.iter().filter(|r| r.text("march") == Some(march));
        let point = |r: &Row| {
            let x = names.iter().position(|n| Some(n.as_str()) == r.text("technique"))? as f64;
            Some(Point { x, y: r.number(column)? * 1e6, range: None })
        };
        let points = of_march.filter_map(point).collect();
        plot.series.push(Series { name: format!("{march}{suffix}"), points });
    }
    let everywhere = (0..names.len()).map(|i| (i as f64, GTX_280_PHOTONS_PER_SEC)).collect();
    plot.series.push(Series::new("the dissertation’s GTX 280", everywhere));
    record.plots.push(plot);
}
