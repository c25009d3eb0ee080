//! Reads texture images from the driver, when something is drawn with them.

use crate::driver::gl;
use crate::enums::*;
use crate::trace::texturing::{BaseFormat, Filters, Image, Level, Mip, Texels};
use std::collections::HashMap;
use std::sync::Arc;

/// The meaning of the components, from the sizes of red, green, blue, alpha, luminance and
/// intensity. There are too many formats to list them by name.
fn base_of([red, _, _, alpha, luminance, intensity]: [i32; 6]) -> BaseFormat {
    match (red > 0, alpha > 0, luminance > 0, intensity > 0) {
        (_, _, _, true) => BaseFormat::Intensity,
        (_, true, true, _) => BaseFormat::LuminanceAlpha,
        (_, false, true, _) => BaseFormat::Luminance,
        (false, true, ..) => BaseFormat::Alpha,
        (_, false, ..) => BaseFormat::Rgb,
        _ => BaseFormat::Rgba,
    }
}

/// The version at which a texture was read, and its image.
type VersionedImage = (u64, Option<Arc<Image>>);

/// Images by texture name, with the version at which they were read.
#[derive(Default)]
pub(crate) struct TextureCache {
    images: HashMap<(u32, u32), VersionedImage>,
    /// The memory of a dropped image. A program that replaces a texture in each frame uses the same
    /// size again.
    spare: Vec<[u8; 4]>,
    /// The context has no fixed function: textures have no luminance and units no bias.
    pub(crate) core: bool,
    /// The number of images read from the driver.
    pub(crate) read: u64,
}

impl TextureCache {
    /// The image of a texture. `None` when it is incomplete (OpenGL then disables texturing) or
    /// cannot be reproduced.
    ///
    /// A texture is read only when something is drawn with it. Images of earlier versions can never
    /// be needed again and are dropped at once, so no more are held than the program has.
    pub(crate) fn get(&mut self, target: u32, name: u32, version: u64) -> Option<Arc<Image>> {
        if let Some((v, image)) = self.images.get(&(target, name))
            && *v == version
        {
            return image.clone();
        }
        let stale: Vec<Arc<Image>> =
            self.images.extract_if(|_, (v, _)| *v != version).filter_map(|(_, (_, i))| i).collect();
        for image in stale.into_iter().filter_map(Arc::into_inner) {
            for level in image.levels {
                if let Texels::Bytes(v) = level.texels
                    && v.len() > self.spare.len()
                {
                    self.spare = v;
                }
            }
        }
        let image = read_bound(target, name, self.core, &mut self.spare).map(Arc::new);
        self.read += u64::from(image.is_some());
        self.images.insert((target, name), (version, image.clone()));
        image
    }
}

/// Reads a texture by its name. Another texture may be bound by now.
fn read_bound(target: u32, name: u32, core: bool, spare: &mut Vec<[u8; 4]>) -> Option<Image> {
    let bound =
        gl::word(if target == TEXTURE_1D { TEXTURE_BINDING_1D } else { TEXTURE_BINDING_2D });
    if bound != name {
        gl::bind_texture(target, name);
    }
    let image = gl::with_raw_pixel_reads(core, |plainly| read(plainly, target, core, spare));
    if bound != name {
        gl::bind_texture(target, bound);
    }
    image
}

/// Sizes of red, green, blue, alpha, luminance, intensity.
const COMPONENT_SIZES: [u32; 6] = [
    TEXTURE_RED_SIZE,
    TEXTURE_GREEN_SIZE,
    TEXTURE_BLUE_SIZE,
    TEXTURE_ALPHA_SIZE,
    TEXTURE_LUMINANCE_SIZE,
    TEXTURE_INTENSITY_SIZE,
];

