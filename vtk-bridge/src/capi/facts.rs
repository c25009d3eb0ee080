//! Facts about props, with C's layout: from them [`super::eligibility`] decides what is ray traced.
//! Zero and null stand for what is not known yet or not there, and refuse nothing.

use super::types::{RtvArray, RtvView};
use std::os::raw::c_char;

/// Representation of a property: every point.
pub const RTV_POINTS: u32 = 0;
/// The edges of polygons.
pub const RTV_WIREFRAME: u32 = 1;
/// Polygons.
pub const RTV_SURFACE: u32 = 2;

/// Bits that describe a texture: it exists.
pub const RTV_TEXTURE: u32 = 1;
/// It has a transform.
pub const RTV_TEXTURE_TRANSFORM: u32 = 2;
/// It is a cube map.
pub const RTV_TEXTURE_CUBE_MAP: u32 = 4;
/// It has mipmaps.
pub const RTV_TEXTURE_MIPMAP: u32 = 8;
/// Back faces do not show it.
pub const RTV_TEXTURE_FRONT_ONLY: u32 = 16;

/// A prop with its property and mapper. Asked about before the mapper is updated, and again if it
/// then has no data.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtvActorFacts {
    /// Name of the prop's VTK class.
    pub actor_class: *const c_char,
    /// Name of the mapper's VTK class; null for props other than actors and for actors without one.
    pub mapper_class: *const c_char,
    /// One of RTV_POINTS, RTV_WIREFRAME and RTV_SURFACE.
    pub representation: u32,
    /// 1 for physically based shading.
    pub pbr: u32,
    /// 1 if the edges of polygons are visible.
    pub edge_visibility: u32,
    /// 1 if lines are drawn as shaded tubes.
    pub lines_as_tubes: u32,
    /// 1 if the vertices of polygons are visible.
    pub vertex_visibility: u32,
    /// HasTranslucentPolygonalGeometry; read only with edges or a back face property.
    pub translucent: u32,
    /// Clipping planes of the mapper.
    pub num_clipping_planes: u32,
    /// 1 if there is a back face property.
    pub has_back: u32,
    /// Its opacity.
    pub back_opacity: f64,
    /// Opacity of edges.
    pub edge_opacity: f64,
    /// Strength of the clear coat.
    pub coat_strength: f64,
    /// Anisotropy of the physically based model.
    pub anisotropy: f64,
    /// Metallic, of the physically based model.
    pub metallic: f64,
    /// Colour of a metal at grazing angles.
    pub edge_tint: [f64; 3],
    /// 1 if it has shaders or shader replacements of its own.
    pub shader_code: u32,
    /// 1 for a vtkGlyph3DMapper.
    pub glyphs: u32,
    /// The actor's texture: bits RTV_TEXTURE and following.
    pub texture: u32,
    /// Textures of the property, of any name.
    pub num_textures: u32,
    /// Bits of the property's albedoTex.
    pub albedo: u32,
    /// Bits of its materialTex.
    pub material: u32,
    /// Bits of its normalTex.
    pub normal: u32,
    /// Bits of its emissiveTex.
    pub emissive: u32,
    /// 1 if the mapper was updated and has no data.
    pub no_data: u32,
    /// 1 if blocks have scalars, colour maps or textures of their own.
    pub block_scalars: u32,
    /// 1 if OpenGL moves the depths of its polygons, for lines and surfaces in the same plane.
    pub polygon_offset: u32,
    /// 1 if an image lights the renderer's physically based surfaces.
    pub image_lighting: u32,
}

/// The data of an actor, or one of their blocks, and its surface. Asked about when the cells are
/// known, and again when the surface is complete.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtvSurfaceFacts {
    /// Vertices of the data.
    pub num_verts: u64,
    /// Lines of the data.
    pub num_lines: u64,
    /// As in RtvActorFacts.
    pub representation: u32,
    /// 1 if the data are neither vtkPolyData nor blocks.
    pub not_polygons: u32,
    /// 1 if polygons were cut into triangles, because they are not convex.
    pub triangulated: u32,
    /// 1 if the edges of polygons are drawn on the surface.
    pub edges: u32,
    /// 1 for a texture that gives the colour.
    pub texture: u32,
    /// 1 for other textures of the property.
    pub maps: u32,
    /// As in RtvSurface.
    pub has_back: u32,
    /// As in RtvSurface.
    pub color_source: u32,
    /// 1 if rtv_surfaces refused the arrays.
    pub invalid_arrays: u32,
    /// 1 if cells have point numbers that cannot be read, in the array described below.
    pub unreadable_cells: u32,
    /// Numbers per tuple of that array.
    pub cell_components: u32,
    /// Not used.
    pub reserved: u32,
    /// Name of its numbers' type.
    pub cell_type: *const c_char,
    /// Name of its VTK class; null if there is no array.
    pub cell_array_class: *const c_char,
}

