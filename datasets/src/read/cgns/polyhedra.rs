//! Polyhedra: faces (`NGON_n`) and the cells on their two sides, by `NFACE_n` or by the parents of
//! the faces.

use super::connectivity::Section;
use super::element::NGON;
use crate::model::shape_of_faces::{POLYHEDRON, distinct, named};
use crate::model::{Cells, Points, UnstructuredGrid};
use crate::read::error::Fault;
use glam::DVec3;

/// The faces of a zone.
#[derive(Default)]
pub(super) struct Faces {
    points: Cells,
    /// In how many cells each is: a face that many cells name would make a small file large.
    used: Vec<u8>,
    /// Number of the first and behind the last element of each section, and its first face here.
    ranges: Vec<(i64, i64, usize)>,
}

/// For each cell its faces: the number of a face here, and whether its normal points outward.
pub(super) type FacesOfCells = Vec<Vec<(u32, bool)>>;

impl Faces {
    pub(super) fn new(sections: &[Section], points: usize) -> Result<Faces, Fault> {
        let mut faces = Faces::default();
        for section in sections.iter().filter(|s| s.kind == NGON) {
            faces.ranges.push((section.range[0], section.range[1] + 1, faces.points.len()));
            for nodes in section.lists()?.iter() {
                let exists = |n: &&i64| **n >= 1 && **n as u64 <= points as u64;
                if let Some(wrong) = nodes.iter().find(|n| !exists(n)) {
                    let what = format!("a face has point {wrong}, of {points}");
                    return Err(section.node.fault(what));
                }
                faces.points.push(nodes.iter().map(|n| Cells::id(n - 1)));
            }
        }
        faces.used = vec![0; faces.points.len()];
        Ok(faces)
    }

    /// The face with this element number.
    fn find(&self, number: i64) -> Option<u32> {
        let at = self.ranges.partition_point(|r| r.1 <= number);
        let (first, _, face) = *self.ranges.get(at)?;
        u32::try_from(number.checked_sub(first).filter(|n| *n >= 0)? as usize + face).ok()
    }

    /// The cells of an `NFACE_n` section: numbers of faces, negative if the normal points inward.
    pub(super) fn of_section(&mut self, section: &Section) -> Result<FacesOfCells, Fault> {
        let own = section.own();
        // The lists first: they show that the file has as many cells as its range says.
        let lists = section.lists()?;
        let mut out = Vec::with_capacity(own.len());
        for list in lists.iter().skip(own.start).take(own.len()) {
            let mut cell = Vec::with_capacity(list.len());
            for &number in list {
                let face = number.checked_abs().and_then(|n| self.find(n));
                let Some(face) = face else {
                    return Err(section.node.fault(format!("a cell has face {number}")));
                };
                let times = &mut self.used[face as usize];
                *times += 1;
                if *times > 2 {
                    let what = format!("face {} belongs to three cells", number.abs());
                    return Err(section.node.fault(what));
                }
                cell.push((face, number > 0));
            }
            out.push(cell);
        }
        Ok(out)
    }

    /// The cells by the parents of the faces: the normal of a face points from the first to the
    /// second. `None` without parents.
    pub(super) fn of_parents(&self, sections: &[Section]) -> Result<Option<FacesOfCells>, Fault> {
        let mut sides = Vec::new();
        let mut node = None;
        for section in sections.iter().filter(|s| s.kind == NGON) {
            let Some(parents) = section.parents()? else { return Ok(None) };
            let (first, second) = parents.split_at(section.len());
            sides.extend(first.iter().copied().zip(second.iter().copied()));
            node = Some(&section.node);
        }
        let both = || sides.iter().flat_map(|s| [s.0, s.1]).filter(|p| *p > 0);
        // Parents are numbers of elements: cells come before or after the faces.
        let (Some(low), Some(high), Some(node)) = (both().min(), both().max(), node) else {
            return Ok(None);
        };
        // Each cell has four faces or more.
        let count = high - low + 1;
        if count as u64 > sides.len() as u64 / 2 + 1 {
            let what = format!("{count} cells with {} faces in all", sides.len());
            return Err(node.fault(what));
        }
        let mut cells: FacesOfCells = vec![Vec::new(); count as usize];
        for (face, (first, second)) in sides.iter().enumerate() {
            for (parent, outward) in [(first, true), (second, false)] {
                if *parent > 0 {
                    cells[(parent - low) as usize].push((face as u32, outward));
                }
            }
        }
        Ok(Some(cells))
    }
}

