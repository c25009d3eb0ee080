//! Shading by gradients, for eight cells at a time. See [`super::shading`] for one.

use super::lanes::{LANES, Row, max};
use super::shading::corner_gradients;
use super::{Volume, VolumeHighlight};
use crate::grid_walk::IndexRay;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, f64x8};
use glam::{DVec3, UVec3};

/// Exponents of a highlight up to which it is multiplied out in lanes.
const MAX_MULTIPLIED: f32 = 128.0;

/// The lights and the shading's numbers, for all of a ray.
pub(super) struct LightsOnRay {
    /// Unit directions to the lights, and their colours.
    lights: Vec<(DVec3, [f64; 3])>,
    /// Lights with colours of their own.
    colored: bool,
    ambient: f64,
    diffuse: f64,
    half_gradient: f64,
    highlight: Option<Highlight>,
}

/// A highlight of the light at `light`, seen from `viewer`, along one ray.
struct Highlight {
    form: VolumeHighlight,
    light: DVec3,
    viewer: DVec3,
    halfway: DVec3,
    specular: f64,
    shininess: f32,
}

/// Factors of colours, and highlights, at the start, the middle and the end of eight cells.
pub(super) struct LitCells {
    factor: [[Row; 3]; 3],
    highlight: [Row; 3],
    channels: usize,
}

/// One cell of [`LitCells`].
pub(super) struct LitCell {
    factor: [[f64; 3]; 3],
    highlight: [f64; 3],
    channels: usize,
}

/// The light in the cells of eight segments, and the parts of these cells that they are.
pub(super) struct LitSegments {
    factor: [[Row; 3]; 3],
    highlight: [Row; 3],
    u0: Row,
    u1: Row,
}

/// [`LitSegments`] in registers.
pub(super) struct LightCurves<S: Simd> {
    factor: [[f64x8<S>; 3]; 3],
    highlight: [f64x8<S>; 3],
    u0: f64x8<S>,
    width: f64x8<S>,
    channels: usize,
}

/// The light at one place of each segment.
pub(super) struct Light<S: Simd> {
    pub(super) factor: [f64x8<S>; 3],
    pub(super) highlight: f64x8<S>,
}

impl Volume {
    /// The lights along `ray`; `None` without shading.
    pub(super) fn lights_on(&self, ray: &IndexRay) -> Option<LightsOnRay> {
        let s = self.options.shading.as_ref()?;
        let dir = self.view_along_index(ray);
        let unit = |l: Option<glam::Vec3>| l.map_or(dir, |l| l.as_dvec3()).normalize_or_zero();
        let colored = !self.options.lights.is_empty();
        let lights = if colored {
            let light = |l: &super::VolumeLight| (unit(l.direction), l.color.map(f64::from));
            self.options.lights.iter().map(light).collect()
        } else {
            vec![(unit(s.light), [1.0; 3])]
        };
        let viewer = if s.light.is_some() { -dir } else { dir }.normalize_or_zero();
        let light = unit(s.light);
        let highlight = (s.specular > 0.0 && !colored).then(|| Highlight {
            form: s.highlight,
            light,
            viewer,
            // Two opposite directions have no half vector, and no highlight.
            halfway: (light + viewer).normalize_or_zero(),
            specular: s.specular.into(),
            shininess: s.shininess,
        });
        Some(LightsOnRay {
            lights,
            colored,
            ambient: s.ambient.into(),
            diffuse: s.diffuse.into(),
            half_gradient: s.half_gradient.into(),
            highlight,
        })
    }
}

impl LitCells {
    /// For the cells `stored` of the grid, crossed from `p` to `q`.
    #[inline(always)]
    pub(super) fn new<S: Simd>(
        simd: S,
        volume: &Volume,
        lights: &LightsOnRay,
        stored: &[UVec3],
        p: &[Row; 3],
        q: &[Row; 3],
    ) -> Self {
        let load = |row: &Row| f64x8::from_slice(simd, row);
        let half = f64x8::splat(simd, 0.5);
        let mut gradients = [[[0.0; LANES]; 3]; 8];
        for (lane, cell) in stored.iter().enumerate() {
            let corners = corner_gradients(&volume.grid, *cell, volume.options.clamped_gradients);
            for (rows, g) in gradients.iter_mut().zip(&corners) {
                rows[0][lane] = g.x.into();
                rows[1][lane] = g.y.into();
                rows[2][lane] = g.z.into();
            }
        }
        let channels = lights.channels();
        let p = [load(&p[0]), load(&p[1]), load(&p[2])];
        let q = [load(&q[0]), load(&q[1]), load(&q[2])];
        let middle = [(p[0] + q[0]) * half, (p[1] + q[1]) * half, (p[2] + q[2]) * half];
        let mut lit =
            LitCells { factor: [[[0.0; LANES]; 3]; 3], highlight: [[0.0; LANES]; 3], channels };
        for (place, at) in [p, middle, q].into_iter().enumerate() {
            let g = [
                between(simd, &gradients, 0, &at),
                between(simd, &gradients, 1, &at),
                between(simd, &gradients, 2, &at),
            ];
            let (factor, highlight) = lights.on(simd, g);
            for k in 0..channels {
                factor[k].store_slice(&mut lit.factor[place][k]);
            }
            highlight.store_slice(&mut lit.highlight[place]);
        }
        lit
    }

