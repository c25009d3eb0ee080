//! Memory layout of the tree.

pub(crate) mod id_leaf;
pub(crate) mod local_frame;
pub(crate) mod triangles;
pub(crate) mod wide;
