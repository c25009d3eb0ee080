//! Cells of legacy files: counted lists up to version 4, offsets and connectivity from version 5.

use super::arrays::Input;
use crate::model::{Cells, UnstructuredGrid};
use crate::read::error::{BROKEN, Fault};
use crate::read::vtk_xml::pieces::{face_stream, integers};

const POLYHEDRON: u8 = 42;

impl Input<'_> {
    /// The cells after one of the keywords VERTICES, LINES, POLYGONS, TRIANGLE_STRIPS and CELLS.
    pub(super) fn cells(&mut self, keyword: &str) -> Result<Cells, Fault> {
        let at = self.cursor.at();
        let number = self.count("number of cells")?;
        let size = self.count("size of the cell list")?;
        if self.offsets_and_connectivity && self.peek().eq_ignore_ascii_case("OFFSETS") {
            self.cursor.word();
            let ty = self.type_word()?;
            let offsets = self.values(&ty, number, "offsets")?;
            if !self.peek().eq_ignore_ascii_case("CONNECTIVITY") {
                return Err(Fault::new(
                    self.cursor.at(),
                    format!("{keyword}: CONNECTIVITY is missing"),
                    BROKEN,
                ));
            }
            self.cursor.word();
            let ty = self.type_word()?;
            let ids = self.values(&ty, size, "point ids")?;
            let ids = integers(&ids).map(Cells::id).collect();
            // The first offset is 0 and is not the end of a cell.
            return Cells::from_ends(integers(&offsets).skip(1), ids).map_err(|bad| {
                let what = format!(
                    "{keyword}: cell {} ends at {}, outside {:?}",
                    bad.cell, bad.end, bad.allowed
                );
                Fault::new(at, what, BROKEN)
            });
        }
        let list = self.values("int", size, "numbers of the cell list")?;
        let mut cells = Cells::new();
        let mut numbers = integers(&list);
        for cell in 0..number {
            let n =
                numbers.next().and_then(|n| usize::try_from(n).ok()).filter(|&n| n <= list.len());
            let ids: Option<Vec<u32>> =
                n.and_then(|n| (0..n).map(|_| numbers.next().map(Cells::id)).collect());
            let Some(ids) = ids else {
                let what = format!(
                    "{keyword}: cell {cell} of {number} does not fit in the list of {size} numbers"
                );
                return Err(Fault::new(at, what, BROKEN));
            };
            cells.push(ids);
        }
        Ok(cells)
    }

    /// The list after CELL_TYPES.
    pub(super) fn cell_types(&mut self) -> Result<Vec<u8>, Fault> {
        let n = self.count("number of cell types")?;
        let values = self.values("int", n, "cell types")?;
        Ok(integers(&values).map(|t| u8::try_from(t).unwrap_or(u8::MAX)).collect())
    }
}

impl UnstructuredGrid {
    /// In legacy files the "point ids" of a polyhedron are its faces: their number, then the size
    /// and ids of each. Moves them to the list of faces; the cell gets the distinct points of its
    /// faces.
    pub(super) fn split_polyhedra(&mut self) -> Result<(), Fault> {
        if !self.types.contains(&POLYHEDRON) || !self.faces_of_cell.is_empty() {
            return Ok(());
        }
        let mut cells = Cells::new();
        for i in 0..self.cells.len() {
            let first = self.polyhedron_faces.len();
            let ids = self.cells.get(i);
            if self.types.get(i) != Some(&POLYHEDRON) {
                cells.push(ids.iter().copied());
            } else {
                let stream: Vec<i64> = ids.iter().map(|&k| i64::from(k)).collect();
                if face_stream(&stream, &mut self.polyhedron_faces).is_none() {
                    return Err(Fault::field(
                        "CELLS",
                        format!("the faces of polyhedron {i} do not add up"),
                    ));
                }
                let mut points: Vec<u32> = Vec::new();
                for f in first..self.polyhedron_faces.len() {
                    points.extend(self.polyhedron_faces.get(f));
                }
                points.sort_unstable();
                points.dedup();
                cells.push(points);
            }
            self.faces_of_cell.push(first..self.polyhedron_faces.len());
        }
        self.cells = cells;
        Ok(())
    }
}
