//! Volumes in files, for more points than memory holds.
//!
//! A [`StoredVolumeWriter`] takes a lattice plane by plane and stores it as **bricks** of
//! 32 x 32 x 32 cells, with values in their own type: a byte a point stays a byte (1.1 with the
//! points that bricks share). A [`StoredVolume`] has the smallest and the largest value of each
//! brick in memory, 24 bytes a brick. A [`StoredIsosurface`] is a [`Shape`] whose primitives are
//! the bricks that the surface crosses, for any isovalue: rays meet the trilinear interpolant
//! itself, and no triangle is made. A medium can stay in its file too (`volume::Volume::stored`). A
//! brick is read when a ray first enters it, and leaves when the
//! budget of memory is used up.
//!
//! As for stored meshes ([`crate::bvh::StoredMesh`]), files are another member's; bricks are read
//! by ordinary calls, not mapped; each has a checksum; and what goes wrong is kept
//! ([`StoredVolume::failure`]) and makes the render fail with it ([`Shape::failure`]).

mod active_cells;
mod active_walk;
mod brick;
mod error;
mod format;
mod isosurface;
mod layout;
mod ray_block;
mod read;
#[cfg(test)]
mod tests;
mod write;

pub use error::StoredVolumeError;
pub use isosurface::StoredIsosurface;
#[cfg(feature = "render")]
pub(crate) use layout::BRICK_CELLS;
pub use layout::{ValueType, VolumeLayout};
pub use read::StoredVolume;
pub use write::{StoredVolumeReport, StoredVolumeWriter};

#[cfg(doc)]
use crate::shapes::Shape;
