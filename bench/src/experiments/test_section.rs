//! Code that the experiments of chapter 5 share: flows of the catalogue between the lenses, rays
//! through them, and PNG images.

use super::Context;
use crate::record::RecordImage;
use datasets::catalogue::flows;
use datasets::cli::Interrupted;
use datasets::generate::flow::Fields;
use glam::DVec3;
use schlieren::analytic::Gaussian;
use schlieren::field::Field;
use schlieren::input::{Medium, Options, Quantity, from_dataset};
use schlieren::march::{DormandPrince, Ray};
use schlieren::path::{Exit, LightPaths, Start};
use schlieren::render::{Control, Layers, RenderError, RenderOutput, TestSection, render};
use schlieren::scene::Scene;
use schlieren::view::View;
use std::sync::atomic::{AtomicBool, Ordering};

/// Photons per second of the dissertation's GTX 280: 13 frames of 512² pixels with 10 photons each,
/// figure 5.11.
pub(super) const GTX_280_PHOTONS_PER_SEC: f64 = 13.0 * 512.0 * 512.0 * 10.0;

/// Helium-neon, as in the dissertation's text.
const WAVELENGTH_NM: f64 = 633.0;

/// A flow of the catalogue as a field of index: air of its density by Gladstone-Dale, or the index
/// itself.
pub(super) fn flow(name: &str, size: &str) -> anyhow::Result<Field> {
    let flow = flows::find(name)?.generate(size, Fields::Density)?;
    let array = flow.fields.first().map_or("density", |f| f.name);
    let medium = match array {
        "index_minus_one" => Medium::NMinus1(Quantity::array(array)),
        other => Medium::density(other),
    };
    let options = Options { wavelength_nm: WAVELENGTH_NM, ..Options::new(medium) };
    Ok(from_dataset(&flow.into_dataset(), &options)?.field)
}

/// A scene from its TOML without the flow, which is passed separately.
pub(super) fn scene(rest: &str) -> anyhow::Result<Scene> {
    Ok(Scene::from_toml(&format!("[flow]\nfile = \"\"\ndensity = \"-\"\n{rest}"))?)
}

/// Renders an image. A cancelled image means an interrupted experiment.
pub(super) fn render_image(
    context: &Context<'_>,
    scene: &Scene,
    section: &TestSection,
) -> anyhow::Result<RenderOutput> {
    render_image_with(context, scene, section, Layers::NONE)
}

/// [`render_picture`] with additional outputs.
pub(super) fn render_image_with(
    context: &Context<'_>,
    scene: &Scene,
    section: &TestSection,
    layers: Layers,
) -> anyhow::Result<RenderOutput> {
    let never = AtomicBool::new(false);
    let control =
        Control { cancel: context.cancel.as_deref().unwrap_or(&never), progress: &|_| {} };
    match render(scene, section, layers, &control) {
        Err(RenderError::Cancelled) => Err(Interrupted.into()),
        other => Ok(other?),
    }
}

/// Stops an experiment after Ctrl-C.
pub(super) fn check_cancelled(context: &Context<'_>) -> anyhow::Result<()> {
    match context.cancel.as_deref().is_some_and(|c| c.load(Ordering::Relaxed)) {
        true => Err(Interrupted.into()),
        false => Ok(()),
    }
}

/// Converts an image for a record.
pub(super) fn image(
    name: &str,
    caption: String,
    rendered: &RenderOutput,
) -> anyhow::Result<RecordImage> {
    let dir = tempfile::tempdir()?;
    let path = dir.path().join("image.png");
    schlieren::output::write_png(&path, rendered)?;
    Ok(RecordImage { name: name.into(), caption, png: std::fs::read(&path)? })
}

