//! Error against bytes and time when many faint layers are blended, by pixel format.

use super::Context;
use super::many_ranks::{CAVEAT, NETWORK, simulated};
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use crate::runner::{VERDICT_ROUNDS, order};
use crate::stats::Summary;
use composite::comm::sim::SimComm;
use composite::icet::{self, Icet, IcetFrame, IcetImage, IcetMode, IcetStrategy};
use composite::{
    Color, Communicator, Composite, Compositor, Destination, Frame, Image, Options, PixelFormat,
    PremultipliedPixel, Rect, Strategy, f16,
};
use std::path::Path;
use std::rc::Rc;
use std::time::Duration;

const TIMEOUT: Duration = Duration::from_secs(600);
/// Number of layers; each rank has one.
const LAYERS: usize = 128;
const ALPHAS: [f64; 3] = [0.005, 0.02, 0.1];

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("format", "", "colour channels of a pixel");
    record.column("bytes_per_pixel", "B", "of a drawn pixel in a message");
    record.column("strategy", "", "how the layers come together; all give the same bits");
    record.column("alpha", "", "opacity of each of the 128 layers");
    record.column(
        "error",
        "1/255",
        "largest difference of a channel from the sum in f64, in 8-bit steps",
    );
    record.column("error_rms", "1/255", "root mean square of the same");
    record.column("time", "ms", "median over the frames until the image is on rank 0");
    record.column("sent", "MB", "bytes sent by all ranks");
    let (size, frames) = if context.quick { (96, 2) } else { (512, VERDICT_ROUNDS) };
    record.notes.push(format!(
        "{LAYERS} ranks with one faint layer each over the whole image of {size} x {size} pixels, \
         whose colour and opacity vary by a tenth from pixel to \
         pixel. Formats, strategies and IceT take turns on the same ranks, in another order for \
         every frame."
    ));
    record.notes.push(CAVEAT.into());
    let icet = icet::find()
        .map_err(|why| record.missing.push(format!("IceT's 8-bit blending: {why}")))
        .ok();
    // All strategies give the same bits, so the short form uses only the one with fewer messages.
    let strategies =
        [("radix-k", Strategy::RadixK { k: 8 }), ("direct send", Strategy::DirectSend)];
    let strategies = &strategies[..if context.quick { 1 } else { 2 }];
    for alpha in ALPHAS {
        context.report_step(format!("alpha {alpha}"))?;
        measure(record, &Case { alpha, size, frames, strategies, icet: icet.as_deref() })?;
    }
    record.notes.extend(describe(&record.rows));
    // One series per format: the error as a function of the layers' opacity, and the time.
    let mut by_alpha = Plot::lines(
        "Error of 128 layers",
        Axis::log("opacity of a layer", ""),
        Axis::log("largest error", "1/255"),
    );
    let mut by_time = Plot::lines(
        "Error against time, radix-k, a point for each opacity",
        Axis::log("time of a frame", "ms"),
        Axis::log("largest error", "1/255"),
    );
    for format in ["u8", "u16", "f16", "f32", ICET_FORMAT] {
        let of = |r: &&Row| {
            r.text("format") == Some(format) && r.text("strategy") != Some("direct send")
        };
        let points = |column: &str| -> Vec<(f64, f64)> {
            let rows = record.rows.iter().filter(of);
            rows.filter_map(|r| r.number(column).zip(r.number("error"))).collect()
        };
        by_alpha.series.push(Series::new(format, points("alpha")));
        by_time.series.push(Series::new(format, points("time")));
    }
    record.plots.extend([by_alpha, by_time]);
    Ok(())
}

/// The only format in which IceT blends.
const ICET_FORMAT: &str = "u8 of IceT";

struct Case<'a> {
    alpha: f64,
    size: u32,
    frames: usize,
    strategies: &'a [(&'static str, Strategy)],
    icet: Option<&'a Path>,
}

/// Describes the error with 8 bits, ours and IceT's, from the rows.
fn describe(rows: &[Row]) -> Option<String> {
    let error = |format: &str, alpha: f64| {
        let here = |r: &&Row| r.text("format") == Some(format) && r.number("alpha") == Some(alpha);
        rows.iter().find(here)?.number("error")
    };
    let each: Vec<String> = ALPHAS
        .iter()
        .filter_map(|&alpha| {
            let (icet_compositor, ours) = (error(ICET_FORMAT, alpha)?, error("u8", alpha)?);
            Some(format!("{icet_compositor:.1} and {ours:.1} at alpha {alpha}"))
        })
        .collect();
    (!each.is_empty()).then(|| {
        format!("Largest errors of 8-bit blending, IceT's and ours, in 1/255: {}.", each.join("; "))
    })
}

