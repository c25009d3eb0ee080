//! The polynomial around a point of a mesh.

use super::Symmetry;
use super::cell_moments::CellMoments;
use super::counts::Counts;
use super::least_squares::NormalEquations;
use super::neighbours::Neighbourhood;
use super::polynomial::{TERMS, TERMS_TO_DEGREE, means, monomials};
use super::quartic;
use super::sample::{NEAREST_SQUARE, Sample, within};
use crate::resample::mesh::Mesh;
use glam::DVec3;

/// Equations for each unknown, at least.
const EQUATIONS_PER_TERM: f64 = 1.25;

/// A polynomial whose residual, as a part of the variation around the point, is below the first
/// number is used as it is; from the second on, it is not used. Steps and noise leave more than the
/// second, and a bell whose width is three cells less than the first (a test has both).
const RESIDUAL: [f64; 2] = [0.1, 0.25];

/// Four values along a line leave nothing of a cubic polynomial to judge it by, and cells around a
/// point, or points at a border, are no more. The residual of the polynomial of second degree on
/// the same values counts too, times this.
const QUADRATIC_SHARE: f64 = 0.7;

/// Where a polynomial gives way, the error is larger than what the spline adds: a step between two
/// points may be anywhere between them. Counted twice, it is 107 times the error of a bell three
/// cells wide on hexahedra, which says nothing any more.
pub(in crate::resample) const UNRESOLVED: f64 = 1.75;

/// Number of coefficients of a polynomial of second degree.
const SPLINE: usize = 1 + TERMS_TO_DEGREE[2];

/// How far a polynomial may go beyond the values around the point, as a part of their range: a
/// maximum between points is higher than they are. Beyond, it bends over within as much again.
const BEYOND: f64 = 0.25;
/// As much for a spline in its place: of a maximum at a shock, nothing is known.
const SPLINE_BEYOND: f64 = 0.02;

/// How well a polynomial fits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum State {
    Fitted,
    Limited,
    FewNeighbours,
    NoValue,
}

/// A polynomial in a frame of its own, in which the neighbours have the same spread along all axes:
/// in stretched cells, a polynomial in lengths would have coefficients whose sum loses all digits.
#[derive(Debug, Clone, Copy)]
pub(in crate::resample) struct Expansion {
    parts: Parts,
    state: State,
}

/// The numbers of an [`Expansion`].
#[derive(Debug, Clone, Copy)]
pub(in crate::resample) struct Parts {
    /// Lower triangle of the matrix from distances to the frame: xx, yx, yy, zx, zy, zz.
    pub(in crate::resample) frame: [f32; 6],
    /// What is added to the point's value, and the coefficients of the monomials.
    pub(in crate::resample) constant: f32,
    pub(in crate::resample) terms: [f32; TERMS],
    pub(in crate::resample) bounds: Bounds,
}

impl Parts {
    /// The same polynomial times a factor.
    pub(in crate::resample) fn times(&self, factor: f32) -> Parts {
        Parts {
            frame: self.frame,
            constant: factor * self.constant,
            terms: self.terms.map(|c| factor * c),
            bounds: self.bounds.times(factor),
        }
    }
}

/// Bounds of what is added to a point's value. From there on it grows ever slower, without a kink,
/// and by the slack at most.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::resample) struct Bounds {
    pub(in crate::resample) low: f32,
    pub(in crate::resample) high: f32,
    pub(in crate::resample) slack: f32,
}

impl Bounds {
    fn times(self, factor: f32) -> Bounds {
        let ends = [self.low * factor, self.high * factor];
        let slack = self.slack * factor.abs();
        Bounds { low: ends[0].min(ends[1]), high: ends[0].max(ends[1]), slack }
    }

    fn bounded(&self, x: f64) -> f64 {
        let within = x.clamp(f64::from(self.low), f64::from(self.high));
        let slack = f64::from(self.slack);
        let beyond = (x - within).clamp(-2.0 * slack, 2.0 * slack);
        // A parabola that ends without slope at twice the slack.
        let less = if slack > 0.0 { beyond * beyond.abs() / (4.0 * slack) } else { 0.0 };
        within + (beyond - less)
    }
}

impl Expansion {
    /// Adds nothing to the point's value.
    const fn nothing(state: State) -> Expansion {
        let parts = Parts {
            frame: [0.0; 6],
            constant: 0.0,
            terms: [0.0; TERMS],
            bounds: Bounds { low: 0.0, high: 0.0, slack: 0.0 },
        };
        Expansion { parts, state }
    }

    /// The numbers of the polynomial.
    pub(in crate::resample) fn parts(&self) -> &Parts {
        &self.parts
    }

