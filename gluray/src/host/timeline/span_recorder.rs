//! Records spans as they end. It keeps a fixed number, the newest, because users ask about what
//! happened last.

use super::Span;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// The newest spans of a process.
#[derive(Debug)]
pub struct SpanRecorder {
    spans: VecDeque<Span>,
    begin: Option<Instant>,
    most: usize,
}

impl SpanRecorder {
    /// Keeps `most` spans.
    pub const fn new(most: usize) -> SpanRecorder {
        SpanRecorder { spans: VecDeque::new(), begin: None, most }
    }

    /// A phase ended just now that took so long.
    pub fn ended(&mut self, track: &str, phase: &str, frame: u64, took: Duration) {
        self.span(track, phase, frame, Instant::now(), took);
    }

    /// A phase ended at `end` that took so long.
    pub fn span(&mut self, track: &str, phase: &str, frame: u64, end: Instant, took: Duration) {
        if self.most == 0 {
            return;
        }
        let start = end.checked_sub(took).unwrap_or(end);
        // The first span's start; another thread's phase may have begun before.
        let begin = *self.begin.get_or_insert(start);
        let ms = |d: Duration| d.as_secs_f64() * 1e3;
        let start_ms = match start.checked_duration_since(begin) {
            Some(after) => ms(after),
            None => -ms(begin.duration_since(start)),
        };
        if self.spans.len() == self.most {
            self.spans.pop_front();
        }
        self.spans.push_back(Span {
            track: track.into(),
            phase: phase.into(),
            frame,
            start_ms,
            ms: ms(took),
        });
    }

    /// Takes the spans out, oldest first. The clock goes on.
    pub fn take(&mut self) -> Vec<Span> {
        self.spans.drain(..).collect()
    }

    /// The spans, oldest first.
    pub fn spans(&self) -> impl ExactSizeIterator<Item = &Span> {
        self.spans.iter()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_lie_on_one_clock_and_the_oldest_make_room() {
        let now = Instant::now();
        let ms = Duration::from_millis;
        let mut r = SpanRecorder::new(3);
        r.span("program", "capture", 1, now + ms(10), ms(10));
        r.span("build", "fast", 1, now + ms(25), ms(30));
        r.span("program", "trace", 1, now + ms(50), ms(40));
        let starts: Vec<f64> = r.spans().map(|s| s.start_ms.round()).collect();
        assert_eq!(starts, [0.0, -5.0, 10.0]);
        r.span("program", "present", 1, now + ms(52), ms(2));
        let phases: Vec<&str> = r.spans().map(|s| s.phase.as_str()).collect();
        assert_eq!(phases, ["fast", "trace", "present"]);
    }
}
