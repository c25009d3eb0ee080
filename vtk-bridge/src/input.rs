//! The data of a visualization program, borrowed without a copy: points, cells, attributes,
//! properties, lights and a camera.
//!
//! The types mirror VTK's arrays (`vtkPoints`, `vtkCellArray`, `vtkUnsignedCharArray`) but do not
//! depend on VTK. Any program with such arrays can fill them in. The arrays are read only when
//! [`crate::bridge::Bridge::add_surface`] needs them.

use rt_core::glam::{DMat4, DVec3};

/// Point coordinates, three per point.
#[derive(Debug, Clone, Copy)]
pub enum Points<'a> {
    /// Single precision.
    F32(&'a [[f32; 3]]),
    /// Double precision; kept relative to the middle, so that detail far from zero survives.
    F64(&'a [[f64; 3]]),
}

impl Points<'_> {
    /// How many points.
    pub fn len(&self) -> usize {
        match self {
            Points::F32(p) => p.len(),
            Points::F64(p) => p.len(),
        }
    }

    /// True without points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Point `i`. Panics when there is none.
    pub fn at(&self, i: usize) -> DVec3 {
        match self {
            Points::F32(p) => DVec3::from(p[i].map(f64::from)),
            Points::F64(p) => DVec3::from(p[i]),
        }
    }
}

/// Whole numbers of either width, as `vtkCellArray` stores them.
#[derive(Debug, Clone, Copy)]
pub enum Ids<'a> {
    /// 32 bits.
    I32(&'a [i32]),
    /// 64 bits.
    I64(&'a [i64]),
}

impl Ids<'_> {
    /// How many.
    pub fn len(&self) -> usize {
        match self {
            Ids::I32(v) => v.len(),
            Ids::I64(v) => v.len(),
        }
    }

    /// True when there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number `i`; panics past the end.
    #[inline]
    pub fn at(&self, i: usize) -> i64 {
        match self {
            Ids::I32(v) => i64::from(v[i]),
            Ids::I64(v) => v[i],
        }
    }

    /// Number `i` as a vertex index. What no index can be (negative, or beyond 32 bits) becomes
    /// `u32::MAX`, which no mesh has: such a triangle is left out and counted.
    #[inline]
    pub fn vertex(&self, i: usize) -> u32 {
        u32::try_from(self.at(i)).unwrap_or(u32::MAX)
    }
}

/// Cells as runs of point numbers: cell i is `connectivity[offsets[i]..offsets[i + 1]]`.
#[derive(Debug, Clone, Copy)]
pub struct Cells<'a> {
    /// One more than there are cells; empty for no cells.
    pub offsets: Ids<'a>,
    /// Point numbers.
    pub connectivity: Ids<'a>,
}

impl<'a> Cells<'a> {
    /// No cells.
    pub const NONE: Cells<'static> = Cells { offsets: Ids::I64(&[]), connectivity: Ids::I64(&[]) };

    /// How many cells.
    pub fn len(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// True without cells.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The run of cell `i` in `connectivity`; empty where the offsets make no sense.
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

/// Which points and cells, and everything else that decides where rays meet them. The acceleration
/// structure is kept as long as `key` stays the same.
#[derive(Debug, Clone, Copy)]
pub struct Shape<'a> {
    /// Changes whenever one of the arrays or numbers below does; 0 is never kept.
    pub key: u64,
    /// Coordinates.
    pub points: Points<'a>,
    /// Vertices: drawn as spheres when `point_radius` is positive.
    pub verts: Cells<'a>,
    /// Polylines: drawn as tubes when `line_radius` is positive.
    pub lines: Cells<'a>,
    /// Polygons, fanned into triangles from their first point as VTK does.
    pub polys: Cells<'a>,
    /// Triangle strips.
    pub strips: Cells<'a>,
    /// Shading normals; of the cells only where there are none of the points.
    pub normals: Option<PerItem<'a, [f32; 3]>>,
    /// Texture coordinates, one per point.
    pub texcoords: Option<&'a [[f32; 2]]>,
    /// Directions in which the first texture coordinate grows, one per point, for normal maps.
    pub tangents: Option<&'a [[f32; 3]]>,
    /// Half-spaces `a x + b y + c z + d >= 0` (data coordinates) outside of which nothing is drawn.
    pub clip_planes: &'a [[f64; 4]],
    /// Radius of spheres for `verts`, data units; 0 for none.
    pub point_radius: f64,
    /// Radius of tubes for `lines`, data units; 0 for none.
    pub line_radius: f64,
    /// Polygons are drawn as their edges, with tubes of `line_radius`.
    pub edges_only: bool,
    /// The backs of polygons look different ([`Surface::back`]).
    pub has_back_faces: bool,
}

impl<'a> Shape<'a> {
    /// Points and polygons, nothing else.
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

/// An RGBA picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Image<'a> {
    /// Changes whenever the pixels do; 0 is never kept.
    pub key: u64,
    /// Texels per row.
    pub width: usize,
    /// Rows; the first is at texture coordinate v = 0.
    pub height: usize,
    /// Not premultiplied.
    pub rgba: &'a [[u8; 4]],
    /// Linear between texels instead of the nearest.
    pub interpolate: bool,
    /// Repeated outside 0..1 instead of its edge.
    pub repeat: bool,
    /// Encoded as sRGB: decoded before it is interpolated.
    pub srgb: bool,
}

/// Textures of a physically based property besides that of its colour, as VTK's shader reads them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Maps<'a> {
    /// Occlusion, roughness (times the property's) and metalness (times the property's) in red,
    /// green and blue.
    pub material: Option<Image<'a>>,
    /// Normals, 2 rgb - 1; nothing without [`Shape::tangents`].
    pub normal: Option<Image<'a>>,
    /// Radiance given off.
    pub emissive: Option<Image<'a>>,
    /// Factor on the first two components of the normals.
    pub normal_scale: f32,
    /// 0 for no occlusion, 1 for all of it.
    pub occlusion_strength: f32,
    /// Factor on the radiance.
    pub emissive_factor: [f32; 3],
}

