//! Storage of triangles in leaves: four to a leaf, with their vertices.

use super::local_frame::LocalFrame;
use super::wide::{ChildRef, LEAF_SIZE, LeafWriter, Unit};
use crate::math::Aabb;
use crate::mesh::Triangles;
use glam::Vec3;

/// Units of a leaf: nine rows of four floats (x, y, z of the first, second and third vertices) and
/// a row of four triangle numbers.
pub(crate) const TRI_LEAF_UNITS: usize = 5;

/// Row `row` (0..=8) of a leaf: one coordinate of one vertex of the four triangles.
#[inline(always)]
pub(crate) fn row(leaf: &[f32; 8 * TRI_LEAF_UNITS], row: usize) -> &[f32] {
    &leaf[4 * row..4 * row + 4]
}

/// The leaf's floats.
#[inline(always)]
pub(crate) fn leaf_floats(units: &[Unit], leaf: ChildRef) -> &[f32; 8 * TRI_LEAF_UNITS] {
    let at = leaf.unit();
    let leaf: &[Unit; TRI_LEAF_UNITS] =
        units[at..at + TRI_LEAF_UNITS].try_into().expect("a slice of that length");
    bytemuck::cast_ref(leaf)
}

/// The four triangle numbers of a leaf. Unused slots repeat the last number.
#[inline(always)]
pub(crate) fn leaf_triangle_ids(leaf: &[f32; 8 * TRI_LEAF_UNITS]) -> [u32; 4] {
    std::array::from_fn(|i| leaf[36 + i].to_bits())
}

/// Writes a mesh's triangles into leaves.
pub(crate) struct TriWriter<'m> {
    mesh: Triangles<'m>,
    frame: &'m LocalFrame,
    /// Positions are stored unchanged.
    plain: bool,
    /// Number of the first triangle in leaves.
    first: u32,
}

impl<'m> TriWriter<'m> {
    /// Triangle `i` of the mesh has the number `first + i` in leaves.
    pub(crate) fn new(mesh: Triangles<'m>, frame: &'m LocalFrame, first: u32) -> Self {
        let plain = frame.center == mesh.origin && frame.scale == 1.0;
        TriWriter { mesh, frame, plain, first }
    }
}

impl TriWriter<'_> {
    /// The corners of triangle `i` of the mesh, as leaves hold them.
    #[inline(always)]
    pub(crate) fn corners(&self, i: u32) -> [Vec3; 3] {
        let corners = self.mesh.corners(i);
        if self.plain { corners } else { corners.map(|p| self.frame.local(self.mesh.origin, p)) }
    }
}

impl TriWriter<'_> {
    /// The numbers of a leaf's triangles in the mesh.
    pub(crate) fn in_mesh(&self, ids: [u32; 4]) -> [u32; 4] {
        ids.map(|id| id - self.first)
    }

    /// The box of triangle `i` of the mesh, [`widened`]; empty when it cannot be built.
    #[inline(always)]
    pub(crate) fn bounds(&self, i: u32) -> Aabb {
        if !self.mesh.is_renderable(i as usize) {
            return Aabb::EMPTY;
        }
        let [a, b, c] = self.corners(i);
        widened(Aabb::new(a.min(b).min(c), a.max(b).max(c)))
    }
}

impl LeafWriter for TriWriter<'_> {
    const UNITS: usize = TRI_LEAF_UNITS;

    fn write(&self, prims: &[u32], out: &mut [Unit]) {
        let floats: &mut [f32] = bytemuck::cast_slice_mut(out);
        let floats: &mut [f32; 8 * TRI_LEAF_UNITS] = floats.try_into().expect("a leaf's units");
        // Unused slots repeat the last triangle. As points, they would pass the edge test of every
        // ray, with three zeros, and be decided by the slow exact products. Triangles that a refit
        // made invalid are stored as points: they have no area and are never hit.
        let last = prims.len() - 1;
        for slot in 0..LEAF_SIZE {
            let id = prims[slot.min(last)];
            let mut corners = self.corners(id);
            if !corners.iter().all(|p| p.is_finite()) {
                corners = [Vec3::ZERO; 3];
            }
            for (vertex, corner) in corners.iter().enumerate() {
                for axis in 0..3 {
                    floats[4 * (3 * vertex + axis) + slot] = corner[axis];
                }
            }
            floats[36 + slot] = f32::from_bits(self.first + id);
        }
    }
}

/// A primitive's box, wider by 2⁻²⁰ of its largest extent.
///
/// The triangle test rounds the corners after the shear. An edge moves by up to 5·2⁻²⁴ of the
/// triangle's extent (7 with the box's own rounding). For a ray that starts close to a large
/// triangle this is far more than the slack of the slab test. The triangle test is consistent: the
/// neighbour across the edge rejects a ray that belongs to this triangle. So a box whose side lies
/// exactly on the edge must not reject the ray. (Measured on a cube, rays from 10⁻⁶ to 1 of its
/// size off an edge, aimed 10⁻⁹ to 10⁻⁶ beside it: 68 of 454,656 were lost with tight boxes.)
///
/// The box is always wider than the corners, so a ray in the plane of a box's side hits the box
/// whatever the sign of a zero in its direction.
#[inline]
pub(crate) fn widened(b: Aabb) -> Aabb {
    let margin = b.extent().max_element() * (8.0 * f32::EPSILON);
    let lo = (b.min - margin).to_array().map(f32::next_down);
    let hi = (b.max + margin).to_array().map(f32::next_up);
    Aabb::new(Vec3::from_array(lo), Vec3::from_array(hi))
}
