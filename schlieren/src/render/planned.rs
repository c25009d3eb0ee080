//! Light paths with their description and measured accuracy.
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
}

impl<'a> PlannedPaths<'a> {
    pub(super) fn new(
        paths: Box<dyn LightPaths + 'a>,
        description: String,
        achieved: Option<MeasuredError>,
        request: &Request,
        (bend, step_voxels): (Bend, f64),
    ) -> PlannedPaths<'a> {
        let warnings = achieved.map_or(Vec::new(), |a| accuracy_warnings(&a, request));
        PlannedPaths {
            paths,
            description,
            error_rad: achieved.map(|a| a.max_rad),
            resolution_error_rad: achieved.map(|a| a.resolution_rad).filter(|r| r.is_finite()),
            warnings,
            bend,
            step_voxels,
            media_rays: Arc::default(),
            choice: None,
            cell_work: None,
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

/// What keeps the deflections from the tolerance, with cures.
fn accuracy_warnings(achieved: &MeasuredError, request: &Request) -> Vec<String> {
    let tolerance_rad = request.tolerance_rad;
    let MeasuredError { max_rad, resolution_rad, .. } = *achieved;
    let mut warnings = Vec::new();
    if max_rad > tolerance_rad {
        let [error, tolerance] = told_apart(max_rad, tolerance_rad);
        let set = what_is_set(request).join(", ");
        let cause = if resolution_rad > tolerance_rad {
            "the flow has structures that its lattice does not resolve: smooth shocks \
             (flow.smoothing_nodes, --smoothing) or use a finer lattice"
                .to_owned()
        } else if set.is_empty() {
            "the plan has no finer march: use a larger tolerance (march.tolerance_rad, \
             --tolerance)"
                .to_owned()
        } else {
            format!(
                "the lattice resolves the flow, and what is set limits the march: leave {set} to \
                 the plan, or use a larger tolerance (march.tolerance_rad, --tolerance)"
            )
        };
        warnings.push(format!(
            "deflections are off by up to {error} rad, above the tolerance of {tolerance} rad; \
             {cause}"
        ));
    }
    if resolution_rad.is_finite() && resolution_rad > tolerance_rad {
        let [error, tolerance] = told_apart(resolution_rad, tolerance_rad);
        warnings.push(format!(
            "the flow's own lattice limits deflections to about {error} rad, above the tolerance \
             of {tolerance} rad, with any march: use a finer lattice, smoother shocks \
             (flow.smoothing_nodes, --smoothing) or a larger tolerance (march.tolerance_rad, \
             --tolerance)"
        ));
    }
    warnings
}

/// What the request sets, as keys of a scene and options of the program.
fn what_is_set(request: &Request) -> Vec<&'static str> {
    let set = [
        (request.mode.is_some(), "march.method (--march)"),
        (request.interpolant.is_some(), "march.interpolant (--interpolant)"),
        (request.step_voxels.is_some(), "march.step_voxels (--step)"),
        (request.skip_rad > 0.0, "march.skip_rad (--skip)"),
    ];
    set.into_iter().filter(|s| s.0).map(|s| s.1).collect()
}

/// Two different numbers with as many digits as tell them apart, two at least.
fn told_apart(a: f64, b: f64) -> [String; 2] {
    (1..16)
        .map(|digits| [a, b].map(|x| format!("{x:.digits$e}")))
        .find(|[a, b]| a != b)
        .unwrap_or_else(|| [a, b].map(|x| format!("{x:e}")))
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

#[cfg(test)]
mod tests {
    use super::*;

    fn warnings_of(max_rad: f64, resolution_rad: f64, set: Request) -> Vec<String> {
        let error = MeasuredError { max_rad, rms_rad: 0.0, resolution_rad, rays: 400 };
        accuracy_warnings(&error, &Request { tolerance_rad: 1e-7, ..set })
    }

    fn warnings(max_rad: f64, resolution_rad: f64) -> Vec<String> {
        warnings_of(max_rad, resolution_rad, Request::default())
    }

    #[test]
    fn what_is_set_is_named_where_it_limits_the_march() {
        let set = Request { step_voxels: Some(8.0), skip_rad: 1e-9, ..Request::default() };
        let limited = warnings_of(2e-7, 8e-9, set);
        assert!(limited[0].contains("leave march.step_voxels (--step), march.skip_rad (--skip"));
        assert!(warnings(2e-7, 8e-9)[0].contains("no finer march"));
    }

    #[test]
    fn warnings_do_not_contradict_themselves() {
        let both = warnings(1.004e-7, 1.0003e-7);
        assert!(both[0].contains("1.004e-7 rad, above the tolerance of 1.000e-7 rad"), "{both:?}");
        assert!(both[1].contains("1.0003e-7 rad, above the tolerance of 1.0000e-7"), "{both:?}");
        // Where the lattice resolves the flow, smoothing it would not help.
        let march = warnings(2e-7, 8e-9);
        assert!(march.len() == 1 && !march[0].contains("smooth"), "{march:?}");
        let lattice = warnings(2e-7, 3e-7);
        assert!(lattice.len() == 2 && lattice[0].contains("smooth shocks"), "{lattice:?}");
        assert!(warnings(1e-7, 1e-7).is_empty() && warnings(9e-8, f64::INFINITY).is_empty());
    }
}
