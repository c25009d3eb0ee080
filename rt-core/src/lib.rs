//! Ray tracing for scientific visualization on the CPU.
#![deny(unsafe_code)]

pub mod bvh;
pub mod camera;
pub mod colormap;
pub mod effects;
pub mod environment;
pub mod frame;
pub mod grid;
mod grid_walk;
pub mod light;
pub mod material;
pub mod material_maps;
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
pub mod volume;

pub use glam;
pub use shade::distributed;
