//! Gives depth to polygons in a plane: slices of unstructured meshes, and two-dimensional cases.

use crate::model::{CellType, Cells, Dataset, Points, PolyData, UnstructuredGrid, extent_dims};
use crate::plane_of_points::FLATNESS;
use glam::DVec3;

const HEXAHEDRON: u8 = 12;
const WEDGE: u8 = 13;
const POLYHEDRON: u8 = 42;

/// Prisms over polygons.
pub(super) struct Extruded {
    /// The prisms. Points come twice: below the plane, then above it.
    pub(super) grid: UnstructuredGrid,
    /// The polygon of each prism.
    pub(super) source: Vec<u32>,
    /// Cells that are no polygons or refer to points that do not exist.
    pub(super) left_out: usize,
    /// The direction across the plane, of length 1.
    pub(super) normal: DVec3,
}

/// The polygons of a surface as cells of a grid, with their numbers among the surface's cells.
pub(super) fn polygons_of(surface: &PolyData) -> (UnstructuredGrid, usize) {
    let types = vec![7; surface.polys.len()];
    let attributes = surface.attributes.clone();
    let (points, cells) = (surface.points.clone(), surface.polys.clone());
    let grid = UnstructuredGrid { points, cells, types, attributes, ..Default::default() };
    (grid, surface.verts.len() + surface.lines.len())
}

/// The corners of a polygon in order; `None` for other cells.
fn corners(d: &UnstructuredGrid, cell: usize) -> Option<Vec<u32>> {
    let ids = d.cells.get(cell);
    if ids.iter().any(|&k| k as usize >= d.points.len()) {
        return None;
    }
    let count = match CellType::of(d.types[cell]) {
        CellType::Pixel => return ids.get(..4).map(|q| vec![q[0], q[1], q[3], q[2]]),
        CellType::Polygon(0) => ids.len(),
        CellType::Polygon(usize::MAX) => ids.len() / 2,
        CellType::Polygon(n) => n,
        _ => return None,
    };
    ids.get(..count).filter(|ids| ids.len() >= 3).map(<[u32]>::to_vec)
}

/// Whether the cells are polygons, with or without lines and vertices, and no solids.
pub(super) fn has_only_polygons(d: &UnstructuredGrid) -> bool {
    let kinds = || d.types.iter().map(|t| CellType::of(*t));
    let solid = |k: CellType| matches!(k, CellType::Solid(_) | CellType::Polyhedron);
    let polygon = |k: CellType| matches!(k, CellType::Polygon(_) | CellType::Pixel);
    kinds().any(polygon) && !kinds().any(solid)
}

/// Whether no cell fills space.
pub(super) fn has_no_solids(d: &UnstructuredGrid) -> bool {
    let solid = |t: &u8| matches!(CellType::of(*t), CellType::Solid(_) | CellType::Polyhedron);
    !d.types.iter().any(solid)
}

/// Whether a leaf has cells that fill space.
pub(super) fn has_solids(leaf: &Dataset) -> bool {
    let is_thick = |dims: [usize; 3]| dims.iter().all(|&d| d >= 2);
    match leaf {
        Dataset::ImageData(d) => is_thick(d.dims()),
        Dataset::RectilinearGrid(d) => is_thick(extent_dims(d.extent)),
        Dataset::StructuredGrid(d) => is_thick(extent_dims(d.extent)),
        Dataset::UnstructuredGrid(d) => !has_no_solids(d),
        Dataset::PolyData(_) | Dataset::MultiBlock(_) => false,
    }
}

/// The normal of the plane of all polygons; `None` if they do not lie in one.
fn plane_normal(d: &UnstructuredGrid, polygons: &[(u32, Vec<u32>)]) -> Option<DVec3> {
    let at = |id: u32| d.points.get(id as usize);
    let mut sum = DVec3::ZERO;
    let nothing = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (mut low, mut high) = nothing;
    for (_, ids) in polygons {
        let first = at(ids[0]);
        let pairs = ids.windows(2).map(|w| (at(w[0]) - first).cross(at(w[1]) - first));
        let area: DVec3 = pairs.sum();
        // The polygons of a slice may run either way round.
        sum += if area.dot(sum) < 0.0 { -area } else { area };
        for &id in ids {
            (low, high) = (low.min(at(id)), high.max(at(id)));
        }
    }
    let normal = sum.try_normalize()?;
    let normal = if normal[normal.abs().max_position()] < 0.0 { -normal } else { normal };
    let tolerance = FLATNESS * (high - low).max_element();
    let height = at(polygons.first()?.1[0]).dot(normal);
    let flat = |id: &u32| (at(*id).dot(normal) - height).abs() <= tolerance;
    polygons.iter().all(|p| p.1.iter().all(flat)).then_some(normal)
}

