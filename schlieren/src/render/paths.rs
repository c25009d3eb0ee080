//! Which march takes the light through, and how exact it is: [`crate::plan`] picks what the scene leaves open by bounds from the tolerance, and measures
//! what was achieved. Marches that no plan picks, because they are for comparison, are made here.

use super::on_gpu::on_gpu;
use super::{RenderError, TestSection};
use crate::field::Field;
use crate::interpolate::{BSpline, Interpolant, Interpolate, Trilinear, TrilinearGradient};
use crate::march::{
    BlankCells, Deviational, Full, FullOptions, Integrator, Kept, Options, Pefrl, RungeKutta4, Scheme, Sharma,
};
use crate::media::Bend;
use crate::path::{Exit, LightPaths, Start, Wanted};
use crate::plan::{Achieved, Mode, Plan, Request};
use crate::scene::Scene;
use crate::technique::bos::Reversed;
use crate::view::View;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Names of marches, the cheapest first.
pub const MARCHES: [&str; 6] = ["line-of-sight", "verlet", "euler", "pefrl", "sharma", "rk4"];
/// Names of interpolants, the default first.
pub const INTERPOLANTS: [&str; 3] = ["b-spline", "trilinear", "trilinear-gradient"];

/// Rays that are traced twice to measure a plan's error.
const MEASURED_RAYS: usize = 256;

/// The error of the phase that leaving out eight steps may cost, in waves: a hundred of such stretches are a thousandth of a wave.
const SKIPPED_WAVES: f64 = 1e-5;

/// Paths of light through one of the fields, and what is known of their accuracy.
pub struct Planned<'a> {
    /// The paths.
    pub paths: Box<dyn LightPaths + 'a>,
    /// The march, the interpolant and the step, in words.
    pub description: String,
    /// Measured error of a deflection by march, interpolant and step; `None` when it was not to be measured, or the march is one for comparison.
    pub error_rad: Option<f64>,
    /// Estimate of what the flow's own lattice leaves open.
    pub resolution_error_rad: Option<f64>,
    /// What should be known, a sentence each.
    pub warnings: Vec<String>,
    /// How the paths bend, and their step: for what goes the same way beside them.
    pub(super) bend: Bend,
    pub(super) step_voxels: f64,
    /// Rays that were walked for what the medium does to their light.
    pub(super) media_rays: Arc<AtomicU64>,
}

impl TestSection {
    /// Light paths through field `line` as the scene's march says. `against_light`: traced from the camera. `measure` traces some rays with everything
    /// refined, to know the error.
    pub fn paths(
        &self,
        scene: &Scene,
        line: usize,
        wanted: Wanted,
        against_light: bool,
        measure: bool,
    ) -> Result<Planned<'_>, RenderError> {
        let march = &scene.march;
        let known = |name: &Option<String>, names: &[&'static str], key| match name {
            None => Ok(None),
            Some(n) => match names.iter().find(|k| **k == n.as_str()) {
                Some(k) => Ok(Some(*k)),
                None => Err(RenderError::Unknown { key, name: n.clone(), names: names.join(", ") }),
            },
        };
        let method = known(&march.method, &MARCHES, "march.method")?;
        let interpolant =
            known(&march.interpolant, &INTERPOLANTS, "march.interpolant")?.map(|name| match name {
                "trilinear" => Interpolant::Trilinear,
                "trilinear-gradient" => Interpolant::TrilinearGradient,
                _ => Interpolant::BSpline,
            });
        let field = &self.fields[line];
        let for_once = Kept::default();
        let kept = self.kept.get(line).unwrap_or(&for_once);
        let view = if against_light { Reversed::view(&self.view) } else { self.view };
        let with = |mode| Request {
            tolerance_rad: march.tolerance_rad,
            direction: Some(view.forward),
            mode,
            interpolant,
            step_voxels: march.step_voxels,
            wanted,
            blank: BlankCells::default(),
            skip_rad: march.skip_rad,
            skip_opd_m: SKIPPED_WAVES * scene.light.wavelengths_nm[line] * 1e-9,
        };

        // On the GPU, if wanted and possible.
        let mode = method.map(|name| match name {
            "line-of-sight" => Mode::LineOfSight,
            "verlet" => Mode::Paraxial,
            _ => Mode::Full,
        });
        let planned = on_gpu(march, field, view, with(mode), measure.then_some(MEASURED_RAYS), kept)?;
        let why_not = match planned {
            Ok(mut planned) => {
                if !scene.media.dims_light().is_empty() {
                    planned.warnings.push("absorption and rotation are collected on the CPU".into());
                }
                return Ok(self.dimmed(scene, line, view, planned)?.seen(against_light));
            }
            Err(why_not) => why_not,
        };

