//! How much work a volume is: the samples of its frame, counted along few rays through few of its
//! values.
//!
//! A frame costs what its samples cost, and how many there are hangs on the view, on the distance
//! between them, and on the opacity, which ends rays. A count is the same on every machine and in
//! every run, which a time is not.

use rt_core::glam::{DMat4, DVec3};

/// Rays per axis of the picture.
const RAYS: u32 = 24;
/// Steps along a ray; with more samples than that, a step stands for several.
const MAX_STEPS: f64 = 256.0;
/// VTK and rt-core end rays here.
const OPAQUE_BELOW: f64 = 1.0 / 255.0;

/// A volume as the count sees it.
#[derive(Debug, Clone, Copy)]
pub struct VolumeInView<'a> {
    /// Values at points evenly spread from the first to the last of each axis, x fastest.
    pub values: &'a [f32],
    /// Their number per axis.
    pub dims: [u32; 3],
    /// Values of the first and the last of the opacities.
    pub range: [f64; 2],
    /// Opacities of a slab of `unit_distance`.
    pub opacities: &'a [f32],
    /// See `opacities`; world units.
    pub unit_distance: f64,
    /// Distance between samples, world units.
    pub sample_distance: f64,
    /// World position of points of the unit cube, which the volume fills.
    pub world_from_unit: DMat4,
    /// OpenGL's projection · view.
    pub clip_from_world: DMat4,
    /// Pixels of the picture.
    pub size: [u32; 2],
    /// Points of the whole volume.
    pub points: u64,
    /// Shading by the gradient.
    pub shaded: bool,
}

/// What a frame of a volume consists of.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct VolumeWork {
    /// Pixels whose rays meet its box.
    pub pixels: f64,
    /// Samples up to where their rays are opaque or leave the box.
    pub samples: f64,
    /// Of these, samples with an opacity.
    pub seen: f64,
    /// Points of the volume.
    pub points: u64,
    /// Seen samples are shaded by the gradient.
    pub shaded: bool,
}

impl VolumeWork {
    /// The work in this view; `None` if there is nothing to count with.
    pub fn count(v: &VolumeInView<'_>) -> Option<VolumeWork> {
        let lattice = v.dims.iter().try_fold(1usize, |n, d| n.checked_mul(*d as usize))?;
        let positive = |x: f64| x > 0.0 && x.is_finite();
        let countable = lattice > 0
            && v.values.len() == lattice
            && !v.opacities.is_empty()
            && positive(v.unit_distance)
            && positive(v.sample_distance);
        if !countable {
            return None;
        }
        let mut sum = VolumeWork { points: v.points, shaded: v.shaded, ..VolumeWork::default() };
        let unit_from_clip = (v.clip_from_world * v.world_from_unit).inverse();
        for j in 0..RAYS {
            for i in 0..RAYS {
                let [x, y] = [i, j].map(|k| (2.0 * f64::from(k) + 1.0) / f64::from(RAYS) - 1.0);
                v.march(
                    [-1.0, 1.0].map(|z| unit_from_clip.project_point3(DVec3::new(x, y, z))),
                    &mut sum,
                );
            }
        }
        let pixels_per_ray = f64::from(v.size[0]) * f64::from(v.size[1]) / f64::from(RAYS * RAYS);
        for count in [&mut sum.pixels, &mut sum.samples, &mut sum.seen] {
            *count *= pixels_per_ray;
        }
        Some(sum)
    }
}

