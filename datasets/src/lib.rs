//! Generators, readers and writers of data sets.
//!
//! | module | what |
//! |---|---|
//! | [`catalogue`] | data sets by name, with sizes and views (start here) |
//! | [`generate`] | every data set of the thesis as a deterministic function of its size |
//! | [`isosurface`] | surfaces of uniform fields, with VTK's triangle counts |
//! | [`contour`] | isosurfaces and plane sections of cells of any shape |
//! | [`cache`] | disk cache of generated meshes |
//! | [`free_memory`] | what this process can still take |
//! | [`image_io`] | images as PNG and multi-layer OpenEXR |
//! | [`colormaps`], [`view`] | colours and cameras |
//! | [`resample`] | data of any mesh on a uniform lattice, with a mask and the error |
//! | [`stored_mesh`], [`stored_volume`] | meshes and volumes in files that are larger than memory |
//! | [`model`], [`read`], [`write`](mod@write) | data sets in files |
//! | `cli` (feature) | conventions of all command-line programs of the workspace |
#![forbid(unsafe_code)]

mod atomic_file;
pub mod cache;
pub mod catalogue;
#[cfg(feature = "cli")]
pub mod cli;
pub mod colormaps;
pub mod contour;
mod delaunay;
pub mod free_memory;
pub mod generate;
pub mod image_io;
pub mod isosurface;
pub mod model;
mod paged_file;
mod plane_of_points;
pub mod read;
pub mod resample;
mod rows;
pub use paged_file::PagedFile;
pub mod stored_mesh;
pub mod stored_volume;
#[cfg(test)]
mod testing;
pub mod view;
pub mod write;
