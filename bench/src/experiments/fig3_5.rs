//! Figure 3.5: frames per second of compositing alone, for 2 to 128 ranks: binary swap against
//! direct send and IceT.

use super::Context;
use super::many_ranks::{CAVEAT, powers, simulated};
use super::smpi;
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use crate::runner::{Ratio, order};
use crate::stats::Summary;
use composite::comm::sim::{Network, SimComm};
use composite::icet::{self, Icet, IcetFrame, IcetMode, IcetStrategy};
use composite::workload::{SyntheticFrame, Workload};
use composite::{Communicator, Compositor, DepthPixel, Destination, Frame, Options, Strategy};
use std::path::Path;
use std::time::Duration;

const TIMEOUT: Duration = Duration::from_secs(600);

/// A compositor.
#[derive(Clone, Copy)]
enum Backend {
    Ours(Strategy),
    Icet(IcetStrategy),
}

const ALL: [(&str, Backend); 5] = [
    ("direct send", Backend::Ours(Strategy::DirectSend)),
    ("binary swap", Backend::Ours(Strategy::BinarySwap)),
    ("radix-k", Backend::Ours(Strategy::RadixK { k: 8 })),
    ("IceT binary swap", Backend::Icet(IcetStrategy::BinarySwap)),
    ("IceT radix-kr", Backend::Icet(IcetStrategy::RadixKr)),
];

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("ranks", "", "ranks");
    record.column(
        "compositor",
        "",
        "strategy; IceT is the library of the dissertation, over the same ranks",
    );
    record.column(
        "time",
        "ms",
        "median over the frames, from the common begin until the image is on rank 0",
    );
    record.column("fps", "1/s", "frames per second at that time");
    record.column("time_low", "ms", "fastest frame");
    record.column("time_high", "ms", "slowest frame");
    record.column(
        "smpi",
        "ms",
        "the same under SimGrid's SMPI, of IceT its best strategy; empty where that is not \
         installed",
    );
    record.column(
        "model_over_smpi",
        "",
        "time by our model over that by SMPI, of direct send, and of IceT its best strategy in \
         either",
    );
    record.column("differ", "", "pixels that differ from direct send's image");
    let (size, frames, most) = if context.quick { (512, 2, 64) } else { (1024, 5, 128) };
    record.notes.push(format!(
        "Frames of {size} x {size} pixels, RGBA8 and f32 depth, as ranks would have drawn a volume \
         cut into bricks (`discs` of `composite \
         compare`). All compositors take turns on the same frames and ranks, in another order for \
         every frame. The dissertation: binary swap above 20 frames per second at 128 nodes, \
         IceT near 100."
    ));
    record.notes.push(CAVEAT.into());
    record.notes.push(
        "Here the model has SMPI's corrections of latency and bandwidth by length of message \
         (measured on gigabit Ethernet), so that it can be compared \
         with SMPI."
            .into(),
    );
    if context.quick {
        record.notes.push(
            "The quick form has SMPI up to 8 ranks only, from the library for SimGrid as it was \
             built before: it builds nothing."
                .into(),
        );
    }
    let icet = icet::find();
    if let Err(why) = &icet {
        record.missing.push(why.to_string());
    }
    let icet = icet.ok();
    let mut smpi_is_there = true;
    for ranks in powers(2, most) {
        context.report_step(format!("{ranks} ranks"))?;
        measure(record, ranks, size, frames, icet.as_deref())?;
        // SimGrid takes minutes for many ranks.
        if smpi_is_there && ranks <= if context.quick { 8 } else { 64 } {
            context.report_step(format!("{ranks} ranks under SMPI"))?;
            match smpi::compare_ms(ranks, size, frames, context.quick) {
                Ok(times) => compare_with_smpi(record, ranks, times),
                Err(why) => {
                    record.missing.push(format!("times under SMPI: {why}"));
                    smpi_is_there = false;
                }
            }
        }
    }
    let mut plot =
        Plot::lines("Compositing", Axis::log("ranks", ""), Axis::log("frames per second", "1/s"));
    for (name, _) in ALL {
        let of = |r: &&Row| r.text("compositor") == Some(name);
        let points: Vec<(f64, f64)> = record
            .rows
            .iter()
            .filter(of)
            .filter_map(|r| r.number("ranks").zip(r.number("fps")))
            .collect();
        if !points.is_empty() {
            plot.series.push(Series::new(name, points));
        }
    }
    record.plots.push(plot);
    Ok(())
}

