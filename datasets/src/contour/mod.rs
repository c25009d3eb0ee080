//! Isosurfaces and plane sections of cells of any shape: tetrahedra, hexahedra, polyhedra, and the
//! cells of lattices.
//!
//! A cell is divided into tetrahedra around its centre, and each face with more than three corners
//! into triangles around its own (so a hexahedron has 24). In a tetrahedron the field is linear,
//! and its surface a triangle or two. Neighbours divide the face between them in the same way
//! whatever their shapes are, and a vertex on an edge is computed from the edge's ends in the order
//! of their values. So the surface has no gaps, also not between pieces that share the points
//! between them.
//!
//! [`crate::isosurface`] does the same of uniform grids, with a quarter of the triangles.
//!
//! | file | what |
//! |---|---|
//! | `solids.rs` | the cells that have a volume, with their faces |
//! | `point_values.rs` | the field at points; values of cells become means |
//! | `tetrahedron.rs` | the surface in one tetrahedron |

mod point_values;
mod solids;
mod tetrahedron;

use crate::model::{ColorBy, Dataset, ModelError};
use glam::{DVec3, Vec3};
use point_values::PointValues;
use rt_core::mesh::{Attribute, MeshError, TriMesh};
use solids::{Cell, Copies, each_solid, number_of_points, point_of};
use tetrahedron::{Node, surface_in};

/// Where a surface lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ContourOf<'a> {
    /// Where an array has one of these values. It is named as [`ColorBy`] says. Values of cells
    /// become those of points, each the mean of the cells around it.
    Values {
        /// The array.
        array: &'a str,
        /// The values.
        isovalues: &'a [f64],
    },
    /// A plane through `point`.
    Plane {
        /// A point of the plane.
        point: DVec3,
        /// Its normal, of any length but 0.
        normal: DVec3,
    },
}

/// What a contour leaves out.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ContourReport {
    /// Cells with a volume.
    pub solids: usize,
    /// Cells without one: points, lines and polygons, which have no surface.
    pub flat_cells: usize,
    /// Cells left out because they are hidden or copies of another process's cells.
    pub ghost_cells: usize,
    /// Cells left out because a point id is out of range, or they have too few points.
    pub bad_cells: usize,
    /// Cells left out because their type is unknown.
    pub unknown_type: usize,
    /// Cells left out because a value or a position is no finite number.
    pub not_finite: usize,
    /// Data sets of a collection that lack the array of the contour.
    pub blocks_without_array: usize,
    /// Whether values of cells have become means at points.
    pub averaged: bool,
}

impl ContourReport {
    /// One line per problem that a user should know about; empty when there are none.
    pub fn warnings(&self) -> Vec<String> {
        let items = [
            (self.bad_cells, "cells left out: points that do not exist, or too few of them"),
            (self.unknown_type, "cells left out: unknown cell type"),
            (self.not_finite, "cells left out: a value or a position is no finite number"),
            (self.blocks_without_array, "blocks lack the array of the contour"),
        ];
        let mut all: Vec<String> =
            items.iter().filter(|(n, _)| *n > 0).map(|(n, text)| format!("{n} {text}")).collect();
        if self.solids == 0 && self.flat_cells > 0 {
            all.push(format!("{} cells have no volume, so no contour", self.flat_cells));
        }
        all
    }
}

/// A contour.
#[derive(Debug, Clone, Default)]
pub struct Contour {
    /// Its triangles, counter-clockwise seen from the lower values (of a plane: from behind it).
    /// They do not share vertices, and have no normals.
    pub mesh: TriMesh,
    /// What is not in it.
    pub report: ContourReport,
}

/// The surface `of` the cells of `data`, with positions relative to `origin`; without it, to one
/// that is chosen for them (see [`Dataset::to_trimesh_at`]). [`TriMesh::scalars`] has the array
/// `color_by`: of each vertex, or of each triangle for an array of cells. Without it, vertices have
/// the isovalue.
///
/// # Errors
/// Arrays that do not exist, inconsistent data, a normal of no length, and surfaces of more than
/// 2^32 vertices.
pub fn contour(
    data: &Dataset,
    of: &ContourOf<'_>,
    color_by: Option<&str>,
    origin: Option<DVec3>,
) -> Result<Contour, ModelError> {
    data.check()?;
    let array = match of {
        ContourOf::Values { array, .. } => Some(ColorBy::find(data, array)?),
        ContourOf::Plane { normal, .. } if normal.try_normalize().is_none() => {
            return Err(ModelError::NotConvertible {
                kind: data.kind(),
                target: "a plane section",
                reason: format!("the normal {normal} has no direction"),
            });
        }
        ContourOf::Plane { .. } => None,
    };
    let color = color_by.map(|name| ColorBy::find(data, name)).transpose()?;
    let plane = [0.0];
    let isovalues = match of {
        ContourOf::Values { isovalues, .. } => isovalues,
        ContourOf::Plane { .. } => &plane[..],
    };
    let mut out = Builder::default();
    out.report.averaged = array.as_ref().is_some_and(|a| !a.per_point);
    for leaf in data.leaves().into_iter().filter(|leaf| number_of_points(leaf) > 0) {
        let field = match (of, &array) {
            (ContourOf::Plane { point, normal }, _) => {
                Some(PointValues::Distances { point: *point, normal: normal.normalize() })
            }
            (_, Some(by)) => PointValues::of(leaf, by),
            (_, None) => None,
        };
        match field {
            Some(field) => out.add(leaf, &field, isovalues, color.as_ref()),
            None => out.report.blocks_without_array += 1,
        }
    }
    out.finish(origin, color.is_some_and(|c| !c.per_point))
}

