//! Ray tracing for scientific visualization on the CPU.
#![deny(unsafe_code)]

pub mod colormap;
pub mod grid;
pub mod math;
pub mod mesh;

pub use glam;
