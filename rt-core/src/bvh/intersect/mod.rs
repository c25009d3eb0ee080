//! Ray-triangle tests.

pub(crate) mod crossing;
pub(crate) mod watertight;