/// A glyph mapper with its data. Asked about before its sources are updated, again for each source,
/// and again for each data set with colours.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtvGlyphFacts {
    /// 1 if the sources are in a tree.
    pub source_table_tree: u32,
    /// Clipping planes of the mapper.
    pub num_clipping_planes: u32,
    /// Sources that the mapper uses.
    pub num_sources: u32,
    /// 1 if the data are one data set.
    pub data_set: u32,
    /// 1 if they are blocks.
    pub composite: u32,
    /// 1 if blocks have colours, opacities or visibilities of their own.
    pub block_attributes: u32,
    /// Blocks that are no data sets.
    pub num_blocks_without_points: u32,
    /// 1 if the two fields below describe a source.
    pub has_source: u32,
    /// Polygons and strips of the source; 0 if it is not vtkPolyData.
    pub num_source_polygons: u64,
    /// Its vertices and lines.
    pub num_other_source_cells: u64,
    /// 1 if the fields below describe colours.
    pub has_colors: u32,
    /// Bytes per colour.
    pub color_components: u32,
    /// Colours of the data set.
    pub num_colors: u64,
    /// Points of the data set.
    pub num_points: u64,
}

/// A volume with its mapper and property, the lights and its image. Asked about when its classes
/// are known, again before the mapper's input is updated, and again with the image.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtvVolumeFacts {
    /// Name of the volume's VTK class.
    pub volume_class: *const c_char,
    /// Name of the mapper's VTK class, or null.
    pub mapper_class: *const c_char,
    /// 1 if the mapper crops.
    pub cropping: u32,
    /// Clipping planes of the mapper.
    pub num_clipping_planes: u32,
    /// 1 if the mapper has a mask.
    pub mask: u32,
    /// 1 if the mapper computes shadows or scattering.
    pub scattering: u32,
    /// 1 if the mapper shows vectors.
    pub vectors: u32,
    /// 1 if the transfer function has two dimensions.
    pub transfer_function_2d: u32,
    /// 1 if the property has colours or opacities of labels.
    pub labels: u32,
    /// The mapper's blend mode, with VTK's number: RTV_BLEND_*, or another.
    pub blend_mode: u32,
    /// 1 if opacities depend on the gradient.
    pub gradient_opacity: u32,
    /// 1 for shading by the gradient.
    pub shade: u32,
    /// Lights that are on; this and the next three are read only with shade.
    pub num_lights: u32,
    /// Of these, positional ones.
    pub num_positional_lights: u32,
    /// Of these, ones with an ambient colour.
    pub num_ambient_lights: u32,
    /// Lights in RtvVolume.
    pub num_listed_lights: u32,
    /// Coefficient of the highlight.
    pub specular: f64,
    /// 1 if the data are known, which the fields below describe.
    pub has_data: u32,
    /// 1 if they are one image.
    pub image: u32,
    /// Number of blocks, for blocks.
    pub num_blocks: u32,
    /// Points per axis; these and the following are read only with image.
    pub dims: [u32; 3],
    /// 1 if points or cells are blanked.
    pub blanked: u32,
    /// 1 if there are scalars.
    pub scalars: u32,
    /// 1 if they belong to cells.
    pub cell_scalars: u32,
    /// Numbers per scalar.
    pub num_components: u32,
    /// 1 if the axes of the image are not those of its space.
    pub turned: u32,
    /// With cropping: which regions are drawn, with VTK's flags.
    pub cropping_regions: u32,
    /// As in RtvVolume.
    pub range: [f64; 2],
    /// Scalars that RTV_BLEND_AVERAGE takes the mean of.
    pub average_range: [f64; 2],
}

/// Answers of rtv_choose: rays.
pub const RTV_CHOICE_RAYS: u32 = 0;
/// OpenGL: nothing is added to the frame.
pub const RTV_CHOICE_OPENGL: u32 = 1;
/// The caller has to collect the scene's facts and ask again.
pub const RTV_CHOICE_ASK_AGAIN: u32 = 2;

/// A renderer's scene, for the choice between rays and OpenGL. The first four fields are always
/// set, the others only when rtv_choose asks for them.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtvSceneFacts {
    /// Pixels of the viewport.
    pub pixels: u64,
    /// Props.
    pub props: u32,
    /// 1 when the program itself asks for shadows.
    pub shadows: u32,
    /// As in RtvView.
    pub interactive: u32,
    /// 1 when the fields below are set.
    pub known: u32,
    /// 1 if OpenGL's driver works on the processor.
    pub software: u32,
    /// 1 for the Python package.
    pub python: u32,
    /// Visible volumes; those that rtv_choose_volume was told of and others.
    pub volumes: u32,
    /// Visible props in space, other than volumes, that have no polygons or more than polygons.
    pub others: u32,
    /// Visible props with translucent surfaces.
    pub translucent: u32,
    /// Visible props with edges.
    pub edges: u32,
    /// Triangles of the visible props, in all copies.
    pub triangles: u64,
}

/// A visible volume of a scene, for the choice: what it is to draw. Its pipeline need not be up to
/// date.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtvSceneVolume {
    /// What rtv_check_volume would be asked with, but for range, which is that of the opacities.
    pub facts: *const RtvVolumeFacts,
    /// The view of the frame.
    pub view: *const RtvView,
    /// Scalars at a few points per axis, evenly spread from the first to the last: one RTV_F32
    /// each, x fastest.
    pub scalars: RtvArray,
    /// How many per axis.
    pub dims: [u32; 3],
    /// 1 if OpenGL takes fewer samples while the user turns the scene.
    pub adjusts: u32,
    /// As in RtvVolume.
    pub opacities: RtvArray,
    /// As in RtvVolume.
    pub unit_distance: f64,
    /// As in RtvVolume.
    pub sample_distance: f64,
    /// World position of a point of the unit cube, which the image fills; row by row.
    pub world_from_unit: [f64; 16],
}
