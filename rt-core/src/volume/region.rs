//! What is drawn of a volume: a box, half-spaces, and the regions of a cropping.
//!
//! A ray's part in a convex region is one interval; cropping to other regions than one box leaves
//! up to four of them.

use super::{Blend, VolumeError, VolumeOptions};
use glam::DVec3;
use std::iter;

/// A half-space: what lies on the side of the normal is kept, and so is the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClipPlane {
    /// A point of the plane, world units from the grid's origin in the volume's axes.
    pub point: DVec3,
    /// Its normal, of any length but zero, in the volume's axes.
    pub normal: DVec3,
}

/// Three slabs cut space into 3 x 3 x 3 regions, of which some are drawn
/// (`vtkVolumeMapper::SetCroppingRegionFlags`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cropping {
    /// The lower and the upper planes of the slabs, world units from the grid's origin in the
    /// volume's axes.
    pub planes: [DVec3; 2],
    /// Bit x + 3 y + 9 z is set where the region is drawn; 0, 1 and 2 stand for below, between and
    /// above the planes of an axis.
    pub regions: u32,
}

impl Cropping {
    /// The region between all planes alone.
    pub const BOX: u32 = 1 << 13;
    /// All regions.
    pub const ALL: u32 = (1 << 27) - 1;

    /// Whether one box is drawn.
    pub fn is_box(&self) -> bool {
        self.regions == Cropping::BOX
    }

    /// Whether a position is drawn. A position on a plane is between the planes.
    pub fn contains(&self, position: DVec3) -> bool {
        let [low, high] = self.planes;
        let side = |a: usize| u32::from(position[a] >= low[a]) + u32::from(position[a] > high[a]);
        (self.regions >> (side(0) + 3 * side(1) + 9 * side(2))) & 1 == 1
    }
}

/// Intervals of a ray, in order, without common points: no more than seven slabs have.
#[derive(Debug, Clone, Copy)]
pub(super) struct Intervals {
    ends: [[f64; 2]; 4],
    count: usize,
}

impl Intervals {
    fn one(t0: f64, t1: f64) -> Intervals {
        Intervals { ends: [[t0, t1]; 4], count: usize::from(t0 < t1) }
    }

    pub(super) fn as_slice(&self) -> &[[f64; 2]] {
        &self.ends[..self.count]
    }

    /// Appends an interval behind all others; one that begins where the last ends continues it.
    fn push(&mut self, t0: f64, t1: f64) {
        if let Some(last) = self.ends[..self.count].last_mut()
            && last[1] == t0
        {
            last[1] = t1;
        } else if let Some(next) = self.ends.get_mut(self.count) {
            *next = [t0, t1];
            self.count += 1;
        }
    }
}

impl VolumeOptions {
    /// Where a ray enters and leaves the part that is drawn, between `t0` and `t1`: empty where the
    /// first is not less. Cropping to several regions counts as their box, which is everything.
    pub(super) fn clipped(&self, o: DVec3, d: DVec3, t0: f64, t1: f64) -> [f64; 2] {
        let [t0, t1] = self.entered(o, d, t0, t1);
        match &self.cropping {
            Some(c) if c.is_box() => in_box(o, d, c.planes, t0, t1),
            _ => [t0, t1],
        }
    }

    /// [`VolumeOptions::clipped`] without cropping.
    fn entered(&self, o: DVec3, d: DVec3, t0: f64, t1: f64) -> [f64; 2] {
        let [t0, t1] = self.in_bounds(o, d, t0, t1);
        self.in_front(o, d, t0, t1)
    }

    /// The part of an interval inside the bounds.
    pub(super) fn in_bounds(&self, o: DVec3, d: DVec3, t0: f64, t1: f64) -> [f64; 2] {
        self.bounds.map_or([t0, t1], |bounds| in_box(o, d, bounds, t0, t1))
    }

    /// The part of an interval in front of all clip planes.
    pub(super) fn in_front(&self, o: DVec3, d: DVec3, mut t0: f64, mut t1: f64) -> [f64; 2] {
        for plane in &self.clip_planes {
            let (along, before) = (plane.normal.dot(d), plane.normal.dot(plane.point - o));
            if along > 0.0 {
                t0 = t0.max(before / along);
            } else if along < 0.0 {
                t1 = t1.min(before / along);
            } else if before > 0.0 {
                return [t1, t0.min(t1)];
            }
        }
        [t0, t1]
    }

