//! Data-parallel rendering: every rank holds a part of a scene, and together they render the image
//! that one node would render of the whole.
//!
//! A [`Partition`] says which primitive goes to which rank, and a [`Part`] is what one rank then
//! holds. [`DataParallel::frame`] renders sort-last (thesis section 3.2.1). Every rank traces
//! camera rays against its part, and owners of tiles keep the nearest hits. The secondary rays of
//! those hits (shadow, ambient occlusion, mirror and glass rays) are sent to the ranks whose bounds
//! they enter, until no ray is left; section 6.2 names this as an open problem. Where a part with a
//! ghost layer around it gives the same result for less, [`ghost`] zones replace these requests.
//! [`ray_parallel()`] is the alternative (sections 3.2.2 and 4.2.3): every rank holds everything
//! and renders some pieces of the image.
//!
//! The image has the bits of [`rt_core::render::render`] of the whole scene, for any number of
//! ranks and any partition: parts use the local spaces of the whole
//! ([`rt_core::bvh::World::build_part`]), hits are merged by parameter and then by number,
//! occlusion bits by *or*, and the functions of one node do everything else
//! ([`rt_core::deferred`], which knows no ranks and no messages).
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
mod demo_pieces;
mod distributed;
mod error;
pub mod ghost;
#[cfg(feature = "light")]
pub mod light;
mod options;
mod partition;
mod primary_rays;
mod rank_bounds;
mod rank_frame;
mod ray_parallel;
mod ray_query;
mod report;
mod request_reply;
mod secondary_rays;
mod sort_last;
mod tile_collector;
mod tile_hits;
mod tile_owners;
mod volume_bricks;
mod volumes;
mod wire_format;

pub use demo_pieces::{PieceDemo, PiecesOfRank};
pub use distributed::{DistributedVolume, PointBrick, RankScene};
pub use error::FrameError;
pub use options::{FrameOptions, FrameOutput, SecondaryRayPolicy};
pub use partition::{Part, Partition, Split};
pub use ray_parallel::ray_parallel;
pub use report::{Activity, RankReport, Span};
pub use sort_last::DataParallel;
