//! Decides which effects run, from the request and from what the scene needs, and writes a warning
//! for every difference.

use crate::camera::Camera;
use crate::effects::Effects;
use crate::ray_stats::RayStats;
use crate::render_error::RenderError;
use crate::render_options::RenderOptions;
use crate::scene::Scene;

/// The effects that will run.
pub(crate) struct Plan {
    pub(crate) effects: Effects,
    /// Needed by the scene but not requested.
    pub(crate) left_out: Effects,
    pub(crate) warnings: Vec<String>,
}

pub(crate) fn plan(
    scene: &Scene,
    camera: &Camera,
    options: &RenderOptions,
) -> Result<Plan, RenderError> {
    plan_for(scene, Effects::required_by(scene), camera, options)
}

/// As [`plan`], for a part of a scene; the whole scene needs `by_scene`.
pub(crate) fn plan_for(
    scene: &Scene,
    by_scene: Effects,
    camera: &Camera,
    options: &RenderOptions,
) -> Result<Plan, RenderError> {
    options.check()?;
    scene.check()?;
    camera.check()?;
    let mut warnings = scene.warnings();
    warnings.extend(options.warnings());
    let asked =
        options.effects.map(|e| e.with_if(e.contains(Effects::SOFT_SHADOWS), Effects::SHADOWS));
    let path = options.path_tracing || asked.is_some_and(|e| e.contains(Effects::PATH_TRACING));
    let mut needed = by_scene | Effects::required_by_camera(camera);
    if path {
        needed = needed.without(Effects::AMBIENT_OCCLUSION) | Effects::PATH_TRACING;
    }
    if path && needed.contains(Effects::VOLUMES) {
        return Err(RenderError::Unsupported {
            what: "path tracing",
            with: "with volumes",
            cure: "leave the volumes out of the scene, or path tracing out of the options",
        });
    }
    let ask = |needed| asked.map(|e| e.with_if(path, Effects::PATH_TRACING)).unwrap_or(needed);
    if !shadows_show(scene, camera, ask(needed).intersection(needed)) {
        needed = needed.without(Effects::SHADOWS | Effects::SOFT_SHADOWS);
    }
    let asked_all = ask(needed);
    let effects = asked_all.intersection(needed);
    for (effect, name) in Effects::ALL {
        if asked.is_some() && asked_all.contains(effect) && !needed.contains(effect) {
            warnings.push(format!("{name} changes no pixel: {}", why_not_needed(effect, path)));
        }
    }
    if effects.contains(Effects::VOLUMES)
        && effects.intersects(Effects::SHADOWS | Effects::AMBIENT_OCCLUSION)
    {
        warnings.push(
            "volumes cast no shadows and no ambient occlusion: light rays pass through them \
             undimmed"
                .into(),
        );
    }
    let left_out = needed.without(effects);
    for (effect, name) in Effects::ALL {
        if left_out.contains(effect) {
            warnings
                .push(format!("{name} left out: the scene has it, the options do not ask for it"));
        }
    }
    Ok(Plan { effects, left_out, warnings })
}

/// Whether `effects` can make a shadow visible. They cannot where all light that casts shadows
/// follows the camera rays and only the first hits of these are lit.
fn shadows_show(scene: &Scene, camera: &Camera, effects: Effects) -> bool {
    let beyond_first_hits = Effects::REFLECTION
        | Effects::GLOSSY_REFLECTION
        | Effects::REFRACTION
        | Effects::TRANSPARENCY
        | Effects::DEPTH_OF_FIELD
        | Effects::PATH_TRACING;
    effects.intersects(beyond_first_hits)
        || scene.lights.iter().any(|l| l.casts_shadows() && !l.follows_rays_of(camera))
}

fn why_not_needed(effect: Effects, path: bool) -> &'static str {
    match effect {
        Effects::SHADOWS => "no light casts shadows that the eye could see",
        Effects::SOFT_SHADOWS => "no light that casts shadows has a size",
        Effects::AMBIENT_OCCLUSION if path => "path tracing computes what it stands for",
        Effects::AMBIENT_OCCLUSION => {
            "the scene has no ambient occlusion settings, no ambient light or environment, or no \
             surface that answers it"
        }
        Effects::REFLECTION => "no material is a mirror or a dielectric",
        Effects::GLOSSY_REFLECTION => "no material reflects with roughness",
        Effects::REFRACTION => "no material is a dielectric",
        Effects::TRANSPARENCY => "every surface is opaque",
        Effects::DEPTH_OF_FIELD => "the camera has no lens with an aperture",
        Effects::VOLUMES => "the scene has no volumes",
        _ => "nothing needs it",
    }
}

/// Warnings about effects that ran without changing anything, after the frame is finished.
pub(crate) fn warn_without_effect(
    asked: Option<Effects>,
    ran: Effects,
    left_out: Effects,
    rays: &RayStats,
    out: &mut Vec<String>,
) {
    let asked = asked.unwrap_or(Effects::NONE);
    let path = ran.contains(Effects::PATH_TRACING);
    for (effect, name) in Effects::ALL {
        // A path tracer's bounces are not counted by kind.
        let told_apart = !path
            || matches!(effect, Effects::SHADOWS | Effects::SOFT_SHADOWS | Effects::PATH_TRACING);
        if asked.contains(effect)
            && ran.contains(effect)
            && told_apart
            && rays.times_effective(effect) == Some(0)
        {
            out.push(format!(
                "{name} changed no pixel of this picture: nothing in view is affected by it"
            ));
        }
    }
    if rays.opacity_ignored > 0 && !left_out.contains(Effects::TRANSPARENCY) {
        out.push(format!(
            "{} hits on surfaces with opacity below 1 were drawn opaque: the scene did not show \
             that it has any; \
             give a material an opacity below 1, or let the shape's `has_transparency` say so",
            rays.opacity_ignored
        ));
    }
    if rays.cut_at_max_bounces > 0 {
        out.push(format!(
            "{} paths were cut at `max_bounces`; what they would have added is missing: raise it \
             if dark spots show",
            rays.cut_at_max_bounces
        ));
    }
}
