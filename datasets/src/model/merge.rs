//! Merges the pieces of one data set.

use super::{
    Attributes, DataArray, Dataset, ModelError, Points, PolyData, UnstructuredGrid, Values,
    extent_dims, lattice_counts,
};

impl Dataset {
    /// Merges pieces of one kind into one data set. Lattice pieces must cover their common extent.
    /// Shared points are stored once for lattices and once per piece otherwise, as in VTK. Arrays
    /// that some pieces lack are left out and named in `warnings`.
    pub fn merge(
        mut pieces: Vec<Dataset>,
        warnings: &mut Vec<String>,
    ) -> Result<Dataset, ModelError> {
        // Ignore empty pieces, which processes without data write.
        if pieces.iter().any(|p| p.counts().0 > 0) {
            pieces.retain(|p| p.counts().0 > 0);
        }
        match pieces.len() {
            0 => return Ok(Dataset::PolyData(PolyData::default())),
            1 => return Ok(pieces.remove(0)),
            _ => {}
        }
        let kind = pieces[0].kind();
        if let Some(other) = pieces.iter().find(|p| p.kind() != kind) {
            let reason = format!("another piece is {}", other.kind());
            return Err(ModelError::NotConvertible {
                kind,
                target: "one data set with the other pieces",
                reason,
            });
        }
        match &pieces[0] {
            Dataset::PolyData(_) => Ok(merge_poly(&pieces, warnings)),
            Dataset::UnstructuredGrid(_) => Ok(merge_unstructured(&pieces, warnings)),
            Dataset::MultiBlock(_) => {
                let blocks = pieces.into_iter().flat_map(|p| match p {
                    Dataset::MultiBlock(b) => b,
                    _ => Vec::new(),
                });
                Ok(Dataset::MultiBlock(blocks.collect()))
            }
            _ => merge_lattices(pieces, warnings),
        }
    }
}

/// Merges the arrays that all pieces have with the same number of components; `join` concatenates
/// the values.
fn join_arrays(
    lists: &[&[DataArray]],
    what: &str,
    warnings: &mut Vec<String>,
    join: impl Fn(&[&DataArray]) -> Option<DataArray>,
) -> Vec<DataArray> {
    let mut out = Vec::new();
    for first in lists[0] {
        let same: Vec<&DataArray> = lists
            .iter()
            .filter_map(|l| {
                l.iter().find(|a| a.name == first.name && a.components == first.components)
            })
            .collect();
        match (same.len() == lists.len()).then(|| join(&same)).flatten() {
            Some(joined) => out.push(joined),
            None => warnings
                .push(format!("{what} array `{}` left out: not all pieces have it", first.name)),
        }
    }
    out
}

fn concatenate_arrays(arrays: &[&DataArray]) -> Option<DataArray> {
    let mut out = arrays[0].clone();
    arrays[1..].iter().for_each(|a| out.values.append(&a.values));
    Some(out)
}

fn attributes_of(pieces: &[Dataset]) -> Vec<&Attributes> {
    pieces.iter().filter_map(|p| p.attributes()).collect()
}

/// The attributes of the first piece, with its point and cell arrays replaced.
fn with_arrays(all: &[&Attributes], point: Vec<DataArray>, cell: Vec<DataArray>) -> Attributes {
    Attributes { point, cell, ..all[0].clone() }
}

fn concatenate_points(pieces: &[Dataset], warnings: &mut Vec<String>) -> Vec<DataArray> {
    let all = attributes_of(pieces);
    let lists: Vec<&[DataArray]> = all.iter().map(|a| a.point.as_slice()).collect();
    join_arrays(&lists, "point", warnings, concatenate_arrays)
}

fn merge_poly(pieces: &[Dataset], warnings: &mut Vec<String>) -> Dataset {
    let parts: Vec<&PolyData> = pieces
        .iter()
        .filter_map(|p| if let Dataset::PolyData(d) = p { Some(d) } else { None })
        .collect();
    let point = concatenate_points(pieces, warnings);
    let mut out = PolyData { points: parts[0].points.clone(), ..Default::default() };
    let mut shift = 0;
    for (i, d) in parts.iter().enumerate() {
        if i > 0 {
            out.points.append(&d.points);
        }
        out.verts.append(&d.verts, shift);
        out.lines.append(&d.lines, shift);
        out.polys.append(&d.polys, shift);
        out.strips.append(&d.strips, shift);
        shift += d.points.len();
    }
    // Cell data is ordered verts, lines, polys, strips: take the verts of all pieces first, then
    // the lines of all, …
    let all = attributes_of(pieces);
    let lists: Vec<&[DataArray]> = all.iter().map(|a| a.cell.as_slice()).collect();
    let cell = join_arrays(&lists, "cell", warnings, |arrays| {
        let mut out =
            DataArray { values: Values::empty(arrays[0].values.kind()), ..arrays[0].clone() };
        for class in 0..4 {
            for (a, d) in arrays.iter().zip(&parts) {
                let sizes = [d.verts.len(), d.lines.len(), d.polys.len(), d.strips.len()];
                let start: usize = sizes[..class].iter().sum();
                let values =
                    a.values.slice(start * a.components..(start + sizes[class]) * a.components);
                out.values.append(&values);
            }
        }
        Some(out)
    });
    out.attributes = with_arrays(&all, point, cell);
    Dataset::PolyData(out)
}