/// Where the colour of a surface comes from.
#[derive(Debug, Clone, Copy)]
pub enum Color<'a> {
    /// The material's own.
    Material,
    /// RGBA of points (interpolated) or cells.
    Values {
        /// Changes whenever the values do; 0 is never kept.
        key: u64,
        /// Not premultiplied.
        rgba: PerItem<'a, [u8; 4]>,
    },
    /// Coordinates that are interpolated first and looked up in a row of colours then (VTK's
    /// *interpolate scalars before mapping*).
    Mapped {
        /// Changes whenever coordinates or row do; 0 is never kept.
        key: u64,
        /// One pair per point: position in the row (0 to 1), and above 0.5 where the value is NaN.
        coordinates: &'a [[f32; 2]],
        /// The colours; the nearest one is taken.
        row: &'a [[u8; 4]],
        /// Colour of NaN.
        nan: [u8; 4],
    },
}

/// How surfaces answer light: `vtkProperty`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Property {
    /// Colour that ambient light sees.
    pub ambient_color: [f32; 3],
    /// Colour that lights see.
    pub diffuse_color: [f32; 3],
    /// Colour of the highlight.
    pub specular_color: [f32; 3],
    /// Share of the ambient colour that shows without any light.
    pub ambient: f32,
    /// Factor on diffuse light.
    pub diffuse: f32,
    /// Factor on the highlight.
    pub specular: f32,
    /// Exponent of the highlight.
    pub specular_power: f32,
    /// 1 opaque.
    pub opacity: f32,
    /// One normal per triangle.
    pub flat: bool,
    /// False: colours are drawn as they are.
    pub lighting: bool,
    /// Physically based: metallic, roughness.
    pub pbr: bool,
    /// Of the physically based model.
    pub metallic: f32,
    /// Of the physically based model.
    pub roughness: f32,
    /// Index of refraction of the physically based model's dielectric layer.
    pub base_ior: f32,
    /// Sides turned to the viewer are left out.
    pub cull_front: bool,
    /// Sides turned away from the viewer are left out.
    pub cull_back: bool,
    /// Colour of the edges of polygons.
    pub edge_color: [f32; 3],
    /// Their width, pixels; 0 for none. Only on opaque surfaces that are not clipped.
    pub edge_width: f32,
}

impl Default for Property {
    /// A new `vtkProperty`'s.
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

/// One drawn thing.
#[derive(Debug, Clone, Copy)]
pub struct Surface<'a> {
    /// Name for messages and the report.
    pub name: &'a str,
    /// Where rays meet it.
    pub shape: Shape<'a>,
    /// Data coordinates to world.
    pub world_from_data: DMat4,
    /// Its colours.
    pub color: Color<'a>,
    /// Its texture.
    pub texture: Option<Image<'a>>,
    /// Further textures of its property.
    pub maps: Option<Maps<'a>>,
    /// Its answer to light.
    pub property: Property,
    /// Another answer on the backs of its polygons, opaque and of one colour (needs
    /// [`Shape::has_back_faces`]).
    pub back: Option<Property>,
    /// Copies: each is drawn where its own matrix (data of the copy to `world_from_data`'s input)
    /// puts it.
    pub glyphs: Option<Glyphs<'a>>,
}

