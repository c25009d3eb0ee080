//! The names that most programs need.
//!
//! ```
//! use rt_core::prelude::*;
//!
//! let mesh = TriMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
//! let world = World::from_mesh(mesh, &BuildOptions::default())?;
//! assert!(world.closest(&Ray::new(Vec3::new(0.2, 0.2, 5.0), Vec3::NEG_Z)).is_some());
//! # Ok::<(), rt_core::bvh::BuildError>(())
//! ```

pub use crate::bvh::{BuildOptions, Geometry, Instance, Storage, World};
pub use crate::bvh::{HitF64, MeshF64, RayF64, WorldF64};
pub use crate::mesh::{Attribute, TriMesh};
pub use crate::ray::{Hit, HitBlock, Ray, RayBlock};
pub use crate::shapes::Shape;
pub use glam::{DAffine3, DVec3, Vec3};

#[cfg(feature = "render")]
pub use crate::{
    camera::Camera,
    effects::Effects,
    frame::{Frame, Layers},
    light::Light,
    material::Material,
    render::{RenderOptions, RenderOutput, render},
    scene::{Appearance, Scene, SceneBuilder},
};
