//! Texture unit 0 of fixed function: coordinates at a vertex, texels at a fragment, and the environment that brings both together
//! (compatibility profile specification, sections 12.1.3, 8.14 and 16.1).

use crate::capture::Attributes;
use crate::enums::*;
use crate::lighting::{Setup, normalized, transform};
use crate::ranks::wire::{Malformed, Reader, Wire, put_pods};
use crate::real::gl;
use crate::state::snapshot::{Snapshot, TextureUnit};
use rt_core::texture::{Filter, Texture, Wrap};
use std::collections::HashMap;
use std::sync::Arc;

/// What a texture's components stand for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Base {
    Alpha,
    Luminance,
    LuminanceAlpha,
    Intensity,
    Rgb,
    Rgba,
}

/// Level 0 of a texture.
#[derive(Debug, Clone)]
pub(crate) struct Image {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) texels: Vec<[f32; 4]>,
    base: Base,
    linear: bool,
    wrap: [u32; 2],
    border: [f32; 4],
}

crate::ranks::wire::wire_enum!(Base { Alpha, Luminance, LuminanceAlpha, Intensity, Rgb, Rgba });

impl Wire for Image {
    fn put(&self, out: &mut Vec<u8>) {
        (self.width, self.height).put(out);
        put_pods(out, &self.texels);
        self.base.put(out);
        self.linear.put(out);
        self.wrap.put(out);
        self.border.put(out);
    }
    fn get(from: &mut Reader<'_>) -> Result<Self, Malformed> {
        let (width, height): (usize, usize) = Wire::get(from)?;
        let texels = from.pods()?;
        if width.checked_mul(height) != Some(texels.len()) || texels.is_empty() {
            return Err(from.fault(format!("an image of {width} x {height} with {} texels", texels.len())));
        }
        let (base, linear) = Wire::get(from)?;
        let (wrap, border) = Wire::get(from)?;
        Ok(Image { width, height, texels, base, linear, wrap, border })
    }
}

fn base_of(format: u32) -> Base {
    match format {
        0x1906 | 0x803b..=0x803e => Base::Alpha,
        1 | 0x1909 | 0x803f..=0x8042 => Base::Luminance,
        2 | 0x190a | 0x8043..=0x8048 => Base::LuminanceAlpha,
        0x8049..=0x804d => Base::Intensity,
        3 | 0x1907 | 0x2a10 | 0x804f..=0x8054 => Base::Rgb,
        _ => Base::Rgba,
    }
}

/// The version at which a texture was read, and what it was.
type Versioned = (u64, Option<Arc<Image>>);

/// Images by texture name, with the version they were read at.
#[derive(Default)]
pub(crate) struct Images {
    images: HashMap<(u32, u32), Versioned>,
}

impl Images {
    /// The image of the bound texture; `None` when it is incomplete (then OpenGL leaves texturing out) or cannot be followed.
    pub(crate) fn get(&mut self, target: u32, name: u32, version: u64) -> Option<Arc<Image>> {
        if let Some((v, image)) = self.images.get(&(target, name))
            && *v == version
        {
            return image.clone();
        }
        let image = read(target).map(Arc::new);
        self.images.insert((target, name), (version, image.clone()));
        image
    }
}

/// Texels of the greatest texture that is read.
const MOST_TEXELS: i64 = 1 << 26;

/// Whether rays can follow the sampling of the bound texture; the reason if not.
pub(crate) fn followed(target: u32) -> Result<(), &'static str> {
    let min = gl::tex_parameter_i::<1>(target, TEXTURE_MIN_FILTER)[0].cast_unsigned();
    let mag = gl::tex_parameter_i::<1>(target, TEXTURE_MAG_FILTER)[0].cast_unsigned();
    if min != mag {
        return Err("a texture with mipmaps or two filters");
    }
    Ok(())
}

/// Why fixed function's sampling of the bound texture cannot be followed; `None` when it can, or when the texture is incomplete and so left out.
pub(crate) fn unfollowed(target: u32) -> Option<&'static str> {
    let level = |what| gl::tex_level_i::<1>(target, 0, what)[0];
    const TEXTURE_BASE_LEVEL: u32 = 0x813c;
    if gl::tex_parameter_i::<1>(target, TEXTURE_BASE_LEVEL)[0] != 0 {
        return Some("a texture whose base level is not 0");
    }
    let (width, height) = (i64::from(level(TEXTURE_WIDTH)), i64::from(level(TEXTURE_HEIGHT)));
    if width <= 0 || height <= 0 {
        return None;
    }
    if width * height > MOST_TEXELS {
        return Some("a texture too large to read");
    }
    match level(TEXTURE_INTERNAL_FORMAT).cast_unsigned() {
        0x1902 | 0x84f9 | 0x81a5..=0x81a7 | 0x88f0 | 0x8cac | 0x8cad => return Some("a texture of depths"),
        0x8d70..=0x8d8f => return Some("a texture of integers"),
        _ => {}
    }
    let min = gl::tex_parameter_i::<1>(target, TEXTURE_MIN_FILTER)[0].cast_unsigned();
    let mag = gl::tex_parameter_i::<1>(target, TEXTURE_MAG_FILTER)[0].cast_unsigned();
    match min {
        NEAREST | LINEAR if min == mag => None,
        NEAREST | LINEAR => Some("a texture with two filters"),
        _ => Some("a texture with mipmaps"),
    }
}

