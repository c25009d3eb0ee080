//! Lattices within a mesh: the two layers of points that a plane becomes, and hidden cells.

use super::flat::ALONG;
use super::{HIDDEN_CELL, HIDDEN_POINT, Mesh, Part, PartDepth, PartKind};
use crate::model::Attributes;
use glam::DVec3;

impl Mesh {
    /// On which side of a plane that got depth a point lies; `None` for points of solid data.
    pub(in crate::resample) fn side_of_plane(&self, point: usize) -> Option<bool> {
        let part = &self.parts[self.parts.partition_point(|p| p.points.end <= point)];
        let local = point - part.points.start;
        Some(match (part.depth.as_ref()?, &part.kind) {
            (PartDepth::Layer(axis), PartKind::Lattice(dims)) => {
                flat_source(local, *dims, *axis).1 == 1
            }
            (PartDepth::Sides(above), _) => above[local],
            _ => 2 * local >= part.points.len(),
        })
    }

    /// How often a part of the mesh has each point of the data: twice if that was a plane. `point`
    /// is one of the part.
    pub(in crate::resample) fn copies(&self, point: usize) -> usize {
        let part = &self.parts[self.parts.partition_point(|p| p.points.end <= point)];
        match part.depth {
            Some(PartDepth::Layer(_) | PartDepth::Copies) => 2,
            _ => 1,
        }
    }

    /// The axis along which a plane got its depth; `None` for solid data, and for planes across
    /// several axes.
    pub fn axis_of_depth(&self) -> Option<usize> {
        let mut found = None;
        for part in &self.parts {
            part.depth.as_ref()?;
            let of_part = (0..3).find(|&a| part.normal[a].abs() > 1.0 - ALONG)?;
            if found.is_some_and(|f| f != of_part) {
                return None;
            }
            found = Some(of_part);
        }
        found
    }

    /// Calls `f` with the number of each leaf of the data and, for each point of the mesh from it,
    /// the number of the point and that of its source in the leaf.
    pub(in crate::resample) fn each_source(&self, mut f: impl FnMut(usize, usize, usize)) {
        for part in &self.parts {
            for (i, point) in part.points.clone().enumerate() {
                f(part.leaf, point, part.source_of(i));
            }
        }
    }

    /// Calls `f` with the number of each leaf of the data, and the points of the mesh from it.
    pub(in crate::resample) fn each_leaf(&self, mut f: impl FnMut(usize, std::ops::Range<usize>)) {
        self.parts.iter().for_each(|p| f(p.leaf, p.points.clone()));
    }
}

impl Part {
    /// The point of the data that point `i` of the part comes from.
    pub(super) fn source_of(&self, i: usize) -> usize {
        match (&self.kind, &self.depth) {
            (PartKind::Lattice(n), Some(PartDepth::Layer(axis))) => flat_source(i, *n, *axis).0,
            (_, Some(PartDepth::Copies)) => i % (self.points.len() / 2),
            _ => i,
        }
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
