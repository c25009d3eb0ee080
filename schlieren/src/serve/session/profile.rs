//! What light does along a line on the image.

use super::{RefusedChange, Session, refused};
use crate::serve::deflection_map::Around;
use serde::Serialize;

/// Points of a profile.
const POINTS: usize = 257;

/// Quantities at equal distances along a line; nothing where no light lands.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(in crate::serve) struct Profile {
    /// Length of the line in the test section.
    pub(in crate::serve) length_m: f64,
    /// Deflection to the right and up.
    pub(in crate::serve) deflection_rad: Vec<Option<[f32; 2]>>,
    /// Optical path difference in waves; empty unless fringes are shown.
    pub(in crate::serve) waves: Vec<Option<f32>>,
    /// How far the dots of a background seem to move to the right and up, in metres in the test
    /// section; empty without dots.
    pub(in crate::serve) dots_m: Vec<Option<[f32; 2]>>,
}

impl Session {
    /// The profile between two points of the image, 0 to 1 from its upper left corner.
    ///
    /// # Errors
    /// If a point is outside the image, both are one, or there is no image yet.
    pub(in crate::serve) fn profile(
        &self,
        from: [f64; 2],
        to: [f64; 2],
    ) -> Result<Profile, RefusedChange> {
        if !from.iter().chain(&to).all(|c| (0.0..=1.0).contains(c)) {
            return Err(refused("points on the image are 0 to 1 from its upper left corner"));
        }
        if from == to {
            return Err(refused("a profile needs two points that differ"));
        }
        let shared = self.lock();
        let view = shared.frame.as_ref().and_then(|f| f.traced.clone());
        drop(shared);
        let view = view.ok_or_else(|| refused("the image is not rendered yet"))?;
        let side = |c: usize, n: u32| (to[c] - from[c]) * f64::from(n) * view.framing.pixel_m;
        let length_m = side(0, view.framing.width).hypot(side(1, view.framing.height));
        let point = |i: usize| {
            let t = i as f64 / (POINTS - 1) as f64;
            [0, 1].map(|c| (from[c] + t * (to[c] - from[c])).clamp(0.0, 1.0))
        };
        let places: Vec<_> = (0..POINTS).map(|i| view.light_at(point(i))).collect();
        let map = &view.map;
        let deflection = |p: &Option<Around>| p.and_then(|p| p.mean_vector(&map.deflection_rad));
        let waves = |p: &Option<Around>| p.and_then(|p| p.mean(&map.waves));
        let dots = |p: &Option<Around>| {
            let moved = p.and_then(|p| p.mean_vector(&map.apparent_m));
            moved.filter(|m| m.iter().all(|c| c.is_finite()))
        };
        Ok(Profile {
            length_m,
            deflection_rad: places.iter().map(deflection).collect(),
            waves: match map.waves.is_empty() {
                true => Vec::new(),
                false => places.iter().map(waves).collect(),
            },
            dots_m: match map.apparent_m.is_empty() {
                true => Vec::new(),
                false => places.iter().map(dots).collect(),
            },
        })
    }
}
