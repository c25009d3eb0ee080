//! VTK's legacy files (`.vtk`), versions 1.0 to 5.1, ascii and binary (always big-endian).
//!
//! Source: "VTK File Formats" (Kitware), section "Simple legacy formats"; version 5 stores cells as
//! offsets and connectivity. Tested against what VTK 9.7 writes in both versions.

mod arrays;
mod cells;

use super::error::{At, BROKEN, Fault, read_bytes};
use super::{Content, LoadedFile, ReadError};
use crate::model::{
    Attributes, DataArray, Dataset, ImageData, Points, PolyData, RectilinearGrid, StructuredGrid,
    UnstructuredGrid,
};
use arrays::Input;
use glam::{DMat3, DVec3};
use std::path::Path;

pub(crate) const FORMAT: &str = "VTK legacy";

/// Reads a `.vtk` file.
pub fn read(path: &Path) -> Result<LoadedFile, ReadError> {
    read_from_bytes(path, &read_bytes(path)?)
}

/// Reads the content of a `.vtk` file; `path` is used in messages only.
pub fn read_from_bytes(path: &Path, bytes: &[u8]) -> Result<LoadedFile, ReadError> {
    let mut warnings = Vec::new();
    let data = parse(bytes, &mut warnings).map_err(|f| f.in_file(path, FORMAT))?;
    Ok(LoadedFile {
        format: FORMAT,
        content: Content::Data(data),
        warnings,
        time_steps: Vec::new(),
    })
}

/// The state from the keywords read so far.
#[derive(Default)]
struct Parts {
    points: Points,
    poly: PolyData,
    grid: UnstructuredGrid,
    dims: [i32; 3],
    origin: DVec3,
    spacing: Option<DVec3>,
    coordinates: [Vec<f64>; 3],
    attributes: Attributes,
}

/// What the following arrays belong to.
#[derive(Clone, Copy, PartialEq)]
enum Section {
    Geometry,
    Points(u64),
    Cells(u64),
}

fn parse(bytes: &[u8], warnings: &mut Vec<String>) -> Result<Dataset, Fault> {
    let mut input = Input::new(bytes);

    // Header: version, title, ASCII or BINARY.
    let first = input.cursor.line().unwrap_or_default();
    let version = first.trim().to_ascii_lowercase();
    let Some(version) = version.strip_prefix("# vtk datafile version").map(str::trim) else {
        let cure =
            "a legacy VTK file begins with `# vtk DataFile Version`; this is another kind of file";
        return Err(Fault::new(At::Line(1), "the first line is not that of a VTK file", cure));
    };
    let major: u32 = version.split('.').next().and_then(|v| v.parse().ok()).unwrap_or(3);
    input.offsets_and_connectivity = major >= 5;
    // The title, which may be empty; after it, files of version 1 have an empty line.
    input.cursor.line();
    let mut number = 2;
    let encoding = loop {
        number += 1;
        match input.cursor.line() {
            Some(line) if line.trim().is_empty() => {}
            line => break line.unwrap_or_default().trim().to_ascii_uppercase(),
        }
    };
    input.binary = match encoding.as_str() {
        "ASCII" => false,
        "BINARY" => true,
        other => {
            let shown: String = other.chars().take(40).collect();
            let what = format!("the line after the title is `{shown}`");
            return Err(Fault::new(At::Line(number), what, "it must be ASCII or BINARY"));
        }
    };

    let mut kind = String::new();
    let mut parts = Parts { dims: [0; 3], ..Default::default() };
    let mut section = Section::Geometry;
    while let Some(word) = input.text_word() {
        let keyword = word.to_ascii_uppercase();
        match keyword.as_str() {
            "DATASET" => kind = input.text_word().unwrap_or_default().to_ascii_uppercase(),
            "POINTS" => {
                let n = input.count("number of points")?;
                let ty = input.type_word()?;
                let values = input.values(&ty, n.saturating_mul(3), "coordinates")?;
                parts.points = Points::from_array(DataArray::new("POINTS", 3, values))?;
            }
            "VERTICES" => parts.poly.verts = input.cells("VERTICES")?,
            "LINES" => parts.poly.lines = input.cells("LINES")?,
            "POLYGONS" => parts.poly.polys = input.cells("POLYGONS")?,
            "TRIANGLE_STRIPS" => parts.poly.strips = input.cells("TRIANGLE_STRIPS")?,
            "CELLS" => parts.grid.cells = input.cells("CELLS")?,
            "CELL_TYPES" => parts.grid.types = input.cell_types()?,
            "DIMENSIONS" => parts.dims = input.numbers_in_line("DIMENSIONS")?,
            "ORIGIN" => parts.origin = DVec3::from_array(input.numbers_in_line("ORIGIN")?),
            "SPACING" | "ASPECT_RATIO" => {
                parts.spacing = Some(DVec3::from_array(input.numbers_in_line(&keyword)?))
            }
            "X_COORDINATES" | "Y_COORDINATES" | "Z_COORDINATES" => {
                let axis = usize::from(keyword.as_bytes()[0] - b'X');
                let n = input.count("number of coordinates")?;
                let ty = input.type_word()?;
                let values = input.values(&ty, n, "coordinates")?;
                parts.coordinates[axis] = (0..values.len()).map(|i| values.get_f64(i)).collect();
            }
            "POINT_DATA" => section = Section::Points(input.count("number of points with data")?),
            "CELL_DATA" => section = Section::Cells(input.count("number of cells with data")?),
            "METADATA" => input.skip_metadata(),
            _ => input.attribute(&keyword, section, &mut parts.attributes, warnings)?,
        }
    }
    let data = assemble(&kind, parts, warnings)?;
    data.check().map_err(Fault::from)?;
    Ok(data)
}

