//! Sets the direction from which the test section is photographed.

use glam::DVec3;

/// An orthonormal, right-handed frame: `right x up = forward`.
///
/// `forward` is the direction in which the light travels, from the source towards the film. The
/// image is what a camera on the film's side sees when it looks at the test section, against the
/// light. `right` and `up` are right and up in the image, which is not mirrored. (Seen from the
/// light source, left and right would be exchanged.)
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Right in the image.
    pub right: DVec3,
    /// Up in the image.
    pub up: DVec3,
    /// The direction of the light.
    pub forward: DVec3,
    /// Centre of the image. Starts lie in the plane through it.
    pub centre_m: DVec3,
}

/// A view along a coordinate axis. The image's axes are the field's, increasing to the right and
/// upwards.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Axis {
    /// y to the right, z up; light travels along +x.
    X,
    /// x to the right, z up; light travels along -y.
    Y,
    /// x to the right, y up; light travels along +z.
    Z,
}

/// Why a direction of view does not define a frame.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// The light's direction is zero or not finite.
    #[error(
        "direction of light ({0}, {1}, {2}) is not a direction; give three finite numbers, not all \
         zero"
    )]
    Direction(f64, f64, f64),
    /// An angle is not finite, or the elevation is beyond the poles.
    #[error(
        "azimuth {azimuth_deg} and elevation {elevation_deg} degrees are not a view; elevations \
         are between -90 and 90"
    )]
    Angles {
        /// Azimuth given.
        azimuth_deg: f64,
        /// Elevation given.
        elevation_deg: f64,
    },
}

impl View {
    /// A view along a coordinate axis.
    pub fn along(axis: Axis, centre_m: DVec3) -> View {
        let (right, up) = match axis {
            Axis::X => (DVec3::Y, DVec3::Z),
            Axis::Y => (DVec3::X, DVec3::Z),
            Axis::Z => (DVec3::X, DVec3::Y),
        };
        View { right, up, forward: right.cross(up), centre_m }
    }

    /// A view with light along `forward`, rotated so that `up_hint` points up in the image. If
    /// `up_hint` is (nearly) parallel to the light, y is up.
    ///
    /// # Errors
    /// If `forward` is zero or not finite.
    pub fn new(forward: DVec3, up_hint: DVec3, centre_m: DVec3) -> Result<View, ViewError> {
        let wrong = ViewError::Direction(forward.x, forward.y, forward.z);
        // Dividing by the largest component first allows directions of any length, such as 1e-200
        // or 1e200.
        let largest = forward.abs().max_element();
        if !forward.is_finite() || largest == 0.0 {
            return Err(wrong);
        }
        let forward = (forward / largest).normalize();
        let up_hint = up_hint.try_normalize().unwrap_or(DVec3::Z);
        let mut right = up_hint.cross(forward);
        if right.length() < 1e-6 {
            right = DVec3::Y.cross(forward);
        }
        if right.length() < 1e-6 {
            right = DVec3::X;
        }
        let right = (right - forward * right.dot(forward)).normalize();
        Ok(View { right, up: forward.cross(right), forward, centre_m })
    }

    /// A view with light towards an azimuth (from +x towards +y) and an elevation (above the x-y
    /// plane), with z up in the image. (0, 0) is [`Axis::X`] and (-90, 0) is [`Axis::Y`]. At a pole
    /// the view is the limit for elevations approaching it: azimuth -90 and elevation 90 is
    /// [`Axis::Z`].
    ///
    /// # Errors
    /// If an angle is not finite or the elevation is beyond the poles.
    pub fn from_angles_deg(
        azimuth_deg: f64,
        elevation_deg: f64,
        centre_m: DVec3,
    ) -> Result<View, ViewError> {
        if !azimuth_deg.is_finite() || !(-90.0..=90.0).contains(&elevation_deg) {
            return Err(ViewError::Angles { azimuth_deg, elevation_deg });
        }
        let (sin_a, cos_a) = sin_cos_deg(azimuth_deg);
        let (sin_e, cos_e) = sin_cos_deg(elevation_deg);
        let forward = DVec3::new(cos_e * cos_a, cos_e * sin_a, sin_e);
        let right = DVec3::new(-sin_a, cos_a, 0.0);
        Ok(View { right, up: forward.cross(right), forward, centre_m })
    }

