//! Data larger than memory: parts of a file (pages of meshes, bricks of volumes) that are read when
//! rays need them, within a budget.

mod bytes;
mod cache;
pub(crate) mod fields;

pub use bytes::{PageSink, PageSource};
pub use cache::PageUse;
pub(crate) use cache::{PageCache, Paged};