    pub(super) fn state(&self) -> State {
        self.state
    }

    /// Whether a spline takes the polynomial's place, wholly or in part.
    pub(in crate::resample) fn is_limited(&self) -> bool {
        self.state == State::Limited
    }

    /// Whether the polynomial is used as it is.
    pub(in crate::resample) fn is_whole(&self) -> bool {
        self.state == State::Fitted
    }

    /// The value at distance `d` from the point, whose own value is `value`.
    #[inline]
    pub(super) fn at(&self, value: f64, d: DVec3) -> f64 {
        value + self.change(d, [1.0; 3])
    }

    /// What is added to the point's value at distance `d`, with a factor for the terms of each
    /// degree ([`factors`]).
    #[inline]
    pub(super) fn change(&self, d: DVec3, factors: [f64; 3]) -> f64 {
        let Parts { frame, constant, terms: own, bounds } = &self.parts;
        let terms = monomials(in_frame(frame, d));
        let of = |degree: usize| -> f64 {
            let range = TERMS_TO_DEGREE[degree - 1]..TERMS_TO_DEGREE[degree];
            let terms = own[range.clone()].iter().zip(&terms[range]);
            factors[degree - 1] * terms.map(|(c, m)| f64::from(*c) * m).sum::<f64>()
        };
        bounds.bounded(f64::from(*constant) + (of(1) + of(2) + of(3)))
    }
}

/// Factors of the terms of degree 1 to 3 in a mean of the corners' polynomials. `whole` is the
/// share of corners whose polynomials are used as they are.
///
/// For shares with Σ Nᵢ xᵢ = x and Σ Nᵢ = 1, as those of elements are, the mean of Taylor
/// polynomials of degree n whose terms of degree k have the factor 1 - k/(n + 1) is exact for
/// polynomials of degree n + 1, where the mean of the polynomials themselves is exact for degree n
/// (Kraaijpoel and van Leeuwen, "Raising the order of multivariate approximation schemes using
/// supplementary derivative data", 2010). Factors must be the same for all corners, or not even
/// lines are exact. The share is continuous, so the value is too.
pub(in crate::resample) fn factors(whole: f64) -> [f64; 3] {
    [1.0, 2.0, 3.0].map(|k| 1.0 - FACTOR_FALL * k * whole)
}

/// What [`factors`] gain over the mean of the polynomials themselves, times this, is the estimate
/// of the error. Once would be above the error of bells; in layers two cells thick, polynomials are
/// wrong by more than they differ: up to three times, of thirty gases on two meshes and two views.
pub(in crate::resample) const CAUTION: f64 = 4.0;

/// What the factor of a whole polynomial's terms loses with each degree: 1/(n + 1).
pub(in crate::resample) const FACTOR_FALL: f64 = 0.25;

#[inline]
fn in_frame(f: &[f32; 6], d: DVec3) -> DVec3 {
    let f = f.map(f64::from);
    DVec3::new(f[0] * d.x, f[1] * d.x + f[2] * d.y, f[3] * d.x + f[4] * d.y + f[5] * d.z)
}

/// Second moments in the frame.
fn moments_in_frame(f: &[f32; 6], s: [f64; 6]) -> [f64; 6] {
    let rows = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| in_frame(f, axis));
    // The columns of the matrix are the images of the axes.
    let row = |i: usize| DVec3::new(rows[0][i], rows[1][i], rows[2][i]);
    let times = |v: DVec3| {
        DVec3::new(
            s[0] * v.x + s[1] * v.y + s[2] * v.z,
            s[1] * v.x + s[3] * v.y + s[4] * v.z,
            s[2] * v.x + s[4] * v.y + s[5] * v.z,
        )
    };
    let (x, y, z) = (row(0), row(1), row(2));
    [
        x.dot(times(x)),
        x.dot(times(y)),
        x.dot(times(z)),
        y.dot(times(y)),
        y.dot(times(z)),
        z.dot(times(z)),
    ]
}

/// The inverse of the Cholesky factor of the neighbours' spread; `None` when they are all at one
/// place.
fn frame_of(spread: [f64; 6]) -> Option<[f32; 6]> {
    let [xx, xy, xz, yy, yz, zz] = spread;
    let size = xx + yy + zz;
    if !(size > 0.0 && size.is_finite()) {
        return None;
    }
    // Of a plane without thickness, the normal gets a scale all the same.
    let least = 1e-20 * size;
    let a = (xx + least).sqrt();
    let (b, c) = (xy / a, xz / a);
    let d = (yy - b * b).max(least).sqrt();
    let e = (yz - b * c) / d;
    let f = (zz - c * c - e * e).max(least).sqrt();
    let frame = [1.0 / a, -b / (a * d), 1.0 / d, (b * e / d - c) / (a * f), -e / (d * f), 1.0 / f];
    let frame = frame.map(|x| x as f32);
    frame.iter().all(|x| x.is_finite()).then_some(frame)
}

