//! Which march takes the light through, and how exact it is.
//!
//! What the scene names is taken. What it leaves open is picked by comparison over a coarse lattice of rays: the cheapest march that agrees with a finer
//! one within half the tolerance. The difference that was seen is reported as the error estimate; it knows the march's error, not that of the
//! flow's own lattice.

use super::{RenderError, TestSection};
use crate::film::Framing;
use crate::field::Field;
use crate::interpolate::{BSpline, Interpolant, Interpolate, Trilinear, TrilinearGradient};
use crate::march::{
    BlankCells, Deviational, Full, FullOptions, Integrator, LineOfSight, Options, Pefrl, RungeKutta4, Scheme, Sharma,
};
use crate::path::{Exit, LightPaths, Start, Status, Wanted};
use crate::scene::{Device, Scene};
use crate::technique::bos::Reversed;
use crate::view::View;

/// Names of marches, the cheapest first.
pub const MARCHES: [&str; 6] = ["line-of-sight", "verlet", "euler", "pefrl", "sharma", "rk4"];
/// Names of interpolants, the default first.
pub const INTERPOLANTS: [&str; 3] = ["b-spline", "trilinear", "trilinear-gradient"];

/// Paths of light through one of the fields, and what is known of their accuracy.
pub struct Planned<'a> {
    /// The paths.
    pub paths: Box<dyn LightPaths + 'a>,
    /// The march, the interpolant and the step that were picked, in words.
    pub description: String,
    /// Estimate of the march's error of a deflection; `None` when the march was forced.
    pub error_rad: Option<f64>,
    /// What should be known, a sentence each.
    pub warnings: Vec<String>,
}

/// A march with its step in voxels.
type Choice = (&'static str, f64);

/// What is tried, the cheapest first.
const LADDER: [Choice; 5] = [("line-of-sight", 1.0), ("verlet", 1.0), ("verlet", 0.5), ("verlet", 0.25), ("pefrl", 0.5)];

impl TestSection {
    /// Light paths through field `line` as the scene's march says. `against_light`: traced from the camera.
    pub fn paths(
        &self,
        scene: &Scene,
        line: usize,
        wanted: Wanted,
        against_light: bool,
    ) -> Result<Planned<'_>, RenderError> {
        let march = &scene.march;
        if march.device == Device::Gpu {
            return Err(RenderError::NoGpu);
        }
        let known = |name: &Option<String>, names: &[&'static str], key| match name {
            None => Ok(None),
            Some(n) => match names.iter().find(|k| **k == n.as_str()) {
                Some(k) => Ok(Some(*k)),
                None => Err(RenderError::Unknown { key, name: n.clone(), names: names.join(", ") }),
            },
        };
        let method = known(&march.method, &MARCHES, "march.method")?;
        let interpolant = match known(&march.interpolant, &INTERPOLANTS, "march.interpolant")? {
            Some("trilinear") => Interpolant::Trilinear,
            Some("trilinear-gradient") => Interpolant::TrilinearGradient,
            _ => Interpolant::BSpline,
        };
        let view = if against_light { Reversed::view(&self.view) } else { self.view };
        let make = |(name, step): Choice, wanted| make(&self.fields[line], view, interpolant, name, step, wanted);
        let words = |(name, step): Choice| {
            let interpolant = INTERPOLANTS[interpolant as usize];
            match name {
                "line-of-sight" => format!("line-of-sight, {interpolant}"),
                _ => format!("{name}, {interpolant}, steps of {step} voxel"),
            }
        };

        // Forced, or the first rung that agrees with the next but one (the line of sight with the first march).
        let mut warnings = Vec::new();
        let mut error_rad = None;
        let choice = match (method, march.step_voxels) {
            (Some(name), step) => (name, step.unwrap_or(if name == "pefrl" { 0.5 } else { 1.0 })),
            (None, Some(step)) => ("verlet", step),
            (None, None) => {
                let starts = self.probes();
                let mut picked = LADDER[LADDER.len() - 1];
                let mut coarse = traced(&*make(LADDER[0], Wanted::default()), &starts);
                for pair in LADDER.windows(2) {
                    let fine = traced(&*make(pair[1], Wanted::default()), &starts);
                    let difference = largest_difference(&coarse, &fine);
                    error_rad = Some(difference);
                    if difference <= 0.5 * march.tolerance_rad {
                        picked = pair[0];
                        break;
                    }
                    coarse = fine;
                }
                picked
            }
        };
        if let Some(e) = error_rad.filter(|e| *e > 0.5 * march.tolerance_rad) {
            warnings.push(format!(
                "deflections differ by up to {e:.1e} rad between the two finest marches, above half the tolerance of {:.1e} rad; the flow has structures that its lattice does not resolve: smooth shocks (flow.smoothing_nodes) or take a finer lattice",
                march.tolerance_rad
            ));
        }
        let paths = make(choice, wanted);
        let paths = if against_light { Box::new(Reversed::new(paths)) as Box<dyn LightPaths> } else { paths };
        Ok(Planned { paths, description: words(choice), error_rad, warnings })
    }

    /// A coarse lattice of rays over the field.
    fn probes(&self) -> Vec<Start> {
        const SIDE: u32 = 24;
        let [w, h] = self.sides_m();
        let framing = |pixel_m| Framing { width: SIDE, height: SIDE, pixel_m, center_m: [0.0; 2] };
        let (across, along) = (framing(w / f64::from(SIDE)).pixel_centers(), framing(h / f64::from(SIDE)).pixel_centers());
        let both = |(a, b): (&Start, &Start)| Start { position_m: [a.position_m[0], b.position_m[1]], tilt_rad: [0.0; 2] };
        across.iter().zip(&along).map(both).collect()
    }
}

