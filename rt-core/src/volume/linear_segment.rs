//! Segments of a ray along which extinction and colour are linear in the scalar, and the scalar is
//! a cubic, integrated eight at a time.
//!
//! Let F, from 0 to 1, be the share of the segment's optical thickness τ that a ray has passed.
//! Emission seen through what lies in front is τ ∫ c(F) e^(−τF) dF (Max 1995, eq. 7, with F as
//! variable). τ is exact: the mean of a Bernstein cubic is that of its coefficients. With c̄ the
//! mean of c over F (exact without shading), Δ = c(1) − c(0), and colours taken as linear in F,
//!
//!   ∫ = c̄ a + Δ g,  a = 1 − e^(−τ),  g = a/τ − e^(−τ) − a/2 (→ −τ²/12).
//!
//! Only the bend of c(F) is left out. A bound on it decides whether the segment is divided.

use super::lanes::{LANES, Row, max};
use super::layer::{MarchState, SegmentLight};
use super::shading_in_lanes::{LightsOnRay, LitCell, LitSegments};
use crate::grid_walk::IndexRay;
use crate::ray_cubic;
use crate::transfer_function::Interval;
use fearless_simd::{Select, Simd, SimdBase, f64x8};

/// Divisions of a segment, into eight parts each, whose error is too large.
const MAX_DIVISIONS: u32 = 3;
/// Optical thickness below which g is computed from its series, whose next term is τ⁴/80: the
/// closed form has lost ten digits there.
const THIN: f64 = 1e-3;
/// Gauss's nodes for three points on 0..1, and their weights. They are exact to degree five.
const NODES: [f64; 3] = [0.112_701_665_379_258_31, 0.5, 0.887_298_334_620_741_7];
const WEIGHTS: [f64; 3] = [5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0];

/// A ray, and what is the same all along it.
pub(super) struct RayInLanes<'a> {
    pub(super) index_ray: &'a IndexRay,
    /// World length of one unit of the parameter.
    pub(super) per_t: f64,
    /// `None` without shading.
    pub(super) lights: Option<LightsOnRay>,
}

/// Up to eight segments, in the order of the ray.
pub(super) struct LinearSegments {
    len: usize,
    /// The scalar along each.
    b: [Row; 4],
    t0: Row,
    t1: Row,
    /// Start of the piece of the transfer function, extinction and colours there, and their slopes.
    start: Row,
    sigma: [Row; 2],
    color: [[Row; 2]; 3],
    lit: LitSegments,
}

/// What the lanes compute.
struct Emissions {
    color: [Row; 3],
    /// e^(−τ).
    attenuation: Row,
    tau: Row,
    length: Row,
    /// Bound on the error of the colour.
    error: Row,
}

impl LinearSegments {
    #[inline(always)]
    pub(super) fn new() -> Self {
        LinearSegments {
            len: 0,
            b: [[0.0; LANES]; 4],
            t0: [0.0; LANES],
            t1: [0.0; LANES],
            start: [0.0; LANES],
            sigma: [[0.0; LANES]; 2],
            color: [[[0.0; LANES]; 2]; 3],
            lit: LitSegments::new(),
        }
    }

    #[inline(always)]
    pub(super) fn is_full(&self) -> bool {
        self.len == LANES
    }

    /// Adds the part `u` of the cell that the ray crosses between `t`; `lit` is the light in that
    /// cell.
    #[inline(always)]
    pub(super) fn push(
        &mut self,
        b: &[f64; 4],
        t: [f64; 2],
        u: [f64; 2],
        piece: &Interval,
        lit: Option<&LitCell>,
    ) {
        let at = |u: f64| if u == 1.0 { t[1] } else { t[0] + (t[1] - t[0]) * u };
        if let Some(lit) = lit {
            self.lit.set(self.len & (LANES - 1), lit, u);
        }
        self.add(b, u.map(at), piece);
    }

    #[inline(always)]
    fn add(&mut self, b: &[f64; 4], t: [f64; 2], piece: &Interval) {
        let lane = self.len & (LANES - 1);
        for (row, b) in self.b.iter_mut().zip(b) {
            row[lane] = *b;
        }
        (self.t0[lane], self.t1[lane]) = (t[0], t[1]);
        self.start[lane] = piece.s;
        for (row, sigma) in self.sigma.iter_mut().zip(piece.sigma) {
            row[lane] = sigma;
        }
        for (rows, color) in self.color.iter_mut().zip(piece.color) {
            (rows[0][lane], rows[1][lane]) = (color[0], color[1]);
        }
        self.len += 1;
    }