/// The fitting of one polynomial; memory that is used again.
#[derive(Default)]
pub(super) struct Fit {
    samples: Vec<Sample>,
}

impl Fit {
    /// A polynomial through the value of `point`.
    pub(super) fn over_points(
        &mut self,
        mesh: &Mesh,
        values: &[f64],
        point: usize,
        around: &Neighbourhood,
        symmetry: Symmetry,
    ) -> Expansion {
        let (value, place) = (values[point], mesh.point(point));
        let radius = (symmetry == Symmetry::Axis).then_some(place.y);
        if !(value.is_finite() && place.is_finite()) {
            return Expansion::nothing(State::NoValue);
        }
        let distance = |id: u32| mesh.point(id as usize) - place;
        let Some(frame) = frame_of(around.spread(distance, |_| [0.0; 6])) else {
            return Expansion::nothing(State::FewNeighbours);
        };
        self.take(&around.ids, &frame, radius, |id| {
            (distance(id), [0.0; 6], values[id as usize] - value)
        });
        self.fit(frame, rounding(value), false)
    }

    /// A polynomial whose averages over the cells around `point` are near those of `cells`. `value`
    /// remains where none fits.
    pub(super) fn over_cells(
        &mut self,
        mesh: &Mesh,
        cells: &[f64],
        moments: &CellMoments,
        value: f64,
        point: usize,
        around: &Neighbourhood,
        symmetry: Symmetry,
    ) -> Expansion {
        let place = mesh.point(point);
        let radius = (symmetry == Symmetry::Axis).then_some(place.y);
        if !(value.is_finite() && place.is_finite()) {
            return Expansion::nothing(State::NoValue);
        }
        let distance = |id: u32| moments.get(id as usize).centre - place;
        // A point at a corner of the mesh has one cell, which alone would be a direction only.
        let own = |id: u32| moments.get(id as usize).second;
        let Some(frame) = frame_of(around.spread(distance, own)) else {
            return Expansion::nothing(State::FewNeighbours);
        };
        self.take(&around.ids, &frame, radius, |id| {
            (distance(id), own(id), cells[id as usize] - value)
        });
        self.fit(frame, rounding(value), true)
    }

    /// Takes the samples of `ids`, each with its distance from the point, its second moments and
    /// its value. In an axisymmetric flow, the value is there on the other side of the axis too:
    /// reflected samples are added where they are no farther than the others. `radius` is that of
    /// the point.
    fn take(
        &mut self,
        ids: &[u32],
        frame: &[f32; 6],
        radius: Option<f64>,
        of: impl Fn(u32) -> (DVec3, [f64; 6], f64),
    ) {
        let sample = |id: u32, distance: DVec3, second: [f64; 6], value: f64| {
            let place = in_frame(frame, distance);
            let second = moments_in_frame(frame, second);
            Sample { square: place.length_squared(), id, value, place, second }
        };
        self.samples.clear();
        self.samples.extend(ids.iter().map(|&id| {
            let (distance, second, value) = of(id);
            sample(id, distance, second, value)
        }));
        let Some(radius) = radius else { return };
        let farthest = self.samples.iter().map(|s| s.square).fold(0.0, f64::max);
        for &id in ids {
            let (distance, [xx, xy, xz, yy, yz, zz], value) = of(id);
            let to_axis = radius + distance.y;
            let distance = distance - 2.0 * to_axis * DVec3::Y;
            let reflected = sample(id, distance, [xx, -xy, xz, yy, -yz, zz], value);
            if to_axis > 0.0 && reflected.square <= farthest {
                self.samples.push(reflected);
            }
        }
    }

