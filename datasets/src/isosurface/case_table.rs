//! The 256 cases of a surface in a cell, derived from two rules rather than tabulated by hand.
//!
//! 1. **Segments on faces.** On each of the six faces, walking around it, every run of inside
//!    corners is cut off by one segment, from the edge where the walk enters the run to the edge
//!    where it leaves. On an ambiguous face (two inside corners on a diagonal), this *separates the
//!    inside corners*. Both cells at a face see the same corners and so agree, and the surface has
//!    no holes (the flaw of the original table: Dürst 1988; Nielson and Hamann 1991).
//! 2. **Triangulation of loops.** The segments join to closed loops. Each loop of n edges becomes
//!    n - 2 triangles. Among all triangulations, the one is chosen that has no diagonal in a face
//!    of the cell (the neighbour might have the same diagonal, and four triangles would meet at one
//!    edge) and the shortest diagonals otherwise.
//!
//! The number of triangles per case equals that of VTK's `vtkMarchingCubesTriangleCases`, so counts
//! agree with `vtkFlyingEdges3D`. The choice of diagonals differs from VTK's.

use std::sync::LazyLock;

/// Corner c of a cell is at (c & 1, c >> 1 & 1, c >> 2); an edge joins two corners. Edges 0..4 run
/// along x (rows (y,z) = 00, 10, 01, 11), 4..8 along y ((x,z) = 00, 10, 01, 11), 8..12 along z
/// ((x,y) = 00, 10, 01, 11).
pub(crate) const EDGE_CORNERS: [[u8; 2]; 12] = [
    [0, 1],
    [2, 3],
    [4, 5],
    [6, 7],
    [0, 2],
    [1, 3],
    [4, 6],
    [5, 7],
    [0, 4],
    [1, 5],
    [2, 6],
    [3, 7],
];

/// The corners of each face, counter-clockwise as seen from outside the cell.
const FACES: [[u8; 4]; 6] =
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// Maximum number of triangles per case, which a test verifies.
pub(crate) const MAX_TRIANGLES: usize = 5;

/// The triangles of one case.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Case {
    /// Bit e is set when edge e is crossed.
    pub(crate) crossed: u16,
    /// Number of entries of `triangles` in use.
    pub(crate) count: u8,
    /// Edge numbers, counter-clockwise as seen from the side where values are below the isovalue.
    pub(crate) triangles: [[u8; 3]; MAX_TRIANGLES],
}

/// Indexed by the inside corners: bit c is set when the value at corner c is at or above the
/// isovalue.
pub(crate) static CASES: LazyLock<[Case; 256]> =
    LazyLock::new(|| std::array::from_fn(|i| derive(i as u8)));

/// Edges that touch a missing corner, indexed by the missing corners (one bit each).
pub(crate) static EDGES_AT_CORNERS: LazyLock<[u16; 256]> = LazyLock::new(|| {
    std::array::from_fn(|corners| {
        let touches = |e: &usize| EDGE_CORNERS[*e].iter().any(|&c| corners >> c & 1 == 1);
        (0..12).filter(touches).fold(0, |mask, e| mask | 1 << e)
    })
});

fn derive(inside: u8) -> Case {
    let is_inside = |c: u8| inside >> c & 1 == 1;
    let mut case = Case::default();
    for (e, [a, b]) in EDGE_CORNERS.iter().enumerate() {
        case.crossed |= ((is_inside(*a) != is_inside(*b)) as u16) << e;
    }

    // Rule 1. The walks are counter-clockwise as seen from outside the cell. Each segment runs from
    // where a walk enters the inside to where it leaves, which makes the loops counter-clockwise as
    // seen from the low values (a test measures it).
    let mut next = [None; 12];
    for face in FACES {
        let corner = |i: usize| face[i % 4];
        for i in 0..4 {
            if !is_inside(corner(i)) && is_inside(corner(i + 1)) {
                let mut last = i + 1;
                while is_inside(corner(last + 1)) {
                    last += 1;
                }
                let entered = edge_between(corner(i), corner(i + 1));
                let left = edge_between(corner(last), corner(last + 1));
                next[entered as usize] = Some(left);
            }
        }
    }

    // Rule 2.
    let mut seen = 0u16;
    for start in 0..12u8 {
        let mut polygon = Vec::new();
        let mut e = start;
        while seen >> e & 1 == 0 {
            let Some(n) = next[e as usize] else { break };
            seen |= 1 << e;
            polygon.push(e);
            e = n;
        }
        if polygon.len() >= 3 {
            for t in best_triangulation(&polygon).1 {
                case.triangles[case.count as usize] = t;
                case.count += 1;
            }
        }
    }
    case
}

