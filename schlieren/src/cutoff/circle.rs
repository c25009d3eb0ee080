//! Circular cut-offs: an iris and its complement, an opaque spot.
//!
//! An iris passes weakly deflected light: in this bright field, deflections darken. An opaque spot
//! passes strongly deflected light: in this dark field, deflections in any direction brighten. The
//! dissertation calls them "circular" and "complemented circular" (section 5.3.4).

use crate::optics::{PlaneVector, SourceImage};

/// A circle in the cut-off plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aperture {
    /// Radius in metres.
    pub radius_m: f64,
    /// Centre relative to the axis, in metres.
    pub center_m: [f64; 2],
    /// The open side.
    pub passes: Passes,
}

/// The open side of a circle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Passes {
    /// The inside: an iris.
    Inside,
    /// The outside: an opaque spot.
    Outside,
}

impl Passes {
    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Passes::Inside => "circle",
            Passes::Outside => "complemented-circle",
        }
    }

    fn of(self, inside: f64) -> f32 {
        match self {
            Passes::Inside => inside as f32,
            Passes::Outside => (1.0 - inside) as f32,
        }
    }
}

impl Aperture {
    /// Transmission at one point. The rim belongs to the inside.
    #[inline]
    pub(super) fn transmission(&self, at_m: PlaneVector) -> f32 {
        self.passes.of(f64::from(self.distance(at_m) <= self.radius_m))
    }

    /// The open fraction of a disc's area. Rectangles have to be sampled.
    #[inline]
    pub(super) fn averaged(&self, image: &SourceImage, shift_m: PlaneVector) -> Option<f32> {
        let SourceImage::Disc { radius_m } = *image else { return None };
        let common = common_area(self.radius_m, radius_m, self.distance(shift_m));
        Some(self.passes.of(common / (std::f64::consts::PI * radius_m * radius_m)))
    }

    fn distance(&self, p: PlaneVector) -> f64 {
        (f64::from(p[0]) - self.center_m[0]).hypot(f64::from(p[1]) - self.center_m[1])
    }
}

/// Area common to two discs of radii r and s with centres d apart: the sum of two circular
/// segments.
fn common_area(r: f64, s: f64, d: f64) -> f64 {
    if d >= r + s {
        return 0.0;
    }
    let small = r.min(s);
    if d <= (r - s).abs() {
        return std::f64::consts::PI * small * small;
    }
    // On either side of the common chord, the segment is a sector minus a triangle.
    let segment = |r: f64, to_chord: f64| {
        let x = (to_chord / r).clamp(-1.0, 1.0);
        r * r * (x.acos() - x * (1.0 - x * x).sqrt())
    };
    let chord = (d * d + r * r - s * s) / (2.0 * d);
    segment(r, chord) + segment(s, d - chord)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn circle_and_complement_add_up_to_all_light() {
        let image = SourceImage::Disc { radius_m: 1e-3 };
        for shift in [[0.0, 0.0], [5e-4, 5e-4], [1.5e-3, 0.0], [1.0, 1.0]] {
            let both = [Passes::Inside, Passes::Outside].map(|passes| {
                let a = Aperture { radius_m: 0.7e-3, center_m: [0.0; 2], passes };
                a.averaged(&image, shift).unwrap()
            });
            assert!((both[0] + both[1] - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn equal_circles_half_a_radius_apart_share_the_known_lens() {
        // 2 r² acos(d/2r) - d/2 sqrt(4r² - d²)
        let exact = 2.0 * 0.25f64.acos() - 0.25 * (4.0f64 - 0.25).sqrt();
        assert!((common_area(1.0, 1.0, 0.5) - exact).abs() < 1e-14);
        assert_eq!(common_area(2.0, 1.0, 0.5), std::f64::consts::PI);
        assert_eq!(common_area(1.0, 1.0, 2.0), 0.0);
    }

    #[test]
    fn dark_field_is_dark_where_nothing_is_deflected() {
        let image = SourceImage::Disc { radius_m: 0.5e-3 };
        let spot = Aperture { radius_m: 0.5e-3, center_m: [0.0; 2], passes: Passes::Outside };
        assert!(spot.averaged(&image, [0.0, 0.0]).unwrap().abs() < 1e-6);
        let up = spot.averaged(&image, [0.0, 2e-4]).unwrap();
        let left = spot.averaged(&image, [-2e-4, 0.0]).unwrap();
        assert!(up > 0.1 && (up - left).abs() < 1e-6, "every direction brightens alike");
    }
}
