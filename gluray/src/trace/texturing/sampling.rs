//! Samples textures at a fragment: wrapping, filters and the choice among mipmap levels.
//!
//! The footprint of a pixel is the longer of the two derivatives (compatibility profile
//! specification, equation 8.7). Derivatives are computed as in llvmpipe: differences within each
//! quad of two by two pixels.

use super::filters::Mip;
use super::image::{Image, Level};
use crate::enums::*;

impl Image {
    /// True when the footprint of a pixel affects sampling.
    pub(crate) fn needs_footprint(&self) -> bool {
        self.filters.mip != Mip::None || self.filters.min_linear != self.filters.mag_linear
    }

    /// The width and height of the base level in texels.
    pub(crate) fn size(&self) -> [f32; 2] {
        [self.levels[0].width as f32, self.levels[0].height as f32]
    }

    /// The texel at (s, t) of the base level, magnified.
    pub(crate) fn sample(&self, s: f32, t: f32) -> [f32; 4] {
        self.filtered(&self.levels[0], self.filters.mag_linear, s, t)
    }

    /// The texel at (s, t) for a pixel that covers `rho` texels of the base level.
    pub(crate) fn sample_over(&self, s: f32, t: f32, rho: f32) -> [f32; 4] {
        let f = &self.filters;
        let (smaller, level, share) = f.choose(rho, self.levels.len() - 1);
        if !smaller && f.min_linear != f.mag_linear {
            return self.sample(s, t);
        }
        let near = self.filtered(&self.levels[level], f.min_linear, s, t);
        if share <= 0.0 {
            return near;
        }
        let far = self.filtered(&self.levels[level + 1], f.min_linear, s, t);
        std::array::from_fn(|k| near[k] + (far[k] - near[k]) * share)
    }

    fn texel(&self, level: &Level, x: i64, y: i64) -> [f32; 4] {
        let (w, h) = (level.width as i64, level.height as i64);
        let place = |i: i64, n: i64, wrap: u32| match wrap {
            REPEAT => Some(i.rem_euclid(n)),
            MIRRORED_REPEAT => {
                let k = i.rem_euclid(2 * n);
                Some(if k < n { k } else { 2 * n - 1 - k })
            }
            CLAMP_TO_EDGE => Some(i.clamp(0, n - 1)),
            _ => (0..n).contains(&i).then_some(i),
        };
        match (place(x, w, self.wrap[0]), place(y, h, self.wrap[1])) {
            (Some(x), Some(y)) => level.texels.at((y * w + x) as usize),
            _ => self.border,
        }
    }

    fn filtered(&self, level: &Level, linear: bool, s: f32, t: f32) -> [f32; 4] {
        let clamp = |v: f32, wrap: u32| if wrap == CLAMP { v.clamp(0.0, 1.0) } else { v };
        let x = clamp(s, self.wrap[0]) * level.width as f32;
        let y = clamp(t, self.wrap[1]) * level.height as f32;
        if !(x.is_finite() && y.is_finite()) {
            return self.border;
        }
        if !linear {
            // GL_CLAMP at 1 is the last texel here.
            let last = |v: f32, n: usize, wrap: u32| {
                let i = v.floor() as i64;
                if wrap == CLAMP { i.min(n as i64 - 1) } else { i }
            };
            let (x, y) = (last(x, level.width, self.wrap[0]), last(y, level.height, self.wrap[1]));
            return self.texel(level, x, y);
        }
        let (x, y) = (x - 0.5, y - 0.5);
        let (i, j) = (x.floor(), y.floor());
        let (a, b) = (x - i, y - j);
        let (i, j) = (i as i64, j as i64);
        let [p, q, r, u] =
            [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| self.texel(level, i + dx, j + dy));
        std::array::from_fn(|k| {
            let (lo, hi) = (p[k] + (q[k] - p[k]) * a, r[k] + (u[k] - r[k]) * a);
            lo + (hi - lo) * b
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::filters::Filters;
    use super::super::image::{BaseFormat, Texels};
    use super::*;

    fn image(linear: bool, wrap: u32) -> Image {
        let texels = Texels::Bytes(vec![[0; 4], [255; 4]]);
        Image {
            levels: vec![Level { width: 2, height: 1, texels }],
            base: BaseFormat::Rgba,
            filters: Filters {
                mag_linear: linear,
                min_linear: linear,
                mip: Mip::None,
                bias: 0.0,
                lod: [-1000.0, 1000.0],
            },
            wrap: [wrap, CLAMP_TO_EDGE],
            border: [0.5; 4],
        }
    }

    #[test]
    fn filters_and_wraps_are_opengls() {
        assert_eq!(image(false, REPEAT).sample(1.3, 0.0)[0], 0.0);
        assert_eq!(image(false, MIRRORED_REPEAT).sample(1.3, 0.0)[0], 1.0);
        assert_eq!(image(false, CLAMP_TO_BORDER).sample(1.3, 0.0)[0], 0.5);
        assert_eq!(image(true, CLAMP_TO_EDGE).sample(0.5, 0.5)[0], 0.5);
        assert_eq!(image(true, CLAMP_TO_EDGE).sample(9.0, 0.5)[0], 1.0);
        assert_eq!(image(true, CLAMP).sample(1.0, 0.5)[0], 0.75, "half edge, half border");
    }

    #[test]
    fn levels_follow_the_footprint_within_their_limits() {
        let mut f = image(true, REPEAT).filters;
        f.mip = Mip::Nearest;
        assert_eq!(f.choose(0.3, 5), (false, 0, 0.0));
        assert_eq!(f.choose(2.0, 5), (true, 1, 0.0));
        assert_eq!(f.choose(2.9, 5), (true, 2, 0.0));
        assert_eq!(f.choose(1e9, 5), (true, 5, 0.0), "no level beyond the last");
        assert_eq!(f.choose(f32::NAN, 5).1, 0);
        f.bias = 1.0;
        assert_eq!(f.choose(2.0, 5), (true, 2, 0.0));
        f.lod = [0.0, 1.0];
        assert_eq!(f.choose(64.0, 5), (true, 1, 0.0));
        f.lod = [3.0, 1000.0];
        assert_eq!(f.choose(0.01, 5), (true, 3, 0.0), "at least that deep");
    }

    #[test]
    fn two_levels_are_blended_by_the_fraction_of_the_level_of_detail() {
        let mut f = image(true, REPEAT).filters;
        f.mip = Mip::Linear;
        assert_eq!(f.choose(2.0, 5), (true, 1, 0.0));
        assert_eq!(f.choose(0.5, 5), (false, 0, 0.0));
        let (_, level, share) = f.choose(2.0 * std::f32::consts::SQRT_2, 5);
        assert!(level == 1 && (share - 0.5).abs() < 1e-5, "{level} {share}");
        f.bias = -0.25;
        let (_, level, share) = f.choose(2.0 * std::f32::consts::SQRT_2, 5);
        assert!(level == 1 && (share - 0.25).abs() < 1e-5, "{level} {share}");
    }

    #[test]
    fn one_filter_makes_larger_and_another_smaller() {
        let mut i = image(true, CLAMP_TO_EDGE);
        i.filters.min_linear = false;
        assert!(i.needs_footprint());
        assert_eq!(i.sample_over(0.5, 0.5, 0.9)[0], 0.5);
        assert_eq!(i.sample_over(0.5, 0.5, 1.1)[0], 1.0);
    }
}
