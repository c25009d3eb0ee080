//! The output of `composite compare`: a table, or the same as JSON.
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Pixels {
    /// RGBA8 with depth
    Depth,
    /// RGBA in half precision with depth; IceT has none, so it composites f32
    DepthF16,
    /// RGBA f32 with depth
    DepthF32,
    /// Premultiplied RGBA f32, in order
    Blend,
}

impl Pixels {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::DepthF16 => "depth-f16",
            Self::DepthF32 => "depth-f32",
            Self::Blend => "blend",
        }
    }
}

/// The output.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Comparison {
    pub(super) machine: Machine,
    pub(super) rows: Vec<Row>,
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Machine {
    pub(super) processors: usize,
    pub(super) transport: String,
    pub(super) icet: String,
    pub(super) note: Option<String>,
}

/// One scene, size, number of ranks, format and instruction set.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Row {
    pub(super) scene: String,
    pub(super) ranks: usize,
    pub(super) size_px: u32,
    pub(super) pixels: Pixels,
    /// IceT's strategy with the smallest median.
    pub(super) rival: String,
    /// Medians.
    pub(super) ours_ms: f64,
    pub(super) rival_ms: f64,
    pub(super) ratio: f64,
    /// Over all frames and all of IceT's strategies.
    pub(super) pixels_differ: u64,
    pub(super) ours_min_ms: f64,
    pub(super) rival_min_ms: f64,
    /// The strategy that was used for the last frame; `SharedMemory` where no messages were sent,
    /// `SharedMemory on 4, DirectSend` where four machines merged first.
    pub(super) ours_strategy: String,
    pub(super) simd: String,
    pub(super) ours_mb: f64,
    pub(super) ours_messages: u64,
    pub(super) rivals_ms: BTreeMap<String, f64>,
    /// Time by column of rank 0 in our median frame.
    pub(super) columns_ms: BTreeMap<String, f64>,
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} processors, {}", self.machine.processors, self.machine.transport)?;
        writeln!(f, "IceT: {}", self.machine.icet)?;
        if let Some(note) = &self.machine.note {
            writeln!(f, "note: {note}")?;
        }
        write!(
            f,
            "{:<6} {:>5} {:>6} {:<9} {:<7} {:>9} {:>10} {:<9} {:>6} {:>14}",
            "scene",
            "ranks",
            "size",
            "pixels",
            "kernels",
            "ours ms",
            "IceT ms",
            "strategy",
            "ratio",
            "pixels differ"
        )?;
        for row in &self.rows {
            write!(
                f,
                "\n{:<6} {:>5} {:>6} {:<9} {:<7} {:>9.3} {:>10.3} {:<9} {:>6.2} {:>14}",
                row.scene,
                row.ranks,
                row.size_px,
                row.pixels.name(),
                row.simd,
                row.ours_ms,
                row.rival_ms,
                row.rival,
                row.ratio,
                row.pixels_differ
            )?;
        }
        Ok(())
    }
}
