//! Implements `schlieren probe`: prints the path of one pixel's ray in numbers.

use super::scene_args::SceneArgs;
use super::units;
use super::words::in_options;
use crate::probe::Probe;
use crate::render::TestSection;
use clap::Args;
use datasets::cli::{CommonArgs, UsageError};
use std::path::PathBuf;

/// Options of `schlieren probe`.
#[derive(Debug, Args)]
pub(super) struct ProbeArgs {
    /// The flow
    file: Option<PathBuf>,
    /// Pixel: column and row from the upper left; 0.5,0.5 is the first one's centre
    #[arg(long, value_name = "X,Y", value_parser = units::pair, allow_hyphen_values = true)]
    pixel: [f64; 2],
    #[command(flatten)]
    scene: SceneArgs,
}

pub(super) fn probe(common: CommonArgs, args: &ProbeArgs) -> anyhow::Result<()> {
    let scene = args.scene.scene(args.file.as_deref())?;
    if !scene.technique.follows_light() {
        return Err(UsageError(format!(
            "technique `{}` does not trace light; use another",
            scene.technique.name()
        ))
        .into());
    }
    let section = TestSection::open(&scene, |what| common.note(0, what))?;
    let found = crate::probe::probe(&scene, &section, args.pixel)?;
    for w in &found.warnings {
        common.warn(in_options(w));
    }
    common.result(&found, || in_words(&found, scene.light.wavelengths_nm[0]))
}

/// The ray for readers.
fn in_words(p: &Probe, wavelength_nm: f64) -> String {
    let [dx, dy] = p.deflection_rad;
    let skipped = p.skip_report.map_or(String::new(), |l| {
        format!(
            "\nskipped          {:.0} % of the steps, at most {:.1e} rad",
            100.0 * l.steps_part,
            l.bound_rad
        )
    });
    let error = p.deflection_error_rad.map_or(String::new(), |e| format!(" ± {e:.1e}"));
    let of_medium: String = [
        ("optical depth    ", "", p.optical_depth),
        ("emission         ", " of undisturbed light", p.emission),
        ("rotation         ", " rad", p.rotation_rad),
    ]
    .into_iter()
    .filter_map(|(words, unit, value)| Some(format!("{words}{:.6}{unit}\n", value?)))
    .collect();
    format!(
        "pixel {}, {}: {}\n\
         undisturbed ray  through ({:.6}, {:.6}, {:.6}) m along ({:.4}, {:.4}, {:.4})\n\
         leaves the field {:.6} m behind the centre, displaced by ({:.4e}, {:.4e}) m\n\
         deflection       right {dx:.6e}, up {dy:.6e} rad{error}\n\
         optical path     {:+.6e} m, {:+.4} waves of {wavelength_nm} nm\n\
         film             shifted by ({:.4}, {:.4}) pixels\n\
         cut-off plane    ({:.4e}, {:.4e}) m from the axis\n\
         {of_medium}energy           {:.6} {:.6} {:.6}\n\
         march            {}{skipped}",
        p.pixel[0],
        p.pixel[1],
        p.status,
        p.start_m[0],
        p.start_m[1],
        p.start_m[2],
        p.direction[0],
        p.direction[1],
        p.direction[2],
        p.exit_depth_m,
        p.exit_displacement_m[0],
        p.exit_displacement_m[1],
        p.path_difference_m,
        p.phase_waves,
        p.film_shift_px[0],
        p.film_shift_px[1],
        p.cutoff_point_m[0],
        p.cutoff_point_m[1],
        p.energy[0],
        p.energy[1],
        p.energy[2],
        p.march,
    )
}
