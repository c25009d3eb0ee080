//! Lattices within a mesh: the two layers of points that a plane becomes, and hidden cells.

use super::{HIDDEN_CELL, HIDDEN_POINT, Mesh, PartKind};
use crate::model::Attributes;
use glam::DVec3;

/// A direction is along an axis whose component is all of its length but for this part.
const PLANE: f64 = 1e-12;

impl Mesh {
    /// On which side of a plane that got depth a point lies; `None` for points of solid data.
    pub(in crate::resample) fn side_of_plane(&self, point: usize) -> Option<bool> {
        let part = &self.parts[self.parts.partition_point(|p| p.points.end <= point)];
        let (axis, local) = (part.extruded?, point - part.points.start);
        Some(match &part.kind {
            PartKind::Lattice(dims) => flat_source(local, *dims, axis).1 == 1,
            PartKind::Cells(_) => 2 * local >= part.points.len(),
        })
    }

    /// The axis along which a plane got its depth; `None` for solid data, and for a plane across no
    /// axis.
    pub fn axis_of_depth(&self) -> Option<usize> {
        let mut found = None;
        for part in &self.parts {
            let axis = part.extruded?;
            let to_copy = match &part.kind {
                PartKind::Lattice(dims) => dims[..axis].iter().product(),
                PartKind::Cells(_) => part.points.len() / 2,
            };
            let first = part.points.start;
            let along = (*self.points.get(first + to_copy)? - *self.points.get(first)?).abs();
            let of_part = (0..3).find(|&a| along[a] > (1.0 - PLANE) * along.length())?;
            if found.is_some_and(|f| f != of_part) {
                return None;
            }
            found = Some(of_part);
        }
        found
    }

    /// Calls `f` with the number of each leaf of the data, and the points of the mesh from it.
    pub(in crate::resample) fn each_leaf(&self, mut f: impl FnMut(usize, std::ops::Range<usize>)) {
        self.parts.iter().for_each(|p| f(p.leaf, p.points.clone()));
    }
}

/// For a lattice with a second layer along `axis`: the corresponding point of the flat lattice, and
/// its side.
pub(super) fn flat_source(i: usize, dims: [usize; 3], axis: usize) -> (usize, usize) {
    let mut at = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
    let mut n = dims;
    let side = std::mem::take(&mut at[axis]);
    n[axis] = 1;
    (at[0] + n[0] * (at[1] + n[1] * at[2]), side)
}

/// Unit normal of a plane lattice: the direction of the summed normals of its quads.
pub(super) fn plane_normal(points: &[DVec3], dims: [usize; 3], axis: usize) -> DVec3 {
    let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
    let stride = [1, dims[0], dims[0] * dims[1]];
    let mut sum = DVec3::ZERO;
    for j in 0..dims[b].saturating_sub(1) {
        for i in 0..dims[a].saturating_sub(1) {
            let p = i * stride[a] + j * stride[b];
            let (d, e) = (p + stride[a] + stride[b], points[p]);
            sum += (points[d] - e).cross(points[p + stride[b]] - points[p + stride[a]]);
        }
    }
    sum.normalize_or(DVec3::AXES[axis])
}

/// Flags the cells that are hidden themselves or through one of their points; empty when none is.
pub(super) fn hidden_cells_of_lattice(dims: [usize; 3], a: &Attributes) -> Vec<bool> {
    let (cells, points) = (a.cell_array("vtkGhostType"), a.point_array("vtkGhostType"));
    if cells.is_none() && points.is_none() {
        return Vec::new();
    }
    let n = dims.map(|d| if d == 1 { 1 } else { d.saturating_sub(1) });
    let mut hidden: Vec<bool> = (0..n.iter().product())
        .map(|c| cells.is_some_and(|a| a.get(c, 0) as u8 & HIDDEN_CELL != 0))
        .collect();
    if let Some(a) = points {
        for (i, h) in hidden.iter_mut().enumerate() {
            let at = [i % n[0], i / n[0] % n[1], i / n[0] / n[1]];
            for corner in 0..8usize {
                let q: [usize; 3] =
                    std::array::from_fn(|c| (at[c] + (corner >> c & 1)).min(dims[c] - 1));
                let id = q[0] + dims[0] * (q[1] + dims[1] * q[2]);
                *h |= a.get(id, 0) as u8 & HIDDEN_POINT != 0;
            }
        }
    }
    hidden
}
