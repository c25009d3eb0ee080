//! The methods that march rays on the device, and their options.

use crate::march::BlankCells;
use crate::path::PathQuantities;

/// How rays are stepped through the field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Method {
    /// Position Verlet of deviations, in `f32` as on the CPU ([`crate::march::Deviational`]). The
    /// default.
    #[default]
    Verlet,
    /// Explicit Euler of deviations, in `f32` as on the CPU.
    Euler,
    /// PEFRL through a strong index. The CPU's is in `f64` ([`crate::march::Full`]).
    Pefrl,
    /// Runge-Kutta-Nystroem by Sharma, Kumar and Ghatak, likewise.
    Sharma,
    /// The classical Runge-Kutta method, likewise.
    RungeKutta4,
    /// Straight rays ([`crate::march::LineOfSight`]): the CPU projects the field along the light,
    /// and frames on the device sample the projection, in `f32` as on the CPU.
    LineOfSight,
}

impl Method {
    /// All methods.
    pub const ALL: [Method; 6] = [
        Method::Verlet,
        Method::Euler,
        Method::Pefrl,
        Method::Sharma,
        Method::RungeKutta4,
        Method::LineOfSight,
    ];

    /// Samples of the field per step.
    pub(super) fn samples(self) -> usize {
        match self {
            Method::Verlet | Method::Euler | Method::LineOfSight => 1,
            Method::Sharma => 3,
            Method::Pefrl | Method::RungeKutta4 => 4,
        }
    }
}

/// Options of the march.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GpuOptions {
    /// How rays are stepped.
    pub method: Method,
    /// Longest step, in lattice steps.
    pub step_voxels: f64,
    /// Quantities to compute besides deflection and displacement.
    pub quantities: PathQuantities,
    /// How cells without data treat light.
    pub blank: BlankCells,
    /// Skip bricks as long as the bounds on the lost deflection of a ray add up to less than this
    /// ([`crate::march::Options::skip_rad`]). Each ray skips by itself. For [`Method::Verlet`].
    pub skip_rad: f64,
    /// [`crate::march::Options::skip_opd_m`].
    pub skip_opd_m: f64,
}

impl Default for GpuOptions {
    fn default() -> Self {
        GpuOptions {
            method: Method::Verlet,
            step_voxels: 1.0,
            quantities: PathQuantities::default(),
            blank: BlankCells::Opaque,
            skip_rad: 0.0,
            skip_opd_m: 0.0,
        }
    }
}
