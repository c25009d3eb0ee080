//! Ray-triangle tests.

pub(crate) mod watertight;
