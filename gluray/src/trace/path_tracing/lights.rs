//! Converts the program's lights to rt-core's lights in eye space.

use crate::capture::draw::Shading;
use crate::host::config::Settings;
use crate::state::snapshot::GlLight;
use crate::trace::Prepared;
use crate::trace::occlusion::{Eye, LightPosition};
use rt_core::glam::DVec3;
use rt_core::light::{Light, LightKind};

fn sane(c: [f32; 4]) -> [f32; 3] {
    [c[0], c[1], c[2]].map(|v| if v.is_finite() { v.max(0.0) } else { 0.0 })
}

fn vector(v: [f32; 4]) -> DVec3 {
    DVec3::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[2]))
}

fn of_opengl(l: &GlLight, radius_rad: f64, eye: Eye) -> Option<Light> {
    let (color, highlight) = (sane(l.diffuse), sane(l.specular));
    if color == [0.0; 3] && highlight == [0.0; 3] {
        return None;
    }
    let w = f64::from(l.position[3]);
    let at = vector(l.position) / if w == 0.0 { 1.0 } else { w };
    if !at.is_finite() || (w == 0.0 && at == DVec3::ZERO) {
        return None;
    }
    let radius = radius_rad.tan() * at.length();
    let kind = if w == 0.0 {
        LightKind::Directional { to_light: at, angular_radius_rad: radius_rad }
    } else if l.spot_cutoff_deg == 180.0 {
        LightKind::Point { position: at, radius }
    } else {
        let [x, y, z] = l.spot_direction.map(f64::from);
        LightKind::Spot {
            position: at,
            direction: DVec3::new(x, y, z),
            cutoff_rad: f64::from(l.spot_cutoff_deg).to_radians().max(1e-6),
            exponent: f64::from(l.spot_exponent),
            radius,
        }
    };
    let light = Light {
        kind,
        highlight_color: Some(highlight),
        attenuation: l.attenuation,
        ..Light::directional(DVec3::Z).with_color(color)
    };
    let place =
        if w == 0.0 { LightPosition::Directional(at) } else { LightPosition::Positional(at) };
    if radius > 0.0 || !place.follows_rays_of(eye) {
        return Some(light);
    }
    // Said so, the renderer leaves shadow rays out where the eye cannot see what they would find,
    // and only there.
    let kind = match light.kind {
        LightKind::Directional { angular_radius_rad, .. } => {
            LightKind::Directional { to_light: DVec3::Z, angular_radius_rad }
        }
        LightKind::Point { radius, .. } => LightKind::Point { position: DVec3::ZERO, radius },
        // The axis of a spotlight is given in eye space.
        _ => return Some(light),
    };
    Some(Light { kind, ..light }.in_camera_frame())
}

/// The lamps, and the radiance that comes from all directions.
pub(super) fn of(
    draws: &[Prepared<'_>],
    settings: &Settings,
    warnings: &mut Vec<String>,
) -> (Vec<Light>, [f32; 3]) {
    let radius_rad = settings.effects.light_radius_deg.to_radians();
    // A scene has one set of lights, but each OpenGL draw has its own. The largest lit draw
    // provides them.
    let mut lit: Vec<&Prepared<'_>> = draws
        .iter()
        .filter(|p| match &p.draw.shading {
            Shading::Fixed => p.draw.state.lighting,
            Shading::Program(program) => program.is_lit(),
        })
        .collect();
    lit.sort_by_key(|p| std::cmp::Reverse(p.draw.geometry.mesh.num_triangles()));
    let mut ambient = [settings.lights.sky as f32; 3];
    let Some(first) = lit.first() else { return (Vec::new(), ambient) };
    let mut lamps: Vec<Light> = match &first.draw.shading {
        Shading::Fixed => {
            let s = &first.draw.state;
            if lit.iter().any(|p| p.draw.state.lights != s.lights) {
                warnings.push(
                    "mode path: lights differ between draws; those of the largest light all".into(),
                );
            }
            // Ambient light as light from everywhere: as bright on a diffuse surface as OpenGL's on
            // the ambient colours that there are.
            let total: [f32; 3] = s.lights.iter().fold(sane(s.model_ambient), |sum, l| {
                let a = sane(l.ambient);
                std::array::from_fn(|k| sum[k] + a[k])
            });
            let m = &first.draw.attributes.materials_at(0)[0];
            let tracked =
                s.color_material.is_some_and(|(_, what)| what == crate::enums::AMBIENT_AND_DIFFUSE);
            let sum = |c: [f32; 4]| c[0] + c[1] + c[2];
            let share = if tracked {
                1.0
            } else {
                (sum(m.ambient) / sum(m.diffuse).max(1e-6)).clamp(0.0, 1.0)
            };
            (0..3).for_each(|k| ambient[k] += total[k] * share);
            s.lights.iter().filter_map(|l| of_opengl(l, radius_rad, first.eye)).collect()
        }
        Shading::Program(program) => program
            .lights
            .iter()
            .filter_map(|l| of_opengl(&l.as_opengl(), radius_rad, first.eye))
            .collect(),
    };
    if !settings.effects.shadows {
        lamps.iter_mut().for_each(|l| l.shadows = false);
    }
    (lamps, ambient)
}