fn merge_unstructured(pieces: &[Dataset], warnings: &mut Vec<String>) -> Dataset {
    let parts: Vec<&UnstructuredGrid> = pieces
        .iter()
        .filter_map(|p| if let Dataset::UnstructuredGrid(d) = p { Some(d) } else { None })
        .collect();
    let mut out = UnstructuredGrid { points: parts[0].points.clone(), ..Default::default() };
    let polyhedra = parts.iter().any(|d| !d.faces_of_cell.is_empty());
    let mut shift = 0;
    for (i, d) in parts.iter().enumerate() {
        if i > 0 {
            out.points.append(&d.points);
        }
        out.cells.append(&d.cells, shift);
        out.types.extend_from_slice(&d.types);
        if polyhedra {
            let faces = out.polyhedron_faces.len();
            out.polyhedron_faces.append(&d.polyhedron_faces, shift);
            out.faces_of_cell.extend(
                (0..d.cells.len()).map(|c| {
                    d.faces_of_cell.get(c).map_or(0..0, |r| r.start + faces..r.end + faces)
                }),
            );
        }
        shift += d.points.len();
    }
    let all = attributes_of(pieces);
    let lists: Vec<&[DataArray]> = all.iter().map(|a| a.cell.as_slice()).collect();
    let cell = join_arrays(&lists, "cell", warnings, concatenate_arrays);
    let point = concatenate_points(pieces, warnings);
    out.attributes = with_arrays(&all, point, cell);
    Dataset::UnstructuredGrid(out)
}

fn extent_of(d: &Dataset) -> [i32; 6] {
    match d {
        Dataset::ImageData(d) => d.extent,
        Dataset::RectilinearGrid(d) => d.extent,
        Dataset::StructuredGrid(d) => d.extent,
        _ => [0, -1, 0, -1, 0, -1],
    }
}