    /// The light in one of the cells.
    #[inline(always)]
    pub(super) fn cell(&self, lane: usize) -> LitCell {
        let lane = lane & (LANES - 1);
        let mut cell =
            LitCell { factor: [[0.0; 3]; 3], highlight: [0.0; 3], channels: self.channels };
        for place in 0..3 {
            for k in 0..self.channels {
                cell.factor[place][k] = self.factor[place][k][lane];
            }
            cell.highlight[place] = self.highlight[place][lane];
        }
        cell
    }
}

impl LitSegments {
    pub(super) fn new() -> Self {
        LitSegments {
            factor: [[[0.0; LANES]; 3]; 3],
            highlight: [[0.0; LANES]; 3],
            u0: [0.0; LANES],
            u1: [0.0; LANES],
        }
    }

    /// Segment `lane` is the part `u` of `cell`.
    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, cell: &LitCell, u: [f64; 2]) {
        for place in 0..3 {
            for k in 0..cell.channels {
                self.factor[place][k][lane] = cell.factor[place][k];
            }
            self.highlight[place][lane] = cell.highlight[place];
        }
        (self.u0[lane], self.u1[lane]) = (u[0], u[1]);
    }

    /// Segment `lane` in eight parts of equal length.
    pub(super) fn divided(&self, lane: usize) -> Self {
        let (u0, u1) = (self.u0[lane], self.u1[lane]);
        let at = |k: usize| u0 + (u1 - u0) * (k as f64 / LANES as f64);
        LitSegments {
            factor: self.factor.map(|place| place.map(|row| [row[lane]; LANES])),
            highlight: self.highlight.map(|row| [row[lane]; LANES]),
            u0: std::array::from_fn(at),
            u1: std::array::from_fn(|k| at(k + 1)),
        }
    }

    #[inline(always)]
    pub(super) fn load<S: Simd>(&self, simd: S, channels: usize) -> LightCurves<S> {
        let load = |row: &Row| f64x8::from_slice(simd, row);
        let u0 = load(&self.u0);
        let zero = f64x8::splat(simd, 0.0);
        let mut lit = LightCurves {
            factor: [[zero; 3]; 3],
            highlight: [zero; 3],
            u0,
            width: load(&self.u1) - u0,
            channels,
        };
        for place in 0..3 {
            for k in 0..channels {
                lit.factor[place][k] = load(&self.factor[place][k]);
            }
            lit.highlight[place] = load(&self.highlight[place]);
        }
        lit
    }
}

/// One component of the trilinear interpolant of the corners' gradients.
#[inline(always)]
fn between<S: Simd>(
    simd: S,
    gradients: &[[Row; 3]; 8],
    component: usize,
    at: &[f64x8<S>; 3],
) -> f64x8<S> {
    let mut g = [f64x8::splat(simd, 0.0); 8];
    for (g, rows) in g.iter_mut().zip(gradients) {
        *g = f64x8::from_slice(simd, &rows[component]);
    }
    let x = [
        g[0] + (g[1] - g[0]) * at[0],
        g[2] + (g[3] - g[2]) * at[0],
        g[4] + (g[5] - g[4]) * at[0],
        g[6] + (g[7] - g[6]) * at[0],
    ];
    let (low, high) = (x[0] + (x[1] - x[0]) * at[1], x[2] + (x[3] - x[2]) * at[1]);
    low + (high - low) * at[2]
}

