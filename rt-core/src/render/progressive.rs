//! Renders one sample per pixel at a time, with an image after each.

use super::assemble::{FrameSlices, Tile, assemble, bands, blank_frame, tiles};
use super::{RenderError, RenderOptions, RenderOutput};
use crate::camera::Camera;
use crate::effect_plan::{plan, warn_without_effect};
use crate::effects::Effects;
use crate::frame::{Frame, Layers};
use crate::ray_stats::RayStats;
use crate::scene::Scene;
use crate::shade::{FrameContext, TileArea, TileLayers, Workspace, render_tile};
use rayon::prelude::*;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Why rendering ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum StopReason {
    /// It has not ended yet.
    Running,
    /// All samples are done.
    Samples,
    /// The time limit was reached.
    Time,
    /// The error estimate fell below the limit.
    Error,
    /// The cancel flag was set.
    Cancelled,
}

/// A report on a frame.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct RenderReport {
    /// Rays by kind.
    pub rays: RayStats,
    /// Effects that ran.
    pub effects: Effects,
    /// Effects that scene or camera need, but the options do not include.
    pub left_out: Effects,
    /// Requests that changed nothing or were only partly fulfilled; empty when there are none.
    pub warnings: Vec<String>,
    /// Samples of every pixel; tiles may have one more when a time limit or cancellation ended a
    /// pass early.
    pub samples: u32,
    /// Why rendering ended.
    pub stopped: StopReason,
    /// Estimated standard error of a pixel (root mean square over the image, luminance), in 8-bit
    /// grey levels of linear light. `None` below two samples.
    pub error_levels: Option<f32>,
    /// Wall time since the start.
    pub elapsed: Duration,
}

/// Memory that one frame leaves for the next.
#[derive(Default)]
pub(super) struct Buffers {
    tiles: Vec<Tile>,
    spare: Vec<ThreadScratch>,
    /// An image that is no longer needed.
    pub(super) frame: Frame,
}

/// Scratch memory of a thread.
#[derive(Default)]
struct ThreadScratch {
    work: Workspace,
    /// The current tile of one-sample images; otherwise each tile has its own layers.
    layers: Option<TileLayers>,
}

/// An image in progress.
pub struct ProgressiveRenderer<'a> {
    context: FrameContext<'a>,
    /// Tiles that accumulate samples. One-sample images have none: each tile is copied to the image
    /// while it is still in the cache, which saves writing and reading 32 bytes per pixel of main
    /// memory (measured: 5 of 50 ms at 1024 x 1024).
    tiles: Vec<Tile>,
    /// Buffers that no thread is using.
    spare: Mutex<Vec<ThreadScratch>>,
    /// Memory for the image. After the first step of a one-sample image, it holds the image.
    old_frame: Frame,
    rays: RayStats,
    left_out: Effects,
    warnings: Vec<String>,
    samples: u32,
    stopped: StopReason,
    started: Instant,
    /// A second cancel flag, for the asynchronous renderer.
    pub(super) also_cancel: Option<&'a AtomicBool>,
}

