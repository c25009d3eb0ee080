//! Converts the `Piece` elements of a VTK XML file to data sets.

use super::file::{XmlFile, attribute_numbers, bad_attribute};
use crate::model::{
    Attributes, Cells, DataArray, Dataset, ImageData, Points, PolyData, RectilinearGrid,
    StructuredGrid, UnstructuredGrid, Values,
};
use crate::read::error::{At, BROKEN, Fault};
use glam::{DMat3, DVec3};
use roxmltree::Node;

/// The kinds of data set with their own file format.
pub(crate) const KINDS: [&str; 5] =
    ["PolyData", "UnstructuredGrid", "ImageData", "RectilinearGrid", "StructuredGrid"];

/// All pieces of the file's data set, which is the element `set`.
pub(crate) fn pieces(
    file: &XmlFile<'_>,
    set: Node<'_, '_>,
    warnings: &mut Vec<String>,
) -> Result<Vec<Dataset>, Fault> {
    let kind = set.tag_name().name();
    let field = field_data(file, set, warnings)?;
    let mut list = Vec::new();
    for piece in set.children().filter(|n| n.has_tag_name("Piece")) {
        let mut attributes =
            Attributes { field: field.0.clone(), text: field.1.clone(), ..Default::default() };
        point_and_cell_data(file, piece, &mut attributes, warnings)?;
        let extent = || -> Result<[i32; 6], Fault> {
            match attribute_numbers(piece, "Extent")? {
                Some(e) => Ok(e),
                None => attribute_numbers(set, "WholeExtent")?
                    .ok_or_else(|| Fault::field(kind, "neither Extent nor WholeExtent is given")),
            }
        };
        let data = match kind {
            "PolyData" => poly_data(file, piece, attributes, warnings)?,
            "UnstructuredGrid" => unstructured(file, piece, attributes, warnings)?,
            "ImageData" => Dataset::ImageData(ImageData {
                extent: extent()?,
                origin: attribute_numbers(set, "Origin")?.map_or(DVec3::ZERO, DVec3::from_array),
                spacing: attribute_numbers(set, "Spacing")?.map_or(DVec3::ONE, DVec3::from_array),
                // Rows in the file; our columns are the axes.
                direction: attribute_numbers::<f64, 9>(set, "Direction")?
                    .map_or(DMat3::IDENTITY, |d| DMat3::from_cols_array(&d).transpose()),
                attributes,
            }),
            "RectilinearGrid" => Dataset::RectilinearGrid(RectilinearGrid {
                extent: extent()?,
                coordinates: coordinates(file, piece, warnings)?,
                attributes,
            }),
            _ => Dataset::StructuredGrid(StructuredGrid {
                extent: extent()?,
                points: points(file, piece, warnings)?,
                attributes,
            }),
        };
        check_counts(piece, &data)?;
        data.check().map_err(Fault::from)?;
        list.push(data);
    }
    Ok(list)
}

/// Compares the declared sizes of the piece with its arrays: a mismatch means that arrays were
/// lost.
fn check_counts(piece: Node<'_, '_>, data: &Dataset) -> Result<(), Fault> {
    let (points, cells) = data.counts();
    let poly_cells = |get: fn(&PolyData) -> &Cells| match data {
        Dataset::PolyData(d) => get(d).len() as u64,
        _ => cells,
    };
    for (attribute, found) in [
        ("NumberOfPoints", points),
        ("NumberOfCells", cells),
        ("NumberOfVerts", poly_cells(|d| &d.verts)),
        ("NumberOfLines", poly_cells(|d| &d.lines)),
        ("NumberOfPolys", poly_cells(|d| &d.polys)),
        ("NumberOfStrips", poly_cells(|d| &d.strips)),
    ] {
        if let Some(text) = piece.attribute(attribute)
            && text.trim().parse() != Ok(found)
        {
            return Err(bad_attribute(
                piece,
                attribute,
                text,
                &format!("{found}, as its arrays have it"),
            ));
        }
    }
    Ok(())
}

type FieldData = (Vec<DataArray>, Vec<(String, Vec<String>)>);

/// The arrays and strings that belong to the data set as a whole.
pub(crate) fn field_data(
    file: &XmlFile<'_>,
    set: Node<'_, '_>,
    warnings: &mut Vec<String>,
) -> Result<FieldData, Fault> {
    let (mut arrays, mut texts) = (Vec::new(), Vec::new());
    for node in set.children().filter(|n| n.has_tag_name("FieldData")).flat_map(|n| n.children()) {
        if !node.is_element() {
            continue;
        }
        if node.attribute("type") == Some("String") {
            texts.push((node.attribute("Name").unwrap_or("").to_string(), file.texts(node)?));
        } else if let Some(array) = file.array(node, warnings)? {
            arrays.push(array);
        }
    }
    Ok((arrays, texts))
}

