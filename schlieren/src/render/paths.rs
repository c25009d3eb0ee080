//! Selects the march of a scene and measures its accuracy. [`crate::plan`] chooses from the
//! tolerance what the scene leaves open, and measures the error. Marches for comparison, which no
//! plan chooses, are made here.

use super::on_cells::{self, Steps};
use super::on_gpu::on_gpu;
use super::planned::{Choice, PlannedPaths, described, skipping_has_no_effect};
use super::section::Caches;
use super::{RenderError, TestSection};
use crate::field::Field;
use crate::interpolate::Interpolant;
use crate::march::{
    BlankCells, Deviational, FieldInterpolant, FullOfField, FullOptions, Integrator, Options,
    Pefrl, RungeKutta4, Scheme, Sharma,
};
use crate::media::Bend;
use crate::path::{LightPaths, PathQuantities};
use crate::plan::{Mode, Plan, Request};
use crate::scene::{Device, Scene};
use crate::technique::bos::ReversedPaths;
use crate::view::View;

/// Names of marches, the cheapest first.
pub const MARCHES: [&str; 6] = ["line-of-sight", "verlet", "euler", "pefrl", "sharma", "rk4"];
/// Names of interpolants, the default first.
pub const INTERPOLANTS: [&str; 3] = ["b-spline", "trilinear", "trilinear-gradient"];

/// Number of rays that are traced twice to measure a plan's error.
const MEASURED_RAYS: usize = 256;

/// Largest error of the phase from skipping eight steps, in waves: a hundred of such stretches add
/// up to a thousandth of a wave.
const SKIPPED_WAVES: f64 = 1e-5;

/// What is known of the accuracy of paths before they are traced.
#[derive(Debug, Clone, Copy)]
#[allow(clippy::large_enum_variant, reason = "one exists for each image, and is copied")]
pub(super) enum Accuracy {
    /// The bounds of the plan.
    Bounded,
    /// Its error, measured with some rays. It is refined until that is within the tolerance.
    Measured,
    /// That of a plan for another wavelength or other quantities, which this one repeats.
    Known(Choice),
}

impl Accuracy {
    pub(super) fn measured(measure: bool) -> Accuracy {
        if measure { Accuracy::Measured } else { Accuracy::Bounded }
    }
}

