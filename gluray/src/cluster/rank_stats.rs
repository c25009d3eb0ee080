//! Statistics of each rank, for reports.

use serde::{Deserialize, Serialize};

/// The statistics of one rank. Rank 0 is the program itself.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RankStats {
    /// The rank's number.
    pub rank: usize,
    /// The number of images of which it rendered a share.
    pub pictures: u64,
    /// The time in milliseconds that rendering took.
    pub trace_ms: f64,
    /// Only for rank 0: the time in milliseconds that it waited for the others.
    pub wait_ms: f64,
    /// Bytes sent to it: the scene, once.
    pub sent_bytes: u64,
    /// Bytes received from it: rows.
    pub received_bytes: u64,
    /// Acceleration structures that it built. Those of rank 0 are also in the report's `builds`.
    pub builds: u64,
    /// Acceleration structures that it refitted from earlier positions.
    pub refits: u64,
    /// Rays of all kinds that it traced.
    pub rays: u64,
    /// Why it was given up.
    pub lost: Option<String>,
}

impl RankStats {
    /// Adds the statistics that another process has of the same rank.
    pub fn add(&mut self, other: &RankStats) {
        self.pictures += other.pictures;
        self.trace_ms += other.trace_ms;
        self.wait_ms += other.wait_ms;
        self.sent_bytes += other.sent_bytes;
        self.received_bytes += other.received_bytes;
        self.builds += other.builds;
        self.refits += other.refits;
        self.rays += other.rays;
        if self.lost.is_none() {
            self.lost.clone_from(&other.lost);
        }
    }
}

/// The statistics of all ranks.
pub(crate) struct RankStatsTable(Vec<RankStats>);

impl RankStatsTable {
    pub(crate) fn new(size: usize) -> RankStatsTable {
        RankStatsTable((0..size).map(|rank| RankStats { rank, ..RankStats::default() }).collect())
    }

    pub(crate) fn of(&mut self, rank: usize) -> &mut RankStats {
        &mut self.0[rank]
    }

    pub(crate) fn all(&self) -> &[RankStats] {
        &self.0
    }

    /// Records that a rank was given up.
    pub(crate) fn lost(&mut self, rank: usize, why: &str) {
        self.0[rank].lost.get_or_insert_with(|| why.to_owned());
    }
}