/// Rays through the middle of an image of `side_m`, in tiles of 4 by 4 in a renderer's order:
/// `width` by `width` of them.
pub(super) fn tiles(width: usize, side_m: f64) -> Vec<Start> {
    let at = |block: usize, i: usize| {
        ((((block * 4 + i) as f64 + 0.5) / width as f64 - 0.5) * side_m) as f32
    };
    (0..width * width / 16)
        .flat_map(|tile| {
            let (bx, by) = (tile % (width / 4), tile / (width / 4));
            (0..16).map(move |i| (bx, by, i))
        })
        .map(|(bx, by, i)| Start { position_m: [at(bx, i % 4), at(by, i / 4)], tilt_rad: [0.0; 2] })
        .collect()
}

/// A view 0.6 rad off every lattice axis.
pub(super) fn oblique() -> anyhow::Result<View> {
    Ok(View::new(DVec3::new(0.6f64.sin(), 0.0, 0.6f64.cos()), DVec3::Y, DVec3::ZERO)?)
}

/// A weak Gaussian blob in the middle of a cube of 1 m, and the field on `n`³ nodes.
pub(super) fn blob(amplitude: f64, n: usize) -> anyhow::Result<(Gaussian, Field)> {
    use schlieren::march::Medium as _;
    let blob = Gaussian { amplitude, sigma_m: 0.08 };
    let h = 1.0 / (n - 1) as f64;
    let field = Field::from_fn([n; 3], [h; 3], DVec3::splat(-0.5), 1.0, |p| blob.sample(p).0)?;
    Ok((blob, field))
}

/// Deflections by the exact blob, without a lattice: an adaptive march in f64, to 1e-13 of the
/// index's amplitude. Rays must pass within 0.3 m of the middle, because the lattice is cut off at
/// the cube and the exact blob is not.
pub(super) fn blob_deflections(
    blob: &Gaussian,
    view: &View,
    starts: &[Start],
) -> anyhow::Result<Vec<[f64; 2]>> {
    use rayon::prelude::*;
    let half_m = 0.7;
    let march = DormandPrince { tolerance: 1e-13 * blob.amplitude, longest_step_m: 0.02 };
    let one = |start: &Start| {
        let [x, y] = start.position_m.map(f64::from);
        let begin = view.centre_m + view.right * x + view.up * y - view.forward * half_m;
        let end = march.run(blob, &Ray::new(begin, view.forward), 2.0 * half_m);
        let u = end.ok_or_else(|| anyhow::anyhow!("the reference march did not end"))?.ray.u;
        Ok([u.dot(view.right), u.dot(view.up)])
    };
    starts.par_iter().map(one).collect()
}

/// Error of deflections: root mean square and maximum, relative to the largest exact deflection.
pub(super) fn error_of(exits: &[Exit], truth: &[[f64; 2]]) -> (f64, f64) {
    let size = |v: [f64; 2]| v[0].hypot(v[1]);
    let scale = truth.iter().map(|t| size(*t)).fold(0.0, f64::max);
    let (mut squares, mut largest) = (0.0, 0.0f64);
    for (e, t) in exits.iter().zip(truth) {
        let off = size([0, 1].map(|c| f64::from(e.deflection_rad[c]) - t[c])) / scale;
        squares += off * off;
        largest = if off.is_nan() { f64::NAN } else { largest.max(off) };
    }
    ((squares / truth.len().max(1) as f64).sqrt(), largest)
}

/// Traces all rays on this thread.
pub(super) fn traced(paths: &dyn LightPaths, starts: &[Start]) -> Vec<Exit> {
    let mut exits = vec![Exit::UNDISTURBED; starts.len()];
    paths.trace(starts, &mut exits);
    exits
}

/// A number that depends on every bit of the deflections, as the check number of variants.
pub(super) fn fingerprint(exits: &[Exit]) -> u64 {
    exits.iter().fold(0u64, |f, e| {
        let [x, y] = e.deflection_rad.map(f32::to_bits);
        f.rotate_left(5) ^ (u64::from(x) << 32 | u64::from(y))
    })
}