/// Builds the data set of kind `kind` from what was read.
fn assemble(kind: &str, parts: Parts, warnings: &mut Vec<String>) -> Result<Dataset, Fault> {
    let Parts { points, mut poly, mut grid, dims, origin, spacing, coordinates, attributes } =
        parts;
    let extent: [i32; 6] =
        std::array::from_fn(|i| if i % 2 == 0 { 0 } else { dims[i / 2].max(0) - 1 });
    let n = points.len();
    let bad = [&poly.verts, &poly.lines, &poly.polys, &poly.strips, &grid.cells]
        .iter()
        .flat_map(|c| c.connectivity())
        .filter(|&&k| k as usize >= n)
        .count();
    Ok(match kind {
        "POLYDATA" => {
            (poly.points, poly.attributes) = (points, attributes);
            note_bad_ids(bad, warnings);
            Dataset::PolyData(poly)
        }
        "UNSTRUCTURED_GRID" => {
            grid.split_polyhedra()?;
            if grid.faces_of_cell.is_empty() {
                note_bad_ids(bad, warnings);
            }
            (grid.points, grid.attributes) = (points, attributes);
            Dataset::UnstructuredGrid(grid)
        }
        "STRUCTURED_POINTS" => {
            let spacing = spacing.unwrap_or(DVec3::ONE);
            Dataset::ImageData(ImageData {
                extent,
                origin,
                spacing,
                direction: DMat3::IDENTITY,
                attributes,
            })
        }
        "STRUCTURED_GRID" => Dataset::StructuredGrid(StructuredGrid { extent, points, attributes }),
        "RECTILINEAR_GRID" => {
            Dataset::RectilinearGrid(RectilinearGrid { extent, coordinates, attributes })
        }
        "" => {
            return Err(Fault::new(
                At::Field("the header".into()),
                "there is no DATASET line",
                BROKEN,
            ));
        }
        other => {
            let shown: String = other.chars().take(40).collect();
            let cure = "convert it to POLYDATA, UNSTRUCTURED_GRID, STRUCTURED_POINTS, \
                        STRUCTURED_GRID or RECTILINEAR_GRID";
            return Err(Fault::unsupported(
                At::Field("DATASET".into()),
                format!("`{shown}`"),
                cure,
            ));
        }
    })
}

fn note_bad_ids(bad: usize, warnings: &mut Vec<String>) {
    if bad > 0 {
        warnings.push(format!("{bad} point ids do not exist; their cells will be left out"));
    }
}
