//! Which props are ray traced, and the reason for every one that OpenGL draws. The C++ shim and the
//! Python package gather the facts and report the reason.
//!
//! A reason completes the sentence "OpenGL draws it: ...". If several apply, the first is given.

mod actor;
mod glyphs;
mod surface;
mod volume;

pub(super) use actor::actor;
pub(super) use glyphs::glyphs;
pub(super) use surface::{CellArray, surface};
pub(super) use volume::volume;

/// Radii for vertices and lines, data units; 0 for none.
#[derive(Debug, Clone, Copy)]
pub(super) struct Radii {
    pub(super) point: f64,
    pub(super) line: f64,
}

/// The first reason whose condition holds.
fn first(reasons: &[(bool, &'static str)]) -> Option<&'static str> {
    reasons.iter().find(|(holds, _)| *holds).map(|(_, reason)| *reason)
}

#[cfg(test)]
mod tests;
