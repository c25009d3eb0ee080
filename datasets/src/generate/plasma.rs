//! A reconnecting current sheet, the subject of the VPIC plasma simulation in table 4.1 of the
//! thesis (102 million triangles): wrinkled flux ropes as an isosurface of density, and tubes along
//! the magnetic field.
//!
//! The field is a Harris sheet (Harris 1962) with a chain of magnetic islands that wander along y,
//! under a guide field: B = ∇×(A ŷ) + B_g ŷ with A = -λ ln cosh(z/λ) + ε cos(k·x + κ(y))
//! exp(-z²/w²), so it is exactly free of divergence. Density is a function of A (plasma is tied to
//! flux surfaces) with turbulence in octaves down to a few cells. The domain is 2 x 1 x 1, periodic
//! along x and y, with z = 0 in the sheet.

use super::noise::{Noise, RowScratch};
use super::polylines::{Line, Polylines};
use super::streamline::{StreamlineOptions, trace};
use crate::isosurface::{IsosurfaceError, Isosurfaces, Options, PlaneSource, extract_streamed};
use crate::view::View;
use glam::{DVec2, DVec3, UVec3};
use rayon::prelude::*;
use rt_core::math::SplitMix64;
use std::f64::consts::TAU;

/// Isovalue of the density: the outer surface of the flux ropes.
pub const ISO: f64 = 0.31;

/// Half thickness of the sheet, λ.
const SHEET: f64 = 0.05;
/// Strength ε and half height w of the islands.
const ISLAND: f64 = 0.06;
const ISLAND_HEIGHT: f64 = 0.2;
/// Wave number of the island chain: five islands over the length of 2.
const WAVE_NUMBER: f64 = 5.0 * TAU / 2.0;
const GUIDE_FIELD: f64 = 0.5;
/// Noise of the first octave, and its wavelengths per unit.
const TURBULENCE: f32 = 0.7;
const FIRST_PERIOD: u32 = 6;
const CELLS_PER_WAVELENGTH: f64 = 3.9;
const BATCH: usize = 32;

/// The plasma; as a [`PlaneSource`], it provides the density.
#[derive(Debug, Clone, Copy)]
pub struct Plasma {
    points: u32,
    seed: u64,
    wander: [f64; 2],
}

impl Plasma {
    /// Samples the density with 2·`points` x `points` x `points` points; `points` is clamped to
    /// 16..=4096.
    pub fn new(points: u32, seed: u64) -> Self {
        let mut random = SplitMix64::new(seed);
        let wander = [random.between(0.0, TAU), random.between(0.0, TAU)];
        Plasma { points: points.clamp(16, 4096), seed, wander }
    }

    /// Phase of the island chain at `y`, and its derivative.
    fn phase(&self, y: f64) -> (f64, f64) {
        let [a, b] = self.wander;
        let (s1, c1) = (TAU * y + a).sin_cos();
        let (s2, c2) = (2.0 * TAU * y + b).sin_cos();
        (1.2 * s1 + 0.5 * s2, TAU * (1.2 * c1 + c2))
    }

    /// The flux function A, which is constant along field lines where the chain is straight.
    pub fn flux(&self, p: DVec3) -> f64 {
        let chain = (WAVE_NUMBER * p.x + self.phase(p.y).0).cos();
        -SHEET * (p.z / SHEET).cosh().ln() + ISLAND * chain * (-(p.z / ISLAND_HEIGHT).powi(2)).exp()
    }

    /// The magnetic field, in units of its strength far from the sheet.
    pub fn magnetic_field(&self, p: DVec3) -> DVec3 {
        let (s, c) = (WAVE_NUMBER * p.x + self.phase(p.y).0).sin_cos();
        let envelope = (-(p.z / ISLAND_HEIGHT).powi(2)).exp();
        let da_dz = -(p.z / SHEET).tanh()
            - 2.0 * p.z / (ISLAND_HEIGHT * ISLAND_HEIGHT) * ISLAND * c * envelope;
        let da_dx = -ISLAND * WAVE_NUMBER * s * envelope;
        DVec3::new(-da_dz, GUIDE_FIELD, da_dx)
    }

