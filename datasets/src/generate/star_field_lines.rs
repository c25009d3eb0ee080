//! Magnetic field lines of a star. Represents the 48 000 streamlines of the VAPOR star in table 4.1
//! of the thesis (86 million triangles of tubes there; round tubes without triangles here).
//!
//! The field is that of a tilted dipole at the centre and a dozen smaller ones under the surface
//! (starspots), so lines have all lengths, from small arcades to loops that leave the domain. The
//! unit of length is the star's radius.

use super::fibonacci::fibonacci_direction;
use super::polylines::{Line, Polylines};
use super::streamline::{StreamlineOptions, trace};
use crate::view::View;
use glam::DVec3;
use rayon::prelude::*;
use rt_core::math::SplitMix64;

/// Number of lines in the thesis.
pub const THESIS_LINES: usize = 48_000;

const SPOTS: usize = 12;
/// Distance from the centre at which lines end.
const OUTER_RADIUS: f64 = 8.0;
/// Step length as a fraction of the distance to the centre: small at the surface, where the field
/// is intricate.
const RELATIVE_STEP: f64 = 0.03;
/// Tube radius as a fraction of the distance to the centre.
const RELATIVE_TUBE: f32 = 0.002;

struct Dipole {
    position: DVec3,
    moment: DVec3,
}

/// The star's magnetic field.
pub struct StarField {
    dipoles: Vec<Dipole>,
}

impl StarField {
    /// The field for a seed.
    pub fn new(seed: u64) -> Self {
        let mut random = SplitMix64::new(seed);
        let mut dipoles = vec![Dipole { position: DVec3::ZERO, moment: DVec3::new(0.2, 0.1, 1.0) }];
        dipoles.extend((0..SPOTS).map(|_| Dipole {
            position: random.direction() * 0.8,
            moment: random.direction() * random.between(0.01, 0.05),
        }));
        StarField { dipoles }
    }

    /// Field at `p`: Σ (3(m·r)r/r² - m)/r³, in units of the central dipole's equatorial surface
    /// field.
    pub fn at(&self, p: DVec3) -> DVec3 {
        let dipole = |d: &Dipole| {
            let r = p - d.position;
            let r2 = r.length_squared();
            (3.0 * d.moment.dot(r) / r2 * r - d.moment) / (r2 * r2.sqrt())
        };
        self.dipoles.iter().map(dipole).sum()
    }

    /// Traces `count` field lines from points spread evenly over the surface, outward until they
    /// return or reach eight radii. The scalar is log₁₀|B|.
    pub fn lines(&self, count: usize) -> Polylines {
        let line = |i: usize| -> Line {
            let seed = fibonacci_direction(i, count);
            let tracing = StreamlineOptions {
                max_points: 5000,
                sign: if self.at(seed).dot(seed) < 0.0 { -1.0 } else { 1.0 },
                min_speed: 1e-12,
            };
            // The first step leaves the surface, so the test for a return inside starts after it.
            let step = |p: DVec3| {
                let r = p.length();
                (r < OUTER_RADIUS && (r >= 1.0 || p == seed)).then_some(RELATIVE_STEP * r)
            };
            let points = trace(|p| self.at(p), seed, step, tracing);
            Line {
                radii: points.iter().map(|p| RELATIVE_TUBE * p.length() as f32).collect(),
                scalars: points.iter().map(|p| self.at(*p).length().log10() as f32).collect(),
                points: points.iter().map(|p| p.as_vec3()).collect(),
            }
        };
        Polylines::from_lines((0..count).into_par_iter().map(line).collect())
    }

    /// Standard views: the whole, and close to the surface.
    pub fn views() -> Vec<View> {
        vec![
            View::new("whole", DVec3::new(14.0, -18.0, 7.0), DVec3::ZERO),
            View::new("surface", DVec3::new(2.6, -2.4, 1.3), DVec3::new(0.5, -0.5, 0.2)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::with_threads;

    #[test]
    fn field_has_no_divergence() {
        let field = StarField::new(1);
        let mut random = SplitMix64::new(2);
        for _ in 0..100 {
            let p = random.direction() * random.between(1.0, 4.0);
            let h = 1e-4;
            let d = |axis: DVec3| {
                (field.at(p + axis * h) - field.at(p - axis * h)).dot(axis) / (2.0 * h)
            };
            let divergence = d(DVec3::X) + d(DVec3::Y) + d(DVec3::Z);
            assert!(divergence.abs() < 1e-3 * field.at(p).length(), "{p}: {divergence}");
        }
    }

    #[test]
    fn lines_return_or_leave_and_are_of_many_lengths() {
        let lines = StarField::new(1).lines(500);
        assert_eq!(lines.len(), 500);
        let mut lengths = Vec::new();
        for w in lines.offsets.windows(2) {
            let line = &lines.points[w[0] as usize..w[1] as usize];
            let end = line.last().unwrap().length();
            assert!(
                line.len() >= 2 && (end < 1.0 || end >= OUTER_RADIUS as f32),
                "ends at radius {end}"
            );
            lengths.push(line.len());
        }
        lengths.sort();
        assert!(lengths[50] < 40 && lengths[450] > 60, "{} {}", lengths[50], lengths[450]);
        assert!(lines.scalars.iter().all(|s| s.is_finite()));
        assert_eq!(lines.num_segments(), lines.points.len() - 500);
        lines.into_tubes().unwrap();
    }

    #[test]
    fn same_lines_on_1_2_7_threads() {
        let lines = |threads| with_threads(threads, || StarField::new(7).lines(64));
        let one = lines(1);
        assert!(one == lines(2) && one == lines(7));
    }
}
