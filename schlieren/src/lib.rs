//! Physically based schlieren, shadowgraph and interferometry from flow data.
//!
//! **Status: not built yet.** This member holds its place in the workspace and has no code; ARCHITECTURE.md says
//! what it will do and in which order the members come.
#![forbid(unsafe_code)]

pub mod index;
