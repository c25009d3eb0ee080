//! Polygons and unstructured cells of one file in pieces, for files that are larger than memory.
//!
//! Nothing is kept but what a piece has: a piece reads its cells, and of each array of points what
//! its cells name. Points that follow the cells' order, as most programs write them, are read about
//! once; in the worst order each piece reads all points.

use super::FORMAT;
use super::blocks::Encoding;
use super::file::{XmlFile, array_description, parse_tree};
use super::outline::outline;
use super::pieces::{all_marks, integers};
use super::stored_array::{Place, StoredArray};
use crate::model::{
    Attributes, CellType, Cells, DataArray, Dataset, PieceBoundaries, Points, PolyData,
    SharedFaces, UnstructuredGrid,
};
use crate::read::error::{At, BROKEN, Fault, io_error, refuse_pointer};
use crate::read::used_points::UsedPoints;
use crate::read::{Content, LoadedFile, ReadError};
use glam::DVec3;
use roxmltree::Node;
use rt_core::mesh::TriMesh;
use std::fs::File;
use std::io::{BufReader, Read as _, Seek as _};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Most corners of the cells of a piece, as a multiple of their number. Cells with more are read
/// with fewer others.
const MOST_CORNERS: u64 = 64;
/// Points that are read at once to find their bounds.
const POINTS_AT_ONCE: u64 = 1 << 16;

/// The cells of a `.vtp` or `.vtu` file, in pieces. Each has the points that its cells name, in
/// ascending order, and their values and its own.
///
/// ```
/// # use datasets::model::{Dataset, PolyData};
/// # use datasets::read::vtk_xml::CellPieces;
/// # use datasets::write::VtkOptions;
/// # let dir = tempfile::tempdir()?;
/// # let path = dir.path().join("ball.vtp");
/// # datasets::write::write_vtk(
/// #     &path,
/// #     &Dataset::PolyData(PolyData::from_trimesh(&datasets::generate::shapes::icosphere(2))),
/// #     VtkOptions::default(),
/// # )?;
/// let mut pieces = CellPieces::open(&path, 100)?.expect("binary arrays");
/// assert_eq!(pieces.cells(), 320);
/// let mut count = 0;
/// while let Some(piece) = pieces.next_piece() {
///     count += 1;
///     assert!(piece?.shared_faces.is_none());
/// }
/// assert_eq!(count, 4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct CellPieces {
    path: PathBuf,
    pieces: Vec<Piece>,
    cells_at_once: u64,
    next: Next,
    shared: Option<SharedFaces>,
}

/// Where the next piece begins: `Piece` element, cell in it, and corner.
#[derive(Debug, Clone, Copy, Default)]
struct Next {
    element: usize,
    cell: u64,
    corner: u64,
}

/// A part of a file.
#[derive(Debug)]
pub struct CellPiece {
    /// The part as a file of its own.
    pub file: LoadedFile,
    /// The faces that it shares with others, where [`CellPieces::find_shared_faces`] has found
    /// them.
    pub shared_faces: Option<SharedFaces>,
    /// Its number of cells.
    pub cells: u64,
}

/// A `Piece` element.
struct Piece {
    points: StoredArray,
    connectivity: StoredArray,
    ends: StoredArray,
    /// Of unstructured grids.
    types: Option<StoredArray>,
    point_data: Vec<StoredArray>,
    cell_data: Vec<StoredArray>,
    /// Which arrays are marked as normals and the like.
    marks: Attributes,
}

/// The cells of one piece, by their points' numbers in the element.
struct PieceCells {
    range: Range<u64>,
    cells: Cells,
    /// Numbers of the points that [`Self::cells`] name by their place here; ascending.
    points: Vec<u64>,
    types: Vec<u8>,
    missing: usize,
    corner: u64,
}