fn make<'a>(
    field: &'a Field,
    view: View,
    interpolant: Interpolant,
    name: &str,
    step_voxels: f64,
    wanted: Wanted,
) -> Box<dyn LightPaths + 'a> {
    let deviational = |scheme| {
        let options = Options { scheme, step_voxels, wanted, ..Options::default() };
        Box::new(Deviational::new(field, view, interpolant, options)) as Box<dyn LightPaths + 'a>
    };
    let options = FullOptions { step_voxels, wanted, ..FullOptions::default() };
    match name {
        "line-of-sight" => Box::new(LineOfSight::new(field, view, interpolant, wanted, BlankCells::default())),
        "euler" => deviational(Scheme::Euler),
        "pefrl" => full(field, view, interpolant, Pefrl, options),
        "sharma" => full(field, view, interpolant, Sharma, options),
        "rk4" => full(field, view, interpolant, RungeKutta4, options),
        _ => deviational(Scheme::Verlet),
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
        Interpolant::BSpline => Box::new(Owned { field, interpolate: BSpline::new(field), integrator, view, options }),
        Interpolant::Trilinear => Box::new(Owned { field, interpolate: Trilinear::new(field), integrator, view, options }),
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
        Full::new(self.field, &self.interpolate, self.integrator, self.view, self.options).trace(starts, exits);
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

fn traced(paths: &dyn LightPaths, starts: &[Start]) -> Vec<Exit> {
    let mut exits = vec![Exit::UNDISTURBED; starts.len()];
    paths.trace_parallel(starts, &mut exits);
    exits
}

/// Largest difference of deflections between rays that come through in both.
fn largest_difference(a: &[Exit], b: &[Exit]) -> f64 {
    let free = |e: &Exit| e.transmission > 0.0 && e.status != Status::Turned;
    let difference = |(a, b): (&Exit, &Exit)| {
        let d = [0, 1].map(|i| f64::from(a.deflection_rad[i]) - f64::from(b.deflection_rad[i]));
        d[0].hypot(d[1])
    };
    a.iter().zip(b).filter(|(a, b)| free(a) && free(b)).map(difference).fold(0.0, f64::max)
}