    /// The frame of a beam with the given slopes, as right, up and direction. It is the view's
    /// frame turned by the smallest rotation that takes `forward` to the beam.
    pub fn beam(&self, tilt_rad: [f32; 2]) -> [DVec3; 3] {
        if tilt_rad == [0.0; 2] {
            return [self.right, self.up, self.forward];
        }
        let slope = self.right * f64::from(tilt_rad[0]) + self.up * f64::from(tilt_rad[1]);
        let direction = (self.forward + slope).normalize();
        let turn = glam::DQuat::from_rotation_arc(self.forward, direction);
        let right = turn * self.right;
        let right = (right - direction * right.dot(direction)).normalize();
        [right, direction.cross(right), direction]
    }
}

/// Sine and cosine of degrees, exact at multiples of a right angle.
fn sin_cos_deg(deg: f64) -> (f64, f64) {
    let turned = deg.rem_euclid(360.0);
    let quarter = (turned / 90.0).floor();
    let (s, c) = (turned - 90.0 * quarter).to_radians().sin_cos();
    match quarter as i64 {
        1 => (c, -s),
        2 => (-s, -c),
        3 => (-c, s),
        _ => (s, c),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_frame(v: &View) {
        assert!((v.right.cross(v.up) - v.forward).length() < 1e-15, "{v:?}");
        for d in [v.right, v.up, v.forward] {
            assert!((d.length() - 1.0).abs() < 1e-15, "{v:?}");
        }
    }

    /// A camera on the film's side looks along -forward. An object on its right must be on the
    /// image's right.
    #[test]
    fn images_are_not_mirrored_seen_from_the_film() {
        for axis in [Axis::X, Axis::Y, Axis::Z] {
            let v = View::along(axis, DVec3::ZERO);
            assert_frame(&v);
            let looks = -v.forward;
            let right_hand = looks.cross(v.up);
            assert_eq!(right_hand, v.right);
        }
    }

    #[test]
    fn angles_and_axes_agree_without_rounding() {
        let at = DVec3::new(1.0, 2.0, 3.0);
        assert_eq!(View::from_angles_deg(0.0, 0.0, at).unwrap(), View::along(Axis::X, at));
        assert_eq!(View::from_angles_deg(-90.0, 0.0, at).unwrap(), View::along(Axis::Y, at));
        assert_eq!(View::from_angles_deg(-90.0, 90.0, at).unwrap(), View::along(Axis::Z, at));
        assert_eq!(View::new(DVec3::X * 1e-200, DVec3::Z, at).unwrap(), View::along(Axis::X, at));
    }

    #[test]
    fn any_direction_makes_a_frame() {
        for a in -12..12 {
            for e in -6..=6 {
                let v =
                    View::from_angles_deg(f64::from(a) * 17.0, f64::from(e) * 15.0, DVec3::ZERO)
                        .unwrap();
                assert_frame(&v);
                assert_frame(&View::new(v.forward * 7.0, DVec3::Z, DVec3::ZERO).unwrap());
                let [right, up, direction] = v.beam([1e-3, -2e-3]);
                assert_frame(&View { right, up, forward: direction, centre_m: DVec3::ZERO });
                assert!((direction.dot(v.right) - 1e-3).abs() < 1e-8);
            }
        }
        for bad in [DVec3::ZERO, DVec3::new(f64::NAN, 0.0, 1.0), DVec3::X * f64::INFINITY] {
            assert!(View::new(bad, DVec3::Z, DVec3::ZERO).is_err());
        }
        assert!(View::from_angles_deg(0.0, 91.0, DVec3::ZERO).is_err());
        assert!(View::from_angles_deg(f64::NAN, 0.0, DVec3::ZERO).is_err());
    }
}
