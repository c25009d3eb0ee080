//! The data of a visualization program, borrowed without a copy: points, cells, attributes,
//! properties, lights and a camera.
//!
//! The types mirror VTK's arrays (`vtkPoints`, `vtkCellArray`, `vtkUnsignedCharArray`) but do not
//! depend on VTK. Any program with such arrays can fill them in. The arrays are read only when
//! [`crate::bridge::Bridge::add_surface`] needs them.

use rt_core::glam::{DMat4, DVec3};
pub use rt_core::volume::Cropping;

/// Point coordinates, three per point.
#[derive(Debug, Clone, Copy)]
pub enum Points<'a> {
    /// Single precision.
    F32(&'a [[f32; 3]]),
    /// Double precision. Stored relative to the centre, so that detail far from zero is not lost.
    F64(&'a [[f64; 3]]),
}

impl Points<'_> {
    /// The number of points.
    pub fn len(&self) -> usize {
        match self {
            Points::F32(p) => p.len(),
            Points::F64(p) => p.len(),
        }
    }

    /// True if there are no points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Point `i`. Panics if it does not exist.
    pub fn at(&self, i: usize) -> DVec3 {
        match self {
            Points::F32(p) => DVec3::from(p[i].map(f64::from)),
            Points::F64(p) => DVec3::from(p[i]),
        }
    }
}

/// Integers of either width, as `vtkCellArray` stores them.
#[derive(Debug, Clone, Copy)]
pub enum Ids<'a> {
    /// 32 bits.
    I32(&'a [i32]),
    /// 64 bits.
    I64(&'a [i64]),
}

impl Ids<'_> {
    /// The number of values.
    pub fn len(&self) -> usize {
        match self {
            Ids::I32(v) => v.len(),
            Ids::I64(v) => v.len(),
        }
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Value `i`. Panics past the end.
    #[inline]
    pub fn at(&self, i: usize) -> i64 {
        match self {
            Ids::I32(v) => i64::from(v[i]),
            Ids::I64(v) => v[i],
        }
    }

    /// Value `i` as a vertex index. A value that cannot be an index (negative, or beyond 32 bits)
    /// becomes `u32::MAX`, which no mesh has. Such a triangle is skipped and counted.
    #[inline]
    pub fn vertex(&self, i: usize) -> u32 {
        u32::try_from(self.at(i)).unwrap_or(u32::MAX)
    }
}

/// Cells as ranges of point numbers: cell i is `connectivity[offsets[i]..offsets[i + 1]]`.
#[derive(Debug, Clone, Copy)]
pub struct Cells<'a> {
    /// One more than the number of cells; empty if there are no cells.
    pub offsets: Ids<'a>,
    /// Point numbers.
    pub connectivity: Ids<'a>,
}

impl<'a> Cells<'a> {
    /// No cells.
    pub const NONE: Cells<'static> = Cells { offsets: Ids::I64(&[]), connectivity: Ids::I64(&[]) };

    /// The number of cells.
    pub fn len(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// True if there are no cells.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The range of cell `i` in `connectivity`; empty if the offsets are invalid.
    #[inline]
    pub fn run(&self, i: usize) -> std::ops::Range<usize> {
        let all = self.connectivity.len() as i64;
        let (a, b) = (self.offsets.at(i), self.offsets.at(i + 1));
        if 0 <= a && a <= b && b <= all { a as usize..b as usize } else { 0..0 }
    }
}

/// Values of either the points or the cells.
#[derive(Debug, Clone, Copy)]
pub enum PerItem<'a, T> {
    /// One per point.
    Point(&'a [T]),
    /// One per cell: vertices first, then lines, polygons and strips, as `vtkPolyData` counts.
    Cell(&'a [T]),
}

/// The geometry of a surface: everything that decides where rays hit it. The acceleration structure
/// is cached while `key` stays the same.
#[derive(Debug, Clone, Copy)]
pub struct Shape<'a> {
    /// Changes whenever one of the arrays or numbers below changes; 0 is never cached.
    pub key: u64,
    /// Coordinates.
    pub points: Points<'a>,
    /// Vertices, drawn as spheres if `point_radius` is positive.
    pub verts: Cells<'a>,
    /// Polylines, drawn as tubes if `line_radius` is positive.
    pub lines: Cells<'a>,
    /// Polygons, fanned into triangles from their first point as VTK does.
    pub polys: Cells<'a>,
    /// Triangle strips.
    pub strips: Cells<'a>,
    /// Shading normals. Normals per cell are used only if there are none per point.
    pub normals: Option<PerItem<'a, [f32; 3]>>,
    /// Texture coordinates, one per point.
    pub texcoords: Option<&'a [[f32; 2]]>,
    /// Tangents for normal maps, one per point: the direction in which the first texture coordinate
    /// grows.
    pub tangents: Option<&'a [[f32; 3]]>,
    /// Half-spaces `a x + b y + c z + d >= 0` (data coordinates) outside of which nothing is drawn.
    pub clip_planes: &'a [[f64; 4]],
    /// Radius of spheres for `verts`, data units; 0 draws none.
    pub point_radius: f64,
    /// Radius of tubes for `lines`, data units; 0 draws none.
    pub line_radius: f64,
    /// Draws only the edges of polygons, as tubes of `line_radius`.
    pub edges_only: bool,
    /// The back faces of polygons look different ([`Surface::back`]).
    pub has_back_faces: bool,
}

impl<'a> Shape<'a> {
    /// A shape of points and polygons only.
    pub fn polygons(key: u64, points: Points<'a>, polys: Cells<'a>) -> Shape<'a> {
        Shape {
            key,
            points,
            verts: Cells::NONE,
            lines: Cells::NONE,
            polys,
            strips: Cells::NONE,
            normals: None,
            texcoords: None,
            tangents: None,
            clip_planes: &[],
            point_radius: 0.0,
            line_radius: 0.0,
            edges_only: false,
            has_back_faces: false,
        }
    }
}

