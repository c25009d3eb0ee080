//! Traces the ray of one point of the image, and tells what happens to it in numbers.

use crate::path::{Exit, PathQuantities, SkipReport, Start, Status};
use crate::render::{RenderError, TestSection, framing, technique};
use crate::scene::Scene;
use crate::technique::{Photon, Technique};
use serde::Serialize;

/// The ray of one point of the image. Its fields are the keys of `schlieren probe --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Probe {
    /// Column and row from the upper left; (0.5, 0.5) is the first pixel's centre.
    pub pixel: [f64; 2],
    /// What becomes of the ray, in words.
    pub status: &'static str,
    /// Where the undisturbed ray passes the plane through the field's middle, in metres.
    pub start_m: [f64; 3],
    /// Direction of the undisturbed ray.
    pub direction: [f64; 3],
    /// Deflection along the image's right and up.
    pub deflection_rad: [f32; 2],
    /// Displacement where the ray leaves the field.
    pub exit_displacement_m: [f32; 2],
    /// Where the ray leaves the field, behind its middle.
    pub exit_depth_m: f32,
    /// Optical path minus that of the undisturbed ray.
    pub path_difference_m: f32,
    /// The same in the plane of focus, in waves.
    pub phase_waves: f64,
    /// Shift on the film, in metres of the test section.
    pub film_shift_m: [f32; 2],
    /// Shift on the film, in pixels.
    pub film_shift_px: [f64; 2],
    /// Place in the cut-off plane.
    pub cutoff_point_m: [f32; 2],
    /// Transmission: 1 for a free ray, 0 for a blocked one.
    pub transmission: f32,
    /// Energy that reaches the film, as linear RGB.
    pub energy: [f32; 3],
    /// Description of the march.
    pub march: String,
    /// Measured error of deflections due to the march.
    pub deflection_error_rad: Option<f64>,
    /// Effect of skipping uniform gas.
    #[serde(rename = "left_out")]
    pub skip_report: Option<SkipReport>,
    /// Warnings, one sentence each.
    pub warnings: Vec<String>,
    /// Optical depth along the path, when the scene has absorption.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub optical_depth: Option<f32>,
    /// Light that the medium emits; 1 is undisturbed light without a cut-off.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub emission: Option<f32>,
    /// Rotation of the plane of polarisation, when the scene has rotation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation_rad: Option<f32>,
}

/// Traces the ray of a point of the image. The scene's technique must trace light
/// ([`crate::scene::TechniqueSpec::follows_light`]); of others, the ray is one of a shadowgraph.
///
/// # Errors
/// As [`crate::render::render`].
pub fn probe(scene: &Scene, section: &TestSection, pixel: [f64; 2]) -> Result<Probe, RenderError> {
    let framing = framing(scene, section);
    let n0 = section.n0(0);
    let t = technique(scene, 0, &framing, n0, false)?;
    let against_light = matches!(t, Technique::Bos(_));
    let planned = section.paths(scene, 0, PathQuantities { opd: true }, against_light, true)?;
    let position_m = framing.plane_from_pixel(pixel[0], pixel[1]);
    let start = Start { position_m: position_m.map(|c| c as f32), tilt_rad: [0.0; 2] };
    let mut exit = [Exit::UNDISTURBED];
    planned.paths.trace(&[start], &mut exit);
    let [exit] = exit;

    let optics = t.optics();
    let film_shift_m = optics.film_shift_m(&start, &exit);
    let photon =
        Photon { start: &start, exit: &exit, image_point_m: [0.0; 2], shift_m: film_shift_m };
    let blocked = section.solids.as_ref().is_some_and(|s| s.block(&section.view, &start));
    let status = match exit.status {
        _ if blocked => "blocked by a body",
        Status::Free => "free",
        Status::Blocked => "blocked by solid cells",
        Status::Masked => "in cells without data",
        Status::Turned => "turned back or aside",
    };
    let transmission = if blocked { 0.0 } else { exit.transmission };
    let energy = if transmission > 0.0 { t.attenuated_energy(&photon) } else { [0.0; 3] };
    let view = &section.view;
    let through = view.centre_m + view.right * position_m[0] + view.up * position_m[1];
    let path_m = f64::from(optics.film_path_difference_m(&exit, n0 as f32));
    let device_warning = planned.paths.device_warning();
    let warnings = section.warnings.iter().chain(&planned.warnings).chain(&device_warning);
    let mut probe = Probe {
        pixel,
        status,
        start_m: through.to_array(),
        direction: view.forward.to_array(),
        deflection_rad: exit.deflection_rad,
        exit_displacement_m: exit.displacement_m,
        exit_depth_m: exit.exit_depth_m,
        path_difference_m: exit.opd_m,
        phase_waves: path_m / (scene.light.wavelengths_nm[0] * 1e-9),
        film_shift_m,
        film_shift_px: film_shift_m.map(|s| f64::from(s) / framing.pixel_m),
        cutoff_point_m: optics.cutoff_point_m([0.0; 2], &exit),
        transmission,
        energy,
        march: planned.description.clone(),
        deflection_error_rad: planned.error_rad,
        skip_report: planned.paths.skip_report(),
        warnings: warnings.cloned().collect(),
        optical_depth: None,
        emission: None,
        rotation_rad: None,
    };
    if let Some(integrals) = section.media_integrals(scene, &planned, &[start])? {
        let given = &scene.media;
        let emitted = section.emitted(scene, &planned, &[start])?.map_or(0.0, |e| e[0]);
        let of = |present: bool, value: f32| present.then_some(value);
        probe.optical_depth = of(given.absorption.is_some(), integrals[0].optical_depth);
        probe.emission = of(given.emission.is_some(), emitted);
        probe.rotation_rad = of(given.rotation.is_some(), integrals[0].rotation_rad);
    }
    Ok(probe)
}