fn measure(
    record: &mut Record,
    ranks: usize,
    size: u32,
    frames: usize,
    icet: Option<&Path>,
) -> anyhow::Result<()> {
    let all: Vec<(&str, Backend)> =
        ALL.into_iter().filter(|(_, w)| icet.is_some() || matches!(w, Backend::Ours(_))).collect();
    let results = simulated(Network::QDR_AS_SMPI, ranks, |mut comm| {
        run_rank(&mut comm, &all, size, frames, icet)
    })?;
    // The slowest rank, by compositor and frame.
    let secs = |k: usize, f: usize| results.iter().map(|r| r.secs[k][f]).fold(0.0, f64::max);
    for (k, (name, _)) in all.iter().enumerate() {
        let times: Vec<f64> = (0..frames).map(|f| secs(k, f)).collect();
        let Some(s) = Summary::of(&times) else { continue };
        record.rows.push(
            Row::new()
                .with("ranks", ranks)
                .with("compositor", *name)
                .with("time", s.median * 1e3)
                .with("fps", 1.0 / s.median)
                .with("time_low", s.low * 1e3)
                .with("time_high", s.high * 1e3)
                .with("differ", results[0].differ[k]),
        );
        if k > 0 {
            let ratios: Vec<f64> = (0..frames).map(|f| secs(k, f) / secs(0, f)).collect();
            record.ratios.extend(Ratio::of_rounds(
                format!("direct send, {ranks} ranks"),
                *name,
                &ratios,
            ));
        }
    }
    Ok(())
}

/// Compares SMPI's times of direct send and of the best IceT strategy with ours.
fn compare_with_smpi(record: &mut Record, ranks: usize, [ours_ms, icet_ms]: [f64; 2]) {
    let is_of = |r: &Row| r.number("ranks") == Some(ranks as f64);
    let icet = record.rows.iter().filter(|r| is_of(r));
    let icet = icet.filter(|r| r.text("compositor").is_some_and(|c| c.starts_with("IceT")));
    let icet_best = icet.filter_map(|r| r.number("time")).min_by(f64::total_cmp);
    for row in record.rows.iter_mut().filter(|r| is_of(r)) {
        let name = row.text("compositor").unwrap_or_default().to_string();
        let time = row.number("time");
        *row = match name.as_str() {
            "direct send" => std::mem::take(row)
                .with("smpi", ours_ms)
                .with("model_over_smpi", time.map(|t| t / ours_ms)),
            "IceT radix-kr" => {
                let ratio = icet_best.map(|t| t / icet_ms);
                std::mem::take(row).with("smpi", icet_ms).with("model_over_smpi", ratio)
            }
            _ => continue,
        };
    }
}

/// One rank's times by compositor and frame; on rank 0 also the number of pixels that differ from
/// the first compositor's.
struct RankResult {
    secs: Vec<Vec<f64>>,
    differ: Vec<u64>,
}

fn run_rank(
    comm: &mut SimComm,
    all: &[(&str, Backend)],
    size: u32,
    frames: usize,
    icet: Option<&Path>,
) -> anyhow::Result<RankResult> {
    let (rank, ranks) = (comm.rank(), comm.size());
    let mut drawn = SyntheticFrame::new(size, size);
    let mut ours: Vec<Option<Compositor<DepthPixel<[u8; 4]>>>> = all
        .iter()
        .map(|(_, who)| match who {
            Backend::Ours(strategy) => Some(Compositor::new(Options {
                strategy: *strategy,
                destination: Destination::Rank(0),
                depth: false,
                timeout: TIMEOUT,
                final_barrier: false,
                ..Options::default()
            })),
            Backend::Icet(_) => None,
        })
        .collect();
    let mut theirs =
        icet.map(|path| Icet::over_comm(path, comm, IcetMode::Depth, size, size)).transpose()?;
    let mut out = RankResult { secs: vec![Vec::new(); all.len()], differ: vec![0; all.len()] };
    for n in 0..=frames {
        Workload::Discs.draw(n as u64, rank, ranks, &mut drawn);
        let frame = Frame::with_depth(size, size, &drawn.colors, &drawn.depths)?
            .with_bounds(drawn.bounds)?;
        // Alternate in another order for every frame, the same on all ranks.
        let mut images: Vec<Option<Vec<[u8; 4]>>> = vec![None; all.len()];
        for k in order(all.len(), n) {
            let (_, who) = &all[k];
            comm.barrier(TIMEOUT)?;
            let begin = comm.now();
            images[k] = match who {
                Backend::Ours(_) => {
                    let Some(compositor) = ours[k].as_mut() else { continue };
                    let image = compositor.composite(comm, &frame)?.image;
                    let end = comm.now();
                    out.secs[k].push(end - begin);
                    image.map(|i| {
                        let colors = i.colors().to_vec();
                        compositor.recycle(i);
                        colors
                    })
                }
                Backend::Icet(strategy) => {
                    let Some(icet) = theirs.as_mut() else { continue };
                    icet.set_strategy(*strategy);
                    let pixels = IcetFrame::Depth(&drawn.colors, &drawn.depths);
                    let image = icet.composite(comm, pixels, drawn.bounds)?;
                    let end = comm.now();
                    out.secs[k].push(end - begin);
                    image.and_then(|i| match i {
                        icet::IcetImage::Rgba8(colors) => Some(colors.to_vec()),
                        icet::IcetImage::RgbaF32(_) => None,
                    })
                }
            };
        }
        if let Some(first) = images[0].take() {
            for (differ, image) in out.differ.iter_mut().zip(&images) {
                let Some(image) = image else { continue };
                *differ += image.iter().zip(&first).filter(|(a, b)| a != b).count() as u64;
            }
        }
    }
    // The first frame was a warm-up.
    out.secs.iter_mut().for_each(|s| drop(s.drain(..1)));
    Ok(out)
}
