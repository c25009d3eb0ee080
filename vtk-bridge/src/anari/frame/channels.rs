//! Converts the renderer's layers to channels: rows start at the bottom, and pixels are packed as
//! the program requested.

use crate::anari::data_type::DataType;
use crate::anari::scene::FrameBackground;
use crate::anari::scene::world::Ids;
use rt_core::colormap::linear_to_srgb;
use rt_core::frame::Frame;

/// A channel's pixels.
pub struct Channel {
    /// Type of a pixel.
    pub data_type: DataType,
    /// Row by row from the bottom.
    pub pixels: Pixels,
}

/// Memory with the alignment that the pixels' type needs.
pub enum Pixels {
    /// 8-bit components.
    Bytes(Vec<u8>),
    /// 16-bit components.
    Shorts(Vec<i16>),
    /// Numbers.
    Words(Vec<u32>),
    /// Floating point components.
    Floats(Vec<f32>),
}

impl Pixels {
    /// Where they begin.
    pub fn address(&self) -> *const std::ffi::c_void {
        match self {
            Pixels::Bytes(v) => v.as_ptr().cast(),
            Pixels::Shorts(v) => v.as_ptr().cast(),
            Pixels::Words(v) => v.as_ptr().cast(),
            Pixels::Floats(v) => v.as_ptr().cast(),
        }
    }
}

/// Values in the renderer's order, top row first, as rows from the bottom.
fn upright<T>(values: &[T], width: u32) -> impl Iterator<Item = &T> {
    values.chunks_exact(width.max(1) as usize).rev().flatten()
}

fn byte(v: f32) -> u8 {
    (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// Colours over the backdrop, linear, rows from the bottom.
pub(super) fn over(
    color: &[[f32; 4]],
    [width, height]: [u32; 2],
    backdrop: &FrameBackground,
) -> Vec<[f32; 4]> {
    let place = |i: usize, n: u32| (i as f32 + 0.5) / n as f32;
    upright(color, width)
        .enumerate()
        .map(|(i, &[r, g, b, a])| {
            let (x, y) = (i % width as usize, i / width as usize);
            let behind = backdrop.at(place(x, width), place(y, height));
            let rest = 1.0 - a.clamp(0.0, 1.0);
            [r + rest * behind[0], g + rest * behind[1], b + rest * behind[2], a + rest * behind[3]]
        })
        .collect()
}

/// Colour pixels with `N` components of an image that is already upright.
pub(super) fn color<const N: usize>(
    pixels: impl Iterator<Item = [f32; 4]>,
    data_type: DataType,
) -> Channel {
    let linear = |p: [f32; 4]| <[f32; N]>::try_from(&p[..N]).unwrap_or([0.0; N]);
    let out = match data_type {
        DataType::FLOAT32_VEC4 | DataType::FLOAT32_VEC3 => {
            Pixels::Floats(pixels.flat_map(linear).collect())
        }
        DataType::UFIXED8_RGBA_SRGB | DataType::UFIXED8_RGB_SRGB => {
            // Alpha stays linear.
            let encode = |(c, v): (usize, f32)| {
                byte(if c == 3 { v } else { linear_to_srgb(v.clamp(0.0, 1.0)) })
            };
            Pixels::Bytes(
                pixels.flat_map(|p| linear(p).into_iter().enumerate().map(encode)).collect(),
            )
        }
        _ => Pixels::Bytes(pixels.flat_map(|p| linear(p).map(byte)).collect()),
    };
    Channel { data_type, pixels: out }
}

pub(super) fn albedo(color_layer: &[[f32; 4]], width: u32, data_type: DataType) -> Channel {
    color::<3>(upright(color_layer, width).copied(), data_type)
}

pub(super) fn depth(frame: &Frame) -> Channel {
    let floats = upright(&frame.distance, frame.width).copied().collect();
    Channel { data_type: DataType::FLOAT32, pixels: Pixels::Floats(floats) }
}

pub(super) fn normal(frame: &Frame, data_type: DataType) -> Channel {
    let components = upright(&frame.normal, frame.width).flatten();
    let pixels = if data_type == DataType::FIXED16_VEC3 {
        Pixels::Shorts(components.map(|v| (v.clamp(-1.0, 1.0) * 32767.0).round() as i16).collect())
    } else {
        Pixels::Floats(components.copied().collect())
    };
    Channel { data_type, pixels }
}

/// A number per pixel, from the renderer's instance and primitive; `u32::MAX` where nothing is.
pub(super) fn numbers(frame: &Frame, ids: &[Ids], number: impl Fn(&Ids, u32) -> u32) -> Channel {
    let instances = upright(&frame.instance, frame.width);
    let primitives = upright(&frame.primitive, frame.width);
    let words = instances
        .zip(primitives)
        .map(|(&instance, &primitive)| {
            ids.get(instance as usize).map_or(u32::MAX, |id| number(id, primitive))
        })
        .collect();
    Channel { data_type: DataType::UINT32, pixels: Pixels::Words(words) }
}

/// Zeros of a type, for frames that could not be drawn.
pub(super) fn blank(data_type: DataType, pixels: usize) -> Channel {
    let n = data_type.components().max(1) * pixels;
    let pixels = match data_type {
        DataType::FLOAT32 | DataType::FLOAT32_VEC3 | DataType::FLOAT32_VEC4 => {
            Pixels::Floats(vec![0.0; n])
        }
        DataType::FIXED16_VEC3 => Pixels::Shorts(vec![0; n]),
        DataType::UINT32 => Pixels::Words(vec![u32::MAX; n]),
        _ => Pixels::Bytes(vec![0; n]),
    };
    Channel { data_type, pixels }
}