    /// The flux ropes as a mesh; memory is bounded by the result. See
    /// [`MixingLayer::surface`](super::mixing_layer::MixingLayer::surface) for `progress`.
    pub fn surface(
        &self,
        options: Options,
        progress: impl FnMut(usize) -> bool,
    ) -> Result<Isosurfaces, IsosurfaceError> {
        extract_streamed(self, ISO, options, BATCH, progress)
    }

    /// `count` field lines through random points near the sheet. The scalar is the field strength.
    pub fn streamtubes(&self, count: usize) -> Polylines {
        let line = |i: usize| -> Line {
            let mut random = SplitMix64::new(self.seed ^ (i as u64 + 1) << 32);
            let seed = DVec3::new(
                random.between(0.0, 2.0),
                random.unit(),
                random.between(-1.0, 1.0) * 2.0 * SHEET,
            );
            let (low, high) = (DVec3::new(0.0, 0.0, -0.5), DVec3::new(2.0, 1.0, 0.5));
            let step = |p: DVec3| (p.cmpge(low).all() && p.cmple(high).all()).then_some(0.006);
            let follow = |sign: f64| {
                let tracing = StreamlineOptions { max_points: 400, sign, min_speed: 1e-9 };
                trace(|p| self.magnetic_field(p), seed, step, tracing)
            };
            let mut points = follow(-1.0);
            points.reverse();
            points.extend(follow(1.0).into_iter().skip(1));
            Line {
                radii: vec![0.0015; points.len()],
                scalars: points.iter().map(|p| self.magnetic_field(*p).length() as f32).collect(),
                points: points.iter().map(|p| p.as_vec3()).collect(),
            }
        };
        Polylines::from_lines((0..count).into_par_iter().map(line).collect())
    }

    /// Standard views: the whole, and along a rope.
    pub fn views() -> Vec<View> {
        let middle = DVec3::new(1.0, 0.5, 0.0);
        vec![
            View::new("whole", middle + DVec3::new(-1.6, -3.0, 2.0), middle),
            View::new("rope", DVec3::new(0.6, -0.5, 0.35), DVec3::new(1.0, 0.4, 0.0)),
        ]
    }

    fn octaves(&self) -> impl Iterator<Item = (Noise, f32)> {
        let finest = (self.points - 1) as f64 / CELLS_PER_WAVELENGTH;
        let seed = self.seed;
        (0..16u32).map_while(move |o| {
            let period = FIRST_PERIOD << o;
            let noise =
                Noise { period: [2 * period, period, period], seed: seed ^ (o as u64 + 1) << 40 };
            (o == 0 || period as f64 <= finest)
                .then(|| (noise, TURBULENCE * 0.5f32.powf(o as f32 / 3.0)))
        })
    }
}

impl PlaneSource for Plasma {
    fn dims(&self) -> UVec3 {
        UVec3::new(2 * self.points, self.points, self.points)
    }

    fn origin(&self) -> DVec3 {
        DVec3::new(0.0, 0.0, -0.5)
    }

    fn spacing(&self) -> DVec3 {
        let n = self.points as f64;
        DVec3::new(2.0 / (2.0 * n - 1.0), 1.0 / (n - 1.0), 1.0 / (n - 1.0))
    }

