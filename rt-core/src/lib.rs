//! Ray tracing for scientific visualization on the CPU.
//!
//! ```
//! use rt_core::prelude::*;
//!
//! let corners = vec![Vec3::new(-9.0, -9.0, 0.0), Vec3::new(9.0, -9.0, 0.0), Vec3::Y * 9.0];
//! let floor = TriMesh::new(corners, vec![[0, 1, 2]]);
//! let mut builder = SceneBuilder::new();
//! builder.mesh(floor, Material::matte([0.5, 0.25, 1.0]));
//! builder.light(Light::directional(DVec3::Z));
//! let scene = builder.build().unwrap();
//! let eye = DVec3::new(0.0, 0.0, 4.0);
//! let camera = Camera::perspective(eye, DVec3::ZERO, DVec3::Y, 0.5, 1.0, [0.1, 100.0]).unwrap();
//! let output = render(&scene, &camera, &RenderOptions::new(32, 32)).unwrap();
//! assert_eq!(output.frame.color_at(16, 16), [0.5, 0.25, 1.0, 1.0]);
//! assert_eq!(output.report.rays.reflection, 0);
//! ```
//!
//! A [`scene::Scene`] has geometry in a [`bvh::World`], materials, lights and volumes. A
//! [`camera::Camera`] and [`render::RenderOptions`] define the image. [`render::render`] returns it
//! with a report. [`distributed`] renders scenes whose parts are held by several processes.
//!
//! Releases may add fields to options: build them from their defaults, as in
//! `RenderOptions { samples: 4, ..RenderOptions::new(64, 64) }`.
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
pub mod prelude;
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
