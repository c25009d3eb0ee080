//! Triangle meshes in arrays that the caller keeps.

use super::{MeshError, TriMesh};
use crate::math::Aabb;
use glam::{DVec3, Vec3};

/// A triangle mesh in the caller's arrays, for [`crate::bvh::World::from_slices`]. Vertex `i` has
/// its x, y and z in `positions`, from `offset + i * stride` on. All positions are relative to
/// `origin`.
///
/// ```
/// use rt_core::glam::Vec3;
/// use rt_core::mesh::MeshSlices;
///
/// // Normal and position in turns, as programs give them to OpenGL.
/// let vertices = [0., 0., 1., 4., 4., 0., 0., 0., 1., 5., 4., 0., 0., 0., 1., 4., 5., 0.];
/// let mesh = MeshSlices { offset: 3, stride: 6, ..MeshSlices::new(&vertices, &[0, 1, 2]) };
/// assert_eq!((mesh.num_vertices(), mesh.num_triangles()), (3, 1));
/// assert_eq!(mesh.position(1), Some(Vec3::new(5.0, 4.0, 0.0)));
/// assert!(mesh.check().is_ok());
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshSlices<'a> {
    /// World position of the mesh's coordinate origin.
    pub origin: DVec3,
    /// Coordinates, and whatever lies between them.
    pub positions: &'a [f32],
    /// Numbers from one vertex to the next, at least 3.
    pub stride: usize,
    /// Numbers before the first vertex.
    pub offset: usize,
    /// Three vertex indices per triangle.
    pub indices: &'a [u32],
}

impl<'a> MeshSlices<'a> {
    /// Vertices without gaps: x, y, z of the first, then of the second.
    pub fn new(positions: &'a [f32], indices: &'a [u32]) -> Self {
        MeshSlices { origin: DVec3::ZERO, positions, stride: 3, offset: 0, indices }
    }

    /// The arrays of `mesh`.
    pub fn of_mesh(mesh: &'a TriMesh) -> Self {
        let (positions, indices) =
            (bytemuck::cast_slice(&mesh.positions), mesh.indices.as_flattened());
        MeshSlices { origin: mesh.origin, ..MeshSlices::new(positions, indices) }
    }

    /// Number of vertices that fit into the array.
    pub fn num_vertices(&self) -> usize {
        let rest = self.positions.len().saturating_sub(self.offset);
        if rest < 3 { 0 } else { (rest - 3) / self.stride.max(1) + 1 }
    }

    /// Number of triangles.
    pub fn num_triangles(&self) -> usize {
        self.indices.len() / 3
    }

    /// Position of vertex `i` relative to the origin; `None` when the array has no such vertex.
    #[inline]
    pub fn position(&self, i: usize) -> Option<Vec3> {
        // No product overflows: it is less than the length of the array.
        let at = (i < self.num_vertices()).then(|| self.offset + i * self.stride)?;
        self.positions.get(at..at + 3).map(Vec3::from_slice)
    }

    /// Whether the stride, the offset and the lengths agree, and the numbers of vertices and
    /// triangles are those of a mesh.
    pub fn check(&self) -> Result<(), MeshError> {
        let MeshSlices { positions, stride, offset, indices, .. } = *self;
        if stride < 3 {
            return Err(MeshError::Stride { stride });
        }
        let found = positions.len();
        let partial = found.checked_sub(offset).map(|rest| rest % stride);
        if !partial.is_some_and(|n| n == 0 || n >= 3) {
            return Err(MeshError::PositionsLength { found, stride, offset });
        }
        if indices.len() % 3 != 0 {
            return Err(MeshError::IndicesLength { found: indices.len() });
        }
        super::check_counts(self.num_vertices(), self.num_triangles())
    }

    /// The triangles, as builders read them.
    pub(crate) fn triangles(&self) -> Triangles<'a> {
        Triangles {
            origin: self.origin,
            positions: self.positions.get(self.offset..).unwrap_or_default(),
            stride: self.stride,
            vertices: self.num_vertices(),
            indices: self.indices.as_chunks().0,
        }
    }
}

/// The triangles of a mesh as builders read them, wherever its arrays lie.
#[derive(Clone, Copy)]
pub(crate) struct Triangles<'a> {
    pub(crate) origin: DVec3,
    /// From the first vertex on.
    positions: &'a [f32],
    stride: usize,
    pub(crate) vertices: usize,
    pub(crate) indices: &'a [[u32; 3]],
}

impl Triangles<'_> {
    /// A vertex relative to the origin; NaN when there is none with this number.
    #[inline(always)]
    fn position(&self, i: u32) -> Vec3 {
        let i = i as usize;
        if i >= self.vertices {
            return Vec3::NAN;
        }
        Vec3::from_slice(&self.positions[i * self.stride..][..3])
    }

    /// The corners of triangle `i` relative to the origin; NaN for those that do not exist.
    #[inline(always)]
    pub(crate) fn corners(&self, i: u32) -> [Vec3; 3] {
        self.indices[i as usize].map(|k| self.position(k))
    }

    /// Whether triangle `i` can be built: indices in range, all coordinates finite.
    #[inline]
    pub(crate) fn is_renderable(&self, i: usize) -> bool {
        self.corners(i as u32).iter().all(|p| p.is_finite())
    }

    /// Bounds of the finite vertices, relative to the origin.
    pub(crate) fn bounds(&self) -> Aabb {
        let all = (0..self.vertices).map(|i| self.position(i as u32)).filter(|p| p.is_finite());
        all.fold(Aabb::EMPTY, |b, p| Aabb::new(b.min.min(p), b.max.max(p)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strides_and_lengths_that_do_not_agree_are_refused_with_their_numbers() {
        let (floats, ids) = ([0.5; 24], [0, 1, 2]);
        let mesh = MeshSlices::new(&floats, &ids);
        let with = |stride, offset, length: usize| MeshSlices {
            stride,
            offset,
            positions: &floats[..length],
            ..mesh
        };
        for (sound, vertices) in [
            (with(3, 0, 24), 8),
            (with(8, 0, 24), 3),
            (with(8, 5, 24), 3),
            // The attributes after the last vertex may be missing.
            (with(8, 0, 19), 3),
            (with(8, 2, 21), 3),
            (with(3, 0, 0), 0),
            (with(4, 24, 24), 0),
            (with(usize::MAX, 0, 24), 1),
        ] {
            assert_eq!(sound.check(), Ok(()), "{sound:?}");
            assert_eq!(sound.num_vertices(), vertices, "{sound:?}");
            assert_eq!(sound.position(vertices), None, "{sound:?}");
        }
        for (stride, offset, found) in [(3, 0, 23), (3, 25, 24), (8, 0, 18), (8, 5, 23)] {
            let error = MeshError::PositionsLength { found, stride, offset };
            assert_eq!(with(stride, offset, found).check(), Err(error.clone()));
            for number in [stride, offset, found] {
                assert!(error.to_string().contains(&number.to_string()), "{error}");
            }
        }
        assert_eq!(with(2, 0, 24).check(), Err(MeshError::Stride { stride: 2 }));
        let indices = MeshSlices { indices: &ids[..2], ..mesh };
        assert_eq!(indices.check(), Err(MeshError::IndicesLength { found: 2 }));
    }
}
