//! The rendered image: colour and the other requested layers.
//!
//! All layers are row by row, **row 0 at the top**, one value per pixel.

use crate::colormap::linear_to_srgb;
use std::borrow::Cow;
use std::ops::BitOr;

/// Which layers to compute. Layers that are not requested are neither computed nor stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Layers(u32);

impl Layers {
    /// Colour and coverage. Without it nothing is shaded.
    pub const COLOR: Layers = Layers(1);
    /// OpenGL's window depth.
    pub const DEPTH: Layers = Layers(1 << 1);
    /// Distance from the eye along the ray.
    pub const DISTANCE: Layers = Layers(1 << 2);
    /// Shading normal.
    pub const NORMAL: Layers = Layers(1 << 3);
    /// Instance and primitive.
    pub const IDS: Layers = Layers(1 << 4);
    /// Rays traced per pixel.
    pub const COST: Layers = Layers(1 << 5);
    /// Every layer.
    pub const ALL: Layers = Layers((1 << 6) - 1);

    /// True when every layer of `other` is included.
    pub const fn contains(self, other: Layers) -> bool {
        self.0 & other.0 == other.0
    }

    /// True when a layer of `other` is included.
    pub const fn intersects(self, other: Layers) -> bool {
        self.0 & other.0 != 0
    }

    /// Layers of this set that are not in `other`.
    pub const fn without(self, other: Layers) -> Layers {
        Layers(self.0 & !other.0)
    }

    /// True for no layer at all.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Layers that describe the surface at the pixel's centre.
    pub(crate) const GEOMETRY: Layers = Layers(0b1_1110);
}

impl BitOr for Layers {
    type Output = Layers;
    fn bitor(self, o: Layers) -> Layers {
        Layers(self.0 | o.0)
    }
}

/// An image. A layer that was not requested is empty.
///
/// `depth`, `distance`, `normal`, `instance` and `primitive` belong to the ray through the pixel's
/// centre, for any number of samples and any lens. Averages over a silhouette would be values that
/// lie on no surface.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Frame {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Linear RGBA, colour premultiplied by alpha (coverage times opacity); mean over the samples.
    pub color: Vec<[f32; 4]>,
    /// OpenGL window depth of the surface at the pixel centre: 0 at the near plane to 1 at the far
    /// plane (or the camera's depth range), within 4 ulp of the matrix product evaluated at the
    /// exact intersection; the far value where nothing is hit.
    pub depth: Vec<f32>,
    /// Euclidean distance from the eye (parallel projection: from the near plane), world units;
    /// infinite where nothing is hit.
    pub distance: Vec<f32>,
    /// Unit shading normal in world axes, oriented by the material's sides; zero where nothing is
    /// hit.
    pub normal: Vec<[f32; 3]>,
    /// Index of the instance; `u32::MAX` where nothing is hit.
    pub instance: Vec<u32>,
    /// Primitive within the instance's geometry; `u32::MAX` where nothing is hit.
    pub primitive: Vec<u32>,
    /// Rays traced for the pixel, summed over all samples and kinds.
    pub cost: Vec<f32>,
}

/// Values of one channel.
#[derive(Debug, Clone, PartialEq)]
pub enum PlaneValues<'a> {
    /// Floating point.
    F32(Cow<'a, [f32]>),
    /// Unsigned integers.
    U32(Cow<'a, [u32]>),
}

/// One channel of a frame, for image files with named channels (OpenEXR).
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Plane<'a> {
    /// Channel name as EXR viewers group them: `R`, `depth.Z`, `normal.X`.
    pub name: &'static str,
    /// Unit of the values, as text.
    pub unit: &'static str,
    /// `width * height` values, top row first.
    pub values: PlaneValues<'a>,
}

/// How linear colour is converted to 8 bits.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Encoding {
    /// IEC 61966-2-1 (sRGB), which image files and screens expect.
    #[default]
    Srgb,
    /// No conversion, as OpenGL and VTK write without sRGB framebuffers.
    Direct,
}

