//! What OpenGL's state is when something is drawn.
//!
//! The driver keeps all state; we ask it (`snapshot`) when a draw comes and something may have
//! changed since we asked last. Only what changes from vertex to vertex is kept here (`current`).

pub(crate) mod current_attributes;
pub(crate) mod enums;
pub(crate) mod material_properties;
pub(crate) mod snapshot;
