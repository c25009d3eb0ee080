//! Finds the lattice nodes inside each cell, one layer of the lattice at a time.
//!
//! A layer of nodes (one k) is one task. The task visits the cells that overlap it in the order of
//! their numbers, so a node on a face shared by two cells gets the same value for any number of
//! threads. A node outside all cells but within [`NEAR`] of one takes the value of the nearest,
//! because curved faces of different cell types do not match exactly.

use super::mesh::Mesh;
use super::reconstruct::PointField;
use super::shape::Cell;
use super::{Lattice, Mark};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Points at most this far outside, in units of the cell, count as inside. This is about 1000 times
/// the rounding error of the inversion.
pub(super) const INSIDE_TOLERANCE: f64 = 1e-9;
/// A point this far outside may lie in a gap between faces that do not match.
const NEAR: f64 = 1e-3;

/// Special cases counted during rasterization.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Counts {
    /// Samples that lay in gaps between cells.
    pub(super) in_gaps: usize,
    /// Cells whose map folds.
    pub(super) folded: usize,
    /// Cells that contain no sample.
    pub(super) without_samples: usize,
    /// Cells with corners that are not finite.
    pub(super) non_finite: usize,
}

/// One sample of a layer: its value, its distance outside the cell, and its mark.
#[derive(Debug, Clone, Copy)]
struct Sample {
    value: f64,
    /// The last part of the value ([`PointField::at`]).
    last: f64,
    outside: f64,
    mark: Mark,
}

const NO_SAMPLE: Sample =
    Sample { value: f64::NAN, last: 0.0, outside: f64::INFINITY, mark: Mark::Outside };

/// Rank of marks by information: a cell with values takes precedence over a hidden one.
fn rank(mark: Mark) -> u8 {
    match mark {
        Mark::Inside => 3,
        Mark::NotFinite => 2,
        Mark::Hidden => 1,
        Mark::Outside => 0,
    }
}

/// The samples of a lattice with `n` per axis and node: index `i` is at `(i + 0.5)/n − 0.5` nodes
/// from the first node.
struct FineLattice<'a> {
    lattice: &'a Lattice,
    n: usize,
}

impl FineLattice<'_> {
    fn coordinate(&self, axis: usize, i: usize) -> f64 {
        let nodes = if self.n == 1 { i as f64 } else { (i as f64 + 0.5) / self.n as f64 - 0.5 };
        self.lattice.origin[axis] + self.lattice.spacing[axis] * nodes
    }
    fn count(&self, axis: usize) -> usize {
        self.lattice.dims[axis] * self.n
    }
    /// Samples between two coordinates, with a small tolerance outwards.
    fn between(&self, axis: usize, low: f64, high: f64) -> Option<(usize, usize)> {
        let n = self.n as f64;
        let index =
            |x: f64| ((x - self.lattice.origin[axis]) / self.lattice.spacing[axis] + 0.5) * n - 0.5;
        let last = (self.count(axis) - 1) as f64;
        let (a, b) = ((index(low) - 1e-6).ceil().max(0.0), (index(high) + 1e-6).floor().min(last));
        // NaN fails the comparison.
        (a <= b).then_some((a as usize, b as usize))
    }
    /// Whether sample `i` lies between the first and the last node. Samples beyond the border are
    /// not averaged.
    fn within(&self, axis: usize, i: usize) -> bool {
        let nodes = (i as f64 + 0.5) / self.n as f64 - 0.5;
        self.n == 1 || (0.0..=(self.lattice.dims[axis] - 1) as f64).contains(&nodes)
    }
}

/// What all nodes get, x fastest.
pub(super) struct Nodes {
    pub(super) values: Vec<f32>,
    /// See [`super::ResampledField::truncation`]; zero where there is no value.
    pub(super) truncation: Vec<f32>,
    pub(super) marks: Vec<Mark>,
    pub(super) counts: Counts,
}

