//! The timeline of a real run: when each phase of each frame ran, and on which thread (the chart of
//! figure 4.8).
//!
//! The library records spans as they end ([`SpanRecorder`]). They are part of its report. [`gantt`]
//! draws them. [`chrome`] writes them for `chrome://tracing` and Perfetto.

pub mod chrome;
pub mod gantt;
mod span_recorder;

pub use chrome::chrome_trace;
pub use gantt::{GanttOptions, gantt_svg};
pub use span_recorder::SpanRecorder;

use serde::{Deserialize, Serialize};

/// A phase that ran.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Span {
    /// Thread, by what it does: `program`, `build`…
    pub track: String,
    /// What ran: `capture`, `trace`, `present`…
    pub phase: String,
    /// In which frame, from 1; 0 where that says nothing.
    #[serde(default)]
    pub frame: u64,
    /// Milliseconds since the process' first span.
    pub start_ms: f64,
    /// How long, milliseconds.
    pub ms: f64,
}

impl Span {
    /// Milliseconds since the process' first span.
    pub fn end_ms(&self) -> f64 {
        self.start_ms + self.ms
    }

    /// False for what files may hold and clocks never say.
    fn is_sound(&self) -> bool {
        self.start_ms.is_finite() && self.ms.is_finite() && self.ms >= 0.0
    }
}

/// Tracks and phases in the order in which they appear first.
fn in_order_of_appearance<'a>(spans: &'a [Span], of: impl Fn(&'a Span) -> &'a str) -> Vec<&'a str> {
    let mut names: Vec<&str> = Vec::new();
    for name in spans.iter().map(of) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}
