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
}

impl DeflectionMap {
    pub(super) fn new(map: Map, framing: Framing) -> DeflectionMap {
        let mut sizes: Vec<f32> = map.deflection_rad.iter().map(|d| d[0].hypot(d[1])).collect();
        let mut strong_rad = 0.0;
        if !sizes.is_empty() {
            let at = sizes.len() * 995 / 1000;
            strong_rad = f64::from(*sizes.select_nth_unstable_by(at, f32::total_cmp).1);
        }
        DeflectionMap { map, framing, strong_rad }
    }
}
