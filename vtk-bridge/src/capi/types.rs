//! The structures of the C interface, with C's layout.

use std::os::raw::{c_char, c_void};

/// Element type of an [`RtvArray`]: no array.
pub const RTV_NONE: u32 = 0;
/// Unsigned bytes.
pub const RTV_U8: u32 = 1;
/// 32-bit floating point.
pub const RTV_F32: u32 = 2;
/// 64-bit floating point.
pub const RTV_F64: u32 = 3;
/// 32-bit signed integers.
pub const RTV_I32: u32 = 4;
/// 64-bit signed integers.
pub const RTV_I64: u32 = 5;

/// Colours come from the property.
pub const RTV_COLOR_PROPERTY: u32 = 0;
/// Four bytes per point.
pub const RTV_COLOR_POINTS: u32 = 1;
/// Four bytes per cell.
pub const RTV_COLOR_CELLS: u32 = 2;
/// Two floats per point: position in `map`, and above 0.5 for NaN.
pub const RTV_COLOR_MAPPED: u32 = 3;

/// Parallel light.
pub const RTV_LIGHT_DIRECTIONAL: u32 = 0;
/// Light from a point.
pub const RTV_LIGHT_POINT: u32 = 1;
/// Light from a point in a cone.
pub const RTV_LIGHT_SPOT: u32 = 2;

/// Emission and absorption.
pub const RTV_BLEND_COMPOSITE: u32 = 0;
/// The largest scalar.
pub const RTV_BLEND_MAXIMUM: u32 = 1;
/// The smallest scalar.
pub const RTV_BLEND_MINIMUM: u32 = 2;
/// The mean of colour times opacity.
pub const RTV_BLEND_AVERAGE: u32 = 3;
/// The integral of colour times opacity.
pub const RTV_BLEND_ADDITIVE: u32 = 4;
/// Surfaces of given scalars.
pub const RTV_BLEND_ISOSURFACES: u32 = 5;

/// `tuples` times `components` numbers, contiguous in memory.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtvArray {
    /// First number; may be null if there are none.
    pub data: *const c_void,
    /// Tuples.
    pub tuples: u64,
    /// Numbers per tuple.
    pub components: u32,
    /// One of RTV_U8 to RTV_I64, or RTV_NONE.
    pub kind: u32,
}

/// Cell i is `connectivity[offsets[i] .. offsets[i + 1]]`.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtvCells {
    /// One more than the number of cells.
    pub offsets: RtvArray,
    /// Point numbers.
    pub connectivity: RtvArray,
}

/// `vtkProperty`.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtvProperty {
    /// Ambient colour.
    pub ambient_color: [f32; 3],
    /// Diffuse colour.
    pub diffuse_color: [f32; 3],
    /// Specular colour.
    pub specular_color: [f32; 3],
    /// Ambient coefficient.
    pub ambient: f32,
    /// Diffuse coefficient.
    pub diffuse: f32,
    /// Specular coefficient.
    pub specular: f32,
    /// Specular exponent.
    pub specular_power: f32,
    /// Opacity.
    pub opacity: f32,
    /// Metallic, of the physically based model.
    pub metallic: f32,
    /// Roughness, of the physically based model.
    pub roughness: f32,
    /// Index of refraction, of the physically based model.
    pub base_ior: f32,
    /// 1 for flat shading.
    pub flat: u32,
    /// 0 for no lighting.
    pub lighting: u32,
    /// 1 for the physically based model.
    pub pbr: u32,
    /// 1 to cull front faces.
    pub cull_front: u32,
    /// 1 to cull back faces.
    pub cull_back: u32,
    /// Colour of the edges of polygons.
    pub edge_color: [f32; 3],
    /// Their width in pixels; 0 for none.
    pub edge_width: f32,
}

/// An image, and how it is sampled.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtvImage {
    /// Four RTV_U8 per texel, or none.
    pub texels: RtvArray,
    /// Changes whenever the texels change.
    pub key: u64,
    /// Texels per row.
    pub width: u32,
    /// 1: interpolated linearly between texels.
    pub interpolate: u8,
    /// 1: repeated.
    pub repeat: u8,
    /// 1: encoded as sRGB.
    pub srgb: u8,
    /// Not used.
    pub reserved: u8,
}

