//! Ray tracing inside unmodified OpenGL programs (chapter 4 of the dissertation).
//!
//! The shared library stands between a program and its OpenGL driver. The life of a frame:
//!
//! 1. A call comes to a trampoline (`interpose`); most go straight on to the driver, which keeps
//!    all state.
//! 2. A draw of filled primitives asks what the state is (`state`) and whether rays can stand for
//!    it (`classify`).
//! 3. If so it becomes a mesh (`capture`) whose hierarchy may be there already
//!    (`capture::geometry_cache`).
//! 4. When the program is about to see the picture (`present::frame`) rays find the nearest
//!    triangle of every pixel (`trace`), which is lit as OpenGL lights it (`trace::lighting`,
//!    `trace::texturing`).
//! 5. Colours and depths go into the program's framebuffer as one pass of fragments
//!    (`present::framebuffer_pass`).
//!
//! Whatever is not understood the driver draws, and depth brings both together. A fault of ours
//! ends the tracing, not the program (`interpose::panic_guard`).
#![deny(unsafe_code)]

mod capture;
mod classify;
pub mod cli;
mod cluster;
pub mod doctor;
mod host;
mod interpose;
mod present;
mod state;
mod trace;

pub use classify::reasons;
pub use cluster::RankStats;
pub use host::{config, export, folders, panel, report, timeline};
pub use interpose::glvnd;

/// Whether rays can stand for a program with these shaders; an empty text for a shader that it
/// lacks.
///
/// # Errors
/// Why it is the driver's, as the account of a run says it.
pub fn recognise(vertex: &str, geometry: &str, fragment: &str) -> Result<(), &'static str> {
    classify::vtk::recognise(vertex, geometry, fragment)
}
