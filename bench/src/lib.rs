//! Measurements of the whole workspace: every table and figure of the dissertation, and error
//! against time.
//!
//! One measurement's life: an [`experiments::Experiment`] prepares its scenes, hands closures to
//! [`runner::interleave`], which times them in turns on a shared machine, and turns the samples
//! into rows and ratios of a [`record::Record`]. Records are written as JSON and CSV; [`report`]
//! makes one HTML page of them, with the plots of [`plot`].
//!
//! Other ray tracers ([`baselines`]) are loaded at run time when they are installed and run on the
//! same mesh and the same [`rays`], in the same process, in turns with ours. What is missing is
//! named in the record, never skipped silently.
//!
//! `unsafe` lives in `baselines/embree` alone: a C library cannot be called without it.
#![deny(unsafe_code)]

pub mod baselines;
mod book;
pub mod cli;
pub mod clock;
pub mod doubts;
pub mod experiments;
pub mod machine;
pub mod memory;
pub mod meshes;
pub mod opengl;
pub mod picture;
pub mod plot;
pub mod quote;
pub mod rays;
pub mod record;
pub mod report;
pub mod rt_core_tracer;
pub mod runner;
pub mod stats;
