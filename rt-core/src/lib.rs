//! Ray tracing for scientific visualization on the CPU.
//!
//! A [`bvh::World`] answers which primitive a ray meets, for single rays and for many at once:
//!
//! ```
//! use rt_core::prelude::*;
//!
//! let corners = vec![Vec3::new(-9.0, -9.0, 0.0), Vec3::new(9.0, -9.0, 0.0), Vec3::Y * 9.0];
//! let floor = TriMesh::new(corners, vec![[0, 1, 2]]);
//! let world = World::from_mesh(floor, &BuildOptions::default())?;
//! let down = Ray::new(Vec3::new(0.0, 0.0, 4.0), Vec3::NEG_Z);
//! assert_eq!(world.closest(&down).map(|hit| (hit.prim, hit.t)), Some((0, 4.0)));
//! assert!(!world.occluded(&down.with_t_max(3.0)));
//! # Ok::<(), rt_core::bvh::BuildError>(())
//! ```
//!
//! The renderer (the feature `render`, on by default) renders images of such worlds:
//!
//! ```
//! # #[cfg(feature = "render")]
//! # {
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
//! # }
//! ```
//!
//! A [`scene::Scene`] has geometry in a [`bvh::World`], materials, lights and volumes. A
//! [`camera::Camera`] and [`render::RenderOptions`] define the image. [`render::render`] returns it
//! with a report. [`deferred`] leaves the tracing of rays to the caller, for scenes that lie in
//! parts.
//!
//! Releases may add fields to options: build them from their defaults, as in
//! `RenderOptions { samples: 4, ..RenderOptions::new(64, 64) }`.
#![deny(unsafe_code)]

// ---- Ray queries: geometry, its trees, and the way of rays through them.
pub mod bvh;
pub mod grid;
mod grid_walk;
pub mod math;
pub mod mesh;
pub mod paging;
pub mod prelude;
pub mod ray;
mod ray_cubic;
pub mod robustness;
pub mod shapes;
pub mod simd;
pub mod stats;
pub mod stored_volume;
#[cfg(test)]
pub(crate) mod test_shapes;

// ---- The renderer, which the modules above know nothing of.
#[cfg(feature = "render")]
pub mod camera;
#[cfg(feature = "render")]
pub mod colormap;
#[cfg(feature = "render")]
mod effect_plan;
#[cfg(feature = "render")]
pub mod effects;
#[cfg(feature = "render")]
pub mod environment;
#[cfg(feature = "render")]
pub mod frame;
#[cfg(feature = "render")]
pub mod light;
#[cfg(feature = "render")]
pub mod material;
#[cfg(feature = "render")]
pub mod material_maps;
#[cfg(feature = "render")]
pub mod ray_stats;
#[cfg(feature = "render")]
pub mod render;
#[cfg(feature = "render")]
mod render_error;
#[cfg(feature = "render")]
mod render_options;
#[cfg(feature = "render")]
pub mod sampler;
#[cfg(feature = "render")]
pub mod scene;
#[cfg(feature = "render")]
mod shade;
#[cfg(feature = "render")]
mod surface;
#[cfg(feature = "render")]
mod surface_model;
#[cfg(feature = "render")]
pub mod texture;
#[cfg(feature = "render")]
pub mod transfer_function;
#[cfg(feature = "render")]
pub mod volume;

pub use glam;
#[cfg(feature = "render")]
pub use shade::deferred;
#[cfg(feature = "render")]
pub use shade::vtk_pbr;
