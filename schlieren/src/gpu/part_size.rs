//! How many photons a device gets at a time: few enough that a frame can be cancelled and no driver
//! assumes that the device hangs, and so many that its start and end cost little.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// Work groups of the first part, and at least.
pub(super) const FEWEST_GROUPS: usize = 1 << 12;
/// Largest number of work groups along an axis.
pub(super) const MOST_GROUPS: usize = 65_535;
/// A part that is finished sooner could be larger. Between two parts a device runs empty: with
/// parts of 2^18 photons, an H200 takes 1.15 times as long for the jet as with 2^22.
const SHORT: Duration = Duration::from_millis(10);
/// A part that takes longer should be smaller.
const LONG: Duration = Duration::from_millis(100);

/// Number of work groups of the next part. It depends on the time that others took; pictures do not
/// depend on it.
#[derive(Debug)]
pub(super) struct PartSize(AtomicUsize);

impl Default for PartSize {
    fn default() -> PartSize {
        PartSize(AtomicUsize::new(FEWEST_GROUPS))
    }
}

impl PartSize {
    pub(super) fn groups(&self) -> usize {
        self.0.load(Ordering::Relaxed)
    }

    /// Learns from a part of so many work groups, from its submission to its end.
    pub(super) fn learn(&self, groups: usize, took: Duration) {
        let next = match took {
            t if t < SHORT && groups >= self.groups() => 2 * groups,
            t if t > LONG => groups / 2,
            _ => return,
        };
        self.0.store(next.clamp(FEWEST_GROUPS, MOST_GROUPS), Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fast_devices_get_larger_parts_and_slow_ones_smaller() {
        let size = PartSize::default();
        let learn = |groups, ms| {
            size.learn(groups, Duration::from_millis(ms));
            size.groups()
        };
        assert_eq!(learn(4096, 1), 8192);
        assert_eq!(learn(100, 1), 8192, "the last part of a frame is small");
        assert_eq!(learn(8192, 50), 8192);
        assert_eq!(learn(8192, 500), 4096);
        assert_eq!(learn(4096, 500), 4096, "never smaller");
        (0..9).for_each(|_| size.learn(size.groups(), Duration::ZERO));
        assert_eq!(size.groups(), 65_535);
    }
}