/// An RGBA image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Image<'a> {
    /// Changes whenever the pixels change; 0 is never cached.
    pub key: u64,
    /// Texels per row.
    pub width: usize,
    /// Rows; the first is at texture coordinate v = 0.
    pub height: usize,
    /// Not premultiplied.
    pub rgba: &'a [[u8; 4]],
    /// Interpolates linearly between texels; false takes the nearest texel.
    pub interpolate: bool,
    /// Repeats the image outside 0..1; false extends its edge.
    pub repeat: bool,
    /// Encoded as sRGB, and decoded before interpolation.
    pub srgb: bool,
}

/// Textures of a physically based property other than its colour, as VTK's shader reads them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Maps<'a> {
    /// Occlusion, roughness (times the property's) and metalness (times the property's) in red,
    /// green and blue.
    pub material: Option<Image<'a>>,
    /// Normals, 2 rgb - 1; ignored without [`Shape::tangents`].
    pub normal: Option<Image<'a>>,
    /// Emitted radiance.
    pub emissive: Option<Image<'a>>,
    /// Factor on the first two components of the normals.
    pub normal_scale: f32,
    /// Strength of occlusion: 0 for none, 1 for full.
    pub occlusion_strength: f32,
    /// Factor on the radiance.
    pub emissive_factor: [f32; 3],
}

/// The source of a surface's colour.
#[derive(Debug, Clone, Copy)]
pub enum Color<'a> {
    /// The material's own colour.
    Material,
    /// RGBA of points (interpolated) or cells.
    Values {
        /// Changes whenever the values change; 0 is never cached.
        key: u64,
        /// Not premultiplied.
        rgba: PerItem<'a, [u8; 4]>,
    },
    /// Coordinates that are interpolated first and then looked up in a row of colours (VTK's
    /// *interpolate scalars before mapping*).
    Mapped {
        /// Changes whenever the coordinates or the row change; 0 is never cached.
        key: u64,
        /// One pair per point: position in the row (0 to 1), and above 0.5 where the value is NaN.
        coordinates: &'a [[f32; 2]],
        /// The colours. The nearest one is used.
        row: &'a [[u8; 4]],
        /// Colour of NaN.
        nan: [u8; 4],
    },
}

/// How surfaces reflect light: `vtkProperty`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Property {
    /// Ambient colour.
    pub ambient_color: [f32; 3],
    /// Diffuse colour.
    pub diffuse_color: [f32; 3],
    /// Colour of the specular highlight.
    pub specular_color: [f32; 3],
    /// Ambient coefficient: factor on the ambient colour, which needs no light.
    pub ambient: f32,
    /// Factor on diffuse light.
    pub diffuse: f32,
    /// Factor on the specular highlight.
    pub specular: f32,
    /// Exponent of the specular highlight.
    pub specular_power: f32,
    /// Opacity; 1 is opaque.
    pub opacity: f32,
    /// Flat shading: one normal per triangle.
    pub flat: bool,
    /// Lighting; false draws the colours unchanged.
    pub lighting: bool,
    /// Physically based shading with metalness and roughness.
    pub pbr: bool,
    /// Metalness of the physically based model.
    pub metallic: f32,
    /// Roughness of the physically based model.
    pub roughness: f32,
    /// Index of refraction of the physically based model's dielectric layer.
    pub base_ior: f32,
    /// Front faces are culled.
    pub cull_front: bool,
    /// Back faces are culled.
    pub cull_back: bool,
    /// Colour of the edges of polygons.
    pub edge_color: [f32; 3],
    /// Width of the edges, pixels; 0 for none. Applies only to opaque surfaces that are not
    /// clipped.
    pub edge_width: f32,
}

