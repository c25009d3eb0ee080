//! Integrates rays cell by cell: steps end on the faces of the lattice's cells, with Gauss's rule
//! between them. The reference for interpolated fields.
//!
//! Within a cell an interpolant is one polynomial; across a face one of its derivatives jumps
//! (trilinear: the gradient; trilinear gradients: their slope; the cubic spline: its third
//! derivative). An integrator that steps over a face loses its order there. An adaptive one does
//! not notice, because its estimate compares two formulas that use the same few points
//! (`adaptive_estimates_are_fooled_by_kinks`). Here no step uses samples from both sides of a face.
//!
//! Along a straight line a trilinear function is a cubic polynomial and its gradient a quadratic
//! one, so Gauss's rule with two points integrates both without error; the cubic spline in three
//! variables is of degree 9, which needs five points. Bent rays use the collocation method on three
//! Gauss points (Kuntzmann and Butcher; Hairer, Nørsett, Wanner, *Solving Ordinary Differential
//! Equations I*, table II.7.4): order 6, symmetric and symplectic. On a straight ray it is the
//! three-point rule.

use super::integrator::{Integrator, Medium, Rate, Ray};
use crate::field::Field;
use glam::DVec3;

/// Splits steps at the faces of a field's cells.
///
/// As an [`Integrator`] it takes steps of any positive length and splits each where it crosses
/// faces. A ray in a face belongs to the upper cell, as for the interpolants. A ray that is bent
/// towards a face from both sides (a ridge of a trilinear eps) zigzags along it in thousands of
/// steps per cell.
///
/// ```
/// use glam::DVec3;
/// use schlieren::field::Field;
/// use schlieren::interpolate::Trilinear;
/// use schlieren::march::{CellExact, InterpolatedMedium, Points};
///
/// // eps = 1e-5 x y z is trilinear: the interpolant is the function itself.
/// let field = Field::from_fn([5; 3], [1.0; 3], DVec3::ZERO, 1.0, |p| 1e-5 * p.x * p.y * p.z)?;
/// let trilinear = Trilinear::new(&field);
/// let medium = InterpolatedMedium::new(&field, &trilinear);
/// let diagonal = DVec3::ONE.normalize();
/// let (march, length_m) = (CellExact::new(&field), 48f64.sqrt());
/// let s = march.line_of_sight(&medium, DVec3::ZERO, diagonal, length_m, Points::Two);
/// // From corner to corner, x = y = z = s/√3.
/// assert!((s.path_m - 1e-5 * 64.0 * 48f64.sqrt() / 4.0).abs() < 1e-9);
/// assert!((s.slope.x - 1e-5 * 16.0 * 48f64.sqrt() / 3.0).abs() < 1e-9);
/// # Ok::<(), schlieren::field::FieldError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct CellExact {
    origin_m: DVec3,
    spacing_m: DVec3,
    last: DVec3,
}

/// Gauss points in each cell along a straight line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Points {
    /// Exact for cubic polynomials: trilinear eps and gradients.
    Two,
    /// Exact up to degree 5.
    #[default]
    Three,
    /// Exact up to degree 9: the cubic spline in three variables.
    Five,
}

impl Points {
    /// Positions in 0..1 and weights, whose sum is 1.
    fn rule(self) -> &'static [(f64, f64)] {
        const TWO: [(f64, f64); 2] =
            [(0.211_324_865_405_187_1, 0.5), (0.788_675_134_594_812_9, 0.5)];
        const THREE: [(f64, f64); 3] = [(C[0], B[0]), (C[1], B[1]), (C[2], B[2])];
        const FIVE: [(f64, f64); 5] = [
            (0.046_910_077_030_668_0, 0.118_463_442_528_094_54),
            (0.230_765_344_947_158_45, 0.239_314_335_249_683_23),
            (0.5, 0.284_444_444_444_444_44),
            (0.769_234_655_052_841_5, 0.239_314_335_249_683_23),
            (0.953_089_922_969_332, 0.118_463_442_528_094_54),
        ];
        match self {
            Points::Two => &TWO,
            Points::Three => &THREE,
            Points::Five => &FIVE,
        }
    }
}

/// Integrals along a straight line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineIntegrals {
    /// Integral of the gradient of eps. Its part across the line is the deflection to first order,
    /// in rad.
    pub slope: DVec3,
    /// Integral of eps: the optical path difference to first order, divided by n0.
    pub path_m: f64,
    /// Number of segments of the line, each in one cell.
    pub pieces: u32,
}