/// Values and marks of all nodes.
pub(super) fn rasterize(
    mesh: &Mesh,
    field: &PointField<'_>,
    of_cells: Option<&[f64]>,
    lattice: &Lattice,
    samples_per_axis: usize,
) -> Nodes {
    let fine = FineLattice { lattice, n: samples_per_axis };

    // Range of layers that each cell overlaps.
    let reach: Vec<Option<(u32, u32)>> = (0..mesh.num_cells())
        .into_par_iter()
        .map(|cell| {
            let (low, high) = cell_box(mesh, cell)?;
            fine.between(0, low.x, high.x)?;
            fine.between(1, low.y, high.y)?;
            let (a, b) = fine.between(2, low.z, high.z)?;
            Some(((a / fine.n) as u32, (b / fine.n) as u32))
        })
        .collect();
    let non_finite =
        (0..mesh.num_cells()).into_par_iter().filter(|&c| cell_box(mesh, c).is_none()).count();

    // The cells of each layer, in order (counting sort).
    let layers = lattice.dims[2];
    let mut starts = vec![0usize; layers + 1];
    for (a, b) in reach.iter().flatten() {
        (*a..=*b).for_each(|k| starts[k as usize + 1] += 1);
    }
    for k in 0..layers {
        starts[k + 1] += starts[k];
    }
    let mut next = starts.clone();
    let mut cells = vec![0u32; starts[layers]];
    for (cell, r) in reach.iter().enumerate() {
        let Some((a, b)) = *r else { continue };
        for k in a as usize..=b as usize {
            cells[next[k]] = cell as u32;
            next[k] += 1;
        }
    }
    drop(reach);

    let seen: Vec<AtomicBool> = (0..mesh.num_cells()).map(|_| AtomicBool::new(false)).collect();
    let folded: Vec<AtomicBool> = (0..mesh.num_cells()).map(|_| AtomicBool::new(false)).collect();
    let in_gaps = AtomicUsize::new(0);
    let per_layer = lattice.dims[0] * lattice.dims[1];
    let mut values = vec![f32::NAN; lattice.len()];
    let mut truncation = vec![0.0; if field.is_linear() { 0 } else { lattice.len() }];
    let mut marks = vec![Mark::Outside; lattice.len()];
    let mut layers_of_truncation: Vec<&mut [f32]> = truncation.chunks_mut(per_layer).collect();
    layers_of_truncation.resize_with(layers, Default::default);
    values
        .par_chunks_mut(per_layer)
        .zip(marks.par_chunks_mut(per_layer))
        .zip(layers_of_truncation)
        .enumerate()
        .for_each(|(k, ((values, marks), truncation))| {
            let mut samples = vec![NO_SAMPLE; fine.count(0) * fine.count(1) * fine.n];
            let mut scratch = Scratch::default();
            for &cell in &cells[starts[k]..starts[k + 1]] {
                let cell = cell as usize;
                let data = CellData { mesh, field, of_cells, cell };
                let (hit, fold) = data.visit(&fine, k, &mut samples, &mut scratch);
                if hit {
                    seen[cell].store(true, Ordering::Relaxed);
                }
                if fold {
                    folded[cell].store(true, Ordering::Relaxed);
                }
            }
            let gaps = samples
                .iter()
                .filter(|s| s.outside > INSIDE_TOLERANCE && s.outside <= NEAR)
                .count();
            in_gaps.fetch_add(gaps, Ordering::Relaxed);
            reduce(&fine, k, &samples, values, truncation, marks);
        });
    let count = |flags: &[AtomicBool]| flags.iter().filter(|f| f.load(Ordering::Relaxed)).count();
    let counts = Counts {
        in_gaps: in_gaps.into_inner(),
        folded: count(&folded),
        without_samples: mesh.num_cells() - count(&seen) - non_finite,
        non_finite,
    };
    Nodes { values, truncation, marks, counts }
}

/// Bounding box of a cell, enlarged by [`NEAR`]; `None` when a corner is not finite.
fn cell_box(mesh: &Mesh, cell: usize) -> Option<(DVec3, DVec3)> {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for id in mesh.corners(cell).ids {
        let p = mesh.point(id as usize);
        if !p.is_finite() {
            return None;
        }
        (low, high) = (low.min(p), high.max(p));
    }
    let margin = DVec3::splat((high - low).max_element() * NEAR);
    Some((low - margin, high + margin))
}

#[derive(Default)]
struct Scratch {
    points: Vec<DVec3>,
    weights: Vec<f64>,
}

/// A cell with its values and mark.
struct CellData<'a> {
    mesh: &'a Mesh,
    field: &'a PointField<'a>,
    of_cells: Option<&'a [f64]>,
    cell: usize,
}

