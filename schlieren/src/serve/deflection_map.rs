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

    /// The pixel of the map whose light lands at a point of the image, which is 0..=1 from its
    /// upper left corner. `None` where no light lands.
    ///
    /// Out of focus, rays land elsewhere than they start. A few steps of a fixed-point iteration
    /// find the start.
    pub(super) fn pixel_at(&self, at: [f64; 2]) -> Option<usize> {
        let DeflectionMap { map, framing, .. } = self;
        let [w, h] = [framing.width, framing.height];
        let end_px = [at[0] * f64::from(w), at[1] * f64::from(h)];
        let pixel = |p: [f64; 2]| {
            let [x, y] = [
                p[0].clamp(0.0, f64::from(w - 1)) as usize,
                p[1].clamp(0.0, f64::from(h - 1)) as usize,
            ];
            y * w as usize + x
        };
        let mut start = end_px;
        for _ in 0..if self.from_film { 0 } else { 4 } {
            let moved = map.displacement_m.get(pixel(start))?;
            start = [
                end_px[0] - f64::from(moved[0]) / framing.pixel_m,
                end_px[1] + f64::from(moved[1]) / framing.pixel_m,
            ];
        }
        let k = pixel(start);
        let arrives = start.iter().all(|v| v.is_finite()) && *map.transmission.get(k)? > 0.0;
        arrives.then_some(k)
    }
}
