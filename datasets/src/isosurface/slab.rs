//! Counts and emits vertices and triangles, one slab of cells (between two neighbouring planes) at
//! a time.
//!
//! Ids depend on position, not on the thread that computes them. Plane k has, in this order, the
//! vertices on its x and y edges (row by row, x before y), then those on the z edges up to plane
//! k + 1. Slab k has its triangles. Two passes therefore suffice: count every plane in parallel,
//! take prefix sums, and emit every plane in parallel into its own part of the result. This is the
//! method of flying edges (Schroeder, Maynard and Geveci 2015), with planes in place of rows. The
//! in-plane vertices come first, so slab k knows the ids on plane k + 1 without reading plane
//! k + 2.

use super::case_table::{CASES, EDGES_AT_CORNERS};
use super::gradient::normal_on_edge;
use super::inside_bits::{Block, PlaneBits, shifted};
use glam::{DVec3, Vec3};
use std::ops::Range;

/// What one plane and the slab above it contribute.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct PlaneCount {
    pub(crate) vertices: u32,
    pub(crate) triangles: u32,
    /// Cells with a missing corner.
    pub(crate) skipped_cells: u32,
}

/// One surface: where it is cut and how its vertices are placed.
#[derive(Clone, Copy)]
pub(crate) struct Cut {
    pub(crate) iso: f64,
    /// Smallest f32 that is at or above `iso`: an f32 comparison with it is equivalent to an f64
    /// comparison with `iso`.
    pub(crate) threshold: f32,
    /// Position of point (0,0,0) relative to the mesh's origin.
    pub(crate) base: DVec3,
    pub(crate) spacing: DVec3,
}

/// The parts of the result that a range of planes fills.
pub(crate) struct Output<'a> {
    pub(crate) positions: &'a mut [Vec3],
    pub(crate) normals: Option<&'a mut [Vec3]>,
    pub(crate) triangles: &'a mut [[u32; 3]],
}

/// Counts planes `range`, which must be in the block together with the plane after them (if the
/// grid has one).
pub(crate) fn count(block: &Block<'_>, cut: &Cut, range: Range<usize>) -> Vec<PlaneCount> {
    let mut counts = Vec::with_capacity(range.len());
    for_each_slab(block, cut.threshold, range, |_, below, above| {
        let mut c = PlaneCount { vertices: below.crossings(), ..Default::default() };
        if let Some(above) = above {
            c.vertices +=
                (0..below.inside.len()).map(|at| below.z(above, at).count_ones()).sum::<u32>();
            for j in 0..block.dims[1] - 1 {
                for_each_active_cell(block.dims[0], below, above, j, |_, case, missing| {
                    c.triangles += if missing == 0 { CASES[case].count as u32 } else { 0 };
                });
            }
            if block.has_missing {
                c.skipped_cells = count_skipped(block.dims, below, above);
            }
        }
        counts.push(c);
    });
    counts
}

