//! `composite compare`: our compositing and IceT's, frame by frame on the same ranks and frames.
use super::ranks::{RankArgs, RankComm};
use super::smpirun;
use crate::compositor::{Compositor, Options};
use crate::frame::Frame;
use crate::pixel::{DepthPixel, PremultipliedPixel};
use crate::rival::{self, Icet, IcetFrame, IcetImage, IcetMode, IcetStrategy};
use crate::scenes::{Drawn, Scene};
use crate::simd::SimdLevel;
use crate::strategies::Strategy;
use anyhow::Context as _;
use datasets::cli::{CommonArgs, Status, UsageError};
use serde::Serialize;
use std::ffi::OsString;
use std::fmt;
use std::path::Path;

/// Frames before the clock counts: buffers are made and connections opened.
const WARM_UP: u64 = 3;
/// Largest difference of a channel that counts as equal where floating-point colours are blended: IceT groups the ranks differently
/// for every strategy, so its own strategies differ by about as much.
const BLEND_TOLERANCE: f32 = 1e-5;

/// Arguments of `composite compare`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    composite compare --ranks 8 --size 1024 --mpi --json\n  \
    composite compare --ranks 127 --smpi --scene discs\n  \
    composite compare --ranks 4 --threads --pixels blend")]
pub(super) struct CompareArgs {
    #[command(flatten)]
    ranks: RankArgs,
    /// Width and height of the image, in pixels
    #[arg(long, default_value_t = 1024, value_name = "PIXELS")]
    size: u32,
    /// Which frames; without it all
    #[arg(long, value_name = "discs|dense|frag")]
    scene: Option<Scene>,
    /// What is composited: RGBA8 with depth (depth), or premultiplied RGBA f32 in order (blend)
    #[arg(long, default_value = "depth")]
    pixels: Pixels,
    /// Our strategy
    #[arg(long, default_value = "direct", value_name = "direct|tree|bswap|radix-k[:K]|auto", value_parser = strategy_named)]
    strategy: Strategy,
    /// Our instruction set at most: scalar, sse2, sse4.2, avx2, avx512 or neon, as far as this machine has it
    #[arg(long, value_name = "LEVEL", value_parser = simd_named)]
    simd: Option<SimdLevel>,
    /// Timed frames; 7 of them, 5 simulated
    #[arg(long, value_name = "N")]
    frames: Option<u64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
enum Pixels {
    Depth,
    Blend,
}

/// What is printed.
#[derive(Debug, Serialize)]
struct Comparison {
    machine: Machine,
    rows: Vec<Row>,
}

#[derive(Debug, Serialize)]
struct Machine {
    processors: usize,
    transport: String,
    icet: String,
    note: Option<&'static str>,
}

/// One scene.
#[derive(Debug, Serialize)]
struct Row {
    scene: &'static str,
    ranks: usize,
    size_px: u32,
    pixels: Pixels,
    /// IceT's strategy with the smallest median.
    rival: &'static str,
    /// Medians.
    ours_ms: f64,
    rival_ms: f64,
    ratio: f64,
    /// Over all frames and all of IceT's strategies.
    pixels_differ: u64,
    ours_min_ms: f64,
    rival_min_ms: f64,
    /// The strategy that was used for the last frame.
    ours_strategy: String,
    simd: &'static str,
    ours_mb: f64,
    ours_messages: u64,
    rivals_ms: std::collections::BTreeMap<&'static str, f64>,
    /// This rank's (rank 0's) share of our median frame, by column.
    columns_ms: std::collections::BTreeMap<&'static str, f64>,
}

pub(super) fn compare(
    common: CommonArgs,
    args: &CompareArgs,
    arguments: &[OsString],
) -> anyhow::Result<Status> {
    if args.size == 0 || args.size > 32_768 {
        return Err(UsageError(format!("an image of {0}x{0}: give 1 to 32768", args.size)).into());
    }
    // Before any rank is started: without the rival there is nothing to compare with.
    let icet = rival::find().map_err(|error| UsageError(error.to_string()))?;
    let frames = args.frames.unwrap_or(if args.ranks.is_simulated() { 5 } else { 7 }).max(1);
    let scenes = args.scene.map_or_else(|| Scene::ALL.to_vec(), |scene| vec![scene]);
    args.ranks.run(
        common,
        arguments,
        |comm| {
            let machine = Machine {
                processors: std::thread::available_parallelism().map_or(1, usize::from),
                transport: comm.transport(),
                icet: icet.display().to_string(),
                note: smpirun::inside().then_some(smpirun::CAVEAT),
            };
            let mut bench = Bench::new(comm, args, &icet, frames)?;
            let rows = scenes.iter().map(|&scene| bench.measure(scene)).collect::<anyhow::Result<_>>()?;
            Ok(Comparison { machine, rows })
        },
        |comparison| {
            common.result(&comparison, || &comparison)?;
            Ok(Status::Success)
        },
    )
}

/// Both compositors on one rank.
struct Bench<'a> {
    comm: &'a mut RankComm,
    args: &'a CompareArgs,
    frames: u64,
    icet: Icet,
    depth: Compositor<DepthPixel<[u8; 4]>>,
    blend: Compositor<PremultipliedPixel<[f32; 4]>>,
    drawn: Drawn,
    glass: Vec<[f32; 4]>,
}

