//! Inputs that break ray tracers, one file per kind of failure.

mod agreement;
mod common;
mod compact;
mod crossings;
mod degenerate;
mod directions;
mod distances;
mod double_precision;
mod exact_oracle;
mod leaks;
mod limits;
mod oracle;
mod random;
mod scales;
#[cfg(feature = "render")]
mod secondary;
mod slivers;
mod ties;
