//! What each rank did, for reports.

use serde::{Deserialize, Serialize};

/// The account of one rank; 0 is the program itself.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RankStats {
    /// Its number.
    pub rank: usize,
    /// Pictures that it made a share of.
    pub pictures: u64,
    /// Milliseconds in which it made them.
    pub trace_ms: f64,
    /// Rank 0 alone: milliseconds in which it waited for the others.
    pub wait_ms: f64,
    /// Bytes that it was sent: the scene, once.
    pub sent_bytes: u64,
    /// Bytes that came back: rows.
    pub received_bytes: u64,
    /// Acceleration structures that it built; rank 0's are those of the report's `builds` as well.
    pub builds: u64,
    /// Structures that it took over from where the triangles were before.
    pub refits: u64,
    /// Rays that it traced, of all kinds.
    pub rays: u64,
    /// Why it was given up.
    pub lost: Option<String>,
}

impl RankStats {
    /// Adds another process' account of the same rank.
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

/// The accounts of all ranks.
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

    /// A rank was given up.
    pub(crate) fn lost(&mut self, rank: usize, why: &str) {
        self.0[rank].lost.get_or_insert_with(|| why.to_owned());
    }
}
