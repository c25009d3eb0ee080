//! Filters painted by hand: strokes of a round brush on a ground colour (dissertation, section
//! 5.6).
//!
//! Strokes are stored in metres of the cut-off plane. A painted filter is therefore a few lines of
//! a scene file, and it can be rasterized at any resolution.

use super::{FilterError, FilterImage, Rgb};
use serde::{Deserialize, Serialize};

/// A straight stroke of a round brush. A stroke of length 0 is a dab.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stroke {
    /// Start, in metres along right and up.
    pub from_m: [f64; 2],
    /// End, in metres along right and up.
    pub to_m: [f64; 2],
    /// Radius of the brush.
    pub radius_m: f64,
    /// Linear transmission, each 0..=1.
    pub rgb: Rgb,
}

/// A ground colour and strokes. Later strokes cover earlier ones.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Painting {
    /// Sides in the cut-off plane.
    pub size_m: [f64; 2],
    /// Number of pixels along the longer side.
    #[serde(default = "default_pixels")]
    pub pixels: u32,
    /// Linear transmission where nothing is painted.
    pub ground_rgb: Rgb,
    /// Strokes in the order of painting.
    #[serde(default)]
    pub strokes: Vec<Stroke>,
}

fn default_pixels() -> u32 {
    512
}

/// Largest number of pixels along a side.
const MAX_PIXELS: u32 = 8192;

impl Painting {
    /// Rasterizes the filter. The rim of a brush is antialiased over one pixel.
    pub fn to_filter(&self) -> Result<FilterImage, FilterError> {
        let longest = self.size_m[0].max(self.size_m[1]);
        let pixels = f64::from(self.pixels.min(MAX_PIXELS));
        let [width, height] = self.size_m.map(|s| (pixels * s / longest).round().max(1.0) as u32);
        let ground = vec![self.ground_rgb; width as usize * height as usize];
        let mut filter = FilterImage::new(width, height, self.size_m, ground)?;
        for stroke in &self.strokes {
            paint(&mut filter, stroke);
        }
        // Validate again, because strokes come from files and from the interactive page.
        FilterImage::new(width, height, self.size_m, filter.pixels().to_vec())
    }
}

/// Draws one stroke into a filter.
fn paint(filter: &mut FilterImage, stroke: &Stroke) {
    let [width, height] = filter.size_px();
    let size = filter.size_m();
    let pixel_m = size[0] / f64::from(width);
    let [a, b] = [stroke.from_m, stroke.to_m];
    let along = [b[0] - a[0], b[1] - a[1]];
    let length2 = along[0] * along[0] + along[1] * along[1];

    // Visit only the pixels that the brush and its rim can reach, because paintings have thousands
    // of small strokes.
    let reach = stroke.radius_m + pixel_m;
    let rows = [a[1].max(b[1]) + reach, a[1].min(b[1]) - reach]
        .map(|y| (0.5 - y / size[1]) * f64::from(height));
    let columns = [a[0].min(b[0]) - reach, a[0].max(b[0]) + reach]
        .map(|x| (0.5 + x / size[0]) * f64::from(width));
    // Casts saturate, so coordinates outside the filter become its border.
    let [top, left] = [rows[0], columns[0]].map(|v| v.floor() as u32);
    let [bottom, right] = [rows[1], columns[1]].map(|v| v.ceil() as u32);
    for j in top..bottom.min(height) {
        let y = (0.5 - (f64::from(j) + 0.5) / f64::from(height)) * size[1];
        for i in left..right.min(width) {
            let x = ((f64::from(i) + 0.5) / f64::from(width) - 0.5) * size[0];
            // Distance to the stroke's segment. A dab has no direction.
            let t = ((x - a[0]) * along[0] + (y - a[1]) * along[1]) / length2;
            let t = if t.is_finite() { t.clamp(0.0, 1.0) } else { 0.0 };
            let distance = (x - a[0] - t * along[0]).hypot(y - a[1] - t * along[1]);
            let cover = (0.5 + (stroke.radius_m - distance) / pixel_m).clamp(0.0, 1.0) as f32;
            if cover > 0.0 {
                let pixel = &mut filter.pixels_mut()[j as usize * width as usize + i as usize];
                *pixel = [0, 1, 2].map(|c| pixel[c] + cover * (stroke.rgb[c] - pixel[c]));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutoff::{Cutoff, CutoffPlane};
    use crate::optics::SourceImage;

    fn painting(strokes: Vec<Stroke>) -> Painting {
        Painting { size_m: [4e-3, 2e-3], pixels: 256, ground_rgb: [0.0; 3], strokes }
    }

    #[test]
    fn later_strokes_cover_earlier_ones_where_they_are() {
        let red = Stroke {
            from_m: [-1e-3, 0.0],
            to_m: [1e-3, 0.0],
            radius_m: 2e-4,
            rgb: [1.0, 0.0, 0.0],
        };
        let dab = Stroke {
            from_m: [5e-4, 5e-4],
            to_m: [5e-4, 5e-4],
            radius_m: 4e-4,
            rgb: [0.0, 0.0, 1.0],
        };
        let filter = Cutoff::Image(painting(vec![red, dab]).to_filter().unwrap());
        assert!(filter.is_colored());
        let filter = CutoffPlane::new(&filter, SourceImage::Point);
        assert_eq!(filter.transmission([-9e-4, 0.0]), [1.0, 0.0, 0.0]);
        assert_eq!(filter.transmission([5e-4, 6e-4]), [0.0, 0.0, 1.0]);
        assert_eq!(
            filter.transmission([5e-4, 1.5e-4]),
            [0.0, 0.0, 1.0],
            "the dab lies over the line"
        );
        assert_eq!(filter.transmission([0.0, -6e-4]), [0.0; 3], "ground");
    }

    #[test]
    fn a_painting_keeps_its_sides_and_refuses_glowing_paint() {
        let filter = painting(vec![]).to_filter().unwrap();
        assert_eq!(filter.size_px(), [256, 128]);
        let glow =
            Stroke { from_m: [0.0; 2], to_m: [0.0; 2], radius_m: 1e-3, rgb: [2.0, 0.0, 0.0] };
        assert!(painting(vec![glow]).to_filter().is_err());
    }
}
