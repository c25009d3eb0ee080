//! Code shared by the experiments with many ranks: ranks simulated in this process, measured
//! frames, columns and texts.

use crate::record::{Record, Row};
use crate::stats::Summary;
use composite::Communicator;
use composite::comm::CommError;
use composite::comm::sim::{Compute, Network, SimComm, run_on};
use composite::render::demo::PreparedDemo;
use composite::render::{
    Activity, DataParallel, FrameOptions, FrameOutput, RankReport, ray_parallel,
};
use rt_core::bvh::BuildOptions;
use std::time::Duration;

/// Note printed with every figure with many ranks.
pub(super) const CAVEAT: &str = "Computing is measured for real: every rank is a thread, one at a \
                                 time has a core, and its clock advances by \
     the processor time of its thread. The network is simulated in this process by the LogGP model \
     of 4X QDR InfiniBand (3.2 GB/s and 1 µs, an \
     interface per rank whose two directions are shared fairly by the messages under way, nothing \
     in the way between interfaces). Not modelled: contention inside \
     the network, noise of the operating system, and that a node has its caches and its memory to \
     itself. One thread a rank.";

/// Maximum wait for a message, on the ranks' own clocks.
const TIMEOUT: Duration = Duration::from_secs(600);

/// The simulated network of all these figures.
pub(super) const NETWORK: Network = Network::QDR;

/// Cost of a frame for a group of ranks, in seconds.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct FrameCost {
    /// From the start of the first rank to the end of the last.
    pub(super) frame_secs: f64,
    /// Tracing and shading: mean over the ranks, and the slowest rank.
    pub(super) render_mean_secs: f64,
    pub(super) render_max_secs: f64,
    /// Choosing hits, collecting tiles, messages and waiting: mean over the ranks.
    pub(super) rest_mean_secs: f64,
    /// Bytes sent by all ranks.
    pub(super) bytes: f64,
    /// Rounds of ray requests.
    pub(super) rounds: f64,
    /// Primary rays of all ranks.
    pub(super) camera_rays: f64,
}

impl FrameCost {
    fn of(reports: &[&RankReport]) -> FrameCost {
        let begin = reports.iter().map(|r| r.begin_at_secs).fold(f64::INFINITY, f64::min);
        let end = reports.iter().map(|r| r.begin_at_secs + r.total_secs()).fold(0.0, f64::max);
        let render = |r: &RankReport| {
            r.secs(Activity::Render) + r.secs(Activity::Shade) + r.secs(Activity::Answer)
        };
        let mean = |f: &dyn Fn(&RankReport) -> f64| {
            reports.iter().map(|r| f(r)).sum::<f64>() / reports.len() as f64
        };
        FrameCost {
            frame_secs: end - begin,
            render_mean_secs: mean(&render),
            render_max_secs: reports.iter().map(|r| render(r)).fold(0.0, f64::max),
            rest_mean_secs: mean(&|r| r.total_secs() - render(r)),
            bytes: reports.iter().map(|r| r.bytes_sent as f64).sum(),
            rounds: reports.iter().map(|r| f64::from(r.rounds)).fold(0.0, f64::max),
            camera_rays: reports.iter().map(|r| r.camera_rays as f64).sum(),
        }
    }
}

/// Frames of a group, and the reports of the last frame by rank.
pub(super) struct Frames {
    /// One entry per counted frame.
    pub(super) costs: Vec<FrameCost>,
    /// Reports of the last frame.
    pub(super) last: Vec<RankReport>,
}

impl Frames {
    /// The frame of median time.
    pub(super) fn median(&self) -> FrameCost {
        let mut sorted = self.costs.clone();
        sorted.sort_by(|a, b| a.frame_secs.total_cmp(&b.frame_secs));
        sorted.get(sorted.len() / 2).copied().unwrap_or_default()
    }

    /// Fastest and slowest frame.
    pub(super) fn range(&self) -> Option<(f64, f64)> {
        let s = Summary::of(&self.costs.iter().map(|c| c.frame_secs).collect::<Vec<_>>())?;
        Some((s.low, s.high))
    }
}

/// Distribution of the work over ranks.
#[derive(Clone, Copy)]
pub(super) enum Sharing {
    /// Every rank has a part of the data.
    SortLast,
    /// Every rank has all data and renders bands of the image.
    RayParallel,
}

