//! What can be wrong with a message of another rank.

use crate::rect::Rect;

/// What is wrong with a message.
#[derive(Debug, thiserror::Error, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum MessageError {
    /// Fewer or more bytes than its header announces.
    #[error("{found} bytes where {expected} were expected")]
    Length {
        /// Bytes needed.
        expected: u64,
        /// Bytes there.
        found: u64,
    },
    /// Not a message of this library or of this version of it.
    #[error("it does not begin with COMPOS03")]
    Magic,
    /// Bits changed in transit.
    #[error("its checksum is {found:#018x} instead of {expected:#018x}")]
    Checksum {
        /// As stored in the message.
        expected: u64,
        /// As computed.
        found: u64,
    },
    /// The sender composites something else.
    #[error(
        "its sender composites another size, pixel format, strategy or rank order, or has other \
         options: \
         use the same on every rank"
    )]
    Fingerprint,
    /// Another part of the image than agreed.
    #[error(
        "it holds columns {}..{} and rows {}..{} instead of {}..{} and {}..{}",
        found.x0, found.x1, found.y0, found.y1, expected.x0, expected.x1, expected.y0, expected.y1
    )]
    Part {
        /// The rectangle it holds.
        found: Rect,
        /// The rectangle it should hold.
        expected: Rect,
    },
    /// Something drawn where the image has no pixels.
    #[error(
        "it speaks of columns {}..{} and rows {}..{} of an image of {width_px}x{height_px}",
        found.x0, found.x1, found.y0, found.y1
    )]
    OutsideImage {
        /// Where the sender says it drew.
        found: Rect,
        /// Width of the image.
        width_px: u32,
        /// Height of the image.
        height_px: u32,
    },
    /// More fragments than pixels can have.
    #[error("it announces {found} fragments where at most {most} can be")]
    Fragments {
        /// Announced.
        found: u64,
        /// As many as the sender's rectangle can have.
        most: u64,
    },
    /// Flags, mask and count contradict each other.
    #[error("its flags, mask and number of active pixels contradict each other")]
    Mask,
}
