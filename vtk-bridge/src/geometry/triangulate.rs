//! Triangulates polygons and strips in VTK's order. Polygons become fans around their first point,
//! and every other triangle of a strip has its winding reversed.

use super::CellOfTriangle;
use crate::input::{Cells, Ids, Shape};
use rayon::prelude::*;
use std::sync::Arc;

/// Number of cells per task.
const CHUNK: usize = 1 << 14;

/// Triangles of all polygons, then of all strips, with the cell of each.
pub(super) fn triangles(
    shape: &Shape<'_>,
    first_poly: usize,
    first_strip: usize,
) -> (Vec<[u32; 3]>, CellOfTriangle) {
    if shape.strips.is_empty() && all_triangles(&shape.polys) {
        let indices = copied(&shape.polys.connectivity, shape.polys.len());
        return (indices, CellOfTriangle::Consecutive { first: first_poly as u32 });
    }
    let polys = expanded(&shape.polys, first_poly, |cells, run, cell, out| {
        for k in run.start + 1..run.end.saturating_sub(1) {
            out.push(([cells.vertex(run.start), cells.vertex(k), cells.vertex(k + 1)], cell));
        }
    });
    let strips = expanded(&shape.strips, first_strip, |cells, run, cell, out| {
        for (n, k) in (run.start..run.end.saturating_sub(2)).enumerate() {
            let [a, b, c] = [k, k + 1, k + 2].map(|i| cells.vertex(i));
            out.push((if n % 2 == 0 { [a, b, c] } else { [b, a, c] }, cell));
        }
    });
    let all = || polys.iter().chain(&strips).flatten();
    (all().map(|t| t.0).collect(), CellOfTriangle::List(Arc::new(all().map(|t| t.1).collect())))
}

/// Which sides of the triangles of [`triangles`] are edges of their polygon. Bit i stands for the
/// side from corner i to the next.
pub(super) fn edges(shape: &Shape<'_>) -> Vec<u8> {
    let polys = expanded(&shape.polys, 0, |_, run, _, out| {
        for k in run.start + 1..run.end.saturating_sub(1) {
            let (first, last) = (k == run.start + 1, k + 2 == run.end);
            out.push(([0; 3], u32::from(first) | 2 | u32::from(last) << 2));
        }
    });
    let strips = expanded(&shape.strips, 0, |_, run, _, out| {
        out.extend((run.start..run.end.saturating_sub(2)).map(|_| ([0; 3], 7)));
    });
    polys.iter().chain(&strips).flatten().map(|t| t.1 as u8).collect()
}

type Triangle = ([u32; 3], u32);

/// Triangulates the cells in chunks and keeps their order.
fn expanded(
    cells: &Cells<'_>,
    first: usize,
    expand: impl Fn(&Ids<'_>, std::ops::Range<usize>, u32, &mut Vec<Triangle>) + Sync,
) -> Vec<Vec<Triangle>> {
    (0..cells.len().div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            let mut out = Vec::with_capacity(2 * CHUNK);
            for i in chunk * CHUNK..((chunk + 1) * CHUNK).min(cells.len()) {
                expand(&cells.connectivity, cells.run(i), (first + i) as u32, &mut out);
            }
            out
        })
        .collect()
}

/// Whether every cell has three points and the cells follow each other without gaps.
fn all_triangles(cells: &Cells<'_>) -> bool {
    let n = cells.len();
    n == 0
        || cells.connectivity.len() == 3 * n
            && (0..n + 1)
                .into_par_iter()
                .with_min_len(CHUNK)
                .all(|i| cells.offsets.at(i) == 3 * i as i64)
}

/// The connectivity when all cells are triangles.
fn copied(connectivity: &Ids<'_>, n: usize) -> Vec<[u32; 3]> {
    let vertex = |v: i64| u32::try_from(v).unwrap_or(u32::MAX);
    match connectivity {
        Ids::I64(v) => v[..3 * n]
            .par_chunks_exact(3)
            .with_min_len(CHUNK)
            .map(|t| [vertex(t[0]), vertex(t[1]), vertex(t[2])])
            .collect(),
        Ids::I32(v) => v[..3 * n]
            .par_chunks_exact(3)
            .with_min_len(CHUNK)
            .map(|t| [vertex(t[0].into()), vertex(t[1].into()), vertex(t[2].into())])
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::Points;

    fn shape<'a>(polys: Cells<'a>, strips: Cells<'a>) -> Shape<'a> {
        Shape { strips, ..Shape::polygons(1, Points::F32(&[]), polys) }
    }

    #[test]
    fn polygons_are_fanned_and_strips_alternate() {
        let polys = Cells {
            offsets: Ids::I64(&[0, 3, 8]),
            connectivity: Ids::I64(&[0, 1, 2, 3, 4, 5, 6, 7]),
        };
        let strips =
            Cells { offsets: Ids::I32(&[0, 4]), connectivity: Ids::I32(&[10, 11, 12, 13]) };
        let (t, cells) = triangles(&shape(polys, strips), 5, 7);
        assert_eq!(t, [[0, 1, 2], [3, 4, 5], [3, 5, 6], [3, 6, 7], [10, 11, 12], [12, 11, 13]]);
        assert_eq!((0..6).map(|i| cells.at(i)).collect::<Vec<_>>(), [5, 6, 6, 6, 7, 7]);
        assert_eq!(
            edges(&shape(polys, strips)),
            [7, 3, 2, 6, 7, 7],
            "diagonals of polygons are no edges"
        );
    }

    #[test]
    fn plain_triangles_need_no_list_of_cells() {
        let offsets: Vec<i64> = (0..5).map(|i| 3 * i).collect();
        let connectivity: Vec<i64> = (0..12).collect();
        let polys = Cells { offsets: Ids::I64(&offsets), connectivity: Ids::I64(&connectivity) };
        let (t, cells) = triangles(&shape(polys, Cells::NONE), 2, 6);
        assert_eq!(t[3], [9, 10, 11]);
        assert!(matches!(cells, CellOfTriangle::Consecutive { first: 2 }));
        assert_eq!(cells.at(3), 5);
    }

    #[test]
    fn offsets_and_numbers_that_make_no_sense_give_no_triangle_of_other_points() {
        let polys =
            Cells { offsets: Ids::I64(&[0, 3, 2, 99]), connectivity: Ids::I64(&[0, -1, 1 << 40]) };
        let (t, _) = triangles(&shape(polys, Cells::NONE), 0, 3);
        assert_eq!(t, [[0, u32::MAX, u32::MAX]]);
    }
}
