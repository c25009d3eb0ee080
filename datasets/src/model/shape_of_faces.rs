//! The shape of a cell by its faces: tetrahedra, hexahedra, wedges and pyramids have a name.

use super::Cells;

/// VTK's numbers of the linear solids.
pub(crate) const TETRA: u8 = 10;
pub(crate) const HEXAHEDRON: u8 = 12;
pub(crate) const WEDGE: u8 = 13;
pub(crate) const PYRAMID: u8 = 14;
/// VTK's number of a cell that is given by its faces.
pub(crate) const POLYHEDRON: u8 = 42;

/// The points of a cell, each once, in the order of its faces.
pub(crate) fn distinct(faces: &Cells) -> Vec<u32> {
    let mut ids: Vec<u32> = Vec::new();
    for &id in faces.connectivity() {
        if !ids.contains(&id) {
            ids.push(id);
        }
    }
    ids
}

/// VTK's type and order of the points, if the faces (outward) are those of a named shape.
pub(crate) fn named(faces: &Cells) -> Option<(u8, Vec<u32>)> {
    let with = |n: usize| faces.iter().filter(move |f| f.len() == n);
    let counts = (with(3).count(), with(4).count());
    if faces.len() > 6 || counts.0 + counts.1 != faces.len() {
        return None;
    }
    let ids = distinct(faces);
    match (counts, ids.len()) {
        ((4, 0), 4) => {
            let base = faces.get(0);
            let apex = ids.iter().find(|id| !base.contains(id))?;
            Some((TETRA, vec![base[0], base[2], base[1], *apex]))
        }
        ((0, 6), 8) => {
            let b = faces.get(0);
            let base = [b[0], b[3], b[2], b[1]];
            Some((HEXAHEDRON, prism(&base, faces)?))
        }
        ((2, 3), 6) => {
            let b = with(3).next()?;
            Some((WEDGE, prism(&[b[0], b[1], b[2]], faces)?))
        }
        ((4, 1), 5) => {
            let b = with(4).next()?;
            let apex = ids.iter().find(|id| !b.contains(id))?;
            Some((PYRAMID, vec![b[0], b[3], b[2], b[1], *apex]))
        }
        _ => None,
    }
}

/// The corners of a base, then those across from them; `None` if these do not form one face.
fn prism(base: &[u32], faces: &Cells) -> Option<Vec<u32>> {
    let mut ids = base.to_vec();
    for &corner in base {
        let mut across = None;
        for face in faces.iter() {
            let Some(at) = face.iter().position(|&id| id == corner) else { continue };
            for next in [face[(at + 1) % face.len()], face[(at + face.len() - 1) % face.len()]] {
                if !base.contains(&next) && *across.get_or_insert(next) != next {
                    return None;
                }
            }
        }
        ids.push(across?);
    }
    let top = &ids[base.len()..];
    let is_top = |f: &[u32]| f.len() == base.len() && f.iter().all(|id| top.contains(id));
    let differ = top.iter().enumerate().all(|(i, id)| !top[..i].contains(id));
    (differ && faces.iter().any(is_top)).then_some(ids)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::CellType;

    /// The faces of a shape, from [`CellType`]'s table of outward faces.
    fn faces(kind: u8) -> Cells {
        let CellType::Solid(table) = CellType::of(kind) else { panic!("{kind} is no solid") };
        let mut faces = Cells::new();
        table.iter().for_each(|f| faces.push(f.iter().map(|&k| u32::from(k) + 10)));
        faces
    }

    #[test]
    fn shapes_are_found_with_outward_faces_whatever_the_order() {
        for kind in [TETRA, HEXAHEDRON, WEDGE, PYRAMID] {
            let original = faces(kind);
            for turn in 0..original.len() {
                let mut turned = Cells::new();
                for i in 0..original.len() {
                    let face = original.get((i + turn) % original.len());
                    turned.push((0..face.len()).map(|k| face[(k + turn) % face.len()]));
                }
                let (found, ids) = named(&turned).expect("a shape");
                assert_eq!(found, kind);
                // The faces by the table are those given, with the same direction.
                let CellType::Solid(table) = CellType::of(kind) else { unreachable!() };
                for face in table {
                    let face: Vec<u32> = face.iter().map(|&k| ids[k as usize]).collect();
                    let same = |f: &[u32]| {
                        (0..face.len()).any(|s| {
                            f.len() == face.len()
                                && (0..face.len()).all(|k| f[(k + s) % f.len()] == face[k])
                        })
                    };
                    assert!(original.iter().any(same), "{kind}, turned by {turn}: {face:?}");
                }
            }
        }
    }

    #[test]
    fn other_cells_with_as_many_faces_stay_polyhedra() {
        // Six quads, but two corners of a face are split: a face has five corners.
        let mut cube = Cells::new();
        for (i, f) in faces(HEXAHEDRON).iter().enumerate() {
            let more = if i == 0 { vec![99] } else { vec![] };
            cube.push(f.iter().copied().chain(more));
        }
        assert_eq!(named(&cube), None);
        assert_eq!(named(&faces(15)), None);
    }
}