    /// Fits to the samples.
    fn fit(&mut self, frame: [f32; 6], rounding: f64, free: bool) -> Expansion {
        let finite = |s: &Sample| s.value.is_finite() && s.square.is_finite();
        self.samples.retain(|s| finite(s) && (s.square > 0.0 || free));
        // The number breaks ties, so that the order does not depend on how they were found.
        self.samples.sort_unstable_by(|a, b| a.square.total_cmp(&b.square).then(a.id.cmp(&b.id)));
        let counts = Counts::of(self.samples.iter().map(|s| s.place), free);
        let around = within(&self.samples, counts.nearest).iter();
        let (low, high) =
            around.fold((0.0f64, 0.0f64), |(l, h), s| (l.min(s.value), h.max(s.value)));
        let mut best = None;
        for wanted in [counts.nearest, counts.more] {
            let samples = within(&self.samples, wanted);
            let solution = Solution::of(samples, counts, rounding, free);
            let complete = solution.as_ref().is_some_and(|s| s.complete);
            best = solution.or(best);
            if complete || samples.len() == self.samples.len() {
                break;
            }
        }
        let Some(solution) = best else { return Expansion::nothing(State::FewNeighbours) };
        let share = share_of(solution.residual);
        let mut coefficients = solution.coefficients.map(|c| share * c);
        if share == 1.0
            && solution.degree == 3
            && !free
            && let Some(terms) =
                quartic::to_third_degree(within(&self.samples, counts.quartic), counts)
        {
            coefficients[1..].copy_from_slice(&terms);
        }
        if share < 1.0 {
            let mut spline = spline_at(&self.samples, counts, free);
            // It goes through the point's value. With the spline's own, or half-way, a shock that
            // crosses long cells is smoother, but bells of four cells lose 9 % of their height.
            if !free {
                spline[0] = 0.0;
            }
            for (sum, c) in coefficients.iter_mut().zip(spline) {
                *sum += (1.0 - share) * c;
            }
        }
        let (range, beyond) = (high - low, share * BEYOND);
        let slack = range * (beyond + (1.0 - share) * SPLINE_BEYOND);
        let (low, high) = (low - beyond * range, high + beyond * range);
        let [constant, terms @ ..] = coefficients.map(|c| c as f32);
        let bounds = Bounds { low: low as f32, high: high as f32, slack: slack as f32 };
        Expansion {
            parts: Parts { frame, constant, terms, bounds },
            state: match (share, solution.degree) {
                (_, 0 | 1) => State::FewNeighbours,
                (1.0, _) => State::Fitted,
                _ => State::Limited,
            },
        }
    }
}

/// Value, gradient and second derivatives at a point of a cubic B-spline whose coefficients are the
/// values (de Boor, "A Practical Guide to Splines", 2001). It makes no new extrema, and has no
/// kinks. On a grid they are those of polynomials of first and second degree that are fitted with
/// the spline's weights: 4 : 1 along an axis, and products of these across. A point that is not
/// `free` has a value too, zero.
fn spline_at(samples: &[Sample], counts: Counts, free: bool) -> [f64; SPLINE] {
    let samples = within(samples, counts.adjacent);
    let next = within(samples, counts.next);
    let square = next.iter().map(|s| s.square).sum::<f64>() / next.len() as f64;
    let mut equations = NormalEquations::<SPLINE>::EMPTY;
    let mut row = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    if !free {
        equations.add(&row, 0.0, 1.0, SPLINE);
    }
    for s in samples {
        row[1..].copy_from_slice(&means(s.place, s.second)[..SPLINE - 1]);
        equations.add(&row, s.value, (-2.0 * s.square / square).exp2(), SPLINE);
    }
    let line = 1 + TERMS_TO_DEGREE[1];
    let mut spline = equations.solve(SPLINE);
    spline[..line].copy_from_slice(&equations.solve(line)[..line]);
    spline
}

/// Most files have values in f32. Where these differ by rounding only, there is nothing to limit.
fn rounding(value: f64) -> f64 {
    value.abs() * f64::from(f32::EPSILON)
}

/// The share of a polynomial that is used: 1 for small residuals, 0 for large ones, smooth between.
fn share_of(residual: f64) -> f64 {
    let [whole, none] = RESIDUAL;
    let x = ((none - residual) / (none - whole)).clamp(0.0, 1.0);
    // NaN is not used.
    if x.is_nan() { 0.0 } else { x * x * (3.0 - 2.0 * x) }
}

/// A polynomial and how well it fits.
struct Solution {
    /// The constant, and the coefficients of the monomials.
    coefficients: [f64; TERMS + 1],
    degree: usize,
    /// Root mean square of the residuals by that of the values, for as many equations as there are
    /// more than unknowns.
    residual: f64,
    /// Whether the samples determine all powers up to the third degree.
    complete: bool,
}