impl CellPieces {
    /// Opens a file and reads its tags; cells come in pieces of at most `cells`, at least one.
    /// `None` for what is not read in pieces, so [`super::read`] must read the whole: other kinds
    /// of data, numbers as text, vertices, lines and strips, polyhedra, and cells that
    /// `vtkGhostType` hides. It also says what is wrong with broken files.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn open(path: &Path, cells: usize) -> Result<Option<CellPieces>, ReadError> {
        let io = |e| io_error(path, e);
        let mut file = File::open(path).map_err(io)?;
        let mut start = [0; 64];
        let read = (&mut file).take(64).read(&mut start).map_err(io)?;
        refuse_pointer(path, &start[..read])?;
        file.rewind().map_err(io)?;
        let found = outline(BufReader::with_capacity(1 << 20, &file)).map_err(io)?;
        let Ok(found) = found else { return Ok(None) };
        let Ok(tree) = parse_tree(&found.head) else { return Ok(None) };
        let Ok(xml) = XmlFile::new(&tree, &[]) else { return Ok(None) };
        let kind = xml.root.attribute("type").unwrap_or("");
        let Some(encoding) = xml.encoding() else { return Ok(None) };
        if !matches!(kind, "PolyData" | "UnstructuredGrid") {
            return Ok(None);
        }
        let set = xml.root.children().find(|n| n.is_element() && n.tag_name().name() == kind);
        let length = file.metadata().map_err(io)?.len();
        let source = Source {
            file: Arc::new(file),
            length,
            appended: found.appended,
            appended_is_raw: xml.appended_is_raw(),
            encoding,
        };
        let mut pieces = Vec::new();
        for piece in set.iter().flat_map(|s| s.children()).filter(|n| n.has_tag_name("Piece")) {
            // Whatever is wrong, the reader of whole files says it better.
            match Piece::open(&source, piece, kind) {
                Ok(Opened::Piece(piece)) => pieces.push(*piece),
                Ok(Opened::Empty) => {}
                Ok(Opened::Other) | Err(_) => return Ok(None),
            }
        }
        if pieces.is_empty() {
            return Ok(None);
        }
        Ok(Some(CellPieces {
            path: path.to_path_buf(),
            pieces,
            cells_at_once: cells.max(1) as u64,
            next: Next::default(),
            shared: None,
        }))
    }

    /// Cells of the file.
    pub fn cells(&self) -> u64 {
        self.pieces.iter().map(|p| p.ends.tuples()).sum()
    }

    /// The names of its arrays on points and on cells.
    pub fn array_names(&self) -> impl Iterator<Item = &str> {
        let arrays = self.pieces.iter().flat_map(|p| p.point_data.iter().chain(&p.cell_data));
        arrays.map(|array| array.name.as_str())
    }

    /// The array that the file marks as its scalars.
    pub fn marked_array(&self) -> Option<String> {
        let marks = &self.pieces.first()?.marks;
        marks.point_scalars.clone().or_else(|| marks.cell_scalars.clone())
    }

    /// Keeps the arrays that are wanted by name, those that the file marks, and normals. Others are
    /// not read.
    pub fn keep_arrays(&mut self, wanted: impl Fn(&str) -> bool) {
        for piece in &mut self.pieces {
            let marks = &piece.marks;
            let marked = [
                &marks.point_normals,
                &marks.point_texcoords,
                &marks.point_scalars,
                &marks.cell_normals,
                &marks.cell_scalars,
            ];
            let is_kept = |array: &StoredArray| {
                let name = array.name.as_str();
                name == "Normals"
                    || wanted(name)
                    || marked.iter().any(|m| m.as_deref() == Some(name))
            };
            piece.point_data.retain(is_kept);
            piece.cell_data.retain(is_kept);
        }
    }

    /// What the positions of all pieces want to be relative to
    /// ([`crate::model::Dataset::to_trimesh_at`]): the origin that [`TriMesh::from_f64_positions`]
    /// chooses for all points.
    ///
    /// # Errors
    /// When the points cannot be read.
    pub fn origin(&mut self) -> Result<DVec3, ReadError> {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for piece in &mut self.pieces {
            let count = piece.points.tuples();
            for start in (0..count).step_by(POINTS_AT_ONCE as usize) {
                let range = start..count.min(start + POINTS_AT_ONCE);
                let values = piece.points.tuples_in(range);
                let values = values.map_err(|f| f.in_file(&self.path, FORMAT))?;
                for i in 0..values.len() / 3 {
                    let p = DVec3::from_array([0, 1, 2].map(|c| values.get_f64(3 * i + c)));
                    if p.is_finite() {
                        (low, high) = (low.min(p), high.max(p));
                    }
                }
            }
        }
        Ok(TriMesh::from_f64_positions(&[low, high], Vec::new()).origin)
    }

    /// Finds the faces of solid cells that lie between two pieces: reads all cells once, and keeps
    /// 24 bytes for each face at the border of a piece. The pieces that follow have the surface of
    /// the whole. `progress` is told the cells read so far, and may end the work.
    ///
    /// # Errors
    /// When the cells cannot be read, and what `progress` says.
    pub fn find_shared_faces<E: From<ReadError>>(
        &mut self,
        mut progress: impl FnMut(u64) -> Result<(), E>,
    ) -> Result<(), E> {
        self.next = Next::default();
        let (mut boundaries, mut read, mut any_solid) = (PieceBoundaries::default(), 0, false);
        while let Some((element, found)) = self.next_cells() {
            let found = found.map_err(|f| f.in_file(&self.path, FORMAT))?;
            read += found.range.end - found.range.start;
            if self.pieces[element].types.is_some() && found.has_solids() {
                any_solid = true;
                let numbers = found.numbers(self.first_point(element));
                // Which faces belong to one cell follows from the points' numbers alone.
                let points = Points::F32(vec![[0.0; 3]; found.points.len()]);
                let grid = found.grid(points, Attributes::default());
                boundaries.add_numbered(&Dataset::UnstructuredGrid(grid), &numbers);
            }
            progress(read)?;
        }
        self.next = Next::default();
        self.shared = any_solid.then(|| boundaries.shared_faces());
        Ok(())
    }

    /// The next piece; nothing after the last one, and after an error.
    pub fn next_piece(&mut self) -> Option<Result<CellPiece, ReadError>> {
        let (element, found) = self.next_cells()?;
        let piece = found.and_then(|found| self.piece(element, found));
        if piece.is_err() {
            self.next.element = self.pieces.len();
        }
        Some(piece.map_err(|f| f.in_file(&self.path, FORMAT)))
    }

    /// Whether the faces between pieces must be found: the file has cells that are solid, and more
    /// than one piece.
    pub fn may_share_faces(&self) -> bool {
        self.pieces.iter().any(|p| p.types.is_some()) && self.cells() > self.cells_at_once
    }

    fn first_point(&self, element: usize) -> u64 {
        self.pieces[..element].iter().map(|p| p.points.tuples()).sum()
    }

    /// The next cells, and the element that they belong to.
    fn next_cells(&mut self) -> Option<(usize, Result<PieceCells, Fault>)> {
        while self.next.cell >= self.pieces.get(self.next.element)?.ends.tuples() {
            self.next = Next { element: self.next.element + 1, cell: 0, corner: 0 };
        }
        let element = self.next.element;
        let (cell, corner) = (self.next.cell, self.next.corner);
        let found = self.pieces[element].cells(cell, corner, self.cells_at_once);
        match &found {
            Ok(found) => (self.next.cell, self.next.corner) = (found.range.end, found.corner),
            Err(_) => self.next.element = self.pieces.len(),
        }
        Some((element, found))
    }

    fn piece(&mut self, element: usize, found: PieceCells) -> Result<CellPiece, Fault> {
        let shared_faces = match &self.shared {
            Some(shared) if found.has_solids() => {
                Some(shared.of_numbered(found.numbers(self.first_point(element))))
            }
            _ => None,
        };
        let piece = &mut self.pieces[element];
        let mut attributes = piece.marks.clone();
        for array in &mut piece.point_data {
            attributes.point.push(array.gathered(&found.points)?);
        }
        for array in &mut piece.cell_data {
            let values = array.tuples_in(found.range.clone())?;
            attributes.cell.push(DataArray::new(array.name.clone(), array.components, values));
        }
        let points = Points::from_array(piece.points.gathered(&found.points)?)?;
        let mut warnings = Vec::new();
        if found.missing > 0 {
            warnings.push(format!(
                "{} point ids do not exist; their cells will be left out",
                found.missing
            ));
        }
        let cells = found.range.end - found.range.start;
        let data = match piece.types {
            Some(_) => Dataset::UnstructuredGrid(found.grid(points, attributes)),
            None => {
                let polys = found.cells;
                Dataset::PolyData(PolyData { points, polys, attributes, ..PolyData::default() })
            }
        };
        data.check()?;
        let content = Content::Data(data);
        let file = LoadedFile { format: FORMAT, content, warnings, time_steps: Vec::new() };
        Ok(CellPiece { file, shared_faces, cells })
    }
}

