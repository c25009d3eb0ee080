//! Light paths with their description and measured accuracy.
use super::accuracy_warning::accuracy_warning;
use crate::interpolate::Interpolant;
use crate::march::CellWork;
use crate::media::Bend;
use crate::path::LightPaths;
use crate::plan::{MeasuredError, Plan, Request};
use crate::technique::bos::ReversedPaths;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// A plan's choices, for repeating them.
#[derive(Debug, Clone, Copy)]
#[allow(clippy::large_enum_variant, reason = "one exists for each image, and is copied")]
pub(super) enum Choice {
    /// The march through a lattice.
    Lattice(Plan),
    /// The march through cells.
    Cells { steps: u32 },
}

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
    /// Estimated error of deflections due to the mesh that the flow comes from. `None` when it was
    /// not estimated, and for data on a lattice.
    pub mesh_error_rad: Option<f64>,
    /// Warnings, one sentence each.
    pub warnings: Vec<String>,
    /// How the paths bend and their step, for integrating media along them.
    pub(super) bend: Bend,
    pub(super) step_voxels: f64,
    /// Number of rays along which media were integrated.
    pub(super) media_rays: Arc<AtomicU64>,
    /// What another wavelength may repeat; `None` for marches for comparison.
    pub(super) choice: Option<Choice>,
    /// The work on the cells of a mesh; `None` on a lattice.
    pub(super) cell_work: Option<Arc<CellWork>>,
    /// The same paths, if the whole frame can be computed where they are.
    #[cfg(feature = "gpu")]
    pub(super) on_device: Option<Arc<crate::gpu::GpuPaths<'a>>>,
    /// What dims the light there.
    #[cfg(feature = "gpu")]
    pub(super) media_on_device: Option<crate::gpu::FrameMedia<'a>>,
}

impl<'a> PlannedPaths<'a> {
    pub(super) fn new(
        paths: Box<dyn LightPaths + 'a>,
        description: String,
        achieved: Option<MeasuredError>,
        request: &Request,
        (bend, step_voxels): (Bend, f64),
    ) -> PlannedPaths<'a> {
        let warnings = achieved.and_then(|a| accuracy_warning(&a, request)).into_iter().collect();
        PlannedPaths {
            paths,
            description,
            error_rad: achieved.map(|a| a.max_rad),
            resolution_error_rad: achieved.map(|a| a.resolution_rad).filter(|r| r.is_finite()),
            mesh_error_rad: achieved.and_then(|a| a.mesh_rad),
            warnings,
            bend,
            step_voxels,
            media_rays: Arc::default(),
            choice: None,
            cell_work: None,
            #[cfg(feature = "gpu")]
            on_device: None,
            #[cfg(feature = "gpu")]
            media_on_device: None,
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

/// Warning that skipping has no effect, with the reason.
pub(super) fn skipping_has_no_effect(march: &str) -> String {
    let why = match march {
        "line-of-sight" => {
            "the tolerance lets the plan use straight rays, which need no steps through the flow; \
             force --march verlet to compare"
        }
        _ => "the index is so strong that the plan uses the full march, which samples every step",
    };
    format!("march.skip_rad has no effect: {why}")
}