/// Textures of a physically based property other than its colour.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtvMaps {
    /// Occlusion, roughness and metalness in red, green and blue.
    pub material: RtvImage,
    /// Normals; they need tangents.
    pub normal: RtvImage,
    /// Emitted radiance.
    pub emissive: RtvImage,
    /// Factor on the first two components of the normals.
    pub normal_scale: f32,
    /// 0 for no occlusion, 1 for full occlusion.
    pub occlusion_strength: f32,
    /// Factor on the radiance.
    pub emissive_factor: [f32; 3],
    /// Not used.
    pub reserved: u32,
}

/// A surface to draw. Arrays are read before `rtv_surface` returns and not kept.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtvSurface {
    /// Name for messages, UTF-8.
    pub name: *const c_char,
    /// Changes whenever points, cells, normals, texture coordinates, clipping planes or radii
    /// change; 0: not known.
    pub shape_key: u64,
    /// Changes whenever the colours change; 0: not known.
    pub color_key: u64,
    /// Changes whenever the texture changes.
    pub texture_key: u64,
    /// Three RTV_F32 or RTV_F64.
    pub points: RtvArray,
    /// Vertices.
    pub verts: RtvCells,
    /// Polylines.
    pub lines: RtvCells,
    /// Polygons.
    pub polys: RtvCells,
    /// Strips.
    pub strips: RtvCells,
    /// Three RTV_F32 per point, or none.
    pub point_normals: RtvArray,
    /// Three RTV_F32 per cell, or none.
    pub cell_normals: RtvArray,
    /// Two RTV_F32 per point, or none.
    pub texcoords: RtvArray,
    /// Four RTV_F64 per plane: a x + b y + c z + d >= 0 remains.
    pub clip_planes: RtvArray,
    /// One of RTV_COLOR_*.
    pub color_source: u32,
    /// 1: draw polygons as their edges (tubes).
    pub edges_only: u32,
    /// The colours, as `color_source` says.
    pub colors: RtvArray,
    /// RTV_COLOR_MAPPED: four RTV_U8 per entry.
    pub map: RtvArray,
    /// RTV_COLOR_MAPPED: colour of NaN.
    pub nan_color: [u8; 4],
    /// 1: interpolated linearly between texels.
    pub texture_interpolate: u8,
    /// 1: the texture is repeated.
    pub texture_repeat: u8,
    /// 1: the texture is encoded as sRGB.
    pub texture_srgb: u8,
    /// Not used.
    pub reserved: u8,
    /// Four RTV_U8 per texel, or none.
    pub texture: RtvArray,
    /// Texels per row.
    pub texture_width: u32,
    /// 1: back faces of polygons have the property `back`.
    pub has_back: u32,
    /// Answer to light.
    pub property: RtvProperty,
    /// Answer of backs.
    pub back: RtvProperty,
    /// Row by row.
    pub world_from_data: [f64; 16],
    /// Sixteen RTV_F64 per copy (row by row), or none.
    pub glyph_matrices: RtvArray,
    /// Four RTV_U8 per copy, or none.
    pub glyph_colors: RtvArray,
    /// Radius of spheres for vertices; 0 for none.
    pub point_radius: f64,
    /// Radius of tubes for lines and edges; 0 for none.
    pub line_radius: f64,
    /// Three RTV_F32 per point, or none; they belong to the shape.
    pub tangents: RtvArray,
    /// Further textures, or null.
    pub maps: *const RtvMaps,
}

