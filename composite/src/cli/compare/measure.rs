//! Measures both compositors on the same ranks and frames, alternating frame by frame.
use super::table::{Pixels, Row};
use crate::cli::ranks::RankComm;
use crate::compositor::{Compositor, Options};
use crate::frame::{Frame, Image};
use crate::icet::{Icet, IcetFrame, IcetImage, IcetMode, IcetStrategy};
use crate::pixel::{DepthPixel, PremultipliedPixel};
use crate::shared_memory_group::{SharedMemoryRank, shared_memory_group};
use crate::simd::SimdLevel;
use crate::strategies::Strategy;
use crate::workload::{SyntheticFrame, Workload};
use anyhow::Context as _;
use datasets::cli::UsageError;
use half::f16;
use rt_core::math::median_high;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Frames before measuring starts, in which buffers are allocated and connections opened.
const WARM_UP: u64 = 3;
/// Largest difference of a channel that counts as equal where floating-point colours are blended.
/// IceT groups the ranks differently for every strategy, so its own strategies differ by about as
/// much.
const BLEND_TOLERANCE: f32 = 1e-5;

/// Settings that are the same for all frames of a measurement.
#[derive(Clone, Copy, Debug)]
pub(super) struct Setting {
    pub(super) size_px: u32,
    pub(super) pixels: Pixels,
    pub(super) strategy: Strategy,
    pub(super) in_memory: bool,
    pub(super) simd: Option<SimdLevel>,
    pub(super) frames: u64,
    pub(super) timeout: Duration,
}

/// Both compositors on one rank.
pub(super) struct Bench<'a> {
    comm: &'a mut RankComm,
    setting: Setting,
    icet: Icet,
    depth: Compositor<DepthPixel<[u8; 4]>>,
    depth_f16: Compositor<DepthPixel<[f16; 4]>>,
    depth_f32: Compositor<DepthPixel<[f32; 4]>>,
    blend: Compositor<PremultipliedPixel<[f32; 4]>>,
    drawn: SyntheticFrame,
    /// The colours in half precision, where they are composited so.
    halves: Vec<[f16; 4]>,
    /// The colours in single precision: premultiplied where they are blended.
    floats: Vec<[f32; 4]>,
}

/// One rank's members of shared-memory groups, for ranks that are threads.
pub(super) struct GroupMembers {
    depth: SharedMemoryRank<DepthPixel<[u8; 4]>>,
    blend: SharedMemoryRank<PremultipliedPixel<[f32; 4]>>,
}

/// The members of all ranks, until the ranks take them.
pub(super) struct Groups(Vec<Mutex<Option<GroupMembers>>>);

impl Groups {
    /// For ranks that are threads; 0 if they are processes or have to send messages.
    pub(super) fn new(ranks: usize) -> Self {
        let members = shared_memory_group(ranks).into_iter().zip(shared_memory_group(ranks));
        Self(
            members.map(|(depth, blend)| Mutex::new(Some(GroupMembers { depth, blend }))).collect(),
        )
    }