/// Appends cells, as the shapes with a name that they are, or as polyhedra.
pub(super) fn push(
    faces: &Faces,
    cells: &FacesOfCells,
    section: &Section,
    grid: &mut UnstructuredGrid,
    warnings: &mut Vec<String>,
) -> Result<(), Fault> {
    let end = grid.polyhedron_faces.len();
    grid.faces_of_cell.resize(grid.types.len(), end..end);
    let mut turned = 0usize;
    let mut own = Cells::new();
    for cell in cells {
        own.clear();
        for &(face, outward) in cell {
            let ids = faces.points.get(face as usize);
            match outward {
                true => own.push(ids.iter().copied()),
                false => own.push(ids.iter().rev().copied()),
            }
        }
        if !is_closed(&own) {
            turned += 1;
            turn_outward(&mut own, &grid.points);
        } else if is_inward(&own, &grid.points) {
            turned += 1;
            turn_all(&mut own);
        }
        let first = grid.polyhedron_faces.len();
        match named(&own) {
            Some((kind, ids)) => {
                grid.types.push(kind);
                grid.cells.push(ids);
            }
            None => {
                grid.types.push(POLYHEDRON);
                grid.cells.push(distinct(&own));
                own.iter().for_each(|f| grid.polyhedron_faces.push(f.iter().copied()));
            }
        }
        grid.faces_of_cell.push(first..grid.polyhedron_faces.len());
    }
    if turned > 0 {
        let path = &section.node.path;
        warnings.push(format!("`{path}`: {turned} cells had faces whose signs are wrong: turned"));
    }
    if grid.polyhedron_faces.is_empty() {
        grid.faces_of_cell.clear();
    }
    Ok(())
}

/// Whether each edge has a face on either side, in opposite directions.
fn is_closed(faces: &Cells) -> bool {
    let edges = |f: &[u32]| -> Vec<(u32, u32)> {
        (0..f.len()).map(|k| (f[k], f[(k + 1) % f.len()])).collect()
    };
    let mut forward: Vec<(u32, u32)> = faces.iter().flat_map(edges).collect();
    let mut backward: Vec<(u32, u32)> = forward.iter().map(|e| (e.1, e.0)).collect();
    forward.sort_unstable();
    backward.sort_unstable();
    forward == backward && forward.windows(2).all(|w| w[0] != w[1])
}

/// The middle of the corners of a cell, and of a face its middle and normal.
fn middle(ids: &[u32], points: &Points) -> DVec3 {
    let sum: DVec3 = ids.iter().map(|&k| points.get(k as usize)).sum();
    sum / ids.len().max(1) as f64
}

fn outward_by(face: &[u32], centre: DVec3, points: &Points) -> f64 {
    let at = |k: usize| points.get(face[k % face.len()] as usize) - centre;
    let normal: DVec3 = (0..face.len()).map(|k| at(k).cross(at(k + 1))).sum();
    normal.dot(middle(face, points) - centre)
}

/// Whether the volume by the faces is negative.
fn is_inward(faces: &Cells, points: &Points) -> bool {
    let centre = middle(&distinct(faces), points);
    faces.iter().map(|f| outward_by(f, centre, points)).sum::<f64>() < 0.0
}

fn turn_all(faces: &mut Cells) {
    let mut out = Cells::new();
    faces.iter().for_each(|f| out.push(f.iter().rev().copied()));
    *faces = out;
}

/// Turns each face away from the middle of the cell.
fn turn_outward(faces: &mut Cells, points: &Points) {
    let centre = middle(&distinct(faces), points);
    let mut out = Cells::new();
    for f in faces.iter() {
        match outward_by(f, centre, points) < 0.0 {
            true => out.push(f.iter().rev().copied()),
            false => out.push(f.iter().copied()),
        }
    }
    *faces = out;
}
