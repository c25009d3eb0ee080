//! Ray tracing inside unmodified OpenGL programs.
#![deny(unsafe_code)]

pub mod config;
pub mod folders;
pub mod panel;
