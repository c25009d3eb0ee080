//! The mesh of a case: faces, and the cells on their two sides.

use super::text::FoamFile;
use crate::model::{Cells, DataArray, Values, WALL_POINTS, is_name_of_body};
use crate::read::ReadError;
use crate::read::error::{At, BROKEN, Fault};
use std::collections::HashMap;

/// Stands for the missing cell behind a face of the boundary.
pub(super) const NO_CELL: u32 = u32::MAX;

/// A mesh of polyhedra, by its faces.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct PolyMesh {
    pub(super) points: Vec<[f64; 3]>,
    pub(super) faces: Cells,
    /// The cell on the side away from which the normal of a face points.
    pub(super) owner: Vec<u32>,
    /// The cell on the other side, or [`NO_CELL`].
    pub(super) neighbour: Vec<u32>,
    pub(super) cells: usize,
    pub(super) patches: Vec<Patch>,
}

/// Faces of the boundary with one role.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Patch {
    pub(super) name: String,
    /// `wall`, `patch`, `empty`, `wedge`, `processor` and so on.
    pub(super) kind: String,
    pub(super) faces: std::ops::Range<usize>,
}

impl Patch {
    /// Whether the patch is a body: by its type, or by its name where cases of inviscid flows give
    /// bodies the type of any patch or of a symmetry.
    pub(super) fn is_wall(&self) -> bool {
        let kind = self.kind.to_lowercase();
        let any = ["patch", "slip", "symmetry", "symmetryplane"].contains(&kind.as_str());
        kind.contains("wall") || any && is_name_of_body(&self.name)
    }
}

/// The list of the points of walls as field data.
pub(super) fn wall_points(ids: impl Iterator<Item = u32>) -> DataArray {
    DataArray::new(WALL_POINTS, 1, Values::U32(ids.collect()))
}

impl PolyMesh {
    /// Flag per point: whether it is one of a wall.
    pub(super) fn wall_points(&self) -> Vec<bool> {
        let mut is_wall = vec![false; self.points.len()];
        for patch in self.patches.iter().filter(|p| p.is_wall()) {
            for face in patch.faces.clone() {
                self.faces.get(face).iter().for_each(|&k| is_wall[k as usize] = true);
            }
        }
        is_wall
    }

    /// Reads the five files, which `open` opens.
    pub(super) fn read(
        open: impl Fn(&str) -> Result<FoamFile, ReadError>,
    ) -> Result<PolyMesh, ReadError> {
        let mut f = open("points")?;
        let points = f.tuples(3, None).map_err(|e| f.fault(e))?;
        let points: Vec<[f64; 3]> =
            (0..points.len() / 3).map(|i| [0, 1, 2].map(|c| points.get_f64(3 * i + c))).collect();
        let mut f = open("faces")?;
        let faces = read_faces(&mut f, points.len()).map_err(|e| f.fault(e))?;
        let mut f = open("owner")?;
        let owner =
            f.labels().and_then(|l| labels(l, faces.len(), true)).map_err(|e| f.fault(e))?;
        let mut f = open("neighbour")?;
        let inner =
            f.labels().and_then(|l| labels(l, faces.len(), false)).map_err(|e| f.fault(e))?;
        let most = owner.iter().chain(&inner).max().map_or(0, |m| *m as usize + 1);
        // Each cell has four faces or more.
        if most > (owner.len() + inner.len()) / 4 {
            let what = format!("cell {} with {} faces in all", most - 1, owner.len());
            return Err(f.fault(Fault::field("owner and neighbour", what)));
        }
        let mut neighbour = inner;
        neighbour.resize(faces.len(), NO_CELL);
        let mut f = open("boundary")?;
        let patches = read_patches(&mut f, faces.len()).map_err(|e| f.fault(e))?;
        Ok(PolyMesh { points, faces, owner, neighbour, cells: most, patches })
    }

    /// The parts of a decomposed mesh as one. Points on the faces between them become one; the
    /// faces stay, once for each side.
    pub(super) fn join(parts: Vec<PolyMesh>) -> PolyMesh {
        if parts.len() == 1 {
            return parts.into_iter().next().unwrap_or_default();
        }
        let mut whole = PolyMesh::default();
        let mut shared: HashMap<[u64; 3], u32> = HashMap::new();
        for part in parts {
            let mut between = vec![false; part.points.len()];
            for patch in part.patches.iter().filter(|p| p.kind.starts_with("processor")) {
                for face in patch.faces.clone() {
                    part.faces.get(face).iter().for_each(|&k| between[k as usize] = true);
                }
            }
            let mut add = |p: [f64; 3]| {
                whole.points.push(p);
                whole.points.len() as u32 - 1
            };
            let ids: Vec<u32> = part
                .points
                .iter()
                .zip(&between)
                .map(|(&p, between)| {
                    if !between {
                        return add(p);
                    }
                    // decomposePar copies coordinates bit by bit; adding zero makes -0 the same
                    // place as 0.
                    *shared.entry(p.map(|x| (x + 0.0).to_bits())).or_insert_with(|| add(p))
                })
                .collect();
            let (first_face, first_cell) = (whole.faces.len(), whole.cells as u32);
            for face in part.faces.iter() {
                whole.faces.push(face.iter().map(|&k| ids[k as usize]));
            }
            whole.owner.extend(part.owner.iter().map(|c| c + first_cell));
            let shift = |c: &u32| if *c == NO_CELL { NO_CELL } else { c + first_cell };
            whole.neighbour.extend(part.neighbour.iter().map(shift));
            whole.cells += part.cells;
            whole.patches.extend(part.patches.into_iter().map(|p| Patch {
                faces: p.faces.start + first_face..p.faces.end + first_face,
                ..p
            }));
        }
        whole
    }

