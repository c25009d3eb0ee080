//! Background-oriented schlieren: computes how the flow displaces a pattern that a camera sees
//! through it.
//!
//! Rays are traced from the camera through the flow to the background. The camera is far away, so
//! they form a parallel beam. The background is at `Optics::focus_m` behind the flow as the camera
//! sees it, and the camera is focused on it. A ray that leaves with the deflection ε at the depth z
//! hits it displaced by `ξ + ε (focus - z)`. The dots of the image seem to move the other way, as
//! the map's apparent displacement says. The paths must be traced against the light
//! ([`ReversedPaths`]).
//!
//! The pattern consists of random dots: one dot per cell of a square lattice, jittered by a hash of
//! the cell. It is the same at any resolution.

use super::Photon;
use crate::optics::{Optics, PlaneVector};
use crate::path::{Exit, LightPaths, PathQuantities, SkipReport, Start};
use crate::view::View;
use rt_core::math::mix64;

/// A dotted background seen through the flow.
#[derive(Debug, Clone, Copy)]
pub struct Bos {
    pub(super) optics: Optics,
    pub(crate) dots: Dots,
}

/// A background of random dots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dots {
    /// Diameter of a dot, in object space.
    pub diameter_m: f64,
    /// Mean distance between dots: the side of the lattice's cells.
    pub spacing_m: f64,
    /// Seed that selects the pattern.
    pub seed: u32,
}

impl Bos {
    /// The background is at `optics.focus_m` behind the middle of the flow, seen from the camera.
    pub fn new(optics: Optics, dots: Dots) -> Bos {
        Bos { optics, dots }
    }

    #[inline]
    pub(super) fn energy(&self, photon: &Photon<'_>) -> f32 {
        let at =
            [0, 1].map(|i| f64::from(photon.start.position_m[i]) + f64::from(photon.shift_m[i]));
        self.dots.brightness(at)
    }
}

impl Dots {
    /// Brightness at a point: 0 on a dot, 1 elsewhere.
    pub fn brightness(&self, at_m: [f64; 2]) -> f32 {
        let cell = at_m.map(|c| (c / self.spacing_m).floor());
        let radius2 = 0.25 * self.diameter_m * self.diameter_m;
        // A dot reaches at most into neighbouring cells, because its diameter is at most a cell.
        for dj in -1..=1 {
            for di in -1..=1 {
                let (i, j) = (cell[0] + f64::from(di), cell[1] + f64::from(dj));
                let [u, v] = self.dot_offset(i as i64, j as i64);
                let (dx, dy) =
                    (at_m[0] - (i + u) * self.spacing_m, at_m[1] - (j + v) * self.spacing_m);
                if dx * dx + dy * dy < radius2 {
                    return 0.0;
                }
            }
        }
        1.0
    }

    /// Position of the dot in its cell, 0..1 along each axis.
    fn dot_offset(&self, i: i64, j: i64) -> [f64; 2] {
        let word = (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
            ^ (j as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f).rotate_left(32)
            ^ u64::from(self.seed);
        let bits = mix64(mix64(word));
        [bits as u32, (bits >> 32) as u32].map(|b| f64::from(b) / 4_294_967_296.0)
    }
}

/// Paths traced against the light, in the frame of the image.
///
/// `paths` are traced along the reversed view ([`ReversedPaths::view`]), whose right is the image's
/// left; this type mirrors starts and exits. Light paths are reversible, so rays from the camera
/// follow the light that reaches it.
pub struct ReversedPaths<'a> {
    paths: Box<dyn LightPaths + 'a>,
    /// The frame of starts and exits. It is left-handed, because it is the image's frame with the
    /// light's direction reversed.
    view: View,
}

