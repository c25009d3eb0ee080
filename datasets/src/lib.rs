//! Generators, readers and writers of data sets.
#![forbid(unsafe_code)]

pub mod generate;
pub mod isosurface;
pub mod model;
pub mod read;
#[cfg(test)]
mod testing;
pub mod write;
