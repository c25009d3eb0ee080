//! Describes the optical bench: light source, collimator, test section, schlieren lens, cut-off
//! plane and film lens.
//!
//! ```text
//!  source      collimator     test section      schlieren lens     cut-off plane      film
//!    |  <-- f1 -->  (   ||||||||  flow  ||||||||   )  <--- f2 --->  |                  |
//!    size w                  z = 0                                 image w f2/f1      focused on z = focus_m
//! ```
//!
//! A point of the source makes one parallel beam. Its *tilt* is the point's distance from the axis
//! divided by the collimator's focal length. The schlieren lens focuses every direction into one
//! point of the cut-off plane, at `f2 (tilt + deflection)`. A deflection ε therefore shifts the
//! whole image of the source by `f2 ε` (Settles, *Schlieren and Shadowgraph Techniques*, 2001,
//! chapter 3). The factor k of the dissertation's equation 5.12 is not a free parameter: it is
//! [`Optics::sensitivity_per_rad`], `f2/a`, with a the height of the source image above the
//! cut-off.
//!
//! The film is focused on the plane z = `focus_m`, measured along the direction of light from the
//! centre of the field. It records each ray where the ray's last straight segment, extended in both
//! directions, crosses that plane. Focused on the centre, the displacement is nearly zero and the
//! result is a schlieren image. Focused elsewhere, the image is a shadowgraph as well. All film
//! coordinates are in object space: metres in the test section.

use crate::path::{Exit, Start};

/// A point or vector in a plane perpendicular to the light: components along `right` and `up`.
pub type PlaneVector = [f32; 2];

/// The shape of the light source in the collimator's focal plane.
///
/// Coordinates are those of the source's image in the cut-off plane: a point of the source at +x
/// makes the beam that travels towards +x.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SourceShape {
    /// A point without extent.
    Point,
    /// A rectangle, usually a slit. Its width lies along `angle_deg`, counter-clockwise from the
    /// image's right.
    Slit {
        /// Width along `angle_deg`; this is across the knife's edge when the knife has the same
        /// angle.
        width_m: f64,
        /// Length across the width; along the knife's edge when the knife has the same angle.
        length_m: f64,
        /// Direction of the width.
        angle_deg: f64,
    },
    /// A disc: a lamp behind a pinhole.
    Circle {
        /// Diameter of the pinhole.
        diameter_m: f64,
    },
}

/// The dimensions of the bench, in metres. The [module](self) explains the symbols.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Optics {
    /// Shape and size of the source.
    pub source: SourceShape,
    /// f1: distance from the source to the collimating lens.
    pub collimator_focal_length_m: f64,
    /// f2: distance from the schlieren lens to the cut-off plane.
    pub schlieren_focal_length_m: f64,
    /// The plane in focus, as its distance from the centre of the field along the light. Positive
    /// is behind the flow, on the film's side.
    pub focus_m: f64,
}

/// The undisturbed image of the source in the cut-off plane, centred on the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SourceImage {
    /// All light falls on one point.
    Point,
    /// A rectangle with sides along `axis` and across it.
    Rectangle {
        /// Half the side lengths in metres.
        half_m: [f64; 2],
        /// Unit vector of the first side.
        axis: [f64; 2],
    },
    /// A disc.
    Disc {
        /// Radius in metres.
        radius_m: f64,
    },
}

impl Optics {
    /// The default bench: a slit of 1 mm by 5 mm, mirrors of 1.5 m focal length, focused on the
    /// centre of the field.
    pub const DEFAULT: Optics = Optics {
        source: SourceShape::Slit { width_m: 1e-3, length_m: 5e-3, angle_deg: 0.0 },
        collimator_focal_length_m: 1.5,
        schlieren_focal_length_m: 1.5,
        focus_m: 0.0,
    };

    /// The undisturbed image of the source, magnified by f2/f1.
    pub fn source_image(&self) -> SourceImage {
        let magnification = self.schlieren_focal_length_m / self.collimator_focal_length_m;
        match self.source {
            SourceShape::Point => SourceImage::Point,
            SourceShape::Slit { width_m, length_m, angle_deg } => {
                let (sin, cos) = angle_deg.to_radians().sin_cos();
                SourceImage::Rectangle {
                    half_m: [width_m, length_m].map(|side| 0.5 * side * magnification),
                    axis: [cos, sin],
                }
            }
            SourceShape::Circle { diameter_m } => {
                SourceImage::Disc { radius_m: 0.5 * diameter_m * magnification }
            }
        }
    }

