//! Measures the whole workspace: reproduces every table and figure of the dissertation, and plots
//! error against time.
//!
//! An [`experiments::Experiment`] prepares its scenes and passes closures to
//! [`runner::interleave`]. The runner times them in alternation, because the machine may be shared.
//! The experiment then turns the samples into rows and ratios of a [`record::Record`]. Records are
//! written as JSON and CSV. [`report`] makes one HTML page of them, with the plots of [`plot`].
//!
//! Other ray tracers ([`baselines`]) are loaded at run time if they are installed. They run on the
//! same mesh and the same [`rays`], in the same process, alternating with ours. The record names
//! everything that is missing; nothing is skipped silently.
//!
//! Only `baselines/embree` contains `unsafe` code, because calling a C library requires it.
#![deny(unsafe_code)]

pub mod baselines;
mod book;
pub mod checkpoint;
pub mod cli;
pub mod clock;
pub mod control_group;
pub mod doubts;
pub mod experiments;
pub mod image;
pub mod machine;
pub mod memory;
pub mod meshes;
pub mod opengl;
pub mod plot;
pub mod quote;
pub mod rays;
pub mod record;
pub mod report;
pub mod rt_core_tracer;
pub mod runner;
pub mod stats;
pub mod stored_data;