/// Emits planes `range`; `first_vertex[k - range.start]` is the id of plane k's first vertex, with
/// one more entry for the plane after the range.
pub(crate) fn emit(
    block: &Block<'_>,
    cut: &Cut,
    range: Range<usize>,
    first_vertex: &[u32],
    out: Output<'_>,
) {
    let start = range.start;
    let ny = block.dims[1];
    let mut vertices =
        VertexWriter { block, cut, positions: out.positions, normals: out.normals, at: 0 };
    let mut triangles = out.triangles.iter_mut();
    let (mut below_rows, mut above_rows, mut z_rows) = (Vec::new(), Vec::new(), Vec::new());
    for_each_slab(block, cut.threshold, range, |k, below, above| {
        // Vertices of this plane.
        for j in 0..ny {
            let row = j * below.words..(j + 1) * below.words;
            for_each_bit(&below.x[row.clone()], |i| vertices.push([i, j, k], 0));
            for_each_bit(&below.y[row], |i| vertices.push([i, j, k], 1));
        }
        let Some(above) = above else { return };
        for j in 0..ny {
            for w in 0..below.words {
                for_each_bit(&[below.z(above, j * below.words + w)], |i| {
                    vertices.push([w * 64 + i, j, k], 2)
                });
            }
        }

        // Ids at which the rows of the three kinds of edges start.
        let end_of_xy = row_starts(below, first_vertex[k - start], &mut below_rows);
        row_starts(above, first_vertex[k - start + 1], &mut above_rows);
        z_rows.clear();
        let mut id = end_of_xy;
        for j in 0..ny {
            z_rows.push(id);
            id += (0..below.words)
                .map(|w| below.z(above, j * below.words + w).count_ones())
                .sum::<u32>();
        }

        // Triangles. Every crossed edge at or to the left of a cell belongs to an active cell, so
        // ids that are advanced only by active cells are correct.
        for j in 0..ny - 1 {
            let mut x =
                [below_rows[j][0], below_rows[j + 1][0], above_rows[j][0], above_rows[j + 1][0]];
            let mut y = [below_rows[j][1], above_rows[j][1]];
            let mut z = [z_rows[j], z_rows[j + 1]];
            for_each_active_cell(block.dims[0], below, above, j, |_, case, missing| {
                let case = &CASES[case];
                let crossed =
                    case.crossed & !if missing == 0 { 0 } else { EDGES_AT_CORNERS[missing] };
                let bit = |e: u32| (crossed >> e & 1) as u32;
                let ids = [
                    x[0],
                    x[1],
                    x[2],
                    x[3],
                    y[0],
                    y[0] + bit(4),
                    y[1],
                    y[1] + bit(6),
                    z[0],
                    z[0] + bit(8),
                    z[1],
                    z[1] + bit(10),
                ];
                if missing == 0 {
                    for t in &case.triangles[..case.count as usize] {
                        if let Some(out) = triangles.next() {
                            *out = t.map(|e| ids[e as usize]);
                        }
                    }
                }
                for (e, x) in x.iter_mut().enumerate() {
                    *x += bit(e as u32);
                }
                y = [y[0] + bit(4), y[1] + bit(6)];
                z = [z[0] + bit(8), z[1] + bit(10)];
            });
        }
    });
    debug_assert!(
        triangles.next().is_none() && vertices.at == vertices.positions.len(),
        "both passes agree"
    );
}

struct VertexWriter<'a, 'b> {
    block: &'a Block<'a>,
    cut: &'a Cut,
    positions: &'b mut [Vec3],
    normals: Option<&'b mut [Vec3]>,
    at: usize,
}

impl VertexWriter<'_, '_> {
    /// Adds the vertex on the edge from `a` to its next point along `axis`.
    #[inline]
    fn push(&mut self, a: [usize; 3], axis: usize) {
        let mut b = a;
        b[axis] += 1;
        let nx = self.block.dims[0];
        let value = |p: [usize; 3]| self.block.plane(p[2])[p[1] * nx + p[0]] as f64;
        let (va, vb) = (value(a), value(b));
        // One value is at or above iso and the other below, so vb - va is not 0 and t is within
        // 0..=1.
        let t = (self.cut.iso - va) / (vb - va);
        let mut p = DVec3::new(a[0] as f64, a[1] as f64, a[2] as f64);
        p[axis] += t;
        self.positions[self.at] = (self.cut.base + self.cut.spacing * p).as_vec3();
        if let Some(normals) = &mut self.normals {
            normals[self.at] = normal_on_edge(self.block, a, b, t as f32, self.cut.spacing);
        }
        self.at += 1;
    }
}

