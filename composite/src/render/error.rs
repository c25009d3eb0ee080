//! Errors of a frame of many ranks.
use crate::comm::CommError;
use rt_core::deferred::AnswerError;
use rt_core::render::RenderError;
use rt_core::scene::SceneError;

/// Why a frame could not be rendered. After an error no rank gets an image: the communicator is
/// aborted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// Scene, camera or options.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A part of the scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The transport.
    #[error(transparent)]
    Comm(#[from] CommError),
    /// A message does not have the expected content.
    #[error(
        "rank {rank} got an unusable message from rank {from} ({what}, {words} words): all ranks \
         must render the same scene, camera and options"
    )]
    Message {
        /// The receiver.
        rank: usize,
        /// The sender.
        from: usize,
        /// The content that was expected.
        what: &'static str,
        /// Its length in 32-bit words.
        words: usize,
    },
    /// The numbers that a rank announced are invalid, or are not what it sent.
    #[error(
        "rank {rank} got numbers from rank {from} that cannot be ({reason}): all ranks must render \
         the same scene, camera and options"
    )]
    Announced {
        /// The receiver.
        rank: usize,
        /// The sender.
        from: usize,
        /// Which numbers, and what they break.
        reason: String,
    },
    /// A reply that no part of this scene can have given.
    #[error("rank {rank}: {source}: all ranks must render parts of the same scene")]
    Answer {
        /// The receiver.
        rank: usize,
        /// What does not fit.
        source: AnswerError,
    },
    /// The partition and the group do not match.
    #[error(
        "the scene was cut into {parts} parts, but there are {ranks} ranks: cut it into as many"
    )]
    Ranks {
        /// Parts of the partition.
        parts: usize,
        /// Ranks of the communicator.
        ranks: usize,
    },
    /// Ranks give different values for what must be the same on all. Every rank gets this error,
    /// and the communicator can still be used.
    #[error(
        "the ranks contradict each other: {what}: {field}: {values}; give the same on all ranks"
    )]
    Contradiction {
        /// "lights", "camera", "object `wing`", ...
        what: String,
        /// The first field in which they differ.
        field: String,
        /// The values, each with its ranks.
        values: String,
    },
    /// What a rank gives of a distributed scene cannot be used. Every rank gets this error, and the
    /// communicator can still be used.
    #[error("rank {rank} gives what cannot be rendered: {reason}")]
    RankScene {
        /// Which one.
        rank: usize,
        /// What is wrong, and the cure.
        reason: String,
    },
    /// A volume cannot be distributed like that.
    #[error("volume {volume} cannot be dealt so: {reason}")]
    Holders {
        /// Its number in the scene.
        volume: usize,
        /// What is wrong.
        reason: String,
    },
}

impl FrameError {
    /// Whether every rank has this same error, so that no rank waits for another.
    pub(super) fn is_agreed(&self) -> bool {
        matches!(self, FrameError::Contradiction { .. } | FrameError::RankScene { .. })
    }
}
