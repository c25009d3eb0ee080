//! One rank's view of a frame, and a parallel loop over its items.
use super::Part;
use super::request_reply::RankChannel;
use rayon::prelude::*;
use rt_core::camera::Camera;
use rt_core::deferred::DeferredFrame;
use rt_core::render::RenderOptions;
use std::sync::atomic::Ordering;

/// One rank's view of the current frame.
pub(super) struct RankFrame<'a> {
    pub(super) frame: &'a DeferredFrame<'a>,
    pub(super) part: &'a Part,
    pub(super) camera: &'a Camera,
    pub(super) options: &'a RenderOptions,
    /// Use rayon's threads within this rank.
    pub(super) parallel: bool,
}

impl RankFrame<'_> {
    /// Instances of the scene, the same in every part.
    pub(super) fn num_instances(&self) -> usize {
        self.part.scene.world.instances().len()
    }

    /// The number of this part's primitive in the whole scene.
    pub(super) fn global_primitive(&self, instance: u32, primitive: u32) -> u32 {
        let geometry = self.part.scene.world.instances()[instance as usize].geometry;
        self.part.primitive_ids.of(geometry, primitive)
    }
}

/// Calls `f` with every item and its index, on several threads if `parallel`. Each finished item is
/// a sign of life.
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
