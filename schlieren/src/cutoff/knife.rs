//! The knife edge: Toepler's classic cut-off.
//!
//! With a slit parallel to the edge, the intensity is *linear and then clipped*. Of the height h of
//! the source image, the height a is open. A deflection ε along the knife's direction shifts the
//! image by f2 ε, so `I/I₀ = clamp((a + f2 ε)/h, 0, 1)`. Relative to the background a/h, the
//! contrast is `f2 ε/a` (Settles 2001, equation 3.7). The range before clipping is `-a/f2 …
//! (h-a)/f2`. Slits at other angles and round sources have closed forms of their own.

use crate::optics::{PlaneVector, SourceImage};

/// A straight knife edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knife {
    /// Direction in the image, counter-clockwise from its right, in which a deflection brightens.
    /// It points from the blade to the opening. 0 is a vertical knife, which shows horizontal
    /// gradients; 90 is a horizontal one.
    pub angle_deg: f64,
    /// Position of the edge.
    pub position: KnifePosition,
}

/// Position of the edge along the knife's direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum KnifePosition {
    /// a/h: the open fraction of the height of the undisturbed source image. 0.5 is the usual half
    /// cut-off.
    OpenFraction(f64),
    /// The open height a in metres. With a given height, the sensitivity depends on the focal
    /// length of the schlieren lens. With a fraction it does not, because the source image and its
    /// shift scale alike.
    OpenM(f64),
    /// Signed distance of the edge from the axis, in metres. Light beyond it passes.
    EdgeM(f64),
}

impl Knife {
    /// The unit vector that points from the blade to the opening.
    pub fn direction(&self) -> [f64; 2] {
        let (sin, cos) = self.angle_deg.to_radians().sin_cos();
        [cos, sin]
    }

    /// Signed distance of the edge from the axis, in metres.
    pub fn edge_m(&self, image: &SourceImage) -> f64 {
        match self.position {
            KnifePosition::OpenFraction(open) => {
                image.half_extent_m(self.direction()) * (1.0 - 2.0 * open)
            }
            KnifePosition::OpenM(height) => image.half_extent_m(self.direction()) - height,
            KnifePosition::EdgeM(edge) => edge,
        }
    }

    /// a: the open height of the undisturbed source image, in metres.
    pub fn open_height_m(&self, image: &SourceImage) -> f64 {
        let half = image.half_extent_m(self.direction());
        (half - self.edge_m(image)).clamp(0.0, 2.0 * half)
    }

    pub(super) fn edge(&self, image: &SourceImage) -> Edge {
        let direction = self.direction();
        let open = match *image {
            SourceImage::Point => Open::Step,
            SourceImage::Disc { radius_m } => Open::Disc { radius_m },
            SourceImage::Rectangle { .. } => {
                let [a, b] = image.projected_half_sides(direction);
                let (p, q) = (a.max(b), a.min(b));
                // Corners smaller than f32 rounding are ignored.
                if q <= 1e-7 * p {
                    Open::Linear { half_m: p as f32 }
                } else {
                    Open::Trapezoid { p, q }
                }
            }
        };
        Edge { direction: direction.map(|c| c as f32), edge_m: self.edge_m(image) as f32, open }
    }
}

/// A knife edge with a known source image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Edge {
    pub(crate) direction: [f32; 2],
    pub(crate) edge_m: f32,
    pub(crate) open: Open,
}

/// The open fraction of the source image, as a function of its centre's distance from the edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Open {
    /// A point: all or nothing.
    Step,
    /// A slit parallel to the edge.
    Linear { half_m: f32 },
    /// A rectangle: half-lengths of its sides projected onto the edge's normal, the longer first.
    Trapezoid { p: f64, q: f64 },
    /// A disc.
    Disc { radius_m: f64 },
}

impl Edge {
    /// Transmission at one point: 1 beyond the edge, and 1/2 on it, so that a point source with the
    /// edge on the axis has a defined background.
    #[inline]
    pub(super) fn transmission(&self, at_m: PlaneVector) -> f32 {
        let d = self.signed_distance(at_m);
        if d == 0.0 { 0.5 } else { f32::from(d > 0.0) }
    }

    /// The open fraction of the source image's area.
    #[inline]
    pub(super) fn averaged(&self, shift_m: PlaneVector) -> f32 {
        match self.open {
            Open::Step => self.transmission(shift_m),
            Open::Linear { half_m } => {
                (0.5 + 0.5 * self.signed_distance(shift_m) / half_m).clamp(0.0, 1.0)
            }
            Open::Trapezoid { p, q } => {
                open_rectangle(p, q, f64::from(self.signed_distance(shift_m))) as f32
            }
            Open::Disc { radius_m } => {
                open_disc(radius_m, f64::from(self.signed_distance(shift_m))) as f32
            }
        }
    }

