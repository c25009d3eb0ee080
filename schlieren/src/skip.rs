//! Skips bricks of nearly uniform gas, with a bound on the deflection that this neglects.
//!
//! Bricks replace the dissertation's octree of step lengths (section 5.3.2), whose threshold had no
//! unit. A brick stores the largest |grad eps| of the interpolant in and around it. This times the
//! length of the ray's chord is the largest angle, in radians, by which the brick can deflect the
//! ray. Rays sum these angles over the bricks that they skip, and stop skipping when the sum would
//! exceed the tolerance.

use crate::field::Field;
use crate::interpolate::BSpline;
use rayon::prelude::*;
use std::time::{Duration, Instant};

/// Lattice steps along a brick's edge.
pub const EDGE: usize = 8;

/// Bounds over a brick and its 26 neighbours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Brick {
    /// Bound on |grad eps|.
    pub max_gradient_per_m: f32,
    /// Centre of the range of eps.
    pub mean_eps: f32,
    /// Half the range of eps: the largest distance of any value from `mean_eps`.
    pub half_range_eps: f32,
    /// Whether some nodes are not gas.
    pub has_nodes: bool,
}

/// The bricks of a field.
#[derive(Debug)]
pub struct Bricks {
    bricks: Vec<Brick>,
    dims: [usize; 3],
    build: Duration,
}

impl Bricks {
    /// Computes bounds for the B-spline through a field. They also hold for the trilinear
    /// interpolants, which stay between the values and differences of the nodes.
    pub fn new(field: &Field, spline: &BSpline) -> Bricks {
        Bricks::in_jobs_of(field, spline, 1)
    }

    /// [`Bricks::new`] on the calling thread alone, which waits for no other thread.
    #[cfg(feature = "gpu")]
    pub(crate) fn on_this_thread(field: &Field, spline: &BSpline) -> Bricks {
        // Rayon does not divide ranges that are shorter than this minimum, and an undivided range
        // runs on the calling thread.
        Bricks::in_jobs_of(field, spline, usize::MAX)
    }

    /// [`Bricks::new`] in rayon jobs of at least `least` bricks.
    fn in_jobs_of(field: &Field, spline: &BSpline, least: usize) -> Bricks {
        let start = Instant::now();
        let [nx, ny, nz] = field.dims();
        let dims = field.dims().map(|n| (n - 1).div_ceil(EDGE));
        let (coefficients, [sy, sz]) = spline.coefficients();
        let rcp_h = field.spacing_m().map(|h| 1.0 / h);
        // The B-spline is a convex combination of coefficients, and its derivative along an axis is
        // a convex combination of their differences. Bounds on these are therefore bounds on the
        // spline. A brick's cells i..i+8 use coefficients i-1..=i+10; in the padded array the
        // indices are larger by one.
        let own: Vec<Brick> = (0..dims[0] * dims[1] * dims[2])
            .into_par_iter()
            .with_min_len(least)
            .map(|b| {
                let first = [
                    b % dims[0] * EDGE,
                    b / dims[0] % dims[1] * EDGE,
                    b / (dims[0] * dims[1]) * EDGE,
                ];
                let size = [nx, ny, nz];
                let (mut lo, mut hi) = (f32::INFINITY, f32::NEG_INFINITY);
                let mut steepest = [0.0f32; 3];
                let end: [usize; 3] =
                    std::array::from_fn(|c| (first[c] + EDGE + 2).min(size[c] + 1));
                for k in first[2]..=end[2] {
                    for j in first[1]..=end[1] {
                        for i in first[0]..=end[0] {
                            let o = i + j * sy + k * sz;
                            let v = coefficients[o];
                            lo = lo.min(v);
                            hi = hi.max(v);
                            for (c, stride) in [1, sy, sz].into_iter().enumerate() {
                                if [i, j, k][c] < end[c] {
                                    steepest[c] =
                                        steepest[c].max((coefficients[o + stride] - v).abs());
                                }
                            }
                        }
                    }
                }
                let mut has_nodes = false;
                let mut values = (f32::INFINITY, f32::NEG_INFINITY);
                for k in first[2]..=(first[2] + EDGE).min(nz - 1) {
                    for j in first[1]..=(first[1] + EDGE).min(ny - 1) {
                        let row = (j + k * ny) * nx;
                        let range = row + first[0]..=row + (first[0] + EDGE).min(nx - 1);
                        for o in range.clone() {
                            values = (values.0.min(field.eps()[o]), values.1.max(field.eps()[o]));
                        }
                        has_nodes |=
                            field.nodes().is_some_and(|n| n[range].iter().any(|k| *k as u8 != 0));
                    }
                }
                let (lo, hi) = (lo.min(values.0), hi.max(values.1));
                let squared: f64 =
                    (0..3).map(|c| (f64::from(steepest[c]) * rcp_h[c]).powi(2)).sum();
                Brick {
                    max_gradient_per_m: squared.sqrt() as f32,
                    mean_eps: 0.5 * (lo + hi),
                    half_range_eps: 0.5 * (hi - lo),
                    has_nodes,
                }
            })
            .collect();

        // A ray looks up the brick at the midpoint of a stride, which is at most a brick long. The
        // neighbours bound the rest of the stride.
        let bricks = (0..own.len())
            .into_par_iter()
            .with_min_len(least)
            .map(|b| {
                let at = [b % dims[0], b / dims[0] % dims[1], b / (dims[0] * dims[1])];
                let range = |c: usize| at[c].saturating_sub(1)..=(at[c] + 1).min(dims[c] - 1);
                let (mut lo, mut hi, mut steepest, mut has_nodes) =
                    (f32::INFINITY, f32::NEG_INFINITY, 0.0f32, false);
                for k in range(2) {
                    for j in range(1) {
                        for i in range(0) {
                            let o = own[i + (j + k * dims[1]) * dims[0]];
                            lo = lo.min(o.mean_eps - o.half_range_eps);
                            hi = hi.max(o.mean_eps + o.half_range_eps);
                            steepest = steepest.max(o.max_gradient_per_m);
                            has_nodes |= o.has_nodes;
                        }
                    }
                }
                Brick {
                    max_gradient_per_m: steepest,
                    mean_eps: 0.5 * (lo + hi),
                    half_range_eps: 0.5 * (hi - lo),
                    has_nodes,
                }
            })
            .collect();
        Bricks { bricks, dims, build: start.elapsed() }
    }

    /// All bricks, x fastest.
    #[cfg(feature = "gpu")]
    pub(crate) fn all(&self) -> &[Brick] {
        &self.bricks
    }

    /// The bounds at a point in lattice coordinates. Points outside use the nearest brick.
    #[inline(always)]
    pub fn around(&self, at: [f32; 3]) -> Brick {
        // Conversions saturate: negative numbers and NaN map to brick 0.
        let [x, y, z] = at;
        let b = [x as usize / EDGE, y as usize / EDGE, z as usize / EDGE];
        let [nx, ny, nz] = self.dims;
        self.bricks[b[0].min(nx - 1) + (b[1].min(ny - 1) + b[2].min(nz - 1) * ny) * nx]
    }

    /// The largest |grad eps| of all bricks.
    pub fn max_gradient_per_m(&self) -> f64 {
        self.bricks.iter().map(|b| f64::from(b.max_gradient_per_m)).fold(0.0, f64::max)
    }

    /// Memory of the bricks in bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&self.bricks[..])
    }

    /// Time to build the bricks.
    pub fn build_time(&self) -> Duration {
        self.build
    }
}
