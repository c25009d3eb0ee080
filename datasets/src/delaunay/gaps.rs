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
//! 3. The *stretch* of a cell is its size by the largest spacing at its corners. It is 1 in a lattice,
//!    and up to 4 among points by chance.
//! 4. So a cell is a gap where its stretch is more than [`Gaps::spacings`] times the *usual* stretch,
//!    which four in five of all cells do not exceed.
//! 5. From gaps, the place without points goes on into cells next to them with two thirds of that
//!    (hysteresis, Canny 1986): up to where a body becomes as thin as its points are apart.
//!
//! What it cannot tell: a body, or its tail, that is thinner than two or three distances between
//! the points along its wall looks like gas. A cloud that is regular in one part and random in
//! another is measured by what most of its cells are.

use glam::DVec3;
use rayon::prelude::*;

/// Default of [`Gaps::spacings`]. In a lattice, bodies four steps wide are found, and 1 million
/// points by chance have no gap.
pub(crate) const SPACINGS: f64 = 2.7;
/// Part of the threshold down to which a gap grows.
const GROWTH: f64 = 2.0 / 3.0;
/// Among the cells around a point in order of their size, where its spacing stands.
const LOWER: f64 = 1.0 / 3.0;
/// Among all cells in order of their stretch, where the usual one stands.
const USUAL: f64 = 0.8;

/// Which cells are gaps.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Gaps {
    /// Flag per cell.
    pub(crate) is_gap: Vec<bool>,
    /// Number of cells that are.
    pub(crate) cells: usize,
}

/// The cells around each point, one after the other.
struct CellsOfPoints {
    starts: Vec<usize>,
    cells: Vec<u32>,
}

impl CellsOfPoints {
    fn new<const N: usize>(corners: &[[u32; N]], points: usize) -> CellsOfPoints {
        let mut starts = vec![0usize; points + 1];
        corners.iter().flatten().for_each(|p| starts[*p as usize + 1] += 1);
        for p in 0..points {
            starts[p + 1] += starts[p];
        }
        let mut next = starts.clone();
        let mut cells = vec![0; corners.len() * N];
        for (c, corners) in corners.iter().enumerate() {
            for p in corners {
                cells[next[*p as usize]] = c as u32;
                next[*p as usize] += 1;
            }
        }
        CellsOfPoints { starts, cells }
    }

    fn of(&self, point: usize) -> &[u32] {
        &self.cells[self.starts[point]..self.starts[point + 1]]
    }
}

/// Finds the gaps among the cells of a Delaunay triangulation: triangles (`N` = 3) or tetrahedra.
/// `spacings`: how many times as wide as the cells around it a gap is.
pub(crate) fn find<const N: usize>(points: &[DVec3], corners: &[[u32; N]], spacings: f64) -> Gaps {
    let sizes: Vec<f64> = corners.par_iter().map(|c| size(points, c)).collect();
    let around = CellsOfPoints::new(corners, points.len());
    let own: Vec<f64> = (0..points.len())
        .into_par_iter()
        .map_init(Vec::new, |sorted, p| {
            sorted.clear();
            sorted.extend(around.of(p).iter().map(|c| sizes[*c as usize]));
            quantile(sorted, LOWER)
        })
        .collect();
    let spacing: Vec<f64> = (0..points.len())
        .into_par_iter()
        .map_init(Vec::new, |sorted, p| {
            sorted.clear();
            let corners = around.of(p).iter().flat_map(|c| corners[*c as usize]);
            sorted.extend(corners.map(|q| own[q as usize]));
            quantile(sorted, 0.5)
        })
        .collect();
    let stretch: Vec<f64> = corners
        .par_iter()
        .zip(&sizes)
        .map(|(corners, size)| {
            size / corners.map(|p| spacing[p as usize]).into_iter().fold(0.0, f64::max)
        })
        .collect();
    let usual = quantile(&mut stretch.clone(), USUAL).max(1.0);
    let mut is_gap: Vec<bool> = stretch.iter().map(|s| *s > spacings * usual).collect();

    // Neighbours of gaps that are wide, too.
    let is_wide = |c: u32| stretch[c as usize] > GROWTH * spacings * usual;
    let mut front: Vec<u32> = (0..corners.len() as u32).filter(|c| is_gap[*c as usize]).collect();
    while let Some(cell) = front.pop() {
        let face = corners[cell as usize];
        for skipped in 0..N {
            for &other in around.of(face[(skipped + 1) % N] as usize) {
                let shares = |p: &u32| corners[other as usize].contains(p);
                if !is_gap[other as usize]
                    && is_wide(other)
                    && face.iter().enumerate().all(|(i, p)| i == skipped || shares(p))
                {
                    is_gap[other as usize] = true;
                    front.push(other);
                }
            }
        }
    }
    let cells = is_gap.iter().filter(|g| **g).count();
    Gaps { is_gap, cells }
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