impl Default for Property {
    /// The values of a new `vtkProperty`.
    fn default() -> Self {
        Property {
            ambient_color: [1.0; 3],
            diffuse_color: [1.0; 3],
            specular_color: [1.0; 3],
            ambient: 0.0,
            diffuse: 1.0,
            specular: 0.0,
            specular_power: 1.0,
            opacity: 1.0,
            flat: false,
            lighting: true,
            pbr: false,
            metallic: 0.0,
            roughness: 0.5,
            base_ior: 1.5,
            cull_front: false,
            cull_back: false,
            edge_color: [0.0; 3],
            edge_width: 0.0,
        }
    }
}

/// One surface to draw.
#[derive(Debug, Clone, Copy)]
pub struct Surface<'a> {
    /// Name for messages and the report.
    pub name: &'a str,
    /// Its geometry.
    pub shape: Shape<'a>,
    /// Data coordinates to world.
    pub world_from_data: DMat4,
    /// Its colour.
    pub color: Color<'a>,
    /// Its texture.
    pub texture: Option<Image<'a>>,
    /// Further textures of its property.
    pub maps: Option<Maps<'a>>,
    /// How it reflects light.
    pub property: Property,
    /// A different property for the back faces of its polygons, opaque and of one colour (needs
    /// [`Shape::has_back_faces`]).
    pub back: Option<Property>,
    /// Copies. Each has its own matrix, from data coordinates of the copy to the input of
    /// `world_from_data`.
    pub glyphs: Option<Glyphs<'a>>,
}

/// Copies of a surface.
#[derive(Debug, Clone, Copy)]
pub struct Glyphs<'a> {
    /// One matrix per copy, in row-major order.
    pub matrices: &'a [[f64; 16]],
    /// One colour per copy; empty to use the surface's own colour.
    pub rgba: &'a [[u8; 4]],
}

