//! The values that a polynomial is fitted to.

use glam::DVec3;

/// Samples nearer than this, squared and in the frame, weigh as if they were there: a point twice
/// in the mesh, or a cell around the point.
pub(super) const NEAREST_SQUARE: f64 = 0.2;

/// A value at a place, and its distance from the point, squared, in the frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    pub(super) square: f64,
    pub(super) id: u32,
    pub(super) value: f64,
    /// Mean position in the frame.
    pub(super) place: DVec3,
    /// Second moments in the frame.
    pub(super) second: [f64; 6],
}

/// The `wanted` nearest samples, and those that are as near as the last of them.
pub(super) fn within(samples: &[Sample], wanted: usize) -> &[Sample] {
    let Some(last) = samples.get(wanted.saturating_sub(1)) else { return samples };
    let end = samples.partition_point(|s| s.square <= last.square * (1.0 + 1e-6));
    &samples[..end]
}