fn point_and_cell_data(
    file: &XmlFile<'_>,
    piece: Node<'_, '_>,
    out: &mut Attributes,
    warnings: &mut Vec<String>,
) -> Result<(), Fault> {
    for section in piece.children() {
        let of_points = match section.tag_name().name() {
            "PointData" => true,
            "CellData" => false,
            _ => continue,
        };
        let mut arrays: Vec<DataArray> = Vec::new();
        for node in
            section.children().filter(|n| n.has_tag_name("DataArray") || n.has_tag_name("Array"))
        {
            // A file may hold several time steps of one array; the first one is used.
            if node.has_attribute("TimeStep")
                && arrays.iter().any(|a| Some(a.name.as_str()) == node.attribute("Name"))
            {
                warnings.push(format!(
                    "array `{}`: later time steps left out",
                    node.attribute("Name").unwrap_or("")
                ));
                continue;
            }
            if let Some(array) = file.array(node, warnings)? {
                arrays.push(array);
            }
        }
        if of_points {
            out.point.extend(arrays);
        } else {
            out.cell.extend(arrays);
        }
        all_marks(section, out);
    }
    Ok(())
}

/// Which arrays a section marks as normals and the like.
pub(super) fn all_marks(section: Node<'_, '_>, out: &mut Attributes) {
    let marked = |what: &str| section.attribute(what).filter(|n| !n.is_empty()).map(str::to_string);
    match section.tag_name().name() {
        "PointData" => {
            out.point_normals = marked("Normals");
            out.point_texcoords = marked("TCoords");
            out.point_scalars = marked("Scalars");
        }
        "CellData" => {
            out.cell_normals = marked("Normals");
            out.cell_scalars = marked("Scalars");
        }
        _ => {}
    }
}

/// The array with the given name inside `section`.
fn named_array(
    file: &XmlFile<'_>,
    section: Node<'_, '_>,
    name: &str,
    warnings: &mut Vec<String>,
) -> Result<Option<DataArray>, Fault> {
    let node = section
        .children()
        .find(|n| n.has_tag_name("DataArray") && n.attribute("Name") == Some(name));
    match node {
        Some(node) => file.array(node, warnings),
        None => Ok(None),
    }
}

fn points(
    file: &XmlFile<'_>,
    piece: Node<'_, '_>,
    warnings: &mut Vec<String>,
) -> Result<Points, Fault> {
    let node = piece
        .children()
        .find(|n| n.has_tag_name("Points"))
        .and_then(|s| s.children().find(|n| n.has_tag_name("DataArray")));
    match node {
        None => Ok(Points::default()),
        Some(node) => match file.array(node, warnings)? {
            Some(array) => Ok(Points::from_array(array)?),
            None => Err(Fault::field("Points", "the coordinates have a type that is not read")),
        },
    }
}

fn coordinates(
    file: &XmlFile<'_>,
    piece: Node<'_, '_>,
    warnings: &mut Vec<String>,
) -> Result<[Vec<f64>; 3], Fault> {
    let mut out: [Vec<f64>; 3] = Default::default();
    let section = piece.children().find(|n| n.has_tag_name("Coordinates"));
    let nodes = section.iter().flat_map(|s| s.children()).filter(|n| n.has_tag_name("DataArray"));
    for (axis, node) in nodes.take(3).enumerate() {
        if let Some(array) = file.array(node, warnings)? {
            out[axis] = (0..array.values.len()).map(|i| array.values.get_f64(i)).collect();
        }
    }
    Ok(out)
}

/// Any integers as i64.
pub(crate) fn integers(values: &Values) -> impl Iterator<Item = i64> + '_ {
    (0..values.len()).map(move |i| match values {
        Values::I64(v) => v[i],
        Values::U64(v) => i64::try_from(v[i]).unwrap_or(i64::MAX),
        other => other.get_f64(i) as i64,
    })
}

/// `connectivity` and `offsets` of one section.
fn cells(
    file: &XmlFile<'_>,
    section: Node<'_, '_>,
    names: [&str; 2],
    num_points: usize,
    warnings: &mut Vec<String>,
) -> Result<Cells, Fault> {
    let connectivity = named_array(file, section, names[0], warnings)?;
    let ends = named_array(file, section, names[1], warnings)?;
    let (Some(connectivity), Some(ends)) = (connectivity, ends) else { return Ok(Cells::new()) };
    cells_from_arrays(
        &connectivity.values,
        &ends.values,
        section.tag_name().name(),
        num_points,
        warnings,
    )
}

pub(crate) fn cells_from_arrays(
    connectivity: &Values,
    ends: &Values,
    section: &str,
    num_points: usize,
    warnings: &mut Vec<String>,
) -> Result<Cells, Fault> {
    let ids: Vec<u32> = integers(connectivity).map(Cells::id).collect();
    let wrong = ids.iter().filter(|&&k| k as usize >= num_points).count();
    if wrong > 0 {
        warnings.push(format!(
            "{section}: {wrong} of {} point ids do not exist; their cells will be left out",
            ids.len()
        ));
    }
    Cells::from_ends(integers(ends), ids).map_err(|bad| {
        let what = format!(
            "cell {} ends at {}, which must be from {} to {}",
            bad.cell, bad.end, bad.allowed.0, bad.allowed.1
        );
        Fault::new(At::Field(format!("offsets of {section}")), what, BROKEN)
    })
}

