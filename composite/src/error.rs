//! Errors of compositing.
use crate::codec::MessageError;
use crate::comm::CommError;

/// Why an image could not be composited. After an error no rank gets an image: the communicator is
/// aborted.
#[derive(Debug, thiserror::Error, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum CompositeError {
    /// A slice of a frame has the wrong length.
    #[error(
        "the {slice} slice holds {found} values but a {width_px}x{height_px} image needs \
         {expected}: pass one value per pixel"
    )]
    FrameSize {
        /// `colour` or `depth`.
        slice: &'static str,
        /// Width of the frame.
        width_px: u32,
        /// Height of the frame.
        height_px: u32,
        /// Values needed.
        expected: u64,
        /// Values given.
        found: u64,
    },
    /// The serial reference got nothing.
    #[error("no frame to composite: pass the frame of at least one rank")]
    NoFrames,
    /// The serial reference got frames of several sizes.
    #[error(
        "rank {rank} has a {}x{} image, the others {}x{}: render the same size on every rank",
        found_px.0, found_px.1, expected_px.0, expected_px.1
    )]
    SizesDiffer {
        /// First rank that differs from rank 0.
        rank: usize,
        /// Its width and height.
        found_px: (u32, u32),
        /// Width and height of rank 0.
        expected_px: (u32, u32),
    },
    /// The options cannot work for this communicator.
    #[error("{0}")]
    Options(String),
    /// A message arrived that cannot be decoded.
    #[error("rank {rank} got an unusable message from rank {from}: {reason}")]
    Message {
        /// The receiver.
        rank: usize,
        /// The sender.
        from: usize,
        /// What is wrong with it.
        reason: MessageError,
    },
    /// Ranks of a blended image overlap in depth, against the order of compositing.
    #[error(
        "rank {front} is to be in front of rank {behind}, but reaches to depth {far_of_front}, \
         behind its nearest {near_of_behind}: \
         give the order from front to back in Options::order, or, if they reach into each other, \
         use composite_deep"
    )]
    Order {
        /// The rank that comes first in the order of compositing.
        front: usize,
        /// The rank that comes later.
        behind: usize,
        /// Farthest depth of the rank in front.
        far_of_front: String,
        /// Nearest depth of the rank behind.
        near_of_behind: String,
    },
    /// A tile of a stream was submitted twice, or lies outside the bounds given at its beginning.
    #[error("{0}")]
    Stream(String),
    /// The transport failed.
    #[error(transparent)]
    Comm(#[from] CommError),
}
