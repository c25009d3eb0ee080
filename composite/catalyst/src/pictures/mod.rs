//! Pictures of one time step, which all ranks make together.

mod agreement;
mod camera;
mod contour;
mod lattice;
mod output;
mod photograph;
mod surface;
mod volume;

pub use agreement::{Group, PictureError};
pub use output::file_of;

use crate::blueprint::{Domain, domains};
use crate::node::Node;
use crate::settings::{Photograph, Picture, Show};
use agreement::Totals;
use composite::render::{DataParallel, FrameOptions, RankScene, SecondaryRayPolicy};
use rt_core::environment::Background;
use rt_core::frame::{Frame, Layers};
use rt_core::render::RenderOptions;
use std::path::Path;

/// The domains of the channel `name` of what the simulation gave (the first without a name).
fn domains_of<'n, 'a>(
    params: &'n Node<'a>,
    name: Option<&str>,
) -> Result<Vec<Domain<'n, 'a>>, String> {
    const CHANNELS: &str = "catalyst/channels";
    let all = params.get(CHANNELS).map_or(&[][..], Node::children);
    let found = match name {
        Some(name) => all.iter().find(|(n, _)| n == name),
        None => all.first(),
    };
    let Some((name, channel)) = found else {
        let names: Vec<&str> = all.iter().map(|(n, _)| n.as_str()).collect();
        return Err(match (name, names.is_empty()) {
            (_, true) => format!("{CHANNELS}: the simulation gives no channel"),
            (name, false) => format!(
                "{CHANNELS}: there is no channel `{}`; there are: {}",
                name.unwrap_or_default(),
                names.join(", ")
            ),
        });
    };
    domains(channel, &format!("{CHANNELS}/{name}")).map_err(|e| e.to_string())
}

/// Makes a ray traced picture, which rank 0 writes to `file`. All ranks call it with the same
/// settings. Returns this rank's warnings.
///
/// # Errors
/// [`PictureError`], on every rank.
pub fn picture(
    group: &mut Group<'_>,
    params: &Node<'_>,
    wanted: &Picture,
    file: &Path,
) -> Result<Vec<String>, PictureError> {
    let mut warnings = Vec::new();
    let domains = domains_of(params, wanted.channel.as_deref());
    let (scene, totals) = match wanted.show {
        Show::Surface => surface::outer(group, domains, wanted, &mut warnings)?,
        Show::Isosurface | Show::Slice => contour::contour(group, domains, wanted, &mut warnings)?,
        Show::Volume => volume::volume(group, domains, wanted)?,
    };
    let is_exr = file.extension().is_some_and(|e| e == "exr");
    if totals.is_nothing() && group.comm.rank() == 0 {
        warnings.push(format!("{}: nothing is to be seen", file.display()));
    }
    let (frame, unusable) = rendered(group, scene, &totals, wanted, is_exr)?;
    if unusable > 0 {
        let what = "triangles are left out: a corner is no finite number, or too large";
        warnings.push(format!("{unusable} {what}"));
    }
    let written = frame.map_or(Ok(()), |frame| output::write_frame(&frame, file));
    group.agree(&written.map_err(|e| e.to_string()).map(|()| Vec::new()))?;
    Ok(warnings)
}

/// The picture on rank 0, and the number of this rank's primitives that cannot be hit.
fn rendered(
    group: &mut Group<'_>,
    mut scene: RankScene,
    totals: &Totals,
    wanted: &Picture,
    with_depth: bool,
) -> Result<(Option<Frame>, usize), PictureError> {
    let view = camera::View::of(totals, wanted);
    (scene.lights, scene.ambient_occlusion) = view.lights(wanted);
    let [r, g, b] = wanted.background;
    scene.background = Background::Constant([r, g, b, 1.0]);
    let options = FrameOptions {
        timeout: group.timeout,
        secondary_rays: SecondaryRayPolicy::Auto { frames: 1 },
        parallel: group.threads,
        ..FrameOptions::default()
    };
    let mut renderer = DataParallel::distributed(group.comm, scene, options)?;
    let layers = match with_depth {
        true => Layers::COLOR | Layers::DEPTH | Layers::DISTANCE,
        false => Layers::COLOR,
    };
    let options = RenderOptions {
        samples: wanted.samples,
        layers,
        ..RenderOptions::new(wanted.size[0], wanted.size[1])
    };
    let camera = view.camera().map_err(|e| PictureError::Camera { reason: e.to_string() })?;
    let unusable = renderer.part().scene.world.report().skipped;
    Ok((renderer.frame(group.comm, &camera, &options)?.frame, unusable))
}

/// Makes a photograph of a gas, which rank 0 writes to `file`. All ranks call it with the same
/// settings. Returns this rank's warnings.
///
/// # Errors
/// [`PictureError`], on every rank.
pub fn photograph(
    group: &mut Group<'_>,
    params: &Node<'_>,
    wanted: &Photograph,
    file: &Path,
) -> Result<Vec<String>, PictureError> {
    let domains = domains_of(params, wanted.channel.as_deref());
    let (picture, warnings) = photograph::photograph(group, domains, wanted)?;
    let written = picture.map_or(Ok(()), |grey| output::write_grey(&grey, wanted.size, file));
    group.agree(&written.map_err(|e| e.to_string()).map(|()| Vec::new()))?;
    Ok(warnings)
}

#[cfg(test)]
mod tests;
