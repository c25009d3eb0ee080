//! Lights. ANARI gives radiometric quantities, the renderer what a white surface becomes: irradiance over π.

use super::Notes;
use crate::anari::object::Object;
use rt_core::environment::Environment;
use rt_core::glam::{DAffine3, DVec3};
use rt_core::light::{Light, LightKind};
use rt_core::math::orthonormal_basis;
use rt_core::texture::{Texture, Wrap};
use std::f64::consts::PI;

/// What a light object gives.
pub(crate) enum Made {
    Lamp(Light),
    Sky(Environment),
}

/// `None`, with a note, when it cannot be used.
pub(crate) fn light_of(light: &Object, place: &DAffine3, notes: &mut Notes) -> Option<Made> {
    if !light.known {
        return None;
    }
    let color = light.vector("color", [1.0; 3]);
    if !color.iter().all(|c| c.is_finite() && *c >= 0.0) {
        notes.error(
            light,
            format!("`color` is {color:?}; it must be finite and not negative: it gives no light"),
        );
        return None;
    }
    if light.subtype == "hdri" {
        return sky(light, color, place, notes);
    }
    let position = place.transform_point3(DVec3::from_array(light.vector("position", [0.0; 3])));
    let direction = place.transform_vector3(DVec3::from_array(light.vector("direction", [0.0, 0.0, -1.0])));
    if !(position.is_finite() && direction.is_finite() && direction != DVec3::ZERO) {
        notes.error(
            light,
            format!("its place {position} or direction {direction} is not finite or zero: it gives no light"),
        );
        return None;
    }
    let number = |name: &str| light.numbers(name).map(|v| v[0]);
    let radius = number("radius").unwrap_or(0.0).max(0.0);
    let per_angle = number("power").map(|p| p / (4.0 * PI)).or(number("intensity")).unwrap_or(1.0);
    let (kind, strength, attenuation) = match light.subtype.as_str() {
        "directional" => {
            let half = 0.5 * number("angularDiameter").unwrap_or(0.0).clamp(0.0, 3.0);
            // The irradiance of a disk of uniform radiance L straight ahead is π L sin² of its radius.
            let sized = number("radiance").filter(|_| half > 0.0).map(|l| PI * l * half.sin().powi(2));
            let kind = LightKind::Directional { to_light: -direction, angular_radius_rad: half };
            (kind, sized.or(number("irradiance")).unwrap_or(1.0), [1.0, 0.0, 0.0])
        }
        "point" => {
            let sized = number("radiance").filter(|_| radius > 0.0).map(|l| l * PI * radius * radius);
            (LightKind::Point { position, radius }, sized.unwrap_or(per_angle), [0.0, 0.0, 1.0])
        }
        "ring" => {
            let sized = number("radiance").filter(|_| radius > 0.0).map(|l| l * PI * radius * radius);
            // Straight ahead; a disk's power is π times that.
            let ahead = number("power").map(|p| p / PI).or(number("intensity")).unwrap_or(1.0);
            let kind = if radius > 0.0 {
                LightKind::Disk { position, direction, radius }
            } else {
                notes.warn(light, "`radius` is 0: it shines from a point, into the half space before it");
                let half = 0.5 * PI;
                LightKind::Cone { position, direction, inner_rad: half, outer_rad: half }
            };
            (kind, sized.unwrap_or(ahead), [0.0, 0.0, 1.0])
        }
        _ => {
            let outer = 0.5 * number("openingAngle").unwrap_or(PI).clamp(0.0, 2.0 * PI);
            let inner = (outer - number("falloffAngle").unwrap_or(0.1).max(0.0)).max(0.0);
            if outer == 0.0 {
                notes.warn(light, "`openingAngle` is 0: it gives no light");
                return None;
            }
            (
                LightKind::Cone { position, direction, inner_rad: inner, outer_rad: outer },
                per_angle,
                [0.0, 0.0, 1.0],
            )
        }
    };
    if !(strength.is_finite() && strength >= 0.0) {
        notes.error(
            light,
            format!("its strength is {strength}; it must be finite and not negative: it gives no light"),
        );
        return None;
    }
    let lamp = Light { kind, attenuation, ..Light::directional(DVec3::Z) };
    Some(Made::Lamp(lamp.with_color(color.map(|c| (c * strength / PI) as f32))))
}

/// The picture turned so that the renderer, which knows only which way is up, has its middle in the right direction.
fn sky(light: &Object, color: [f64; 3], place: &DAffine3, notes: &mut Notes) -> Option<Made> {
    let picture = light.object("radiance").and_then(|a| a.with_array(|a| (a.dims, a.vectors())));
    let Some(([width, height, _], texels)) = picture.filter(|(_, t)| !t.is_empty()) else {
        notes.error(light, "`radiance` is not set or has no texels: it gives no light");
        return None;
    };
    let up =
        place.transform_vector3(DVec3::from_array(light.vector("up", [0.0, 0.0, 1.0]))).normalize_or_zero();
    let forward = place.transform_vector3(DVec3::from_array(light.vector("direction", [1.0, 0.0, 0.0])));
    let forward = (forward - up * up.dot(forward)).normalize_or_zero();
    if up == DVec3::ZERO || forward == DVec3::ZERO {
        notes.error(light, "`up` and `direction` are zero or parallel: it gives no light");
        return None;
    }
    let right = forward.cross(up);
    let (east, north) = orthonormal_basis(up.as_vec3());
    let (east, north) = (east.as_dvec3(), north.as_dvec3());
    let mut turned = Vec::with_capacity(texels.len());
    for row in texels.chunks_exact(width) {
        for i in 0..width {
            let angle = ((i as f64 + 0.5) / width as f64 - 0.5) * 2.0 * PI;
            let d = east * angle.cos() + north * angle.sin();
            // Column of the program's picture: its middle is `direction`, and it goes to the right seen from inside.
            let u = 0.5 + d.dot(right).atan2(d.dot(forward)) / (2.0 * PI);
            let x = u * width as f64 - 0.5;
            let (low, part) = (x.floor(), (x - x.floor()) as f32);
            let at = |k: i64| row[k.rem_euclid(width as i64) as usize];
            let (a, b) = (at(low as i64), at(low as i64 + 1));
            let c: [f32; 3] = std::array::from_fn(|c| (a[c] + (b[c] - a[c]) * part) * color[c] as f32);
            turned.push([c[0], c[1], c[2], 1.0].map(|v: f32| if v.is_finite() { v.max(0.0) } else { 0.0 }));
        }
    }
    let mut image = match Texture::from_linear(width, height, turned) {
        Ok(image) => image,
        Err(e) => {
            notes.error(light, e);
            return None;
        }
    };
    image.wrap = [Wrap::Repeat, Wrap::Clamp];
    let scale = light.f32("scale", 1.0);
    if !(scale.is_finite() && scale >= 0.0) {
        notes.error(
            light,
            format!("`scale` is {scale}; it must be finite and not negative: it gives no light"),
        );
        return None;
    }
    Some(Made::Sky(Environment::Image { image: image.into(), up: up.as_vec3(), scale }))
}
