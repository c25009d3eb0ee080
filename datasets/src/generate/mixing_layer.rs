//! A Richtmyer-Meshkov-like mixing layer: two gases, a perturbed interface between them, and
//! turbulence that breaks it up.
//!
//! It represents the LLNL simulation (2048 x 2048 x 1920 points, 316 million triangles) that the
//! thesis renders in table 4.1 as "RMO" (the whole, from outside) and "RMI" (close, from inside the
//! layer).
//!
//! The field is the fraction of the heavy gas, 0 above to 1 below. It falls linearly across a
//! surface. The height of the surface is a sum of long waves (left behind by the shock) plus noise
//! in octaves down to a few cells, with Kolmogorov's amplitudes ∝ wavelength^(1/3). Where the
//! noise's slope in z exceeds one, the surface folds over, so its area grows faster than the square
//! of the resolution, as in the simulation (measured: 0.18, 1.1, 6.8 and 42.5 million triangles at
//! 128, 256, 512 and 1024 points). Along x and y the field is periodic.

use super::noise::{Noise, RowScratch};
use crate::isosurface::{IsosurfaceError, Isosurfaces, Options, PlaneSource, extract_streamed};
use crate::view::View;
use glam::{DVec3, UVec3};
use rayon::prelude::*;
use rt_core::math::SplitMix64;
use std::f64::consts::TAU;

/// Isovalue of the surface: equal parts of heavy and light gas.
pub const ISO: f64 = 0.5;

/// Height of the domain relative to its width: 1920 / 2048.
const HEIGHT: f64 = 0.9375;
/// Thickness over which the fraction falls from 1 to 0.
const TRANSITION: f32 = 0.4;
/// Number of waves of the undisturbed interface.
const MODES: usize = 60;
/// Cells per wavelength of the finest octave; shorter waves would be aliased.
const CELLS_PER_WAVELENGTH: f64 = 3.9;
/// Noise amplitude of the first octave, 8 wavelengths per width.
const AMPLITUDE: f32 = 0.24;
const FIRST_PERIOD: u32 = 8;
/// Half thickness of the turbulent zone.
const ZONE: f64 = 0.13;
/// Number of planes in memory at a time.
const BATCH: usize = 32;

/// The field; the domain is 1 x 1 x 0.9375 at any resolution.
pub struct MixingLayer {
    points: u32,
    seed: u64,
    /// Height of the undisturbed interface above the middle, per (x, y).
    waves: Vec<f32>,
    highest_wave: f32,
}

impl MixingLayer {
    /// A layer sampled with `points` x `points` x 0.9375·`points` points (2048 for the thesis's
    /// size); `points` is clamped to 16..=8192.
    pub fn new(points: u32, seed: u64) -> Self {
        let points = points.clamp(16, 8192);
        let mut random = SplitMix64::new(seed);
        // Wave numbers in a ring; longer waves have larger amplitudes.
        let modes: Vec<[f64; 4]> = (0..MODES)
            .map(|_| {
                let k = random.between(3.0, 12.0);
                let (s, c) = random.between(0.0, TAU).sin_cos();
                [(k * c).round(), (k * s).round(), random.between(0.0, TAU), 0.05 / k]
            })
            .collect();
        let dx = 1.0 / (points - 1) as f64;
        let mut waves = vec![0f32; (points * points) as usize];
        waves.par_chunks_mut(points as usize).enumerate().for_each(|(j, row)| {
            for (i, v) in row.iter_mut().enumerate() {
                let (x, y) = (i as f64 * dx, j as f64 * dx);
                *v = modes
                    .iter()
                    .map(|[kx, ky, p, a]| a * (TAU * (kx * x + ky * y) + p).cos())
                    .sum::<f64>() as f32;
            }
        });
        let highest_wave = waves.iter().fold(0f32, |m, w| m.max(w.abs()));
        MixingLayer { points, seed, waves, highest_wave }
    }

    /// The interface as a mesh. Memory is bounded by the result: 32 planes of the field exist at a
    /// time. `progress` is called with the number of finished planes and stops the work by
    /// returning false.
    pub fn surface(
        &self,
        options: Options,
        progress: impl FnMut(usize) -> bool,
    ) -> Result<Isosurfaces, IsosurfaceError> {
        extract_streamed(self, ISO, options, BATCH, progress)
    }

    /// Standard views: "RMO", the whole from outside, and "RMI", from within the layer.
    pub fn views() -> Vec<View> {
        let middle = DVec3::new(0.5, 0.5, HEIGHT / 2.0);
        vec![
            View::new("RMO", middle + DVec3::new(-1.35, -1.7, 1.15), middle),
            View {
                vertical_fov_degrees: 45.0,
                ..View::new(
                    "RMI",
                    middle + DVec3::new(-0.12, -0.38, 0.16),
                    middle + DVec3::new(0.1, 0.2, -0.05),
                )
            },
        ]
    }