    /// Change of relative intensity per radian of deflection across a knife: k = f2/a of equation
    /// 5.12, with `a` the height of the source image that the knife leaves open. The dissertation
    /// divides by e there; Settles' equation 3.7 divides by a.
    pub fn sensitivity_per_rad(&self, open_height_m: f64) -> f64 {
        self.schlieren_focal_length_m / open_height_m
    }

    /// The direction of the beam from a point of the source image.
    pub fn tilt_rad(&self, image_point_m: PlaneVector) -> PlaneVector {
        image_point_m.map(|c| (f64::from(c) / self.schlieren_focal_length_m) as f32)
    }

    /// The point where a photon crosses the cut-off plane: the image of its source point, shifted
    /// by its deflection.
    #[inline]
    pub fn cutoff_point_m(&self, image_point_m: PlaneVector, exit: &Exit) -> PlaneVector {
        let f2 = self.schlieren_focal_length_m as f32;
        [0, 1].map(|i| f2 * exit.deflection_rad[i] + image_point_m[i])
    }

    /// Distance in the plane of focus, in metres, between a photon's start and the point where the
    /// film records it.
    ///
    /// At depth `exit_depth`, the last straight segment is `displacement` away from the undisturbed
    /// ray, at the angle `deflection` to it. Extending it to the plane of focus adds the distance
    /// to that plane times the tangent of the angle. The undisturbed ray of a tilted beam crosses
    /// the plane of focus at `tilt focus` from the start.
    #[inline]
    pub fn film_shift_m(&self, start: &Start, exit: &Exit) -> PlaneVector {
        let focus = self.focus_m as f32;
        let lever = focus - exit.exit_depth_m;
        let [dx, dy] = exit.deflection_rad;
        // Deflections are sines (see `Exit`).
        let per_cos = 1.0 / (1.0 - (dx * dx + dy * dy)).max(f32::MIN_POSITIVE).sqrt();
        [0, 1].map(|i| {
            start.tilt_rad[i] * focus
                + (exit.displacement_m[i] + exit.deflection_rad[i] * per_cos * lever)
        })
    }

    /// Optical path difference on the film, between this ray and the undisturbed ray *of the same
    /// beam that ends in the same point of the film*. `n0` is the reference index.
    ///
    /// The undisturbed wave front is a plane across the beam, so the ray's end point within that
    /// plane does not matter. The straight segment from the exit to the plane of focus is longer by
    /// the factor `sec θ - 1 = s²/(c (1 + c))`, with s and c the sine and cosine of the deflection.
    #[inline]
    pub fn film_path_difference_m(&self, exit: &Exit, n0: f32) -> f32 {
        let lever = self.focus_m as f32 - exit.exit_depth_m;
        let [dx, dy] = exit.deflection_rad;
        let sin2 = dx * dx + dy * dy;
        let cos = (1.0 - sin2).max(f32::MIN_POSITIVE).sqrt();
        exit.opd_m + n0 * lever * sin2 / (cos * (1.0 + cos))
    }
}

impl SourceImage {
    /// Maps the unit square to the source image, uniformly by area.
    #[inline]
    pub fn point_m(&self, square: PlaneVector) -> PlaneVector {
        match *self {
            SourceImage::Point => [0.0, 0.0],
            SourceImage::Rectangle { half_m, axis } => {
                let [a, b] = [0, 1].map(|i| (2.0 * f64::from(square[i]) - 1.0) * half_m[i]);
                [(a * axis[0] - b * axis[1]) as f32, (a * axis[1] + b * axis[0]) as f32]
            }
            SourceImage::Disc { radius_m } => {
                rt_core::sampler::unit_disk(square).map(|c| (f64::from(c) * radius_m) as f32)
            }
        }
    }

    /// Half the extent of the source image along a unit direction.
    pub fn half_extent_m(&self, direction: [f64; 2]) -> f64 {
        match *self {
            SourceImage::Point => 0.0,
            SourceImage::Rectangle { .. } => self.projected_half_sides(direction).iter().sum(),
            SourceImage::Disc { radius_m } => radius_m,
        }
    }

