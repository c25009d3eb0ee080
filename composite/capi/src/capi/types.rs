//! Structures and constants of the C interface, in the order of the header.
//!
//! A structure begins with its size, `struct_bytes`, which tells versions apart. Sizes, offsets and
//! strides are in bytes where the name says so, else in elements. Members that say "0 or 1" take
//! nothing else.

use std::ffi::c_void;

/// Version of this interface: major, minor and patch in a byte each. The library's own is that of
/// rtsv_composite_library_version.
pub const RTSV_COMPOSITE_VERSION: u32 = 0x0000_0100;

/// The number in the library's name, librtsv_composite.so.0: a change that breaks programs raises
/// it.
pub const RTSV_COMPOSITE_ABI: u32 = 0;

/// What a call returns: one of RTSV_COMPOSITE_OK and the statuses below.
pub type RtsvCompositeStatus = u32;

/// The call did what it says.
pub const RTSV_COMPOSITE_OK: u32 = 0;
/// A pointer that must not be null is null, or not aligned.
pub const RTSV_COMPOSITE_POINTER: u32 = 1;
/// A handle that was never made, has been freed, or is of another kind.
pub const RTSV_COMPOSITE_HANDLE: u32 = 2;
/// A handle that another thread has made: only that one may use it.
pub const RTSV_COMPOSITE_THREAD: u32 = 3;
/// A handle that another call of this thread is at work with.
pub const RTSV_COMPOSITE_BUSY: u32 = 4;
/// struct_bytes is not the size of the structure: set it, or compile with this version's header.
pub const RTSV_COMPOSITE_STRUCT: u32 = 5;
/// A value or an array cannot be used; the text names it.
pub const RTSV_COMPOSITE_VALUE: u32 = 6;
/// MPI is not running, or the communicator cannot be used.
pub const RTSV_COMPOSITE_MPI: u32 = 7;
/// What the ranks give does not fit together, or cannot be rendered. Every rank gets this status
/// with the same text, and the group can be used further.
pub const RTSV_COMPOSITE_DISAGREE: u32 = 8;
/// The group of ranks has ended: this rank or another has failed. Free the handles, and make a new
/// group.
pub const RTSV_COMPOSITE_ENDED: u32 = 9;
/// An error of this library, which ends the group.
pub const RTSV_COMPOSITE_PANIC: u32 = 10;

/// A group of ranks.
#[repr(C)]
pub struct RtsvCompositeComm {
    _private: [u8; 0],
}

/// Composites images of one pixel format.
#[repr(C)]
pub struct RtsvCompositeCompositor {
    _private: [u8; 0],
}

/// What one rank has of a scene.
#[repr(C)]
pub struct RtsvCompositeScene {
    _private: [u8; 0],
}

/// One of the ranks that render a scene together.
#[repr(C)]
pub struct RtsvCompositeRenderer {
    _private: [u8; 0],
}

/// RGBA in 8 bits a channel, with depth.
pub const RTSV_COMPOSITE_DEPTH_U8: u32 = 1;
/// RGBA in 16 bits a channel, with depth.
pub const RTSV_COMPOSITE_DEPTH_U16: u32 = 2;
/// RGBA in half precision, with depth.
pub const RTSV_COMPOSITE_DEPTH_F16: u32 = 3;
/// RGBA in single precision, with depth.
pub const RTSV_COMPOSITE_DEPTH_F32: u32 = 4;
/// Premultiplied RGBA in 8 bits a channel, blended in the order of the ranks.
pub const RTSV_COMPOSITE_ALPHA_U8: u32 = 5;
/// Premultiplied RGBA in 16 bits a channel.
pub const RTSV_COMPOSITE_ALPHA_U16: u32 = 6;
/// Premultiplied RGBA in half precision.
pub const RTSV_COMPOSITE_ALPHA_F16: u32 = 7;
/// Premultiplied RGBA in single precision.
pub const RTSV_COMPOSITE_ALPHA_F32: u32 = 8;

