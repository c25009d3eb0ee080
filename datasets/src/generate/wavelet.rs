//! The wavelet of `vtkRTAnalyticSource` (ParaView's *Sources > Wavelet*), bit for bit: chapter 3 of
//! the thesis renders nested isosurfaces of this field with 1 to 32 million triangles (figures 3.5
//! and 3.6).
//!
//! With the scaled distances `x = (Cx - i)·sx`, `sx = 1/(xmax - xmin)` (y and z alike) and `t =
//! 1/(2·σ²)`:
//!
//! ```text
//! f = 255·exp(-(z² + y² + x²)·t) + 10·sin(60·x) + 18·sin(30·y) + 5·cos(40·z)
//! ```
//!
//! VTK computes in f64, rounds each of the three waves to f32, adds them one after the other in f64
//! and rounds the sum to f32. This module keeps that order. `exp`, `sin` and `cos` come from the
//! platform's C library, as in VTK. Results that differ in their last f64 bit agree after the
//! rounding to f32, except about once in 2²⁹ samples.

use glam::{DVec3, IVec3};
use rayon::prelude::*;
use rt_core::grid::Grid;

/// The largest number of points per axis: f32 vertices of finer grids would coincide.
const MAX_POINTS_PER_AXIS: i64 = 1 << 20;

/// Parameters of the wavelet; the default is VTK's.
///
/// ```
/// let grid = datasets::generate::wavelet::Wavelet::with_points(21).grid()?;
/// assert_eq!(grid.range(), Some((37.353104, 276.82883)));
/// # Ok::<(), datasets::generate::wavelet::WaveletError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wavelet {
    /// First point index per axis (`WholeExtent`); also its world position, because the spacing
    /// is 1.
    pub first: IVec3,
    /// Last point index per axis, not smaller than `first`.
    pub last: IVec3,
    /// Position of the Gaussian peak, in point indices.
    pub center: DVec3,
    /// Height of the Gaussian peak.
    pub maximum: f64,
    /// Standard deviation of the Gaussian, as a fraction of the extent.
    pub standard_deviation: f64,
    /// Angular frequency of the wave along each axis, in radians per extent.
    pub frequency: DVec3,
    /// Amplitude of the wave along each axis.
    pub magnitude: DVec3,
}

impl Default for Wavelet {
    fn default() -> Self {
        Wavelet {
            first: IVec3::splat(-10),
            last: IVec3::splat(10),
            center: DVec3::ZERO,
            maximum: 255.0,
            standard_deviation: 0.5,
            frequency: DVec3::new(60.0, 30.0, 40.0),
            magnitude: DVec3::new(10.0, 18.0, 5.0),
        }
    }
}

/// Why a wavelet cannot be sampled.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WaveletError {
    /// An axis has no points, or more than 2²⁰.
    #[error(
        "wavelet extent {first}..={last} along {axis} has {points} points; give between 1 and \
         {MAX_POINTS_PER_AXIS}"
    )]
    Extent {
        /// 'x', 'y' or 'z'.
        axis: char,
        /// First index.
        first: i32,
        /// Last index.
        last: i32,
        /// Number of points, `last - first + 1`.
        points: i64,
    },
}

impl Wavelet {
    /// VTK's wavelet with `points` samples per axis, centred: 201 is `WholeExtent` -100..100 (an
    /// even number has one more sample on the negative side). `points` 0 becomes 1.
    pub fn with_points(points: u32) -> Self {
        let points = points.max(1) as i32;
        let first = -(points / 2);
        Wavelet {
            first: IVec3::splat(first),
            last: IVec3::splat(first + points - 1),
            ..Default::default()
        }
    }

