//! Through the field: from starts to exits.
//!
//! | march | where | cost |
//! |---|---|---|
//! | [`LineOfSight`] | deflections so small that rays stay within their voxel | one 2-D sample a photon |
//! | [`Deviational`] (Verlet) | gases: the default | a sample a step, `f32`, sixteen rays at a time |
//! | [`Deviational`] (Euler) | the dissertation's equations 5.7 and 5.8, for comparison | the same |
//! | [`Full`] | strong index: lenses, liquids, turning rays | one to six samples a step, `f64` |
//!
//! Two are there to judge the others by: [`DormandPrince`], adaptive, for smooth media, and [`CellExact`], which ends its steps on the cells' faces, for
//! interpolated fields, whose kinks no adaptive step sees.

mod adaptive;
mod cell_exact;
mod deviational;
mod euler;
mod frame;
mod full;
mod integrator;
mod kept;
mod line_of_sight;
mod packet;
mod pefrl;
mod prepared;
mod rk4;
mod sharma;
mod verlet;

pub use adaptive::{DormandPrince, Run};
pub use cell_exact::{CellExact, Points, Sight};
pub use deviational::{Counters, Deviational, Options, Scheme};
pub use euler::Euler;
pub use frame::BlankCells;
pub(crate) use frame::Frame;
pub use full::{Full, FullOptions};
pub use integrator::{Integrator, Interpolated, Medium, Ray};
pub use kept::{Kept, Projection};
pub use line_of_sight::LineOfSight;
pub use pefrl::Pefrl;
#[cfg(feature = "gpu")]
pub(crate) use prepared::{Left, Prepared};
pub use rk4::RungeKutta4;
pub use sharma::Sharma;
pub use verlet::Verlet;