/// Premultiplied colour of `layer` at pixel `k`: an exact function, which every format then rounds.
fn layer_color(alpha: f64, layer: usize, k: usize) -> [f64; 4] {
    // Golden-ratio steps make the layers differ between all pixels.
    let vary = |step: f64| 1.0 + 0.1 * ((layer as f64 * 0.618_034 + k as f64 * step).fract() - 0.5);
    let a = alpha * vary(0.754_878);
    [a * 0.9 * vary(0.569_840), a * 0.5, a * 0.2, a]
}

/// The sum of all layers in f64, front to back.
fn exact(alpha: f64, k: usize) -> [f64; 4] {
    let mut sum = [0.0; 4];
    for layer in 0..LAYERS {
        let c = layer_color(alpha, layer, k);
        let left = 1.0 - sum[3];
        for i in 0..4 {
            sum[i] += left * c[i];
        }
    }
    sum
}

/// A compositing method on one rank.
trait Contender {
    /// Composites the rank's layer. Returns the time of completion on the rank's clock, and the
    /// number of bytes sent, if known.
    fn composite(&mut self, comm: &mut SimComm) -> anyhow::Result<(f64, Option<u64>)>;
    /// The most recent image, on rank 0.
    fn image(&self) -> Option<Vec<[f32; 4]>>;
}

struct OurCompositor<C: Color>
where
    PremultipliedPixel<C>: Composite + PixelFormat<Color = C>,
{
    size: u32,
    layer: Rc<Vec<C>>,
    compositor: Compositor<PremultipliedPixel<C>>,
    image: Option<Image<PremultipliedPixel<C>>>,
}

impl<C: Color> Contender for OurCompositor<C>
where
    PremultipliedPixel<C>: Composite + PixelFormat<Color = C>,
{
    fn composite(&mut self, comm: &mut SimComm) -> anyhow::Result<(f64, Option<u64>)> {
        let frame =
            Frame::<PremultipliedPixel<C>>::premultiplied(self.size, self.size, &self.layer)?;
        let done = self.compositor.composite(comm, &frame)?;
        let end_secs = comm.now();
        self.image = done.image;
        Ok((end_secs, Some(done.report.bytes_sent)))
    }

    fn image(&self) -> Option<Vec<[f32; 4]>> {
        let image = self.image.as_ref()?;
        Some(image.colors().iter().map(|c| c.to_f32()).collect())
    }
}

struct IcetCompositor {
    size: u32,
    layer: Vec<[u8; 4]>,
    icet: Icet,
    image: Option<Vec<[u8; 4]>>,
}

impl Contender for IcetCompositor {
    fn composite(&mut self, comm: &mut SimComm) -> anyhow::Result<(f64, Option<u64>)> {
        let whole = Rect { x0: 0, y0: 0, x1: self.size, y1: self.size };
        let image = self.icet.composite(comm, IcetFrame::BlendU8(&self.layer), whole)?;
        let end_secs = comm.now();
        self.image = image.and_then(|i| match i {
            IcetImage::Rgba8(colors) => Some(colors.to_vec()),
            IcetImage::RgbaF32(_) => None,
        });
        Ok((end_secs, None))
    }

    fn image(&self) -> Option<Vec<[f32; 4]>> {
        Some(self.image.as_ref()?.iter().map(|c| c.to_f32()).collect())
    }
}

/// A contender with the description for its rows.
struct NamedContender {
    format: &'static str,
    bytes_per_pixel: usize,
    strategy: &'static str,
    contender: Box<dyn Contender>,
}

fn layer<C: Color>(case: &Case<'_>, rank: usize) -> Vec<C> {
    let pixels = (case.size * case.size) as usize;
    (0..pixels).map(|k| C::from_f32(layer_color(case.alpha, rank, k).map(|v| v as f32))).collect()
}

fn ours<C: Color + 'static>(
    all: &mut Vec<NamedContender>,
    format: &'static str,
    case: &Case<'_>,
    rank: usize,
) where
    PremultipliedPixel<C>: Composite + PixelFormat<Color = C>,
{
    let layer = Rc::new(layer::<C>(case, rank));
    for &(strategy, how) in case.strategies {
        let compositor = Compositor::new(Options {
            strategy: how,
            destination: Destination::Rank(0),
            timeout: TIMEOUT,
            final_barrier: false,
            ..Options::default()
        });
        let contender = Box::new(OurCompositor {
            size: case.size,
            layer: layer.clone(),
            compositor,
            image: None,
        });
        all.push(NamedContender { format, bytes_per_pixel: size_of::<C>(), strategy, contender });
    }
}

/// All contenders on one rank, in the order of the rows.
fn contenders(comm: &mut SimComm, case: &Case<'_>) -> anyhow::Result<Vec<NamedContender>> {
    let (rank, ranks) = (comm.rank(), comm.size());
    let mut all = Vec::new();
    ours::<[u8; 4]>(&mut all, "u8", case, rank);
    ours::<[u16; 4]>(&mut all, "u16", case, rank);
    ours::<[f16; 4]>(&mut all, "f16", case, rank);
    ours::<[f32; 4]>(&mut all, "f32", case, rank);
    if let Some(path) = case.icet {
        let mut icet = Icet::over_comm(path, comm, IcetMode::BlendU8, case.size, case.size)?;
        let strategy = IcetStrategy::RadixKr;
        icet.set_strategy(strategy);
        icet.set_order(&(0..ranks).collect::<Vec<_>>());
        let icet_compositor =
            IcetCompositor { size: case.size, layer: layer(case, rank), icet, image: None };
        let (format, strategy) = (ICET_FORMAT, strategy.name());
        all.push(NamedContender {
            format,
            bytes_per_pixel: 4,
            strategy,
            contender: Box::new(icet_compositor),
        });
    }
    Ok(all)
}

