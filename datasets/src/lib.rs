//! Generators, readers and writers of data sets.
#![forbid(unsafe_code)]

mod atomic_file;
#[cfg(feature = "cli")]
pub mod cli;
pub mod generate;
pub mod image_io;
pub mod isosurface;
pub mod model;
pub mod read;
#[cfg(test)]
mod testing;
pub mod view;
pub mod write;
