//! Fixed-function texturing on unit 0: coordinates at a vertex, texels at a fragment, and the
//! environment that combines them with the colour (compatibility profile specification, sections
//! 12.1.3, 8.14 and 16.1).

mod filters;
mod image;
mod sampling;

use crate::capture::draw::Attributes;
use crate::enums::*;
use crate::state::matrix::transform;
use crate::state::snapshot::{Snapshot, TextureUnit};
use crate::trace::lighting::{LightingSetup, normalized};
pub(crate) use filters::{Filters, Mip};
pub(crate) use image::{BaseFormat, Image, Level, Texels};

/// The texture coordinates of vertex `i`, generated and transformed.
pub(crate) fn coordinates(
    unit: &TextureUnit,
    state: &Snapshot,
    attributes: &Attributes,
    lighting: &LightingSetup<'_>,
    i: usize,
    p: [f32; 3],
) -> [f32; 4] {
    let mut c = attributes.tex.at(i);
    if unit.generate.iter().any(|g| g.0 != 0) {
        let eye = transform(&state.model_view, p);
        let normal = lighting.eye_normal(attributes.normals.at(i));
        let toward = normalized([eye[0], eye[1], eye[2]]);
        let twice = 2.0 * (normal[0] * toward[0] + normal[1] * toward[1] + normal[2] * toward[2]);
        let reflected: [f32; 3] = std::array::from_fn(|k| toward[k] - normal[k] * twice);
        let m = 2.0
            * (reflected[0].powi(2) + reflected[1].powi(2) + (reflected[2] + 1.0).powi(2)).sqrt();
        for (k, (mode, plane)) in unit.generate.iter().enumerate() {
            let dot = |v: [f32; 4]| (0..4).map(|j| plane[j] * v[j]).sum::<f32>();
            c[k] = match *mode {
                OBJECT_LINEAR => dot([p[0], p[1], p[2], 1.0]),
                EYE_LINEAR => dot(eye),
                SPHERE_MAP if k < 2 => reflected[k] / m + 0.5,
                REFLECTION_MAP if k < 3 => reflected[k],
                NORMAL_MAP if k < 3 => normal[k],
                _ => c[k],
            };
        }
    }
    let m = &unit.matrix;
    std::array::from_fn(|r| m[r] * c[0] + m[4 + r] * c[1] + m[8 + r] * c[2] + m[12 + r] * c[3])
}

/// Where coordinates are on the texture.
pub(crate) fn divided(coords: [f32; 4]) -> [f32; 2] {
    let q = if coords[3] == 0.0 { 1.0 } else { coords[3] };
    [coords[0] / q, coords[1] / q]
}

/// The fragment's colour after the texture environment. `rho` is the number of texels that its
/// pixel covers, where that is known.
pub(crate) fn apply(
    unit: &TextureUnit,
    image: &Image,
    f: [f32; 4],
    coords: [f32; 4],
    rho: Option<f32>,
) -> [f32; 4] {
    let [u, v] = divided(coords);
    let t = match rho {
        Some(rho) => image.sample_over(u, v, rho),
        None => image.sample(u, v),
    };
    environment(unit.env_mode, unit.env_color, image.base, f, t)
}

fn environment(
    mode: u32,
    constant: [f32; 4],
    base: BaseFormat,
    f: [f32; 4],
    t: [f32; 4],
) -> [f32; 4] {
    // GetTexImage returns luminance and intensity in the first component.
    let (ct, at) = match base {
        BaseFormat::Alpha => ([0.0; 3], t[3]),
        BaseFormat::Luminance => ([t[0]; 3], 1.0),
        BaseFormat::LuminanceAlpha => ([t[0]; 3], t[3]),
        BaseFormat::Intensity => ([t[0]; 3], t[0]),
        BaseFormat::Rgb => ([t[0], t[1], t[2]], 1.0),
        BaseFormat::Rgba => ([t[0], t[1], t[2]], t[3]),
    };
    let (has_color, has_alpha) =
        (base != BaseFormat::Alpha, !matches!(base, BaseFormat::Luminance | BaseFormat::Rgb));
    let mut out = f;
    for k in 0..3 {
        out[k] = match mode {
            _ if !has_color => f[k],
            REPLACE => ct[k],
            DECAL if base == BaseFormat::Rgba => f[k] * (1.0 - at) + ct[k] * at,
            DECAL => ct[k],
            BLEND => f[k] * (1.0 - ct[k]) + constant[k] * ct[k],
            ADD => f[k] + ct[k],
            _ => f[k] * ct[k],
        };
    }
    out[3] = match mode {
        DECAL => f[3],
        _ if !has_alpha => f[3],
        REPLACE => at,
        BLEND | ADD if base == BaseFormat::Intensity => {
            if mode == ADD {
                f[3] + at
            } else {
                f[3] * (1.0 - at) + constant[3] * at
            }
        }
        _ => f[3] * at,
    };
    out.map(|v| v.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn environments_follow_the_table_of_the_specification() {
        let (f, t, c) = ([0.5, 0.5, 0.5, 0.5], [1.0, 0.0, 0.25, 0.5], [1.0; 4]);
        assert_eq!(environment(MODULATE, c, BaseFormat::Rgba, f, t), [0.5, 0.0, 0.125, 0.25]);
        assert_eq!(environment(DECAL, c, BaseFormat::Rgba, f, t), [0.75, 0.25, 0.375, 0.5]);
        assert_eq!(environment(REPLACE, c, BaseFormat::Rgb, f, t), [1.0, 0.0, 0.25, 0.5]);
        assert_eq!(environment(BLEND, c, BaseFormat::Luminance, f, t), [1.0, 1.0, 1.0, 0.5]);
        assert_eq!(environment(MODULATE, c, BaseFormat::Alpha, f, t), [0.5, 0.5, 0.5, 0.25]);
    }
}
