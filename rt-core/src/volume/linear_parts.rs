//! Where a cubic turns, and where it meets the knots of the transfer function.

use super::projection::turns;
use crate::ray_cubic;
use crate::transfer_function::Pieces;

/// Knots of the transfer function in one cell up to which the cell is cut at each of them. Beyond,
/// knots are so dense that an interval with many of them is integrated as a whole
/// ([`super::Volume::march_adaptive`]).
pub(super) const MAX_KNOTS: usize = 12;
/// Cuts of a cell: its turns and knots, and its end. A cubic meets each knot up to three times.
const MAX_CUTS: usize = 3 * MAX_KNOTS + 3;

/// A last step of Newton's method, in units of the cell. The error after it is about its square.
const NEWTON_STEP: f64 = 1e-6;
const MAX_NEWTON_STEPS: u32 = 40;

/// Calls `visit` with each part of the cubic `b` that lies within one piece of the transfer
/// function, its range of the parameter, and the number of the piece. `first` and `last` are those
/// of the smallest and largest coefficient.
///
/// Inlined, so that `visit` is compiled for the instruction set of the caller.
#[inline(always)]
pub(super) fn for_each_linear(
    b: &[f64; 4],
    pieces: &Pieces,
    [first, last]: [usize; 2],
    mut visit: impl FnMut(&[f64; 4], [f64; 2], usize),
) {
    let mut cuts = [1.0; MAX_CUTS];
    let mut count = 0;
    let (turns, turns_count) = turns(b);
    let (mut from, mut value) = (0.0, b[0]);
    for end in turns[..turns_count].iter().copied().chain([1.0]) {
        let at_end = if end == 1.0 { b[3] } else { ray_cubic::evaluate(b, end) };
        let knot = |k: usize| pieces.all()[k].s;
        let mut cut = |k: usize| {
            let s = knot(k);
            if (value < s) != (at_end < s) {
                cuts[count] = crossing(&b.map(|x| x - s), [from, end], [value - s, at_end - s]);
                count += 1;
            }
        };
        // In the order in which they are met.
        if value < at_end {
            (first + 1..=last).for_each(&mut cut);
        } else {
            (first + 1..=last).rev().for_each(&mut cut);
        }
        if end < 1.0 {
            cuts[count] = end;
            count += 1;
        }
        (from, value) = (end, at_end);
    }
    // The last entry is 1.
    let (mut rest, mut from) = (*b, 0.0);
    for &end in &cuts[..=count] {
        if end <= from {
            continue;
        }
        let (part, behind) = if end < 1.0 {
            ray_cubic::split(&rest, (end - from) / (1.0 - from))
        } else {
            (rest, rest)
        };
        let piece = pieces.number_at(ray_cubic::evaluate(&part, 0.5));
        let interval = &pieces.all()[piece];
        if interval.sigma != [0.0; 2] {
            visit(&part, [from, end], piece);
        }
        (rest, from) = (behind, end);
    }
}

/// Where the cubic `b`, which is monotone over `range` and has the values `f` at its ends, is zero:
/// Newton's method in a shrinking bracket, from the secant on.
#[inline]
fn crossing(b: &[f64; 4], range: [f64; 2], f: [f64; 2]) -> f64 {
    let [mut lo, mut hi] = range;
    let mut u = lo + (hi - lo) * (f[0] / (f[0] - f[1]));
    for _ in 0..MAX_NEWTON_STEPS {
        if !(u >= lo && u <= hi) {
            u = 0.5 * (lo + hi);
        }
        let (value, slope) = ray_cubic::evaluate_with_slope(b, u);
        if (value < 0.0) == (f[0] < 0.0) {
            lo = u;
        } else {
            hi = u;
        }
        let step = value / slope;
        if step.abs() < NEWTON_STEP {
            return (u - step).clamp(range[0], range[1]);
        }
        u -= step;
    }
    0.5 * (lo + hi)
}
