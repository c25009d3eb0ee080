//! VTK's glyphs: an instanced draw of one source, with a matrix and a colour for each copy.
//!
//! The copies become one mesh in the actor's space, with the arithmetic of VTK's vertex shader. So
//! a glyph is like any other surface to what follows, and one structure holds all of them. It is
//! made again only when the program writes one of the buffers. A mesh of so many triangles costs
//! memory, unlike instances, so there is a limit.

use crate::capture::draw::{Attributes, PackedArray, Values, component_bytes};
use crate::capture::vertex_arrays::Instances;
use crate::classify::vtk::signature::VtkShaderSignature;
use crate::driver::gl;
use crate::enums::*;
use crate::interpose::client_memory::ArraySource;
use rayon::prelude::*;
use std::sync::Arc;

/// The most triangles of all copies of a draw: about 2 GB with their structure.
const MOST_TRIANGLES: usize = 1 << 24;

/// The arrays with one element for each copy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct GlyphArrays {
    /// The columns of the matrix.
    matrix: [ArraySource; 4],
    /// The columns of the matrix for normals.
    normal: Option<[ArraySource; 3]>,
    color: ArraySource,
}

/// An attribute of a program with an element for each instance, column by column.
fn columns<const N: usize>(program: u32, name: &str) -> Result<[ArraySource; N], &'static str> {
    const NONE: &str = "glyphs of VTK's without an array of their matrices or colours";
    let first = u32::try_from(gl::attrib_location(program, name)).map_err(|_| NONE)?;
    let mut out = [None; N];
    for (at, column) in (first..).zip(&mut out) {
        if gl::vertex_attrib_i::<1>(at, VERTEX_ATTRIB_ARRAY_DIVISOR)[0] != 1 {
            return Err("glyphs of VTK's with an array that is not one element for each");
        }
        *column = ArraySource::of_attribute(at);
    }
    if out.iter().any(Option::is_none) {
        return Err(NONE);
    }
    let out = out.map(|c| c.expect("checked"));
    // A frame looks at one buffer for each array, to see whether it was written.
    match out.iter().all(|c| c.buffer == out[0].buffer) {
        true => Ok(out),
        false => Err("glyphs of VTK's with a matrix in several buffers"),
    }
}

impl GlyphArrays {
    /// The arrays of a recognised program.
    pub(super) fn query(
        program: u32,
        signature: &VtkShaderSignature,
    ) -> Result<GlyphArrays, &'static str> {
        // A program without lighting leaves the normals out.
        let has_normals = !signature.flat && gl::attrib_location(program, "glyphNormalMatrix") >= 0;
        let [color] = columns(program, "glyphColor")?;
        Ok(GlyphArrays {
            matrix: columns(program, "GCMCMatrix")?,
            normal: has_normals.then(|| columns(program, "glyphNormalMatrix")).transpose()?,
            color,
        })
    }

    /// Arrays in all of the buffers.
    pub(super) fn buffers(&self) -> [Option<ArraySource>; 3] {
        [Some(self.matrix[0]), self.normal.map(|n| n[0]), Some(self.color)]
    }

    /// The elements of the copies of a source with so many vertices and triangles.
    pub(super) fn read(
        &self,
        instances: Instances,
        vertices: usize,
        triangles: usize,
    ) -> Result<Glyphs, &'static str> {
        // Vertices of no triangle count as those of others do.
        let triangles = triangles.max(vertices.div_ceil(3));
        if instances.count.saturating_mul(triangles) > MOST_TRIANGLES {
            return Err("more than 16,777,216 triangles of glyphs");
        }
        let read = |source: &ArraySource| source.read_range(instances.first, instances.count);
        let vectors = |source: &ArraySource| -> Result<Vec<[f32; 4]>, &'static str> {
            let packed = read(source)?;
            Ok((0..instances.count).map(|i| packed.at(i, [0.0, 0.0, 0.0, 1.0])).collect())
        };
        let all = |sources: &[ArraySource]| -> Result<Vec<Vec<[f32; 4]>>, &'static str> {
            sources.iter().map(vectors).collect()
        };
        let matrices = all(&self.matrix)?;
        let copies: Vec<Glyph> = (0..instances.count)
            .map(|i| Glyph { matrix: std::array::from_fn(|k| matrices[k][i]), normal: None })
            .collect();
        let perspective =
            |g: &Glyph| (0..4).any(|k| g.matrix[k][3] != if k == 3 { 1.0 } else { 0.0 });
        if copies.iter().any(perspective) {
            return Err("glyphs of VTK's with a matrix in perspective");
        }
        let color = read(&self.color)?;
        let Some(normal) = &self.normal else { return Ok(Glyphs { copies, color }) };
        let normals = all(normal)?;
        let with_normals = |(i, g): (usize, Glyph)| {
            let column = |k: usize| {
                let [x, y, z, _] = normals[k][i];
                [x, y, z]
            };
            Glyph { normal: Some(std::array::from_fn(column)), ..g }
        };
        let copies = copies.into_iter().enumerate().map(with_normals).collect();
        Ok(Glyphs { copies, color })
    }
}

/// One copy.
#[derive(Debug, Clone, Copy)]
struct Glyph {
    matrix: [[f32; 4]; 4],
    normal: Option<[[f32; 3]; 3]>,
}