    /// The faces of each cell, in the order of their numbers.
    pub(super) fn faces_of_cells(&self) -> Cells {
        let mut starts = vec![0usize; self.cells + 1];
        let sides = || self.owner.iter().zip(&self.neighbour).enumerate();
        for (_, (&o, &n)) in sides() {
            starts[o as usize + 1] += 1;
            if n != NO_CELL {
                starts[n as usize + 1] += 1;
            }
        }
        for c in 0..self.cells {
            starts[c + 1] += starts[c];
        }
        let mut list = vec![0u32; starts[self.cells]];
        let mut next = starts.clone();
        for (face, (&o, &n)) in sides() {
            for c in [o, n].into_iter().filter(|c| *c != NO_CELL) {
                list[next[c as usize]] = face as u32;
                next[c as usize] += 1;
            }
        }
        let ends = starts[1..].iter().map(|&e| e as i64);
        Cells::from_ends(ends, list).unwrap_or_default()
    }

    /// Appends the corners of a face as `cell` sees it: counter-clockwise from outside.
    pub(super) fn outward(&self, face: usize, cell: u32, out: &mut Vec<u32>) {
        let ids = self.faces.get(face);
        if self.owner[face] == cell {
            out.extend(ids);
        } else {
            out.extend(ids.iter().rev());
        }
    }
}

fn read_faces(file: &mut FoamFile, points: usize) -> Result<Cells, Fault> {
    let mut faces = Cells::new();
    for (i, ids) in file.faces()?.into_iter().enumerate() {
        if ids.len() < 3 {
            let what = format!("face {i} has {} points", ids.len());
            return Err(Fault::new(file.at(), what, BROKEN));
        }
        if let Some(id) = ids.iter().find(|&&id| id < 0 || id >= points as i64) {
            let what = format!("face {i} has point {id} of {points}");
            return Err(Fault::new(file.at(), what, BROKEN));
        }
        faces.push(ids.into_iter().map(Cells::id));
    }
    Ok(faces)
}

/// Cells of faces.
fn labels(list: Vec<i64>, faces: usize, all: bool) -> Result<Vec<u32>, Fault> {
    let at = || At::Field(if all { "owner" } else { "neighbour" }.into());
    if list.len() > faces || all && list.len() != faces {
        let what = format!("{} labels for {faces} faces", list.len());
        return Err(Fault::new(at(), what, BROKEN));
    }
    let cell = |(i, &c): (usize, &i64)| match u32::try_from(c) {
        Ok(c) if c != NO_CELL => Ok(c),
        _ => Err(Fault::new(at(), format!("face {i} has cell {c}"), BROKEN)),
    };
    // Some versions write -1 for the neighbours of faces of the boundary.
    let end = list.iter().position(|&c| !all && c == -1).unwrap_or(list.len());
    list[..end].iter().enumerate().map(cell).collect()
}

fn read_patches(file: &mut FoamFile, faces: usize) -> Result<Vec<Patch>, Fault> {
    let length = file.list_of_entries()?;
    file.items(length, |file| {
        let name = file.word().unwrap_or_default();
        let (mut kind, mut count, mut start) = (String::new(), None, None);
        file.expect(b'{')?;
        loop {
            let Some(key) = file.word() else { return Err(file.unexpected("a patch")) };
            match key.as_str() {
                "}" => break,
                "type" => kind = file.word().unwrap_or_default(),
                "nFaces" => count = Some(file.number::<usize>("a number of faces")?),
                "startFace" => start = Some(file.number::<usize>("the number of a face")?),
                _ => {
                    file.skip_value()?;
                    continue;
                }
            }
            file.expect(b';')?;
        }
        let (Some(count), Some(start)) = (count, start) else {
            let what = format!("patch `{name}` lacks nFaces or startFace");
            return Err(Fault::new(file.at(), what, BROKEN));
        };
        match start.checked_add(count) {
            Some(end) if end <= faces => Ok(Patch { name, kind, faces: start..end }),
            _ => {
                let what = format!("patch `{name}`: {count} faces from {start} on, of {faces}");
                Err(Fault::new(file.at(), what, BROKEN))
            }
        }
    })
}