impl CellData<'_> {
    /// Fills in the samples of layer `k` that lie in the cell. Returns whether there is any, and
    /// whether the cell is folded.
    fn visit(
        &self,
        fine: &FineLattice<'_>,
        k: usize,
        samples: &mut [Sample],
        scratch: &mut Scratch,
    ) -> (bool, bool) {
        let Some((low, high)) = cell_box(self.mesh, self.cell) else { return (false, false) };
        let ranges = [0, 1, 2].map(|a| fine.between(a, low[a], high[a]));
        let [Some((x0, x1)), Some((y0, y1)), Some((z0, z1))] = ranges else {
            return (false, false);
        };
        let (z0, z1) = (z0.max(k * fine.n), z1.min(k * fine.n + fine.n - 1));

        let corners = self.mesh.corners(self.cell);
        scratch.points.clear();
        scratch.points.extend(corners.ids.iter().map(|&i| self.mesh.point(i as usize)));
        let shape =
            Cell::new(&scratch.points, &corners.shape).with_shares(self.field.shares(&corners.ids));
        let own_mark = if self.mesh.is_hidden(self.cell) {
            Mark::Hidden
        } else if self.of_cells.is_some_and(|v| !v[self.cell].is_finite()) {
            Mark::NotFinite
        } else {
            Mark::Inside
        };

        let mut hit = false;
        for z in z0..=z1 {
            for y in y0..=y1 {
                for x in x0..=x1 {
                    let slot =
                        &mut samples[x + fine.count(0) * (y + fine.count(1) * (z - k * fine.n))];
                    if slot.mark == Mark::Inside && slot.outside == 0.0 {
                        // The sample is already inside another cell. Testing this cell as well
                        // would only affect the count of cells without samples, which does not
                        // matter for cells that share faces with others.
                        hit = true;
                        continue;
                    }
                    let p = DVec3::new(
                        fine.coordinate(0, x),
                        fine.coordinate(1, y),
                        fine.coordinate(2, z),
                    );
                    let outside = shape.locate(p, &mut scratch.weights);
                    let Some(outside) = outside.filter(|&outside| outside <= NEAR) else {
                        continue;
                    };
                    hit = true;
                    let [value, last] = self.field.at(self.mesh, &corners.ids, &scratch.weights, p);
                    let mark = if own_mark == Mark::Inside && !value.is_finite() {
                        Mark::NotFinite
                    } else {
                        own_mark
                    };
                    let outside = if outside <= INSIDE_TOLERANCE { 0.0 } else { outside };
                    // Precedence: inside before near, then the more informative mark, then the
                    // smaller distance, then the first cell.
                    let key = |outside: f64, mark: Mark| (outside == 0.0, rank(mark));
                    let (new, old) = (key(outside, mark), key(slot.outside, slot.mark));
                    if new > old || new == old && outside < slot.outside {
                        *slot = Sample { value, last, outside, mark };
                    }
                }
            }
        }
        (hit, shape.is_folded())
    }
}

/// Computes the nodes of layer `k` from their samples: the mean of the samples with values if they
/// are at least half of all, otherwise the most frequent other mark.
fn reduce(
    fine: &FineLattice<'_>,
    k: usize,
    samples: &[Sample],
    values: &mut [f32],
    truncation: &mut [f32],
    marks: &mut [Mark],
) {
    let n = fine.n;
    let width = fine.count(0);
    for (node, (value, mark)) in values.iter_mut().zip(marks).enumerate() {
        let (i, j) = (node % fine.lattice.dims[0], node / fine.lattice.dims[0]);
        let (mut sum, mut last, mut count, mut all) = (0.0, 0.0, 0usize, 0usize);
        let mut others = [0usize; 3];
        for z in 0..n {
            for y in j * n..(j + 1) * n {
                for x in i * n..(i + 1) * n {
                    if !(fine.within(0, x) && fine.within(1, y) && fine.within(2, k * n + z)) {
                        continue;
                    }
                    let s = samples[x + width * (y + fine.count(1) * z)];
                    all += 1;
                    match s.mark {
                        Mark::Inside => {
                            sum += s.value;
                            last += s.last;
                            count += 1;
                        }
                        other => others[rank(other) as usize] += 1,
                    }
                }
            }
        }
        if count > 0 && 2 * count >= all {
            (*value, *mark) = ((sum / count as f64) as f32, Mark::Inside);
            if let Some(t) = truncation.get_mut(node) {
                *t = (last / count as f64) as f32;
            }
        } else {
            let most = others.iter().max().copied().unwrap_or(0);
            *mark = [Mark::NotFinite, Mark::Hidden, Mark::Outside]
                .into_iter()
                .find(|m| others[rank(*m) as usize] == most)
                .unwrap_or(Mark::Outside);
        }
    }
}