/// Calls `f(k, plane k, plane k + 1)` for the planes of `range`; the grid's last plane has no plane
/// above.
fn for_each_slab(
    block: &Block<'_>,
    threshold: f32,
    range: Range<usize>,
    mut f: impl FnMut(usize, &PlaneBits, Option<&PlaneBits>),
) {
    let (mut below, mut above) = (PlaneBits::default(), PlaneBits::default());
    if range.is_empty() {
        return;
    }
    below.fill(block, range.start, threshold);
    for k in range {
        if k + 1 < block.dims[2] {
            above.fill(block, k + 1, threshold);
            f(k, &below, Some(&above));
        } else {
            f(k, &below, None);
        }
        std::mem::swap(&mut below, &mut above);
    }
}

/// Calls `f(i, inside corners, missing corners)` for the cells (i, j) between two planes that have
/// corners on both sides.
#[inline]
fn for_each_active_cell(
    nx: usize,
    below: &PlaneBits,
    above: &PlaneBits,
    j: usize,
    mut f: impl FnMut(usize, usize, usize),
) {
    let words = below.words;
    for w in 0..words {
        let at = j * words + w;
        let next = w + 1 < words;
        // Corner order: x fastest, so (row, row shifted by one point) pairs.
        let corners = |bits: [&[u64]; 2]| -> [u64; 8] {
            let mut c = [0; 8];
            for (r, (bits, at)) in
                [(bits[0], at), (bits[0], at + words), (bits[1], at), (bits[1], at + words)]
                    .into_iter()
                    .enumerate()
            {
                c[2 * r] = bits[at];
                c[2 * r + 1] = shifted(bits, at, next);
            }
            c
        };
        let inside = corners([&below.inside, &above.inside]);
        let any = inside.iter().fold(0, |m, c| m | c);
        let all = inside.iter().fold(u64::MAX, |m, c| m & c);
        let mut active = any & !all;
        if !next {
            // Points past the end of the row count as outside; there is no cell at the last point.
            active &= (1 << ((nx - 1) % 64)) - 1;
        }
        if active == 0 {
            continue;
        }
        let gather =
            |c: &[u64; 8], i: u32| (0..8).fold(0, |case, b| case | ((c[b] >> i & 1) as usize) << b);
        if below.missing.is_empty() {
            while active != 0 {
                let i = active.trailing_zeros();
                active &= active - 1;
                f(w * 64 + i as usize, gather(&inside, i), 0);
            }
        } else {
            let missing = corners([&below.missing, &above.missing]);
            while active != 0 {
                let i = active.trailing_zeros();
                active &= active - 1;
                f(w * 64 + i as usize, gather(&inside, i), gather(&missing, i));
            }
        }
    }
}

/// Cells between two planes with a missing corner.
fn count_skipped(dims: [usize; 3], below: &PlaneBits, above: &PlaneBits) -> u32 {
    let words = below.words;
    let mut skipped = 0;
    for j in 0..dims[1] - 1 {
        for w in 0..words {
            let mut any = 0;
            for bits in [&below.missing, &above.missing] {
                for at in [j * words + w, (j + 1) * words + w] {
                    any |= bits[at] | shifted(bits, at, w + 1 < words);
                }
            }
            if w + 1 == words {
                any &= (1 << ((dims[0] - 1) % 64)) - 1;
            }
            skipped += any.count_ones();
        }
    }
    skipped
}

/// Ids of the first x and the first y vertex of every row; returns the id after the last.
fn row_starts(plane: &PlaneBits, first: u32, rows: &mut Vec<[u32; 2]>) -> u32 {
    rows.clear();
    let ones = |bits: &[u64]| bits.iter().map(|w| w.count_ones()).sum::<u32>();
    plane.x.chunks(plane.words).zip(plane.y.chunks(plane.words)).fold(first, |id, (x, y)| {
        let y_start = id + ones(x);
        rows.push([id, y_start]);
        y_start + ones(y)
    })
}

/// Calls `f` with the index of each set bit, ascending.
#[inline]
fn for_each_bit(words: &[u64], mut f: impl FnMut(usize)) {
    for (w, &word) in words.iter().enumerate() {
        let mut bits = word;
        while bits != 0 {
            f(w * 64 + bits.trailing_zeros() as usize);
            bits &= bits - 1;
        }
    }
}
