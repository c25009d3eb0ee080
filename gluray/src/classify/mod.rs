//! Decides which draws are traced and which the driver draws: rules on the state, VTK's shader
//! programs, the probe that finds out whether an unknown vertex shader is an affine map, and the
//! prices of both sides where either makes the same picture.

pub(crate) mod affine_probe;
pub(crate) mod cost;
pub mod reasons;
pub(crate) mod routing;
pub(crate) mod rules;
pub(crate) mod vtk;

use affine_probe::AffineProbes;
use rules::Classification;
use vtk::VtkPrograms;

/// The classification of draws in the present state, and the programs of a context.
pub(crate) struct Classifier {
    /// The classification of filled primitives in the state of the last snapshot.
    pub(crate) classification: Classification,
    pub(crate) probes: AffineProbes,
    pub(crate) programs: VtkPrograms,
}

impl Default for Classifier {
    fn default() -> Classifier {
        Classifier {
            classification: Classification::Pass("nothing drawn yet"),
            probes: AffineProbes::default(),
            programs: VtkPrograms::default(),
        }
    }
}
