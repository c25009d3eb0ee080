//! Reads buffer textures: VTK's data for each cell, by the number of the triangle.

use crate::driver::gl;
use crate::enums::*;
use crate::interpose::client_memory::{ArrayLayout, ArraySource};
use crate::trace::texturing::Image;
use std::sync::Arc;

/// The buffer behind the buffer texture of a program's sampler.
pub(super) fn buffer_texture(program: u32, sampler: &str) -> Result<ArraySource, &'static str> {
    let at = gl::uniform_location(program, sampler);
    let unit = if at < 0 { 0 } else { gl::uniform_i::<1>(program, at)[0].max(0) };
    let active = gl::word(ACTIVE_TEXTURE);
    gl::active_texture(TEXTURE0 + unit.cast_unsigned());
    let bound = gl::word(TEXTURE_BINDING_BUFFER);
    let of = |what| gl::tex_level_i::<1>(TEXTURE_BUFFER, 0, what)[0].cast_unsigned();
    let (format, buffer) = (of(TEXTURE_INTERNAL_FORMAT), of(TEXTURE_BUFFER_DATA_STORE_BINDING));
    gl::active_texture(active);
    let (size, kind, normalized) = match format {
        RGBA8 => (4, UNSIGNED_BYTE, true),
        R8 => (1, UNSIGNED_BYTE, true),
        RGBA32F => (4, FLOAT, false),
        _ => return Err("a buffer texture of a format that is not read"),
    };
    if bound == 0 {
        return Err("a buffer texture without a buffer");
    }
    let layout = ArrayLayout { size, kind, stride: 0, address: 0, buffer, normalized };
    ArraySource::in_buffer(layout).ok_or("a buffer texture without a buffer")
}

/// The colours of `count` triangles from number `first` on.
pub(super) fn colors(
    source: &ArraySource,
    first: usize,
    count: usize,
) -> Result<Arc<Image>, &'static str> {
    let packed = source.read_range(first, count)?;
    if packed.size != 4 {
        return Err("colours of cells without four components");
    }
    Ok(Arc::new(match packed.kind {
        UNSIGNED_BYTE => Image::of_bytes(bytemuck::pod_collect_to_vec(&packed.bytes)),
        _ => Image::of_floats(bytemuck::pod_collect_to_vec(&packed.bytes)),
    }))
}

/// For `count` triangles from number `first` on, which sides are edges of their cells.
pub(super) fn sides(
    source: &ArraySource,
    first: usize,
    count: usize,
) -> Result<Arc<Vec<u8>>, &'static str> {
    let packed = source.read_range(first, count)?;
    match (packed.kind, packed.size) {
        (UNSIGNED_BYTE, 1) => Ok(Arc::new(packed.bytes)),
        _ => Err("edges of cells that are no bytes"),
    }
}