impl PieceCells {
    fn has_solids(&self) -> bool {
        self.types.iter().any(|&t| matches!(CellType::of(t), CellType::Solid(_)))
    }

    /// The points' numbers in the file.
    fn numbers(&self, first_point: u64) -> Vec<u64> {
        self.points.iter().map(|number| number + first_point).collect()
    }

    fn grid(self, points: Points, attributes: Attributes) -> UnstructuredGrid {
        let (cells, types) = (self.cells, self.types);
        UnstructuredGrid { points, cells, types, attributes, ..UnstructuredGrid::default() }
    }
}

impl Piece {
    /// Opens the arrays of an element.
    fn open(source: &Source, piece: Node<'_, '_>, kind: &str) -> Result<Opened, Fault> {
        let count = |name: &str| -> Option<u64> {
            piece.attribute(name).map_or(Some(0), |text| text.trim().parse().ok())
        };
        let section = |name: &str| piece.children().find(|n| n.has_tag_name(name));
        let is_grid = kind == "UnstructuredGrid";
        let others = ["NumberOfVerts", "NumberOfLines", "NumberOfStrips"];
        if !is_grid && others.iter().any(|name| count(name) != Some(0)) {
            return Ok(Opened::Other);
        }
        let number = if is_grid { "NumberOfCells" } else { "NumberOfPolys" };
        let (Some(num_points), Some(num_cells)) = (count("NumberOfPoints"), count(number)) else {
            return Ok(Opened::Other);
        };
        if num_cells == 0 {
            return Ok(Opened::Empty);
        }
        let cells = section(if is_grid { "Cells" } else { "Polys" });
        let points = section("Points").map(|s| source.arrays(s)).transpose()?.flatten();
        let cells = cells.map(|s| source.arrays(s)).transpose()?.flatten();
        let (Some(points), Some(cells)) = (points, cells) else { return Ok(Opened::Other) };
        let [points] = match <[StoredArray; 1]>::try_from(points) {
            Ok(one) => one,
            Err(_) => return Ok(Opened::Other),
        };
        let (mut connectivity, mut ends, mut types) = (None, None, None);
        for array in cells {
            match &*array.name {
                "connectivity" => connectivity = Some(array),
                "offsets" => ends = Some(array),
                "types" if is_grid => types = Some(array),
                // The faces of polyhedra.
                _ if array.tuples() > 0 => return Ok(Opened::Other),
                _ => {}
            }
        }
        let (Some(connectivity), Some(ends)) = (connectivity, ends) else {
            return Ok(Opened::Other);
        };
        let data = |name| match section(name) {
            Some(section) => source.arrays(section),
            None => Ok(Some(Vec::new())),
        };
        let (Some(point_data), Some(cell_data)) = (data("PointData")?, data("CellData")?) else {
            return Ok(Opened::Other);
        };
        let single = [Some(&connectivity), Some(&ends), types.as_ref()]
            .map(|a| a.map_or(1, |a| a.components));
        let complete = points.components == 3
            && points.tuples() == num_points
            && ends.tuples() == num_cells
            && types.as_ref().is_none_or(|t| t.tuples() == num_cells)
            && types.is_some() == is_grid
            && single == [1; 3]
            && point_data.iter().all(|a| a.tuples() == num_points)
            && cell_data.iter().all(|a| a.tuples() == num_cells);
        if !complete || cell_data.iter().any(|a| a.name == "vtkGhostType") {
            return Ok(Opened::Other);
        }
        let mut marks = Attributes::default();
        piece.children().for_each(|section| all_marks(section, &mut marks));
        let piece = Piece { points, connectivity, ends, types, point_data, cell_data, marks };
        Ok(Opened::Piece(Box::new(piece)))
    }

