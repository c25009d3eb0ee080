//! Frames: renders on a separate thread and returns channels in the requested format.

mod channels;
mod job;

pub use channels::{Channel, Pixels};
pub(crate) use job::{Job, Order, start};

use super::object::Object;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A finished frame.
#[derive(Default)]
pub struct FrameImage {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Channels by name, `channel.color` and so on.
    pub channels: BTreeMap<&'static str, Channel>,
    /// Duration of the frame, seconds.
    pub duration_secs: f32,
    /// Samples per pixel, including accumulated earlier frames.
    pub samples: u32,
}

/// Accumulated earlier frames of the same scene.
#[derive(Default)]
pub(crate) struct Accumulated {
    pub(crate) key: Vec<u64>,
    pub(crate) sum: Vec<[f32; 4]>,
    pub(crate) passes: u32,
}

/// State of a frame object apart from its parameters.
#[derive(Default)]
pub struct FrameState {
    pub(crate) job: Option<Arc<Job>>,
    latest: Option<Arc<FrameImage>>,
    /// Images to which the program holds pointers.
    mapped: BTreeMap<String, Arc<FrameImage>>,
}

/// The running or finished job, if any.
pub(crate) fn current_job(frame: &Object) -> Option<Arc<Job>> {
    frame.with_state(|s: &mut FrameState| s.job.clone()).flatten()
}

pub(crate) fn set_job(frame: &Object, job: Arc<Job>) {
    frame.with_state(|s: &mut FrameState| s.job = Some(job));
}

/// Waits for the frame and returns its image; `None` if it was never rendered.
pub fn finish(frame: &Object) -> Option<Arc<FrameImage>> {
    // Waiting while holding the lock would block `discard`.
    let picture = current_job(frame).map(|job| job.wait());
    frame
        .with_state(|s: &mut FrameState| {
            if picture.is_some() {
                s.latest = picture;
            }
            s.latest.clone()
        })
        .flatten()
}

/// Keeps the image alive until the channel is unmapped.
pub(crate) fn hold(frame: &Object, channel: &str, picture: Arc<FrameImage>) {
    frame.with_state(|s: &mut FrameState| s.mapped.insert(channel.to_owned(), picture));
}

/// Removes a mapping; false if there was none.
pub(crate) fn unhold(frame: &Object, channel: &str) -> bool {
    frame.with_state(|s: &mut FrameState| s.mapped.remove(channel).is_some()).unwrap_or(false)
}
