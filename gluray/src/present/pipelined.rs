//! Presents images one frame late (section 4.1.2). The image of the last frame is shown while the
//! current frame is traced in parallel.
//!
//! Each time pending draws must be in the window, the layer that the previous frame traced at the
//! same position is presented. Other threads trace the rays of the current draws until the program
//! reaches this position again. The driver's lines and text belong to the new frame. Only windows
//! are delayed. Content of framebuffer objects is needed at once, and a program that reads its
//! window must not read an old image twice.

use crate::capture::draw::TexturedDraw;
use crate::capture::geometry_cache::BuildCounts;
use crate::host::config::Settings;
use crate::trace::thread_pool;
use crate::trace::{Layer, Prepared};
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// The result of tracing draws.
#[derive(Default)]
pub(crate) struct TracedFrame {
    pub(crate) layer: Layer,
    /// The numbers of shadow rays and ambient occlusion rays.
    pub(crate) extra: [u64; 2],
    pub(crate) primary: u64,
    /// The pixels of the draws' rectangles, summed over draws.
    pub(crate) searched: u64,
    pub(crate) structures: BuildCounts,
    pub(crate) took: Duration,
    /// The draws, whose memory is reused.
    pub(crate) draws: Vec<TexturedDraw>,
}

/// Traces draws on the threads of the pool. The caller is one of them.
pub(crate) fn trace(draws: Vec<TexturedDraw>, settings: &Settings) -> TracedFrame {
    let start = Instant::now();
    let mut structures = BuildCounts::default();
    let (layer, extra, primary, searched) = {
        let ready: Vec<Prepared<'_>> = draws
            .iter()
            .filter_map(|(d, image)| Prepared::new(d, image.clone(), &mut structures))
            .collect();
        let (layer, extra) = crate::cluster::nearest(&ready, settings);
        let searched = ready.iter().map(|p| p.rect.w as u64 * p.rect.h as u64).sum();
        (layer, extra, ready.iter().map(|p| p.rays.load(Relaxed)).sum(), searched)
    };
    TracedFrame { layer, extra, primary, searched, structures, took: start.elapsed(), draws }
}

/// The layers that are being traced, by their position in the frame.
#[derive(Default)]
pub(crate) struct PipelinedPresent {
    jobs: Vec<Receiver<TracedFrame>>,
    /// The next position in this frame.
    place: usize,
    /// The number of further frames without delay, because the program read its window.
    reads: u32,
}

/// The number of frames after a read-back in which the program may read again.
const READING_FRAMES: u32 = 8;

impl PipelinedPresent {
    /// Ends a frame.
    pub(crate) fn frame_done(&mut self) {
        // Positions that this frame did not use show nothing in the next one.
        self.jobs.truncate(self.place);
        self.place = 0;
        self.reads = self.reads.saturating_sub(1);
    }

    /// Records that the program reads its framebuffer.
    pub(crate) fn read(&mut self) {
        self.reads = READING_FRAMES;
        self.jobs.clear();
    }

    /// False while the program reads its window.
    pub(crate) fn is_allowed(&self) -> bool {
        self.reads == 0
    }

    /// Starts tracing `draws`, and gives the result of the last frame. Without such a result, it
    /// waits for these draws.
    pub(crate) fn exchange(
        &mut self,
        draws: Vec<TexturedDraw>,
        settings: Settings,
    ) -> Option<TracedFrame> {
        let (sender, receiver) = channel();
        // Waits for the previous job first. Two jobs at once would only compete for threads.
        let before = self.jobs.get(self.place).and_then(|r| r.recv().ok());
        thread_pool::spawn(move || {
            // There is no receiver when the context is gone.
            sender.send(trace(draws, &settings)).ok();
        });
        let (shown, next) = match before {
            Some(shown) => (Some(shown), receiver),
            None => {
                let first = receiver.recv().ok();
                // The next frame shows it again.
                let (sender, again) = channel();
                if let Some(t) = &first {
                    let layer = t.layer.clone();
                    sender
                        .send(TracedFrame { layer, took: Duration::ZERO, ..TracedFrame::default() })
                        .ok();
                }
                (first, again)
            }
        };
        match self.jobs.get_mut(self.place) {
            Some(job) => *job = next,
            None => self.jobs.push(next),
        }
        self.place += 1;
        shown
    }
}