fn poly_data(
    file: &XmlFile<'_>,
    piece: Node<'_, '_>,
    attributes: Attributes,
    warnings: &mut Vec<String>,
) -> Result<Dataset, Fault> {
    let points = points(file, piece, warnings)?;
    let mut section = |name: &str| match piece.children().find(|n| n.has_tag_name(name)) {
        Some(node) => cells(file, node, ["connectivity", "offsets"], points.len(), warnings),
        None => Ok(Cells::new()),
    };
    let (verts, lines, polys, strips) =
        (section("Verts")?, section("Lines")?, section("Polys")?, section("Strips")?);
    Ok(Dataset::PolyData(PolyData { points, verts, lines, polys, strips, attributes }))
}

fn unstructured(
    file: &XmlFile<'_>,
    piece: Node<'_, '_>,
    attributes: Attributes,
    warnings: &mut Vec<String>,
) -> Result<Dataset, Fault> {
    let points = points(file, piece, warnings)?;
    let mut d = UnstructuredGrid { points, attributes, ..Default::default() };
    let Some(section) = piece.children().find(|n| n.has_tag_name("Cells")) else {
        return Ok(Dataset::UnstructuredGrid(d));
    };
    let num_points = d.points.len();
    d.cells = cells(file, section, ["connectivity", "offsets"], num_points, warnings)?;
    if let Some(types) = named_array(file, section, "types", warnings)? {
        d.types = integers(&types.values).map(|t| u8::try_from(t).unwrap_or(u8::MAX)).collect();
    }

    // Polyhedra, VTK 9.4 and later: faces as cells, and which faces each polyhedron has.
    if let Some(ends) = named_array(file, section, "polyhedron_offsets", warnings)? {
        d.polyhedron_faces =
            cells(file, section, ["face_connectivity", "face_offsets"], num_points, warnings)?;
        let of_cell = named_array(file, section, "polyhedron_to_faces", warnings)?;
        let list: Vec<i64> = of_cell.iter().flat_map(|a| integers(&a.values)).collect();
        d.polyhedra_from_lists(integers(&ends.values), &list)?;
    } else if let Some(stream) = named_array(file, section, "faces", warnings)?
        && let Some(ends) = named_array(file, section, "faceoffsets", warnings)?
    {
        // Earlier versions: one stream per cell: number of faces, then per face its number of
        // points and their ids; -1 for no polyhedron.
        let stream: Vec<i64> = integers(&stream.values).collect();
        let mut start = 0usize;
        for (cell, end) in integers(&ends.values).enumerate() {
            let first = d.polyhedron_faces.len();
            if let Ok(end) = usize::try_from(end) {
                let bad = || {
                    Fault::field(
                        "faces of Cells",
                        format!("the faces of cell {cell} do not end at {end}"),
                    )
                };
                let slice = stream.get(start..end).ok_or_else(bad)?;
                face_stream(slice, &mut d.polyhedron_faces).ok_or_else(bad)?;
                start = end;
            }
            d.faces_of_cell.push(first..d.polyhedron_faces.len());
        }
    }
    Ok(Dataset::UnstructuredGrid(d))
}

/// Appends the faces of one polyhedron: count, then per face its size and ids. `None` if the
/// numbers do not add up.
pub(crate) fn face_stream(stream: &[i64], faces: &mut Cells) -> Option<()> {
    let mut at = 1;
    for _ in 0..*stream.first()? {
        let n = usize::try_from(*stream.get(at)?).ok()?;
        let ids = stream.get(at + 1..at.checked_add(1)?.checked_add(n)?)?;
        faces.push(ids.iter().map(|&k| Cells::id(k)));
        at += 1 + n;
    }
    (at == stream.len()).then_some(())
}

impl UnstructuredGrid {
    /// Sets which faces belong to each cell from ends into `list`. The list must name the faces in
    /// order, as VTK writes it; otherwise the faces are copied into that order.
    fn polyhedra_from_lists(
        &mut self,
        ends: impl Iterator<Item = i64>,
        list: &[i64],
    ) -> Result<(), Fault> {
        let mut ordered = Cells::new();
        let mut start = 0;
        for (cell, end) in ends.enumerate() {
            let first = ordered.len();
            let range = usize::try_from(end).ok().and_then(|end| list.get(start..end));
            let Some(faces) = range else {
                let what = format!("the faces of cell {cell} end at {end} of {}", list.len());
                return Err(Fault::field("polyhedron_offsets of Cells", what));
            };
            for &face in faces {
                let Some(i) =
                    usize::try_from(face).ok().filter(|&i| i < self.polyhedron_faces.len())
                else {
                    let what =
                        format!("cell {cell} names face {face} of {}", self.polyhedron_faces.len());
                    return Err(Fault::field("polyhedron_to_faces of Cells", what));
                };
                ordered.push(self.polyhedron_faces.get(i).iter().copied());
            }
            self.faces_of_cell.push(first..ordered.len());
            start += faces.len();
        }
        self.polyhedron_faces = ordered;
        Ok(())
    }
}