impl VolumeInView<'_> {
    /// Counts along a ray between two points of the unit cube's space.
    fn march(&self, [start, end]: [DVec3; 2], sum: &mut VolumeWork) {
        let along = end - start;
        let (mut near, mut far) = (0.0f64, 1.0f64);
        for axis in 0..3 {
            let [u, v] = [0.0, 1.0].map(|face| (face - start[axis]) / along[axis]);
            // For rays parallel to the face, NaN and infinities either leave both ends unchanged or
            // make the interval empty, as intended.
            (near, far) = (near.max(u.min(v)), far.min(u.max(v)));
        }
        // Neither is NaN, which `max` and `min` leave out.
        if near >= far {
            return;
        }
        let length = self.world_from_unit.transform_vector3(along * (far - near)).length();
        let samples = (length / self.sample_distance).ceil();
        if !samples.is_finite() {
            return;
        }
        sum.pixels += 1.0;
        let steps = samples.clamp(1.0, MAX_STEPS);
        let samples_per_step = samples / steps;
        let units = samples_per_step * self.sample_distance / self.unit_distance;
        let mut through = 1.0;
        for k in 0..steps as u32 {
            let t = near + (far - near) * (f64::from(k) + 0.5) / steps;
            let opacity = f64::from(self.opacity(start + along * t)).clamp(0.0, 1.0);
            sum.samples += samples_per_step;
            if opacity > 0.0 {
                sum.seen += samples_per_step;
                through *= (1.0 - opacity).powf(units);
            }
            if through < OPAQUE_BELOW {
                return;
            }
        }
    }

    /// The opacity of the nearest value.
    fn opacity(&self, place: DVec3) -> f32 {
        let index = |axis: usize| {
            let last = self.dims[axis] - 1;
            ((place[axis] * f64::from(last) + 0.5).max(0.0) as u32).min(last) as usize
        };
        let [nx, ny, _] = self.dims.map(|n| n as usize);
        let value = f64::from(self.values[(index(2) * ny + index(1)) * nx + index(0)]);
        let [low, high] = self.range;
        let last = (self.opacities.len() - 1) as f64;
        // Values that are not a number become the first entry.
        let entry = ((value - low) / (high - low) * last + 0.5).max(0.0) as usize;
        self.opacities[entry.min(self.opacities.len() - 1)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit cube that fills half of a parallel picture of 100 by 100 pixels in both directions.
    fn cube<'a>(values: &'a [f32], opacities: &'a [f32]) -> VolumeInView<'a> {
        let dims = [2, 2, 2];
        VolumeInView {
            values,
            dims,
            range: [0.0, 1.0],
            opacities,
            unit_distance: 1.0,
            sample_distance: 0.01,
            world_from_unit: DMat4::from_translation(DVec3::splat(-0.5)),
            clip_from_world: DMat4::IDENTITY,
            size: [100, 100],
            points: 8,
            shaded: false,
        }
    }

    #[test]
    fn samples_are_those_of_the_pixels_that_meet_the_box() {
        let work = VolumeWork::count(&cube(&[1.0; 8], &[0.0, 0.5])).unwrap();
        assert_eq!((work.pixels, work.samples, work.seen), (2_500.0, 250_000.0, 250_000.0));
        let near = VolumeInView { sample_distance: 0.001, ..cube(&[1.0; 8], &[0.0, 0.5]) };
        assert!((VolumeWork::count(&near).unwrap().samples - 2_500_000.0).abs() < 1.0);
    }

    #[test]
    fn clear_samples_are_not_seen_and_opaque_ones_end_their_rays() {
        let left = [1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0];
        let work = VolumeWork::count(&cube(&left, &[0.0, 0.1])).unwrap();
        assert_eq!((work.samples, work.seen), (250_000.0, 125_000.0));
        let work = VolumeWork::count(&cube(&[1.0; 8], &[0.0, 1.0])).unwrap();
        assert_eq!((work.samples, work.seen), (2_500.0, 2_500.0));
    }

    #[test]
    fn values_and_views_that_make_no_sense_count_nothing_or_as_clear() {
        let nan = [f32::NAN; 8];
        assert_eq!(VolumeWork::count(&cube(&nan, &[0.0, 1.0])).unwrap().seen, 0.0);
        let flat = VolumeInView { clip_from_world: DMat4::ZERO, ..cube(&nan, &[0.0]) };
        assert_eq!(VolumeWork::count(&flat).unwrap().samples, 0.0);
        assert_eq!(VolumeWork::count(&VolumeInView { dims: [3; 3], ..cube(&nan, &[0.0]) }), None);
        let thick = VolumeInView { sample_distance: 0.0, ..cube(&nan, &[0.0]) };
        assert_eq!(VolumeWork::count(&thick), None);
        assert_eq!(VolumeWork::count(&cube(&nan, &[])), None);
    }
}
