//! Ray tracing inside unmodified OpenGL programs (chapter 4 of the dissertation).
//!
//! The shared library is loaded between a program and its OpenGL driver: it is the package
//! `gluray-interposer`, which has the entry points, and this library. It handles a frame in five
//! steps:
//!
//! 1. The program's OpenGL call enters a trampoline. Most calls go straight on to the driver, which
//!    keeps all state; others come to a hook (`interpose`).
//! 2. For a draw of filled primitives, the library reads the state (`state`) and decides whether
//!    ray tracing can replace the draw (`classify`).
//! 3. If it can, the draw becomes a mesh (`capture`). The mesh's hierarchy may already be cached
//!    (`capture::geometry_cache`).
//! 4. When the program is about to see the image (`interpose::pipeline`), rays find the nearest
//!    triangle of every pixel (`trace`). Each hit is lit as OpenGL lights it (`trace::lighting`,
//!    `trace::texturing`).
//! 5. Colours and depths go into the program's framebuffer as one pass of fragments
//!    (`present::framebuffer_pass`).
//!
//! The driver draws whatever the library does not understand, and the depth buffer combines the
//! two. A fault in the library ends the tracing, not the program (`faults`).
#![deny(unsafe_code)]

mod calls;
mod capture;
mod classify;
pub mod cli;
mod cluster;
pub mod doctor;
mod driver;
mod enums;
mod faults;
mod host;
mod interpose;
mod present;
mod state;
mod trace;
mod watched_calls;

pub use classify::reasons;
pub use cluster::RankStats;
pub use host::{config, export, folders, panel, report, timeline};
pub use interpose::glvnd;
#[doc(hidden)]
pub use interpose::symbols::interface as interposer;

/// Checks whether ray tracing can replace a program with these shaders. Pass an empty text for a
/// shader that the program lacks.
///
/// # Errors
/// Returns the reason why the driver must draw it, in the words of a run's report.
pub fn recognise(vertex: &str, geometry: &str, fragment: &str) -> Result<(), &'static str> {
    classify::vtk::recognise(vertex, geometry, fragment)
}
