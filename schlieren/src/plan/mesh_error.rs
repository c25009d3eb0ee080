//! The error that a mesh makes before any lattice or march: how well polynomials between its points
//! follow the flow.
//!
//! Resampling gives, beside each value, what the last degree of the polynomials adds to it
//! ([`datasets::resample::ResampledField::truncation`]). Rays through this difference, taken for a
//! gas, are bent by the difference of deflections. For thirty gases on two meshes and in two views
//! (bench's experiment `accuracy-tolerance`), errors are no larger than that difference and the
//! lattice's error together, but for a shock steeper than its tetrahedra are wide, in one view: 1.3
//! times.

use super::RESOLUTION_STEP;
use crate::field::Field;
use crate::interpolate::Trilinear;
use crate::march::{Full, FullOptions, Verlet};
use crate::path::{Exit, LightPaths, Start, Status};
use crate::view::View;

/// The largest error of deflections that the field's mesh makes, for these rays; `None` for a field
/// that comes from no mesh.
pub(super) fn mesh_error(field: &Field, view: View, starts: &[Start]) -> Option<f64> {
    let difference = field.truncation()?;
    let interpolate = Trilinear::new(&difference);
    let options = FullOptions { step_voxels: RESOLUTION_STEP, ..FullOptions::default() };
    let mut exits = vec![Exit::UNDISTURBED; starts.len()];
    Full::new(&difference, &interpolate, Verlet, view, options).trace_parallel(starts, &mut exits);
    Some(largest_deflection(&exits))
}

/// The largest deflection of rays that are free.
pub(super) fn largest_deflection(exits: &[Exit]) -> f64 {
    exits
        .iter()
        .filter(|e| e.status == Status::Free)
        .map(|e| f64::from(e.deflection_rad[0]).hypot(f64::from(e.deflection_rad[1])))
        .fold(0.0, f64::max)
}