fn merge_lattices(
    mut pieces: Vec<Dataset>,
    warnings: &mut Vec<String>,
) -> Result<Dataset, ModelError> {
    let extents: Vec<[i32; 6]> = pieces.iter().map(extent_of).collect();
    let whole: [i32; 6] = std::array::from_fn(|i| {
        let all = extents.iter().map(|e| e[i]);
        if i % 2 == 0 { all.min() } else { all.max() }.unwrap_or(0)
    });
    let dims = extent_dims(whole);
    let has_arrays =
        |p: &Dataset| p.attributes().is_some_and(|a| !a.point.is_empty() || !a.cell.is_empty());
    let gather_something =
        matches!(pieces[0], Dataset::StructuredGrid(_)) || pieces.iter().all(has_arrays);
    if dims.contains(&0) {
        return Ok(pieces.swap_remove(0));
    }
    // Pieces must cover the whole extent; otherwise some values would be undefined. This check also
    // bounds the memory.
    let covered: u64 = extents
        .iter()
        .map(|&e| lattice_counts(extent_dims(e)).map_or(0, |c| c.0))
        .fold(0, u64::saturating_add);
    let (expected, _) = lattice_counts(dims).unwrap_or((u64::MAX, 0));
    let gap = |found| ModelError::Inconsistent {
        field: "points covered by the pieces of the lattice".into(),
        expected,
        found,
    };
    if covered < expected {
        return Err(gap(covered));
    }
    // Without arrays, nothing backs the declared extent, so no memory of its size may be allocated;
    // and there are no values to merge.
    let (mut points_from, mut cells_from) = (Vec::new(), Vec::new());
    if gather_something {
        points_from = index_map(whole, &extents, false);
        cells_from = index_map(whole, &extents, true);
        let found = points_from.iter().filter(|s| s.0 != u32::MAX).count() as u64;
        if found < expected {
            return Err(gap(found));
        }
    }

    let all = attributes_of(&pieces);
    let gather = |map: &[(u32, usize)], arrays: &[&DataArray]| -> Option<DataArray> {
        // First concatenate the pieces into one array, so that the types agree; then put the values
        // into lattice order.
        let joined = concatenate_arrays(arrays)?;
        let starts: Vec<usize> = arrays
            .iter()
            .scan(0, |n, a| {
                let start = *n;
                *n += a.tuples();
                Some(start)
            })
            .collect();
        let c = joined.components;
        let order = || map.iter().flat_map(|&(p, i)| (0..c).map(move |k| (p, i, k)));
        let values = super::array::with_values!(&joined.values, v => {
            let picked = order().map(|(p, i, k)| {
                starts.get(p as usize).and_then(|s| v.get((s + i) * c + k)).copied()
            });
            super::array::IntoValues::into_values(picked.collect::<Option<Vec<_>>>()?)
        });
        let mut out = DataArray { values, ..joined };
        // Every point and cell now exists once, so none is another process's copy (bit 1) any more.
        if let ("vtkGhostType", Values::U8(v)) = (out.name.as_str(), &mut out.values) {
            v.iter_mut().for_each(|g| *g &= !1);
        }
        Some(out)
    };
    let lists: Vec<&[DataArray]> = all.iter().map(|a| a.point.as_slice()).collect();
    let point = join_arrays(&lists, "point", warnings, |a| gather(&points_from, a));
    let lists: Vec<&[DataArray]> = all.iter().map(|a| a.cell.as_slice()).collect();
    let cell = join_arrays(&lists, "cell", warnings, |a| gather(&cells_from, a));
    let attributes = with_arrays(&all, point, cell);

    let coordinates: Option<[Vec<f64>; 3]> =
        matches!(pieces[0], Dataset::RectilinearGrid(_)).then(|| {
            std::array::from_fn(|a| {
                let mut x = vec![f64::NAN; dims[a]];
                for p in &pieces {
                    if let Dataset::RectilinearGrid(d) = p {
                        let shift = (i64::from(d.extent[2 * a]) - i64::from(whole[2 * a])) as usize;
                        for (i, v) in d.coordinates[a].iter().enumerate() {
                            x[shift + i] = *v;
                        }
                    }
                }
                x
            })
        });
    let points: Option<Points> = matches!(pieces[0], Dataset::StructuredGrid(_)).then(|| {
        let arrays: Vec<DataArray> = pieces
            .iter()
            .filter_map(|p| {
                if let Dataset::StructuredGrid(d) = p { Some(d.points.to_array()) } else { None }
            })
            .collect();
        let list: Vec<&DataArray> = arrays.iter().collect();
        gather(&points_from, &list).and_then(|a| Points::from_array(a).ok()).unwrap_or_default()
    });
    let mut first = pieces.swap_remove(0);
    match &mut first {
        Dataset::ImageData(d) => (d.extent, d.attributes) = (whole, attributes),
        Dataset::RectilinearGrid(d) => {
            (d.extent, d.attributes) = (whole, attributes);
            d.coordinates = coordinates.unwrap_or_default();
        }
        Dataset::StructuredGrid(d) => {
            (d.extent, d.attributes) = (whole, attributes);
            d.points = points.unwrap_or_default();
        }
        _ => {}
    }
    first.check()?;
    Ok(first)
}

/// For each point (or cell) of the whole lattice: the piece that has it, and its index there.
fn index_map(whole: [i32; 6], extents: &[[i32; 6]], cells: bool) -> Vec<(u32, usize)> {
    let size = |e: [i32; 6]| extent_dims(e).map(|d| if cells && d > 1 { d - 1 } else { d });
    let dims = size(whole);
    let mut map = vec![(u32::MAX, 0); dims.iter().product()];
    for (p, &e) in extents.iter().enumerate() {
        let n = size(e);
        let shift: [usize; 3] =
            std::array::from_fn(|a| (i64::from(e[2 * a]) - i64::from(whole[2 * a])) as usize);
        // A piece that is flat along an axis where the whole lattice is not has no cells of it.
        if cells && (0..3).any(|a| extent_dims(e)[a] == 1 && extent_dims(whole)[a] > 1) {
            continue;
        }
        for k in 0..n[2] {
            for j in 0..n[1] {
                for i in 0..n[0] {
                    let to = shift[0] + i + dims[0] * (shift[1] + j + dims[1] * (shift[2] + k));
                    map[to] = (p as u32, i + n[0] * (j + n[1] * k));
                }
            }
        }
    }
    map
}