/// Points and weights of Gauss's rule on 0..1: 1/2 ∓ √15/10.
const C: [f64; 3] = [0.112_701_665_379_258_31, 0.5, 0.887_298_334_620_741_7];
const B: [f64; 3] = [5.0 / 18.0, 4.0 / 9.0, 5.0 / 18.0];
const ROOT_15: f64 = 3.872_983_346_207_417;
const A: [[f64; 3]; 3] = [
    [5.0 / 36.0, 2.0 / 9.0 - ROOT_15 / 15.0, 5.0 / 36.0 - ROOT_15 / 30.0],
    [5.0 / 36.0 + ROOT_15 / 24.0, 2.0 / 9.0, 5.0 / 36.0 - ROOT_15 / 24.0],
    [5.0 / 36.0 + ROOT_15 / 30.0, 2.0 / 9.0 + ROOT_15 / 15.0, 5.0 / 36.0],
];

/// A ray closer than this to a face, in cells, counts as on it. The rounding of coordinates in the
/// thousands is a thousandth of this.
const ON_FACE: f64 = 1e-10;
/// Largest distance beyond a face, in cells, at which a step may end.
const BEYOND: f64 = 1e-11;

impl CellExact {
    /// Splits steps at the cells of `field`.
    pub fn new(field: &Field) -> CellExact {
        let d = field.dims();
        CellExact {
            origin_m: field.origin_m(),
            spacing_m: DVec3::from(field.spacing_m()),
            last: DVec3::new((d[0] - 1) as f64, (d[1] - 1) as f64, (d[2] - 1) as f64),
        }
    }

    fn lattice(&self, at_m: DVec3) -> DVec3 {
        (at_m - self.origin_m) / self.spacing_m
    }

    /// Integrals along a line from `start_m` in `direction` (of length one) over `length_m`, with
    /// Gauss's rule between every two faces.
    pub fn line_of_sight(
        &self,
        medium: &impl Medium,
        start_m: DVec3,
        direction: DVec3,
        length_m: f64,
        points: Points,
    ) -> LineIntegrals {
        // The distance to each face is computed from the face's index, so no rounding accumulates.
        let (from, rate) = (self.lattice(start_m), direction / self.spacing_m);
        let mut ends = vec![0.0, length_m];
        for c in 0..3 {
            if rate[c] != 0.0 {
                let (a, b) = (from[c], from[c] + rate[c] * length_m);
                let first = a.min(b).ceil().clamp(0.0, self.last[c]);
                let after = a.max(b).floor().clamp(0.0, self.last[c]);
                let faces = first as u64..=after as u64;
                ends.extend(faces.map(|i| (i as f64 - from[c]) / rate[c]));
            }
        }
        ends.retain(|s| (0.0..=length_m).contains(s));
        ends.sort_unstable_by(f64::total_cmp);
        let mut out = LineIntegrals { slope: DVec3::ZERO, path_m: 0.0, pieces: 0 };
        for pair in ends.windows(2) {
            let piece_m = pair[1] - pair[0];
            if piece_m <= 0.0 {
                continue;
            }
            out.pieces += 1;
            for (abscissa, weight) in points.rule() {
                let (eps, gradient) =
                    medium.sample(start_m + direction * (pair[0] + abscissa * piece_m));
                out.path_m += eps * (weight * piece_m);
                out.slope += gradient * (weight * piece_m);
            }
        }
        out
    }

    /// Lowest and highest coordinates of the cell that a ray is in, or enters when it is on a face.
    /// Infinite outside the lattice, where values are continued.
    fn cell(&self, at: DVec3, rate: DVec3) -> [DVec3; 2] {
        let (mut low, mut high) = (DVec3::NEG_INFINITY, DVec3::INFINITY);
        for c in 0..3 {
            let below = if rate[c] < 0.0 {
                (at[c] - ON_FACE).ceil() - 1.0
            } else {
                (at[c] + ON_FACE).floor()
            };
            if below >= 0.0 {
                low[c] = below.min(self.last[c]);
            }
            if below < self.last[c] {
                high[c] = (below + 1.0).max(0.0);
            }
        }
        [low, high]
    }
}

/// A medium restricted to one cell: outside the cell it has the values on the cell's faces. Without
/// this the collocation points of a step that is still too long would sample the next cell, and
/// where the two cells bend light in opposite directions the equations would have no solution.
struct ClampedMedium<'a, M> {
    medium: &'a M,
    low_m: DVec3,
    high_m: DVec3,
}

