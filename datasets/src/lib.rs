//! Generators, readers and writers of data sets.
#![forbid(unsafe_code)]

pub mod generate;
pub mod isosurface;
#[cfg(test)]
mod testing;