#[derive(Default)]
struct Builder {
    positions: Vec<DVec3>,
    /// Of vertices, or of triangles for an array of cells.
    scalars: Vec<f32>,
    report: ContourReport,
}

impl Builder {
    fn add(
        &mut self,
        leaf: &Dataset,
        field: &PointValues,
        isovalues: &[f64],
        color: Option<&ColorBy>,
    ) {
        let colors = color.and_then(|by| {
            Some((by, leaf.attributes().and_then(|attributes| by.array(attributes))?))
        });
        let per_point = color.is_none_or(|by| by.per_point);
        // An array that this block lacks has no colours there.
        let color_at = |id: usize| colors.map_or(f32::NAN, |(by, array)| by.value(array, id));
        let node_at = |id: u32| {
            let position = point_of(leaf, id as usize);
            let value = field.at(id as usize, position);
            let color = if color.is_some() && per_point { color_at(id as usize) } else { f32::NAN };
            Node { position, value, color }
        };
        let Builder { positions, scalars, report } = self;
        let mut corners = Vec::new();
        each_solid(leaf, Copies::LeftOut, report, |number, cell| {
            corners.clear();
            corners.extend(cell.corners.iter().map(|&id| node_at(id)));
            let finite = |n: &Node| n.value.is_finite() && n.position.is_finite();
            if !corners.iter().all(finite) {
                return false;
            }
            let of =
                |f: fn(f64, f64) -> f64, start| corners.iter().fold(start, |a, n| f(a, n.value));
            let (low, high) = (of(f64::min, f64::INFINITY), of(f64::max, f64::NEG_INFINITY));
            for &iso in isovalues.iter().filter(|&&iso| low < iso && iso <= high) {
                surface_in_cell(&cell, &corners, iso, |triangle| {
                    positions.extend(triangle.map(|node| node.position));
                    match (color.is_some(), per_point) {
                        (true, true) => scalars.extend(triangle.map(|node| node.color)),
                        (true, false) => scalars.push(color_at(number)),
                        (false, _) => scalars.extend([iso as f32; 3]),
                    }
                });
            }
            true
        });
    }

    fn finish(self, origin: Option<DVec3>, per_face: bool) -> Result<Contour, ModelError> {
        let found = self.positions.len();
        let limit = u32::MAX as usize;
        if found > limit {
            return Err(MeshError::TooLarge { what: "vertices", found, limit }.into());
        }
        let indices = (0..found as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let mut mesh = match origin {
            None => TriMesh::from_f64_positions(&self.positions, indices),
            Some(origin) => {
                let positions: Vec<Vec3> =
                    self.positions.iter().map(|p| (*p - origin).as_vec3()).collect();
                TriMesh { origin, ..TriMesh::new(positions, indices) }
            }
        };
        mesh.scalars = Some(match per_face {
            true => Attribute::per_face(self.scalars),
            false => Attribute::per_vertex(self.scalars),
        });
        mesh.check()?;
        Ok(Contour { mesh, report: self.report })
    }
}

/// Calls `emit` with the triangles in a cell.
fn surface_in_cell(cell: &Cell<'_>, corners: &[Node], iso: f64, mut emit: impl FnMut([Node; 3])) {
    if let [a, b, c, d] = *corners {
        return surface_in(&[a, b, c, d], iso, &mut emit);
    }
    let centre = Node::mean(corners.iter().copied());
    let (mut face, mut on_face) = (Vec::new(), Vec::new());
    for k in 0..cell.num_faces() {
        cell.face(k, &mut face);
        on_face.clear();
        on_face.extend(face.iter().map(|&corner| corners[corner]));
        match on_face[..] {
            [] | [_] | [_, _] => {}
            [a, b, c] => surface_in(&[centre, a, b, c], iso, &mut emit),
            _ => {
                let middle = Node::mean_of_face(&on_face);
                for (k, &a) in on_face.iter().enumerate() {
                    let b = on_face[(k + 1) % on_face.len()];
                    surface_in(&[centre, middle, a, b], iso, &mut emit);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