/// Results of a contender on one rank.
struct RankResult {
    format: &'static str,
    bytes_per_pixel: usize,
    strategy: &'static str,
    secs: Vec<f64>,
    sent: Option<u64>,
    image: Option<Vec<[f32; 4]>>,
}

fn measure(record: &mut Record, case: &Case<'_>) -> anyhow::Result<()> {
    let results = simulated(NETWORK, LAYERS, |mut comm| {
        let mut all = contenders(&mut comm, case)?;
        let mut secs = vec![Vec::new(); all.len()];
        let mut sent = vec![None; all.len()];
        // The first frame is a warm-up.
        for n in 0..=case.frames {
            for k in order(all.len(), n) {
                comm.barrier(TIMEOUT)?;
                let begin = comm.now();
                let (end, bytes) = all[k].contender.composite(&mut comm)?;
                sent[k] = bytes;
                if n > 0 {
                    secs[k].push(end - begin);
                }
            }
        }
        let each = all.into_iter().zip(secs).zip(sent).map(|((named, secs), sent)| {
            let NamedContender { format, bytes_per_pixel, strategy, contender } = named;
            RankResult { format, bytes_per_pixel, strategy, secs, sent, image: contender.image() }
        });
        Ok(each.collect::<Vec<_>>())
    })?;
    let Some(root) = results.first() else { return Ok(()) };
    for (k, of) in root.iter().enumerate() {
        let slowest: Vec<f64> = (0..case.frames)
            .map(|f| results.iter().map(|r| r[k].secs[f]).fold(0.0, f64::max))
            .collect();
        let sent: Option<u64> = results.iter().map(|r| r[k].sent).sum();
        let Some(image) = &of.image else { anyhow::bail!("{}: rank 0 has no image", of.format) };
        let (worst, rms) = error_of(image, case.alpha);
        record.rows.push(
            Row::new()
                .with("format", of.format)
                .with("bytes_per_pixel", of.bytes_per_pixel)
                .with("strategy", of.strategy)
                .with("alpha", case.alpha)
                .with("error", worst)
                .with("error_rms", rms)
                .with("time", Summary::of(&slowest).map(|s| s.median * 1e3))
                .with("sent", sent.map(|s| s as f64 * 1e-6)),
        );
    }
    Ok(())
}

/// Largest and root mean square difference of a channel from the f64 sum, in 1/255.
fn error_of(image: &[[f32; 4]], alpha: f64) -> (f64, f64) {
    let (mut worst, mut squares) = (0.0f64, 0.0);
    for (k, color) in image.iter().enumerate() {
        for (found, expected) in color.iter().zip(exact(alpha, k)) {
            let e = 255.0 * (f64::from(*found) - expected).abs();
            worst = worst.max(e);
            squares += e * e;
        }
    }
    (worst, (squares / (4 * image.len().max(1)) as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn icet_s_eight_bits_are_measured_and_the_note_says_what_was_found() {
        let icet = match icet::find() {
            Ok(path) => path,
            Err(why) => {
                assert!(std::env::var_os("RTSV_REQUIRE_PEERS").is_none_or(|v| v != "1"), "{why}");
                eprintln!("skipped: {why}");
                return;
            }
        };
        let mut record =
            Record::new("accuracy-composite", "", 3, true, crate::machine::Machine::describe());
        let strategies = [("radix-k", Strategy::RadixK { k: 8 })];
        let case = Case {
            alpha: ALPHAS[0],
            size: 16,
            frames: 1,
            strategies: &strategies,
            icet: Some(&icet),
        };
        measure(&mut record, &case).unwrap();
        let of = |format: &str| {
            let row = record.rows.iter().find(|r| r.text("format") == Some(format)).expect(format);
            row.number("error").unwrap()
        };
        // 128 layers of 1/255 each sum to 0.473 of white. If every sum is rounded down, at most one
        // layer remains.
        assert!(of(ICET_FORMAT) > 100.0, "{}", of(ICET_FORMAT));
        assert!(of("u8") < 60.0 && of("u16") < 1.0 && of("f32") < 1e-3, "{:?}", record.rows);
        let note = describe(&record.rows).unwrap();
        assert!(note.contains(&format!("{:.1} and {:.1} at", of(ICET_FORMAT), of("u8"))), "{note}");
        assert_eq!(describe(&[]), None, "nothing measured, nothing said");
    }
}
