//! Writes Chrome's trace event format ("Trace Event Format", Google, complete events). Perfetto
//! also reads it.

use super::{Span, in_order_of_appearance};
use serde_json::{Value, json};

/// The trace: a thread for each track, a complete event for each span, in microseconds.
pub fn chrome_trace(program: &str, spans: &[Span]) -> Value {
    let tracks = in_order_of_appearance(spans, |s| &s.track);
    let first =
        spans.iter().filter(|s| s.is_sound()).map(|s| s.start_ms).fold(f64::INFINITY, f64::min);
    let number = |track: &str| tracks.iter().position(|t| *t == track).unwrap_or(0) + 1;
    let mut events = vec![
        json!({"ph": "M", "name": "process_name", "pid": 1, "tid": 0, "args": {"name": program}}),
    ];
    for track in &tracks {
        events.push(json!({"ph": "M", "name": "thread_name", "pid": 1, "tid": number(track), "args": {"name": track}}));
    }
    for s in spans.iter().filter(|s| s.is_sound()) {
        events.push(json!({
            "ph": "X", "name": s.phase, "cat": "gluray", "pid": 1, "tid": number(&s.track),
            "ts": (s.start_ms - first) * 1e3, "dur": s.ms * 1e3, "args": {"frame": s.frame},
        }));
    }
    json!({ "traceEvents": events, "displayTimeUnit": "ms" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_are_in_microseconds_on_named_threads() {
        let span = |track: &str, phase: &str, start_ms, ms| Span {
            track: track.into(),
            phase: phase.into(),
            frame: 2,
            start_ms,
            ms,
        };
        let spans = [
            span("program", "trace", 1.0, 2.5),
            span("build", "best", -1.0, 10.0),
            span("program", "x", f64::NAN, 1.0),
        ];
        let trace = chrome_trace("gmsh", &spans);
        let events = trace["traceEvents"].as_array().unwrap();
        let named: Vec<&Value> = events.iter().filter(|e| e["ph"] == "X").collect();
        assert_eq!(named.len(), 2, "what no clock says is left out");
        assert_eq!(
            (named[0]["ts"].as_f64(), named[0]["dur"].as_f64()),
            (Some(2000.0), Some(2500.0))
        );
        assert_eq!(named[1]["ts"], 0.0, "the trace begins with its first event");
        let thread = events
            .iter()
            .find(|e| e["name"] == "thread_name" && e["tid"] == named[1]["tid"])
            .unwrap();
        assert_eq!(thread["args"]["name"], "build");
    }
}