impl Glyph {
    fn place(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        let [a, b, c, d] = self.matrix;
        std::array::from_fn(|k| a[k] * x + b[k] * y + c[k] * z + d[k])
    }

    /// A normal, not of unit length, as the vertex shader passes it on.
    fn turn(&self, n: [f32; 3]) -> [f32; 3] {
        let Some([a, b, c]) = self.normal else { return n };
        std::array::from_fn(|k| a[k] * n[0] + b[k] * n[1] + c[k] * n[2])
    }
}

/// The copies of a draw.
#[derive(Debug)]
pub(super) struct Glyphs {
    copies: Vec<Glyph>,
    color: PackedArray,
}

impl Glyphs {
    /// Replaces a source by its copies, one after the other.
    pub(super) fn repeat(
        &self,
        positions: &mut Vec<[f32; 3]>,
        triangles: &mut Vec<[u32; 3]>,
        attributes: &mut Attributes,
    ) {
        let (vertices, times) = (positions.len(), self.copies.len());
        let source = std::mem::take(positions);
        *positions = self
            .copies
            .par_iter()
            .flat_map_iter(|g| source.iter().map(move |p| g.place(*p)))
            .collect();
        let source = std::mem::take(triangles);
        *triangles = (0..times)
            .into_par_iter()
            .flat_map_iter(|i| {
                let first = (i * vertices) as u32;
                source.iter().map(move |t| t.map(|v| v + first))
            })
            .collect();
        if !matches!(attributes.normals, Values::Constant(_)) {
            let source: Vec<[f32; 3]> = (0..vertices).map(|i| attributes.normals.at(i)).collect();
            let turned = self.copies.par_iter();
            let turned = turned.flat_map_iter(|g| source.iter().map(move |n| g.turn(*n)));
            attributes.normals = Values::PerVertex(turned.collect());
        }
        let element = component_bytes(self.color.kind) * self.color.size;
        let colors: Vec<u8> = self
            .color
            .bytes
            .chunks_exact(element)
            .flat_map(|c| std::iter::repeat_n(c, vertices).flatten().copied())
            .collect();
        attributes.colors =
            Values::Packed(Arc::new(PackedArray { bytes: colors, ..self.color.clone() }));
        attributes.tex = match &attributes.tex {
            Values::Constant(c) => Values::Constant(*c),
            Values::PerVertex(v) => Values::PerVertex(v.repeat(times)),
            Values::Packed(p) => {
                let whole = vertices * component_bytes(p.kind) * p.size;
                let bytes = p.bytes.get(..whole).unwrap_or(&p.bytes).repeat(times);
                Values::Packed(Arc::new(PackedArray { bytes, ..(**p).clone() }))
            }
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::current_attributes::CurrentAttributes;

    fn packed(bytes: Vec<u8>, kind: u32, size: usize) -> PackedArray {
        PackedArray { bytes, kind, size, normalized: kind == UNSIGNED_BYTE }
    }

    #[test]
    fn copies_are_placed_turned_and_coloured_one_after_the_other() {
        let copy = |scale: f32, x: f32, normal| Glyph {
            matrix: [
                [scale, 0.0, 0.0, 0.0],
                [0.0, scale, 0.0, 0.0],
                [0.0, 0.0, scale, 0.0],
                [x, 0.0, 0.0, 1.0],
            ],
            normal: Some([[0.0, normal, 0.0], [-normal, 0.0, 0.0], [0.0, 0.0, normal]]),
        };
        let glyphs = Glyphs {
            copies: vec![copy(1.0, 0.0, 1.0), copy(2.0, 10.0, 0.5)],
            color: packed(vec![255, 0, 0, 255, 0, 255, 0, 51], UNSIGNED_BYTE, 4),
        };
        let mut positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 3.0]];
        let mut triangles = vec![[0, 1, 2]];
        let mut attributes = Attributes::constant(&CurrentAttributes::default());
        attributes.normals = Values::PerVertex(vec![[1.0, 0.0, 0.0]; 3]);
        let coordinates = [0.0_f32, 0.25, 0.5, 0.75, 1.0, 0.0];
        attributes.tex =
            Values::Packed(Arc::new(packed(bytemuck::cast_slice(&coordinates).to_vec(), FLOAT, 2)));
        glyphs.repeat(&mut positions, &mut triangles, &mut attributes);
        assert_eq!(triangles, [[0, 1, 2], [3, 4, 5]]);
        assert_eq!(positions[..3], [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 3.0]]);
        assert_eq!(positions[3..], [[10.0, 0.0, 0.0], [12.0, 0.0, 0.0], [10.0, 2.0, 6.0]]);
        let normals: Vec<[f32; 3]> = (0..6).map(|i| attributes.normals.at(i)).collect();
        assert_eq!(normals[0], [0.0, 1.0, 0.0]);
        assert_eq!(normals[5], [0.0, 0.5, 0.0], "not of unit length, as in the shader");
        assert_eq!(attributes.colors.at(2), [1.0, 0.0, 0.0, 1.0]);
        assert_eq!(attributes.colors.at(3), [0.0, 1.0, 0.0, 0.2]);
        assert_eq!(attributes.tex.at(4)[..2], [0.5, 0.75]);
    }
}
