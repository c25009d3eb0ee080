//! Lights. ANARI specifies radiometric quantities. The renderer takes the radiance of a lit white
//! surface, which is irradiance over π.

use super::Diagnostics;
use crate::anari::object::Object;
use rt_core::environment::Environment;
use rt_core::glam::{DAffine3, DVec3};
use rt_core::light::{Light, LightKind};
use rt_core::math::orthonormal_basis;
use rt_core::texture::{Texture, Wrap};
use std::f64::consts::PI;

/// The result of converting a light object.
pub(crate) enum CompiledLight {
    Light(Light),
    Environment(Environment),
}

/// Returns `None`, with a diagnostic, if the light cannot be used.
pub(crate) fn light_of(
    light: &Object,
    place: &DAffine3,
    diagnostics: &mut Diagnostics,
) -> Option<CompiledLight> {
    if !light.known {
        return None;
    }
    let color = light.vector("color", [1.0; 3]);
    if !color.iter().all(|c| c.is_finite() && *c >= 0.0) {
        diagnostics.error(
            light,
            format!("`color` is {color:?}; it must be finite and not negative: it gives no light"),
        );
        return None;
    }
    if light.subtype == "hdri" {
        return environment(light, color, place, diagnostics);
    }
    if light.subtype == "quad" {
        return quad(light, color, place, diagnostics);
    }
    let position = place.transform_point3(DVec3::from_array(light.vector("position", [0.0; 3])));
    let direction =
        place.transform_vector3(DVec3::from_array(light.vector("direction", [0.0, 0.0, -1.0])));
    if !(position.is_finite() && direction.is_finite() && direction != DVec3::ZERO) {
        diagnostics.error(
            light,
            format!(
                "its place {position} or direction {direction} is not finite or zero: it gives \
                     no light"
            ),
        );
        return None;
    }
    let number = |name: &str| light.numbers(name).map(|v| v[0]);
    let radius = number("radius").unwrap_or(0.0).max(0.0);
    let mut cone = |light: &Object| {
        let outer = 0.5 * number("openingAngle").unwrap_or(PI).clamp(0.0, 2.0 * PI);
        let inner = (outer - number("falloffAngle").unwrap_or(0.1).max(0.0)).max(0.0);
        // NaN fails the comparison too.
        let any = outer > 0.0 && inner >= 0.0;
        if !any {
            diagnostics
                .warn(light, "`openingAngle` or `falloffAngle` leaves no cone: it gives no light");
        }
        any.then_some((inner, outer))
    };
    let per_angle = number("power").map(|p| p / (4.0 * PI)).or(number("intensity")).unwrap_or(1.0);
    let (kind, strength, attenuation) = match light.subtype.as_str() {
        "directional" => {
            let half = 0.5 * number("angularDiameter").unwrap_or(0.0).clamp(0.0, 3.0);
            // On the axis, a disk of uniform radiance L and angular radius r gives the irradiance π
            // L sin² r.
            let sized =
                number("radiance").filter(|_| half > 0.0).map(|l| PI * l * half.sin().powi(2));
            let kind = LightKind::Directional { to_light: -direction, angular_radius_rad: half };
            (kind, sized.or(number("irradiance")).unwrap_or(1.0), [1.0, 0.0, 0.0])
        }
        "point" => {
            let sized =
                number("radiance").filter(|_| radius > 0.0).map(|l| l * PI * radius * radius);
            (LightKind::Point { position, radius }, sized.unwrap_or(per_angle), [0.0, 0.0, 1.0])
        }
        "ring" => {
            let hole = number("innerRadius").unwrap_or(0.0);
            let area = PI * (radius * radius - hole * hole);
            let sized = number("radiance").filter(|_| radius > 0.0).map(|l| l * area);
            // Intensity along the axis; the power of a disk is π times that.
            let ahead = number("power").map(|p| p / PI).or(number("intensity")).unwrap_or(1.0);
            let (inner_rad, outer_rad) = cone(light)?;
            // A flat light emits nothing behind its own plane.
            let (inner_rad, outer_rad) = (inner_rad.min(0.5 * PI), outer_rad.min(0.5 * PI));
            let kind = if radius > 0.0 {
                let inner_radius = number("innerRadius").unwrap_or(0.0);
                if !(0.0..radius).contains(&inner_radius) {
                    diagnostics.error(
                        light,
                        format!(
                            "`innerRadius` is {inner_radius}; it must be from 0 to below the \
                                 radius {radius}: it gives no light"
                        ),
                    );
                    return None;
                }
                LightKind::Ring { position, direction, inner_radius, radius, inner_rad, outer_rad }
            } else {
                diagnostics.warn(
                    light,
                    "`radius` is 0: it shines from a point, into the half space before it",
                );
                LightKind::Cone { position, direction, inner_rad, outer_rad }
            };
            (kind, sized.unwrap_or(ahead), [0.0, 0.0, 1.0])
        }
        _ => {
            let (inner_rad, outer_rad) = cone(light)?;
            (
                LightKind::Cone { position, direction, inner_rad, outer_rad },
                per_angle,
                [0.0, 0.0, 1.0],
            )
        }
    };
    if !(strength.is_finite() && strength >= 0.0) {
        diagnostics.error(
            light,
            format!(
                "its strength is {strength}; it must be finite and not negative: it gives no light"
            ),
        );
        return None;
    }
    let lamp = Light { kind, attenuation, ..Light::directional(DVec3::Z) };
    Some(CompiledLight::Light(lamp.with_color(color.map(|c| (c * strength / PI) as f32))))
}