fn read(target: u32) -> Option<Image> {
    let level = |what| gl::tex_level_i::<1>(target, 0, what)[0];
    let (width, height) = (level(TEXTURE_WIDTH).max(0) as usize, level(TEXTURE_HEIGHT).max(0) as usize);
    if width == 0 || height == 0 || (width * height) as i64 > MOST_TEXELS {
        return None;
    }
    let base = base_of(level(TEXTURE_INTERNAL_FORMAT).cast_unsigned());
    let parameter = |what| gl::tex_parameter_i::<1>(target, what)[0].cast_unsigned();
    Some(Image {
        width,
        height,
        texels: gl::tex_image_rgba(target, width * height),
        base,
        linear: parameter(TEXTURE_MAG_FILTER) == LINEAR,
        wrap: [
            parameter(TEXTURE_WRAP_S),
            if target == TEXTURE_1D { CLAMP_TO_EDGE } else { parameter(TEXTURE_WRAP_T) },
        ],
        border: gl::tex_parameter_f(target, TEXTURE_BORDER_COLOR),
    })
}

impl Image {
    /// True when no texel lets anything through.
    pub(crate) fn is_opaque(&self) -> bool {
        self.texels.iter().all(|t| t[3] == 1.0)
            && (self.wrap != [CLAMP_TO_BORDER; 2] || self.border[3] == 1.0)
    }

    /// The picture as a texture of rt-core's, with what its components stand for; `None` when it cannot be one.
    pub(crate) fn as_texture(&self) -> Option<Texture> {
        let rgba = |t: &[f32; 4]| match self.base {
            Base::Alpha => [1.0, 1.0, 1.0, t[3]],
            Base::Luminance => [t[0], t[0], t[0], 1.0],
            Base::LuminanceAlpha => [t[0], t[0], t[0], t[3]],
            Base::Intensity => [t[0]; 4],
            Base::Rgb => [t[0], t[1], t[2], 1.0],
            Base::Rgba => *t,
        };
        let texels = self.texels.iter().map(rgba).collect();
        let wrap = self.wrap.map(|w| match w {
            REPEAT => Wrap::Repeat,
            MIRRORED_REPEAT => Wrap::Mirror,
            _ => Wrap::Clamp,
        });
        let filter = if self.linear { Filter::Bilinear } else { Filter::Nearest };
        let mut texture = Texture::from_linear(self.width, self.height, texels).ok()?;
        (texture.wrap, texture.filter) = (wrap, filter);
        Some(texture)
    }

    fn texel(&self, x: i64, y: i64) -> [f32; 4] {
        let (w, h) = (self.width as i64, self.height as i64);
        let place = |i: i64, n: i64, wrap: u32| match wrap {
            REPEAT => Some(i.rem_euclid(n)),
            MIRRORED_REPEAT => {
                let k = i.rem_euclid(2 * n);
                Some(if k < n { k } else { 2 * n - 1 - k })
            }
            CLAMP_TO_EDGE => Some(i.clamp(0, n - 1)),
            _ => (0..n).contains(&i).then_some(i),
        };
        match (place(x, w, self.wrap[0]), place(y, h, self.wrap[1])) {
            (Some(x), Some(y)) => self.texels[(y * w + x) as usize],
            _ => self.border,
        }
    }

