//! Stand-off and shape of the detached shock in front of a blunt body: Billig's correlations of
//! experiments.
//!
//! F. S. Billig, "Shock-wave shapes around spherical- and cylindrical-nosed bodies", J. Spacecraft
//! and Rockets 4(6), 1967, pages 822-823. The correlations hold to a few percent from about Mach 2
//! upwards in air.

use super::theta_beta_m::mach_angle_rad;
use super::{GasError, check_supersonic};

/// Shape of the nose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Nose {
    /// Sphere: axisymmetric flow.
    Sphere,
    /// Cylinder across the stream: plane flow.
    Cylinder,
}

/// A bow shock: a hyperbola with its vertex upstream of the nose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BowShock {
    /// Radius of the nose, m.
    pub nose_radius_m: f64,
    /// Distance between vertex and nose, m.
    pub stand_off_m: f64,
    /// Radius of curvature at the vertex, m.
    pub vertex_radius_m: f64,
    /// Angle far away: the Mach angle, or the shock angle of the cone (wedge) behind the nose.
    pub far_angle_rad: f64,
}

impl BowShock {
    /// The shock of a nose followed by an afterbody. `far_angle_rad` is the angle of the
    /// afterbody's own attached shock, or `None` for a parallel afterbody, whose shock decays to a
    /// Mach wave.
    pub fn billig(
        nose: Nose,
        mach: f64,
        nose_radius_m: f64,
        far_angle_rad: Option<f64>,
    ) -> Result<Self, GasError> {
        check_supersonic(super::GAMMA_AIR, mach)?;
        let (stand_off, vertex) = match nose {
            Nose::Sphere => (
                0.143 * (3.24 / (mach * mach)).exp(),
                1.143 * (0.54 / (mach - 1.0).powf(1.2)).exp(),
            ),
            Nose::Cylinder => (
                0.386 * (4.67 / (mach * mach)).exp(),
                1.386 * (1.8 / (mach - 1.0).powf(0.75)).exp(),
            ),
        };
        let mach_angle = mach_angle_rad(mach);
        let far = far_angle_rad.unwrap_or(mach_angle);
        if !(mach_angle..std::f64::consts::FRAC_PI_2).contains(&far) {
            return Err(GasError::Angle {
                what: "the shock's angle far from the nose",
                given_degrees: far.to_degrees(),
                least_degrees: mach_angle.to_degrees(),
                most_degrees: 90.0,
            });
        }
        Ok(BowShock {
            nose_radius_m,
            stand_off_m: stand_off * nose_radius_m,
            vertex_radius_m: vertex * nose_radius_m,
            far_angle_rad: far,
        })
    }

    /// Position of the shock along the stream at distance `r` from the axis, measured from the
    /// foremost point of the nose, positive downstream (Billig's equation with x reversed and
    /// shifted).
    pub fn x_m(&self, r_m: f64) -> f64 {
        let t = self.far_angle_rad.tan();
        let s = r_m * t / self.vertex_radius_m;
        // sqrt(1+s²) - 1 without cancellation near the axis.
        -self.stand_off_m + self.vertex_radius_m / (t * t) * (s * s / (1.0 + (1.0 + s * s).sqrt()))
    }

    /// Angle between stream and shock at distance `r` from the axis: 90 degrees on the axis.
    pub fn angle_rad(&self, r_m: f64) -> f64 {
        let t = self.far_angle_rad.tan();
        let s = r_m * t / self.vertex_radius_m;
        // dx/dr = r / (Rc sqrt(1+s²)).
        (self.vertex_radius_m * (1.0 + s * s).sqrt()).atan2(r_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stand_off_of_the_blunt_fin() {
        // Mach 2.95 past a cylinder: 0.660 radii.
        let shock = BowShock::billig(Nose::Cylinder, 2.95, 2.0, None).unwrap();
        assert!((shock.stand_off_m / 2.0 - 0.660).abs() < 5e-4);
        let far_away = BowShock::billig(Nose::Sphere, 1e6, 1.0, None).unwrap();
        assert!(
            (far_away.stand_off_m - 0.143).abs() < 1e-9
                && (far_away.vertex_radius_m - 1.143).abs() < 1e-6
        );
    }

    #[test]
    fn vertex_and_far_angle_and_slope_fit_the_curve() {
        let shock = BowShock::billig(Nose::Sphere, 6.0, 0.5, Some(0.4)).unwrap();
        assert_eq!(shock.x_m(0.0), -shock.stand_off_m);
        let h = 1e-4;
        let curvature = 2.0 * (shock.x_m(h) - shock.x_m(0.0)) / (h * h);
        assert!((curvature * shock.vertex_radius_m - 1.0).abs() < 1e-6);
        for r in [0.2, 1.0, 30.0] {
            let slope = (shock.x_m(r + h) - shock.x_m(r - h)) / (2.0 * h);
            assert!((1.0 / slope - shock.angle_rad(r).tan()).abs() < 1e-5, "{r}");
        }
        assert!((shock.angle_rad(1e6) - 0.4).abs() < 1e-6);
        assert!(
            BowShock::billig(Nose::Sphere, 6.0, 0.5, Some(0.1)).is_err(),
            "below the Mach angle"
        );
    }
}
