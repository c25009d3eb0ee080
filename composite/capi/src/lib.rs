//! The C interface of composite: `include/rtsv_composite.h`, `librtsv_composite.so`.
//!
//! A program has handles: of a [group of ranks](RtsvCompositeComm), which is a communicator of its
//! MPI; of [compositors](RtsvCompositeCompositor), which make one image of the images of all ranks;
//! of its part of a [scene](RtsvCompositeScene); and of [renderers](RtsvCompositeRenderer), which
//! make pictures of the sum of all parts. Rust programs use the crate `composite`, on which this
//! one is a layer: the bits of all images are the same.
//!
//! - Every call returns a [status](RtsvCompositeStatus). [`rtsv_composite_last_error`] is the text.
//! - *Collective* calls are made by all ranks of a group, in the same order. If one fails on a
//!   rank, all ranks get an error with the cause, none waits for ever, and the group has ended. The
//!   exception is [`RTSV_COMPOSITE_DISAGREE`].
//! - Handles belong to the thread that made them. Different threads may use handles of their own at
//!   once, as far as the thread level of MPI allows.
//! - Arrays belong to the program. They are read during the calls and not kept; where the library
//!   has to copy what it could have read, it says so by name.
//! - No panic leaves the library, and null pointers, handles that are none, sizes of other versions
//!   and values that cannot be end with a status.
#![deny(unsafe_code)]
// MPI's binary interface is known there.
#![cfg(all(unix, target_pointer_width = "64", target_endian = "little"))]

mod capi;

pub use capi::*;