/// A parallelogram; its intensity along the normal is radiance times area.
fn quad(
    light: &Object,
    color: [f64; 3],
    place: &DAffine3,
    diagnostics: &mut Diagnostics,
) -> Option<CompiledLight> {
    let vector = |name: &str, default: [f64; 3]| DVec3::from_array(light.vector(name, default));
    let corner = place.transform_point3(vector("position", [0.0; 3]));
    let [a, b] = [("edge1", [1.0, 0.0, 0.0]), ("edge2", [0.0, 1.0, 0.0])]
        .map(|(name, default)| place.transform_vector3(vector(name, default)));
    let area = a.cross(b).length();
    if !(corner.is_finite() && area.is_finite() && area > 0.0) {
        diagnostics.error(
            light,
            format!(
                "its corner {corner} is not finite, or its edges {a} and {b} span no area: it \
                 gives no light"
            ),
        );
        return None;
    }
    let number = |name: &str| light.numbers(name).map(|v| v[0]);
    let side = light.text("side").unwrap_or_default();
    let both_sides = side == "both";
    let sides = if both_sides { 2.0 } else { 1.0 };
    // The power of one side is π times its intensity along the normal.
    let strength = number("radiance")
        .map(|l| l * area)
        .or(number("power").map(|p| p / (PI * sides)))
        .or(number("intensity"))
        .unwrap_or(1.0);
    if !(strength.is_finite() && strength >= 0.0) {
        diagnostics.error(
            light,
            format!(
                "its strength is {strength}; it must be finite and not negative: it gives no light"
            ),
        );
        return None;
    }
    // The emitting side is the one that the cross product of the first and second edge points to.
    let edges = if side == "back" { [b, a] } else { [a, b] };
    let kind = LightKind::Quad { corner, edges, both_sides };
    let lamp = Light { kind, ..Light::quad(corner, edges) };
    Some(CompiledLight::Light(lamp.with_color(color.map(|c| (c * strength / PI) as f32))))
}

/// Rotates the environment image so that its centre has the right direction; the renderer knows
/// only the up direction.
fn environment(
    light: &Object,
    color: [f64; 3],
    place: &DAffine3,
    diagnostics: &mut Diagnostics,
) -> Option<CompiledLight> {
    let picture = light.object("radiance").and_then(|a| a.with_array(|a| (a.dims, a.vectors())));
    let Some(([width, height, _], texels)) = picture.filter(|(_, t)| !t.is_empty()) else {
        diagnostics.error(light, "`radiance` is not set or has no texels: it gives no light");
        return None;
    };
    let up = place
        .transform_vector3(DVec3::from_array(light.vector("up", [0.0, 0.0, 1.0])))
        .normalize_or_zero();
    let forward =
        place.transform_vector3(DVec3::from_array(light.vector("direction", [1.0, 0.0, 0.0])));
    let forward = (forward - up * up.dot(forward)).normalize_or_zero();
    if up == DVec3::ZERO || forward == DVec3::ZERO {
        diagnostics.error(light, "`up` and `direction` are zero or parallel: it gives no light");
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
            // Column of the program's image: its centre is `direction`, and columns increase to the
            // right as seen from inside.
            let u = 0.5 + d.dot(right).atan2(d.dot(forward)) / (2.0 * PI);
            let x = u * width as f64 - 0.5;
            let (low, part) = (x.floor(), (x - x.floor()) as f32);
            let at = |k: i64| row[k.rem_euclid(width as i64) as usize];
            let (a, b) = (at(low as i64), at(low as i64 + 1));
            let c: [f32; 3] =
                std::array::from_fn(|c| (a[c] + (b[c] - a[c]) * part) * color[c] as f32);
            turned.push(
                [c[0], c[1], c[2], 1.0].map(|v: f32| if v.is_finite() { v.max(0.0) } else { 0.0 }),
            );
        }
    }
    let mut image = match Texture::from_linear(width, height, turned) {
        Ok(image) => image,
        Err(e) => {
            diagnostics.error(light, e);
            return None;
        }
    };
    image.wrap = [Wrap::Repeat, Wrap::Clamp];
    let scale = light.f32("scale", 1.0);
    if !(scale.is_finite() && scale >= 0.0) {
        diagnostics.error(
            light,
            format!("`scale` is {scale}; it must be finite and not negative: it gives no light"),
        );
        return None;
    }
    Some(CompiledLight::Environment(Environment::Image {
        image: image.into(),
        up: up.as_vec3(),
        scale,
    }))
}
