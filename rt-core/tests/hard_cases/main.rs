//! Inputs that break ray tracers, one file per disease.

mod common;
mod leaks;
mod ties;
