//! What the volumes of a scene cost.

use super::costs::PartCosts;
use super::volume_work::{VolumeInView, VolumeWork};
use rt_core::glam::DVec3;
use rt_core::simd::SimdLevel;

/// The volumes whose costs are known.
#[derive(Debug, Clone, Default)]
pub struct Media {
    costs: PartCosts,
    /// World bounds of each.
    bounds: Vec<[DVec3; 2]>,
    overlap: bool,
}

impl Media {
    /// Adds a volume, if its work can be counted.
    pub fn add(&mut self, volume: &VolumeInView<'_>) {
        let Some(work) = VolumeWork::count(volume) else { return };
        self.costs += PartCosts::of_volume(&work, SimdLevel::available().last().copied());
        let corners = (0..8).map(|i| {
            let corner = DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2));
            volume.world_from_unit.transform_point3(corner)
        });
        let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let own = corners.fold(none, |[low, high], p| [low.min(p), high.max(p)]);
        let meets =
            |other: &[DVec3; 2]| own[0].cmplt(other[1]).all() && other[0].cmplt(own[1]).all();
        self.overlap |= self.bounds.iter().any(meets);
        self.bounds.push(own);
    }

    /// How many there are. None if some may overlap: these are integrated, not sampled as OpenGL
    /// does.
    pub fn known(&self) -> u32 {
        if self.overlap { 0 } else { self.bounds.len() as u32 }
    }

    /// What they cost together.
    pub fn costs(&self) -> PartCosts {
        if self.overlap { PartCosts::default() } else { self.costs }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::glam::DMat4;

    #[test]
    fn volumes_that_may_overlap_are_not_known() {
        let at = |x: f64| VolumeInView {
            values: &[1.0; 8],
            dims: [2; 3],
            range: [0.0, 1.0],
            opacities: &[0.0, 0.1],
            unit_distance: 1.0,
            sample_distance: 0.1,
            world_from_unit: DMat4::from_translation(DVec3::new(x, 0.0, 0.0)),
            clip_from_world: DMat4::IDENTITY,
            size: [64, 64],
            points: 8,
            shaded: false,
        };
        let mut media = Media::default();
        media.add(&at(-1.0));
        media.add(&at(0.0));
        assert_eq!(media.known(), 2);
        assert!(media.costs().opengl > 0.0);
        media.add(&at(0.5));
        assert_eq!((media.known(), media.costs()), (0, PartCosts::default()));
    }
}
