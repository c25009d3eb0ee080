//! The ways to trace a packet.
//!
//! Bounds on its rays fit tiles of pixels on large triangles, per-ray tests fit rays that diverge,
//! and where triangles are smaller than pixels the rays do best alone. With rules on counts (the
//! share of rays that a box keeps), tiles of a terrain took 1.7 times as long as they need, and
//! rays from a light 2.2 times. So time decides. Every way gives the same bits.

use super::SlabCounts;
use crate::bvh::traverse::timed_choice::TimedChoice;
use std::time::Instant;

/// A way to trace a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Strategy {
    /// Boxes are tested against the intervals of groups of rays. Only for rays of one origin:
    /// combined intervals of origins and directions are weak bounds (measured seven times slower).
    Intervals,
    /// Boxes are also tested ray by ray. Rays leave the packet where few of them hit a box.
    Rays,
    /// As `Rays`, but the rays leave the packet early.
    RaysLeaveEarly,
}

const STRATEGIES: [Strategy; 3] = [Strategy::Intervals, Strategy::Rays, Strategy::RaysLeaveEarly];

impl Strategy {
    /// Largest number of rays of a packet that leave it at a box.
    pub(super) fn most_leaving(self) -> u32 {
        match self {
            Strategy::Intervals => 0,
            Strategy::Rays => 4,
            Strategy::RaysLeaveEarly => 64,
        }
    }
}

/// The best strategy for one kind of packets, learned from packets.
#[derive(Debug, Clone, Copy)]
pub(super) struct StrategyChoice {
    choice: TimedChoice<3>,
    /// Means over packets traced with [`Strategy::Rays`]: the share of the groups tested ray by ray
    /// that were kept, and the number of rays in a tested group that hit the box.
    kept: f32,
    rays: f32,
}

impl StrategyChoice {
    /// Intervals alone are tried only if per-ray tests keep more than this share of the groups,
    /// with more rays in a group. Otherwise they can take 60 times as long.
    const KEPT: f32 = 0.75;
    const RAYS: f32 = 5.0;

    pub(super) const fn new() -> Self {
        // Per-ray tests are never slower than the others by much.
        StrategyChoice { choice: TimedChoice::new(1), kept: 0.0, rays: 0.0 }
    }

    /// The strategy for the next packet, with the time when it starts if its duration is needed.
    pub(super) fn next(&mut self, common_origin: bool) -> (Strategy, Option<Instant>) {
        let intervals = common_origin && self.kept > Self::KEPT && self.rays > Self::RAYS;
        let possible = |k: usize| STRATEGIES[k] != Strategy::Intervals || intervals;
        let (way, start) = self.choice.next(possible);
        (STRATEGIES[way], start)
    }

    /// Learns from the packet that [`StrategyChoice::next`] was asked about: it took `seconds` for
    /// each of its groups.
    pub(super) fn learn(&mut self, strategy: Strategy, counts: SlabCounts, seconds: f32) {
        if strategy == Strategy::Rays && counts.tested > 0 {
            let tested = counts.tested as f32;
            self.kept += 0.2 * (counts.kept as f32 / tested - self.kept);
            self.rays += 0.2 * (counts.rays as f32 / tested - self.rays);
        }
        self.choice.learn(seconds);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_of_rays_that_diverge_are_not_tried() {
        let mut choice = StrategyChoice::new();
        let trace = |choice: &mut StrategyChoice, common_origin, counts: SlabCounts| {
            let mut tried = false;
            for _ in 0..5000 {
                let (strategy, _) = choice.next(common_origin);
                tried |= strategy == Strategy::Intervals;
                choice.learn(strategy, counts, 1e-6);
            }
            tried
        };
        let diverging = SlabCounts { tested: 100, kept: 60, rays: 250 };
        let similar = SlabCounts { tested: 100, kept: 90, rays: 1200 };
        assert!(!trace(&mut choice, true, diverging));
        assert!(!trace(&mut choice, false, similar), "rays of different origins");
        assert!(trace(&mut choice, true, similar));
    }
}
