//! Through the field: from starts to exits.

mod deviational;
mod frame;
mod packet;

pub use deviational::{Counters, Deviational, Options, Scheme};
pub use frame::BlankCells;