impl TestSection {
    /// Light paths through field `line` with the scene's march. With `against_light` they are
    /// traced from the camera. With `measure` some rays are traced with everything refined, to
    /// measure the error, and the plan is refined until that is within the tolerance
    /// ([`Plan::within_tolerance`]).
    ///
    /// # Errors
    /// If the scene names a march or an interpolant that does not exist, requests a GPU that is not
    /// available, or needs a property of the medium that the test section lacks.
    pub fn paths(
        &self,
        scene: &Scene,
        line: usize,
        quantities: PathQuantities,
        against_light: bool,
        measure: bool,
    ) -> Result<PlannedPaths<'_>, RenderError> {
        self.paths_of(scene, line, quantities, against_light, Accuracy::measured(measure))
    }

    /// [`TestSection::paths`], also those of a plan that was measured before.
    pub(super) fn paths_of(
        &self,
        scene: &Scene,
        line: usize,
        quantities: PathQuantities,
        against_light: bool,
        accuracy: Accuracy,
    ) -> Result<PlannedPaths<'_>, RenderError> {
        let measure = matches!(accuracy, Accuracy::Measured);
        let march = &scene.march;
        let view = if against_light { ReversedPaths::view(&self.view) } else { self.view };
        if let Some(gas) = self.cells.get(line) {
            let steps = match accuracy {
                Accuracy::Known(Choice::Cells { steps }) => Steps::Known(steps),
                _ if measure => Steps::Measured { rays: MEASURED_RAYS },
                _ => Steps::One,
            };
            let mut planned = on_cells::planned(gas, view, quantities, march.tolerance_rad, steps);
            if march.device == Device::Auto {
                planned.warnings.push(
                    "computed on the CPU: the GPU traces light on lattices, not on cells".into(),
                );
            }
            return Ok(planned.in_image_frame(against_light));
        }
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
        let temporary = Caches::default();
        let caches = self.caches.get(line).unwrap_or(&temporary);
        let cache = &caches.field;
        let with = |mode| Request {
            tolerance_rad: march.tolerance_rad,
            direction: Some(view.forward),
            mode,
            interpolant,
            step_voxels: march.step_voxels,
            quantities,
            blank: BlankCells::default(),
            skip_rad: march.skip_rad,
            skip_opd_m: SKIPPED_WAVES * scene.light.wavelengths_nm[line] * 1e-9,
        };

        // What is repeated is as good as forced.
        let known = match accuracy {
            Accuracy::Known(Choice::Lattice(plan)) => Some(plan),
            _ => None,
        };
        let with = |mode| Request {
            interpolant: known.map_or(interpolant, |p| Some(p.interpolant)),
            step_voxels: known.map_or(march.step_voxels, |p| Some(p.step_voxels)),
            ..with(mode)
        };

        // Uses the GPU if wanted and possible.
        let mode = method.map(|name| match name {
            "line-of-sight" => Mode::LineOfSight,
            "verlet" => Mode::Paraxial,
            _ => Mode::Full,
        });
        let mode = known.map_or(mode, |p| Some(p.mode));
        let planned =
            on_gpu(march, field, view, with(mode), measure.then_some(MEASURED_RAYS), caches)?;
        let why_not = match planned {
            Ok(mut planned) => {
                if quantities.opd && planned.bend == Bend::Full {
                    let wavelength_m = scene.light.wavelengths_nm[line] * 1e-9;
                    let longest_m = cache.derivative_bounds(field).eps * field.size_m().length();
                    planned.warnings.extend(vague_fringes(longest_m / wavelength_m));
                }
                return Ok(self
                    .attenuated(scene, line, view, planned)?
                    .in_image_frame(against_light));
            }
            Err(why_not) => why_not,
        };

        let (mut skip_warning, mut choice) = (None, None);
        // Marches for comparison are selected by name only.
        let (paths, description, achieved, media_step) =
            if let Some(name @ ("euler" | "sharma" | "rk4")) = method {
                let interpolant = interpolant.unwrap_or_default();
                let step_voxels = march.step_voxels.unwrap_or(1.0);
                let paths =
                    comparison_march(name, field, view, interpolant, step_voxels, quantities);
                let bend = if name == "euler" { Bend::Paraxial } else { Bend::Full };
                (paths, described(name, interpolant, step_voxels), None, (bend, step_voxels))
            } else {
                let mut plan =
                    Plan::from_derivative_bounds(field, with(mode), cache.derivative_bounds(field));
                // A plan makes PEFRL with the spline only.
                let by_name = plan.mode == Mode::Full
                    && interpolant.is_some_and(|i| i != Interpolant::BSpline);
                let mut achieved = None;
                if measure && !by_name {
                    let (refined, error) = plan.within_tolerance(field, view, MEASURED_RAYS, cache);
                    (plan, achieved) = (refined, Some(error));
                }
                choice = Some(Choice::Lattice(plan));
                let media_step = (Bend::from(plan.mode), plan.step_voxels);
                if by_name {
                    let step = plan.step_voxels;
                    let options =
                        FullOptions { step_voxels: step, quantities, ..FullOptions::default() };
                    let paths = full(field, view, plan.interpolant, Pefrl, options);
                    skip_warning = (march.skip_rad > 0.0).then(|| skipping_has_no_effect("pefrl"));
                    (paths, described("pefrl", plan.interpolant, step), None, media_step)
                } else {
                    let name = match plan.mode {
                        Mode::LineOfSight => "line-of-sight",
                        Mode::Paraxial => "verlet",
                        Mode::Full => "pefrl",
                    };
                    let mut description = described(name, plan.interpolant, plan.step_voxels);
                    if march.skip_rad > 0.0 {
                        match plan.mode {
                            Mode::Paraxial => {
                                description +=
                                    &format!(", skipping at most {:e} rad", march.skip_rad)
                            }
                            Mode::LineOfSight | Mode::Full => {
                                skip_warning = Some(skipping_has_no_effect(name))
                            }
                        }
                    }
                    (plan.paths_with(field, view, cache), description, achieved, media_step)
                }
            };
        let mut planned = PlannedPaths::new(paths, description, achieved, &with(mode), media_step);
        planned.choice = choice;
        planned.warnings.extend(why_not);
        planned.warnings.extend(skip_warning);
        Ok(self.attenuated(scene, line, view, planned)?.in_image_frame(against_light))
    }
}

/// Error of optical paths by a full march on a GPU, in single precision, as part of the path.
const DEVICE_PATH_ERROR: f64 = 2e-6;
/// Error of a phase that no eye sees, in waves.
const UNSEEN_WAVES: f64 = 0.1;

/// The warning about fringes of so many waves on a GPU.
fn vague_fringes(waves: f64) -> Option<String> {
    let error_waves = DEVICE_PATH_ERROR * waves;
    (error_waves > UNSEEN_WAVES).then(|| {
        format!(
            "optical paths are up to {waves:.1e} waves long, and the GPU's single precision is off \
             by up to {error_waves:.1} waves of it: fringes may be shifted; compute on the CPU \
             (--device cpu)"
        )
    })
}

/// A march for comparison.
fn comparison_march<'a>(
    name: &str,
    field: &'a Field,
    view: View,
    interpolant: Interpolant,
    step_voxels: f64,
    quantities: PathQuantities,
) -> Box<dyn LightPaths + 'a> {
    let options = FullOptions { step_voxels, quantities, ..FullOptions::default() };
    match name {
        "sharma" => full(field, view, interpolant, Sharma, options),
        "rk4" => full(field, view, interpolant, RungeKutta4, options),
        _ => {
            let options =
                Options { scheme: Scheme::Euler, step_voxels, quantities, ..Options::default() };
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
    let interpolant = FieldInterpolant::new(field, interpolant);
    Box::new(FullOfField::new(field, interpolant, integrator, view, options))
}
