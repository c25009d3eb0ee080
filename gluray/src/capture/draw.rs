//! Draw calls as meshes, with their attributes and state.

use crate::capture::geometry_cache::Geometry;
use crate::classify::vtk::VtkProgram;
use crate::enums::*;
use crate::state::current_attributes::CurrentAttributes;
use crate::state::material::Materials;
use crate::state::snapshot::Snapshot;
use crate::trace::overrides::RayMaterial;
use crate::trace::texturing::Image;
use std::sync::Arc;

/// An attribute of `N` components.
#[derive(Debug, Clone)]
pub(crate) enum Values<const N: usize> {
    /// The same everywhere.
    Constant([f32; N]),
    /// One per vertex.
    PerVertex(Vec<[f32; N]>),
    /// One per vertex, in the format of the program's arrays.
    Packed(Arc<PackedArray>),
}

/// A tightly packed array in the program's format.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PackedArray {
    pub(crate) bytes: Vec<u8>,
    pub(crate) kind: u32,
    pub(crate) size: usize,
    pub(crate) normalized: bool,
}

/// The number of bytes of one component of a type; 0 for types that are not read.
pub(crate) fn component_bytes(kind: u32) -> usize {
    match kind {
        BYTE | UNSIGNED_BYTE => 1,
        SHORT | UNSIGNED_SHORT => 2,
        INT | UNSIGNED_INT | FLOAT => 4,
        DOUBLE => 8,
        _ => 0,
    }
}

/// One component. Signed normalised values are c / (2^(b-1) - 1), at least -1 (OpenGL 4.2, equation
/// 2.2), as in Mesa's arrays.
pub(crate) fn component(b: &[u8], kind: u32, normalized: bool) -> f32 {
    let signed =
        |v: f64, most: f64| if normalized { (v / most).max(-1.0) as f32 } else { v as f32 };
    let unsigned = |v: f64, most: f64| if normalized { (v / most) as f32 } else { v as f32 };
    match (kind, b) {
        (FLOAT, &[a, b, c, d]) => f32::from_ne_bytes([a, b, c, d]),
        (DOUBLE, &[a, b, c, d, e, f, g, h]) => f64::from_ne_bytes([a, b, c, d, e, f, g, h]) as f32,
        (BYTE, &[a]) => signed(f64::from(a.cast_signed()), 127.0),
        (UNSIGNED_BYTE, &[a]) => unsigned(f64::from(a), 255.0),
        (SHORT, &[a, b]) => signed(f64::from(i16::from_ne_bytes([a, b])), 32767.0),
        (UNSIGNED_SHORT, &[a, b]) => unsigned(f64::from(u16::from_ne_bytes([a, b])), 65535.0),
        (INT, &[a, b, c, d]) => {
            signed(f64::from(i32::from_ne_bytes([a, b, c, d])), 2_147_483_647.0)
        }
        (UNSIGNED_INT, &[a, b, c, d]) => {
            unsigned(f64::from(u32::from_ne_bytes([a, b, c, d])), 4_294_967_295.0)
        }
        _ => 0.0,
    }
}

impl PackedArray {
    /// The value of vertex `i`. Missing components come from `fill`.
    pub(crate) fn at<const N: usize>(&self, i: usize, fill: [f32; N]) -> [f32; N] {
        let one = component_bytes(self.kind);
        let start = i * one * self.size;
        std::array::from_fn(|k| {
            if k >= self.size {
                return fill[k];
            }
            let b = self.bytes.get(start + k * one..start + (k + 1) * one);
            b.map_or(fill[k], |b| component(b, self.kind, self.normalized))
        })
    }
}

impl<const N: usize> Values<N> {
    /// The value of vertex `i`.
    pub(crate) fn at(&self, i: usize) -> [f32; N] {
        let fill = || std::array::from_fn(|k| if k == 3 { 1.0 } else { 0.0 });
        match self {
            Values::Constant(v) => *v,
            Values::PerVertex(v) => v.get(i).copied().unwrap_or_else(fill),
            Values::Packed(p) => p.at(i, fill()),
        }
    }
}

/// The attributes of a draw.
#[derive(Debug, Clone)]
pub(crate) struct Attributes {
    pub(crate) normals: Values<3>,
    pub(crate) colors: Values<4>,
    pub(crate) tex: Values<4>,
    /// The materials of the draw, and the index of each vertex's material (empty: all the first).
    pub(crate) materials: Vec<Materials>,
    pub(crate) material_of: Vec<u32>,
    /// For one geometry, attributes with the same version are equal. 0 means unknown.
    pub(crate) version: u64,
}

impl Attributes {
    /// The same attributes for all vertices.
    pub(crate) fn constant(current: &CurrentAttributes) -> Attributes {
        Attributes {
            normals: Values::Constant(current.normal),
            colors: Values::Constant(current.color),
            tex: Values::Constant(current.tex),
            materials: vec![current.materials],
            material_of: Vec::new(),
            version: 0,
        }
    }

    /// The materials of vertex `i`.
    pub(crate) fn materials_at(&self, i: usize) -> &Materials {
        &self.materials[self.material_of.get(i).map_or(0, |m| *m as usize)]
    }
}

/// What computes a draw's colours.
#[derive(Debug, Clone)]
pub(crate) enum Shading {
    /// OpenGL's fixed function.
    Fixed,
    /// A recognised shader.
    Program(Arc<VtkProgram>),
}

/// A draw to trace.
#[derive(Clone)]
pub(crate) struct Draw {
    pub(crate) geometry: Arc<Geometry>,
    pub(crate) attributes: Arc<Attributes>,
    pub(crate) state: Arc<Snapshot>,
    pub(crate) shading: Shading,
    /// The matrix from object to clip space, column by column, as the driver has it in f32.
    pub(crate) clip_from_object: [f32; 16],
    /// The number of the program's draw calls in it.
    pub(crate) calls: u64,
    /// The material that the user has set.
    pub(crate) ray_material: RayMaterial,
}

/// A draw and the image of its texture.
pub(crate) type TexturedDraw = (Draw, Option<Arc<Image>>);

impl Draw {
    /// True when no part of the draw lets light through.
    pub(crate) fn has_full_alpha(&self) -> bool {
        let (s, a) = (&self.state, &self.attributes);
        let tracked =
            s.color_material.is_some_and(|(_, what)| matches!(what, DIFFUSE | AMBIENT_AND_DIFFUSE));
        match (&self.shading, &a.colors) {
            (Shading::Program(program), _) => {
                program.is_opaque(a, self.geometry.mesh.positions.len())
            }
            _ if s.lighting && !tracked => {
                a.materials.iter().flatten().all(|m| m.diffuse[3] == 1.0)
            }
            (_, Values::Constant(c)) => c[3] == 1.0,
            (_, Values::PerVertex(all)) => all.iter().all(|c| c[3] == 1.0),
            (_, Values::Packed(_)) => {
                (0..self.geometry.mesh.positions.len()).all(|i| a.colors.at(i)[3] == 1.0)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn byte_normals_are_read_as_arrays_have_them() {
        let p =
            PackedArray { bytes: vec![127, 129, 128, 0], kind: BYTE, size: 3, normalized: true };
        assert_eq!(p.at::<3>(0, [0.0; 3]), [1.0, -1.0, -1.0]);
        let p = PackedArray {
            bytes: vec![255, 0, 51, 255],
            kind: UNSIGNED_BYTE,
            size: 4,
            normalized: true,
        };
        assert_eq!(p.at::<4>(0, [0.0; 4]), [1.0, 0.0, 0.2, 1.0]);
    }
}
