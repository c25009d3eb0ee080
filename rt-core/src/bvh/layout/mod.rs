//! Memory layout of the tree.

pub(crate) mod local_frame;
pub(crate) mod triangles;
pub(crate) mod wide;