    pub(super) fn members_of(&self, rank: usize) -> Option<GroupMembers> {
        self.0.get(rank)?.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

impl<'a> Bench<'a> {
    pub(super) fn new(
        comm: &'a mut RankComm,
        path: &Path,
        setting: Setting,
    ) -> anyhow::Result<Self> {
        let Setting { size_px: size, strategy, in_memory, simd, timeout, .. } = setting;
        let mode = match setting.pixels {
            Pixels::Depth => IcetMode::Depth,
            Pixels::DepthF16 | Pixels::DepthF32 => IcetMode::DepthF32,
            Pixels::Blend => IcetMode::BlendF32,
        };
        let icet = match comm {
            RankComm::Mpi(comm) => Icet::over_mpi(path, comm, mode, size, size),
            RankComm::Thread(comm) => Icet::over_comm(path, comm, mode, size, size),
            RankComm::Model(comm) => Icet::over_comm(path, comm, mode, size, size),
        };
        // IceT collects colours only. Its ranks do not wait for each other at the end either: the
        // barrier is timed for both.
        let options = Options {
            strategy,
            in_memory,
            simd,
            depth: false,
            final_barrier: false,
            timeout,
            ..Options::default()
        };
        Ok(Self {
            comm,
            setting,
            icet: icet.map_err(|error| UsageError(error.to_string()))?,
            depth: Compositor::new(options.clone()),
            depth_f16: Compositor::new(options.clone()),
            depth_f32: Compositor::new(options.clone()),
            blend: Compositor::new(options),
            drawn: SyntheticFrame::new(size, size),
            halves: Vec::new(),
            floats: Vec::new(),
        })
    }

    /// An image that the threads of this process share, in the formats that they have groups for.
    fn shared(&self) -> anyhow::Result<Option<Shared>> {
        let SyntheticFrame { width_px, height_px, colors, depths, .. } = &self.drawn;
        Ok(match self.setting.pixels {
            Pixels::Depth => {
                let image =
                    Image::from_planes(*width_px, *height_px, colors.clone(), depths.clone())?;
                Some(Shared::Depth(Arc::new(image)))
            }
            Pixels::Blend => {
                let image =
                    Image::from_planes(*width_px, *height_px, self.floats.clone(), Vec::new())?;
                Some(Shared::Blend(Arc::new(image)))
            }
            Pixels::DepthF16 | Pixels::DepthF32 => None,
        })
    }

    /// The frame's colours in the format that is composited.
    fn convert(&mut self) {
        match self.setting.pixels {
            Pixels::Depth => {}
            Pixels::Blend => self.drawn.premultiplied(&mut self.floats),
            Pixels::DepthF16 | Pixels::DepthF32 => {
                let colors = self.drawn.colors.iter();
                self.floats.clear();
                self.floats.extend(colors.map(|color| color.map(|c| f32::from(c) / 255.0)));
                self.halves.clear();
                self.halves.extend(self.floats.iter().map(|color| color.map(f16::from_f32)));
            }
        }
    }

    /// Composites the current frame with IceT's strategy of this number, and calls `look` with the
    /// image where there is one.
    fn run_icet<T>(
        &mut self,
        strategy: usize,
        timed: bool,
        times_ms: &mut [Vec<f64>],
        look: impl FnOnce(IcetImage<'_>) -> T,
    ) -> anyhow::Result<Option<T>> {
        let Setting { pixels, timeout, .. } = self.setting;
        let chosen = IcetStrategy::ALL[strategy];
        self.icet.set_strategy(chosen);
        self.comm.comm().barrier(timeout)?;
        let begin = self.comm.comm().now();
        let frame = match pixels {
            Pixels::Depth => IcetFrame::Depth(&self.drawn.colors, &self.drawn.depths),
            Pixels::DepthF16 | Pixels::DepthF32 => {
                IcetFrame::DepthF32(&self.floats, &self.drawn.depths)
            }
            Pixels::Blend => IcetFrame::BlendF32(&self.floats),
        };
        let theirs = self.icet.composite(self.comm.comm(), frame, self.drawn.bounds);
        let theirs = theirs.with_context(|| format!("IceT's {}", chosen.name()))?;
        self.comm.comm().barrier(timeout)?;
        if timed {
            times_ms[strategy].push(1e3 * (self.comm.comm().now() - begin));
        }
        Ok(theirs.map(look))
    }

    /// Composites the current frame; `order` is for blending.
    fn run_ours(
        &mut self,
        order: Vec<usize>,
    ) -> anyhow::Result<(Option<CompositeImage>, crate::Report)> {
        let comm = self.comm.comm();
        let SyntheticFrame { width_px: w, height_px: h, colors, depths, bounds, .. } = &self.drawn;
        Ok(match self.setting.pixels {
            Pixels::Depth => {
                let frame = Frame::with_depth(*w, *h, colors, depths)?.with_bounds(*bounds)?;
                let done = self.depth.composite(comm, &frame)?;
                (done.image.map(CompositeImage::Depth), done.report)
            }
            Pixels::DepthF16 => {
                let frame = Frame::with_depth(*w, *h, &self.halves, depths)?;
                let done = self.depth_f16.composite(comm, &frame.with_bounds(*bounds)?)?;
                (done.image.map(CompositeImage::DepthF16), done.report)
            }
            Pixels::DepthF32 => {
                let frame = Frame::with_depth(*w, *h, &self.floats, depths)?;
                let done = self.depth_f32.composite(comm, &frame.with_bounds(*bounds)?)?;
                (done.image.map(CompositeImage::DepthF32), done.report)
            }
            Pixels::Blend => {
                // The order changes from frame to frame; the buffers remain.
                self.blend.set_order(Some(order));
                let frame = Frame::premultiplied(*w, *h, &self.floats)?.with_bounds(*bounds)?;
                let done = self.blend.composite(comm, &frame)?;
                (done.image.map(CompositeImage::Blend), done.report)
            }
        })
    }

    /// Measures frames of one workload.
    pub(super) fn measure(
        &mut self,
        scene: Workload,
        mut members: Option<&mut GroupMembers>,
    ) -> anyhow::Result<Row> {
        let (rank, ranks) = (self.comm.comm().rank(), self.comm.comm().size());
        let Setting { size_px, pixels, strategy, simd, frames, timeout, .. } = self.setting;
        let mut ours_ms = Vec::new();
        let mut rivals_ms = vec![Vec::new(); IcetStrategy::ALL.len()];
        let mut pixels_differ = 0;
        let (mut sent, mut reports) = (0, Vec::new());
        for moment in 0..WARM_UP + frames {
            scene.draw(moment, rank, ranks, &mut self.drawn);
            let order = scene.front_to_back(moment, ranks);
            self.convert();
            if pixels == Pixels::Blend {
                self.icet.set_order(&order);
            }
            let timed = moment >= WARM_UP;

            // Renderers of one process can draw into shared images.
            let shared = if members.is_some() { self.shared()? } else { None };
            let turns = rotated_order(1 + IcetStrategy::ALL.len(), moment);
            let ours_at = turns.iter().position(|turn| *turn == 0).unwrap_or(0);
            let mut copies = Vec::new();
            for turn in &turns[..ours_at] {
                copies.extend(self.run_icet(turn - 1, timed, &mut rivals_ms, |image| {
                    IcetPixels::copied(&image)
                })?);
            }

            // Ours.
            self.comm.comm().barrier(timeout)?;
            let begin = self.comm.comm().now();
            let (image, report) = match (&shared, &mut members) {
                (Some(Shared::Depth(image)), Some(members)) => {
                    let (comm, bounds) = (self.comm.comm(), self.drawn.bounds);
                    let done =
                        members.depth.composite(comm, image, bounds, self.depth.options())?;
                    (done.image.map(CompositeImage::Depth), done.report)
                }
                (Some(Shared::Blend(image)), Some(members)) => {
                    self.blend.set_order(Some(order));
                    let (comm, bounds) = (self.comm.comm(), self.drawn.bounds);
                    let done =
                        members.blend.composite(comm, image, bounds, self.blend.options())?;
                    (done.image.map(CompositeImage::Blend), done.report)
                }
                _ => self.run_ours(order)?,
            };
            self.comm.comm().barrier(timeout)?;
            if timed {
                ours_ms.push(1e3 * (self.comm.comm().now() - begin));
                sent = sent.max(report.bytes_sent);
                reports.push(report);
            }

            // Compare with IceT's strategies that ran before ours, and run the remaining ones.
            if let Some(ours) = &image {
                pixels_differ +=
                    copies.iter().map(|theirs| count_differing(ours, theirs.image())).sum::<u64>();
            }
            drop(copies);
            for turn in &turns[ours_at + 1..] {
                let differ = self.run_icet(turn - 1, timed, &mut rivals_ms, |theirs| {
                    image.as_ref().map_or(0, |ours| count_differing(ours, theirs))
                })?;
                pixels_differ += differ.unwrap_or(0);
            }
            match (image, &mut members) {
                (Some(CompositeImage::Depth(image)), Some(members)) => members.depth.recycle(image),
                (Some(CompositeImage::Blend(image)), Some(members)) => members.blend.recycle(image),
                (Some(CompositeImage::Depth(image)), None) => self.depth.recycle(image),
                (Some(CompositeImage::DepthF16(image)), _) => self.depth_f16.recycle(image),
                (Some(CompositeImage::DepthF32(image)), _) => self.depth_f32.recycle(image),
                (Some(CompositeImage::Blend(image)), None) => self.blend.recycle(image),
                (None, _) => {}
            }
        }

        // Bytes and messages sent by all ranks.
        let mine = [sent, reports.last().map_or(0, |report| report.messages_sent)];
        let bytes: Vec<u8> = mine.iter().flat_map(|number| number.to_le_bytes()).collect();
        let all = self.comm.comm().all_gather(&bytes, 16, timeout)?;
        let total = |at: usize| -> u64 {
            let number = |bytes: &Vec<u8>| bytes.get(at..at + 8).and_then(|b| b.try_into().ok());
            all.iter().filter_map(number).map(u64::from_le_bytes).sum()
        };
        let medians: Vec<f64> = rivals_ms.iter().map(|times| median(times)).collect();
        let best =
            (0..medians.len()).min_by(|&a, &b| medians[a].total_cmp(&medians[b])).unwrap_or(0);
        let ours = median(&ours_ms);
        let column = |of: fn(&crate::Report) -> f64| {
            1e3 * median(&reports.iter().map(of).collect::<Vec<f64>>())
        };
        Ok(Row {
            scene: scene.name().to_string(),
            ranks,
            size_px,
            pixels,
            rival: IcetStrategy::ALL[best].name().to_string(),
            ours_ms: ours,
            rival_ms: medians[best],
            ratio: medians[best] / ours,
            pixels_differ,
            ours_min_ms: smallest(&ours_ms),
            rival_min_ms: smallest(&rivals_ms[best]),
            ours_strategy: match reports.last() {
                Some(report) if report.machines > 1 => {
                    format!("SharedMemory on {}, {:?}", report.machines, report.strategy)
                }
                Some(report) if report.in_memory => "SharedMemory".to_string(),
                Some(report) => format!("{:?}", report.strategy),
                None => format!("{strategy:?}"),
            },
            simd: simd.unwrap_or_else(SimdLevel::best).name().to_string(),
            ours_mb: total(0) as f64 / 1e6,
            ours_messages: total(8),
            rivals_ms: IcetStrategy::ALL
                .iter()
                .map(|s| s.name().to_string())
                .zip(medians)
                .collect(),
            columns_ms: [
                ("compress", column(|r| r.compress_secs)),
                ("blend", column(|r| r.blend_secs)),
                ("send", column(|r| r.exchange_secs)),
                ("collect", column(|r| r.collect_secs)),
            ]
            .map(|(name, ms)| (name.to_string(), ms))
            .into(),
        })
    }
}

/// The order in which a frame is composited by each, the same on all ranks: rotated from frame to
/// frame, and reversed in every second one, so that each is first, last and after each neighbour
/// equally often. The same as in `runner` of the member bench, which may use composite and may not
/// be used by it.
fn rotated_order(count: usize, frame: u64) -> Vec<usize> {
    let mut turns: Vec<usize> =
        (0..count).map(|i| (i + frame as usize / 2) % count.max(1)).collect();
    if frame % 2 == 1 {
        turns.reverse();
    }
    turns
}

/// A copy of IceT's image, which it keeps only until its next frame.
enum IcetPixels {
    Rgba8(Vec<[u8; 4]>),
    RgbaF32(Vec<[f32; 4]>),
}

impl IcetPixels {
    fn copied(image: &IcetImage<'_>) -> IcetPixels {
        match image {
            IcetImage::Rgba8(colors) => IcetPixels::Rgba8(colors.to_vec()),
            IcetImage::RgbaF32(colors) => IcetPixels::RgbaF32(colors.to_vec()),
        }
    }

    fn image(&self) -> IcetImage<'_> {
        match self {
            IcetPixels::Rgba8(colors) => IcetImage::Rgba8(colors),
            IcetPixels::RgbaF32(colors) => IcetImage::RgbaF32(colors),
        }
    }
}

/// What a rank has drawn, as an owned image.
enum Shared {
    Depth(Arc<Image<DepthPixel<[u8; 4]>>>),
    Blend(Arc<Image<PremultipliedPixel<[f32; 4]>>>),
}

enum CompositeImage {
    Depth(Image<DepthPixel<[u8; 4]>>),
    DepthF16(Image<DepthPixel<[f16; 4]>>),
    DepthF32(Image<DepthPixel<[f32; 4]>>),
    Blend(Image<PremultipliedPixel<[f32; 4]>>),
}

fn count_differing(ours: &CompositeImage, theirs: IcetImage<'_>) -> u64 {
    let count = match (ours, theirs) {
        (CompositeImage::Depth(ours), IcetImage::Rgba8(theirs)) => {
            ours.colors().iter().zip(theirs).filter(|(a, b)| a != b).count()
        }
        (CompositeImage::DepthF16(ours), IcetImage::RgbaF32(theirs)) => {
            let differ = |(a, b): &(&[f16; 4], &[f32; 4])| **a != b.map(f16::from_f32);
            ours.colors().iter().zip(theirs).filter(differ).count()
        }
        (CompositeImage::DepthF32(ours), IcetImage::RgbaF32(theirs)) => {
            ours.colors().iter().zip(theirs).filter(|(a, b)| a != b).count()
        }
        (CompositeImage::Blend(ours), IcetImage::RgbaF32(theirs)) => {
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
    median_high(&mut values.to_vec()).unwrap_or(f64::NAN)
}

fn smallest(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ours_does_not_always_have_the_first_turn() {
        let count = 1 + IcetStrategy::ALL.len();
        for place in 0..count {
            for contender in 0..count {
                let here = (0..2 * count as u64)
                    .filter(|frame| rotated_order(count, *frame)[place] == contender);
                assert_eq!(here.count(), 2, "contender {contender} at place {place}");
            }
        }
    }
}
