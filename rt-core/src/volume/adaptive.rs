//! Integration of one cell to a tolerance.
//!
//! The scalar along the ray is a cubic. An interval of it becomes one homogeneous layer with the
//! exact mean of the transfer function over its chord. This has four errors, and an interval is
//! split until each is small enough:
//!
//! 1. the curve is not its chord: the layer differs from the layers of the two parts;
//! 2. the curve leaves the range of its ends and reaches, there, a bend of the transfer function
//!    that no sample has seen;
//! 3. the curve reaches a step of the transfer function at another parameter than its chord does;
//! 4. colours are mixed instead of composited in order: also visible as a difference, but only when
//!    both parts have some thickness.

use super::Volume;
use super::layer::{Layer, MarchState};
use super::shading::ShadingCurve;
use crate::ray_cubic;

/// Where an interval is split. Not in the middle: an antisymmetric cubic passes through the middle
/// of its chord, and would seem straight.
const SPLIT: f64 = 0.375;
/// The error of a layer is proportional to the cube of its length (curvature, order of colours):
/// two parts have a quarter of the error of one, a third of the difference between them.
const REFINEMENT_GAIN: f64 = 3.0;
/// Largest number of splits of a cell's interval: to less than 2⁻⁸ of a cell.
const MAX_SPLITS: usize = 12;
/// Largest number of splits for features that no sample shows.
const MAX_BLIND_SPLITS: u32 = 6;
/// A part with less than this share of the other's optical thickness gives no information on the
/// order of colours.
const MIN_ORDER_THICKNESS: f64 = 0.1;

/// An interval of a cell that still has to be integrated.
#[derive(Clone, Copy)]
struct CubicSegment {
    ta: f64,
    tb: f64,
    /// The scalar along it.
    b: [f64; 4],
    /// The transfer function's integrals at both ends.
    ends: [[f64; 4]; 2],
    layer: Layer,
    splits: u32,
}

impl Volume {
    /// Adds a cell, along which the scalar is the cubic `b`.
    pub(super) fn march_adaptive(
        &self,
        lit: Option<&ShadingCurve<'_>>,
        per_t: f64,
        [t0, t1]: [f64; 2],
        b: &[f64; 4],
        m: &mut MarchState,
    ) {
        let ends = [self.transfer.integral(b[0]), self.transfer.integral(b[3])];
        let layer = self.layer(lit, per_t, t0, t1, b, &ends);
        m.samples += 1;
        // An error at one point of a cell, not all along it, may use half of the cell's share of
        // the tolerance.
        let local_share = 0.5 * m.error_per_length * (t1 - t0) * per_t;
        // Depth first with the near part on top: the stack holds one far part per level.
        let mut stack =
            [CubicSegment { ta: t0, tb: t1, b: *b, ends, layer, splits: 0 }; MAX_SPLITS + 1];
        let mut height = 1;
        while height > 0 && !m.is_opaque() {
            height -= 1;
            let CubicSegment { ta, tb, b, ends: [i0, i1], layer: one, splits } = stack[height];
            let mid = ta + SPLIT * (tb - ta);
            let (near, far) = ray_cubic::split(&b, SPLIT);
            let im = self.transfer.integral(far[0]);
            let first = self.layer(lit, per_t, ta, mid, &near, &[i0, im]);
            let second = self.layer(lit, per_t, mid, tb, &far, &[im, i1]);
            m.samples += 2;
            let length = (tb - ta) * per_t;
            let t = m.transmittance;
            let done = splits as usize == MAX_SPLITS
                || (t * one.difference(&first.then(&second))
                    <= REFINEMENT_GAIN * m.error_per_length * length
                    && !(splits < MAX_BLIND_SPLITS && self.may_hide_something(&b))
                    && t * self.step_error(&b, length) <= local_share
                    && t * self.order_error(&first, &near, &second, &far) <= local_share);
            if done {
                m.add(ta, mid, &first);
                m.add(mid, tb, &second);
            } else {
                let splits = splits + 1;
                stack[height] =
                    CubicSegment { ta: mid, tb, b: far, ends: [im, i1], layer: second, splits };
                stack[height + 1] =
                    CubicSegment { ta, tb: mid, b: near, ends: [i0, im], layer: first, splits };
                height += 2;
            }
        }
    }

    /// The interval as one layer, with a linear scalar; `ends` are the transfer function's
    /// integrals at its ends.
    #[inline]
    fn layer(
        &self,
        lit: Option<&ShadingCurve<'_>>,
        per_t: f64,
        ta: f64,
        tb: f64,
        b: &[f64; 4],
        ends: &[[f64; 4]; 2],
    ) -> Layer {
        let (s0, s1) = (b[0], b[3]);
        let (sigma, color) = if (s1 - s0).abs() > self.transfer.resolution() {
            let area = ends[1][0] - ends[0][0];
            let mean =
                |c: usize| if area != 0.0 { (ends[1][c + 1] - ends[0][c + 1]) / area } else { 0.0 };
            (area / (s1 - s0), [mean(0), mean(1), mean(2)])
        } else {
            self.transfer.sample(0.5 * (s0 + s1))
        };
        let (sigma, color) = lit.map_or((sigma, color), |l| l.on(0.5 * (ta + tb), sigma, color));
        Layer { tau: sigma.max(0.0) * (tb - ta) * per_t, color }
    }

    /// Error 2: whether the scalar may leave the range between its ends and reach, there, a bend of
    /// the transfer function.
    #[inline]
    fn may_hide_something(&self, b: &[f64; 4]) -> bool {
        let (s0, s1) = (b[0].min(b[3]), b[0].max(b[3]));
        let (lo, hi) = (b[1].min(b[2]), b[1].max(b[2]));
        (lo < s0 && self.transfer.has_knot_between(lo, s0))
            || (hi > s1 && self.transfer.has_knot_between(s1, hi))
    }

    /// Error 3: the error of optical thickness that steps of the transfer function can cause.
    #[inline]
    fn step_error(&self, b: &[f64; 4], length: f64) -> f64 {
        let (lo, hi) = ray_cubic::hull(b);
        let steps = self.transfer.steps_between(lo, hi);
        if steps == 0.0 {
            return 0.0;
        }
        let chord = |f: f64| b[0] + (b[3] - b[0]) * f;
        let bow = (b[1] - chord(1.0 / 3.0)).abs().max((b[2] - chord(2.0 / 3.0)).abs());
        let shift = bow / (b[3] - b[0]).abs();
        steps * length * if shift < 1.0 { shift } else { 1.0 }
    }

    /// Error 4, where the parts' difference does not show it: colours that differ by δ within a
    /// layer of opacity a, mixed instead of ordered, have an error of at most a²·δ/4 (half of the
    /// layer in front of the other half).
    #[inline]
    fn order_error(&self, first: &Layer, near: &[f64; 4], second: &Layer, far: &[f64; 4]) -> f64 {
        let (small, big, b) =
            if first.tau < second.tau { (first, second, far) } else { (second, first, near) };
        if small.tau >= MIN_ORDER_THICKNESS * big.tau {
            return 0.0;
        }
        let a = big.opacity();
        let difference = if self.transfer.has_knot_between(b[0].min(b[3]), b[0].max(b[3])) {
            1.0
        } else {
            let (x, y) = (self.transfer.sample(b[0]).1, self.transfer.sample(b[3]).1);
            (0..3).map(|c| (x[c] - y[c]).abs()).fold(0.0, f64::max)
        };
        0.25 * a * a * difference
    }
}