fn read(
    plainly: &gl::RawPixelTransfer,
    target: u32,
    core: bool,
    spare: &mut Vec<[u8; 4]>,
) -> Option<Image> {
    let of_level = |n: i32, what| gl::tex_level_i::<1>(target, n, what)[0];
    let size =
        |n: i32| [TEXTURE_WIDTH, TEXTURE_HEIGHT].map(|what| of_level(n, what).max(0) as usize);
    let parameter = |what| gl::tex_parameter_i::<1>(target, what)[0].cast_unsigned();
    let first = parameter(TEXTURE_BASE_LEVEL).min(31).cast_signed();
    let [width, height] = size(first);
    if width == 0 || height == 0 || width * height > 1 << 26 {
        return None;
    }
    let format = of_level(first, TEXTURE_INTERNAL_FORMAT).cast_unsigned();
    let [min, mag] = [TEXTURE_MIN_FILTER, TEXTURE_MAG_FILTER].map(parameter);
    let filters = filters(target, core, min, mag);
    // A texture is complete when all levels exist, in one format, down to one texel or to the last
    // allowed level.
    let smallest = first + width.max(height).ilog2().cast_signed();
    let last = match filters.mip {
        Mip::None => first,
        _ => smallest.min(parameter(TEXTURE_MAX_LEVEL).min(1000).cast_signed()),
    };
    if last < first {
        return None;
    }
    let halved = |n: i32| [width, height].map(|v| (v >> (n - first)).max(1));
    let is_complete = (first + 1..=last).all(|n| {
        size(n) == halved(n) && of_level(n, TEXTURE_INTERNAL_FORMAT).cast_unsigned() == format
    });
    if !is_complete {
        return None;
    }
    // Signed components have other quantisation steps.
    let signed = matches!(format, RED_SNORM..=RGBA16_SNORM | ALPHA_SNORM..=INTENSITY16_SNORM);
    let sizes = COMPONENT_SIZES.map(|what| match what {
        TEXTURE_LUMINANCE_SIZE | TEXTURE_INTENSITY_SIZE if core => 0,
        _ => of_level(first, what),
    });
    let whole = !signed && sizes.iter().all(|bits| matches!(bits, 0 | 8));
    // Decoded before filtering, as in the driver.
    let encoded = matches!(format, SRGB..=COMPRESSED_SRGB_ALPHA_S3TC_DXT5)
        && parameter(TEXTURE_SRGB_DECODE) != SKIP_DECODE;
    let levels = (first..=last).map(|n| {
        let [width, height] = halved(n);
        let texels = if whole && !encoded {
            Texels::Bytes(gl::tex_image_bytes(plainly, target, n, std::mem::take(spare)))
        } else {
            let mut texels = gl::tex_image_rgba(plainly, target, n);
            if encoded {
                texels.iter_mut().for_each(|t| (0..3).for_each(|k| t[k] = decoded(t[k])));
            }
            Texels::Floats(texels)
        };
        Level { width, height, texels }
    });
    let levels: Vec<Level> = levels.collect();
    if levels.iter().any(|l| l.texels.len() != l.width * l.height) {
        // Another thread has resized the texture in the meantime.
        return None;
    }
    Some(Image {
        levels,
        base: base_of(sizes),
        filters,
        wrap: [
            parameter(TEXTURE_WRAP_S),
            if target == TEXTURE_1D { CLAMP_TO_EDGE } else { parameter(TEXTURE_WRAP_T) },
        ],
        border: gl::tex_parameter_f(target, TEXTURE_BORDER_COLOR),
    })
}

/// The linear value of an sRGB component (OpenGL 4.6, equation 8.17).
fn decoded(v: f32) -> f32 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// The filters of the bound texture and its unit.
fn filters(target: u32, core: bool, min: u32, mag: u32) -> Filters {
    let one = |what| gl::tex_parameter_f::<1>(target, what)[0];
    let of_unit = match core {
        true => 0.0,
        false => gl::tex_env_f::<1>(TEXTURE_FILTER_CONTROL, TEXTURE_LOD_BIAS)[0],
    };
    Filters {
        mag_linear: mag == LINEAR,
        min_linear: matches!(min, LINEAR | LINEAR_MIPMAP_NEAREST | LINEAR_MIPMAP_LINEAR),
        mip: match min {
            NEAREST | LINEAR => Mip::None,
            NEAREST_MIPMAP_NEAREST | LINEAR_MIPMAP_NEAREST => Mip::Nearest,
            _ => Mip::Linear,
        },
        bias: one(TEXTURE_LOD_BIAS) + of_unit,
        lod: [one(TEXTURE_MIN_LOD), one(TEXTURE_MAX_LOD)],
    }
}
