//! Uses any image as a filter: each photon is multiplied by the colour at the point where it
//! crosses the cut-off plane.

use super::Rgb;
use crate::optics::PlaneVector;
use datasets::image_io::{ImageError, read_png};
use std::path::Path;

/// A raster of linear transmissions that covers a rectangle of the cut-off plane, centred on the
/// axis. The image's top is up. Values are interpolated bilinearly between pixel centres. Outside
/// the rectangle, the edge pixels continue.
#[derive(Debug, Clone, PartialEq)]
pub struct FilterImage {
    width: u32,
    height: u32,
    size_m: [f64; 2],
    pixels: Vec<Rgb>,
}

/// Why an image cannot be used as a filter.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FilterError {
    /// The file cannot be read.
    #[error("the filter image cannot be used")]
    File(#[from] ImageError),
    /// The dimensions or values do not describe a filter.
    #[error("a filter of {width}x{height} pixels and {} x {} m with {found} values: \
             {reason}", size_m[0], size_m[1])]
    Shape {
        /// Pixels per row.
        width: u32,
        /// Number of rows.
        height: u32,
        /// Sides in the cut-off plane.
        size_m: [f64; 2],
        /// Number of values given.
        found: usize,
        /// What is wrong and how to correct it.
        reason: &'static str,
    },
}

impl FilterImage {
    /// Creates a filter from `width * height` transmissions, top row first. Each must be in 0..=1,
    /// because a filter cannot add light.
    pub fn new(
        width: u32,
        height: u32,
        size_m: [f64; 2],
        pixels: Vec<Rgb>,
    ) -> Result<Self, FilterError> {
        let found = pixels.len();
        let wrong = |reason| FilterError::Shape { width, height, size_m, found, reason };
        if width == 0 || height == 0 || found as u64 != u64::from(width) * u64::from(height) {
            return Err(wrong("give width times height values, at least one"));
        }
        if !size_m.iter().all(|s| s.is_finite() && *s > 0.0) {
            return Err(wrong("give a size above 0 m along both sides"));
        }
        if !pixels.iter().flatten().all(|v| (0.0..=1.0).contains(v)) {
            return Err(wrong("a transmission lies outside 0..=1"));
        }
        Ok(FilterImage { width, height, size_m, pixels })
    }

    /// Reads a PNG as a filter of width `width_m`. The height follows from the aspect ratio.
    /// Colours are multiplied by alpha, so transparent pixels are dark.
    pub fn from_png(path: &Path, width_m: f64) -> Result<Self, FilterError> {
        let png = read_png(path)?;
        let (width, height) = (png.width, png.height);
        let size_m = [width_m, width_m * f64::from(height) / f64::from(width.max(1))];
        let pixels = png.rgba()?.iter().map(|p| [p[0], p[1], p[2]]).collect();
        FilterImage::new(width, height, size_m, pixels)
    }

    /// Sides in the cut-off plane, in metres.
    pub fn size_m(&self) -> [f64; 2] {
        self.size_m
    }

    /// Number of pixels per row and of rows.
    pub fn size_px(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// The transmissions, top row first.
    pub fn pixels(&self) -> &[Rgb] {
        &self.pixels
    }

    pub(super) fn pixels_mut(&mut self) -> &mut [Rgb] {
        &mut self.pixels
    }

    /// Position of a point of the plane in pixels; (0, 0) is the upper left corner.
    pub fn pixel_from_plane(&self, at_m: PlaneVector) -> [f64; 2] {
        let [w, h] = [f64::from(self.width), f64::from(self.height)];
        [
            (f64::from(at_m[0]) / self.size_m[0] + 0.5) * w,
            (0.5 - f64::from(at_m[1]) / self.size_m[1]) * h,
        ]
    }

    /// Whether any pixel is not grey.
    pub fn is_colored(&self) -> bool {
        self.pixels.iter().any(|p| p[0] != p[1] || p[1] != p[2])
    }

    pub(super) fn transmission(&self, at_m: PlaneVector) -> Rgb {
        let [x, y] = self.pixel_from_plane(at_m);
        let clamp = |v: f64, n: u32| (v - 0.5).clamp(0.0, f64::from(n - 1));
        let (x, y) = (clamp(x, self.width), clamp(y, self.height));
        let (i, j) = (x.floor() as usize, y.floor() as usize);
        let (fx, fy) = ((x - i as f64) as f32, (y - j as f64) as f32);
        let (w, h) = (self.width as usize, self.height as usize);
        let at = |i: usize, j: usize| self.pixels[j.min(h - 1) * w + i.min(w - 1)];
        let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
        let (p, q, r, s) = (at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1));
        [0, 1, 2].map(|c| mix(mix(p[c], q[c], fx), mix(r[c], s[c], fx), fy))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_images_top_is_up_and_its_right_is_right() {
        let f = FilterImage::new(
            2,
            2,
            [2.0, 2.0],
            vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0; 3]],
        )
        .unwrap();
        assert_eq!(f.transmission([-0.5, 0.5]), [1.0, 0.0, 0.0]);
        assert_eq!(f.transmission([0.5, 0.5]), [0.0, 1.0, 0.0]);
        assert_eq!(f.transmission([-0.5, -0.5]), [0.0, 0.0, 1.0]);
        assert_eq!(f.transmission([0.0, 0.5]), [0.5, 0.5, 0.0], "bilinear");
        assert_eq!(f.transmission([-50.0, 50.0]), [1.0, 0.0, 0.0], "edge pixels go on");
    }

    #[test]
    fn light_cannot_be_added_and_nan_is_refused() {
        for bad in [1.5, -0.1, f32::NAN] {
            let error = FilterImage::new(1, 1, [1.0; 2], vec![[bad; 3]]).unwrap_err().to_string();
            assert!(error.contains("outside 0..=1"), "{error}");
        }
        assert!(FilterImage::new(0, 1, [1.0; 2], vec![]).is_err());
        assert!(FilterImage::new(1, 1, [0.0, 1.0], vec![[1.0; 3]]).is_err());
    }
}