    /// Integrates what is held, and empties it.
    #[inline(never)]
    pub(super) fn integrate<S: Simd>(&mut self, simd: S, ray: &RayInLanes<'_>, m: &mut MarchState) {
        if self.len > 0 && !m.is_opaque() {
            let emissions = simd.vectorize(
                #[inline(always)]
                || self.emissions(simd, ray),
            );
            self.composite(&emissions, m, |segments, lane, m| {
                segments.divide(simd, lane, ray, 1, m);
            });
        }
        self.len = 0;
    }

    /// Adds the segments in order. Those whose error is too large go to `divide`.
    #[inline(always)]
    fn composite(
        &self,
        e: &Emissions,
        m: &mut MarchState,
        mut divide: impl FnMut(&Self, usize, &mut MarchState),
    ) {
        for lane in 0..self.len {
            if m.is_opaque() {
                return;
            }
            if m.transmittance * e.error[lane] > m.error_per_length * e.length[lane] {
                divide(self, lane, m);
                continue;
            }
            m.samples += 1;
            m.add_segment(&SegmentLight {
                t: [self.t0[lane], self.t1[lane]],
                color: e.color.map(|row| row[lane]),
                attenuation: e.attenuation[lane],
                tau: e.tau[lane],
                ends: [self.b[0][lane], self.b[3][lane]].map(|b| {
                    (self.sigma[0][lane] + self.sigma[1][lane] * (b - self.start[lane])).max(0.0)
                }),
            });
        }
    }

    /// The segment in `lane` in eight parts of equal length.
    #[inline(never)]
    fn divide<S: Simd>(
        &self,
        simd: S,
        lane: usize,
        ray: &RayInLanes<'_>,
        divisions: u32,
        m: &mut MarchState,
    ) {
        let mut parts = LinearSegments::new();
        let piece = Interval::linear(
            self.start[lane],
            self.sigma.map(|row| row[lane]),
            self.color.map(|rows| rows.map(|row| row[lane])),
        );
        let t = [self.t0[lane], self.t1[lane]];
        parts.lit = self.lit.divided(lane);
        let at = |k: usize| match k {
            LANES => t[1],
            _ => t[0] + (t[1] - t[0]) * (k as f64 / LANES as f64),
        };
        let mut rest = self.b.map(|row| row[lane]);
        for k in 0..LANES {
            let (part, behind) = match k {
                7 => (rest, rest),
                _ => ray_cubic::split(&rest, 1.0 / (LANES - k) as f64),
            };
            rest = behind;
            parts.add(&part, [at(k), at(k + 1)], &piece);
        }
        let emissions = simd.vectorize(
            #[inline(always)]
            || parts.emissions(simd, ray),
        );
        if divisions == MAX_DIVISIONS {
            let accepted = Emissions { error: [0.0; LANES], ..emissions };
            parts.composite(&accepted, m, |_, _, _| {});
        } else {
            parts.composite(&emissions, m, |segments, lane, m| {
                segments.divide(simd, lane, ray, divisions + 1, m);
            });
        }
    }

