//! Indexed triangle meshes with attributes, and their validation.

mod slices;

use crate::math::Aabb;
use glam::{DVec3, Vec2, Vec3, Vec4};

pub use slices::MeshSlices;
pub(crate) use slices::Triangles;

/// Whether an [`Attribute`] has one value per vertex or one per triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PerElement {
    /// One value per entry of [`TriMesh::positions`], interpolated across a triangle.
    Vertex,
    /// One value per entry of [`TriMesh::indices`], constant on a triangle.
    Face,
}

/// Values on the vertices or the triangles of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Attribute<T> {
    /// What the values belong to.
    pub per: PerElement,
    /// One value per element.
    pub values: Vec<T>,
}

impl<T> Attribute<T> {
    /// One value per vertex.
    pub fn per_vertex(values: Vec<T>) -> Self {
        Attribute { per: PerElement::Vertex, values }
    }
    /// One value per triangle.
    pub fn per_face(values: Vec<T>) -> Self {
        Attribute { per: PerElement::Face, values }
    }
}

impl<T: Copy> Attribute<T> {
    /// The values of some vertices and triangles.
    fn part(&self, vertices: &[u32], triangles: &[u32]) -> Self {
        let kept = match self.per {
            PerElement::Vertex => vertices,
            PerElement::Face => triangles,
        };
        let values = kept.iter().filter_map(|&i| self.values.get(i as usize).copied()).collect();
        Attribute { per: self.per, values }
    }
}

/// Indexed triangles. World position of vertex i is `origin + positions[i]` (f64 sum), so data with
/// large coordinates keeps its precision: see [`TriMesh::from_f64_positions`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TriMesh {
    /// World position of the mesh's coordinate origin.
    pub origin: DVec3,
    /// Vertex positions relative to `origin`.
    pub positions: Vec<Vec3>,
    /// Three vertex indices per triangle, counter-clockwise seen from outside.
    pub indices: Vec<[u32; 3]>,
    /// Shading normals; need not have unit length. Without them the geometric normal is used.
    pub normals: Option<Attribute<Vec3>>,
    /// Linear RGBA in 0..=1; replaces the material's base colour, alpha multiplies its opacity.
    pub colors: Option<Attribute<[f32; 4]>>,
    /// Scalars that the material's [`crate::colormap::ColorMap`] turns into colour after
    /// interpolation (thesis section 3.2.5).
    pub scalars: Option<Attribute<f32>>,
    /// Texture coordinates, one per vertex.
    pub texcoords: Option<Vec<Vec2>>,
    /// Tangents, one per vertex, for normal maps: the direction in which the first texture
    /// coordinate grows, and 1 or -1 for a bitangent that makes a right-handed or left-handed
    /// frame. Without them, tangents are computed from the texture coordinates.
    pub tangents: Option<Vec<Vec4>>,
}

/// Why a mesh cannot be used at all. Tolerable faults are counted in [`MeshReport`] instead.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// An attribute has the wrong number of values.
    #[error("mesh attribute `{field}` has {found} values; give one per {per}, {expected} in all")]
    AttributeLength {
        /// The attribute.
        field: &'static str,
        /// "vertex" or "triangle".
        per: &'static str,
        /// Number of values needed.
        expected: usize,
        /// Number of values found.
        found: usize,
    },
    /// More triangles or vertices than 32-bit ids can address.
    #[error("mesh has {found} {what}; at most {limit} fit in one mesh: split it into several")]
    TooLarge {
        /// "triangles" or "vertices".
        what: &'static str,
        /// Number found.
        found: usize,
        /// The largest number allowed.
        limit: usize,
    },
    /// The vertices of [`MeshSlices`] would overlap.
    #[error("vertices {stride} numbers apart; each has three: give a stride of 3 or more")]
    Stride {
        /// Numbers from one vertex to the next.
        stride: usize,
    },
    /// The positions of [`MeshSlices`] end inside a vertex, or before the first.
    #[error(
        "{found} numbers of positions do not end with a vertex, of which the first lies at {offset} \
         and the next {stride} further: give the whole array, or the offset and stride that it has"
    )]
    PositionsLength {
        /// Length of the array.
        found: usize,
        /// Numbers from one vertex to the next.
        stride: usize,
        /// Numbers before the first vertex.
        offset: usize,
    },
    /// The number of indices of [`MeshSlices`] is no multiple of three.
    #[error("{found} vertex indices; give three for each triangle")]
    IndicesLength {
        /// Number of indices.
        found: usize,
    },
}

/// Faults found by [`TriMesh::validate`]. The build leaves unusable triangles out; the rest is
/// rendered.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct MeshReport {
    /// Triangles in the mesh.
    pub triangles: usize,
    /// Triangles with a vertex index past the end.
    pub index_out_of_range: usize,
    /// Triangles with a NaN or infinite vertex.
    pub non_finite: usize,
    /// Triangles with zero area (kept: they are never hit except exactly edge-on, and cost little).
    pub zero_area: usize,
}

impl MeshReport {
    /// Triangles that cannot be rendered.
    pub fn skipped(&self) -> usize {
        self.index_out_of_range + self.non_finite
    }
}

/// Whether 32-bit ids can address everything.
fn check_counts(vertices: usize, triangles: usize) -> Result<(), MeshError> {
    const LIMIT: usize = (u32::MAX - 1) as usize;
    for (what, found) in [("vertices", vertices), ("triangles", triangles)] {
        if found > LIMIT {
            return Err(MeshError::TooLarge { what, found, limit: LIMIT });
        }
    }
    Ok(())
}

