//! Ray tracing for scientific visualization on the CPU.
#![deny(unsafe_code)]

pub mod accel;
pub mod colormap;
pub mod grid;
pub mod math;
pub mod mesh;
pub mod ray;
pub mod shapes;
pub mod simd;

pub use glam;
