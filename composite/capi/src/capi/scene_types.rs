//! Structures and constants of scenes and pictures; the rules are those of `types.rs`.

use std::ffi::{c_char, c_void};

/// uint8_t
pub const RTSV_COMPOSITE_U8: u32 = 1;
/// int8_t
pub const RTSV_COMPOSITE_I8: u32 = 2;
/// uint16_t
pub const RTSV_COMPOSITE_U16: u32 = 3;
/// int16_t
pub const RTSV_COMPOSITE_I16: u32 = 4;
/// uint32_t
pub const RTSV_COMPOSITE_U32: u32 = 5;
/// int32_t
pub const RTSV_COMPOSITE_I32: u32 = 6;
/// uint64_t
pub const RTSV_COMPOSITE_U64: u32 = 7;
/// int64_t
pub const RTSV_COMPOSITE_I64: u32 = 8;
/// float
pub const RTSV_COMPOSITE_F32: u32 = 9;
/// double
pub const RTSV_COMPOSITE_F64: u32 = 10;

/// Tuples of numbers in memory of the program; all zero for none.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtsvCompositeArray {
    /// The first number of the first tuple; null only without tuples.
    pub data: *const c_void,
    /// Number of tuples.
    pub count: u64,
    /// Numbers of a tuple, one behind the other.
    pub components: u32,
    /// What they are: RTSV_COMPOSITE_U8 to RTSV_COMPOSITE_F64.
    pub kind: u32,
    /// From one tuple to the next, also negative or less than a tuple; 0 for tuples without gaps.
    pub stride_bytes: i64,
    /// Called once with `owner` when the library needs the array no more, also after an error, or
    /// null. Not called if the structure that holds this array is null or has another size.
    pub release: Option<unsafe extern "C" fn(*mut c_void)>,
    /// For `release`.
    pub owner: *mut c_void,
}

/// Ideal diffuse.
pub const RTSV_COMPOSITE_MATTE: u32 = 0;
/// The colour without lighting.
pub const RTSV_COMPOSITE_UNLIT: u32 = 1;
/// OpenGL's model, with `specular` and `shininess`.
pub const RTSV_COMPOSITE_PHONG: u32 = 2;
/// A metal with `roughness`: a mirror at 0.
pub const RTSV_COMPOSITE_METAL: u32 = 3;
/// Clear glass with `ior`.
pub const RTSV_COMPOSITE_GLASS: u32 = 4;
/// glTF's model, with `metallic` and `roughness`.
pub const RTSV_COMPOSITE_PBR: u32 = 5;

/// A material. rtsv_composite_material_init fills it: matte, white, opaque.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtsvCompositeMaterial {
    /// Size of this structure.
    pub struct_bytes: u64,
    /// RTSV_COMPOSITE_MATTE or another model.
    pub model: u32,
    /// Linear RGB; multiplied by the colours of the object.
    pub color: [f32; 3],
    /// Emitted radiance, linear RGB.
    pub emission: [f32; 3],
    /// 1 opaque to 0 invisible.
    pub opacity: f32,
    /// Strength of the highlight.
    pub specular: f32,
    /// Exponent of the highlight.
    pub shininess: f32,
    /// 0 smooth to 1.
    pub roughness: f32,
    /// 0 or 1, or between.
    pub metallic: f32,
    /// Refractive index.
    pub ior: f32,
    /// 0 or 1: the normals of the triangles, not of their corners.
    pub flat: u32,
}

/// The same from all directions.
pub const RTSV_COMPOSITE_AMBIENT: u32 = 0;
/// Parallel light from `direction`.
pub const RTSV_COMPOSITE_DIRECTIONAL: u32 = 1;
/// Light from `position` in all directions.
pub const RTSV_COMPOSITE_POINT: u32 = 2;
/// Light from `position` along `direction`, within `cutoff_rad`.
pub const RTSV_COMPOSITE_SPOT: u32 = 3;
/// Parallel light along the view, without shadows.
pub const RTSV_COMPOSITE_HEADLIGHT: u32 = 4;

