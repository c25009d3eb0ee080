//! Error against bytes and time of blending many faint layers, by pixel format.

use super::Context;
use super::many_ranks::{CAVEAT, NETWORK, simulated};
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use crate::stats::Summary;
use composite::{
    Color, Communicator, Composite, Compositor, Destination, Frame, Options, PixelFormat, PremultipliedPixel,
    Strategy, f16,
};
use std::time::Duration;

const TIMEOUT: Duration = Duration::from_secs(600);
/// One layer per rank.
const LAYERS: usize = 128;
const ALPHAS: [f64; 3] = [0.005, 0.02, 0.1];

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("format", "", "colour channels of a pixel");
    record.column("bytes_per_pixel", "B", "of a drawn pixel in a message");
    record.column("strategy", "", "how the layers come together; all give the same bits");
    record.column("alpha", "", "opacity of each of the 128 layers");
    record.column("error", "1/255", "largest difference of a channel from the sum in f64, in 8-bit steps");
    record.column("error_rms", "1/255", "root mean square of the same");
    record.column("time", "ms", "median over the frames until the image is on rank 0");
    record.column("sent", "MB", "bytes sent by all ranks");
    let (size, frames) = if context.quick { (96, 2) } else { (512, 5) };
    record.notes.push(format!(
        "{LAYERS} ranks with one faint layer each over the whole image of {size} x {size} pixels, whose colour and opacity vary by a tenth from pixel to \
         pixel. IceT’s 8-bit blending truncates and loses such layers altogether (error 120/255 at alpha 0.005, by its formula); ours rounds, and the \
         other formats are for those who need more."
    ));
    record.notes.push(CAVEAT.into());
    for alpha in ALPHAS {
        // The strategies give the same bits: one will do for the short form.
        let strategies = [("direct send", Strategy::DirectSend), ("radix-k", Strategy::RadixK { k: 8 })];
        for (name, strategy) in strategies.into_iter().take(if context.quick { 1 } else { 2 }) {
            context.say(format!("alpha {alpha}, {name}"))?;
            let case = Case { alpha, size, frames, strategy, name };
            measure::<[u8; 4]>(record, "u8", &case)?;
            measure::<[u16; 4]>(record, "u16", &case)?;
            measure::<[f16; 4]>(record, "f16", &case)?;
            measure::<[f32; 4]>(record, "f32", &case)?;
        }
    }
    // A series for each format: what it loses with how faint layers, and at what time.
    let mut by_alpha = Plot::lines(
        "Error of 128 layers",
        Axis::log("opacity of a layer", ""),
        Axis::log("largest error", "1/255"),
    );
    let mut by_time = Plot::lines(
        "Error against time, direct send, a point for each opacity",
        Axis::log("time of a frame", "ms"),
        Axis::log("largest error", "1/255"),
    );
    for format in ["u8", "u16", "f16", "f32"] {
        let of = |r: &&Row| r.text("format") == Some(format) && r.text("strategy") == Some("direct send");
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

struct Case<'a> {
    alpha: f64,
    size: u32,
    frames: usize,
    strategy: Strategy,
    name: &'a str,
}

/// Premultiplied colour of `layer` at pixel `k`: a function that every format then rounds.
fn layer_color(alpha: f64, layer: usize, k: usize) -> [f64; 4] {
    // Golden-ratio steps: no two pixels have the same layers.
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

fn measure<C: Color>(record: &mut Record, format: &str, case: &Case<'_>) -> anyhow::Result<()>
where
    PremultipliedPixel<C>: Composite + PixelFormat<Color = C>,
{
    let Case { alpha, size, frames, strategy, name } = *case;
    let pixels = (size * size) as usize;
    let results = simulated(NETWORK, LAYERS, |mut comm| {
        let rank = comm.rank();
        let layer: Vec<C> =
            (0..pixels).map(|k| C::from_f32(layer_color(alpha, rank, k).map(|v| v as f32))).collect();
        let frame = Frame::<PremultipliedPixel<C>>::premultiplied(size, size, &layer)?;
        let mut compositor = Compositor::new(Options {
            strategy,
            destination: Destination::Rank(0),
            timeout: TIMEOUT,
            confirm: false,
            ..Options::default()
        });
        let (mut secs, mut sent, mut image) = (Vec::new(), 0, None);
        for n in 0..=frames {
            comm.barrier(TIMEOUT)?;
            let begin = comm.now();
            let done = compositor.composite(&mut comm, &frame)?;
            if n > 0 {
                secs.push(comm.now() - begin);
            }
            sent = done.report.bytes_sent;
            image = done.image;
        }
        Ok((secs, sent, image.map(|i| i.colors().to_vec())))
    })?;
    let slowest: Vec<f64> = (0..frames).map(|f| results.iter().map(|r| r.0[f]).fold(0.0, f64::max)).collect();
    let sent: u64 = results.iter().map(|r| r.1).sum();
    let Some(image) = results.into_iter().next().and_then(|r| r.2) else {
        anyhow::bail!("rank 0 has no image");
    };
    let (mut worst, mut squares) = (0.0f64, 0.0);
    for (k, color) in image.iter().enumerate() {
        let (found, expected) = (color.to_f32(), exact(alpha, k));
        for i in 0..4 {
            let e = 255.0 * (f64::from(found[i]) - expected[i]).abs();
            worst = worst.max(e);
            squares += e * e;
        }
    }
    let time = Summary::of(&slowest).map(|s| s.median * 1e3);
    record.rows.push(
        Row::new()
            .with("format", format)
            .with("bytes_per_pixel", size_of::<C>())
            .with("strategy", name)
            .with("alpha", alpha)
            .with("error", worst)
            .with("error_rms", (squares / (4 * pixels) as f64).sqrt())
            .with("time", time)
            .with("sent", sent as f64 * 1e-6),
    );
    Ok(())
}
