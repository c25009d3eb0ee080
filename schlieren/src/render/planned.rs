//! Light paths with their description and measured accuracy.
use crate::interpolate::Interpolant;
use crate::media::Bend;
use crate::path::LightPaths;
use crate::plan::MeasuredError;
use crate::technique::bos::ReversedPaths;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Light paths through one of the fields, with their measured accuracy.
pub struct PlannedPaths<'a> {
    /// The paths.
    pub paths: Box<dyn LightPaths + 'a>,
    /// Description of the march, the interpolant and the step.
    pub description: String,
    /// Measured error of deflections due to march, interpolant and step. `None` when it was not
    /// measured or the march is for comparison.
    pub error_rad: Option<f64>,
    /// Estimated error of deflections due to the flow's own lattice.
    pub resolution_error_rad: Option<f64>,
    /// Warnings, one sentence each.
    pub warnings: Vec<String>,
    /// How the paths bend and their step, for integrating media along them.
    pub(super) bend: Bend,
    pub(super) step_voxels: f64,
    /// Number of rays along which media were integrated.
    pub(super) media_rays: Arc<AtomicU64>,
}

impl<'a> PlannedPaths<'a> {
    pub(super) fn new(
        paths: Box<dyn LightPaths + 'a>,
        description: String,
        achieved: Option<MeasuredError>,
        tolerance_rad: f64,
        (bend, step_voxels): (Bend, f64),
    ) -> PlannedPaths<'a> {
        let mut warnings = Vec::new();
        if let Some(a) = achieved.filter(|a| a.max_rad > tolerance_rad) {
            warnings.push(format!(
                "deflections are off by up to {:.1e} rad, above the tolerance of \
                 {tolerance_rad:.1e} rad; the flow has structures that its lattice does not \
                 resolve: smooth shocks (flow.smoothing_nodes) or use a finer lattice",
                a.max_rad
            ));
        }
        if let Some(a) =
            achieved.filter(|a| a.resolution_rad.is_finite() && a.resolution_rad > tolerance_rad)
        {
            warnings.push(format!(
                "the flow's own lattice limits deflections to about {:.1e} rad, above the \
                 tolerance of {tolerance_rad:.1e} rad, with any march: use a finer lattice, \
                 smoother shocks (flow.smoothing_nodes) or a larger tolerance \
                 (march.tolerance_rad)",
                a.resolution_rad
            ));
        }
        PlannedPaths {
            paths,
            description,
            error_rad: achieved.map(|a| a.max_rad),
            resolution_error_rad: achieved.map(|a| a.resolution_rad).filter(|r| r.is_finite()),
            warnings,
            bend,
            step_voxels,
            media_rays: Arc::default(),
        }
    }

    /// Number of rays along which media were integrated since the last call.
    pub(super) fn take_media_rays(&self) -> u64 {
        self.media_rays.swap(0, Ordering::Relaxed)
    }

    /// The same paths, converted to the image's frame when `against_light`.
    pub(super) fn in_image_frame(self, against_light: bool) -> PlannedPaths<'a> {
        let paths = self.paths;
        let paths = if against_light {
            Box::new(ReversedPaths::new(paths)) as Box<dyn LightPaths>
        } else {
            paths
        };
        PlannedPaths { paths, ..self }
    }
}

pub(super) fn described(name: &str, interpolant: Interpolant, step_voxels: f64) -> String {
    let interpolant = match interpolant {
        Interpolant::BSpline => "b-spline",
        Interpolant::Trilinear => "trilinear",
        Interpolant::TrilinearGradient => "trilinear-gradient",
    };
    match name {
        "line-of-sight" => format!("line-of-sight, {interpolant}"),
        _ => format!("{name}, {interpolant}, steps of {step_voxels} voxel"),
    }
}
