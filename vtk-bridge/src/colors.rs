//! Converts colours of points and cells to rt-core's format and caches them until their key
//! changes.

use crate::geometry::PolygonMesh;
use crate::input::{Color, Image, PerItem};
use rayon::prelude::*;
use rt_core::colormap::ColorMap;
use rt_core::mesh::Attribute;
use rt_core::texture::{Filter, Texture, Wrap};
use std::sync::Arc;

/// The colours of one mesh.
#[derive(Clone)]
pub enum MeshColors {
    /// RGBA of vertices or triangles.
    Values(Arc<Attribute<[f32; 4]>>),
    /// Positions on a colour map.
    Mapped(Arc<Attribute<f32>>, Arc<ColorMap>),
}

/// Number of values per task.
const CHUNK: usize = 1 << 14;

/// Converts bytes to floats. VTK writes its colours to the image unchanged, so they are not decoded
/// here and the image is not encoded.
fn float(c: [u8; 4]) -> [f32; 4] {
    c.map(|v| f32::from(v) / 255.0)
}

/// Resolves `color` for `built`, or says why that is impossible. `points` is the number of points
/// that the colours were made for.
pub fn resolve(
    color: &Color<'_>,
    built: &PolygonMesh,
    points: usize,
) -> Result<Option<MeshColors>, String> {
    let length = |what, expected: usize, found: usize| {
        format!("{found} colours for {expected} {what}: the property's colour is used")
    };
    match color {
        Color::Material => Ok(None),
        Color::Values { rgba: PerItem::Point(values), .. } => {
            if values.len() < points {
                return Err(length("points", points, values.len()));
            }
            let values: Vec<[f32; 4]> =
                values[..points].par_iter().with_min_len(CHUNK).map(|c| float(*c)).collect();
            let values = match &built.clip_map {
                Some(c) => c.vertex_values(&values, |a, b, t| {
                    std::array::from_fn(|k| a[k] + (b[k] - a[k]) * t)
                }),
                None => values,
            };
            Ok(Some(MeshColors::Values(Arc::new(Attribute::per_vertex(values)))))
        }
        Color::Values { rgba: PerItem::Cell(values), .. } => {
            let of_triangle = |i: usize| {
                let before = built.clip_map.as_ref().map_or(i, |c| c.triangles[i] as usize);
                values.get(built.cells.at(before)).map(|c| float(*c))
            };
            let triangles = built.mesh.indices.len();
            let list: Option<Vec<_>> =
                (0..triangles).into_par_iter().with_min_len(CHUNK).map(of_triangle).collect();
            let list = list.ok_or_else(|| length("cells", triangles, values.len()))?;
            Ok(Some(MeshColors::Values(Arc::new(Attribute::per_face(list)))))
        }
        Color::Mapped { coordinates, row, nan, .. } => {
            if coordinates.len() < points || row.is_empty() {
                return Err(length("points", points, coordinates.len()));
            }
            // A lookup table whose range is a single number yields 0/0 for that number; OpenGL then
            // takes the first colour.
            let place = |x: f32| if x.is_nan() { 0.0 } else { x.clamp(-1000.0, 1000.0) };
            let of = |c: &[f32; 2]| if c[1] > 0.5 { f32::NAN } else { place(c[0]) };
            let values: Vec<f32> =
                coordinates[..points].par_iter().with_min_len(CHUNK).map(of).collect();
            let values = match &built.clip_map {
                Some(c) => c.vertex_values(&values, |a, b, t| a + (b - a) * t),
                None => values,
            };
            Ok(Some(MeshColors::Mapped(
                Arc::new(Attribute::per_vertex(values)),
                Arc::new(stepped(row, *nan)),
            )))
        }
    }
}

/// Maximum number of entries of a stepped map.
const MAP_ENTRIES: usize = 4096;

/// VTK takes the nearest colour of its row, but rt-core's maps interpolate linearly. Each colour is
/// therefore repeated, so that only a small part of the range lies between two different ones.
fn stepped(row: &[[u8; 4]], nan: [u8; 4]) -> ColorMap {
    let repeat = (MAP_ENTRIES / row.len()).max(1);
    let n = row.len() * repeat;
    let colors = row.iter().flat_map(|c| std::iter::repeat_n(float(*c), repeat)).collect();
    // Entry k of n is centred in its part of 0..1, as texels are.
    let half = 0.5 / n as f32;
    ColorMap { nan_color: float(nan), ..ColorMap::new(colors, [half, 1.0 - half]) }
}

/// Converts a texture; only images marked as sRGB are decoded (see `float`).
pub fn texture(image: &Image<'_>) -> Option<Texture> {
    let decode = |v: f32| if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
    let linear = |c: [u8; 4]| {
        let [r, g, b, a] = float(c);
        if image.srgb { [decode(r), decode(g), decode(b), a] } else { [r, g, b, a] }
    };
    let texels = image.rgba.par_iter().with_min_len(CHUNK).map(|c| linear(*c)).collect();
    let mut texture = Texture::from_linear(image.width, image.height, texels).ok()?;
    texture.wrap = [if image.repeat { Wrap::Repeat } else { Wrap::Clamp }; 2];
    texture.filter = if image.interpolate { Filter::Bilinear } else { Filter::Nearest };
    Some(texture)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_of_colours_is_stepped_like_the_nearest_texel() {
        let row = [[0, 0, 0, 255], [255, 0, 0, 255], [255, 255, 0, 255], [255, 255, 255, 255]];
        let map = stepped(&row, [1, 2, 3, 255]);
        for u in [0.01f32, 0.1, 0.24, 0.26, 0.49, 0.51, 0.74, 0.76, 0.99] {
            let nearest = float(row[(u * 4.0) as usize]);
            assert_eq!(map.lookup(u), nearest, "at {u}");
        }
        assert_eq!(map.lookup(f32::NAN), float([1, 2, 3, 255]));
        assert_eq!(map.lookup(7.0), [1.0; 4]);
    }

    #[test]
    fn a_range_without_extent_takes_the_first_color_and_not_that_of_nan() {
        use crate::input::{Cells, Ids, Points, Shape};
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let polys = Cells { offsets: Ids::I64(&[0, 3]), connectivity: Ids::I64(&[0, 1, 2]) };
        let built = crate::geometry::build(&Shape::polygons(1, Points::F32(&points), polys));
        let coordinates = [[f32::NAN, 0.0], [f32::INFINITY, 0.0], [0.5, 1.0]];
        let color = Color::Mapped {
            key: 1,
            coordinates: &coordinates,
            row: &[[9, 8, 7, 255]; 4],
            nan: [1, 2, 3, 255],
        };
        let resolved = resolve(&color, &built.mesh.expect("a triangle"), 3);
        let Ok(Some(MeshColors::Mapped(values, _))) = resolved else { panic!("a map") };
        assert_eq!(values.values[..2], [0.0, 1000.0]);
        assert!(values.values[2].is_nan(), "the value itself is not a number");
    }
}
