//! Takes away the cells of a triangulation that bridge places without points: bodies, and hollows
//! of the border. The hull of points is not the flow.
//!
//! The sphere through the corners of a Delaunay cell holds no points, so its radius says how wide
//! the place between them is. Alpha shapes (Edelsbrunner and Mücke 1994) drop cells above one
//! radius for all. Points of flow solvers are a hundred times as dense at a wall as far away, so
//! here the radius is measured in the spacing of the points around:
//!
//! 1. The *size* of a cell is the largest radius of the circles through three of its corners. (For
//!    a triangle, that is its circumradius. A tetrahedron's own radius is rounding where it is
//!    flat.)
//! 2. The *spacing* at a point is the size of the cell a third up among those around it, and of
//!    these values the median over its neighbours. Cells in a body are less than two thirds of
//!    those around most points of its wall. In a boundary layer, the size is half of the distance
//!    along the wall, however thin the layers are: a circle between two columns of points cannot
//!    grow through them.
//! 3. The *stretch* of a cell is its size by the largest spacing at its corners. It is 1 in a
//!    lattice, and up to 4 among points by chance.
//! 4. So a cell is a gap where its stretch is more than `spacings` times the *usual* stretch, which
//!    four in five of all cells do not exceed. This is repeated, without the cells that were
//!    found, until no more are: cospherical points of a body may have many cells in it.
//! 5. From gaps, the place without points goes on into cells next to them with two thirds of that
//!    (hysteresis, Canny 1986): up to where a body becomes as thin as its points are apart.
//! 6. Gaps of a few cells are chance, and closed again.
//!
//! What it cannot tell: a body, or its tail, that is thinner than two or three distances between
//! the points along its wall looks like gas. A cloud that is regular in one part and random in
//! another is measured by what most of its cells are.

use crate::rows::Rows;
use glam::DVec3;
use rayon::prelude::*;

/// Default of `spacings`. In a lattice, bodies four steps wide are found.
pub(crate) const SPACINGS: f64 = 2.7;
/// Part of the threshold down to which a gap grows.
const GROWTH: f64 = 2.0 / 3.0;
/// Among the cells around a point in order of their size, where its spacing stands.
const LOWER: f64 = 1.0 / 3.0;
/// Among all cells in order of their stretch, where the usual one stands.
const USUAL: f64 = 0.8;

/// Cells of a gap, at least, in a plane and in space. Points by chance leave places of a few cells,
/// mostly at the hull, and a body four steps wide has more.
const LEAST_CELLS: [usize; 2] = [8, 24];

/// Which cells are gaps.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Gaps {
    /// Flag per cell.
    pub(crate) is_gap: Vec<bool>,
    /// Number of cells that are.
    pub(crate) cells: usize,
}

/// Finds the gaps among the cells of a Delaunay triangulation: triangles (`N` = 3) or tetrahedra.
/// `spacings`: how many times as wide as the cells around it a gap is.
pub(crate) fn find<const N: usize>(points: &[DVec3], corners: &[[u32; N]], spacings: f64) -> Gaps {
    let mut cloud = Cloud {
        corners,
        around: Rows::inverse(corners.iter().map(|c| &c[..]), points.len()),
        sizes: corners.par_iter().map(|c| size(points, c)).collect(),
        is_gap: vec![false; corners.len()],
        own: vec![0.0; points.len()],
        spacing: vec![0.0; points.len()],
    };
    let all: Vec<u32> = (0..points.len() as u32).collect();
    cloud.measure(&all);
    let mut stretch: Vec<f64> =
        (0..corners.len()).into_par_iter().map(|c| cloud.stretch(c)).collect();
    let threshold = spacings * quantile(&mut stretch, USUAL).max(1.0);

    // Gaps hide how dense the points beside them are: each round sees more of that.
    let mut candidates: Vec<u32> = (0..corners.len() as u32).collect();
    while !candidates.is_empty() {
        let above = |limit: f64| {
            let cloud = &cloud;
            move |c: &u32| !cloud.is_gap[*c as usize] && cloud.stretch(*c as usize) > limit
        };
        let found: Vec<u32> = candidates.into_par_iter().filter(above(threshold)).collect();
        found.iter().for_each(|c| cloud.is_gap[*c as usize] = true);
        let points = cloud.points_of(&found);
        cloud.measure(&points);
        let beside: Vec<u32> = points.par_iter().flat_map_iter(|p| cloud.neighbours(*p)).collect();
        candidates = sorted(beside.iter().flat_map(|p| cloud.around.row(*p as usize)).copied());
    }
    cloud.grow(GROWTH * threshold);
    cloud.close_small(LEAST_CELLS[usize::from(N > 3)]);
    let cells = cloud.is_gap.iter().filter(|g| **g).count();
    Gaps { is_gap: cloud.is_gap, cells }
}

/// A triangulation, and what is known of its gaps.
struct Cloud<'a, const N: usize> {
    corners: &'a [[u32; N]],
    /// The cells around each point.
    around: Rows,
    sizes: Vec<f64>,
    is_gap: Vec<bool>,
    /// For each point, the size a third up among the cells around it that are no gaps.
    own: Vec<f64>,
    /// The median of `own` over the neighbours.
    spacing: Vec<f64>,
}

