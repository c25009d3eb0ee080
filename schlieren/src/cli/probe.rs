//! Implements `schlieren probe`: prints the path of one pixel's ray in numbers.

use super::scene_args::SceneArgs;
use super::units;
use crate::path::{Exit, PathQuantities, Start, Status};
use crate::render::{TestSection, framing, technique};
use crate::technique::{Photon, Technique};
use clap::Args;
use datasets::cli::{CommonArgs, UsageError};
use serde_json::json;
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
    let framing = framing(&scene, &section);
    let t = technique(&scene, 0, &framing, section.fields[0].n0(), false)?;
    let planned = section.paths(
        &scene,
        0,
        PathQuantities { opd: true },
        matches!(t, Technique::Bos(_)),
        true,
    )?;
    let [x, y] = args.pixel;
    let position_m = framing.plane_from_pixel(x, y);
    let start = Start { position_m: position_m.map(|c| c as f32), tilt_rad: [0.0; 2] };
    let mut exit = [Exit::UNDISTURBED];
    planned.paths.trace(&[start], &mut exit);
    let [exit] = exit;

    let skip_report = planned.paths.skip_report();
    let device_warning = planned.paths.device_warning();
    let warnings: Vec<&String> =
        section.warnings.iter().chain(&planned.warnings).chain(&device_warning).collect();
    for w in &warnings {
        common.warn(w);
    }
    let optics = t.optics();
    let shift_m = optics.film_shift_m(&start, &exit);
    let photon = Photon { start: &start, exit: &exit, image_point_m: [0.0; 2], shift_m };
    let blocked = section.solids.as_ref().is_some_and(|s| s.block(&section.view, &start));
    let status = match exit.status {
        _ if blocked => "blocked by a body",
        Status::Free => "free",
        Status::Blocked => "blocked by solid cells",
        Status::Masked => "in cells without data",
        Status::Turned => "turned back or aside",
    };
    let light = if blocked { 0.0 } else { exit.transmission };
    let energy = if light > 0.0 { t.attenuated_energy(&photon) } else { [0.0; 3] };
    let view = &section.view;
    let world = view.centre_m + view.right * position_m[0] + view.up * position_m[1];
    let waves = f64::from(optics.film_path_difference_m(&exit, section.fields[0].n0() as f32))
        / (scene.light.wavelengths_nm[0] * 1e-9);
    let cutoff_m = optics.cutoff_point_m([0.0; 2], &exit);
    let mut object = json!({
        "pixel": args.pixel,
        "status": status,
        "start_m": world.to_array(),
        "direction": view.forward.to_array(),
        "deflection_rad": exit.deflection_rad,
        "exit_displacement_m": exit.displacement_m,
        "exit_depth_m": exit.exit_depth_m,
        "path_difference_m": exit.opd_m,
        "phase_waves": waves,
        "film_shift_m": shift_m,
        "film_shift_px": shift_m.map(|s| f64::from(s) / framing.pixel_m),
        "cutoff_point_m": cutoff_m,
        "transmission": light,
        "energy": energy,
        "march": planned.description,
        "deflection_error_rad": planned.error_rad,
        "left_out": skip_report,
        "warnings": warnings,
    });
    let mut of_medium = String::new();
    if let Some(c) = section.media_integrals(&scene, &planned, &[start])? {
        let c = c[0];
        let emission = section.emitted(&scene, &planned, &[start])?.map_or(0.0, |e| e[0]);
        let given = &scene.media;
        for (name, words, unit, value, present) in [
            ("optical_depth", "optical depth    ", "", c.optical_depth, given.absorption.is_some()),
            (
                "emission",
                "emission         ",
                " of undisturbed light",
                emission,
                given.emission.is_some(),
            ),
            ("rotation_rad", "rotation         ", " rad", c.rotation_rad, given.rotation.is_some()),
        ] {
            if present {
                object[name] = value.into();
                of_medium += &format!("{words}{value:.6}{unit}\n");
            }
        }
    }
    common.result(&object, || {
        let [dx, dy] = exit.deflection_rad;
        let skipped = skip_report.map_or(String::new(), |l| {
            format!(
                "\nskipped          {:.0} % of the steps, at most {:.1e} rad",
                100.0 * l.steps_part,
                l.bound_rad
            )
        });
        let error = planned.error_rad.map_or(String::new(), |e| format!(" ± {e:.1e}"));
        format!(
            "pixel {x}, {y}: {status}\n\
             undisturbed ray  through ({:.6}, {:.6}, {:.6}) m along ({:.4}, {:.4}, {:.4})\n\
             leaves the field {:.6} m behind the centre, displaced by ({:.4e}, {:.4e}) m\n\
             deflection       right {dx:.6e}, up {dy:.6e} rad{error}\n\
             optical path     {:+.6e} m, {waves:+.4} waves of {} nm\n\
             film             shifted by ({:.4}, {:.4}) pixels\n\
             cut-off plane    ({:.4e}, {:.4e}) m from the axis\n\
             {of_medium}energy           {:.6} {:.6} {:.6}\n\
             march            {}{skipped}",
            world.x,
            world.y,
            world.z,
            view.forward.x,
            view.forward.y,
            view.forward.z,
            exit.exit_depth_m,
            exit.displacement_m[0],
            exit.displacement_m[1],
            exit.opd_m,
            scene.light.wavelengths_nm[0],
            f64::from(shift_m[0]) / framing.pixel_m,
            f64::from(shift_m[1]) / framing.pixel_m,
            cutoff_m[0],
            cutoff_m[1],
            energy[0],
            energy[1],
            energy[2],
            planned.description,
        )
    })
}