    /// Half the lengths of a rectangle's two sides, projected onto a direction; zero for other
    /// shapes.
    pub(crate) fn projected_half_sides(&self, direction: [f64; 2]) -> [f64; 2] {
        let SourceImage::Rectangle { half_m, axis } = *self else { return [0.0; 2] };
        let along = (axis[0] * direction[0] + axis[1] * direction[1]).abs();
        let across = (axis[0] * direction[1] - axis[1] * direction[0]).abs();
        // In floating point, cos 90° is not exactly 0. A side perpendicular to the direction must
        // project to exactly zero.
        let clean = |v: f64| if v < 1e-12 { 0.0 } else { v };
        [half_m[0] * clean(along), half_m[1] * clean(across)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::Status;

    fn exit(
        deflection_rad: PlaneVector,
        displacement_m: PlaneVector,
        exit_depth_m: f32,
        opd_m: f32,
    ) -> Exit {
        Exit {
            deflection_rad,
            displacement_m,
            exit_depth_m,
            opd_m,
            transmission: 1.0,
            status: Status::Free,
        }
    }

    fn bench(focus_m: f64) -> Optics {
        Optics { focus_m, ..Optics::DEFAULT }
    }

    #[test]
    fn a_prism_focused_into_its_middle_moves_nothing() {
        // The ray bends at depth 0 and leaves at depth 0.5. It is displaced by 0.5 θ there, but its
        // extension passes through the start.
        let e = exit([1e-3, -2e-3], [0.5e-3, -1e-3], 0.5, 0.0);
        let s = Start { position_m: [0.1, 0.2], tilt_rad: [0.0; 2] };
        let at = |focus| bench(focus).film_shift_m(&s, &e);
        // The tangent differs from the sine by 0.5 θ³/2.
        assert!(at(0.0)[0].abs() < 2e-9 && at(0.0)[1].abs() < 4e-9, "{:?}", at(0.0));
        // In focus 2 m behind the flow, the ray has moved by 2 θ.
        assert!((at(2.0)[0] - 0.002).abs() < 1e-8 && (at(2.0)[1] + 0.004).abs() < 2e-8);
    }

    #[test]
    fn tilted_beams_meet_in_focus_and_part_behind_it() {
        let e = exit([0.0; 2], [0.0; 2], 0.5, 0.0);
        let s = Start { position_m: [0.1, 0.0], tilt_rad: [1e-3, 0.0] };
        assert_eq!(bench(0.0).film_shift_m(&s, &e), [0.0, 0.0]);
        assert!((bench(1.0).film_shift_m(&s, &e)[0] - 0.001).abs() < 1e-9);
    }

    #[test]
    fn deflection_shifts_the_source_image_by_f2_times_it() {
        let b = Optics { schlieren_focal_length_m: 2.0, ..bench(0.0) };
        let c = b.cutoff_point_m([1e-3, 0.0], &exit([1e-4, -3e-4], [0.0; 2], 0.0, 0.0));
        assert!((c[0] - 1.2e-3).abs() < 1e-9 && (c[1] + 6e-4).abs() < 1e-9);
        // The lens maps the tilt of an image point back to that point.
        let back = b.tilt_rad([1e-3, 2e-3]).map(|t| t * 2.0);
        assert!((back[0] - 1e-3).abs() < 1e-9 && (back[1] - 2e-3).abs() < 1e-9);
    }

    #[test]
    fn path_beyond_the_flow_is_that_of_a_triangle() {
        // θ = 1e-2 over 3 m adds 3 (sec θ - 1).
        let b = bench(3.0);
        let got = b.film_path_difference_m(&exit([1e-2f32.sin(), 0.0], [0.0; 2], 0.0, 2e-6), 1.0);
        let exact = 2e-6 + 3.0 * (1.0 / 1e-2f64.cos() - 1.0);
        assert!((f64::from(got) - exact).abs() < 1e-4 * exact, "{got} {exact}");
    }

    #[test]
    fn source_images_are_magnified_turned_and_filled_evenly() {
        let o = Optics {
            source: SourceShape::Slit { width_m: 1e-3, length_m: 4e-3, angle_deg: 90.0 },
            schlieren_focal_length_m: 3.0,
            ..Optics::DEFAULT
        };
        let image = o.source_image();
        assert!((image.half_extent_m([0.0, 1.0]) - 1e-3).abs() < 1e-12);
        assert!((image.half_extent_m([1.0, 0.0]) - 4e-3).abs() < 1e-12);
        let corner = image.point_m([1.0, 1.0]);
        assert!((corner[0] + 4e-3).abs() < 1e-8 && (corner[1] - 1e-3).abs() < 1e-8, "{corner:?}");
        let disc = Optics { source: SourceShape::Circle { diameter_m: 2e-3 }, ..o }.source_image();
        let n = 4096;
        let inside = (0..n)
            .map(|i| rt_core::sampler::Sampler::new(Default::default(), 0, 0, 0, i).square(0))
            .map(|p| disc.point_m(p))
            .filter(|p| p[0].hypot(p[1]) < 1e-3)
            .count();
        // The inner half of the 2 mm radius has a quarter of the area.
        assert!((inside as f64 / f64::from(n) - 0.25).abs() < 0.01, "{inside}");
    }
}
