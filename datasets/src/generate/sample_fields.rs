//! Refractive index fields with closed-form ray paths, sampled at points: test objects for ray
//! tracers.

use super::flow::{Flow, FlowError, names};
use glam::{DVec3, UVec3};

/// The fields. Positions are in metres; the origin is the centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SampleField {
    /// n = 1 + A exp(-r²/(2σ²)).
    Gaussian {
        /// Amplitude A.
        amplitude: f64,
        /// Width σ.
        sigma_m: f64,
    },
    /// Luneburg's lens: n² = 2 - r² within the unit ball, 1 outside. Parallel rays meet at its far
    /// side.
    Luneburg,
    /// Maxwell's fish-eye: n = n0 / (1 + r²/a²). Rays are circles.
    Maxwell {
        /// Index n0 at the centre.
        n0: f64,
        /// Radius a.
        radius_m: f64,
    },
}

impl SampleField {
    /// The refractive index at a point.
    pub fn index(&self, p: DVec3) -> f64 {
        let r2 = p.length_squared();
        match *self {
            SampleField::Gaussian { amplitude, sigma_m } => {
                1.0 + amplitude * (-0.5 * r2 / (sigma_m * sigma_m)).exp()
            }
            SampleField::Luneburg => (2.0 - r2).max(1.0).sqrt(),
            SampleField::Maxwell { n0, radius_m } => n0 / (1.0 + r2 / (radius_m * radius_m)),
        }
    }

    /// Samples the index on a cube of `half_width_m` about the origin. The only field is
    /// [`refractive_index`](names::REFRACTIVE_INDEX). As f32 it resolves changes of 6e-8, so use
    /// [`SampleField::index_minus_one`] for weak Gaussians (A < 1e-3).
    pub fn flow(&self, dims: UVec3, half_width_m: f64) -> Result<Flow, FlowError> {
        self.sampled(dims, half_width_m, (names::REFRACTIVE_INDEX, "1"), |p| self.index(p))
    }

    /// Samples the same field as `index_minus_one`, n - 1, with full f32 precision.
    pub fn index_minus_one(&self, dims: UVec3, half_width_m: f64) -> Result<Flow, FlowError> {
        self.sampled(dims, half_width_m, ("index_minus_one", "1"), |p| match *self {
            SampleField::Gaussian { amplitude, sigma_m } => {
                amplitude * (-0.5 * p.length_squared() / (sigma_m * sigma_m)).exp()
            }
            _ => self.index(p) - 1.0,
        })
    }

    fn sampled(
        &self,
        dims: UVec3,
        half_width_m: f64,
        field: (&'static str, &'static str),
        value: impl Fn(DVec3) -> f64 + Sync,
    ) -> Result<Flow, FlowError> {
        let mut flow = Flow::over(dims, DVec3::splat(-half_width_m), DVec3::splat(half_width_m))?;
        let (origin, spacing) = (flow.origin_m, flow.spacing_m);
        flow.fill(
            &[field],
            || (),
            |(), j, k, rows| {
                for (i, v) in rows[0].iter_mut().enumerate() {
                    *v = value(origin + spacing * DVec3::new(i as f64, j as f64, k as f64)) as f32;
                }
            },
        );
        Ok(flow)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_at_centre_edge_and_outside() {
        assert_eq!(SampleField::Luneburg.index(DVec3::ZERO), 2f64.sqrt());
        assert_eq!(SampleField::Luneburg.index(DVec3::new(0.0, 0.0, 1.0)), 1.0);
        assert_eq!(SampleField::Luneburg.index(DVec3::splat(3.0)), 1.0);
        let eye = SampleField::Maxwell { n0: 2.0, radius_m: 0.5 };
        assert_eq!(eye.index(DVec3::new(0.5, 0.0, 0.0)), 1.0);
        let flow = SampleField::Luneburg.flow(UVec3::splat(5), 1.0).unwrap();
        assert_eq!(flow.grid(names::REFRACTIVE_INDEX).unwrap().at(2, 2, 2), 2f32.sqrt());
    }

    #[test]
    fn weak_gaussian_keeps_its_digits_as_index_minus_one() {
        let weak = SampleField::Gaussian { amplitude: 1e-8, sigma_m: 0.2 };
        assert_eq!(weak.flow(UVec3::splat(5), 1.0).unwrap().fields[0].range(), Some((1.0, 1.0)));
        let exact = weak.index_minus_one(UVec3::splat(5), 1.0).unwrap();
        assert_eq!(exact.fields[0].range().unwrap().1, 1e-8);
    }
}
