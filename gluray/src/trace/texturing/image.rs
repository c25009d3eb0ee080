//! Texture images, level by level, in the driver's format.

use super::filters::Filters;
use crate::cluster::codec::{MalformedMessage, Reader, Wire, put_pods};
use crate::enums::*;
use rt_core::texture::{Filter, Texture, Wrap};

/// The meaning of a texture's components.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum BaseFormat {
    Alpha,
    Luminance,
    LuminanceAlpha,
    Intensity,
    Rgb,
    Rgba,
}

/// Texels, row by row.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Texels {
    /// Eight bits per component, as in most textures. It needs a quarter of the memory, and reading
    /// from the driver is a copy.
    Bytes(Vec<[u8; 4]>),
    /// Components of other sizes.
    Floats(Vec<[f32; 4]>),
}

impl Texels {
    pub(crate) fn len(&self) -> usize {
        match self {
            Texels::Bytes(v) => v.len(),
            Texels::Floats(v) => v.len(),
        }
    }

    #[inline]
    pub(super) fn at(&self, i: usize) -> [f32; 4] {
        match self {
            Texels::Bytes(v) => v[i].map(|c| f32::from(c) * (1.0 / 255.0)),
            Texels::Floats(v) => v[i],
        }
    }
}

/// One level of a texture.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Level {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) texels: Texels,
}

/// A texture: its base level and, with mipmaps, the levels after it.
#[derive(Debug, Clone)]
pub(crate) struct Image {
    /// Never empty.
    pub(crate) levels: Vec<Level>,
    pub(crate) base: BaseFormat,
    pub(crate) filters: Filters,
    pub(crate) wrap: [u32; 2],
    pub(crate) border: [f32; 4],
}

crate::cluster::codec::wire_enum!(BaseFormat {
    Alpha,
    Luminance,
    LuminanceAlpha,
    Intensity,
    Rgb,
    Rgba
});

impl Wire for Level {
    fn put(&self, out: &mut Vec<u8>) {
        (self.width, self.height).put(out);
        match &self.texels {
            Texels::Bytes(v) => {
                false.put(out);
                put_pods(out, v);
            }
            Texels::Floats(v) => {
                true.put(out);
                put_pods(out, v);
            }
        }
    }
    fn get(from: &mut Reader<'_>) -> Result<Self, MalformedMessage> {
        let (width, height): (usize, usize) = Wire::get(from)?;
        let texels = if Wire::get(from)? {
            Texels::Floats(from.pods()?)
        } else {
            Texels::Bytes(from.pods()?)
        };
        if width.checked_mul(height) != Some(texels.len()) || texels.len() == 0 {
            return Err(
                from.fault(format!("an image of {width} x {height} with {} texels", texels.len()))
            );
        }
        Ok(Level { width, height, texels })
    }
}

impl Wire for Image {
    fn put(&self, out: &mut Vec<u8>) {
        self.levels.put(out);
        self.base.put(out);
        self.filters.put(out);
        self.wrap.put(out);
        self.border.put(out);
    }
    fn get(from: &mut Reader<'_>) -> Result<Self, MalformedMessage> {
        let levels: Vec<Level> = Wire::get(from)?;
        if levels.is_empty() {
            return Err(from.fault("an image without a level".to_owned()));
        }
        let (base, filters) = Wire::get(from)?;
        let (wrap, border) = Wire::get(from)?;
        Ok(Image { levels, base, filters, wrap, border })
    }
}

impl Image {
    /// Colours in a row, found by their numbers.
    fn of_row(texels: Texels) -> Image {
        let level = Level { width: texels.len(), height: 1, texels };
        Image {
            levels: vec![level],
            base: BaseFormat::Rgba,
            filters: Filters::NEAREST,
            wrap: [CLAMP_TO_EDGE; 2],
            border: [0.0; 4],
        }
    }

    /// The same of eight bits a component.
    pub(crate) fn of_bytes(texels: Vec<[u8; 4]>) -> Image {
        Image::of_row(Texels::Bytes(texels))
    }

    /// The same of numbers of any size.
    pub(crate) fn of_floats(texels: Vec<[f32; 4]>) -> Image {
        Image::of_row(Texels::Floats(texels))
    }

    /// The colour of a number; white where there is none.
    pub(crate) fn numbered(&self, i: usize) -> [f32; 4] {
        let texels = &self.levels[0].texels;
        if i < texels.len() { texels.at(i) } else { [1.0; 4] }
    }

    /// True when its components are red, green, blue and alpha, or the first of these.
    pub(crate) fn is_of_colors(&self) -> bool {
        matches!(self.base, BaseFormat::Rgb | BaseFormat::Rgba)
    }

    /// True when every texel is opaque.
    pub(crate) fn is_opaque(&self) -> bool {
        let opaque = |l: &Level| match &l.texels {
            Texels::Bytes(v) => v.iter().all(|t| t[3] == 255),
            Texels::Floats(v) => v.iter().all(|t| t[3] == 1.0),
        };
        self.levels.iter().all(opaque)
            && (self.wrap != [CLAMP_TO_BORDER; 2] || self.border[3] == 1.0)
    }

    /// The image as an rt-core texture, with the meaning of its components. `None` when it cannot
    /// be converted.
    pub(crate) fn as_texture(&self) -> Option<Texture> {
        let rgba = |t: [f32; 4]| match self.base {
            BaseFormat::Alpha => [1.0, 1.0, 1.0, t[3]],
            BaseFormat::Luminance => [t[0], t[0], t[0], 1.0],
            BaseFormat::LuminanceAlpha => [t[0], t[0], t[0], t[3]],
            BaseFormat::Intensity => [t[0]; 4],
            BaseFormat::Rgb => [t[0], t[1], t[2], 1.0],
            BaseFormat::Rgba => t,
        };
        let level = &self.levels[0];
        let texels = (0..level.texels.len()).map(|i| rgba(level.texels.at(i))).collect();
        let wrap = self.wrap.map(|w| match w {
            REPEAT => Wrap::Repeat,
            MIRRORED_REPEAT => Wrap::Mirror,
            _ => Wrap::Clamp,
        });
        let filter = if self.filters.mag_linear { Filter::Bilinear } else { Filter::Nearest };
        let mut texture = Texture::from_linear(level.width, level.height, texels).ok()?;
        (texture.wrap, texture.filter) = (wrap, filter);
        Some(texture)
    }
}