    #[inline(always)]
    fn emissions<S: Simd>(&self, simd: S, ray: &RayInLanes<'_>) -> Emissions {
        let s = |x: f64| f64x8::splat(simd, x);
        let load = |row: &Row| f64x8::from_slice(simd, row);
        let zero = s(0.0);
        // ---- Extinction.
        let start = load(&self.start);
        let mut x = [zero; 4];
        for (x, b) in x.iter_mut().zip(&self.b) {
            *x = load(b) - start;
        }
        let [e0, e1] = [load(&self.sigma[0]), load(&self.sigma[1])];
        let mean = (x[0] + x[1] + x[2] + x[3]) * s(0.25);
        let sigma = max(e0 + e1 * mean, zero);
        let length = (load(&self.t1) - load(&self.t0)) * s(ray.per_t);
        let tau = sigma * length;
        let through = crate::simd::exponential::attenuation(simd, tau);
        let opacity = s(1.0) - through;
        let g = divided(opacity, tau, zero) - through - opacity * s(0.5);
        let g_thin = tau * tau * (tau * s(0.5) - s(1.0)) * s(1.0 / 12.0);
        let g = tau.simd_lt(s(THIN)).select(g_thin, g);
        // ---- Colours: mean over the optical thickness, and at the ends.
        let rise = x[3] - x[0];
        let rho = divided(e1 * rise, sigma, zero).abs();
        let mut colors = [[zero; 2]; 3];
        for (color, rows) in colors.iter_mut().zip(&self.color) {
            *color = [load(&rows[0]), load(&rows[1])];
        }
        let mut emitted = [zero; 3];
        let (mut change, mut bend) = (zero, zero);
        if let Some(lights) = &ray.lights {
            let lights = self.lit.load(simd, lights.channels());
            let mut nodes = [(zero, [zero; 3]); 3];
            for (node, u) in nodes.iter_mut().zip(NODES) {
                let w = 1.0 - u;
                let x = x[0] * s(w * w * w)
                    + x[1] * s(3.0 * w * w * u)
                    + x[2] * s(3.0 * w * u * u)
                    + x[3] * s(u * u * u);
                *node = (max(e0 + e1 * x, zero), lights.at(simd, u).on(&colors, x));
            }
            let weight = nodes[0].0 * s(WEIGHTS[0])
                + nodes[1].0 * s(WEIGHTS[1])
                + nodes[2].0 * s(WEIGHTS[2]);
            let near = lights.at(simd, 0.0).on(&colors, x[0]);
            let far = lights.at(simd, 1.0).on(&colors, x[3]);
            for k in 0..3 {
                let sum = nodes[0].0 * s(WEIGHTS[0]) * nodes[0].1[k]
                    + nodes[1].0 * s(WEIGHTS[1]) * nodes[1].1[k]
                    + nodes[2].0 * s(WEIGHTS[2]) * nodes[2].1[k];
                let delta = far[k] - near[k];
                emitted[k] = max(divided(sum, weight, zero) * opacity + delta * g, zero);
                change = max(change, delta.abs());
                bend = max(bend, (nodes[1].1[k] - (near[k] + far[k]) * s(0.5)).abs());
            }
        } else {
            // The variance of the scalar: the integral of Bⁱ Bʲ is C(3,i) C(3,j) / (7 C(6,i+j)).
            let d = [x[0] - mean, x[1] - mean, x[2] - mean, x[3] - mean];
            let outer = d[0] * d[0] + d[3] * d[3];
            let inner = d[1] * d[1] + d[2] * d[2];
            let variance = outer * s(1.0 / 7.0)
                + inner * s(3.0 / 35.0)
                + (d[0] * d[1] + d[2] * d[3]) * s(1.0 / 7.0)
                + (d[0] * d[2] + d[1] * d[3]) * s(2.0 / 35.0)
                + d[0] * d[3] * s(1.0 / 70.0)
                + d[1] * d[2] * s(9.0 / 70.0);
            let at = mean + divided(e1 * variance, sigma, zero);
            let bow = (x[1] + x[2] - x[0] - x[3]).abs() * s(3.0 / 8.0);
            let bow = max(bow, (x[1] - x[2] + rise * s(1.0 / 3.0)).abs());
            for (k, [c0, c1]) in colors.into_iter().enumerate() {
                emitted[k] = max((c0 + c1 * at) * opacity + c1 * rise * g, zero);
                let slope = c1.abs();
                change = max(change, slope * rise.abs());
                bend = max(bend, slope * bow);
            }
        }
        // c(F) is off its line by at most Δ|ρ|/8 where extinction changes by the ratio ρ, and by
        // the bend; half as much again because the line is fitted to the mean. The average of
        // e^(−τF) over F, less its middle, is at most a/4.
        let off = change * rho * s(0.1875) + bend * s(1.5);
        let error = tau * opacity * off * s(0.25);
        let mut e = Emissions {
            color: [[0.0; LANES]; 3],
            attenuation: [0.0; LANES],
            tau: [0.0; LANES],
            length: [0.0; LANES],
            error: [0.0; LANES],
        };
        for (row, color) in e.color.iter_mut().zip(emitted) {
            color.store_slice(row);
        }
        through.store_slice(&mut e.attenuation);
        tau.store_slice(&mut e.tau);
        length.store_slice(&mut e.length);
        error.store_slice(&mut e.error);
        e
    }
}

/// `a / b` where `b` is positive, `zero` elsewhere.
#[inline(always)]
fn divided<S: Simd>(a: f64x8<S>, b: f64x8<S>, zero: f64x8<S>) -> f64x8<S> {
    b.simd_gt(zero).select(a / b, zero)
}
