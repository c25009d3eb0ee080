//! Options of a frame of many ranks, and its result.
use super::RankReport;
use rt_core::frame::Frame;
use std::time::Duration;

/// How secondary rays are tested against the parts of other ranks.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum SecondaryRayPolicy {
    /// [`SecondaryRayPolicy::Forward`] or ghost zones, whichever is estimated to be cheaper.
    /// `frames` will be rendered before the scene changes.
    Auto {
        /// Frames that share the cost of building ghost zones.
        frames: u32,
    },
    /// Send light rays to the ranks whose bounds they enter: exact for every effect.
    #[default]
    Forward,
    /// Every rank also holds the geometry within the distance of ambient occlusion around its part,
    /// and needs no other rank. Exact, but only for ambient occlusion of limited distance; other
    /// scenes use [`SecondaryRayPolicy::Forward`].
    GhostZones,
    /// Only the rank that was hit is asked. Wrong near the borders of parts, like rendering without
    /// any exchange of light. For comparison.
    LocalOnly,
}

/// How to render a frame.
#[derive(Clone, Debug)]
pub struct FrameOptions {
    /// The rank that gets the image; `None` to render it and keep it nowhere (for measuring).
    pub root: Option<usize>,
    /// Longest wait for one message.
    pub timeout: Duration,
    /// How secondary rays cross the borders of parts.
    pub secondary_rays: SecondaryRayPolicy,
    /// Send messages while rays are traced, and finished tiles while others are not finished. Off,
    /// one step follows the other: for comparison.
    pub stream: bool,
    /// Use rayon's threads within a rank. Off, a rank is one thread: for many ranks in one process.
    pub parallel: bool,
    /// How acceleration structures are built where a rank needs another one (ghost zones).
    pub build: rt_core::bvh::BuildOptions,
}

impl Default for FrameOptions {
    fn default() -> Self {
        FrameOptions {
            root: Some(0),
            timeout: Duration::from_secs(60),
            secondary_rays: SecondaryRayPolicy::default(),
            stream: true,
            parallel: false,
            build: rt_core::bvh::BuildOptions::default(),
        }
    }
}

/// One rank's result of a frame.
#[derive(Clone, Debug)]
pub struct FrameOutput {
    /// The image, on the root.
    pub frame: Option<Frame>,
    /// What it cost this rank.
    pub report: RankReport,
}
