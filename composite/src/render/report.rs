//! Costs of a frame on one rank, and its timeline.
use rt_core::effects::Effects;
use rt_core::ray_stats::RayStats;

/// What a rank spends time on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Activity {
    /// Tracing camera rays against its own part, and the colours of their hits where local light
    /// suffices.
    Render,
    /// Choosing the nearest of all ranks' hits.
    Composite,
    /// Shading the pixels it owns: generating secondary rays, adding up light.
    Shade,
    /// Tracing other ranks' (and its own) secondary rays against its part.
    Answer,
    /// Sending messages and waiting for them.
    Exchange,
    /// Sending finished tiles to one rank.
    Collect,
}

impl Activity {
    /// All activities, in the order of a frame.
    pub const ALL: [Activity; 6] = [
        Activity::Render,
        Activity::Composite,
        Activity::Shade,
        Activity::Answer,
        Activity::Exchange,
        Activity::Collect,
    ];

    /// Name in tables and plots.
    pub fn name(self) -> &'static str {
        match self {
            Activity::Render => "render",
            Activity::Composite => "composite",
            Activity::Shade => "shade",
            Activity::Answer => "answer",
            Activity::Exchange => "exchange",
            Activity::Collect => "collect",
        }
    }
}

/// A span of time, in the communicator's seconds since the beginning of the frame on this rank.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// The activity.
    pub activity: Activity,
    /// Beginning.
    pub begin_secs: f64,
    /// End.
    pub end_secs: f64,
}

/// One rank's costs of one frame.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct RankReport {
    /// When this rank began, on the communicator's clock.
    pub begin_at_secs: f64,
    /// Spans without gaps, from the beginning of the frame to its end.
    pub spans: Vec<Span>,
    /// Effects that were rendered.
    pub effects: Effects,
    /// Camera rays traced against the own part: more than the pixels where parts overlap in the
    /// image.
    pub camera_rays: u64,
    /// Rays that owners of pixels sent, as one node would have counted them.
    pub rays: RayStats,
    /// Secondary rays traced against the own part, for any rank.
    pub answered_rays: u64,
    /// Points sent to other ranks to request their light.
    pub points_sent: u64,
    /// Rays that were sent to other ranks.
    pub rays_sent: u64,
    /// Rounds of requests and replies.
    pub rounds: u32,
    /// Messages sent.
    pub messages_sent: u64,
    /// Bytes sent.
    pub bytes_sent: u64,
    /// Bytes received.
    pub bytes_received: u64,
    /// How light crosses the borders of parts, and why.
    pub secondary_rays: String,
    /// Requested settings that had no effect, in words.
    pub warnings: Vec<String>,
}

impl RankReport {
    /// Seconds spent with `activity`.
    pub fn secs(&self, activity: Activity) -> f64 {
        let of_it = self.spans.iter().filter(|s| s.activity == activity);
        // Start with +0: the sum of an empty list is −0.
        of_it.map(|s| s.end_secs - s.begin_secs).fold(0.0, |sum, secs| sum + secs)
    }

    /// Seconds from the beginning of the frame to its end.
    pub fn total_secs(&self) -> f64 {
        self.spans.last().map_or(0.0, |s| s.end_secs)
    }

    /// Records that everything since the last span was `activity`.
    pub(super) fn record_span(&mut self, activity: Activity, now_secs: f64) {
        let (begin_secs, end_secs) = (self.total_secs(), now_secs - self.begin_at_secs);
        if end_secs <= begin_secs {
            return;
        }
        match self.spans.last_mut() {
            Some(last) if last.activity == activity => last.end_secs = end_secs,
            _ => self.spans.push(Span { activity, begin_secs, end_secs }),
        }
    }
}
