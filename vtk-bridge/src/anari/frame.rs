//! Frames: renders on a separate thread and returns channels in the requested format.

mod channels;
mod job;

pub use channels::{Channel, Pixels};
pub(crate) use job::{Job, Order, start};

use super::object::Object;
use super::status::lock;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A finished frame.
#[derive(Default)]
pub struct FrameImage {
    /// Pixels per row, and rows.
    pub size: [u32; 2],
    /// By name, `channel.color` and so on.
    pub channels: BTreeMap<&'static str, Channel>,
    /// Seconds it took.
    pub duration_secs: f32,
    /// Samples per pixel, with those of earlier frames that were added up.
    pub samples: u32,
}

/// Sums of earlier frames of the same scene.
#[derive(Default)]
pub(crate) struct Accumulated {
    pub(crate) key: Vec<u64>,
    pub(crate) sum: Vec<[f32; 4]>,
    pub(crate) passes: u32,
}

/// What a frame object has besides its parameters.
#[derive(Default)]
pub struct FrameState {
    pub(crate) job: Option<Arc<Job>>,
    latest: Option<Arc<FrameImage>>,
    /// Pictures of which the program holds addresses.
    mapped: BTreeMap<String, Arc<FrameImage>>,
}

/// Gives the frame's state to `f`; `None` for objects that are no frames.
fn with_state<T>(frame: &Object, f: impl FnOnce(&mut FrameState) -> T) -> Option<T> {
    match &mut *lock(&frame.extra) {
        super::object::Extra::Frame(state) => Some(f(state)),
        _ => None,
    }
}

/// The job in work or done, if any.
pub(crate) fn current_job(frame: &Object) -> Option<Arc<Job>> {
    with_state(frame, |s| s.job.clone()).flatten()
}

pub(crate) fn set_job(frame: &Object, job: Arc<Job>) {
    with_state(frame, |s| s.job = Some(job));
}

/// Waits for the frame and gives its picture; `None` when it was never drawn.
pub fn finish(frame: &Object) -> Option<Arc<FrameImage>> {
    // Waiting with the lock held would stop `discard`.
    let picture = current_job(frame).map(|job| job.wait());
    with_state(frame, |s| {
        if picture.is_some() {
            s.latest = picture;
        }
        s.latest.clone()
    })
    .flatten()
}

/// Keeps the picture alive until the channel is unmapped.
pub(crate) fn hold(frame: &Object, channel: &str, picture: Arc<FrameImage>) {
    with_state(frame, |s| s.mapped.insert(channel.to_owned(), picture));
}

/// Forgets a mapping; false when there was none.
pub(crate) fn unhold(frame: &Object, channel: &str) -> bool {
    with_state(frame, |s| s.mapped.remove(channel).is_some()).unwrap_or(false)
}