    /// The noise octaves and their amplitudes.
    fn octaves(&self) -> impl Iterator<Item = (Noise, f32)> {
        let finest = (self.points - 1) as f64 / CELLS_PER_WAVELENGTH;
        let seed = self.seed;
        (0..16u32).map_while(move |o| {
            let period = FIRST_PERIOD << o;
            let noise = Noise { period: [period; 3], seed: seed ^ (o as u64 + 1) << 48 };
            (o == 0 || period as f64 <= finest)
                .then(|| (noise, AMPLITUDE * 0.5f32.powf(o as f32 / 3.0)))
        })
    }
}

impl PlaneSource for MixingLayer {
    fn dims(&self) -> UVec3 {
        UVec3::new(self.points, self.points, (self.points as f64 * HEIGHT).round() as u32)
    }

    fn origin(&self) -> DVec3 {
        DVec3::ZERO
    }

    fn spacing(&self) -> DVec3 {
        DVec3::splat(1.0 / (self.points - 1) as f64)
    }

    fn fill_plane(&self, k: u32, values: &mut [f32]) {
        let dx = 1.0 / (self.points - 1) as f64;
        let z = k as f64 * dx;
        let from_middle = (z - HEIGHT / 2.0) as f32;
        let calm = (-(from_middle as f64 / ZONE).powi(2)).exp() as f32;
        // Gradient noise with components in ±1 stays within ±1.5. The surface cannot lie outside
        // that range, so noise is left out there.
        let octaves: Vec<_> = self.octaves().collect();
        let reach = self.highest_wave + 1.5 * calm * octaves.iter().map(|(_, a)| a).sum::<f32>();
        let turbulent = from_middle.abs() <= reach;
        let mut scratch: Vec<RowScratch> = octaves.iter().map(|_| RowScratch::default()).collect();
        let n = self.points as usize;
        for (j, (row, waves)) in values.chunks_mut(n).zip(self.waves.chunks(n)).enumerate() {
            row.copy_from_slice(waves);
            if turbulent {
                for ((noise, amplitude), scratch) in octaves.iter().zip(&mut scratch) {
                    noise.add_row(row, dx, j as f64 * dx, z, amplitude * calm, scratch);
                }
            }
            for v in row {
                *v = (0.5 + (*v - from_middle) / TRANSITION).clamp(0.0, 1.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{crc32_f32, with_threads};
    use rt_core::grid::Grid;

    #[test]
    fn area_grows_faster_than_the_square_of_the_resolution() {
        let count = |n| {
            MixingLayer::new(n, 1)
                .surface(Options::default(), |_| true)
                .unwrap()
                .mesh
                .num_triangles()
        };
        let [coarse, fine] = [48, 192].map(count);
        assert!(coarse > 5_000, "{coarse}");
        assert!(fine > 22 * coarse, "{coarse} to {fine}: 16 times the cells of a smooth surface");
    }

    #[test]
    fn heavy_below_light_above_and_periodic() {
        let layer = MixingLayer::new(64, 3);
        let d = layer.dims();
        let mut values = vec![0f32; (d.x * d.y * d.z) as usize];
        values
            .chunks_mut((d.x * d.y) as usize)
            .enumerate()
            .for_each(|(k, p)| layer.fill_plane(k as u32, p));
        let grid = Grid::new(d, layer.origin(), layer.spacing(), values).unwrap();
        assert_eq!((grid.at(5, 9, 0), grid.at(5, 9, d.z - 1)), (1.0, 0.0));
        for k in 0..d.z {
            for i in 0..64 {
                assert!((grid.at(i, 0, k) - grid.at(i, 63, k)).abs() < 1e-3, "y at {i} {k}");
                assert!((grid.at(0, i, k) - grid.at(63, i, k)).abs() < 1e-3, "x at {i} {k}");
            }
        }
    }

    #[test]
    fn same_mesh_on_1_2_7_threads_and_other_on_other_seeds() {
        let crc = |seed, threads| {
            with_threads(threads, || {
                let m =
                    MixingLayer::new(40, seed).surface(Options::default(), |_| true).unwrap().mesh;
                crc32_f32(bytemuck::cast_slice(&m.positions))
            })
        };
        assert_eq!((crc(1, 1), crc(1, 1)), (crc(1, 2), crc(1, 7)));
        assert_ne!(crc(1, 1), crc(2, 1));
    }
}