impl<M: Medium> Medium for ClampedMedium<'_, M> {
    fn sample(&self, at_m: DVec3) -> (f64, DVec3) {
        // Not `clamp`, which panics when a bound is NaN.
        self.medium.sample(at_m.max(self.low_m).min(self.high_m))
    }
}

/// Distance of a point outside a cell (negative inside), and the axis along which it is measured.
fn outside([low, high]: [DVec3; 2], at: DVec3) -> (f64, usize) {
    let by = (low - at).max(at - high);
    let axis = if by.x >= by.y && by.x >= by.z { 0 } else { 1 + usize::from(by.z > by.y) };
    (by[axis], axis)
}

/// One step of the collocation method. Its three equations are solved by fixed-point iteration,
/// which converges because the gas is thin or the cell small.
fn collocation(medium: &impl Medium, ray: &Ray, step_m: f64) -> Ray {
    const ROUNDS: u32 = 16;
    let stage = |i: usize, k: &[Rate; 3]| {
        let mut at =
            ray.after(step_m, &Rate::sum(&[(A[i][0], &k[0]), (A[i][1], &k[1]), (A[i][2], &k[2])]));
        at.tau_m = ray.tau_m + C[i] * step_m;
        at.rate(medium)
    };
    let mut k = [Rate { xi: ray.u, u: DVec3::ZERO, excess: 0.0 }; 3];
    for _ in 0..ROUNDS {
        let next = [0, 1, 2].map(|i| stage(i, &k));
        let change =
            |i: usize| (next[i].xi - k[i].xi).length() + (next[i].u - k[i].u).length() * step_m;
        let size = |i: usize| next[i].xi.length() + next[i].u.length() * step_m;
        let done = (0..3).all(|i| change(i) <= 1e-16 * size(i));
        k = next;
        if done {
            break;
        }
    }
    ray.after(step_m, &Rate::sum(&[(B[0], &k[0]), (B[1], &k[1]), (B[2], &k[2])]))
}

impl Integrator for CellExact {
    /// Holds for a medium that is smooth within each cell.
    const ORDER: u32 = 6;
    /// Per iteration of the collocation equations, in each cell.
    const SAMPLES: u32 = 3;

    fn step(&self, medium: &impl Medium, ray: &Ray, dtau_m: f64) -> Ray {
        let end_m = ray.tau_m + dtau_m;
        let least_m = 1e-9 * self.spacing_m.min_element();
        let mut r = *ray;
        // The least step bounds the number of segments; this bound is for media that return NaN.
        for _ in 0..1_000_000 {
            let left_m = end_m - r.tau_m;
            if left_m.is_nan() || left_m <= 0.0 {
                break;
            }
            let (at, rate) = (self.lattice(r.position_m()), r.w() / self.spacing_m);
            let cell = self.cell(at, rate);
            let inside = ClampedMedium {
                medium,
                low_m: self.origin_m + (cell[0] + BEYOND) * self.spacing_m,
                high_m: self.origin_m + (cell[1] - BEYOND) * self.spacing_m,
            };
            // Distance to where a straight ray leaves the cell. A bent ray may end a little before
            // the face; the next step then continues from there.
            let to_face = |c: usize| {
                let face = if rate[c] > 0.0 { cell[1][c] } else { cell[0][c] };
                if rate[c] == 0.0 { f64::INFINITY } else { (face - at[c]) / rate[c] }
            };
            let mut step_m =
                to_face(0).min(to_face(1)).min(to_face(2)).clamp(least_m, left_m.max(least_m));
            let mut next = collocation(&inside, &r, step_m);
            // A bent ray may also end beyond the face: the step is then shortened by the rate at
            // which the ray leaves.
            for _ in 0..60 {
                let (by, axis) = outside(cell, self.lattice(next.position_m()));
                if by.is_nan() || by <= BEYOND || step_m <= least_m {
                    break;
                }
                let leaving = (next.w() / self.spacing_m)[axis].abs();
                let shorter = step_m - by / leaving;
                step_m = if shorter > 0.1 * step_m { shorter } else { 0.5 * step_m }.max(least_m);
                next = collocation(&inside, &r, step_m);
            }
            r = next;
            if step_m >= left_m {
                r.tau_m = end_m;
            }
        }
        r
    }
}
