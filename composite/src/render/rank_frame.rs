//! One rank's view of a frame, and work on several of its items at once.
use super::Part;
use super::request_reply::RankChannel;
use rayon::prelude::*;
use rt_core::distributed::DistributedFrame;
use std::sync::atomic::Ordering;

/// One rank's view of the frame in work.
pub(super) struct RankFrame<'a> {
    pub(super) frame: &'a DistributedFrame<'a>,
    pub(super) part: &'a Part,
    pub(super) parallel: bool,
}

impl RankFrame<'_> {
    /// Number in the whole of this part's primitive.
    pub(super) fn global_primitive(&self, instance: u32, primitive: u32) -> u32 {
        let geometry = self.part.scene.world.instances()[instance as usize].geometry;
        self.part.primitive_ids[geometry][primitive as usize]
    }
}

/// Calls `f` with every item and its place, on several threads if wanted; each item done is a sign
/// of life.
pub(super) fn each<T: Send>(
    channel: &mut RankChannel<'_>,
    parallel: bool,
    items: &mut [T],
    f: impl Fn(usize, &mut T) + Sync,
) {
    if parallel {
        channel.in_background(|steps| {
            items.par_iter_mut().enumerate().for_each(|(i, item)| {
                f(i, item);
                steps.fetch_add(1, Ordering::Relaxed);
            });
        });
    } else {
        items.iter_mut().enumerate().for_each(|(i, item)| {
            f(i, item);
            channel.alive();
        });
    }
}