impl Frame {
    /// An image in which nothing is hit, with the given layers: transparent, with the depth
    /// `background_depth` ([`Camera::background_depth`](crate::camera::Camera::background_depth)).
    pub fn blank(width: u32, height: u32, layers: Layers, background_depth: f32) -> Frame {
        let n = width as usize * height as usize;
        let pixels = |layer| if layers.contains(layer) { n } else { 0 };
        Frame {
            width,
            height,
            color: vec![[0.0; 4]; pixels(Layers::COLOR)],
            depth: vec![background_depth; pixels(Layers::DEPTH)],
            distance: vec![f32::INFINITY; pixels(Layers::DISTANCE)],
            normal: vec![[0.0; 3]; pixels(Layers::NORMAL)],
            instance: vec![u32::MAX; pixels(Layers::IDS)],
            primitive: vec![u32::MAX; pixels(Layers::IDS)],
            cost: vec![0.0; pixels(Layers::COST)],
        }
    }

    /// Index of pixel (`x`, `y`), y from the top. Panics outside the image.
    #[inline]
    pub fn index(&self, x: u32, y: u32) -> usize {
        assert!(
            x < self.width && y < self.height,
            "pixel ({x}, {y}) is outside {} x {}",
            self.width,
            self.height
        );
        y as usize * self.width as usize + x as usize
    }

    /// Linear premultiplied RGBA of pixel (`x`, `y`). Panics outside the image and without the
    /// colour layer.
    pub fn color_at(&self, x: u32, y: u32) -> [f32; 4] {
        self.color[self.index(x, y)]
    }

    /// Number of pixels.
    pub fn num_pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Every computed channel with its name and unit.
    pub fn planes(&self) -> Vec<Plane<'_>> {
        let mut out = Vec::new();
        let component = |v: Vec<f32>| PlaneValues::F32(Cow::Owned(v));
        if !self.color.is_empty() {
            let unit = "linear, premultiplied";
            for (c, name) in ["R", "G", "B", "A"].into_iter().enumerate() {
                let unit = if c == 3 { "coverage 0..1" } else { unit };
                out.push(Plane {
                    name,
                    unit,
                    values: component(self.color.iter().map(|p| p[c]).collect()),
                });
            }
        }
        for (name, unit, values) in [
            ("depth.Z", "OpenGL window depth 0..1", &self.depth),
            ("distance.Z", "world units from the eye", &self.distance),
            ("cost.rays", "rays per pixel", &self.cost),
        ] {
            if !values.is_empty() {
                out.push(Plane { name, unit, values: PlaneValues::F32(Cow::Borrowed(values)) });
            }
        }
        if !self.normal.is_empty() {
            for (c, name) in ["normal.X", "normal.Y", "normal.Z"].into_iter().enumerate() {
                let values = component(self.normal.iter().map(|p| p[c]).collect());
                out.push(Plane { name, unit: "unit vector, world axes", values });
            }
        }
        for (name, values) in [("id.instance", &self.instance), ("id.primitive", &self.primitive)] {
            if !values.is_empty() {
                let values = PlaneValues::U32(Cow::Borrowed(values));
                out.push(Plane { name, unit: "index, 4294967295 for none", values });
            }
        }
        out
    }

    /// 8-bit RGBA, not premultiplied (as PNG requires), multiplied by `exposure` before encoding.
    /// Values are clamped to 0..=1; NaN becomes 0.
    pub fn to_rgba8(&self, encoding: Encoding, exposure: f32) -> Vec<u8> {
        let mut out = Vec::with_capacity(self.color.len() * 4);
        for &[r, g, b, a] in &self.color {
            let scale = if a > 0.0 { exposure / a } else { 0.0 };
            for v in [r, g, b] {
                let v = (v * scale).clamp(0.0, 1.0);
                let v = if encoding == Encoding::Srgb { linear_to_srgb(v) } else { v };
                // `as` saturates and turns NaN into 0.
                out.push((v * 255.0 + 0.5) as u8);
            }
            out.push((a.clamp(0.0, 1.0) * 255.0 + 0.5) as u8);
        }
        out
    }
}
