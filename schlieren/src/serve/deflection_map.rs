//! The deflections of a traced image, which the filter plane and the legend ask for.

use crate::film::Framing;
use crate::render::Map;

/// The deflections of a view, for tracing pixels to the filter.
pub(super) struct DeflectionMap {
    pub(super) map: Map,
    pub(super) framing: Framing,
    /// The deflection that all but few rays stay below. A shock deflects these far: with them the
    /// rest of the light would shrink to a dot.
    pub(super) strong_rad: f64,
    /// Whether rays go from the film through the flow, as those of a background's dots. Then they
    /// are known by where they end; otherwise by where they start.
    pub(super) from_film: bool,
}

impl DeflectionMap {
    pub(super) fn new(map: Map, framing: Framing, from_film: bool) -> DeflectionMap {
        let mut sizes: Vec<f32> = map.deflection_rad.iter().map(|d| d[0].hypot(d[1])).collect();
        let mut strong_rad = 0.0;
        if !sizes.is_empty() {
            let at = sizes.len() * 995 / 1000;
            strong_rad = f64::from(*sizes.select_nth_unstable_by(at, f32::total_cmp).1);
        }
        DeflectionMap { map, framing, strong_rad, from_film }
    }

    /// The pixels of the map whose light lands at a point of the image, which is 0..=1 from its
    /// upper left corner. `None` where no light lands.
    ///
    /// Out of focus, rays land elsewhere than they start. A few steps of a fixed-point iteration
    /// find the start.
    pub(super) fn light_at(&self, at: [f64; 2]) -> Option<Around> {
        let DeflectionMap { map, framing, .. } = self;
        let end_px = [at[0] * f64::from(framing.width), at[1] * f64::from(framing.height)];
        let mut start = end_px;
        for _ in 0..if self.from_film { 0 } else { 4 } {
            let moved = self.around(start).mean_vector(&map.displacement_m)?;
            start = [
                end_px[0] - f64::from(moved[0]) / framing.pixel_m,
                end_px[1] + f64::from(moved[1]) / framing.pixel_m,
            ];
        }
        if !start.iter().all(|v| v.is_finite()) {
            return None;
        }
        let arrives = |pixel: usize| map.transmission.get(pixel).is_some_and(|t| *t > 0.0);
        let around = self.around(start);
        if around.0.iter().all(|(pixel, weight)| *weight == 0.0 || arrives(*pixel)) {
            return Some(around);
        }
        // Beside a shadow: what the nearest pixel has.
        let nearest = around.0.iter().max_by(|a, b| a.1.total_cmp(&b.1))?.0;
        arrives(nearest).then_some(Around([(nearest, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)]))
    }

    /// The pixels around a place, in pixels from the upper left corner, for linear interpolation
    /// between their centres.
    fn around(&self, place_px: [f64; 2]) -> Around {
        let [w, h] = [self.framing.width, self.framing.height].map(|n| n as usize);
        let cell = |at: f64, count: usize| {
            let at = (at - 0.5).clamp(0.0, (count - 1) as f64);
            let first = (at as usize).min(count.saturating_sub(2));
            (first, (first + 1).min(count - 1), (at - first as f64) as f32)
        };
        let ((i, i1, s), (j, j1, t)) = (cell(place_px[0], w), cell(place_px[1], h));
        Around([
            (j * w + i, (1.0 - s) * (1.0 - t)),
            (j * w + i1, s * (1.0 - t)),
            (j1 * w + i, (1.0 - s) * t),
            (j1 * w + i1, s * t),
        ])
    }
}

/// Pixels of a map around a place, with their weights.
#[derive(Debug, Clone, Copy)]
pub(super) struct Around([(usize, f32); 4]);

impl Around {
    /// The weighted mean of numbers, one for each pixel of the map.
    pub(super) fn mean(&self, of_pixels: &[f32]) -> Option<f32> {
        self.mean_vector_of(|pixel| of_pixels.get(pixel).map(|v| [*v; 2])).map(|v| v[0])
    }

    /// The weighted mean of vectors.
    pub(super) fn mean_vector(&self, of_pixels: &[[f32; 2]]) -> Option<[f32; 2]> {
        self.mean_vector_of(|pixel| of_pixels.get(pixel).copied())
    }

    fn mean_vector_of(&self, of: impl Fn(usize) -> Option<[f32; 2]>) -> Option<[f32; 2]> {
        let mut sum = [0.0; 2];
        // What has no weight may be no number.
        for (pixel, weight) in self.0.into_iter().filter(|p| p.1 > 0.0) {
            let value = of(pixel)?;
            (0..2).for_each(|c| sum[c] += weight * value[c]);
        }
        Some(sum)
    }
}