    fn fill_plane(&self, k: u32, values: &mut [f32]) {
        let d = self.spacing();
        let z = -0.5 + k as f64 * d.z;
        // A = harris + chain·envelope; only the chain varies within the plane.
        let harris = -SHEET * (z / SHEET).cosh().ln();
        let envelope = ISLAND * (-(z / ISLAND_HEIGHT).powi(2)).exp();
        let wave: Vec<DVec2> =
            (0..2 * self.points).map(|i| DVec2::from_angle(WAVE_NUMBER * i as f64 * d.x)).collect();
        // Where the density is too low even in the middle of an island, turbulence cannot reach the
        // surface and is left out.
        let thickest = density(harris + envelope);
        let turbulent =
            thickest * (1.0 + 1.5 * self.octaves().map(|(_, a)| a).sum::<f32>()) > 0.9 * ISO as f32;
        let mut turbulence = vec![0f32; wave.len()];
        let octaves: Vec<_> = self.octaves().collect();
        let mut scratch: Vec<RowScratch> = octaves.iter().map(|_| RowScratch::default()).collect();
        for (j, row) in values.chunks_mut(wave.len()).enumerate() {
            let y = j as f64 * d.y;
            if turbulent {
                turbulence.fill(0.0);
                for ((noise, amplitude), scratch) in octaves.iter().zip(&mut scratch) {
                    // The noise repeats after a length of 1 in its own x, which corresponds to the
                    // domain's length of 2.
                    noise.add_row(&mut turbulence, d.x / 2.0, y, z + 0.5, *amplitude, scratch);
                }
            }
            let phase = DVec2::from_angle(-self.phase(y).0);
            for ((v, t), w) in row.iter_mut().zip(&turbulence).zip(&wave) {
                // cos(kx + κ) is the dot product of the two directions.
                *v = density(harris + envelope * w.dot(phase)) * (1.0 + t);
            }
        }
    }
}

/// Density without turbulence: 1 in the middle of an island, where A = ε; 1/9 on the separatrix,
/// where A = -ε; and falling further away from the sheet. (An exponential would also work but would
/// cost more than the noise.)
fn density(flux: f64) -> f32 {
    let q = ISLAND / (2.0 * ISLAND - flux);
    (q * q) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::with_threads;

    #[test]
    fn magnetic_field_is_the_curl_of_the_flux_function() {
        let plasma = Plasma::new(16, 4);
        let mut random = SplitMix64::new(5);
        let h = 1e-6;
        for _ in 0..100 {
            let p = DVec3::new(random.between(0.0, 2.0), random.unit(), random.between(-0.4, 0.4));
            let d =
                |axis: DVec3| (plasma.flux(p + axis * h) - plasma.flux(p - axis * h)) / (2.0 * h);
            let curl = DVec3::new(-d(DVec3::Z), GUIDE_FIELD, d(DVec3::X));
            assert!(curl.distance(plasma.magnetic_field(p)) < 1e-6, "{p}");
        }
    }

    #[test]
    fn density_without_turbulence_is_a_function_of_the_flux() {
        let plasma = Plasma::new(32, 4);
        let d = plasma.dims();
        let mut plane = vec![0f32; (d.x * d.y) as usize];
        // The outermost plane lies outside the turbulence.
        plasma.fill_plane(0, &mut plane);
        for (i, v) in plane.iter().enumerate() {
            let (i, j) = (i as u32 % d.x, i as u32 / d.x);
            let p = plasma.origin() + plasma.spacing() * DVec3::new(i as f64, j as f64, 0.0);
            let expected = density(plasma.flux(p));
            assert!((v - expected).abs() < 1e-5 * expected, "{i} {j}: {v} {expected}");
        }
    }

    #[test]
    fn ropes_lie_along_the_sheet() {
        let mesh = Plasma::new(64, 1).surface(Options::default(), |_| true).unwrap().mesh;
        assert!(mesh.num_triangles() > 20_000, "{}", mesh.num_triangles());
        let b = mesh.bounds();
        assert!(b.min.z > -0.3 && b.max.z < 0.3 && b.max.x - b.min.x > 1.9, "{b:?}");
    }

    #[test]
    fn streamtubes_stay_in_the_domain() {
        let lines = Plasma::new(16, 1).streamtubes(100);
        assert_eq!(lines.len(), 100);
        assert!(lines.points.iter().all(|p| p.is_finite() && p.z.abs() < 0.51));
        assert!(lines.num_segments() > 5_000, "{}", lines.num_segments());
        lines.into_tubes().unwrap();
    }

    #[test]
    fn same_data_on_1_2_7_threads() {
        let data = |threads| {
            with_threads(threads, || {
                let p = Plasma::new(24, 9);
                (p.surface(Options::default(), |_| true).unwrap(), p.streamtubes(20))
            })
        };
        let one = data(1);
        assert!(one == data(2) && one == data(7));
    }
}
