//! The calls, in the order of a program: a group of ranks, compositing alone, a scene, pictures,
//! photographs.
#![allow(unsafe_code, reason = "this is where foreign code calls us")]

mod compositing;
mod group;
mod handles;
mod light;
mod light_types;
mod memory;
mod planes;
mod renderer;
mod scene;
mod scene_types;
mod status;
mod tuples;
mod types;
mod volumes;

pub use compositing::*;
pub use group::*;
pub use light::*;
pub use light_types::*;
pub use renderer::*;
pub use scene::*;
pub use scene_types::*;
pub use status::*;
pub use types::*;
pub use volumes::*;
