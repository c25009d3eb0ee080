//! Figure 5.14: noise against the number of samples, for independent and for low-discrepancy
//! photons, each with and without a filter. Also the difference between images with growing numbers
//! of samples, for which the dissertation gives numbers.

use super::Context;
use super::test_section::{check_cancelled, flow, image, render_image, scene};
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use schlieren::render::{RenderOutput, TestSection};
use schlieren::scene::{FilterSpec, Jitter, SamplingSpec, Scene};

/// Filters by name, in sizes for one photon per pixel.
pub(super) const FILTERS: [(&str, FilterSpec); 4] = [
    ("none", FilterSpec::None {}),
    ("gaussian", FilterSpec::Gaussian { sigma_px: 0.8 }),
    ("mean", FilterSpec::Mean { radius_px: 1.0 }),
    ("cone", FilterSpec::Cone { nearest: 12 }),
];

/// Seed of the references, which must not share photons with any measured image.
const REFERENCE_SEED: u64 = 0x5eed;

/// The dissertation's numbers: by filter, the root mean square difference in percent between its
/// images of 1 and 10, of 10 and 100, and of 100 and 1000 samples. It gives no errors, because its
/// images have no reference.
const THESIS: [(&str, [f64; 3]); 2] = [("none", [7.75, 2.78, 0.91]), ("cone", [0.83, 2.55, 0.176])];

/// Samples of the first image of each pair. The second image has ten times as many.
const THESIS_SAMPLES: [u32; 3] = [1, 10, 100];

/// A schlieren image that needs many photons, and its test section.
pub(super) struct NoiseCase {
    scene: Scene,
    section: TestSection,
    reference_samples: u32,
}

impl NoiseCase {
    /// Each photon has its own point of an extended source, and the knife blocks or passes it: the
    /// dissertation's method, and the noisiest.
    pub(super) fn knife(context: &mut Context<'_>) -> anyhow::Result<NoiseCase> {
        NoiseCase::of(context, "[technique]\nkind = \"schlieren\"\n[light]\nbeams = \"tilted\"\n")
    }

    /// Photons move between pixels; the film is 0.5 m behind the flow.
    fn shadowgraph(context: &mut Context<'_>) -> anyhow::Result<NoiseCase> {
        NoiseCase::of(context, "[technique]\nkind = \"shadowgraph\"\n")
    }

    fn of(context: &mut Context<'_>, technique: &str) -> anyhow::Result<NoiseCase> {
        let (size, pixels, reference_samples) =
            if context.quick { ("small", 96, 2048) } else { ("medium", 192, 16384) };
        context.report_step("combustion jet")?;
        let text = format!(
            "[film]\nsize = [{pixels}, {pixels}]\n[march]\nmethod = \"line-of-sight\"\n{technique}"
        );
        let scene = scene(&text)?;
        let section = TestSection::of_fields(&scene, vec![flow("combustion-jet", size)?], None)?;
        Ok(NoiseCase { scene, section, reference_samples })
    }

    /// Renders the image with this many photons per pixel. Returns it with the time in seconds.
    pub(super) fn image(
        &self,
        context: &Context<'_>,
        jitter: Jitter,
        samples: u32,
        seed: u64,
        filter: FilterSpec,
    ) -> anyhow::Result<(RenderOutput, f64)> {
        let sampling = Some(SamplingSpec::Photons { samples, jitter, seed, filter });
        let scene = Scene { sampling, ..self.scene.clone() };
        let start = std::time::Instant::now();
        let rendered = render_image(context, &scene, &self.section)?;
        Ok((rendered, start.elapsed().as_secs_f64()))
    }

    /// Renders the image without visible noise.
    pub(super) fn reference(&self, context: &Context<'_>) -> anyhow::Result<(RenderOutput, f64)> {
        self.image(
            context,
            Jitter::Sobol,
            self.reference_samples,
            REFERENCE_SEED,
            FilterSpec::None {},
        )
    }
}

/// Root mean square difference of two images, in percent of white.
pub(super) fn rms_difference(a: &RenderOutput, b: &RenderOutput) -> f64 {
    let squares: f64 =
        a.pixels.iter().zip(&b.pixels).map(|(a, b)| f64::from(a[0] - b[0]).powi(2)).sum();
    100.0 * (squares / a.pixels.len().max(1) as f64).sqrt()
}

/// Sampling of pixel and source, by name.
const SAMPLINGS: [(&str, Jitter); 2] =
    [("random", Jitter::Random), ("low-discrepancy", Jitter::Sobol)];

