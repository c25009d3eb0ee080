//! Converts VTK's lights to rt-core's lights.

use crate::input::{LightKind, SceneLight};
use crate::options::Options;
use rt_core::light::{Light, LightKind as Kind};

/// Converts the lights that have an effect. `options` may request shadows.
pub fn lights(scene: &[SceneLight], shadows: bool, options: &Options) -> Vec<Light> {
    scene.iter().filter_map(|l| light(l, shadows, options)).collect()
}

fn light(l: &SceneLight, shadows: bool, options: &Options) -> Option<Light> {
    if l.color.iter().any(|c| !c.is_finite()) || l.color == [0.0; 3] {
        return None;
    }
    let axis = l.focal_point - l.position;
    let usable = l.position.is_finite() && axis.is_finite() && axis.length_squared() > 0.0;
    if l.headlight {
        return Some(Light::headlight().with_color(l.color));
    }
    if !usable {
        return None;
    }
    let kind = match l.kind {
        LightKind::Directional => {
            Kind::Directional { to_light: -axis, angular_radius_rad: options.light_size_rad }
        }
        // The light's radius subtends the requested angle at the focal point.
        LightKind::Point => Kind::Point {
            position: l.position,
            radius: axis.length() * options.light_size_rad.tan(),
        },
        LightKind::Spot { cutoff_rad, exponent } => Kind::Spot {
            position: l.position,
            direction: axis,
            cutoff_rad: cutoff_rad.clamp(1e-6, std::f64::consts::PI),
            exponent: if exponent.is_finite() { exponent.max(0.0) } else { 0.0 },
            radius: axis.length() * options.light_size_rad.tan(),
        },
    };
    let sharp =
        Light { kind, color: l.color, attenuation: l.attenuation, shadows, ..Light::headlight() };
    Some(Light { frame: rt_core::light::LightFrame::World, ..sharp })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::glam::DVec3;

    #[test]
    fn lights_that_stand_where_they_look_are_left_out() {
        let l = SceneLight {
            kind: LightKind::Directional,
            position: DVec3::ONE,
            focal_point: DVec3::ONE,
            color: [1.0; 3],
            attenuation: [1.0, 0.0, 0.0],
            headlight: false,
        };
        assert!(lights(&[l], true, &Options::default()).is_empty());
        let head = SceneLight { headlight: true, ..l };
        assert!(!lights(&[head], true, &Options::default())[0].casts_shadows());
    }
}