    /// The filtered texel at (s, t).
    pub(crate) fn sample(&self, s: f32, t: f32) -> [f32; 4] {
        let clamp = |v: f32, wrap: u32| if wrap == CLAMP { v.clamp(0.0, 1.0) } else { v };
        let x = clamp(s, self.wrap[0]) * self.width as f32;
        let y = clamp(t, self.wrap[1]) * self.height as f32;
        if !(x.is_finite() && y.is_finite()) {
            return self.border;
        }
        if !self.linear {
            // GL_CLAMP at 1 is the last texel here.
            let last = |v: f32, n: usize, wrap: u32| {
                let i = v.floor() as i64;
                if wrap == CLAMP { i.min(n as i64 - 1) } else { i }
            };
            return self.texel(last(x, self.width, self.wrap[0]), last(y, self.height, self.wrap[1]));
        }
        let (x, y) = (x - 0.5, y - 0.5);
        let (i, j) = (x.floor(), y.floor());
        let (a, b) = (x - i, y - j);
        let (i, j) = (i as i64, j as i64);
        let [p, q, r, u] = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| self.texel(i + dx, j + dy));
        std::array::from_fn(|k| {
            let (lo, hi) = (p[k] + (q[k] - p[k]) * a, r[k] + (u[k] - r[k]) * a);
            lo + (hi - lo) * b
        })
    }
}

/// Texture coordinates of vertex `i`, generated and transformed.
pub(crate) fn coordinates(
    unit: &TextureUnit,
    state: &Snapshot,
    attributes: &Attributes,
    lighting: &Setup<'_>,
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
        let m = 2.0 * (reflected[0].powi(2) + reflected[1].powi(2) + (reflected[2] + 1.0).powi(2)).sqrt();
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

/// The fragment's colour after the texture environment.
pub(crate) fn apply(unit: &TextureUnit, image: &Image, f: [f32; 4], coords: [f32; 4]) -> [f32; 4] {
    let q = if coords[3] == 0.0 { 1.0 } else { coords[3] };
    let t = image.sample(coords[0] / q, coords[1] / q);
    environment(unit.env_mode, unit.env_color, image.base, f, t)
}

fn environment(mode: u32, constant: [f32; 4], base: Base, f: [f32; 4], t: [f32; 4]) -> [f32; 4] {
    // What GetTexImage gives for luminance and intensity is in the first component.
    let (ct, at) = match base {
        Base::Alpha => ([0.0; 3], t[3]),
        Base::Luminance => ([t[0]; 3], 1.0),
        Base::LuminanceAlpha => ([t[0]; 3], t[3]),
        Base::Intensity => ([t[0]; 3], t[0]),
        Base::Rgb => ([t[0], t[1], t[2]], 1.0),
        Base::Rgba => ([t[0], t[1], t[2]], t[3]),
    };
    let (has_color, has_alpha) = (base != Base::Alpha, !matches!(base, Base::Luminance | Base::Rgb));
    let mut out = f;
    for k in 0..3 {
        out[k] = match mode {
            _ if !has_color => f[k],
            REPLACE => ct[k],
            DECAL if base == Base::Rgba => f[k] * (1.0 - at) + ct[k] * at,
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
        BLEND | ADD if base == Base::Intensity => {
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

    fn image(linear: bool, wrap: u32) -> Image {
        let texels = vec![[0.0; 4], [1.0; 4]];
        Image {
            width: 2,
            height: 1,
            texels,
            base: Base::Rgba,
            linear,
            wrap: [wrap, CLAMP_TO_EDGE],
            border: [0.5; 4],
        }
    }

    #[test]
    fn filters_and_wraps_are_opengls() {
        assert_eq!(image(false, REPEAT).sample(1.3, 0.0)[0], 0.0);
        assert_eq!(image(false, MIRRORED_REPEAT).sample(1.3, 0.0)[0], 1.0);
        assert_eq!(image(false, CLAMP_TO_BORDER).sample(1.3, 0.0)[0], 0.5);
        assert_eq!(image(true, CLAMP_TO_EDGE).sample(0.5, 0.5)[0], 0.5);
        assert_eq!(image(true, CLAMP_TO_EDGE).sample(9.0, 0.5)[0], 1.0);
        assert_eq!(image(true, CLAMP).sample(1.0, 0.5)[0], 0.75, "half edge, half border");
    }

    #[test]
    fn environments_follow_the_table_of_the_specification() {
        let (f, t, c) = ([0.5, 0.5, 0.5, 0.5], [1.0, 0.0, 0.25, 0.5], [1.0; 4]);
        assert_eq!(environment(MODULATE, c, Base::Rgba, f, t), [0.5, 0.0, 0.125, 0.25]);
        assert_eq!(environment(DECAL, c, Base::Rgba, f, t), [0.75, 0.25, 0.375, 0.5]);
        assert_eq!(environment(REPLACE, c, Base::Rgb, f, t), [1.0, 0.0, 0.25, 0.5]);
        assert_eq!(environment(BLEND, c, Base::Luminance, f, t), [1.0, 1.0, 1.0, 0.5]);
        assert_eq!(environment(MODULATE, c, Base::Alpha, f, t), [0.5, 0.5, 0.5, 0.25]);
    }
}
