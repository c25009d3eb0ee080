//! Intel Embree 3 and 4, loaded at run time.
//!
//! One Rust type serves both versions. Of the functions in use, Embree 4 changed only the arguments
//! of the queries. All `unsafe` code of this workspace member is in this folder: [`library`] finds
//! and loads the C library, `abi` repeats its C declarations, and `scene` calls it.
//!
//! The measurements use Embree at its best. Ray packets are copied from blocks that already have
//! its layout. Fields that a query does not change are set once per call, not once per packet. Only
//! the hit fields that rt-core also fills are read back.

mod abi;
pub mod library;
mod scene;

pub use library::{Embree, Version};
pub use scene::{EmbreeScene, Options, Quality, View};