/// A light. rtsv_composite_light_init fills it: ambient, white.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtsvCompositeLight {
    /// Size of this structure.
    pub struct_bytes: u64,
    /// RTSV_COMPOSITE_AMBIENT or another kind.
    pub kind: u32,
    /// 0 or 1: surfaces block it. Not for ambient light and headlights, which nothing blocks.
    pub shadows: u32,
    /// Position in the world.
    pub position: [f64; 3],
    /// Directional: towards the light. Spot: away from it.
    pub direction: [f64; 3],
    /// Radius in world units, or of directional light half the angle it fills, radians; 0 for sharp
    /// shadows.
    pub size: f64,
    /// Half angle of a spot, radians.
    pub cutoff_rad: f64,
    /// Linear RGB.
    pub color: [f32; 3],
    /// Not used; 0.
    pub reserved: u32,
}

/// What surrounds the objects. rtsv_composite_surroundings_init fills it: nothing.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtsvCompositeSurroundings {
    /// Size of this structure.
    pub struct_bytes: u64,
    /// Largest distance of an occluder of ambient light, world units, infinite for any.
    pub occlusion_distance: f64,
    /// Rays of ambient occlusion for each point; 0 for no ambient occlusion.
    pub occlusion_rays: u32,
    /// 0 or 1: a background of `bottom` to `top`, opaque. Else alpha is 0 where nothing is.
    pub has_background: u32,
    /// Linear RGB of the bottom row.
    pub bottom: [f32; 3],
    /// Linear RGB of the top row.
    pub top: [f32; 3],
}

/// This rank's triangles of an object. What ranks give under one name is one object.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtsvCompositeMesh {
    /// Size of this structure.
    pub struct_bytes: u64,
    /// The object's name, UTF-8.
    pub name: *const c_char,
    /// The material's number in the scene.
    pub material: u32,
    /// 0 or 1: colors has one colour per triangle, not per vertex.
    pub colors_per_face: u32,
    /// Positions are kept as float relative to this point; the same on all ranks. Choose it near
    /// the object where coordinates are large.
    pub origin: [f64; 3],
    /// Three floats or doubles per vertex.
    pub positions: RtsvCompositeArray,
    /// Three integers per triangle, counter-clockwise seen from outside. Triangles with an index
    /// beyond the positions are left out, and counted (rtsv_composite_renderer_warnings).
    pub triangles: RtsvCompositeArray,
    /// Three floats or doubles per vertex, or none.
    pub normals: RtsvCompositeArray,
    /// Linear RGBA, four floats or doubles, or none.
    pub colors: RtsvCompositeArray,
    /// Transforms to the world, twelve doubles each (three rows of four), or none for one without a
    /// transform. The same on all ranks that have a piece of the object.
    pub places: RtsvCompositeArray,
}

/// This rank's spheres of an object.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtsvCompositeSpheres {
    /// Size of this structure.
    pub struct_bytes: u64,
    /// The object's name, UTF-8.
    pub name: *const c_char,
    /// The material's number in the scene.
    pub material: u32,
    /// Radius of all spheres, where `radii` has none.
    pub radius: f32,
    /// As that of a mesh.
    pub origin: [f64; 3],
    /// Three floats or doubles per sphere.
    pub centers: RtsvCompositeArray,
    /// One float or double per sphere, or none.
    pub radii: RtsvCompositeArray,
    /// Linear RGBA, four floats or doubles per sphere, or none.
    pub colors: RtsvCompositeArray,
    /// As those of a mesh.
    pub places: RtsvCompositeArray,
}

/// A volume, of which ranks have bricks. All ranks give the same description, in the same order.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtsvCompositeVolume {
    /// Size of this structure.
    pub struct_bytes: u64,
    /// Its name, UTF-8.
    pub name: *const c_char,
    /// Points per axis of the whole grid.
    pub dims: [u32; 3],
    /// 0: linear interpolation; 1: the value of the nearest point.
    pub nearest: u32,
    /// World position of the first point.
    pub origin: [f64; 3],
    /// Distance of neighbouring points, world units.
    pub spacing: [f64; 3],
    /// Three floats or doubles (linear RGB) per entry, evenly spaced over `range`.
    pub colors: RtsvCompositeArray,
    /// Values of the first and the last colour.
    pub range: [f32; 2],
    /// Two floats or doubles per entry, ascending: a value, and the opacity of a slab of
    /// `unit_distance` there.
    pub opacities: RtsvCompositeArray,
    /// See opacities; world units.
    pub unit_distance: f64,
}

