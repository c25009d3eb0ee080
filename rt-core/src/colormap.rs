//! Maps scalars to colours with a one-dimensional lookup table (thesis section 3.2.5). Scalars are
//! interpolated first and then mapped, so a colour map stays sharp inside large triangles.

use crate::ray::LANES;
use crate::simd::vectors::Row;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x16};

/// Linear RGBA.
pub type Rgba = [f32; 4];

/// A colour map: linear interpolation between evenly spaced colours over `range`.
#[derive(Debug, Clone, PartialEq)]
pub struct ColorMap {
    /// The colours, evenly spaced over `range`; linear RGB, alpha is opacity. A
    /// scene takes no map without colours; [`ColorMap::lookup`] of an empty list is opaque white.
    pub colors: Vec<Rgba>,
    /// Scalars at the first and the last colour. Values outside get the end colours.
    pub range: [f32; 2],
    /// Whether the map is logarithmic in the scalar (both ends of `range` must be positive).
    pub log: bool,
    /// Colour of NaN scalars.
    pub nan_color: Rgba,
}

impl ColorMap {
    /// A linear map over `range`. An empty list becomes white.
    pub fn new(colors: Vec<Rgba>, range: [f32; 2]) -> Self {
        let colors = if colors.is_empty() { vec![[1.0; 4]] } else { colors };
        ColorMap { colors, range, log: false, nan_color: [1.0, 0.0, 1.0, 1.0] }
    }

    /// Checks the numbers. The error contains the field, its value and the valid values.
    pub(crate) fn check(&self) -> Result<(), (&'static str, String, &'static str)> {
        if self.colors.is_empty() {
            return Err(("color map", "without colours".into(), "one with at least one colour"));
        }
        let broken = self
            .colors
            .iter()
            .chain([&self.nan_color])
            .position(|c| !c.iter().all(|v| v.is_finite()));
        if let Some(i) = broken {
            let (field, c) = match self.colors.get(i) {
                Some(c) => ("color map", c),
                None => ("color map's nan_color", &self.nan_color),
            };
            return Err((field, format!("{c:?} at place {i}"), "finite in every channel"));
        }
        if self.range.iter().all(|r| if self.log { *r > 0.0 } else { !r.is_nan() }) {
            return Ok(());
        }
        let rule = "two numbers and, for a logarithmic map, positive ones";
        Err(("color map's range", format!("{:?}", self.range), rule))
    }

    /// The colour of `scalar`.
    #[inline]
    pub fn lookup(&self, scalar: f32) -> Rgba {
        if scalar.is_nan() {
            return self.nan_color;
        }
        let [a, b] = self.range;
        let t = if self.log { (scalar / a).ln() / (b / a).ln() } else { (scalar - a) / (b - a) };
        // A range of zero width gives NaN or infinity here. The map then is a step at that value.
        let t = if t.is_nan() { 0.5 } else { t.clamp(0.0, 1.0) };
        let Some(last) = self.colors.len().checked_sub(1) else { return [1.0; 4] };
        let x = t * last as f32;
        let i = (x as usize).min(last);
        let j = (i + 1).min(last);
        let f = x - i as f32;
        std::array::from_fn(|c| self.colors[i][c] + (self.colors[j][c] - self.colors[i][c]) * f)
    }

    /// [`ColorMap::lookup`] of sixteen scalars, with the same bits. `out` has one row per channel.
    #[inline(always)]
    pub(crate) fn lookup_block<S: Simd>(&self, simd: S, scalars: f32x16<S>, out: &mut [Row; 4]) {
        let v = |x: f32| f32x16::splat(simd, x);
        if self.log {
            // Logarithms are not vectorised, so each lane is computed by itself.
            for lane in 0..LANES {
                let color = self.lookup(scalars[lane]);
                for c in 0..4 {
                    out[c][lane] = color[c];
                }
            }
            return;
        }
        let Some(last) = self.colors.len().checked_sub(1) else {
            *out = [[1.0; LANES]; 4];
            return;
        };
        let [a, b] = self.range;
        let t = (scalars - v(a)) / v(b - a);
        let t = t.simd_eq(t).select(t.max(v(0.0)).min(v(1.0)), v(0.5));
        let x = t * v(last as f32);
        // Not negative, so truncation rounds down.
        let i = x.floor();
        let f = x - i;
        let (mut low, mut high) = ([[0.0; LANES]; 4], [[0.0; LANES]; 4]);
        for lane in 0..LANES {
            let i = (i[lane] as usize).min(last);
            let (p, q) = (self.colors[i], self.colors[(i + 1).min(last)]);
            for c in 0..4 {
                (low[c][lane], high[c][lane]) = (p[c], q[c]);
            }
        }
        let known = scalars.simd_eq(scalars);
        for c in 0..4 {
            let (p, q) = (f32x16::from_slice(simd, &low[c]), f32x16::from_slice(simd, &high[c]));
            let mixed = p + (q - p) * f;
            let color =
                if known.all_true() { mixed } else { known.select(mixed, v(self.nan_color[c])) };
            color.store_slice(&mut out[c]);
        }
    }
}

/// sRGB-encoded component (0..=1) to linear (IEC 61966-2-1).
#[inline]
pub fn srgb_to_linear(v: f32) -> f32 {
    if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// Linear component to sRGB-encoded (IEC 61966-2-1).
#[inline]
pub fn linear_to_srgb(v: f32) -> f32 {
    if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}