impl<'a> ProgressiveRenderer<'a> {
    /// Checks all arguments and sets up the frame; traces nothing yet.
    pub fn new(
        scene: &'a Scene,
        camera: &Camera,
        options: &'a RenderOptions,
    ) -> Result<ProgressiveRenderer<'a>, RenderError> {
        ProgressiveRenderer::with_buffers(scene, camera, options, Buffers::default())
    }

    /// As [`ProgressiveRenderer::new`], with the memory of an earlier frame.
    pub(super) fn with_buffers(
        scene: &'a Scene,
        camera: &Camera,
        options: &'a RenderOptions,
        buffers: Buffers,
    ) -> Result<ProgressiveRenderer<'a>, RenderError> {
        let started = Instant::now();
        let plan = plan(scene, camera, options)?;
        Ok(ProgressiveRenderer {
            context: FrameContext::new(scene, camera, options, plan.effects),
            tiles: if one_pass(options) {
                buffers.tiles
            } else {
                tiles(options, camera, buffers.tiles)
            },
            spare: Mutex::new(buffers.spare),
            old_frame: buffers.frame,
            rays: RayStats::default(),
            left_out: plan.left_out,
            warnings: plan.warnings,
            samples: 0,
            stopped: StopReason::Running,
            started,
            also_cancel: None,
        })
    }

    /// Adds one sample to every pixel. Returns whether more samples are due; does nothing when none
    /// are.
    pub fn step(&mut self) -> Result<bool, RenderError> {
        if self.stopped != StopReason::Running {
            return Ok(false);
        }
        let sample = self.samples;
        let (context, spare, started) = (&self.context, &self.spare, self.started);
        let also_cancel = self.also_cancel;
        let options = context.options;
        // A pass may end early between tiles: at once when cancelled, at the time limit only after
        // the first pass.
        let cut = || {
            let is_set = |f: &AtomicBool| f.load(Ordering::Relaxed);
            if options.cancel.as_deref().is_some_and(is_set) || also_cancel.is_some_and(is_set) {
                Some(StopReason::Cancelled)
            } else if sample > 0 && options.time_limit.is_some_and(|l| started.elapsed() >= l) {
                Some(StopReason::Time)
            } else {
                None
            }
        };
        let one_pass = one_pass(options);
        // Rays of the tiles that were drawn, and the number of tiles that were not.
        let draw = |area: &TileArea, layers: &mut TileLayers, work: &mut Workspace| {
            catch_unwind(AssertUnwindSafe(|| render_tile(context, area, layers, work, sample)))
                .map_err(|panic| locate_panic(context, *area, sample, message_of(&*panic)))
        };
        let add = |mut a: (RayStats, u32), b: (RayStats, u32)| {
            a.0 += b.0;
            Ok((a.0, a.1 + b.1))
        };
        let none = || (RayStats::default(), 0);
        let (rays, missing) = if one_pass {
            let old = std::mem::take(&mut self.old_frame);
            self.old_frame = blank_frame(options, &context.camera, old);
            let frame = &mut self.old_frame;
            let pieces =
                bands(options, frame).into_par_iter().flat_map(|b| b.tiles().into_par_iter());
            let draw_piece = |mut piece: FrameSlices<'_>| {
                let mut scratch = take_scratch(spare);
                let mut layers = ready_layers(context, scratch.layers.take());
                let cut = cut().is_some();
                let stats = if cut {
                    layers.clear_color();
                    RayStats::default()
                } else {
                    draw(&piece.area, &mut layers, &mut scratch.work)?
                };
                piece.write(&layers);
                scratch.layers = Some(layers);
                return_scratch(spare, scratch);
                Ok::<_, RenderError>((stats, cut as u32))
            };
            pieces.map(draw_piece).try_reduce(none, add)?
        } else {
            let draw_tile = |tile: &mut Tile| {
                if cut().is_some() {
                    return Ok::<_, RenderError>((RayStats::default(), 1));
                }
                let mut scratch = take_scratch(spare);
                let stats = draw(&tile.area, &mut tile.layers, &mut scratch.work)?;
                tile.samples += 1;
                return_scratch(spare, scratch);
                Ok((stats, 0))
            };
            self.tiles.par_iter_mut().map(draw_tile).try_reduce(none, add)?
        };
        if let Some(error) = RenderError::unreadable(context.scene) {
            return Err(error);
        }
        self.rays += rays;
        let complete = missing == 0;
        self.samples += complete as u32;
        self.stopped = if let Some(reason) = cut() {
            reason
        } else if self.samples >= options.samples || !options.layers.contains(Layers::COLOR) {
            StopReason::Samples
        } else if self.time_is_up() {
            StopReason::Time
        } else if let (Some(limit), Some(error), true) =
            (options.max_error_levels, self.error_levels(), self.samples >= 4)
            && error <= limit
        {
            StopReason::Error
        } else {
            StopReason::Running
        };
        Ok(self.stopped == StopReason::Running)
    }

    fn time_is_up(&self) -> bool {
        self.context.options.time_limit.is_some_and(|l| self.started.elapsed() >= l)
    }

    /// Estimated standard error, see [`RenderReport::error_levels`].
    pub fn error_levels(&self) -> Option<f32> {
        let usable = self.samples >= 2
            && !one_pass(self.context.options)
            && self.tiles.iter().all(|t| !t.layers.luminance_sq.is_empty());
        usable.then(|| {
            let sum: f64 =
                self.tiles.iter().map(|t| t.layers.squared_error(&t.area, t.samples)).sum();
            let area = self.context.options.area();
            (255.0 * (sum / (area.width as f64 * area.height as f64)).sqrt()) as f32
        })
    }

    /// The image so far.
    pub fn frame(&self) -> Frame {
        let options = self.context.options;
        if !one_pass(options) {
            return assemble(options, &self.tiles, Frame::default());
        }
        // Before the first step, `old_frame` holds an unrelated image.
        if self.stopped == StopReason::Running {
            blank_frame(options, &self.context.camera, Frame::default())
        } else {
            self.old_frame.clone()
        }
    }

    /// The finished image, its report, and the memory for the next frame.
    pub(super) fn finish(mut self) -> (RenderOutput, Buffers) {
        let mut frame = std::mem::take(&mut self.old_frame);
        if !one_pass(self.context.options) {
            frame = assemble(self.context.options, &self.tiles, frame);
        }
        let report = self.report();
        let spare = self.spare.into_inner().unwrap_or_default();
        (
            RenderOutput { frame, report },
            Buffers { tiles: self.tiles, spare, frame: Frame::default() },
        )
    }

    /// The report so far.
    pub fn report(&self) -> RenderReport {
        let mut warnings = self.warnings.clone();
        let options = self.context.options;
        if self.samples > 0 {
            warn_without_effect(
                options.effects,
                self.context.effects,
                self.left_out,
                &self.rays,
                &mut warnings,
            );
        }
        RenderReport {
            rays: self.rays,
            effects: self.context.effects,
            left_out: self.left_out,
            warnings,
            samples: self.samples,
            stopped: self.stopped,
            error_levels: self.error_levels(),
            elapsed: self.started.elapsed(),
        }
    }
}

