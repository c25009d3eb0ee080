//! The error that a mesh makes before any lattice or march: how well polynomials between its points
//! follow the flow.
//!
//! Resampling gives, beside each value, what the last degree of the polynomials adds to it
//! ([`datasets::resample::ResampledField::truncation`]). Rays through this difference, taken for a
//! gas, are bent by the difference of deflections. For thirty gases on two meshes and in two views
//! (bench's experiment `accuracy-tolerance`), errors are no larger than that difference and the
//! lattice's error together, where the mesh resolves the flow. Where it hardly does, as a shock
//! that is steeper than the cells are wide, further degrees would add more: [`further_degrees`].

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
    Some(deflection_by(&difference, view, starts))
}

/// Largest part of a deflection that counts as the last degree's: with half of it, the sum of the
/// further ones is as large as the last.
const LARGEST_PART: f64 = 0.5;

/// Factor for an error of a flow on a mesh, for the degrees beyond the last: if that adds the part
/// q to the deflections and each further one the part q of that before, all of them add up to the
/// error times 1/(1 - q).
pub(super) fn further_degrees(field: &Field, view: View, starts: &[Start], error_rad: f64) -> f64 {
    let deflection_rad = deflection_by(field, view, starts);
    let part = if deflection_rad > 0.0 { error_rad / deflection_rad } else { 0.0 };
    1.0 / (1.0 - part.clamp(0.0, LARGEST_PART))
}

/// The largest deflection by a gas, coarsely.
fn deflection_by(field: &Field, view: View, starts: &[Start]) -> f64 {
    let interpolate = Trilinear::new(field);
    let options = FullOptions { step_voxels: RESOLUTION_STEP, ..FullOptions::default() };
    let mut exits = vec![Exit::UNDISTURBED; starts.len()];
    Full::new(field, &interpolate, Verlet, view, options).trace_parallel(starts, &mut exits);
    largest_deflection(&exits)
}

/// The largest deflection of rays that are free.
pub(super) fn largest_deflection(exits: &[Exit]) -> f64 {
    exits
        .iter()
        .filter(|e| e.status == Status::Free)
        .map(|e| f64::from(e.deflection_rad[0]).hypot(f64::from(e.deflection_rad[1])))
        .fold(0.0, f64::max)
}