fn edge_between(a: u8, b: u8) -> u8 {
    let key = [a.min(b), a.max(b)];
    EDGE_CORNERS.iter().position(|e| *e == key).map_or(u8::MAX, |e| e as u8)
}

/// Diagonals inside faces, then the sum of squared diagonal lengths in quarter units.
type Cost = (u32, i32);

/// The cheapest triangulation of a polygon whose corners are edge midpoints: the triangle at the
/// polygon's closing edge splits the rest into two smaller polygons (there are at most 42
/// triangulations of a heptagon).
fn best_triangulation(polygon: &[u8]) -> (Cost, Vec<[u8; 3]>) {
    let n = polygon.len();
    if n < 3 {
        return ((0, 0), Vec::new());
    }
    let diagonal = |i: usize, j: usize| -> Cost {
        if j - i == 1 { (0, 0) } else { diagonal_cost(polygon[i], polygon[j]) }
    };
    (1..n - 1)
        .map(|apex| {
            let (left, right) =
                (best_triangulation(&polygon[..=apex]), best_triangulation(&polygon[apex..]));
            let (a, b) = (diagonal(0, apex), diagonal(apex, n - 1));
            let cost = (left.0.0 + right.0.0 + a.0 + b.0, left.0.1 + right.0.1 + a.1 + b.1);
            let mut triangles = vec![[polygon[0], polygon[apex], polygon[n - 1]]];
            triangles.extend(left.1);
            triangles.extend(right.1);
            (cost, triangles)
        })
        .min_by_key(|(cost, _)| *cost)
        .unwrap_or_default()
}

fn diagonal_cost(a: u8, b: u8) -> Cost {
    let doubled = |e: u8, axis: usize| -> i32 {
        EDGE_CORNERS[e as usize].iter().map(|&c| (c >> axis & 1) as i32).sum()
    };
    let length = (0..3).map(|axis| (doubled(a, axis) - doubled(b, axis)).pow(2)).sum();
    // Both edges lie in the same face when all four corners agree in one coordinate.
    let in_face =
        (0..3).any(|axis| matches!((doubled(a, axis), doubled(b, axis)), (0, 0) | (2, 2)));
    (in_face as u32, length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_case_needs_more_than_five_triangles() {
        assert_eq!(CASES.iter().map(|c| c.count).max(), Some(MAX_TRIANGLES as u8));
        assert_eq!(CASES[0].count + CASES[255].count, 0);
    }

    #[test]
    fn inverting_a_case_without_ambiguous_faces_flips_its_triangles() {
        // One corner gives one triangle; four corners of a face give two; the inverse of five
        // corners around one gives three.
        for (case, count) in [
            (0b0000_0001, 1),
            (0b1111_1110, 1),
            (0b0000_1111, 2),
            (0b0000_0111, 3),
            (0b1111_1000, 3),
        ] {
            assert_eq!(CASES[case].count, count, "case {case:08b}");
        }
    }

    #[test]
    fn ambiguous_faces_separate_inside_corners() {
        // Two inside corners on a diagonal of one face: two corners cut off, no tunnel.
        assert_eq!(CASES[0b0000_1001].count, 2);
        assert_eq!(CASES[0b0110_1001].count, 4, "checkerboard");
    }

    #[test]
    fn every_crossed_edge_is_used_and_every_used_edge_is_crossed() {
        for (i, c) in CASES.iter().enumerate() {
            let used =
                c.triangles[..c.count as usize].iter().flatten().fold(0u16, |m, e| m | 1 << e);
            assert_eq!(used, c.crossed, "case {i:08b}");
        }
    }

    #[test]
    fn no_diagonal_lies_in_a_face() {
        // Interior edges of the triangulation are those used in both directions.
        for (i, c) in CASES.iter().enumerate() {
            let t = &c.triangles[..c.count as usize];
            let edges: Vec<_> =
                t.iter().flat_map(|t| (0..3).map(|k| (t[k], t[(k + 1) % 3]))).collect();
            for &(a, b) in edges.iter().filter(|(a, b)| edges.contains(&(*b, *a))) {
                assert_eq!(diagonal_cost(a, b).0, 0, "case {i:08b} edge {a}-{b}");
            }
        }
    }
}
