//! How a frame of many ranks is made, and what each of them gets.
use super::RankReport;
use rt_core::frame::Frame;
use std::time::Duration;

/// How light finds what is in its way on other ranks.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum SecondaryRayPolicy {
    /// As [`SecondaryRayPolicy::Forward`] or by ghost zones, whichever is estimated to be cheaper.
    /// `frames` will be rendered before the scene changes.
    Auto {
        /// Frames that share the cost of building ghost zones.
        frames: u32,
    },
    /// Ask the ranks whose bounds light rays come into: exact for every effect.
    #[default]
    Forward,
    /// Every rank also holds what is within the distance of ambient occlusion around its part, and
    /// answers alone. Exact, but only for ambient occlusion of limited distance; other scenes ask.
    GhostZones,
    /// Only the rank that was hit is asked: wrong near the borders of parts, as rendering without
    /// any of this is. For comparison.
    LocalOnly,
}

/// How a frame is made.
#[derive(Clone, Debug)]
pub struct FrameOptions {
    /// Who gets the picture; `None` to make it and keep it nowhere (for measuring).
    pub root: Option<usize>,
    /// Longest wait for one message.
    pub timeout: Duration,
    /// How light crosses borders.
    pub secondary_rays: SecondaryRayPolicy,
    /// Messages travel while rays are traced, and finished tiles while others are not. Off, one
    /// thing after the other: for comparison.
    pub stream: bool,
    /// Use rayon's threads within a rank. Off, a rank is one thread: for many ranks in one process.
    pub parallel: bool,
    /// How boxes are built where a rank needs another structure (ghost zones).
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
    /// The picture, on the root.
    pub frame: Option<Frame>,
    /// What it cost this rank.
    pub report: RankReport,
}
