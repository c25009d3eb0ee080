//! One frame late (section 4.1.2): what the program drew last is shown while what it draws now is
//! traced beside it.
//!
//! Each time pending draws have to be in the window, the layer that the same place of the frame
//! before came to is put there, and the rays for these draws are sent by other threads until the
//! program comes here again. Lines and text of the driver's are those of the new frame. Only
//! windows are late: what is drawn into framebuffer objects is drawn to be used at once, and a
//! program that reads its window is not made to read an old picture twice.

use crate::capture::geometry_cache::BuildCounts;
use crate::interpose::context::Context;
use crate::present::frame::Pending;
use crate::present::framebuffer_pass::CompositeMode;
use crate::trace::thread_pool;
use crate::trace::{Layer, Prepared};
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// What draws came to.
#[derive(Default)]
pub(crate) struct TracedFrame {
    pub(crate) layer: Layer,
    /// Shadow rays, ambient occlusion rays.
    pub(crate) extra: [u64; 2],
    pub(crate) primary: u64,
    pub(crate) structures: BuildCounts,
    pub(crate) took: Duration,
    /// The draws, whose memory serves again.
    pub(crate) draws: Vec<Pending>,
}

/// Traces draws on the threads of the pool, of which this is one.
pub(crate) fn trace(draws: Vec<Pending>, settings: &crate::host::config::Settings) -> TracedFrame {
    let start = Instant::now();
    let mut structures = BuildCounts::default();
    let (layer, extra, primary) = {
        let ready: Vec<Prepared<'_>> = draws
            .iter()
            .filter_map(|(d, image)| Prepared::new(d, image.clone(), &mut structures))
            .collect();
        let (layer, extra) = crate::cluster::nearest(&ready, settings);
        (layer, extra, ready.iter().map(|p| p.rays.load(Relaxed)).sum())
    };
    TracedFrame { layer, extra, primary, structures, took: start.elapsed(), draws }
}

/// The layers that are on their way, by their place in the frame.
#[derive(Default)]
pub(crate) struct PipelinedPresent {
    jobs: Vec<Receiver<TracedFrame>>,
    /// The next place of this frame.
    place: usize,
    /// Frames for which nothing is late, because the program read its window.
    reads: u32,
}

/// Frames after a read-back in which the program may read again.
const READING_FRAMES: u32 = 8;

impl PipelinedPresent {
    /// A frame is over.
    pub(crate) fn frame_done(&mut self) {
        // Draws that this frame did not have show nothing in the next.
        self.jobs.truncate(self.place);
        self.place = 0;
        self.reads = self.reads.saturating_sub(1);
    }

    /// The program reads what it drew.
    pub(crate) fn read(&mut self) {
        self.reads = READING_FRAMES;
        self.jobs.clear();
    }
}

impl Context {
    /// True when what is pending may be shown in the next frame.
    pub(crate) fn may_be_pipelined(&self, before: &str) -> bool {
        let reads = ["Read", "Copy", "Blit", "GetTex", "Accum", "Query"];
        self.config.settings.asynchronous
            && self.frame.pipelined.reads == 0
            && self.state.framebuffer == 0
            && !reads.iter().any(|r| before.contains(r))
            && !thread_pool::forked()
    }

    /// Sends `draws` off and shows what came of those of the last frame; without such, waits for
    /// these.
    pub(crate) fn flush_pipelined(&mut self, draws: Vec<Pending>, func: u32) {
        let (sender, receiver) = channel();
        let settings = self.config.settings.clone();
        let start = Instant::now();
        // The one before first: two at a time would only take threads from each other.
        let place = self.frame.pipelined.place;
        let before = self.frame.pipelined.jobs.get(place).and_then(|r| r.recv().ok());
        thread_pool::spawn(move || {
            // Nobody waits for it when the context has gone.
            sender.send(trace(draws, &settings)).ok();
        });
        let (shown, next) = match before {
            Some(shown) => (Some(shown), receiver),
            None => {
                let first = receiver.recv().ok();
                // The next frame shows it once more.
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
        self.counters.add_time("wait", start.elapsed());
        if place < self.frame.pipelined.jobs.len() {
            self.frame.pipelined.jobs[place] = next;
        } else {
            self.frame.pipelined.jobs.push(next);
        }
        self.frame.pipelined.place += 1;
        if let Some(traced) = shown {
            drop(self.present_traced(traced, CompositeMode::Surface(func), None));
        }
    }
}
