//! What one rank did in the frame of a demo, as sent to rank 0 and written to JSON.
use crate::render::{Activity, Part, RankReport, Span};
use crate::report::Report;
use serde::{Deserialize, Serialize};

/// What one rank did in the last frame, in seconds, and bytes.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct RankTimes {
    pub(super) rank: usize,
    pub(super) render_secs: f64,
    pub(super) compress_secs: f64,
    pub(super) blend_secs: f64,
    pub(super) send_secs: f64,
    pub(super) collect_secs: f64,
    pub(super) total_secs: f64,
    pub(super) bytes_sent: u64,
}

impl RankTimes {
    pub(super) const BYTES: usize = 7 * 8;

    pub(super) fn new(rank: usize, render_secs: f64, report: &Report) -> Self {
        Self {
            rank,
            render_secs,
            compress_secs: report.compress_secs,
            blend_secs: report.blend_secs,
            send_secs: report.exchange_secs,
            collect_secs: report.collect_secs,
            total_secs: render_secs + report.total_secs,
            bytes_sent: report.bytes_sent,
        }
    }

    pub(super) fn to_bytes(self) -> Vec<u8> {
        let numbers = [
            self.render_secs,
            self.compress_secs,
            self.blend_secs,
            self.send_secs,
            self.collect_secs,
            self.total_secs,
        ];
        let mut bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        bytes.extend_from_slice(&self.bytes_sent.to_le_bytes());
        bytes
    }

    pub(super) fn from_bytes(rank: usize, bytes: &[u8]) -> Option<Self> {
        let words: Vec<[u8; 8]> =
            bytes.chunks_exact(8).filter_map(|word| word.try_into().ok()).collect();
        let number = |i: usize| words.get(i).map(|word| f64::from_le_bytes(*word));
        Some(Self {
            rank,
            render_secs: number(0)?,
            compress_secs: number(1)?,
            blend_secs: number(2)?,
            send_secs: number(3)?,
            collect_secs: number(4)?,
            total_secs: number(5)?,
            bytes_sent: words.get(6).map(|word| u64::from_le_bytes(*word))?,
        })
    }
}

/// What one rank did in the last frame.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct RankRecord {
    pub(super) rank: usize,
    pub(super) triangles: usize,
    /// Values of volumes.
    pub(super) values: usize,
    /// Files that it has read by itself.
    pub(super) files: usize,
    /// Milliseconds by activity, in the order of [`Activity::ALL`].
    pub(super) render_ms: f64,
    pub(super) composite_ms: f64,
    pub(super) shade_ms: f64,
    pub(super) answer_ms: f64,
    pub(super) exchange_ms: f64,
    pub(super) collect_ms: f64,
    pub(super) total_ms: f64,
    pub(super) camera_rays: u64,
    pub(super) answered_rays: u64,
    /// Rays, and points whose light was asked for, that went to other ranks.
    pub(super) rays_sent: u64,
    pub(super) rounds: u32,
    pub(super) bytes_sent: u64,
    pub(super) bytes_received: u64,
    /// Activity (index in [`Activity::ALL`]), beginning and end in milliseconds.
    pub(super) spans: Vec<(usize, f64, f64)>,
}

impl RankRecord {
    pub(super) fn new(rank: usize, files: usize, part: &Part, report: &RankReport) -> Self {
        let ms = |activity| 1e3 * report.secs(activity);
        let span = |s: &Span| {
            let place = Activity::ALL.iter().position(|a| *a == s.activity).unwrap_or(0);
            (place, 1e3 * s.begin_secs, 1e3 * s.end_secs)
        };
        Self {
            rank,
            triangles: part.primitives(),
            values: part.volume_values(),
            files,
            render_ms: ms(Activity::Render),
            composite_ms: ms(Activity::Composite),
            shade_ms: ms(Activity::Shade),
            answer_ms: ms(Activity::Answer),
            exchange_ms: ms(Activity::Exchange),
            collect_ms: ms(Activity::Collect),
            total_ms: 1e3 * report.total_secs(),
            camera_rays: report.camera_rays,
            answered_rays: report.answered_rays,
            rays_sent: report.rays_sent + report.points_sent,
            rounds: report.rounds,
            bytes_sent: report.bytes_sent,
            bytes_received: report.bytes_received,
            spans: report.spans.iter().map(span).collect(),
        }
    }
}
