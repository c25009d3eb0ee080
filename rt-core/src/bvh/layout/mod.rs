//! How the tree lies in memory.

pub(crate) mod local_frame;
pub(crate) mod triangles;
pub(crate) mod wide;