impl<const N: usize> Cloud<'_, N> {
    /// Measures the spacing at these points and their neighbours.
    fn measure(&mut self, points: &[u32]) {
        let own: Vec<f64> = points
            .par_iter()
            .map_init(Vec::new, |values, p| {
                values.clear();
                values.extend(self.cells(*p).map(|c| self.sizes[c as usize]));
                quantile(values, LOWER)
            })
            .collect();
        points.iter().zip(own).for_each(|(p, own)| self.own[*p as usize] = own);
        let touched = match points.len() == self.own.len() {
            true => points.to_vec(),
            false => sorted(points.iter().flat_map(|p| self.neighbours(*p))),
        };
        let spacing: Vec<f64> = touched
            .par_iter()
            .map_init(Vec::new, |values, p| {
                values.clear();
                values.extend(self.neighbours(*p).map(|q| self.own[q as usize]));
                quantile(values, 0.5)
            })
            .collect();
        touched.iter().zip(spacing).for_each(|(p, s)| self.spacing[*p as usize] = s);
    }

    /// The cells around a point that are no gaps.
    fn cells(&self, point: u32) -> impl Iterator<Item = u32> + '_ {
        self.around.row(point as usize).iter().copied().filter(|c| !self.is_gap[*c as usize])
    }

    /// The corners of these cells, the point among them, once for each cell.
    fn neighbours(&self, point: u32) -> impl Iterator<Item = u32> + '_ {
        self.cells(point).flat_map(|c| self.corners[c as usize])
    }

    fn points_of(&self, cells: &[u32]) -> Vec<u32> {
        sorted(cells.iter().flat_map(|c| self.corners[*c as usize]))
    }

    fn stretch(&self, cell: usize) -> f64 {
        let spacings = self.corners[cell].map(|p| self.spacing[p as usize]);
        self.sizes[cell] / spacings.into_iter().fold(0.0, f64::max)
    }

    /// The cells that share a face with a cell, and the cell itself.
    fn beside(&self, cell: u32) -> impl Iterator<Item = u32> + '_ {
        let corners = self.corners[cell as usize];
        (0..N).flat_map(move |skipped| {
            let shares = move |other: &u32| {
                let others = &self.corners[*other as usize];
                corners.iter().enumerate().all(|(i, p)| i == skipped || others.contains(p))
            };
            self.around.row(corners[(skipped + 1) % N] as usize).iter().copied().filter(shares)
        })
    }

    fn gap_cells(&self) -> Vec<u32> {
        (0..self.corners.len() as u32).filter(|c| self.is_gap[*c as usize]).collect()
    }

    /// Lets the gaps grow into neighbours that are wider than `limit`.
    fn grow(&mut self, limit: f64) {
        let mut front = self.gap_cells();
        while let Some(cell) = front.pop() {
            let is_next = |c: &u32| !self.is_gap[*c as usize] && self.stretch(*c as usize) > limit;
            let next: Vec<u32> = self.beside(cell).filter(is_next).collect();
            for &other in &next {
                self.is_gap[other as usize] = true;
            }
            front.extend(next);
        }
    }

    /// Makes gaps of fewer cells than `least` none.
    fn close_small(&mut self, least: usize) {
        let mut seen = vec![false; self.corners.len()];
        for first in self.gap_cells() {
            if seen[first as usize] {
                continue;
            }
            seen[first as usize] = true;
            let mut gap = vec![first];
            let mut at = 0;
            while let Some(&cell) = gap.get(at) {
                at += 1;
                for other in self.beside(cell) {
                    if self.is_gap[other as usize] && !seen[other as usize] {
                        seen[other as usize] = true;
                        gap.push(other);
                    }
                }
            }
            if gap.len() < least {
                gap.into_iter().for_each(|c| self.is_gap[c as usize] = false);
            }
        }
    }
}

/// Numbers in order, each once.
fn sorted(numbers: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut all: Vec<u32> = numbers.collect();
    all.par_sort_unstable();
    all.dedup();
    all
}

/// The largest radius of the circles through three of the corners.
fn size<const N: usize>(points: &[DVec3], corners: &[u32; N]) -> f64 {
    let p = corners.map(|c| points[c as usize]);
    let mut largest = 0.0f64;
    for i in 0..N {
        for j in 0..i {
            for k in 0..j {
                let (a, b) = (p[j] - p[i], p[k] - p[i]);
                // Twice the area; 0 only if the corners are on a line, apart from rounding.
                let area = a.cross(b).length();
                let radius = 0.5 * a.length() * b.length() * (a - b).length() / area;
                largest = largest.max(if radius.is_nan() { f64::INFINITY } else { radius });
            }
        }
    }
    largest
}

/// The value with this part of the others below it; 0 if there is none.
fn quantile(values: &mut [f64], part: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let at = (part * (values.len() - 1) as f64) as usize;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}