    /// The parts of an interval that cropping leaves.
    pub(super) fn cropped(&self, o: DVec3, d: DVec3, [t0, t1]: [f64; 2]) -> Intervals {
        let Some(cropping) = &self.cropping else { return Intervals::one(t0, t1) };
        if cropping.is_box() {
            let [t0, t1] = in_box(o, d, cropping.planes, t0, t1);
            return Intervals::one(t0, t1);
        }
        let mut out = Intervals { ends: [[0.0; 2]; 4], count: 0 };
        if t0.is_nan() || t1.is_nan() || t0 >= t1 {
            return out;
        }
        let mut cuts = [t1; 6];
        for (cut, (plane, a)) in
            cuts.iter_mut().zip(cropping.planes.iter().flat_map(|p| (0..3).map(move |a| (p[a], a))))
        {
            let t = (plane - o[a]) / d[a];
            if t > t0 && t < t1 {
                *cut = t;
            }
        }
        cuts.sort_by(f64::total_cmp);
        let mut near = t0;
        for far in cuts.into_iter().chain(iter::once(t1)) {
            if near < far {
                // An interval without an end is decided far out, where it lies on one side of all.
                let middle = if far.is_finite() { near + 0.5 * (far - near) } else { f64::MAX };
                if cropping.contains((o + d * middle).min(DVec3::MAX).max(DVec3::MIN)) {
                    out.push(near, far);
                }
                near = far;
            }
        }
        out
    }

    /// The first fault of what is drawn.
    pub(super) fn check_region(&self) -> Result<(), VolumeError> {
        let fault = |field, rule| Err(VolumeError::Region { field, rule });
        const BOX: &str = "two finite corners, the lower one first";
        let is_box =
            |[low, high]: [DVec3; 2]| low.is_finite() && high.is_finite() && low.cmple(high).all();
        if self.bounds.is_some_and(|b| !is_box(b)) {
            return fault("bounds", BOX);
        }
        if self
            .clip_planes
            .iter()
            .any(|p| !p.point.is_finite() || !p.normal.is_finite() || p.normal == DVec3::ZERO)
        {
            return fault("clip_planes", "finite, with normals that are not zero");
        }
        if let Some(c) = &self.cropping {
            if !is_box(c.planes) {
                return fault("cropping's planes", BOX);
            }
            if c.regions > Cropping::ALL {
                return fault("cropping's regions", "27 bits");
            }
            if !c.is_box() && self.blend != Blend::Composite {
                return fault("cropping's regions", "one box, unless the blending is composite");
            }
        }
        Ok(())
    }
}

