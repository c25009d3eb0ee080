//! Ray tracing for scientific visualization on the CPU.
#![deny(unsafe_code)]

pub mod accel;
pub mod colormap;
pub mod grid;
mod grid_walk;
mod intersect;
pub mod math;
pub mod mesh;
pub mod ray;
mod ray_cubic;
pub mod shapes;
pub mod simd;
pub mod stats;
#[cfg(test)]
pub(crate) mod test_shapes;
pub mod transfer_function;
mod traverse;
pub mod volume;

pub use glam;