    /// At most `most` cells from `first` on, whose first corner is number `corner`.
    fn cells(&mut self, first: u64, corner: u64, most: u64) -> Result<PieceCells, Fault> {
        let end = self.ends.tuples().min(first + most);
        let values = self.ends.tuples_in(first..end)?;
        let total = self.connectivity.tuples();
        let (mut last, mut ends) = (corner, Vec::with_capacity(values.len()));
        for (i, end) in integers(&values).enumerate() {
            let fits = u64::try_from(end).ok().filter(|end| (last..=total).contains(end));
            let Some(end) = fits else {
                let cell = first + i as u64;
                let what =
                    format!("cell {cell} ends at {end}, which must be from {last} to {total}");
                return Err(Fault::new(At::Field("offsets".into()), what, BROKEN));
            };
            if end - corner > most.saturating_mul(MOST_CORNERS) && !ends.is_empty() {
                break;
            }
            ends.push((end - corner) as i64);
            last = end;
        }
        let range = first..first + ends.len() as u64;
        let ids = self.connectivity.tuples_in(corner..last)?;
        let num_points = self.points.tuples();
        let exists = |id: i64| u64::try_from(id).ok().filter(|&id| id < num_points);
        let UsedPoints { numbers: points, places, missing } =
            UsedPoints::of(|| integers(&ids).map(exists));
        let cells = Cells::from_ends(ends.into_iter(), places)
            .map_err(|bad| Fault::field("offsets", format!("cell {} has no end", bad.cell)))?;
        let types = match &mut self.types {
            Some(types) => integers(&types.tuples_in(range.clone())?)
                .map(|t| u8::try_from(t).unwrap_or(u8::MAX))
                .collect(),
            None => Vec::new(),
        };
        Ok(PieceCells { range, cells, points, types, missing, corner: last })
    }
}

