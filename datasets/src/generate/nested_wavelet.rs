//! Nested isosurfaces of the wavelet with 1, 2, 4 … 64 million triangles: the scaling series of
//! figures 3.5 and 3.6 of the thesis, which varies the number of isosurfaces rather than the
//! resolution of the field.
//!
//! The isovalues are evenly spaced and rounded to two decimals, so that they can be typed into
//! ParaView's Contour filter. The triangle counts are those of `vtkFlyingEdges3D`. 27 values give
//! exactly the 16 022 136 triangles that the thesis reports.

use super::wavelet::{Wavelet, WaveletError};
use crate::isosurface::{self, IsosurfaceError, Isosurfaces, Options, count_triangles};
use rt_core::grid::Grid;

/// Points per axis of the grid for the named sizes (`WholeExtent` -100..100).
pub const POINTS: u32 = 201;

/// Range of the isovalues of larger series; outside it, surfaces become small.
const SPREAD: [f64; 2] = [115.0, 195.0];

/// The named sizes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[expect(missing_docs, reason = "the names say it: millions of triangles")]
pub enum Size {
    M1,
    M2,
    M4,
    M8,
    M16,
    M32,
    M64,
}

impl Size {
    /// All sizes, ascending.
    pub const ALL: [Size; 7] =
        [Size::M1, Size::M2, Size::M4, Size::M8, Size::M16, Size::M32, Size::M64];

    /// "1M", "2M", … "64M".
    pub fn name(self) -> &'static str {
        ["1M", "2M", "4M", "8M", "16M", "32M", "64M"][self as usize]
    }

    /// The size of that name, in upper or lower case.
    pub fn from_name(name: &str) -> Option<Size> {
        Size::ALL.into_iter().find(|s| s.name().eq_ignore_ascii_case(name))
    }

    /// Number of triangles at 201³ points.
    pub fn triangles(self) -> usize {
        [1_002_484, 1_996_950, 4_003_478, 8_005_776, 16_022_136, 31_996_300, 64_135_816]
            [self as usize]
    }

    /// The isovalues, ascending.
    pub fn isovalues(self) -> Vec<f64> {
        let (count, lowest, highest) = [
            (2, 121.0, 189.0),
            (4, 105.5, 204.5),
            (7, 115.0, 195.0),
            (14, 112.0, 198.0),
            (27, 116.0, 194.0),
            (54, SPREAD[0], SPREAD[1]),
            (108, SPREAD[0], SPREAD[1]),
        ][self as usize];
        evenly_spaced(count, lowest, highest)
    }

    /// Generates the surfaces: 24 bytes per triangle, 30 with normals. 16 million triangles take
    /// about 1.5 seconds on two cores.
    pub fn generate(self, options: Options) -> Result<Isosurfaces, NestedWaveletError> {
        let grid = Wavelet::with_points(POINTS).grid()?;
        Ok(isosurface::extract(&grid, &self.isovalues(), options)?)
    }
}

/// Why the surfaces cannot be generated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NestedWaveletError {
    /// The field cannot be sampled.
    #[error(transparent)]
    Wavelet(#[from] WaveletError),
    /// The surfaces cannot be extracted.
    #[error(transparent)]
    Isosurface(#[from] IsosurfaceError),
}

/// `count` values from `lowest` to `highest`, rounded to two decimals. A single value lies in the
/// middle.
pub fn evenly_spaced(count: usize, lowest: f64, highest: f64) -> Vec<f64> {
    let step = (highest - lowest) / (count.max(2) - 1) as f64;
    let value =
        |i: usize| if count == 1 { 0.5 * (lowest + highest) } else { lowest + step * i as f64 };
    (0..count).map(|i| (value(i) * 100.0).round() / 100.0).collect()
}

/// Isovalues between 115 and 195 for any wavelet grid, whose triangle count comes as close to
/// `triangles` as an evenly spaced series can. (Larger grids have proportionally more triangles per
/// surface.)
pub fn isovalues_for(grid: &Grid, triangles: usize) -> Result<Vec<f64>, IsosurfaceError> {
    let total = |n: usize| -> Result<usize, IsosurfaceError> {
        Ok(count_triangles(grid, &evenly_spaced(n, SPREAD[0], SPREAD[1]))?.iter().sum())
    };
    // The mean over a fine series barely changes with its length, so one estimate and a comparison
    // with its neighbours suffice.
    let mean = total(16)? as f64 / 16.0;
    let guess = if mean > 0.0 { (triangles as f64 / mean).round().max(1.0) as usize } else { 1 };
    let mut best = (usize::MAX, guess);
    for n in guess.saturating_sub(1).max(1)..=guess + 1 {
        best = best.min((total(n)?.abs_diff(triangles), n));
    }
    Ok(evenly_spaced(best.1, SPREAD[0], SPREAD[1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangle_counts_are_as_named() {
        let grid = Wavelet::with_points(POINTS).grid().unwrap();
        for size in Size::ALL {
            let counted: usize = count_triangles(&grid, &size.isovalues()).unwrap().iter().sum();
            assert_eq!(counted, size.triangles(), "{}", size.name());
            let millions: f64 = size.name().trim_end_matches('M').parse().unwrap();
            assert!((counted as f64 / 1e6 / millions - 1.0).abs() < 0.003, "{}", size.name());
        }
    }

    #[test]
    fn isovalues_are_the_published_lists() {
        assert_eq!(Size::M1.isovalues(), [121.0, 189.0]);
        assert_eq!(Size::M2.isovalues(), [105.5, 138.5, 171.5, 204.5]);
        assert_eq!(Size::M4.isovalues(), [115.0, 128.33, 141.67, 155.0, 168.33, 181.67, 195.0]);
        let m8 = [
            112.0, 118.62, 125.23, 131.85, 138.46, 145.08, 151.69, 158.31, 164.92, 171.54, 178.15,
            184.77, 191.38, 198.0,
        ];
        assert_eq!(Size::M8.isovalues(), m8);
        let m16: Vec<f64> = (0..27).map(|i| 116.0 + 3.0 * i as f64).collect();
        assert_eq!(Size::M16.isovalues(), m16);
    }

    #[test]
    fn other_grids_come_close_to_the_target() {
        let grid = Wavelet::with_points(81).grid().unwrap();
        for target in [1, 100_000, 1_000_000] {
            let isos = isovalues_for(&grid, target).unwrap();
            let counted: usize = count_triangles(&grid, &isos).unwrap().iter().sum();
            // Off by at most half a surface (one surface of 81³ has about 100,000 triangles).
            assert!(
                isos.len() == 1 || counted.abs_diff(target) < 60_000,
                "{target}: {counted} by {}",
                isos.len()
            );
        }
    }

    #[test]
    fn names_round_trip() {
        for s in Size::ALL {
            assert_eq!(Size::from_name(&s.name().to_lowercase()), Some(s));
        }
        assert_eq!(Size::from_name("3M"), None);
    }
}
