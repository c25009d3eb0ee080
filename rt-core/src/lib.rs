//! Ray tracing for scientific visualization on the CPU.
#![deny(unsafe_code)]

pub mod accel;
pub mod camera;
pub mod colormap;
pub mod detail;
pub mod effects;
pub mod environment;
pub mod frame;
pub mod grid;
mod grid_walk;
mod intersect;
pub mod light;
pub mod material;
pub mod math;
pub mod mesh;
pub mod ray;
mod ray_cubic;
pub mod ray_stats;
pub mod render;
pub mod robustness;
pub mod sampler;
pub mod scene;
mod shade;
pub mod shapes;
pub mod simd;
pub mod stats;
mod surface;
#[cfg(test)]
pub(crate) mod test_shapes;
pub mod texture;
pub mod transfer_function;
mod traverse;
pub mod volume;

pub use glam;
pub use shade::waves;