    /// Samples the field, in parallel over planes; the result does not depend on the number of
    /// threads. An extent that is empty or has more than 2²⁰ points along an axis is an error.
    pub fn grid(&self) -> Result<Grid, WaveletError> {
        let axis = |a: usize| -> Result<Axis, WaveletError> {
            let (first, last) = (self.first[a], self.last[a]);
            let points = last as i64 - first as i64 + 1;
            if !(1..=MAX_POINTS_PER_AXIS).contains(&points) {
                return Err(WaveletError::Extent { axis: ['x', 'y', 'z'][a], first, last, points });
            }
            let wave: fn(f64) -> f64 = if a == 2 { f64::cos } else { f64::sin };
            Ok(Axis::new(first, last, self.center[a], self.magnitude[a], self.frequency[a], wave))
        };
        let (x, y, z) = (axis(0)?, axis(1)?, axis(2)?);
        let t = 1.0 / (2.0 * self.standard_deviation * self.standard_deviation);

        let (nx, ny, nz) = (x.wave.len(), y.wave.len(), z.wave.len());
        let mut values = vec![0f32; nx * ny * nz];
        values.par_chunks_mut(nx * ny).zip(z.square.par_iter().zip(&z.wave)).for_each(
            |(plane, (&zz, &zw))| {
                for (row, (&yy, &yw)) in plane.chunks_mut(nx).zip(y.square.iter().zip(&y.wave)) {
                    let zy = zz + yy;
                    for (v, (&xx, &xw)) in row.iter_mut().zip(x.square.iter().zip(&x.wave)) {
                        let gaussian = self.maximum * (-(zy + xx) * t).exp();
                        *v = (((gaussian + xw) + yw) + zw) as f32;
                    }
                }
            },
        );
        let dims = glam::UVec3::new(nx as u32, ny as u32, nz as u32);
        let grid = Grid::new(dims, self.first.as_dvec3(), DVec3::ONE, values);
        Ok(grid.unwrap_or_else(|_| unreachable!("each point has a value")))
    }
}

/// The terms that depend on one coordinate only: the squared scaled distance, and the wave rounded
/// to f32.
struct Axis {
    square: Vec<f64>,
    wave: Vec<f64>,
}

impl Axis {
    fn new(
        first: i32,
        last: i32,
        center: f64,
        magnitude: f64,
        frequency: f64,
        wave: fn(f64) -> f64,
    ) -> Self {
        let scale = if last > first { 1.0 / (last as f64 - first as f64) } else { 1.0 };
        let scaled = |i: i32| (center - i as f64) * scale;
        Axis {
            square: (first..=last).map(|i| scaled(i) * scaled(i)).collect(),
            wave: (first..=last)
                .map(|i| (magnitude * wave(frequency * scaled(i))) as f32 as f64)
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{crc32_f32, with_threads};

    #[test]
    fn ranges_are_vtks() {
        // Measured with vtkRTAnalyticSource of VTK 9.1, 9.2 (ParaView 5.11) and 9.7.
        assert_eq!(Wavelet::default().grid().unwrap().range(), Some((37.353104, 276.82883)));
        assert_eq!(Wavelet::with_points(201).grid().unwrap().range(), Some((33.95115, 286.3411)));
    }

    #[test]
    fn bits_are_vtks() {
        // zlib.crc32 of RTData from vtkRTAnalyticSource (VTK 9.7.2); wavelet_vs_vtk.rs repeats the
        // comparison live.
        assert_eq!(crc32_f32(Wavelet::default().grid().unwrap().values()), 0x6f34_cebe);
        assert_eq!(crc32_f32(Wavelet::with_points(101).grid().unwrap().values()), 0x1b8c_cc5c);
    }

    #[test]
    fn default_is_21_points() {
        assert_eq!(Wavelet::default(), Wavelet::with_points(21));
    }

    #[test]
    fn same_bits_on_1_2_7_threads() {
        let crc = |threads| {
            with_threads(threads, || crc32_f32(Wavelet::with_points(33).grid().unwrap().values()))
        };
        assert_eq!((crc(1), crc(1)), (crc(2), crc(7)));
    }

    #[test]
    fn one_point_axis_has_scale_one() {
        let flat = Wavelet {
            first: IVec3::new(-10, -10, 3),
            last: IVec3::new(10, 10, 3),
            ..Default::default()
        };
        let grid = flat.grid().unwrap();
        assert_eq!(grid.dims(), glam::UVec3::new(21, 21, 1));
        // z = (0 - 3)·1: the Gaussian is exp(-18 - …), the wave along z is 5·cos(-120).
        let expected = 255.0 * (-18f64).exp() + (5.0 * (120f64).cos()) as f32 as f64;
        assert_eq!(grid.at(10, 10, 0), expected as f32);
    }

    #[test]
    fn empty_extent_is_an_error_that_names_the_axis() {
        let w = Wavelet { last: IVec3::new(10, -11, 10), ..Default::default() };
        let message = w.grid().unwrap_err().to_string();
        assert!(message.contains("along y") && message.contains("0 points"), "{message}");
        let huge = Wavelet {
            first: IVec3::splat(i32::MIN),
            last: IVec3::splat(i32::MAX),
            ..Default::default()
        };
        assert!(huge.grid().is_err(), "2^32 points per axis");
    }
}
