//! Intel Embree 3 and 4, loaded at run time.
//!
//! One Rust type for both: Embree 4 changed the arguments of its query functions and nothing else
//! that is used here. Everything `unsafe` of this workspace member is in this folder: [`library`]
//! finds and loads the C library, `abi` repeats its C declarations, and this file calls it.
//!
//! What is measured is Embree at its best: packets of rays are copied from blocks that already have
//! its layout, fields that a query leaves alone are set once per call and not once per packet, and
//! only the hit fields that ours fills too are read back.

mod abi;
pub mod library;
mod scene;

pub use library::{Embree, Version};
pub use scene::{EmbreeScene, Options, Quality, View};
