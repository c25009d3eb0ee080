//! Generators, readers and writers of data sets.
#![forbid(unsafe_code)]

pub mod generate;
#[cfg(test)]
mod testing;