/// The part of an interval in which a ray is inside a box; empty where the first is not less.
pub(super) fn in_box(
    o: DVec3,
    d: DVec3,
    [low, high]: [DVec3; 2],
    mut t0: f64,
    mut t1: f64,
) -> [f64; 2] {
    for a in 0..3 {
        if d[a] == 0.0 {
            if o[a] < low[a] || o[a] > high[a] {
                return [t1, t0.min(t1)];
            }
        } else {
            let (x, y) = ((low[a] - o[a]) / d[a], (high[a] - o[a]) / d[a]);
            (t0, t1) = (t0.max(x.min(y)), t1.min(x.max(y)));
        }
    }
    [t0, t1]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colormap::ColorMap;
    use crate::grid::Grid;
    use crate::ray::Ray;
    use crate::test_shapes::Random;
    use crate::transfer_function::TransferFunction;
    use crate::volume::{Volume, VolumeQuality, VolumeSample, integrate_overlapping};
    use glam::{UVec3, Vec3};
    use std::f64::consts::LN_2;

    /// One scalar everywhere: the opacity tells the length of a ray that is drawn.
    fn fog(options: VolumeOptions) -> Volume {
        let dims = UVec3::new(21, 17, 19);
        let values = vec![0.5; dims.as_usizevec3().element_product()];
        let grid = Grid::new(dims, DVec3::new(3.0, -2.0, 1.0), DVec3::splat(0.5), values);
        let white = ColorMap::new(vec![[1.0; 4]], [0.0, 1.0]);
        let thin = TransferFunction::new(white, vec![[0.0, 0.05]]).expect("sound");
        Volume::new(grid.expect("a grid").into(), thin, options).expect("sound")
    }

    fn random_rays(count: usize) -> Vec<Ray> {
        let mut rng = Random::new(5);
        (0..count)
            .map(|_| {
                let target =
                    Vec3::new(10.0, 8.0, 9.0) * Vec3::new(rng.unit(), rng.unit(), rng.unit());
                let from = target + 20.0 * rng.direction();
                Ray::new(from, 0.7 * (target - from))
            })
            .collect()
    }

    /// World length of the ray that is drawn, by many short pieces.
    fn length(ray: &Ray, keeps: impl Fn(DVec3) -> bool) -> f64 {
        let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
        let (steps, end) = (40_000, 4.0);
        let step = end / f64::from(steps);
        let size = DVec3::new(10.0, 8.0, 9.0);
        let inside = |p: DVec3| p.cmpge(DVec3::ZERO).all() && p.cmple(size).all();
        let count = (0..steps)
            .map(|k| o + d * (f64::from(k) + 0.5) * step)
            .filter(|p| inside(*p) && keeps(*p))
            .count();
        count as f64 * step * d.length()
    }

    fn drawn_length(sample: &VolumeSample) -> f64 {
        -f64::from(-sample.rgba[3]).ln_1p() / 0.05
    }

    fn options() -> Vec<VolumeOptions> {
        let slanted =
            ClipPlane { point: DVec3::new(4.0, 3.0, 5.0), normal: DVec3::new(1.0, -2.0, 0.4) };
        let other =
            ClipPlane { point: DVec3::new(4.0, 6.0, 5.0), normal: DVec3::new(0.0, 3.0, 0.0) };
        let planes = [DVec3::new(2.0, 3.0, 4.0), DVec3::new(7.0, 5.0, 8.0)];
        let cropping = |regions| Some(Cropping { planes, regions });
        let all = VolumeOptions::default();
        vec![
            VolumeOptions { bounds: Some([DVec3::ONE, DVec3::new(9.0, 7.5, 3.0)]), ..all.clone() },
            VolumeOptions { clip_planes: vec![slanted], ..all.clone() },
            VolumeOptions { clip_planes: vec![slanted, other], ..all.clone() },
            VolumeOptions { cropping: cropping(Cropping::BOX), ..all.clone() },
            // A fence, its inverse, a cross, one corner.
            VolumeOptions { cropping: cropping(0x2eb_feba), ..all.clone() },
            VolumeOptions { cropping: cropping(0x514_0145), ..all.clone() },
            VolumeOptions { cropping: cropping(0x041_7410), ..all.clone() },
            VolumeOptions { cropping: cropping(1 << 26), clip_planes: vec![slanted], ..all },
        ]
    }

    fn keeps(options: &VolumeOptions, p: DVec3) -> bool {
        let inside = |[low, high]: [DVec3; 2]| p.cmpge(low).all() && p.cmple(high).all();
        options.bounds.is_none_or(inside)
            && options.clip_planes.iter().all(|c| c.normal.dot(p - c.point) >= 0.0)
            && options.cropping.is_none_or(|c| c.contains(p))
    }

    #[test]
    fn a_ray_is_drawn_where_the_regions_are() {
        for options in options() {
            let volume = fog(options.clone());
            for ray in random_rays(60) {
                let wanted = length(&ray, |p| keeps(&options, p));
                let whole = volume.integrate(&ray, 0.0, f32::INFINITY, &VolumeQuality::default());
                let off = (drawn_length(&whole) - wanted).abs();
                assert!(off < 0.02, "{off} of {wanted}: {ray:?} {options:?}");
                // The same among other volumes, and in two parts.
                let clear = Ray { origin: ray.origin + 500.0, ..ray };
                let pair = [(&volume, ray), (&volume, clear)];
                let mixed =
                    integrate_overlapping(&pair, 0.0, f32::INFINITY, &VolumeQuality::default());
                assert!((drawn_length(&mixed) - wanted).abs() < 0.02, "{ray:?} {options:?}");
                let [a, b] = [(0.0, 1.4), (1.4, f32::INFINITY)].map(|(t0, t1)| {
                    drawn_length(&volume.integrate(&ray, t0, t1, &VolumeQuality::default()))
                });
                assert!((a + b - wanted).abs() < 0.02, "{ray:?} {options:?}");
            }
        }
    }

    #[test]
    fn samples_are_those_whose_positions_are_drawn() {
        let distance = 0.23;
        for options in options() {
            let options = VolumeOptions { sample_distance: Some(distance), ..options };
            let volume = fog(options.clone());
            for ray in random_rays(200) {
                let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
                let grid = [DVec3::ZERO, DVec3::new(10.0, 8.0, 9.0)];
                let [t0, t1] = in_box(o, d, grid, 0.0, 4.0);
                let [t0, t1] = options.in_bounds(o, d, t0, t1);
                let [near, behind] = options.in_front(o, d, t0, t1);
                let step = distance / d.length();
                let (mut wanted, mut close) = (0, 0);
                let mut k = 1.0;
                while near < behind && near + k * step <= t1 && near + (k - 1.0) * step < behind {
                    let at = o + d * (near + k * step);
                    wanted += u32::from(options.cropping.is_none_or(|c| c.contains(at)));
                    // A sample on a plane may count or not.
                    let moved = [-1e-5, 1e-5].map(|e| at + d * e);
                    close += u32::from(
                        options
                            .cropping
                            .is_some_and(|c| c.contains(moved[0]) != c.contains(moved[1])),
                    );
                    k += 1.0;
                }
                // The first one counts where it ends outside, and the last may be rounded.
                let got = volume.sample_ray(&ray, 0.0, f32::INFINITY).samples;
                assert!(got.abs_diff(wanted) <= 1 + close, "{got} {wanted} {ray:?} {options:?}");
            }
        }
    }

    #[test]
    fn cells_around_points_end_where_the_bounds_are() {
        let bounds = Some([DVec3::splat(0.25), DVec3::new(9.75, 7.75, 8.75)]);
        let nearest = super::super::Interpolation::Nearest;
        let options = VolumeOptions { bounds, interpolation: nearest, ..Default::default() };
        let volume = fog(options);
        let ray = Ray::new(Vec3::new(-2.0, 3.3, 4.4), Vec3::X);
        let got = volume.integrate(&ray, 0.0, f32::INFINITY, &VolumeQuality::default());
        assert!((drawn_length(&got) - 9.5).abs() < 1e-4, "{}", drawn_length(&got));
        let box_drawn = volume.bounds();
        assert!((box_drawn.max.x - 9.75).abs() < 1e-5 && (box_drawn.min.x - 0.25).abs() < 1e-5);
    }

    #[test]
    fn a_region_that_is_none_is_refused_by_name() {
        let try_with = |options: VolumeOptions| options.check_region().map_err(|e| e.to_string());
        let all = VolumeOptions::default();
        let planes = [DVec3::ONE, DVec3::ZERO];
        let refused = [
            (VolumeOptions { bounds: Some(planes), ..all.clone() }, "bounds"),
            (
                VolumeOptions {
                    clip_planes: vec![ClipPlane { point: DVec3::ONE, normal: DVec3::ZERO }],
                    ..all.clone()
                },
                "clip_planes",
            ),
            (
                VolumeOptions {
                    cropping: Some(Cropping { planes, regions: Cropping::BOX }),
                    ..all.clone()
                },
                "planes",
            ),
            (
                VolumeOptions {
                    cropping: Some(Cropping { planes: [DVec3::ZERO, DVec3::ONE], regions: 5 }),
                    blend: Blend::Maximum,
                    ..all
                },
                "one box",
            ),
        ];
        for (options, word) in refused {
            let fault = try_with(options).expect_err("refused");
            assert!(fault.contains(word), "{fault}");
        }
    }

    #[test]
    fn a_half_of_the_light_passes_half_of_a_box() {
        // 20 ln 2 units let half of the light through.
        let size = 20.0 * LN_2;
        let half = [DVec3::ZERO, DVec3::new(0.5 * size, 50.0, 50.0)];
        let whole = fog(VolumeOptions { bounds: Some(half), ..Default::default() });
        let ray = Ray::new(Vec3::new(-1.0, 4.0, 4.0), Vec3::X);
        let got = whole.integrate(&ray, 0.0, f32::INFINITY, &VolumeQuality::default());
        assert!((f64::from(got.rgba[3]) - (1.0 - 0.5f64.sqrt())).abs() < 1e-5, "{got:?}");
    }
}
