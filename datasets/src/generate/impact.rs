//! A ball that has hit a plate: a crater with a torn rim, the flattened ball, and ejecta flying off
//! in a cone. It represents the fracture simulations among the data sets of chapter 4 of the
//! thesis: many separate closed parts of very different size, which are harder for acceleration
//! structures than one big surface.
//!
//! The field is a signed distance in world units, positive in matter. It is the maximum over plate,
//! ball and fragments, with noise that roughens the surface. The plate is 1.8 x 1.8 x 0.25, and its
//! undisturbed top is at z = 0.

use super::noise::{Noise, RowScratch};
use crate::isosurface::{IsosurfaceError, Isosurfaces, Options, PlaneSource, extract_streamed};
use crate::view::View;
use glam::{DMat3, DVec2, DVec3, UVec3};
use rayon::prelude::*;
use rt_core::math::SplitMix64;

/// The surface of matter.
pub const ISO: f64 = 0.0;

const LOW: DVec3 = DVec3::new(-1.0, -1.0, -0.5);
const HIGH: DVec3 = DVec3::new(1.0, 1.0, 1.1);
const CRATER_RADIUS: f64 = 0.42;
const CRATER_DEPTH: f64 = 0.2;
const PLATE_HALF: f64 = 0.9;
const PLATE_THICKNESS: f64 = 0.25;
const ROUGHNESS: f32 = 0.008;
const BATCH: usize = 32;

/// An ellipsoidal fragment.
struct Fragment {
    center: DVec3,
    /// Maps world space to the unit sphere.
    unit_from_world: DMat3,
    largest_radius: f64,
    smallest_radius: f64,
}

/// The scene after the impact.
pub struct Impact {
    points: u32,
    seed: u64,
    plate: Vec<[f32; 2]>,
    fragments: Vec<Fragment>,
}

impl Impact {
    /// Samples the field on `points` x `points` x 0.8·`points` points (clamped to 16..=4096), with
    /// `fragments` ejecta.
    pub fn new(points: u32, fragments: usize, seed: u64) -> Self {
        let mut random = SplitMix64::new(seed);
        let fragments = (0..fragments)
            .map(|_| {
                // Sizes follow a power law, as for real fragments; the smallest fragments are the
                // fastest and furthest.
                let size = 0.01 * (1.0 - 0.997 * random.unit()).powf(-0.4);
                let flight = random.between(0.05, 1.0).powf(0.7) * (1.0 - (size / 0.15).min(0.6));
                let (s, c) = random.between(0.0, std::f64::consts::TAU).sin_cos();
                let slope = random.between(0.9, 1.5);
                let r = CRATER_RADIUS + 0.45 * flight;
                let center = DVec3::new(r * c, r * s, 0.06 + slope * 0.55 * flight);
                let radii =
                    DVec3::new(1.0, random.between(0.4, 1.0), random.between(0.25, 0.8)) * size;
                let turn =
                    glam::DQuat::from_axis_angle(random.direction(), random.between(0.0, 6.3));
                let unit_from_world =
                    DMat3::from_diagonal(radii.recip()) * DMat3::from_quat(turn).transpose();
                let (largest_radius, smallest_radius) = (radii.max_element(), radii.min_element());
                Fragment { center, unit_from_world, largest_radius, smallest_radius }
            })
            .collect();
        let points = points.clamp(16, 4096);
        Impact { points, seed, plate: Impact::plate_faces(points), fragments }
    }

    /// All parts as one mesh; memory is bounded by the result. See
    /// [`MixingLayer::surface`](super::mixing_layer::MixingLayer::surface) for `progress`.
    pub fn surface(
        &self,
        options: Options,
        progress: impl FnMut(usize) -> bool,
    ) -> Result<Isosurfaces, IsosurfaceError> {
        extract_streamed(self, ISO, options, BATCH, progress)
    }

    /// Standard views: the whole scene, and into the crater.
    pub fn views() -> Vec<View> {
        vec![
            View::new("whole", DVec3::new(2.4, -3.4, 2.2), DVec3::new(0.0, 0.0, 0.15)),
            View::new("crater", DVec3::new(0.7, -1.2, 0.9), DVec3::new(0.0, 0.0, -0.05)),
        ]
    }

