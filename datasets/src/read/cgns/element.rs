//! Elements of CGNS as VTK's cells.
//!
//! Source: SIDS, section 3.3 "Unstructured Grid Element Numbering Conventions", and VTK's
//! `vtkCellType.h` for the order of the nodes.

use crate::model::shape_of_faces::{HEXAHEDRON, PYRAMID, TETRA, WEDGE};
use crate::model::{Cells, Points};
use crate::read::wedge;

pub(super) const MIXED: i64 = 20;
pub(super) const NGON: i64 = 22;
pub(super) const NFACE: i64 = 23;

/// A kind of element with a fixed number of nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) name: &'static str,
    /// Number of nodes in the file.
    pub(super) nodes: usize,
    /// How many of them the cell has. The others are inner nodes, or those of cubic and quartic
    /// elements, of which VTK has other kinds: they are used by their corners.
    pub(super) kept: usize,
    /// 0 to 3: a node, a line, a face, a solid.
    pub(super) axes: usize,
    vtk: u8,
}

const LINE: u8 = 3;
const TRIANGLE: u8 = 5;
const QUAD: u8 = 9;
const QUADRATIC_HEXA: u8 = 25;
const QUADRATIC_WEDGE: u8 = 26;
const TRIQUADRATIC_HEXA: u8 = 29;
const BIQUADRATIC_WEDGE: u8 = 32;

impl Element {
    /// The kind with this number in the enumeration `ElementType_t`.
    pub(super) fn of(number: i64) -> Option<Element> {
        let (name, nodes, kept, axes, vtk) = match number {
            2 => ("NODE", 1, 1, 0, 1),
            3 => ("BAR_2", 2, 2, 1, LINE),
            4 => ("BAR_3", 3, 3, 1, 21),
            5 => ("TRI_3", 3, 3, 2, TRIANGLE),
            6 => ("TRI_6", 6, 6, 2, 22),
            7 => ("QUAD_4", 4, 4, 2, QUAD),
            8 => ("QUAD_8", 8, 8, 2, 23),
            9 => ("QUAD_9", 9, 9, 2, 28),
            10 => ("TETRA_4", 4, 4, 3, TETRA),
            11 => ("TETRA_10", 10, 10, 3, 24),
            12 => ("PYRA_5", 5, 5, 3, PYRAMID),
            13 => ("PYRA_14", 14, 13, 3, 27),
            14 => ("PENTA_6", 6, 6, 3, WEDGE),
            15 => ("PENTA_15", 15, 15, 3, QUADRATIC_WEDGE),
            16 => ("PENTA_18", 18, 18, 3, BIQUADRATIC_WEDGE),
            17 => ("HEXA_8", 8, 8, 3, HEXAHEDRON),
            18 => ("HEXA_20", 20, 20, 3, QUADRATIC_HEXA),
            19 => ("HEXA_27", 27, 27, 3, TRIQUADRATIC_HEXA),
            21 => ("PYRA_13", 13, 13, 3, 27),
            24 => ("BAR_4", 4, 2, 1, LINE),
            25 => ("TRI_9", 9, 3, 2, TRIANGLE),
            26 => ("TRI_10", 10, 3, 2, TRIANGLE),
            27 => ("QUAD_12", 12, 4, 2, QUAD),
            28 => ("QUAD_16", 16, 4, 2, QUAD),
            29 => ("TETRA_16", 16, 4, 3, TETRA),
            30 => ("TETRA_20", 20, 4, 3, TETRA),
            31 => ("PYRA_21", 21, 5, 3, PYRAMID),
            32 => ("PYRA_29", 29, 5, 3, PYRAMID),
            33 => ("PYRA_30", 30, 5, 3, PYRAMID),
            34 => ("PENTA_24", 24, 6, 3, WEDGE),
            35 => ("PENTA_38", 38, 6, 3, WEDGE),
            36 => ("PENTA_40", 40, 6, 3, WEDGE),
            37 => ("HEXA_32", 32, 8, 3, HEXAHEDRON),
            38 => ("HEXA_56", 56, 8, 3, HEXAHEDRON),
            39 => ("HEXA_64", 64, 8, 3, HEXAHEDRON),
            40 => ("BAR_5", 5, 2, 1, LINE),
            41 => ("TRI_12", 12, 3, 2, TRIANGLE),
            42 => ("TRI_15", 15, 3, 2, TRIANGLE),
            43 => ("QUAD_P4_16", 16, 4, 2, QUAD),
            44 => ("QUAD_25", 25, 4, 2, QUAD),
            45 => ("TETRA_22", 22, 4, 3, TETRA),
            46 => ("TETRA_34", 34, 4, 3, TETRA),
            47 => ("TETRA_35", 35, 4, 3, TETRA),
            48 => ("PYRA_P4_29", 29, 5, 3, PYRAMID),
            49 => ("PYRA_50", 50, 5, 3, PYRAMID),
            50 => ("PYRA_55", 55, 5, 3, PYRAMID),
            51 => ("PENTA_33", 33, 6, 3, WEDGE),
            52 => ("PENTA_66", 66, 6, 3, WEDGE),
            53 => ("PENTA_75", 75, 6, 3, WEDGE),
            54 => ("HEXA_44", 44, 8, 3, HEXAHEDRON),
            55 => ("HEXA_98", 98, 8, 3, HEXAHEDRON),
            56 => ("HEXA_125", 125, 8, 3, HEXAHEDRON),
            _ => return None,
        };
        Some(Element { name, nodes, kept, axes, vtk })
    }

    /// Appends the cell with these nodes, which count from 1.
    pub(super) fn push(
        self,
        nodes: &[i64],
        points: &Points,
        cells: &mut Cells,
        types: &mut Vec<u8>,
    ) {
        let id = |k: usize| Cells::id(nodes[k].saturating_sub(1));
        types.push(self.vtk);
        let is_wedge = matches!(self.vtk, WEDGE | QUADRATIC_WEDGE | BIQUADRATIC_WEDGE);
        let ids: Vec<u32> = (0..self.kept).map(|k| id(self.place(k))).collect();
        // In the SIDS the first triangle is seen from inside, and some programs write it as VTK
        // has it.
        if is_wedge && wedge::is_turned(&ids, points) {
            cells.push(wedge::TURNED[..self.kept].iter().map(|&k| ids[k]));
        } else {
            cells.push(ids);
        }
    }

    /// Which node of CGNS is node `k` of VTK: VTK has the middles of the upper edges before those
    /// of the vertical ones, and the faces of a hexahedron along x, y and z.
    fn place(self, k: usize) -> usize {
        match (self.vtk, k) {
            (QUADRATIC_HEXA | TRIQUADRATIC_HEXA, 12..=15) => k + 4,
            (QUADRATIC_HEXA | TRIQUADRATIC_HEXA, 16..=19) => k - 4,
            (TRIQUADRATIC_HEXA, 20..=25) => [24, 22, 21, 23, 20, 25][k - 20],
            (QUADRATIC_WEDGE | BIQUADRATIC_WEDGE, 9..=11) => k + 3,
            (QUADRATIC_WEDGE | BIQUADRATIC_WEDGE, 12..=14) => k - 3,
            _ => k,
        }
    }
}