/// Prisms of height `span`, half on either side of the plane; `None` if the polygons do not lie in
/// one.
pub(super) fn extruded(d: &UnstructuredGrid, span: f64) -> Option<Extruded> {
    let polygons: Vec<(u32, Vec<u32>)> =
        (0..d.cells.len()).filter_map(|cell| Some((cell as u32, corners(d, cell)?))).collect();
    let normal = plane_normal(d, &polygons)?;
    let n = d.points.len();
    let layer = |side: f64| (0..n).map(move |i| (d.points.get(i) + normal * side).to_array());
    let points = layer(-0.5 * span).chain(layer(0.5 * span)).collect();
    let mut grid = UnstructuredGrid { points: Points::F64(points), ..Default::default() };
    let left_out = d.cells.len() - polygons.len();
    let above = |id: u32| Cells::id(i64::from(id) + n as i64);
    let mut source = Vec::with_capacity(polygons.len());
    for (cell, mut ids) in polygons {
        source.push(cell);
        let first = d.points.get(ids[0] as usize);
        let area: DVec3 = ids
            .windows(2)
            .map(|w| {
                let [a, b] = [w[0], w[1]].map(|k| d.points.get(k as usize) - first);
                a.cross(b)
            })
            .sum();
        // Counter-clockwise as seen from above.
        if area.dot(normal) < 0.0 {
            ids.reverse();
        }
        let faces = grid.polyhedron_faces.len();
        let top = ids.iter().map(|&id| above(id));
        match ids.len() {
            // VTK's wedges have their first triangle outwards, its hexahedra their first quad
            // inwards.
            3 => {
                grid.types.push(WEDGE);
                grid.cells.push(ids.iter().rev().copied().chain(top.rev()));
            }
            4 => {
                grid.types.push(HEXAHEDRON);
                grid.cells.push(ids.iter().copied().chain(top));
            }
            k => {
                grid.types.push(POLYHEDRON);
                grid.cells.push(ids.iter().copied().chain(top.clone()));
                grid.polyhedron_faces.push(ids.iter().rev().copied());
                grid.polyhedron_faces.push(top);
                for i in 0..k {
                    let [a, b] = [ids[i], ids[(i + 1) % k]];
                    grid.polyhedron_faces.push([a, b, above(b), above(a)]);
                }
            }
        }
        grid.faces_of_cell.push(faces..grid.polyhedron_faces.len());
    }
    Some(Extruded { grid, source, left_out, normal })
}

#[cfg(test)]
mod tests {
    use crate::model::{Cells, DataArray, Dataset, Points, PolyData, UnstructuredGrid, Values};
    use crate::resample::{Lattice, Mark, Mesh, Options, Plane, Resolution, Samples, resample};

    /// A rectangle of 4 by 2 as triangles, a quad that runs backwards and a pentagon, in the plane
    /// z = 3; the points are turned so that y is the axis across if `upright`.
    fn rectangle(upright: bool) -> UnstructuredGrid {
        let points =
            [[0., 0.], [1., 0.], [2., 0.], [4., 0.], [4., 2.], [2., 2.], [0., 2.], [3., 2.]];
        let place = |[a, b]: [f64; 2]| if upright { [a, 3.0, b] } else { [a, b, 3.0] };
        let mut d = UnstructuredGrid {
            points: Points::F64(points.map(place).to_vec()),
            types: vec![5, 9, 7],
            ..Default::default()
        };
        d.cells.push([0, 1, 6]);
        d.cells.push([1, 6, 5, 2]);
        d.cells.push([2, 3, 4, 7, 5]);
        d.attributes.cell.push(DataArray::new("c", 1, Values::F64(vec![1.0, 2.0, 3.0])));
        d
    }

    #[test]
    fn polygons_of_all_sizes_fill_the_space_over_their_plane() {
        for upright in [false, true] {
            let data = Dataset::UnstructuredGrid(rectangle(upright));
            let mesh = Mesh::with_plane(&data, Plane::Extrude { span: 0.5 }).unwrap();
            assert_eq!((mesh.num_cells(), mesh.num_points(), mesh.left_out()), (3, 16, 0));
            let (low, high) = mesh.bounds();
            let expected = if upright { [4.0, 0.5, 2.0] } else { [4.0, 2.0, 0.5] };
            assert_eq!((high - low).to_array(), expected);
            let value = |i: usize| 1.0 + 2.0 * mesh.point(i).x + mesh.point(i).y + mesh.point(i).z;
            let values: Vec<f64> = (0..16).map(value).collect();
            let lattice =
                Lattice::fit(low, high, mesh.typical_cell(), Resolution::Longest(33)).unwrap();
            let fine =
                resample(&mesh, Samples::Points(&values), &lattice, &Options::default()).unwrap();
            assert!(fine.marks.iter().all(|m| *m == Mark::Inside), "upright: {upright}");
            assert_eq!(mesh.gather_cells(&data, |a, i| a.cell[0].get(i, 0)), [1.0, 2.0, 3.0]);
            let of_points = mesh.gather_points(&data, |_, i| i as f64);
            assert_eq!((of_points[3], of_points[8 + 3]), (3.0, 3.0));
        }
    }

    #[test]
    fn a_slice_saved_as_a_surface_keeps_the_values_of_its_cells() {
        let grid = rectangle(false);
        let mut lines = Cells::new();
        lines.push([0, 3]);
        let values = DataArray::new("c", 1, Values::F64(vec![0.0, 1.0, 2.0, 3.0]));
        let mut slice =
            PolyData { points: grid.points, polys: grid.cells, lines, ..Default::default() };
        slice.attributes.cell.push(values);
        let data = Dataset::PolyData(slice);
        let mesh = Mesh::with_plane(&data, Plane::Extrude { span: 1.0 }).unwrap();
        assert_eq!(mesh.gather_cells(&data, |a, i| a.cell[0].get(i, 0)), [1.0, 2.0, 3.0]);
    }

    #[test]
    fn a_curved_surface_gets_no_depth() {
        let mut grid = rectangle(false);
        let Points::F64(points) = &mut grid.points else { unreachable!() };
        points[4][2] = 3.1;
        let data = Dataset::UnstructuredGrid(grid);
        let error = Mesh::with_plane(&data, Plane::Extrude { span: 1.0 }).unwrap_err();
        assert!(error.to_string().contains("save the volume"), "{error}");
    }
}
