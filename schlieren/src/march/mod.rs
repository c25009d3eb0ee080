//! Traces light through a field: each march turns [`crate::path::Start`]s into
//! [`crate::path::Exit`]s.
//!
//! | march | use | cost |
//! |---|---|---|
//! | [`LineOfSight`] | rays that stay within their voxel | one 2-D sample per photon |
//! | [`Deviational`] (Verlet) | gases: the default | one sample per step, `f32`, 16 rays at once |
//! | [`Deviational`] (Euler) | comparison with the dissertation (equations 5.7, 5.8) | the same |
//! | [`Full`] | lenses, liquids, turning rays | one to six samples per step, `f64` |
//! | [`InBricks`] (Verlet) | lattices that no process has whole | one sample per step, `f64` |
//! | [`OnCells`] (Verlet) | meshes without a lattice | one sample per cell or more, `f64` |
//!
//! Two more integrators are references for measuring the errors of these. [`DormandPrince`] is
//! adaptive and serves smooth media. [`CellExact`] ends its steps on the faces of cells and serves
//! interpolated fields, whose kinks an adaptive step does not notice.

mod adaptive;
mod cell_exact;
mod deviational;
mod euler;
mod field_cache;
mod field_interpolant;
mod frame;
mod full;
mod full_of_field;
mod in_bricks;
mod integrator;
mod kernel_ray;
mod line_of_sight;
mod on_cells;
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
pub(crate) use field_interpolant::FieldInterpolant;
pub use frame::BlankCells;
pub(crate) use frame::Frame;
pub use full::{Full, FullOptions};
pub(crate) use full_of_field::FullOfField;
pub use in_bricks::{
    Brick, InBricks, InBricksError, Lattice, Progress, RayState, Stencil, Undisturbed,
};
pub use integrator::{Integrator, InterpolatedMedium, Medium, Ray};
#[cfg(feature = "gpu")]
pub(crate) use kernel_ray::KernelOutput;
pub(crate) use kernel_ray::KernelRay;
pub use line_of_sight::LineOfSight;
#[cfg(feature = "gpu")]
pub(crate) use line_of_sight::ProjectedMap;
pub(crate) use on_cells::CellWork;
pub use on_cells::{CellCounters, OnCells};
pub use pefrl::Pefrl;
pub use rk4::RungeKutta4;
pub use sharma::Sharma;
pub use verlet::Verlet;