/// The image for the comparison with the dissertation's numbers: a knife, and photons from the
/// whole source.
const KNIFE: &str = "schlieren, knife";

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("technique", "", "the image");
    record.column("sampling", "", "how photons are spread over pixel and source");
    record.column("filter", "", "against noise");
    record.column("samples", "", "photons per pixel");
    record.column("rms_error", "%", "root mean square over pixels against the reference, of white");
    record.column(
        "samples_more",
        "",
        "photons per pixel of the image that this one is compared with",
    );
    record.column(
        "difference",
        "%",
        "root mean square over pixels of the difference between these two images, of white",
    );
    record.column("thesis", "%", "the dissertation's difference between images of as many samples");
    record.column("time", "s", "wall time of the image with the field in memory, one run");
    record.column(
        "order",
        "",
        "exponent p of error = c N^-p over the whole curve, in its last row",
    );
    for (name, noisy) in
        [(KNIFE, NoiseCase::knife(context)?), ("shadowgraph", NoiseCase::shadowgraph(context)?)]
    {
        errors(context, record, name, &noisy)?;
        if name == KNIFE {
            differences(context, record, name, &noisy)?;
        }
    }
    let photons = if context.quick { 2048 } else { 16384 };
    record.notes.push(format!(
        "References of `rms_error` have {photons} low-discrepancy photons a pixel with another \
         seed; what they lack shows where a curve flattens. {}",
        describe_errors(&record.rows)
    ));
    record.notes.push(describe_differences(&record.rows));
    Ok(())
}

/// Errors against a reference without visible noise.
fn errors(
    context: &mut Context<'_>,
    record: &mut Record,
    name: &str,
    noisy: &NoiseCase,
) -> anyhow::Result<()> {
    let most = if context.quick { 256 } else { 1024 };
    context.report_step(format!("{name}: reference"))?;
    let (reference, _) = noisy.reference(context)?;
    let mut plot = Plot::lines(
        &format!("Noise against samples: {name}"),
        Axis::log("photons per pixel", ""),
        Axis::log("rms error, of white", "%"),
    );
    for (sampling, jitter) in SAMPLINGS {
        for (filter_name, filter) in [FILTERS[0], FILTERS[1]] {
            let mut points: Vec<(f64, f64)> = vec![];
            for samples in (0..).map(|k| 1u32 << (2 * k)).take_while(|n| *n <= most) {
                check_cancelled(context)?;
                context.report_step(format!(
                    "{name}: {sampling}, filter {filter_name}, {samples} photons"
                ))?;
                let (rendered, secs) = noisy.image(context, jitter, samples, 0, filter)?;
                let rms = rms_difference(&rendered, &reference);
                points.push((f64::from(samples), rms));
                let row = Row::new().with("technique", name).with("sampling", sampling);
                let row = row.with("filter", filter_name).with("samples", samples);
                record.rows.push(row.with("rms_error", rms).with("time", secs));
                if samples == 16 && filter_name == "none" {
                    let caption =
                        format!("{name}, 16 photons a pixel, {sampling}: rms error {rms:.2} %");
                    record.images.push(image(&format!("{name} {sampling}"), caption, &rendered)?);
                }
            }
            if let Some(last) = record.rows.last_mut() {
                *last = last.clone().with("order", order(&points));
            }
            plot.series.push(Series::new(format!("{sampling}, filter {filter_name}"), points));
        }
    }
    record.plots.push(plot);
    Ok(())
}

/// The quantity of the dissertation, for both of its filters. Each image has ten times the photons
/// of the previous one, whose photons are the first of them.
fn differences(
    context: &mut Context<'_>,
    record: &mut Record,
    name: &str,
    noisy: &NoiseCase,
) -> anyhow::Result<()> {
    let mut plot = Plot::lines(
        &format!("Difference between images of N and 10 N photons: {name}"),
        Axis::log("photons per pixel, N", ""),
        Axis::log("rms difference, of white", "%"),
    );
    for (filter_name, thesis) in THESIS {
        let Some((_, filter)) = FILTERS.iter().find(|f| f.0 == filter_name) else { continue };
        for (sampling, jitter) in SAMPLINGS {
            let mut points = vec![];
            let mut before = noisy.image(context, jitter, THESIS_SAMPLES[0], 0, *filter)?.0;
            for (samples, percent) in THESIS_SAMPLES.into_iter().zip(thesis) {
                check_cancelled(context)?;
                let more = 10 * samples;
                context.report_step(format!(
                    "{name}: {sampling}, filter {filter_name}, {samples} against {more}"
                ))?;
                let after = noisy.image(context, jitter, more, 0, *filter)?.0;
                let difference = rms_difference(&before, &after);
                points.push((f64::from(samples), difference));
                let row = Row::new().with("technique", name).with("sampling", sampling);
                let row = row.with("filter", filter_name).with("samples", samples);
                let row = row.with("samples_more", more).with("difference", difference);
                record.rows.push(row.with("thesis", percent));
                before = after;
            }
            plot.series.push(Series::new(format!("{sampling}, filter {filter_name}"), points));
        }
        let points = THESIS_SAMPLES.into_iter().map(f64::from).zip(thesis).collect();
        plot.series.push(Series::new(format!("dissertation, filter {filter_name}"), points));
    }
    record.plots.push(plot);
    Ok(())
}

