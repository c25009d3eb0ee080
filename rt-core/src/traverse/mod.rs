//! Traversal of the 8-wide hierarchy.

pub(crate) mod hybrid;
pub(crate) mod packet;
pub(crate) mod pair;
pub(crate) mod single;