/// Copies of a surface.
#[derive(Debug, Clone, Copy)]
pub struct Glyphs<'a> {
    /// A matrix per copy, row by row.
    pub matrices: &'a [[f64; 16]],
    /// A colour per copy; empty for the surface's own.
    pub rgba: &'a [[u8; 4]],
}

/// Values of any kind that a grid can have.
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

/// A uniform grid of scalars as a glowing, absorbing medium: `vtkImageData` through a volume
/// mapper, blended front to back.
#[derive(Debug, Clone, Copy)]
pub struct Volume<'a> {
    /// Name for messages and the report.
    pub name: &'a str,
    /// Changes whenever the scalars do; 0 is never kept.
    pub key: u64,
    /// One per point, x fastest. Not read when [`crate::bridge::Bridge::has_volume`] says so.
    pub scalars: Scalars<'a>,
    /// Points per axis.
    pub dims: [u32; 3],
    /// Distance of neighbouring points, data units; positive.
    pub spacing: [f64; 3],
    /// Data coordinates (point (0,0,0) at zero) to world.
    pub world_from_data: DMat4,
    /// The value of the nearest point instead of linear interpolation.
    pub nearest: bool,
    /// Scalars of the first and the last entry of the tables.
    pub range: [f64; 2],
    /// Colours, evenly spaced, linear between.
    pub colors: &'a [[f32; 3]],
    /// Opacities of a slab of `unit_distance`, evenly spaced, linear between.
    pub opacities: &'a [f32],
    /// Thickness that the opacities are for, data units.
    pub unit_distance: f64,
    /// Answer to light; `None` for none.
    pub shading: Option<Shading>,
    /// Lights: for each the direction towards it, in the world (zero for one at the viewer), and
    /// its colour; none for a white one at the viewer.
    pub lights: &'a [[f32; 6]],
    /// Opacities by gradient, evenly spaced from 0 to `steepest`, that the others are multiplied
    /// by; empty for 1.
    pub gradient_opacities: &'a [f32],
    /// Gradient of the last of them, scalar per data unit.
    pub steepest: f64,
    /// What a ray makes of the scalars. All but [`VolumeBlend::Composite`] take the opacities as
    /// they are, whatever the thickness.
    pub blend: VolumeBlend<'a>,
}

/// `vtkVolumeMapper`'s blend modes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum VolumeBlend<'a> {
    /// Emission and absorption.
    Composite,
    /// Colour and opacity of the largest scalar.
    Maximum,
    /// Of the smallest.
    Minimum,
    /// The mean of colour times opacity, opaque.
    Average,
    /// The integral of colour times opacity by `unit_distance`, opaque.
    Additive,
    /// Surfaces of these scalars.
    Isosurfaces(&'a [f64]),
}

/// Answer of a volume to light, by its gradient (`vtkVolumeProperty`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shading {
    /// Part of the colour that needs no light.
    pub ambient: f32,
    /// Part that is lit.
    pub diffuse: f32,
    /// White highlight.
    pub specular: f32,
    /// Its exponent.
    pub specular_power: f32,
    /// It lies around the mirrored light (VTK 9.2 and later), not the half vector (9.1).
    pub mirrored: bool,
}

/// Shape of a light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightKind {
    /// Parallel light, from `position` to `focal_point`.
    Directional,
    /// To all sides from `position`.
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
    /// World point it looks at.
    pub focal_point: DVec3,
    /// Colour times intensity.
    pub color: [f32; 3],
    /// Constant, linear and quadratic attenuation.
    pub attenuation: [f32; 3],
    /// True when it moves with the camera and looks where the camera looks.
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

/// What is asked for: a camera and a size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// OpenGL's projection · view, depth -1..1.
    pub clip_from_world: DMat4,
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Renderer's background at the bottom and the top: what mirrors see where they see nothing.
    pub background: [[f32; 3]; 2],
    /// The program wants a quick picture (it is being turned with the mouse): one sample.
    pub interactive: bool,
    /// The program itself asks for shadows (`vtkRenderer::SetUseShadows`).
    pub shadows: bool,
    /// Samples per pixel that the program itself asks for; 0 for no wish.
    pub samples: u32,
    /// The program's own lens.
    pub lens: Option<Lens>,
}
