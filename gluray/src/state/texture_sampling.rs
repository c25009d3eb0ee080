//! Whether rays can reproduce how the driver samples a texture.

use crate::driver::gl;
use crate::enums::*;

/// The number of texels of the largest texture that is read.
const MOST_TEXELS: i64 = 1 << 26;

/// Checks that rays can reproduce the sampling of the bound texture. The error is the reason.
pub(crate) fn check_sampling(target: u32) -> Result<(), &'static str> {
    let min = gl::tex_parameter_i::<1>(target, TEXTURE_MIN_FILTER)[0].cast_unsigned();
    let mag = gl::tex_parameter_i::<1>(target, TEXTURE_MAG_FILTER)[0].cast_unsigned();
    if min != mag {
        return Err("a texture with mipmaps or two filters");
    }
    Ok(())
}

/// The reason why the fixed-function sampling of the bound texture cannot be reproduced. `None`
/// when it can, or when the texture is incomplete and therefore disabled.
pub(crate) fn unsupported_sampling(target: u32, version: u32) -> Option<&'static str> {
    const SWIZZLE: [u32; 4] =
        [TEXTURE_SWIZZLE_R, TEXTURE_SWIZZLE_G, TEXTURE_SWIZZLE_B, TEXTURE_SWIZZLE_A];
    let parameter = |what| gl::tex_parameter_i::<1>(target, what)[0];
    let base = parameter(TEXTURE_BASE_LEVEL).clamp(0, 31);
    let level = |what| gl::tex_level_i::<1>(target, base, what)[0];
    let (width, height) = (i64::from(level(TEXTURE_WIDTH)), i64::from(level(TEXTURE_HEIGHT)));
    if width <= 0 || height <= 0 {
        return None;
    }
    if width * height > MOST_TEXELS {
        return Some("a texture too large to read");
    }
    match level(TEXTURE_INTERNAL_FORMAT).cast_unsigned() {
        DEPTH_COMPONENT
        | DEPTH_STENCIL
        | DEPTH_COMPONENT16..=DEPTH_COMPONENT32
        | DEPTH24_STENCIL8
        | DEPTH_COMPONENT32F
        | DEPTH32F_STENCIL8 => return Some("a texture of depths"),
        RGBA32UI..=RGB8I => return Some("a texture of integers"),
        _ => {}
    }
    if gl::tex_parameter_f::<1>(target, TEXTURE_MAX_ANISOTROPY)[0] > 1.0 {
        return Some("a texture with anisotropic filtering");
    }
    if version >= 33
        && SWIZZLE.map(|what| parameter(what).cast_unsigned()) != [RED, GREEN, BLUE, ALPHA]
    {
        return Some("a texture with its components in another order");
    }
    if version >= 33 && gl::word(SAMPLER_BINDING) != 0 {
        return Some("a sampler object");
    }
    None
}