/// Each rank owns a tile of the image and gets it from all others.
pub const RTSV_COMPOSITE_DIRECT_SEND: u32 = 0;
/// Half of the ranks send their images to the other half, round after round.
pub const RTSV_COMPOSITE_TREE: u32 = 1;
/// Partners exchange halves.
pub const RTSV_COMPOSITE_BINARY_SWAP: u32 = 2;
/// As binary swap, in groups of up to `radix` ranks.
pub const RTSV_COMPOSITE_RADIX_K: u32 = 3;
/// What a model of the network, measured before the first frame, finds cheapest.
pub const RTSV_COMPOSITE_AUTOMATIC: u32 = 4;

/// How to composite; the same on all ranks but for timeout_secs. rtsv_composite_options_init fills
/// it.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtsvCompositeOptions {
    /// Size of this structure.
    pub struct_bytes: u64,
    /// RTSV_COMPOSITE_DIRECT_SEND (the default) or another strategy: changes the time, not the
    /// image.
    pub strategy: u32,
    /// Group size of RTSV_COMPOSITE_RADIX_K, a power of two (8).
    pub radix: u32,
    /// The rank that gets the image (0); -1 leaves a piece of it on each rank.
    pub destination: i32,
    /// 0 or 1 (the default): the image has its depths too.
    pub depth: u32,
    /// 0 (the default) or 1: checksums cover the pixels of messages too.
    pub verify: u32,
    /// 0 or 1 (the default): ranks of one machine merge in memory that they share.
    pub in_memory: u32,
    /// 0 or 1 (the default): ranks wait for each other at the end, so that success on one means
    /// success on all.
    pub final_barrier: u32,
    /// Not used; 0.
    pub reserved: u32,
    /// Most pixels of a message, about; 0 (the default) chooses.
    pub slice_px: u64,
    /// Longest wait for a rank that gives no sign of life, seconds (60).
    pub timeout_secs: f64,
}

/// Pixels of one kind in memory of the program. Pixel (x, y) begins at data + y * row_bytes + x *
/// pixel_bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtsvCompositePlane {
    /// The first pixel of row 0.
    pub data: *const c_void,
    /// From one pixel to the next; 0 for pixels without gaps.
    pub pixel_bytes: i64,
    /// From one row to the next, also negative; 0 for rows without gaps.
    pub row_bytes: i64,
}

/// What one rank has drawn. The order of rows is free, and the same on all ranks. The planes are
/// read before the call returns, and not copied where pixels have no gaps and are aligned, rows
/// ascend by whole pixels, and both planes have rows of one length. What lies between rows must be
/// readable.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtsvCompositeFrame {
    /// Size of this structure.
    pub struct_bytes: u64,
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Four channels per pixel, as the compositor's format says.
    pub color: RtsvCompositePlane,
    /// One float per pixel, 0 (near) to 1 (nothing drawn; so are NaN and more than 1); not read for
    /// premultiplied formats.
    pub depth: RtsvCompositePlane,
    /// 0 or 1: `bounds` says where something was drawn; pixels outside count as not drawn.
    pub has_bounds: u32,
    /// 0 or 1: `depth_range` is known, which checks the order of premultiplied frames.
    pub has_depth_range: u32,
    /// First column, first row, column behind the last one, row behind the last one.
    pub bounds: [u32; 4],
    /// Nearest and farthest depth of what was drawn, in a unit that all ranks share.
    pub depth_range: [f32; 2],
}

/// A tile of a display wall.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtsvCompositeTile {
    /// First column in the frame.
    pub x: u32,
    /// First row in the frame.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The rank that shows it.
    pub rank: u32,
    /// Not used; 0.
    pub reserved: u32,
}

/// A composited image, or this rank's part of one; without gaps. Its memory belongs to the
/// compositor until its next call.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtsvCompositeImage {
    /// Size of this structure; set it before the call.
    pub struct_bytes: u64,
    /// Pixels per row; 0 on ranks that get nothing.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// First column in the frame.
    pub x: u32,
    /// First row in the frame.
    pub y: u32,
    /// Four channels per pixel, all 0 where nothing was drawn; null on ranks that get nothing.
    pub color: *const c_void,
    /// One per pixel, 1 where nothing was drawn; null without depth.
    pub depth: *const f32,
}
