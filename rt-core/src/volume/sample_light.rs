//! Light and opacity by the gradient, for sixteen samples. See [`super::shading`] for one.

use super::{VolumeHighlight, VolumeLight, VolumeOptions, VolumeShading};
use crate::simd::gather::GatherSlice;
use crate::simd::vectors::Vec3x16;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdFrom, f32x16};
use glam::Vec3;

/// Exponents of a highlight up to which it is multiplied out in lanes.
const MAX_MULTIPLIED: f32 = 128.0;

/// The lights of a volume.
#[derive(Debug, Clone)]
pub(super) struct PacketLights {
    /// Unit directions to the lights, `None` for one at the viewer, and their colours; white if
    /// `is_colored` is false.
    lights: Vec<(Option<Vec3>, [f32; 3])>,
    is_colored: bool,
    ambient: f32,
    diffuse: f32,
    /// In the units of the gradients.
    half_gradient: f32,
    /// Strength, exponent and form; `None` without a highlight.
    highlight: Option<(f32, f32, VolumeHighlight)>,
}

/// Factors of the opacity by the length of the gradient.
pub(super) struct GradientFactors<'a> {
    factors: GatherSlice<'a>,
    last: f32,
    /// Factors per unit of the gradients.
    per_unit: f32,
}

impl PacketLights {
    /// `None` without shading. Gradients are multiplied by `unit` before they are used.
    pub(super) fn new(options: &VolumeOptions, unit: f64) -> Option<Self> {
        let s: &VolumeShading = options.shading.as_ref()?;
        let is_colored = !options.lights.is_empty();
        let direction = |d: Option<Vec3>| d.map(|d| d.as_dvec3().normalize_or_zero().as_vec3());
        let lights = if is_colored {
            options.lights.iter().map(|l: &VolumeLight| (direction(l.direction), l.color)).collect()
        } else {
            vec![(direction(s.light), [1.0; 3])]
        };
        let highlight =
            (s.specular > 0.0 && !is_colored).then_some((s.specular, s.shininess, s.highlight));
        Some(PacketLights {
            lights,
            is_colored,
            ambient: s.ambient,
            diffuse: s.diffuse,
            half_gradient: (f64::from(s.half_gradient) * unit) as f32,
            highlight,
        })
    }

    /// [`PacketLights::on`] as a function of its own.
    #[inline(never)]
    pub(super) fn on_apart<S: Simd>(
        &self,
        simd: S,
        g: Vec3x16<S>,
        steepness: f32x16<S>,
        view: Vec3x16<S>,
        color: [f32x16<S>; 3],
    ) -> [f32x16<S>; 3] {
        simd.vectorize(
            #[inline(always)]
            || self.on(simd, g, steepness, view, color),
        )
    }

    /// The colours under the lights, at most 1, where the gradients are `g` and rays go along
    /// `view`.
    #[inline(always)]
    pub(super) fn on<S: Simd>(
        &self,
        simd: S,
        g: Vec3x16<S>,
        steepness: f32x16<S>,
        view: Vec3x16<S>,
        mut color: [f32x16<S>; 3],
    ) -> [f32x16<S>; 3] {
        let s = |x: f32| f32x16::splat(simd, x);
        let (zero, one) = (s(0.0), s(1.0));
        // NaN is not steep either.
        let steep = steepness.simd_gt(zero) & steepness.simd_lt(s(f32::INFINITY));
        let normal = g.scale(one / steep.select(steepness, one));
        let weight = if self.half_gradient > 0.0 {
            steepness / (steepness + s(self.half_gradient))
        } else {
            one
        };
        let flat = s(if self.half_gradient > 0.0 { 1.0 } else { self.ambient });
        let mut sums = [zero; 3];
        for (direction, light) in &self.lights {
            let cos = normal.dot(towards(simd, *direction, view)).abs();
            for (sum, c) in sums.iter_mut().zip(light) {
                *sum += cos * s(*c);
            }
            if !self.is_colored {
                sums = [sums[0]; 3];
            }
        }
        let mut peak = zero;
        if let (Some((strength, exponent, form)), [(light, _), ..]) =
            (self.highlight, &self.lights[..])
        {
            // A light at the viewer shines along the ray; both signs of the gradient are
            // equivalent.
            let viewer = if light.is_some() { view.neg() } else { view };
            let light = towards(simd, *light, view);
            let base = match form {
                VolumeHighlight::Halfway => {
                    let (halfway, is_one) = light.add(viewer).try_normalize(simd);
                    is_one.select(normal.dot(halfway).abs(), zero)
                }
                VolumeHighlight::Mirrored => {
                    let both = normal.dot(light) * normal.dot(viewer) * s(2.0);
                    (both - light.dot(viewer)).max(zero)
                }
            };
            peak = steep.select(weight * s(strength) * powers(simd, base, exponent), zero);
        }
        for (c, sum) in color.iter_mut().zip(sums) {
            let lit = one + weight * (s(self.ambient) + s(self.diffuse) * sum - one);
            *c = (*c * steep.select(lit, flat) + peak).min(one);
        }
        color
    }
}

impl<'a> GradientFactors<'a> {
    /// Two factors or more; the last one is that of gradients of length `steepest`.
    pub(super) fn new(factors: &'a [f32], steepest: f64) -> Option<Self> {
        let last = factors.len().checked_sub(1)? as f32;
        let factors = GatherSlice::new(factors)?;
        Some(GradientFactors { factors, last, per_unit: (f64::from(last) / steepest) as f32 })
    }

    /// The factors where gradients have these lengths.
    #[inline(always)]
    pub(super) fn at<S: Simd>(&self, simd: S, steepness: f32x16<S>) -> f32x16<S> {
        let s = |x: f32| f32x16::splat(simd, x);
        let place = (steepness * s(self.per_unit)).max(s(0.0)).min(s(self.last));
        let entry = place.floor().min(s(self.last - 1.0));
        let [a, b] = self.factors.pairs(simd, entry.to_int());
        a + (b - a) * (place - entry)
    }
}

/// The direction to a light; one at the viewer is along the view.
#[inline(always)]
fn towards<S: Simd>(simd: S, direction: Option<Vec3>, view: Vec3x16<S>) -> Vec3x16<S> {
    match direction {
        Some(direction) => Vec3x16::splat(simd, direction),
        None => view,
    }
}

/// `base` to the power of `exponent`.
#[inline(always)]
fn powers<S: Simd>(simd: S, base: f32x16<S>, exponent: f32) -> f32x16<S> {
    if exponent.fract() == 0.0 && exponent <= MAX_MULTIPLIED {
        let (mut left, mut square) = (exponent as u32, base);
        let mut product = f32x16::splat(simd, 1.0);
        while left > 0 {
            if left & 1 == 1 {
                product *= square;
            }
            square *= square;
            left >>= 1;
        }
        return product;
    }
    f32x16::simd_from(simd, powers_one_by_one(base.into(), exponent))
}

/// Not inlined, because sixteen calls would stand in each instance of the march.
#[inline(never)]
fn powers_one_by_one(base: [f32; 16], exponent: f32) -> [f32; 16] {
    base.map(|b| b.powf(exponent))
}
