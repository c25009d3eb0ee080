//! Ray tracing inside unmodified OpenGL programs.
#![deny(unsafe_code)]

pub mod cli;
pub mod config;
pub mod doctor;
pub mod export;
pub mod folders;
pub mod panel;
pub mod timeline;