impl Solution {
    /// `None` with too few samples for a gradient. A polynomial that is not `free` has no constant.
    fn of(samples: &[Sample], counts: Counts, rounding: f64, free: bool) -> Option<Solution> {
        let constant = usize::from(free);
        let enough = |d: &usize| {
            samples.len() as f64 >= EQUATIONS_PER_TERM * (counts.terms[*d] + constant) as f64
        };
        let degree = (1..=3).rev().find(enough)?;
        // The constant is the first unknown; without it, its column is zero and is left out.
        let used = 1 + TERMS_TO_DEGREE[degree];
        let row = |s: &Sample| {
            let mut row = [0.0; TERMS + 1];
            row[0] = constant as f64;
            row[1..].copy_from_slice(&means(s.place, s.second));
            row
        };
        // The error of a cubic polynomial grows with the fourth power of the distance. Deflections
        // through a bell have half the error that weights of the fourth power give.
        let weight = |s: &Sample| s.square.max(NEAREST_SQUARE).powi(-4);
        // With these weights, the polynomial goes through the nearest values whatever they are. So
        // it is judged by those around too.
        let judged = |s: &Sample| s.square.max(NEAREST_SQUARE).powi(-2);
        let mut equations = NormalEquations::<{ TERMS + 1 }>::EMPTY;
        let (mut weights, mut mean) = (0.0, 0.0);
        for s in samples {
            equations.add(&row(s), s.value, weight(s), used);
            weights += judged(s);
            mean += judged(s) * s.value;
        }
        let (coefficients, known) = equations.solve_and_count(used);
        // The variation is that about the point's value, or about the mean of the averages.
        let centre = if free { mean / weights } else { 0.0 };
        let variation: f64 = samples.iter().map(|s| judged(s) * (s.value - centre).powi(2)).sum();
        let residual_of = |(coefficients, known): ([f64; TERMS + 1], usize)| {
            let fitted =
                |s: &Sample| coefficients.iter().zip(row(s)).map(|(c, m)| c * m).sum::<f64>();
            let squares: f64 =
                samples.iter().map(|s| judged(s) * (fitted(s) - s.value).powi(2)).sum();
            let known = known.saturating_sub(constant);
            let surplus = (samples.len() - known.min(samples.len() - 1)) as f64;
            let above_rounding =
                squares * samples.len() as f64 / surplus - weights * rounding * rounding;
            if above_rounding > 0.0 { (above_rounding / variation).sqrt() } else { 0.0 }
        };
        let mut residual = residual_of((coefficients, known));
        if degree == 3 {
            let quadratic = equations.solve_and_count(1 + TERMS_TO_DEGREE[2]);
            residual = residual.max(QUADRATIC_SHARE * residual_of(quadratic));
        }
        let complete = known == counts.terms[3] + constant;
        Some(Solution { coefficients, degree, residual, complete })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::math::SplitMix64;

    /// The residual of a field around a node of a cubic grid.
    fn residual(f: impl Fn(DVec3) -> f64) -> f64 {
        let centre = f(DVec3::ZERO);
        let steps = -2..=2i32;
        let places = steps.clone().flat_map(|i| {
            steps.clone().flat_map({
                let steps = steps.clone();
                move |j| steps.clone().map(move |k| glam::IVec3::new(i, j, k).as_dvec3())
            })
        });
        let mut samples: Vec<Sample> = places
            .filter(|p| *p != DVec3::ZERO)
            .map(|p| Sample {
                square: p.length_squared(),
                id: 0,
                value: f(p) - centre,
                place: p,
                second: [0.0; 6],
            })
            .collect();
        samples.sort_by(|a, b| a.square.total_cmp(&b.square));
        let counts = Counts::of(samples.iter().map(|s| s.place), false);
        assert_eq!(counts.terms, TERMS_TO_DEGREE);
        let nearest = within(&samples, counts.nearest);
        Solution::of(nearest, counts, 0.0, false).expect("enough samples").residual
    }

    #[test]
    fn residuals_tell_steps_and_noise_from_a_bell_of_three_cells() {
        let [whole, none] = RESIDUAL;
        for x in [0.0, 1.0, 2.0, 3.0, 4.5] {
            let bell = |p: DVec3| (-0.5 * (p + DVec3::X * x).length_squared() / 9.0).exp();
            assert!(residual(bell) < whole, "{x} from the middle: {}", residual(bell));
        }
        for x in [-0.5, 0.5, 1.5] {
            let step = |p: DVec3| f64::from(u8::from(p.x > x));
            assert!(residual(step) > none, "a step at {x}: {}", residual(step));
        }
        let mut random = SplitMix64::new(1);
        let noise = std::cell::RefCell::new(|| random.unit());
        let all = (0..20).map(|_| residual(|_| noise.borrow_mut()()));
        let least = all.fold(f64::INFINITY, f64::min);
        assert!(least > none, "noise: {least}");
    }
}