    /// Top and bottom of the plate at every (x, y), which do not depend on z.
    fn plate_faces(points: u32) -> Vec<[f32; 2]> {
        let d = (HIGH - LOW) / (points - 1) as f64;
        let face = |i: u32| {
            let p =
                DVec2::new(LOW.x + (i % points) as f64 * d.x, LOW.y + (i / points) as f64 * d.y);
            let (r, angle) = (p.length(), p.to_angle());
            let bowl = CRATER_DEPTH * (1.0 - (r / CRATER_RADIUS).powi(2)).max(0.0);
            let torn = 1.0 + 0.35 * (9.0 * angle + 0.7).sin() + 0.25 * (23.0 * angle).cos();
            let rim = 0.09 * torn * (-((r - CRATER_RADIUS) / 0.06).powi(2)).exp();
            let bulge = 0.12 * (-(r / 0.35).powi(2)).exp();
            [(rim - bowl) as f32, (-PLATE_THICKNESS - bulge) as f32]
        };
        (0..points * points).into_par_iter().map(face).collect()
    }

    /// Distance to plate and ball at a point, given the plate's top and bottom there.
    fn solid(p: DVec3, [top, bottom]: [f32; 2]) -> f32 {
        let sides = PLATE_HALF - p.x.abs().max(p.y.abs());
        let plate = (top as f64 - p.z).min(p.z - bottom as f64).min(sides);
        // The ball, flattened to half its height, rests in the bowl.
        let ball = 0.09
            * (1.0 - ((p - DVec3::new(0.0, 0.0, -0.13)) / DVec3::new(0.2, 0.2, 0.09)).length());
        plate.max(ball) as f32
    }
}

impl PlaneSource for Impact {
    fn dims(&self) -> UVec3 {
        UVec3::new(self.points, self.points, (self.points as f64 * 0.8).round() as u32)
    }

    fn origin(&self) -> DVec3 {
        LOW
    }

    fn spacing(&self) -> DVec3 {
        (HIGH - LOW) / (self.dims() - UVec3::ONE).as_dvec3()
    }

    fn fill_plane(&self, k: u32, values: &mut [f32]) {
        let (n, d) = (self.points as usize, self.spacing());
        let z = LOW.z + k as f64 * d.z;
        let noise = Noise { period: [24; 3], seed: self.seed };
        let mut scratch = RowScratch::default();
        for (j, row) in values.chunks_mut(n).enumerate() {
            let y = LOW.y + j as f64 * d.y;
            for (i, v) in row.iter_mut().enumerate() {
                *v = Impact::solid(DVec3::new(LOW.x + i as f64 * d.x, y, z), self.plate[j * n + i]);
            }
            let length = HIGH - LOW;
            noise.add_row(
                row,
                d.x / length.x,
                (y - LOW.y) / length.y,
                (z - LOW.z) / length.z,
                ROUGHNESS,
                &mut scratch,
            );
        }
        // Each fragment affects few points: only those in its bounding square are visited.
        for f in self.fragments.iter().filter(|f| (f.center.z - z).abs() < f.largest_radius + d.z) {
            let reach = f.largest_radius + d.x.max(d.y);
            let first = ((f.center - reach - LOW) / d).max(DVec3::ZERO).as_uvec3();
            let last = ((f.center + reach - LOW) / d)
                .ceil()
                .max(DVec3::ZERO)
                .as_uvec3()
                .min(self.dims() - 1);
            for j in first.y..=last.y {
                for i in first.x..=last.x {
                    let p = LOW + DVec3::new(i as f64, j as f64, 0.0) * d;
                    let inside = 1.0 - (f.unit_from_world * (p.with_z(z) - f.center)).length();
                    let v = &mut values[j as usize * n + i as usize];
                    *v = v.max((inside * f.smallest_radius) as f32);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{open_or_flipped_edges, pieces, volume, with_threads};

    #[test]
    fn pieces_are_closed() {
        let mesh = Impact::new(96, 200, 1).surface(Options::default(), |_| true).unwrap().mesh;
        assert_eq!(open_or_flipped_edges(&mesh.indices), 0);
        // The plate alone, minus the bowl, plus rim and bulge.
        let plate = 4.0 * PLATE_HALF * PLATE_HALF * PLATE_THICKNESS;
        assert!((0.8..1.1).contains(&(volume(&mesh) / plate)), "{}", volume(&mesh) / plate);
        assert!(mesh.bounds().max.z > 0.4, "ejecta fly: {:?}", mesh.bounds());
    }

    #[test]
    fn more_fragments_are_more_pieces() {
        let count = |f| {
            pieces(
                &Impact::new(96, f, 1).surface(Options::default(), |_| true).unwrap().mesh.indices,
            )
        };
        let [none, many] = [0, 400].map(count);
        // The plate and the ball touch; fragments smaller than a cell are missed at this
        // resolution.
        assert_eq!(none, 1);
        assert!(many > 60, "{many}");
    }

    #[test]
    fn same_mesh_on_1_2_7_threads() {
        let mesh = |threads| {
            with_threads(threads, || {
                Impact::new(40, 50, 3).surface(Options::default(), |_| true).unwrap()
            })
        };
        let one = mesh(1);
        assert!(one == mesh(2) && one == mesh(7));
    }
}