/// What a `Piece` element is.
enum Opened {
    Piece(Box<Piece>),
    /// It has no cells.
    Empty,
    /// It is not read in pieces.
    Other,
}

/// The file, and how it stores arrays.
struct Source {
    file: Arc<File>,
    length: u64,
    appended: Option<u64>,
    appended_is_raw: bool,
    encoding: Encoding,
}

impl Source {
    /// The arrays of a section. `None` where one of them is text or of a type that is not read.
    fn arrays(&self, section: Node<'_, '_>) -> Result<Option<Vec<StoredArray>>, Fault> {
        let nodes =
            section.children().filter(|n| n.has_tag_name("DataArray") || n.has_tag_name("Array"));
        let mut arrays: Vec<StoredArray> = Vec::new();
        for node in nodes {
            let Some(description) = array_description(node)? else { return Ok(None) };
            // Several time steps of one array.
            if arrays.iter().any(|a| a.name == description.0) {
                return Ok(None);
            }
            let Some(place) = self.place(node) else { return Ok(None) };
            match StoredArray::open(place, self.encoding, description)? {
                Some(array) => arrays.push(array),
                None => return Ok(None),
            }
        }
        Ok(Some(arrays))
    }

    fn place(&self, node: Node<'_, '_>) -> Option<Place> {
        let file = Arc::clone(&self.file);
        match node.attribute("format")? {
            "appended" => {
                let offset = node.attribute("offset")?.trim().parse::<u64>().ok()?;
                let start = self.appended?.checked_add(offset).filter(|&s| s <= self.length)?;
                let length = self.length - start;
                Some(Place { file, start, length, base64: !self.appended_is_raw })
            }
            "binary" => {
                // As `outline` leaves it.
                let (start, length) = node.text()?.split_once(' ')?;
                let (start, length) = (start.parse().ok()?, length.parse().ok()?);
                Place { file, start, length, base64: true }.without_white_space()
            }
            _ => None,
        }
    }
}
