//! Meshes in files, for more triangles than memory holds.
//!
//! A [`StoredMeshWriter`] takes a mesh piece by piece and stores it as **pages**: compact trees
//! ([`super::compact`]) of up to 4,096 neighbouring triangles, about 14 bytes for each. A
//! [`StoredMesh`] is a [`Shape`] whose primitives are the pages. The boxes of all pages are in
//! memory, some 150 bytes a page with the tree over them; a page is read when a ray first enters
//! its box, and leaves when the budget of memory is used up. So a scene of any size is there at
//! once, and a picture needs the pages that its rays meet.
//!
//! This module reads and writes through traits ([`PageSource`], [`PageSink`]); files are another
//! member's. Pages are read by ordinary calls, not mapped: a file that is cut, or a disk that
//! fails, is an error of a call and not a signal that ends the process. Each page has a checksum,
//! and is checked before a ray follows it. What goes wrong is kept ([`StoredMesh::failure`]), and
//! makes the render fail with it ([`Shape::failure`]).
//!
//! Hits are those of the same triangles in memory, bit for bit, where the mesh's coordinates are
//! stored as they are. Of two triangles hit at the same distance in different pages, the page with
//! the lower number wins, not the triangle. Normals, colours and scalars lie behind each page
//! ([`attributes`]), and are read when a hit on it is shaded.

mod attributes;
mod error;
mod format;
mod octahedral;
mod packets;
mod page;
mod read;
mod recent_hits;
mod surface;
#[cfg(test)]
mod tests;
mod write;

pub use error::StoredMeshError;
pub use read::{StoredAttributes, StoredMesh};
pub use write::{StoredMeshReport, StoredMeshWriter};

#[cfg(doc)]
use crate::paging::{PageSink, PageSource};
#[cfg(doc)]
use crate::shapes::Shape;
