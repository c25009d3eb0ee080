//! Diagnoses the machine for `gluray doctor`: what is available, and what will not work.
//!
//! A [`Machine`] is plain data: files, variables and the output of `glxinfo`. [`findings`]
//! evaluates it. Each finding can therefore be tested without the machine that causes it.

mod judge;
mod machine;

pub use judge::findings;
pub use machine::{Machine, OpenGl, find_glvnd, inspect};

use serde::Serialize;

/// How bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Grade {
    /// As it should be.
    Good,
    /// Works, but somebody may be surprised.
    Note,
    /// Will not work.
    Bad,
}

/// Something the doctor found.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// About what.
    pub about: &'static str,
    /// How bad it is.
    pub grade: Grade,
    /// What is there.
    pub found: String,
    /// What to do, when there is something to do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cure: Option<String>,
}
