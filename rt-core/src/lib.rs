//! Ray tracing for scientific visualization on the CPU.
#![deny(unsafe_code)]

pub mod accel;
pub mod colormap;
pub mod grid;
mod intersect;
pub mod math;
pub mod mesh;
pub mod ray;
pub mod shapes;
pub mod simd;
pub mod stats;
#[cfg(test)]
pub(crate) mod test_shapes;
mod traverse;

pub use glam;
