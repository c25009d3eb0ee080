//! Finite elements of Tecplot as VTK's cells.

use crate::model::Cells;
use crate::model::shape_of_faces::{HEXAHEDRON, PYRAMID, TETRA, WEDGE};

/// A kind of element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Element {
    Line,
    Triangle,
    Quad,
    Tetra,
    Brick,
}

impl Element {
    /// Number of corners.
    pub(super) fn corners(self) -> usize {
        match self {
            Element::Line => 2,
            Element::Triangle => 3,
            Element::Quad | Element::Tetra => 4,
            Element::Brick => 8,
        }
    }

    /// The kind with this name, with or without `FE`.
    pub(super) fn named(name: &str) -> Option<Element> {
        let name = name.to_ascii_uppercase();
        Some(match name.strip_prefix("FE").unwrap_or(&name) {
            "LINESEG" => Element::Line,
            "TRIANGLE" => Element::Triangle,
            "QUADRILATERAL" => Element::Quad,
            "TETRAHEDRON" => Element::Tetra,
            "BRICK" => Element::Brick,
            _ => return None,
        })
    }
}

const LINE: u8 = 3;
const TRIANGLE: u8 = 5;
const QUAD: u8 = 9;

/// The elements as cells. Tecplot has no wedges and pyramids: solvers write them as bricks with
/// corners that coincide, and triangles among quads with the last corner twice.
pub(super) fn cells_of(kind: Element, ids: &[u32]) -> (Cells, Vec<u8>) {
    let mut cells = Cells::new();
    let mut types = Vec::with_capacity(ids.len() / kind.corners());
    for e in ids.chunks_exact(kind.corners()) {
        let (cell_type, corners) = match kind {
            Element::Line => (LINE, e.to_vec()),
            Element::Triangle => (TRIANGLE, e.to_vec()),
            Element::Tetra => (TETRA, e.to_vec()),
            Element::Quad if e[2] == e[3] => (TRIANGLE, e[..3].to_vec()),
            Element::Quad => (QUAD, e.to_vec()),
            Element::Brick => brick(e),
        };
        types.push(cell_type);
        cells.push(corners);
    }
    (cells, types)
}

/// The shape that a brick collapses to.
fn brick(e: &[u32]) -> (u8, Vec<u32>) {
    let apex = e[4] == e[5] && e[5] == e[6] && e[6] == e[7];
    match (e[2] == e[3], apex, e[6] == e[7]) {
        (true, true, _) => (TETRA, vec![e[0], e[1], e[2], e[4]]),
        (false, true, _) => (PYRAMID, vec![e[0], e[1], e[2], e[3], e[4]]),
        // VTK's wedge has the first triangle seen from outside, the brick its base from inside.
        (true, false, true) => (WEDGE, vec![e[0], e[2], e[1], e[4], e[6], e[5]]),
        _ => (HEXAHEDRON, e.to_vec()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::CellType;

    #[test]
    fn bricks_with_corners_that_coincide_become_the_shape_they_are() {
        let p: [[f64; 3]; 8] = [
            [0., 0., 0.],
            [1., 0., 0.],
            [1., 1., 0.],
            [0., 1., 0.],
            [0., 0., 1.],
            [1., 0., 1.],
            [1., 1., 1.],
            [0., 1., 1.],
        ];
        for (ids, kind, volume) in [
            ([0, 1, 2, 3, 4, 5, 6, 7], HEXAHEDRON, 1.0),
            ([0, 1, 2, 2, 4, 5, 6, 6], WEDGE, 0.5),
            ([0, 1, 2, 3, 4, 4, 4, 4], PYRAMID, 1.0 / 3.0),
            ([0, 1, 2, 2, 4, 4, 4, 4], TETRA, 1.0 / 6.0),
        ] {
            let (cells, types) = cells_of(Element::Brick, &ids);
            assert_eq!(types, [kind]);
            let CellType::Solid(faces) = CellType::of(kind) else { panic!() };
            // The divergence theorem over fans of the outward faces.
            let mut sum = 0.0;
            for face in faces {
                let at = |k: usize| glam::DVec3::from(p[cells.get(0)[face[k] as usize] as usize]);
                for k in 2..face.len() {
                    sum += at(0).dot(at(k - 1).cross(at(k))) / 6.0;
                }
            }
            assert!((sum - volume).abs() < 1e-15, "{kind}: {sum}");
        }
    }
}