        let mut in_vain = None;
        // For comparison: by name only, never picked.
        let (paths, description, achieved, walked) = if let Some(name @ ("euler" | "sharma" | "rk4")) = method
        {
            let interpolant = interpolant.unwrap_or_default();
            let step_voxels = march.step_voxels.unwrap_or(1.0);
            let paths = compared(name, field, view, interpolant, step_voxels, wanted);
            let bend = if name == "euler" { Bend::Paraxial } else { Bend::Full };
            (paths, described(name, interpolant, step_voxels), None, (bend, step_voxels))
        } else {
            let plan = Plan::from_roughness(field, with(mode), kept.roughness(field));
            let walked = (Bend::from(plan.mode), plan.step_voxels);
            // PEFRL is made with the spline only.
            if plan.mode == Mode::Full && interpolant.is_some_and(|i| i != Interpolant::BSpline) {
                let step = plan.step_voxels;
                let options = FullOptions { step_voxels: step, wanted, ..FullOptions::default() };
                let paths = full(field, view, plan.interpolant, Pefrl, options);
                in_vain = (march.skip_rad > 0.0).then(|| left_nothing_out("pefrl"));
                (paths, described("pefrl", plan.interpolant, step), None, walked)
            } else {
                let name = match plan.mode {
                    Mode::LineOfSight => "line-of-sight",
                    Mode::Paraxial => "verlet",
                    Mode::Full => "pefrl",
                };
                let achieved = measure.then(|| plan.measure_with(field, view, MEASURED_RAYS, kept));
                let mut description = described(name, plan.interpolant, plan.step_voxels);
                if march.skip_rad > 0.0 {
                    match plan.mode {
                        Mode::Paraxial => {
                            description += &format!(", leaving out at most {:e} rad", march.skip_rad)
                        }
                        Mode::LineOfSight | Mode::Full => in_vain = Some(left_nothing_out(name)),
                    }
                }
                (plan.paths_with(field, view, kept), description, achieved, walked)
            }
        };
        let mut planned = Planned::new(paths, description, achieved, march.tolerance_rad, walked);
        planned.warnings.extend(why_not);
        planned.warnings.extend(in_vain);
        Ok(self.dimmed(scene, line, view, planned)?.seen(against_light))
    }
}

impl<'a> Planned<'a> {
    pub(super) fn new(
        paths: Box<dyn LightPaths + 'a>,
        description: String,
        achieved: Option<Achieved>,
        tolerance_rad: f64,
        (bend, step_voxels): (Bend, f64),
    ) -> Planned<'a> {
        let mut warnings = Vec::new();
        if let Some(a) = achieved.filter(|a| a.max_rad > tolerance_rad) {
            warnings.push(format!(
                "deflections are off by up to {:.1e} rad, above the tolerance of {tolerance_rad:.1e} rad; the flow has structures that its lattice does not resolve: smooth shocks (flow.smoothing_nodes) or take a finer lattice",
                a.max_rad
            ));
        }
        if let Some(a) = achieved.filter(|a| a.resolution_rad.is_finite() && a.resolution_rad > tolerance_rad)
        {
            warnings.push(format!(
                "the flow's own lattice leaves deflections open by about {:.1e} rad, above the tolerance of {tolerance_rad:.1e} rad, whatever march is taken: take a finer lattice, smooth shocks (flow.smoothing_nodes), or ask for less (march.tolerance_rad)",
                a.resolution_rad
            ));
        }
        Planned {
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

    /// Rays that were walked through media since this was last asked.
    pub(super) fn take_media_rays(&self) -> u64 {
        self.media_rays.swap(0, Ordering::Relaxed)
    }

    /// The same, seen from the film when `against_light`.
    fn seen(self, against_light: bool) -> Planned<'a> {
        let paths = self.paths;
        let paths = if against_light { Box::new(Reversed::new(paths)) as Box<dyn LightPaths> } else { paths };
        Planned { paths, ..self }
    }
}

/// Why skipping was asked for in vain.
fn left_nothing_out(march: &str) -> String {
    let why = match march {
        "line-of-sight" => {
            "the tolerance lets the plan take straight rays, which need no steps through the flow; force --march verlet to compare"
        }
        _ => "the index is so strong that the plan takes the full march, which samples every step",
    };
    format!("march.skip_rad changes nothing: {why}")
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

/// A march that is there to compare with.
fn compared<'a>(
    name: &str,
    field: &'a Field,
    view: View,
    interpolant: Interpolant,
    step_voxels: f64,
    wanted: Wanted,
) -> Box<dyn LightPaths + 'a> {
    let options = FullOptions { step_voxels, wanted, ..FullOptions::default() };
    match name {
        "sharma" => full(field, view, interpolant, Sharma, options),
        "rk4" => full(field, view, interpolant, RungeKutta4, options),
        _ => {
            let options = Options { scheme: Scheme::Euler, step_voxels, wanted, ..Options::default() };
            Box::new(Deviational::new(field, view, interpolant, options))
        }
    }
}

fn full<'a, G: Integrator + Copy + 'a>(
    field: &'a Field,
    view: View,
    interpolant: Interpolant,
    integrator: G,
    options: FullOptions,
) -> Box<dyn LightPaths + 'a> {
    match interpolant {
        Interpolant::BSpline => {
            Box::new(Owned { field, interpolate: BSpline::new(field), integrator, view, options })
        }
        Interpolant::Trilinear => {
            Box::new(Owned { field, interpolate: Trilinear::new(field), integrator, view, options })
        }
        Interpolant::TrilinearGradient => {
            Box::new(Owned { field, interpolate: TrilinearGradient::new(field), integrator, view, options })
        }
    }
}

/// [`Full`] together with the interpolant that it borrows.
struct Owned<'a, I, G> {
    field: &'a Field,
    interpolate: I,
    integrator: G,
    view: View,
    options: FullOptions,
}

impl<I: Interpolate, G: Integrator + Copy> LightPaths for Owned<'_, I, G> {
    fn trace(&self, starts: &[Start], exits: &mut [Exit]) {
        Full::new(self.field, &self.interpolate, self.integrator, self.view, self.options)
            .trace(starts, exits);
    }

    fn view(&self) -> &View {
        &self.view
    }

    fn wanted(&self) -> Wanted {
        self.options.wanted
    }

    fn difference_step_m(&self) -> f64 {
        Full::new(self.field, &self.interpolate, self.integrator, self.view, self.options).difference_step_m()
    }
}