impl<S: Simd> LightCurves<S> {
    /// The parabolas through the three values of each cell at `u` of each segment.
    #[inline(always)]
    pub(super) fn at(&self, simd: S, u: f64) -> Light<S> {
        let s = |x: f64| f64x8::splat(simd, x);
        let x = self.u0 + self.width * s(u);
        let (one, two) = (s(1.0), s(2.0));
        let w = [(one - x) * (one - two * x), s(4.0) * x * (one - x), x * (two * x - one)];
        let zero = s(0.0);
        let mut light = Light { factor: [zero; 3], highlight: zero };
        for k in 0..self.channels {
            let sum =
                self.factor[0][k] * w[0] + self.factor[1][k] * w[1] + self.factor[2][k] * w[2];
            light.factor[k] = max(sum, zero);
        }
        if self.channels == 1 {
            light.factor = [light.factor[0]; 3];
        }
        let h = &self.highlight;
        light.highlight = max(h[0] * w[0] + h[1] * w[1] + h[2] * w[2], zero);
        light
    }
}

impl<S: Simd> Light<S> {
    /// Colours, linear in the scalar, under this light where the scalar is `x`.
    #[inline(always)]
    pub(super) fn on(&self, colors: &[[f64x8<S>; 2]; 3], x: f64x8<S>) -> [f64x8<S>; 3] {
        let mut lit = self.factor;
        for (lit, color) in lit.iter_mut().zip(colors) {
            *lit = (color[0] + color[1] * x) * *lit + self.highlight;
        }
        lit
    }
}

impl LightsOnRay {
    /// Numbers that make up a factor: one for white light.
    #[inline(always)]
    pub(super) fn channels(&self) -> usize {
        if self.colored { 3 } else { 1 }
    }

    /// Factors of the colour and highlights where the gradients are `g`.
    #[inline(always)]
    fn on<S: Simd>(&self, simd: S, g: [f64x8<S>; 3]) -> ([f64x8<S>; 3], f64x8<S>) {
        let s = |x: f64| f64x8::splat(simd, x);
        let (zero, one) = (s(0.0), s(1.0));
        let steepness = (g[0] * g[0] + g[1] * g[1] + g[2] * g[2]).sqrt();
        // NaN is not steep either.
        let steep = steepness.simd_gt(zero) & steepness.simd_lt(s(f64::INFINITY));
        let mut normal = g;
        for n in &mut normal {
            *n = steep.select(*n / steepness, zero);
        }
        let weight = steepness / (steepness + s(self.half_gradient));
        let mut sums = [zero; 3];
        for (light, color) in &self.lights {
            let cos = dot(simd, &normal, *light).abs();
            for (sum, c) in sums.iter_mut().zip(color) {
                *sum += cos * s(*c);
            }
        }
        let flat = s(if self.half_gradient > 0.0 { 1.0 } else { self.ambient });
        let mut factors = sums;
        for factor in &mut factors {
            let lit = one + weight * (s(self.ambient) + s(self.diffuse) * *factor - one);
            *factor = steep.select(lit, flat);
        }
        let Some(h) = &self.highlight else { return (factors, zero) };
        let base = match h.form {
            VolumeHighlight::Halfway => dot(simd, &normal, h.halfway).abs(),
            VolumeHighlight::Mirrored => {
                let (light, viewer) = (dot(simd, &normal, h.light), dot(simd, &normal, h.viewer));
                let base = light * viewer * s(2.0) - s(h.light.dot(h.viewer));
                max(base, zero)
            }
        };
        let peak = weight * s(h.specular) * powers(simd, base, h.shininess);
        (factors, steep.select(peak, zero))
    }
}

/// The dot products of eight vectors `v` with `w`.
#[inline(always)]
fn dot<S: Simd>(simd: S, v: &[f64x8<S>; 3], w: DVec3) -> f64x8<S> {
    v[0] * f64x8::splat(simd, w.x) + v[1] * f64x8::splat(simd, w.y) + v[2] * f64x8::splat(simd, w.z)
}

/// `base` to the power of `exponent`.
#[inline(always)]
fn powers<S: Simd>(simd: S, base: f64x8<S>, exponent: f32) -> f64x8<S> {
    if exponent.fract() == 0.0 && exponent <= MAX_MULTIPLIED {
        let (mut left, mut square) = (exponent as u32, base);
        let mut product = f64x8::splat(simd, 1.0);
        while left > 0 {
            if left & 1 == 1 {
                product *= square;
            }
            square *= square;
            left >>= 1;
        }
        return product;
    }
    let mut row = [0.0; LANES];
    base.store_slice(&mut row);
    let row = row.map(|base: f64| base.powf(exponent.into()));
    f64x8::from_slice(simd, &row)
}
