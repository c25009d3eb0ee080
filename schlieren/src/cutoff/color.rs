//! The colour filter: hue shows the direction of a deflection, saturation its size.
//!
//! Equation 5.16 of the dissertation takes the hue from the cosine between the deflected and the
//! undeflected direction. In f32 that cosine is exactly 1 for every deflection below 2.44e-4 rad,
//! so most flows would have a single hue. Here the hue is `atan2(y, x)` of the position in the
//! cut-off plane, as on a real filter.

use super::Rgb;
use crate::optics::PlaneVector;

/// A colour wheel: white on the axis, saturated from `radius_m` outwards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColorWheel {
    /// Distance from the axis, in metres, at which colours are fully saturated.
    pub radius_m: f64,
    /// Direction of red, counter-clockwise from the image's right. Green and blue follow at 120
    /// degrees each.
    pub red_deg: f64,
}

impl ColorWheel {
    /// Transmission at a point: hue by angle, saturation by distance. The strongest channel is
    /// always 1, because a filter cannot add light.
    #[inline]
    pub(super) fn transmission(&self, [x, y]: PlaneVector) -> Rgb {
        let saturation = (f64::from(x).hypot(f64::from(y)) / self.radius_m).min(1.0) as f32;
        let turn = (f64::from(y).atan2(f64::from(x)).to_degrees() - self.red_deg) / 60.0;
        let pure = hue(turn.rem_euclid(6.0) as f32);
        pure.map(|c| 1.0 + saturation * (c - 1.0))
    }
}

/// The saturated colour at `h` sixths of a turn: 0 red, 2 green, 4 blue.
fn hue(h: f32) -> Rgb {
    let peak = |center: f32| {
        // Distance on the circle of 6; a plateau of ±1, ramps of 1.
        let d = (h - center).abs();
        (2.0 - d.min(6.0 - d)).clamp(0.0, 1.0)
    };
    [peak(0.0), peak(2.0), peak(4.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHEEL: ColorWheel = ColorWheel { radius_m: 1e-3, red_deg: 0.0 };

    #[test]
    fn tiny_deflections_have_the_hue_of_their_direction() {
        // 1e-7 rad at f2 = 1 m, where the cosine of equation 5.16 is exactly 1.
        for (degrees, strongest) in [(0.0f32, 0), (120.0, 1), (240.0, 2), (355.0, 0), (-120.0, 2)] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let c = WHEEL.transmission([1e-7 * cos, 1e-7 * sin]);
            let others = [0, 1, 2].into_iter().filter(|&i| i != strongest);
            assert!(others.into_iter().all(|i| c[i] < c[strongest]), "{degrees}: {c:?}");
        }
    }

    #[test]
    fn white_on_the_axis_saturated_at_the_rim() {
        assert_eq!(WHEEL.transmission([0.0, 0.0]), [1.0; 3]);
        assert_eq!(WHEEL.transmission([1.0, 0.0]), [1.0, 0.0, 0.0]);
        assert_eq!(WHEEL.transmission([-1.0, 0.0]), [0.0, 1.0, 1.0], "cyan lies opposite");
        let half = WHEEL.transmission([0.5e-3, 0.0]);
        assert!((half[0] - 1.0).abs() < 1e-6 && (half[1] - 0.5).abs() < 1e-6);
    }
}