impl<'a> ReversedPaths<'a> {
    /// `paths` must have been made for [`ReversedPaths::view`] of the image's view.
    pub fn new(paths: Box<dyn LightPaths + 'a>) -> ReversedPaths<'a> {
        let inner = *paths.view();
        ReversedPaths { paths, view: View { right: -inner.right, ..inner } }
    }

    /// The view against the light: right and forward are negated, up is kept, and it stays
    /// right-handed.
    pub fn view(view: &View) -> View {
        View { right: -view.right, forward: -view.forward, ..*view }
    }

    /// The image's starts in the frame of [`ReversedPaths::view`].
    pub fn starts(starts: &[Start]) -> Vec<Start> {
        let mirror = |s: &Start| Start {
            position_m: mirrored(s.position_m),
            tilt_rad: mirrored(s.tilt_rad),
        };
        starts.iter().map(mirror).collect()
    }
}

fn mirrored([x, y]: PlaneVector) -> PlaneVector {
    [-x, y]
}

impl LightPaths for ReversedPaths<'_> {
    fn trace(&self, starts: &[Start], exits: &mut [Exit]) {
        self.paths.trace(&ReversedPaths::starts(starts), exits);
        for e in exits {
            e.deflection_rad = mirrored(e.deflection_rad);
            e.displacement_m = mirrored(e.displacement_m);
        }
    }

    fn view(&self) -> &View {
        &self.view
    }

    fn rays_at_once(&self) -> Option<usize> {
        self.paths.rays_at_once()
    }

    fn quantities(&self) -> PathQuantities {
        self.paths.quantities()
    }

    fn difference_step_m(&self) -> f64 {
        self.paths.difference_step_m()
    }

    fn device_warning(&self) -> Option<String> {
        self.paths.device_warning()
    }

    fn skip_report(&self) -> Option<SkipReport> {
        self.paths.skip_report()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Framing;
    use crate::technique::Technique;
    use crate::testing::{ClosedForm, expose_grey};

    const DOTS: Dots = Dots { diameter_m: 2e-3, spacing_m: 4e-3, seed: 1 };
    const FRAMING: Framing = Framing { width: 64, height: 48, pixel_m: 0.5e-3, center_m: [0.0; 2] };

    fn image(paths: &ClosedForm, distance_m: f64) -> Vec<f32> {
        let optics = Optics { focus_m: distance_m, ..Optics::DEFAULT };
        expose_grey(&Technique::Bos(Bos::new(optics, DOTS)), paths, FRAMING, 16)
    }

    #[test]
    fn a_prism_displaces_the_pattern_by_angle_times_distance() {
        let still = image(&ClosedForm::prism([0.0; 2]), 2.0);
        // 1 mm right and 0.5 mm up at 2 m: pixel (x, y) shows what pixel (x+2, y-1) shows without
        // flow.
        let moved = image(&ClosedForm::prism([5e-4, 2.5e-4]), 2.0);
        let same = |dx: usize, dy: usize| {
            (4..44).flat_map(|y| (4..60).map(move |x| (x, y))).fold(0.0f32, |sum, (x, y)| {
                sum + (moved[y * 64 + x] - still[(y - dy) * 64 + x + dx]).abs()
            }) / (40.0 * 56.0)
        };
        assert!(same(2, 1) < 0.03 && same(0, 0) > 0.2, "{} {}", same(2, 1), same(0, 0));
    }

    #[test]
    fn dots_cover_the_area_they_should() {
        // Because dots overlap, they cover a little less than the sum of their areas, π/16.
        let n = 400;
        let dark = (0..n * n).filter(|k| {
            DOTS.brightness([f64::from(k % n), f64::from(k / n)].map(|v| v * 2.1e-4)) == 0.0
        });
        let part = dark.count() as f64 / f64::from(n * n);
        assert!((0.17..0.197).contains(&part), "{part}");
    }

    #[test]
    fn against_the_light_left_is_right() {
        let v = View::along(crate::view::Axis::Z, glam::DVec3::ZERO);
        let r = ReversedPaths::view(&v);
        assert_eq!((r.right.cross(r.up), r.forward), (-v.forward, -v.forward));
        // A prism that deflects towards the reversed frame's right deflects to the image's left.
        let reversed = ReversedPaths::new(Box::new(ClosedForm::prism([1e-3, 2e-3])));
        let mut exit = [Exit::UNDISTURBED];
        reversed.trace(&[Start::default()], &mut exit);
        assert_eq!(exit[0].deflection_rad, [-1e-3, 2e-3]);
    }
}