/// True when tiles keep no state between samples: one sample, or layers without samples.
fn one_pass(options: &RenderOptions) -> bool {
    options.samples == 1 || !options.layers.contains(Layers::COLOR)
}

/// Empty layers of a tile. Reuses the memory of `old` layers where they fit.
fn ready_layers(context: &FrameContext<'_>, old: Option<TileLayers>) -> TileLayers {
    let background_depth = context.camera.background_depth() as f32;
    let layers = context.options.layers;
    let used = old.and_then(|mut l| l.reset(layers, background_depth, false).then_some(l));
    used.unwrap_or_else(|| TileLayers::new(layers, background_depth, false))
}

fn take_scratch(spare: &Mutex<Vec<ThreadScratch>>) -> ThreadScratch {
    spare.lock().map(|mut s| s.pop()).ok().flatten().unwrap_or_default()
}

fn return_scratch(spare: &Mutex<Vec<ThreadScratch>>, scratch: ThreadScratch) {
    if let Ok(mut s) = spare.lock() {
        s.push(scratch);
    }
}

/// Renders the tile's pixels one by one until one panics, to find its position.
fn locate_panic(
    context: &FrameContext<'_>,
    tile: TileArea,
    sample: u32,
    message: String,
) -> RenderError {
    for y in tile.y..tile.y + tile.height {
        for x in tile.x..tile.x + tile.width {
            let area = TileArea { x, y, width: 1, height: 1, sample };
            let again = catch_unwind(AssertUnwindSafe(|| {
                let mut layers = TileLayers::new(context.options.layers, 0.0, false);
                render_tile(context, &area, &mut layers, &mut Workspace::default(), sample)
            }));
            if let Err(panic) = again {
                return RenderError::Panicked { x, y, sample, message: message_of(&*panic) };
            }
        }
    }
    let message = format!(
        "{message} (only with the whole tile of {} x {} pixels from here)",
        tile.width, tile.height
    );
    RenderError::Panicked { x: tile.x, y: tile.y, sample, message }
}

fn message_of(panic: &(dyn std::any::Any + Send)) -> String {
    panic
        .downcast_ref::<&str>()
        .map(|s| s.to_string())
        .or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "panic without a message".into())
}
