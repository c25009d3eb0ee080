//! What there is to work with, and what will not work: everything `gluray doctor` says.
//!
//! A [`Machine`] is what was seen (files, variables, the answer of `glxinfo`), plain data;
//! [`findings`] judges it. So each judgement is tested without the machine that it is about.

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
