//! Scenes that are made where their parts are: no rank ever has the whole.
//!
//! Each rank gives a [`RankScene`]. A collective call compares the settings, makes one list of
//! objects from small tables, and agrees on the spaces of the sum of all parts from bounds
//! ([`GlobalLayout::of_parts`]). Then each rank builds the structure over its own primitives, as a
//! part of a scene that exists nowhere. The memory of a rank is that of its own data, of a row for
//! each object of each rank, and of the instances.
mod agreement;
mod assemble;
mod brick_points;
mod fields;
mod objects;
mod rank_scene;
mod tables;
mod words;

pub(super) use agreement::{Setting, agree_on};
pub(super) use assemble::assemble;
pub use rank_scene::{DistributedVolume, PointBrick, RankScene};
#[cfg(doc)]
use rt_core::bvh::GlobalLayout;