/// Scalar types that a grid can have.
#[derive(Debug, Clone, Copy)]
pub enum Scalars<'a> {
    /// Unsigned bytes.
    U8(&'a [u8]),
    /// 32-bit integers.
    I32(&'a [i32]),
    /// 64-bit integers.
    I64(&'a [i64]),
    /// Single precision.
    F32(&'a [f32]),
    /// Double precision.
    F64(&'a [f64]),
}

/// A uniform grid of scalars as an emitting and absorbing medium: `vtkImageData` through a volume
/// mapper, blended front to back.
#[derive(Debug, Clone, Copy)]
pub struct Volume<'a> {
    /// Name for messages and the report.
    pub name: &'a str,
    /// Changes whenever the scalars change; 0 is never cached.
    pub key: u64,
    /// One per point, or per cell with `cells`, x fastest. Not read if
    /// [`crate::bridge::Bridge::has_volume`] returns true.
    pub scalars: Scalars<'a>,
    /// The scalars belong to the cells between the points. A scalar is that of its cell's centre,
    /// and half a cell from the bounds it changes no more, as in OpenGL's textures.
    pub cells: bool,
    /// Points per axis.
    pub dims: [u32; 3],
    /// Distance between neighbouring points, data units; positive.
    pub spacing: [f64; 3],
    /// Data coordinates (point (0,0,0) at zero) to world.
    pub world_from_data: DMat4,
    /// Uses the value of the nearest point; false interpolates linearly.
    pub nearest: bool,
    /// Scalars of the first and the last entry of the tables.
    pub range: [f64; 2],
    /// Colours, evenly spaced and interpolated linearly.
    pub colors: &'a [[f32; 3]],
    /// Opacities of a slab of `unit_distance`, evenly spaced and interpolated linearly.
    pub opacities: &'a [f32],
    /// Thickness to which the opacities refer, data units.
    pub unit_distance: f64,
    /// Distance of the mapper's samples along a ray, data units: [`VolumeBlend::Composite`] takes
    /// the same ones. 0 integrates to half a level instead.
    pub sample_distance: f64,
    /// World position of the camera: lights at the viewer and highlights go by lines from it, as in
    /// OpenGL's parallel projections. `None`: by the rays.
    pub viewer: Option<DVec3>,
    /// Shading; `None` for none.
    pub shading: Option<Shading>,
    /// For each light, its world direction (zero for a light at the viewer) and its colour. An
    /// empty list means one white light at the viewer.
    pub lights: &'a [[f32; 6]],
    /// Gradient opacities, evenly spaced from 0 to `steepest`, that multiply the scalar opacities;
    /// empty for 1.
    pub gradient_opacities: &'a [f32],
    /// Gradient of the last entry, scalar per data unit.
    pub steepest: f64,
    /// How a ray combines the scalars. All modes but [`VolumeBlend::Composite`] use the opacities
    /// unchanged, independent of the thickness.
    pub blend: VolumeBlend<'a>,
    /// What is drawn; `None` for all of it. Planes are in data units.
    pub cropping: Option<Cropping>,
    /// Half-spaces that are drawn: for each a point of the plane and its normal, in the world.
    pub clip_planes: &'a [[f64; 6]],
    /// Cropping planes are where OpenGL's mapper has them: its shader compares them with
    /// coordinates of texels, in which a grid of n points is n wide, and not n - 1.
    pub cropping_in_texels: bool,
    /// So are clipping planes, as in OpenGL's mapper before VTK 9.3.1.
    pub clipping_in_texels: bool,
}

/// `vtkVolumeMapper`'s blend modes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum VolumeBlend<'a> {
    /// Emission and absorption.
    Composite,
    /// Colour and opacity of the largest scalar.
    Maximum,
    /// Colour and opacity of the smallest scalar.
    Minimum,
    /// The mean of colour times opacity, opaque.
    Average,
    /// The integral of colour times opacity by `unit_distance`, opaque.
    Additive,
    /// Isosurfaces at these scalars.
    Isosurfaces(&'a [f64]),
}

/// Shading of a volume by its gradient (`vtkVolumeProperty`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shading {
    /// Ambient coefficient.
    pub ambient: f32,
    /// Diffuse coefficient.
    pub diffuse: f32,
    /// Coefficient of the white specular highlight.
    pub specular: f32,
    /// Exponent of the highlight.
    pub specular_power: f32,
    /// The highlight is centred on the mirrored light (VTK 9.2 and later), not on the half vector
    /// (9.1).
    pub mirrored: bool,
}

/// Shape of a light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightKind {
    /// Parallel light, from `position` to `focal_point`.
    Directional,
    /// In all directions from `position`.
    Point,
    /// A cone from `position` to `focal_point`.
    Spot {
        /// Half angle of the cone, radians.
        cutoff_rad: f64,
        /// Falloff exponent inside the cone.
        exponent: f64,
    },
}

/// A light that is switched on: `vtkLight`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneLight {
    /// Shape.
    pub kind: LightKind,
    /// World position.
    pub position: DVec3,
    /// World point that it is aimed at.
    pub focal_point: DVec3,
    /// Colour times intensity.
    pub color: [f32; 3],
    /// Constant, linear and quadratic attenuation.
    pub attenuation: [f32; 3],
    /// True if the light moves with the camera and points where the camera looks.
    pub headlight: bool,
}

/// A thin lens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Radius of the aperture, world units.
    pub aperture_radius: f64,
    /// Distance in focus, world units.
    pub focus_distance: f64,
}

/// What to render: a camera and a size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// OpenGL's projection · view, depth -1..1.
    pub clip_from_world: DMat4,
    /// World position of the camera: in parallel projections, highlights and lights at the viewer
    /// are seen from it, as in OpenGL's shaders. `None`: along the rays.
    pub viewer: Option<DVec3>,
    /// Pixels per row.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// Renderer's background at the bottom and the top. Reflected rays that hit nothing see it.
    pub background: [[f32; 3]; 2],
    /// The program wants a fast image because the user is moving the camera: one sample.
    pub interactive: bool,
    /// The program itself requests shadows (`vtkRenderer::SetUseShadows`).
    pub shadows: bool,
    /// Samples per pixel that the program itself requests; 0 for no request.
    pub samples: u32,
    /// Samples of each of the window's pixels (`vtkRenderWindow::SetMultiSamples`): edges are as
    /// smooth as OpenGL would draw them. 0 or 1 for a window without; no more than 16 are taken.
    pub window_samples: u32,
    /// OpenGL draws nothing beside the image that is translucent or has a depth. Images with
    /// translucent pixels then come as one layer, [`crate::window_image::WindowImage::straight`].
    pub one_layer: bool,
    /// The program's own lens.
    pub lens: Option<Lens>,
}
