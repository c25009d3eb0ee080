//! Ray tracing inside unmodified OpenGL programs (chapter 4 of the dissertation).
//!
//! The shared library stands between a program and its OpenGL driver. The life of a frame:
//!
//! 1. A call comes to a trampoline (`symbols`); most go straight on to the driver, which keeps all state.
//! 2. A draw of filled primitives asks what the state is (`state`) and whether rays can stand for it (`decide`).
//! 3. If so it becomes a mesh (`capture`, `arrays`, `primitives`) whose hierarchy may be there already (`cache`).
//! 4. When the program is about to see the picture (`frame`) rays find the nearest triangle of every pixel (`trace`), which is lit as
//!    OpenGL lights it (`lighting`, `texturing`).
//! 5. Colours and depths go into the program's framebuffer as one pass of fragments (`present`).
//!
//! Whatever is not understood the driver draws, and depth brings both together. A fault of ours ends the tracing, not the
//! program (`fault`).
#![deny(unsafe_code)]

mod again;
mod arrays;
mod beyond;
mod buffers;
mod cache;
mod capture;
pub mod cli;
mod client_memory;
pub mod config;
mod context;
mod control;
mod decide;
pub mod doctor;
mod effects;
mod elements;
mod enums;
mod evaluators;
pub mod export;
mod fault;
pub mod folders;
mod frame;
pub mod glvnd;
mod immediate;
mod late;
mod lighting;
mod multisample;
mod overrides;
mod packs;
pub mod panel;
mod picture;
mod present;
mod primitives;
mod probe;
mod programs;
pub mod ranks;
mod raster;
mod real;
pub mod reasons;
mod recorder;
pub mod report;
mod shading;
mod share_group;
mod state;
mod studio;
mod symbols;
mod texturing;
pub mod timeline;
mod trace;
mod view;
mod worker;

/// Whether rays can stand for a program with these shaders; an empty text for a shader that it lacks.
///
/// # Errors
/// Why it is the driver's, as the account of a run says it.
pub fn recognise(vertex: &str, geometry: &str, fragment: &str) -> Result<(), &'static str> {
    programs::recognise(vertex, geometry, fragment)
}
