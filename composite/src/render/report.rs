//! What a frame cost on one rank, and when it did what.
use rt_core::effects::Effects;
use rt_core::ray_stats::RayStats;

/// What a rank is busy with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Activity {
    /// Tracing camera rays against its own part, and the colours of what they met where local light
    /// suffices.
    Render,
    /// Choosing the nearest of all ranks' hits.
    Composite,
    /// Shading the pixels it owns: making secondary rays, adding up light.
    Shade,
    /// Tracing other ranks' (and its own) secondary rays against its part.
    Answer,
    /// Waiting for messages, and handing them over.
    Exchange,
    /// Bringing finished tiles to one rank.
    Collect,
}

impl Activity {
    /// All, in the order of a frame.
    pub const ALL: [Activity; 6] = [
        Activity::Render,
        Activity::Composite,
        Activity::Shade,
        Activity::Answer,
        Activity::Exchange,
        Activity::Collect,
    ];

    /// For tables and plots.
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

/// A stretch of time, in the communicator's seconds from the begin of the frame on this rank.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// What was done.
    pub activity: Activity,
    /// Begin.
    pub begin_secs: f64,
    /// End.
    pub end_secs: f64,
}

/// One rank's account of one frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RankReport {
    /// When this rank began, on the communicator's clock.
    pub begin_at_secs: f64,
    /// Without gaps, from the begin of the frame to its end.
    pub spans: Vec<Span>,
    /// Effects that ran.
    pub effects: Effects,
    /// Camera rays traced against the own part: more than the pixels where parts overlap in the
    /// picture.
    pub camera_rays: u64,
    /// Rays that owners of pixels sent, as one node would have counted them.
    pub rays: RayStats,
    /// Secondary rays traced against the own part, for whomever.
    pub answered_rays: u64,
    /// Points that were sent to other ranks to be asked for light.
    pub points_sent: u64,
    /// Rays that were sent to other ranks.
    pub rays_sent: u64,
    /// Rounds of questions and answers.
    pub rounds: u32,
    /// Messages sent.
    pub messages_sent: u64,
    /// Bytes sent.
    pub bytes_sent: u64,
    /// Bytes received.
    pub bytes_received: u64,
    /// How light came across the borders of parts, and why so.
    pub secondary_rays: String,
    /// Requests that changed nothing, in words.
    pub warnings: Vec<String>,
}

impl RankReport {
    /// Seconds spent with `activity`.
    pub fn secs(&self, activity: Activity) -> f64 {
        let of_it = self.spans.iter().filter(|s| s.activity == activity);
        // From +0: the sum of nothing is −0.
        of_it.map(|s| s.end_secs - s.begin_secs).fold(0.0, |sum, secs| sum + secs)
    }

    /// Seconds from the begin of the frame to its end.
    pub fn total_secs(&self) -> f64 {
        self.spans.last().map_or(0.0, |s| s.end_secs)
    }

    /// Everything since the last span was `activity`.
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
