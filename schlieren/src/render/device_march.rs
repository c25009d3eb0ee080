//! Chooses the march of a scene for the GPU: by name, or by the plan.

use super::planned::Choice;
use crate::field::Field;
use crate::gpu::{GpuPaths, Method};
use crate::interpolate::Interpolant;
use crate::march::FieldCache;
use crate::media::Bend;
use crate::plan::{MeasuredError, Mode, Plan, Request};
use crate::scene::MarchSpec;
use crate::view::View;

/// A march of the GPU.
pub(super) struct DeviceMarch {
    pub(super) name: &'static str,
    pub(super) method: Method,
    pub(super) interpolant: Interpolant,
    pub(super) step_voxels: f64,
    /// How its rays bend, for media.
    pub(super) bend: Bend,
    /// The plan; `None` for marches for comparison, which only a name selects.
    pub(super) plan: Option<Plan>,
    /// The plan's error, if it was measured.
    pub(super) achieved: Option<MeasuredError>,
}

/// A march that only its name selects.
fn for_comparison(name: &str) -> Option<(&'static str, Method, Bend)> {
    match name {
        "euler" => Some(("euler", Method::Euler, Bend::Paraxial)),
        "sharma" => Some(("sharma", Method::Sharma, Bend::Full)),
        "rk4" => Some(("rk4", Method::RungeKutta4, Bend::Full)),
        _ => None,
    }
}

impl DeviceMarch {
    /// The march that a scene names, or that follows from its plan.
    pub(super) fn new(
        march: &MarchSpec,
        plan: Plan,
        field: &Field,
        view: View,
        measured_rays: Option<usize>,
        cache: &FieldCache,
    ) -> DeviceMarch {
        let request = plan.request;
        if let Some((name, method, bend)) = march.method.as_deref().and_then(for_comparison) {
            return DeviceMarch {
                name,
                method,
                interpolant: request.interpolant.unwrap_or_default(),
                step_voxels: request.step_voxels.unwrap_or(1.0),
                bend,
                plan: None,
                achieved: None,
            };
        }
        // The error is measured with the CPU's march. Straight rays may become bent ones; besides,
        // only steps and interpolant can be refined: the GPU has no finer arithmetic. A plan makes
        // PEFRL with the spline only.
        let refined = |plan: Plan, mode, rays| {
            let here = Plan { request: Request { mode, ..request }, ..plan };
            here.within_tolerance(field, view, rays, cache)
        };
        let by_name = plan.mode == Mode::Full && plan.interpolant != Interpolant::BSpline;
        let (plan, achieved) = match measured_rays.filter(|_| !by_name) {
            None => (plan, None),
            Some(rays) if plan.mode == Mode::LineOfSight => {
                let mut best = refined(plan, request.mode, rays);
                if best.0.mode == Mode::Full {
                    let mode = Some(Mode::Paraxial);
                    let bent = Request { mode, ..request };
                    let bounds = plan.derivative_bounds;
                    best = refined(Plan::from_derivative_bounds(field, bent, bounds), mode, rays);
                }
                (Plan { request, ..best.0 }, Some(best.1))
            }
            Some(rays) => {
                let (refined, error) = refined(plan, Some(plan.mode), rays);
                (Plan { request, ..refined }, Some(error))
            }
        };
        let (name, method) = match plan.mode {
            Mode::Full => ("pefrl", Method::Pefrl),
            Mode::Paraxial => ("verlet", Method::Verlet),
            Mode::LineOfSight => ("line-of-sight", Method::LineOfSight),
        };
        DeviceMarch {
            name,
            method,
            interpolant: plan.interpolant,
            step_voxels: plan.step_voxels,
            bend: plan.mode.into(),
            plan: Some(plan),
            achieved,
        }
    }

    /// Measures the error again, with the device's own rays, where these are in other precision
    /// than those of the plan.
    pub(super) fn measure(
        &mut self,
        paths: &GpuPaths<'_>,
        field: &Field,
        rays: usize,
        cache: &FieldCache,
    ) {
        if let (Method::Pefrl, Some(plan), Some(known)) = (self.method, self.plan, self.achieved) {
            self.achieved = Some(plan.measure_paths(known, paths, field, rays, cache));
        }
    }

    /// What another wavelength may repeat.
    pub(super) fn choice(&self) -> Option<Choice> {
        self.plan.map(Choice::Lattice)
    }
}