/// This rank's values on a box of points of a volume. Bricks of neighbours share the points between
/// them.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtsvCompositeBrick {
    /// Size of this structure.
    pub struct_bytes: u64,
    /// The volume's number in the scene.
    pub volume: u32,
    /// Not used; 0.
    pub reserved: u32,
    /// First point in the whole grid.
    pub first: [u32; 3],
    /// Points per axis of the brick.
    pub dims: [u32; 3],
    /// One number per point; stride_bytes leads along x.
    pub values: RtsvCompositeArray,
    /// From one row of points to the next, along y; 0 for rows without gaps.
    pub row_bytes: i64,
    /// From one slice of points to the next, along z; 0 for slices without gaps.
    pub slice_bytes: i64,
}

/// Rays go to the ranks whose bounds they enter: exact for every effect.
pub const RTSV_COMPOSITE_FORWARD: u32 = 0;
/// Each rank also holds what lies within the distance of ambient occlusion around its part.
pub const RTSV_COMPOSITE_GHOST_ZONES: u32 = 1;
/// Only the rank that was hit is asked: wrong near borders, for comparison.
pub const RTSV_COMPOSITE_LOCAL_ONLY: u32 = 2;

/// How ranks render together; the same on all ranks but for timeout_secs and threads.
/// rtsv_composite_render_options_init fills it.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtsvCompositeRenderOptions {
    /// Size of this structure.
    pub struct_bytes: u64,
    /// The rank that gets the picture (0).
    pub root: u32,
    /// RTSV_COMPOSITE_FORWARD (the default) or another way for light to cross borders.
    pub secondary_rays: u32,
    /// 0 (the default) or 1: use all processors that the process may, not one thread for a rank.
    pub threads: u32,
    /// Not used; 0.
    pub reserved: u32,
    /// Longest wait for a rank that gives no sign of life, seconds (60).
    pub timeout_secs: f64,
}

/// A perspective view.
pub const RTSV_COMPOSITE_PERSPECTIVE: u32 = 0;
/// A parallel projection.
pub const RTSV_COMPOSITE_PARALLEL: u32 = 1;
/// The view of `clip_from_world`.
pub const RTSV_COMPOSITE_MATRIX: u32 = 2;

/// What to render; the same on all ranks. rtsv_composite_view_init fills it: a perspective view
/// from (0, 0, 1) to the origin, 640 x 480 pixels, one sample.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtsvCompositeView {
    /// Size of this structure.
    pub struct_bytes: u64,
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// RTSV_COMPOSITE_PERSPECTIVE or another projection.
    pub projection: u32,
    /// Samples per pixel.
    pub samples: u32,
    /// Shadow rays per sample to each light that has a size (4).
    pub light_rays: u32,
    /// Most reflections and refractions one behind the other; -1 (the default) for 8, or for no
    /// limit in path tracing.
    pub max_bounces: i32,
    /// 0 or 1: light over many bounces.
    pub path_tracing: u32,
    /// 0 or 1: the picture has depths too.
    pub depth: u32,
    /// Another seed gives other noise.
    pub seed: u64,
    /// Position of the eye in the world.
    pub eye: [f64; 3],
    /// A point in the middle of the picture.
    pub target: [f64; 3],
    /// What is up.
    pub up: [f64; 3],
    /// Full vertical angle of a perspective, radians.
    pub fov_y_rad: f64,
    /// Height of the picture of a parallel projection, world units.
    pub parallel_height: f64,
    /// Distance of the near plane.
    pub near: f64,
    /// Distance of the far plane.
    pub far: f64,
    /// Projection times view of OpenGL, row by row.
    pub clip_from_world: [f64; 16],
}

/// A rendered picture. Rows start at the top. Its memory belongs to the renderer until its next
/// call.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RtsvCompositePicture {
    /// Size of this structure; set it before the call.
    pub struct_bytes: u64,
    /// Pixels per row; 0 on all ranks but the root.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Linear RGBA, premultiplied, four per pixel; null on all ranks but the root.
    pub color: *const f32,
    /// OpenGL's window depth, one per pixel; null if it was not asked for.
    pub depth: *const f32,
}