/// Describes the errors in words.
fn describe_errors(rows: &[Row]) -> String {
    let error = |sampling: &str, filter: &str, samples: f64| {
        let here = |r: &&Row| {
            r.text("technique") == Some(KNIFE)
                && r.text("sampling") == Some(sampling)
                && r.text("filter") == Some(filter)
                && r.number("samples") == Some(samples)
                && r.number("rms_error").is_some()
        };
        rows.iter().find(here).and_then(|r| r.number("rms_error")).unwrap_or(f64::NAN)
    };
    let less = error("random", "none", 16.0) / error("low-discrepancy", "none", 16.0);
    let mut words = format!(
        "With 16 photons a pixel behind the knife, independent photons have {less:.1} times the \
         noise of low-discrepancy ones (as many as {:.0} times          16 of them would have, as \
         1/sqrt(N) goes).",
        less * less
    );
    let counts = || {
        let mut all: Vec<f64> = rows
            .iter()
            .filter(|r| r.number("rms_error").is_some())
            .filter_map(|r| r.number("samples"))
            .collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    };
    for (sampling, _) in SAMPLINGS {
        let helps = |n: &f64| error(sampling, "gaussian", *n) < error(sampling, "none", *n);
        let helped: Vec<String> =
            counts().iter().filter(|n| helps(n)).map(f64::to_string).collect();
        let with = if helped.is_empty() { "no number of".into() } else { helped.join(", ") };
        words += &format!(
            " The Gaussian filter lowers the error of {sampling} photons behind the knife with \
             {with} photons a pixel."
        );
    }
    words
}

/// Compares the differences with those of the dissertation in words.
fn describe_differences(rows: &[Row]) -> String {
    let mut words = String::from(
        "`difference` is the dissertation's quantity: it prints root mean square differences \
         between images of 1 and 10, of 10 and 100, and of 100 \
         and 1000 samples, and has no reference. The photons of each of our images are the first \
         ones of the next. Of independent photons without a filter each \
         such difference is sqrt(10) = 3.16 times the next. Its flow and bench are not ours, so \
         ratios compare and heights do not.",
    );
    for (filter, thesis) in THESIS {
        words += &format!(
            " Filter {filter}: the dissertation's fall {:.2} and {:.2} times",
            thesis[0] / thesis[1],
            thesis[1] / thesis[2]
        );
        for (sampling, _) in SAMPLINGS {
            let here =
                |r: &&Row| r.text("sampling") == Some(sampling) && r.text("filter") == Some(filter);
            let ours: Vec<f64> =
                rows.iter().filter(here).filter_map(|r| r.number("difference")).collect();
            if let [a, b, c] = ours[..] {
                words +=
                    &format!(", ours of {sampling} photons {:.2} and {:.2} times", a / b, b / c);
            }
        }
        words += ".";
    }
    words
}

/// Exponent of a power law through the points, by least squares in logarithms; positive for falling
/// errors.
fn order(points: &[(f64, f64)]) -> Option<f64> {
    let logs: Vec<(f64, f64)> =
        points.iter().filter(|p| p.1 > 0.0).map(|p| (p.0.ln(), p.1.ln())).collect();
    let n = logs.len() as f64;
    let (mx, my) =
        (logs.iter().map(|p| p.0).sum::<f64>() / n, logs.iter().map(|p| p.1).sum::<f64>() / n);
    let (sxy, sxx) = logs
        .iter()
        .fold((0.0, 0.0), |(a, b), p| (a + (p.0 - mx) * (p.1 - my), b + (p.0 - mx).powi(2)));
    (logs.len() >= 2).then(|| -sxy / sxx)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_laws_give_their_exponent() {
        let points: Vec<(f64, f64)> =
            [1.0, 4.0, 16.0, 64.0].map(|n: f64| (n, 3.0 * n.powf(-0.5))).to_vec();
        assert!((order(&points).unwrap() - 0.5).abs() < 1e-12);
        assert_eq!(order(&points[..1]), None);
    }

    #[test]
    fn low_discrepancy_photons_have_less_noise_than_independent_ones() {
        let mut silent = |_: &str, _: Option<f64>| Ok(());
        let mut context = Context::new(true, None, &mut silent);
        let noisy = NoiseCase { reference_samples: 512, ..NoiseCase::knife(&mut context).unwrap() };
        let (reference, _) = noisy.reference(&context).unwrap();
        let error = |jitter, n| {
            let (r, _) = noisy.image(&context, jitter, n, 0, FilterSpec::None {}).unwrap();
            rms_difference(&r, &reference)
        };
        let (random, even) = (error(Jitter::Random, 16), error(Jitter::Sobol, 16));
        assert!(even < 0.8 * random, "{even} {random}");
        // With independent photons, a quarter of them gives twice the noise.
        let ratio = error(Jitter::Random, 4) / random;
        assert!((1.8..2.2).contains(&ratio), "{ratio}");
    }
}