impl TriMesh {
    /// A mesh without attributes.
    pub fn new(positions: Vec<Vec3>, indices: Vec<[u32; 3]>) -> Self {
        TriMesh { positions, indices, ..Default::default() }
    }

    /// A mesh from f64 positions. `origin` becomes the centre of their bounds, rounded to exact f32
    /// steps, and positions are stored relative to it. This keeps sub-millimetre detail in
    /// planet-sized coordinates.
    pub fn from_f64_positions(positions: &[DVec3], indices: Vec<[u32; 3]>) -> Self {
        let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in positions.iter().filter(|p| p.is_finite()) {
            lo = lo.min(*p);
            hi = hi.max(*p);
        }
        let center = 0.5 * lo + 0.5 * hi;
        // Coordinates that straddle zero lose nothing in f32: keep the origin at 0 so that they do
        // not change.
        let far = center.abs().max_element() > (hi - lo).max_element();
        let origin =
            if center.is_finite() && far { center.as_vec3().as_dvec3() } else { DVec3::ZERO };
        let positions = positions.iter().map(|p| (*p - origin).as_vec3()).collect();
        TriMesh { origin, positions, indices, ..Default::default() }
    }

    /// The triangles, as builders read them.
    pub(crate) fn triangles(&self) -> Triangles<'_> {
        MeshSlices::of_mesh(self).triangles()
    }

    /// Number of triangles.
    pub fn num_triangles(&self) -> usize {
        self.indices.len()
    }

    /// Bounds of the finite positions, relative to `origin`.
    pub fn bounds(&self) -> Aabb {
        Aabb::from_points(self.positions.iter().filter(|p| p.is_finite()))
    }

    /// The corners of triangle `i`, relative to `origin`. Panics when `i` or one of its indices is
    /// out of range.
    #[inline]
    pub fn triangle(&self, i: usize) -> [Vec3; 3] {
        self.indices[i].map(|k| self.positions[k as usize])
    }

    /// The triangles `kept` with their vertices and attributes, relative to the same origin; and
    /// for each vertex its index in this mesh, in ascending order. Triangles with vertex indices
    /// out of range stay unusable. Panics when this mesh has no such triangle.
    pub fn part(&self, kept: &[u32]) -> (TriMesh, Vec<u32>) {
        let mut vertices: Vec<u32> = kept.iter().flat_map(|&t| self.indices[t as usize]).collect();
        vertices.sort_unstable();
        vertices.dedup();
        vertices.retain(|&v| (v as usize) < self.positions.len());
        let new_index = |v: u32| vertices.binary_search(&v).map_or(u32::MAX, |i| i as u32);
        let of_vertices = |i: &u32| *i as usize;
        let part = TriMesh {
            origin: self.origin,
            positions: vertices.iter().map(|i| self.positions[of_vertices(i)]).collect(),
            indices: kept.iter().map(|&t| self.indices[t as usize].map(new_index)).collect(),
            normals: self.normals.as_ref().map(|n| n.part(&vertices, kept)),
            colors: self.colors.as_ref().map(|c| c.part(&vertices, kept)),
            scalars: self.scalars.as_ref().map(|s| s.part(&vertices, kept)),
            texcoords: self
                .texcoords
                .as_ref()
                .map(|t| vertices.iter().map(|i| t[of_vertices(i)]).collect()),
            tangents: self
                .tangents
                .as_ref()
                .map(|t| vertices.iter().map(|i| t[of_vertices(i)]).collect()),
        };
        (part, vertices)
    }

    /// Checks the lengths of the attributes and the number of triangles.
    pub fn check(&self) -> Result<(), MeshError> {
        fn len<T>(
            field: &'static str,
            a: &Option<Attribute<T>>,
            vertices: usize,
            faces: usize,
        ) -> Result<(), MeshError> {
            let Some(a) = a else { return Ok(()) };
            let (per, expected) = match a.per {
                PerElement::Vertex => ("vertex", vertices),
                PerElement::Face => ("triangle", faces),
            };
            let found = a.values.len();
            if found == expected {
                Ok(())
            } else {
                Err(MeshError::AttributeLength { field, per, expected, found })
            }
        }
        let (v, f) = (self.positions.len(), self.indices.len());
        check_counts(v, f)?;
        len("normals", &self.normals, v, f)?;
        len("colors", &self.colors, v, f)?;
        len("scalars", &self.scalars, v, f)?;
        let vectors = [
            ("texcoords", self.texcoords.as_ref().map(Vec::len)),
            ("tangents", self.tangents.as_ref().map(Vec::len)),
        ];
        for (field, found) in vectors {
            if let Some(found) = found.filter(|n| *n != v) {
                return Err(MeshError::AttributeLength {
                    field,
                    per: "vertex",
                    expected: v,
                    found,
                });
            }
        }
        Ok(())
    }

    /// True when triangle `i` can be built: indices in range, all coordinates finite.
    #[inline]
    pub fn is_renderable(&self, i: usize) -> bool {
        self.indices[i]
            .iter()
            .all(|&k| self.positions.get(k as usize).is_some_and(|p| p.is_finite()))
    }

    /// Counts the triangles that will be left out or can never be hit.
    pub fn validate(&self) -> MeshReport {
        let mut r = MeshReport { triangles: self.indices.len(), ..Default::default() };
        for (i, t) in self.indices.iter().enumerate() {
            if t.iter().any(|&k| k as usize >= self.positions.len()) {
                r.index_out_of_range += 1;
            } else if !self.is_renderable(i) {
                r.non_finite += 1;
            } else {
                let [a, b, c] = self.triangle(i).map(|p| p.as_dvec3());
                r.zero_area += ((b - a).cross(c - a) == DVec3::ZERO) as usize;
            }
        }
        r
    }
}
