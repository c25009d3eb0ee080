//! Data-parallel rendering: every rank holds a part of a scene, and all together make the picture
//! that one node would make of the whole.
//!
//! A [`Partition`] says which primitive goes to which rank, a [`Part`] is what one rank then holds.
//! [`DataParallel::frame`] renders sort-last (thesis section 3.2.1): every rank traces camera rays
//! against its part, owners of tiles keep the nearest hits, and what leaves those hits (shadow,
//! ambient occlusion, mirror and glass rays) is asked of the ranks in whose bounds the rays come,
//! until no ray is left: the open problem of section 6.2. Where local geometry with a rim around it
//! does as well for less, [`ghost`] zones take the place of asking. [`ray_parallel()`] is the other
//! way (sections 3.2.2 and 4.2.3): every rank holds everything and renders some tiles.
//!
//! The picture has the bits of [`rt_core::render::render`] of the whole scene, for any number of
//! ranks and any partition: parts take over the whole's local spaces
//! ([`rt_core::bvh::World::build_part`]), hits are joined by parameter and then by number, light
//! bits by *or*, and everything else is done by the functions that one node would use
//! ([`rt_core::distributed`]).
//!
//! ```
//! use composite::render::{DataParallel, FrameOptions, Partition, Split};
//! use composite::{Communicator, threads};
//! use rt_core::{bvh::{BuildOptions, World}, camera::Camera, glam::{DVec3, Vec3}, mesh::TriMesh};
//! use rt_core::{render::{RenderOptions, render}, scene::Scene};
//!
//! let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 0.5)];
//! let mesh = TriMesh::new(corners, vec![[0, 1, 2], [1, 3, 2]]);
//! let scene = Scene::new(World::from_mesh(mesh, &BuildOptions::default()).unwrap());
//! let (eye, center) = (DVec3::new(0.5, 0.5, 3.0), DVec3::new(0.5, 0.5, 0.0));
//! let camera = Camera::perspective(eye, center, DVec3::Y, 0.6, 1.0, [0.1, 10.0]).unwrap();
//! let options = RenderOptions::new(64, 64);
//!
//! let partition = Partition::new(&scene, 2, &Split::Triangles);
//! let outputs = threads::run(2, |mut comm| {
//!     let part = partition.part(&scene, comm.rank(), &BuildOptions::default())?;
//!     let mut renderer = DataParallel::new(&mut comm, part, FrameOptions::default())?;
//!     renderer.frame(&mut comm, &camera, &options)
//! });
//! let picture = outputs[0].as_ref().unwrap().as_ref().unwrap().frame.as_ref().unwrap();
//! assert_eq!(picture.color, render(&scene, &camera, &options).unwrap().frame.color);
//! ```

pub mod demo;
mod demo_error;
mod demo_model;
mod error;
pub mod ghost;
mod message_codec;
mod options;
mod partition;
mod primary_rays;
mod rank_bounds;
mod rank_frame;
mod ray_codec;
mod ray_parallel;
mod report;
mod request_reply;
mod secondary_rays;
mod sort_last;
mod tile_collector;
mod tile_hits;
mod tile_owners;
mod volume_bricks;
mod volumes;

pub use error::FrameError;
pub use options::{FrameOptions, FrameOutput, SecondaryRayPolicy};
pub use partition::{Part, Partition, Split};
pub use ray_parallel::ray_parallel;
pub use report::{Activity, RankReport, Span};
pub use sort_last::DataParallel;
