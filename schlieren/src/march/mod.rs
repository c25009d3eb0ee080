//! Through the field: from starts to exits.
//!
//! | march | where | cost |
//! |---|---|---|
//! | [`LineOfSight`] | deflections so small that rays stay within their voxel | one 2-D sample a photon |
//! | [`Deviational`] (Verlet) | gases: the default | a sample a step, `f32`, sixteen rays at a time |
//! | [`Deviational`] (Euler) | the dissertation's equations 5.7 and 5.8, for comparison | the same |
//! | [`Full`] | strong index: lenses, liquids, turning rays | one to six samples a step, `f64` |
//!
//! Two are there to judge the others by: [`DormandPrince`], adaptive, for smooth media, and
//! [`CellExact`], which ends its steps on the cells' faces, for interpolated fields, whose kinks no
//! adaptive step sees.

mod adaptive;
mod cell_exact;
mod deviational;
mod euler;
mod field_cache;
mod frame;
mod full;
mod integrator;
mod kernel_ray;
mod line_of_sight;
mod packet;
mod pefrl;
mod rk4;
mod sharma;
mod verlet;

pub use adaptive::{AdaptiveRay, DormandPrince};
pub use cell_exact::{CellExact, LineIntegrals, Points};
pub use deviational::{Counters, Deviational, Options, Scheme};
pub use euler::Euler;
pub use field_cache::{FieldCache, Projection};
pub use frame::BlankCells;
pub(crate) use frame::Frame;
pub use full::{Full, FullOptions};
pub use integrator::{Integrator, InterpolatedMedium, Medium, Ray};
#[cfg(feature = "gpu")]
pub(crate) use kernel_ray::{KernelOutput, KernelRay};
pub use line_of_sight::LineOfSight;
pub use pefrl::Pefrl;
pub use rk4::RungeKutta4;
pub use sharma::Sharma;
pub use verlet::Verlet;
