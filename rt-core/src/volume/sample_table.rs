//! The transfer function as a table for samples at one distance.
//!
//! VTK's GPU mapper has the same table: 1,024 entries over the range of the scalars, an opacity
//! per entry that is that of a slab as thick as the distance of samples, and texels at the middle
//! of their interval. So its pictures can be had to the last level.

use crate::transfer_function::TransferFunction;

/// Entries of the table.
pub(super) const ENTRIES: usize = 1024;

/// Opacities of a slab, and colours, by scalar.
#[derive(Debug, Clone)]
pub(super) struct SampleTable {
    /// Scalar of the lower end of the first entry's interval.
    pub(super) low: f32,
    pub(super) entries_per_scalar: f32,
    pub(super) opacity: Vec<f32>,
    pub(super) color: [Vec<f32>; 3],
    /// Entries with an opacity before each.
    opaque_before: Vec<u32>,
}

impl SampleTable {
    /// For samples that are `distance` apart, in world units.
    pub(super) fn new(transfer: &TransferFunction, distance: f64) -> SampleTable {
        let [low, high] = transfer.range();
        let last = (ENTRIES - 1) as f64;
        let at = |i: usize| transfer.sample(low + (high - low) * (i as f64 / last));
        let samples: Vec<_> = (0..ENTRIES).map(at).collect();
        let opacity: Vec<f32> =
            samples.iter().map(|(sigma, _)| -(-sigma * distance).exp_m1() as f32).collect();
        let mut opaque_before = vec![0];
        for (i, a) in opacity.iter().enumerate() {
            opaque_before.push(opaque_before[i] + u32::from(*a > 0.0));
        }
        SampleTable {
            low: low as f32,
            entries_per_scalar: (ENTRIES as f64 / (high - low)) as f32,
            opacity,
            color: std::array::from_fn(|c| samples.iter().map(|s| s.1[c] as f32).collect()),
            opaque_before,
        }
    }

    /// Whether no scalar in `low..=high` has an opacity. One more entry counts on either side:
    /// rounding may take an interpolated scalar out of its range.
    pub(super) fn is_clear(&self, [low, high]: [f32; 2]) -> bool {
        let place = |s: f32| (s - self.low) * self.entries_per_scalar - 0.5;
        let first = (place(low) - 1.0).clamp(0.0, (ENTRIES - 1) as f32) as usize;
        let last = (place(high) + 2.0).clamp(0.0, (ENTRIES - 1) as f32) as usize;
        self.opaque_before[last + 1] == self.opaque_before[first]
    }
}
