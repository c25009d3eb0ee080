//! Which draws are traced and which the driver draws: rules on the state, VTK's shader programs,
//! and the probe that finds out whether an unknown vertex shader is an affine map.

pub(crate) mod affine_probe;
pub mod reasons;
pub(crate) mod rules;
pub(crate) mod vtk;