impl<'a> Bench<'a> {
    fn new(comm: &'a mut RankComm, args: &'a CompareArgs, path: &Path, frames: u64) -> anyhow::Result<Self> {
        let mode = match args.pixels {
            Pixels::Depth => IcetMode::Depth,
            Pixels::Blend => IcetMode::BlendF32,
        };
        let icet = match comm {
            RankComm::Mpi(comm) => Icet::over_mpi(path, comm, mode, args.size, args.size),
            RankComm::Thread(comm) => Icet::over_comm(path, comm, mode, args.size, args.size),
        };
        // IceT collects colours only. Its ranks do not wait for each other at the end either: the barrier is timed for both.
        let options = Options {
            strategy: args.strategy,
            simd: args.simd,
            depth: false,
            confirm: false,
            timeout: args.ranks.timeout(),
            ..Options::default()
        };
        Ok(Self {
            comm,
            args,
            frames,
            icet: icet.map_err(|error| UsageError(error.to_string()))?,
            depth: Compositor::new(options.clone()),
            blend: Compositor::new(options),
            drawn: Drawn::new(args.size, args.size),
            glass: Vec::new(),
        })
    }

    fn measure(&mut self, scene: Scene) -> anyhow::Result<Row> {
        let (rank, ranks) = (self.comm.comm().rank(), self.comm.comm().size());
        let timeout = self.args.ranks.timeout();
        let mut ours_ms = Vec::new();
        let mut rivals_ms = vec![Vec::new(); IcetStrategy::ALL.len()];
        let mut pixels_differ = 0;
        let (mut sent, mut reports) = (0, Vec::new());
        for moment in 0..WARM_UP + self.frames {
            scene.draw(moment, rank, ranks, &mut self.drawn);
            let order = scene.front_to_back(moment, ranks);
            if self.args.pixels == Pixels::Blend {
                self.drawn.premultiplied(&mut self.glass);
                self.icet.set_order(&order);
            }
            let timed = moment >= WARM_UP;

            // Ours.
            self.comm.comm().barrier(timeout)?;
            let begin = self.comm.comm().now();
            let (image, report) = match self.args.pixels {
                Pixels::Depth => {
                    let drawn = &self.drawn;
                    let frame =
                        Frame::with_depth(drawn.width_px, drawn.height_px, &drawn.colors, &drawn.depths)?;
                    let done = self.depth.composite(self.comm.comm(), &frame.bounded(drawn.bounds)?)?;
                    (done.image.map(Ours::Depth), done.report)
                }
                Pixels::Blend => {
                    // The order changes from frame to frame; buffers stay.
                    self.blend.set_order(Some(order));
                    let frame = Frame::premultiplied(self.drawn.width_px, self.drawn.height_px, &self.glass)?;
                    let done = self.blend.composite(self.comm.comm(), &frame.bounded(self.drawn.bounds)?)?;
                    (done.image.map(Ours::Blend), done.report)
                }
            };
            self.comm.comm().barrier(timeout)?;
            if timed {
                ours_ms.push(1e3 * (self.comm.comm().now() - begin));
                sent = sent.max(report.bytes_sent);
                reports.push(report);
            }

            // Theirs, each strategy in turn.
            for (times, strategy) in rivals_ms.iter_mut().zip(IcetStrategy::ALL) {
                self.icet.set_strategy(strategy);
                self.comm.comm().barrier(timeout)?;
                let begin = self.comm.comm().now();
                let frame = match self.args.pixels {
                    Pixels::Depth => IcetFrame::Depth(&self.drawn.colors, &self.drawn.depths),
                    Pixels::Blend => IcetFrame::BlendF32(&self.glass),
                };
                let theirs = self.icet.composite(self.comm.comm(), frame, self.drawn.bounds);
                let theirs = theirs.with_context(|| format!("IceT's {}", strategy.name()))?;
                self.comm.comm().barrier(timeout)?;
                if timed {
                    times.push(1e3 * (self.comm.comm().now() - begin));
                }
                if let (Some(ours), Some(theirs)) = (&image, theirs) {
                    pixels_differ += differing(ours, theirs);
                }
            }
            match image {
                Some(Ours::Depth(image)) => self.depth.recycle(image),
                Some(Ours::Blend(image)) => self.blend.recycle(image),
                None => {}
            }
        }

        // What all ranks sent.
        let mine = [sent, reports.last().map_or(0, |report| report.messages_sent)];
        let bytes: Vec<u8> = mine.iter().flat_map(|number| number.to_le_bytes()).collect();
        let all = self.comm.comm().all_gather(&bytes, 16, timeout)?;
        let total = |at: usize| -> u64 {
            let number = |bytes: &Vec<u8>| bytes.get(at..at + 8).and_then(|b| b.try_into().ok());
            all.iter().filter_map(number).map(u64::from_le_bytes).sum()
        };
        let medians: Vec<f64> = rivals_ms.iter().map(|times| median(times)).collect();
        let best = (0..medians.len()).min_by(|&a, &b| medians[a].total_cmp(&medians[b])).unwrap_or(0);
        let ours = median(&ours_ms);
        let column =
            |of: fn(&crate::Report) -> f64| 1e3 * median(&reports.iter().map(of).collect::<Vec<f64>>());
        Ok(Row {
            scene: scene.name(),
            ranks,
            size_px: self.args.size,
            pixels: self.args.pixels,
            rival: IcetStrategy::ALL[best].name(),
            ours_ms: ours,
            rival_ms: medians[best],
            ratio: medians[best] / ours,
            pixels_differ,
            ours_min_ms: smallest(&ours_ms),
            rival_min_ms: smallest(&rivals_ms[best]),
            ours_strategy: format!(
                "{:?}",
                reports.last().map_or(self.args.strategy, |report| report.strategy)
            ),
            simd: self.args.simd.unwrap_or_else(SimdLevel::best).name(),
            ours_mb: total(0) as f64 / 1e6,
            ours_messages: total(8),
            rivals_ms: IcetStrategy::ALL.iter().map(|s| s.name()).zip(medians).collect(),
            columns_ms: [
                ("compress", column(|r| r.compress_secs)),
                ("blend", column(|r| r.blend_secs)),
                ("send", column(|r| r.exchange_secs)),
                ("collect", column(|r| r.collect_secs)),
            ]
            .into(),
        })
    }
}