/// Renders one warm-up frame and `frames` counted frames on `ranks` simulated ranks.
pub(super) fn frames(
    prepared: &PreparedDemo,
    ranks: usize,
    frames: usize,
    sharing: Sharing,
    options: &FrameOptions,
) -> anyhow::Result<Frames> {
    frames_of(ranks, frames, options, |comm, options| {
        let mut renderer = match sharing {
            Sharing::SortLast => {
                let built = BuildOptions::default();
                let part = prepared.partition.part(&prepared.scene, comm.rank(), &built)?;
                Some(DataParallel::new(comm, part, options.clone())?)
            }
            Sharing::RayParallel => None,
        };
        let options = options.clone();
        Ok(move |comm: &mut SimComm| {
            let PreparedDemo { scene, camera, options: render, .. } = prepared;
            Ok(match &mut renderer {
                Some(renderer) => renderer.frame(comm, camera, render)?,
                None => ray_parallel(comm, scene, camera, render, &options)?,
            })
        })
    })
}

/// Renders one warm-up frame and `frames` counted frames on `ranks` simulated ranks, each by what
/// `begin` makes of its communicator.
pub(super) fn frames_of<F>(
    ranks: usize,
    frames: usize,
    options: &FrameOptions,
    begin: impl Fn(&mut SimComm, &FrameOptions) -> anyhow::Result<F> + Sync,
) -> anyhow::Result<Frames>
where
    F: FnMut(&mut SimComm) -> anyhow::Result<FrameOutput>,
{
    let outputs = run_on(ranks, NETWORK, Compute::Measured(1.0), 1, |mut comm| {
        let options = FrameOptions { timeout: TIMEOUT, ..options.clone() };
        let frame = begin(&mut comm, &options)?;
        measure_frames(&mut comm, frames, frame)
    });
    let mut reports: Vec<Vec<RankReport>> = Vec::with_capacity(ranks);
    for output in outputs {
        let output: anyhow::Result<Vec<RankReport>> = output?;
        reports.push(output?);
    }
    let costs = (0..frames)
        .map(|f| FrameCost::of(&reports.iter().map(|r| &r[f]).collect::<Vec<_>>()))
        .collect();
    Ok(Frames { costs, last: reports.into_iter().filter_map(|mut r| r.pop()).collect() })
}

/// The reports of the counted frames. All ranks begin each frame together.
fn measure_frames(
    comm: &mut SimComm,
    frames: usize,
    mut frame: impl FnMut(&mut SimComm) -> anyhow::Result<FrameOutput>,
) -> anyhow::Result<Vec<RankReport>> {
    let mut reports = Vec::with_capacity(frames);
    for n in 0..=frames {
        comm.barrier(TIMEOUT)?;
        let report = frame(comm)?.report;
        if n > 0 {
            reports.push(report);
        }
    }
    Ok(reports)
}

/// Numbers of ranks that are powers of two, from `first` to `last`.
pub(super) fn powers(first: usize, last: usize) -> impl Iterator<Item = usize> {
    std::iter::successors(Some(first), |n| Some(2 * n)).take_while(move |n| *n <= last)
}

/// Describes the columns of [`with_cost`].
pub(super) fn cost_columns(record: &mut Record) {
    record.column("ranks", "", "ranks, one thread each");
    record.column(
        "frame",
        "ms",
        "median over the frames: from the first rank's begin to the image on rank 0",
    );
    record.column("frame_low", "ms", "fastest frame");
    record.column("frame_high", "ms", "slowest frame");
    record.column(
        "render_mean",
        "ms",
        "tracing and shading of the median frame, mean over the ranks (CPU time)",
    );
    record.column("render_max", "ms", "the same of the slowest rank");
    record.column(
        "rest_mean",
        "ms",
        "compositing, collecting, messages and waiting, mean over the ranks",
    );
    record.column("sent", "MB", "bytes sent by all ranks");
    record.column(
        "camera_rays",
        "Mray",
        "camera rays of all ranks: more than pixels where parts overlap",
    );
    record.notes.push(CAVEAT.into());
}

/// Adds the cost of frames to a row.
pub(super) fn with_cost(row: Row, ranks: usize, frames: &Frames) -> Row {
    let c = frames.median();
    let (low, high) = frames.range().unwrap_or_default();
    row.with("ranks", ranks)
        .with("frame", c.frame_secs * 1e3)
        .with("frame_low", low * 1e3)
        .with("frame_high", high * 1e3)
        .with("render_mean", c.render_mean_secs * 1e3)
        .with("render_max", c.render_max_secs * 1e3)
        .with("rest_mean", c.rest_mean_secs * 1e3)
        .with("sent", c.bytes * 1e-6)
        .with("camera_rays", c.camera_rays * 1e-6)
}

/// Runs `work` on ranks simulated over `network`; every rank must return a result.
pub(super) fn simulated<T: Send>(
    network: Network,
    ranks: usize,
    work: impl Fn(SimComm) -> anyhow::Result<T> + Sync,
) -> anyhow::Result<Vec<T>> {
    let results: Vec<Result<anyhow::Result<T>, CommError>> =
        run_on(ranks, network, Compute::Measured(1.0), 1, work);
    results.into_iter().map(|r| r?).collect()
}