    #[inline]
    fn signed_distance(&self, p: PlaneVector) -> f32 {
        self.direction[0] * p[0] + self.direction[1] * p[1] - self.edge_m
    }
}

/// Fraction of a rectangle on the positive side of a line at distance -t from its centre. The
/// rectangle's sides, projected onto the line's normal, have half-lengths p and q ≤ p. Its area
/// density along the normal is the convolution of two boxes, a trapezoid. The result is the
/// integral of that density.
fn open_rectangle(p: f64, q: f64, t: f64) -> f64 {
    let t = t.clamp(-p - q, p + q);
    let (outer, inner) = (p + q, p - q);
    if t.abs() <= inner {
        return 0.5 + 0.5 * t / p;
    }
    // The line cuts off a corner: a triangle, which is either missing or the only part.
    let corner = (outer - t.abs()).powi(2) / (8.0 * p * q);
    if t > 0.0 { 1.0 - corner } else { corner }
}

/// Fraction of a disc beyond a line at distance -t from its centre: a circular segment.
fn open_disc(radius: f64, t: f64) -> f64 {
    let x = (t / radius).clamp(-1.0, 1.0);
    0.5 + (x * (1.0 - x * x).sqrt() + x.asin()) / std::f64::consts::PI
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intensity_is_linear_then_clipped_as_in_settles() {
        // f2 = 1.5 m, image 1 mm high, 40 % open: a = 0.4 mm, k = f2/a = 3750 per radian.
        let image = SourceImage::Rectangle { half_m: [0.5e-3, 2.5e-3], axis: [1.0, 0.0] };
        let knife = Knife { angle_deg: 0.0, position: KnifePosition::OpenFraction(0.4) };
        assert!((knife.open_height_m(&image) - 0.4e-3).abs() < 1e-15);
        let intensity = |e: f64| knife.edge(&image).averaged([(1.5 * e) as f32, 7e-4]);
        assert!((intensity(0.0) - 0.4).abs() < 1e-7);
        let contrast = intensity(1e-5) / intensity(0.0) - 1.0;
        assert!((contrast - 3750.0 * 1e-5).abs() < 1e-6, "{contrast}");
        // The range is -a/f2 = -2.667e-4 to (h-a)/f2 = 4e-4.
        assert!(intensity(-2.6e-4) > 0.0 && intensity(-2.7e-4) == 0.0);
        assert!(intensity(3.9e-4) < 1.0 && intensity(4.1e-4) == 1.0);
    }

    #[test]
    fn a_knife_turned_by_90_degrees_sees_the_other_component_only() {
        let image = SourceImage::Disc { radius_m: 1e-3 };
        let knife = Knife { angle_deg: 90.0, position: KnifePosition::OpenFraction(0.5) };
        let at = |x, y| knife.edge(&image).averaged([x, y]);
        assert_eq!(at(0.0, 1e-4), at(5e-4, 1e-4));
        assert!(at(0.0, 1e-4) > 0.5 && at(0.0, -1e-4) < 0.5);
    }

    #[test]
    fn sensitivity_is_f2_over_a_and_f2_cancels_from_fractions() {
        use crate::optics::{Optics, SourceShape};
        let slope = |f2: f64, position| {
            let source = SourceShape::Slit { width_m: 1e-3, length_m: 5e-3, angle_deg: 0.0 };
            let optics = Optics { source, schlieren_focal_length_m: f2, ..Optics::DEFAULT };
            let image = optics.source_image();
            let knife = Knife { angle_deg: 0.0, position };
            let at = |e: f64| f64::from(knife.edge(&image).averaged([(f2 * e) as f32, 0.0]));
            let contrast = (at(1e-5) - at(0.0)) / at(0.0) / 1e-5;
            let expected = optics.sensitivity_per_rad(knife.open_height_m(&image));
            assert!((contrast / expected - 1.0).abs() < 1e-3, "{contrast} {expected}");
            contrast
        };
        // With a = 0.5 mm: 3000 and 6000 per radian. With half open: 3000 for any f2.
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-3;
        assert!(near(slope(1.5, KnifePosition::OpenM(0.5e-3)), 3000.0));
        assert!(near(slope(3.0, KnifePosition::OpenM(0.5e-3)), 6000.0));
        assert!(near(slope(3.0, KnifePosition::OpenFraction(0.5)), 3000.0));
    }

    #[test]
    fn point_source_on_the_edge_is_half_lit() {
        let knife = Knife { angle_deg: 0.0, position: KnifePosition::EdgeM(0.0) };
        assert_eq!(
            [-1e-9, 0.0, 1e-9].map(|x| knife.edge(&SourceImage::Point).transmission([x, 0.0])),
            [0.0, 0.5, 1.0]
        );
    }
}
