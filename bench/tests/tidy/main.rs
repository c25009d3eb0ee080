//! Enforces ARCHITECTURE.md: reads the manifests, the sources and the documents of the workspace,
//! and fails where they break a rule that is written there. Every check has a twin (`planted_...`)
//! that shows that it finds planted faults.
//!
//! The checks read text. They help people who want to follow the rules; they are not a defence
//! against tricks.

mod counted;
mod documents;
mod interface;
mod manifests;
mod modules;
mod sources;
mod tree;
mod width;
