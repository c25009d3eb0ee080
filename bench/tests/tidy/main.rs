//! Keeps ARCHITECTURE.md true: reads the manifests, the sources and the documents of the workspace
//! and fails where they break a rule that is written there. Every check has a twin (`planted_...`)
//! that shows it finds what it should.
//!
//! The checks read text, so they are rules for people who want to follow them, not a defence
//! against tricks.

mod counted;
mod documents;
mod interface;
mod manifests;
mod modules;
mod sources;
mod tree;
mod width;