fn strategy_named(name: &str) -> Result<Strategy, String> {
    let (name, k) = name.split_once(':').unwrap_or((name, "8"));
    match (name, k.parse()) {
        ("direct", _) => Ok(Strategy::DirectSend),
        ("tree", _) => Ok(Strategy::Tree),
        ("bswap", _) => Ok(Strategy::BinarySwap),
        ("radix-k", Ok(k)) => Ok(Strategy::RadixK { k }),
        ("auto", _) => Ok(Strategy::Automatic),
        _ => Err("use direct, tree, bswap, radix-k, radix-k:4 or auto".to_string()),
    }
}

fn simd_named(name: &str) -> Result<SimdLevel, String> {
    let levels = SimdLevel::available();
    let names = || levels.iter().map(|level| level.name()).collect::<Vec<_>>().join(", ");
    let found = levels.iter().find(|level| level.name() == name).copied();
    found.ok_or_else(|| format!("this machine has {}", names()))
}

enum Ours {
    Depth(crate::Image<DepthPixel<[u8; 4]>>),
    Blend(crate::Image<PremultipliedPixel<[f32; 4]>>),
}

fn differing(ours: &Ours, theirs: IcetImage<'_>) -> u64 {
    let count = match (ours, theirs) {
        (Ours::Depth(ours), IcetImage::Rgba8(theirs)) => {
            ours.colors().iter().zip(theirs).filter(|(a, b)| a != b).count()
        }
        (Ours::Blend(ours), IcetImage::RgbaF32(theirs)) => {
            let differ = |(a, b): &(&[f32; 4], &[f32; 4])| {
                // Not "any is farther", so that NaN differs.
                !a.iter().zip(*b).all(|(a, b)| (a - b).abs() <= BLEND_TOLERANCE)
            };
            ours.colors().iter().zip(theirs).filter(differ).count()
        }
        _ => usize::MAX,
    };
    count as u64
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}

fn smallest(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min)
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} processors, {}", self.machine.processors, self.machine.transport)?;
        writeln!(f, "IceT: {}", self.machine.icet)?;
        if let Some(note) = self.machine.note {
            writeln!(f, "note: {note}")?;
        }
        write!(
            f,
            "{:<6} {:>5} {:>6} {:>9} {:>10} {:<9} {:>6} {:>14}",
            "scene", "ranks", "size", "ours ms", "IceT ms", "strategy", "ratio", "pixels differ"
        )?;
        for row in &self.rows {
            write!(
                f,
                "\n{:<6} {:>5} {:>6} {:>9.3} {:>10.3} {:<9} {:>6.2} {:>14}",
                row.scene,
                row.ranks,
                row.size_px,
                row.ours_ms,
                row.rival_ms,
                row.rival,
                row.ratio,
                row.pixels_differ
            )?;
        }
        Ok(())
    }
}