/// A uniform grid of scalars as a medium. Arrays are read before rtv_volume returns and not kept.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct RtvVolume {
    /// Name for messages, UTF-8.
    pub name: *const c_char,
    /// Changes whenever the scalars change; 0: not known.
    pub scalar_key: u64,
    /// One number of any kind per point, or per cell with cells, x fastest; none when
    /// rtv_has_volume says that they are kept.
    pub scalars: RtvArray,
    /// Points per axis.
    pub dims: [u32; 3],
    /// 1: the value of the nearest point; 0: linear interpolation.
    pub nearest: u32,
    /// Distance between neighbouring points.
    pub spacing: [f64; 3],
    /// Row by row; the first point is at zero of the data.
    pub world_from_data: [f64; 16],
    /// Scalars of the first and the last entry of both tables.
    pub range: [f64; 2],
    /// Three RTV_F32 per entry.
    pub colors: RtvArray,
    /// One RTV_F32 per entry: opacity of a slab of unit_distance.
    pub opacities: RtvArray,
    /// See opacities.
    pub unit_distance: f64,
    /// Distance of the mapper's samples, data units, of which RTV_BLEND_COMPOSITE takes the same;
    /// 0 integrates instead.
    pub sample_distance: f64,
    /// World position of the camera, with has_viewer.
    pub viewer: [f64; 3],
    /// 1 for shading by the gradient.
    pub shade: u32,
    /// Of the shading.
    pub ambient: f32,
    /// Of the shading.
    pub diffuse: f32,
    /// Of the shading.
    pub specular: f32,
    /// Of the shading.
    pub specular_power: f32,
    /// 1 for a highlight around the mirrored light instead of the half vector.
    pub specular_mirrored: u32,
    /// Lights: for each the direction towards it, in the world (zero for one at the viewer), and
    /// its colour; none for a white one at the viewer.
    pub lights: RtvArray,
    /// Opacities by gradient, evenly spaced from 0 to steepest, that those of the scalars are
    /// multiplied by; none for 1.
    pub gradient_opacities: RtvArray,
    /// Gradient of the last of them, scalar per data unit.
    pub steepest: f64,
    /// One of RTV_BLEND_*.
    pub blend: u32,
    /// 1: lights at the viewer and highlights go by lines from viewer, not by the rays, which in
    /// parallel projections differ.
    pub has_viewer: u32,
    /// Scalars of the surfaces of RTV_BLEND_ISOSURFACES, f64.
    pub isovalues: RtvArray,
    /// 1: the scalars belong to the cells between the points.
    pub cells: u32,
    /// Regions that are drawn, bit x + 3 y + 9 z, where 0, 1 and 2 stand for below, between and
    /// above the planes of an axis; 0: all of the volume.
    pub cropping_regions: u32,
    /// Lower and upper plane of each axis, data units, with cropping_regions.
    pub cropping_planes: [f64; 6],
    /// Planes that cut off what is behind them, in the world: a point and the normal of each.
    pub clip_planes: RtvArray,
    /// 1: cropping planes are where OpenGL's mapper has them, which takes the grid for half a cell
    /// larger on each side, unless the scalars are those of cells.
    pub cropping_in_texels: u32,
    /// 1: so are clipping planes, as before VTK 9.3.1.
    pub clipping_in_texels: u32,
}

/// A light that is on.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtvLight {
    /// World position.
    pub position: [f64; 3],
    /// World point that it is aimed at.
    pub focal_point: [f64; 3],
    /// Half angle of a spot, degrees.
    pub cone_angle_deg: f64,
    /// Exponent of a spot.
    pub exponent: f64,
    /// Colour times intensity.
    pub color: [f32; 3],
    /// Constant, linear, quadratic.
    pub attenuation: [f32; 3],
    /// One of RTV_LIGHT_*.
    pub kind: u32,
    /// 1 for a headlight.
    pub headlight: u32,
}

/// What to render: a camera and a size.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtvView {
    /// Projection times view, row by row, depth -1 to 1.
    pub clip_from_world: [f64; 16],
    /// World position of the camera, with has_viewer.
    pub viewer: [f64; 3],
    /// Background at the bottom.
    pub background_bottom: [f32; 3],
    /// Background at the top.
    pub background_top: [f32; 3],
    /// Distance from the camera to its focal point, world units.
    pub focus_distance: f64,
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// 1 while the user turns the scene.
    pub interactive: u32,
    /// 1 when the program itself asks for shadows.
    pub shadows: u32,
    /// Samples of each pixel of the framebuffer that the image is drawn into; 0 or 1 for none. With
    /// more, the alpha of opaque images is the part of the pixel that is covered.
    pub window_samples: u32,
    /// 1 when OpenGL draws nothing beside the image that is translucent or has a depth.
    pub one_layer: u32,
    /// 1: parallel projections see highlights and lights at the viewer by lines from viewer, as
    /// OpenGL's shaders do, not by the rays.
    pub has_viewer: u32,
}

/// An image; rows start at the top, and the memory belongs to the bridge until its next call.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtvPicture {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// RGBA bytes, not premultiplied, or null when `blended` is not.
    pub opaque: *const u8,
    /// Premultiplied RGBA, or null.
    pub blended: *const f32,
    /// Window depth of the first opaque surface.
    pub depth: *const f32,
    /// Window depth of the first surface, or null without `blended` or with `straight`.
    pub first_depth: *const f32,
    /// `blended` as one layer, to be blended over everything with `depth`: RGBA, not premultiplied,
    /// 65535 for 1; null without `one_layer` or `blended`.
    pub straight: *const u16,
}
