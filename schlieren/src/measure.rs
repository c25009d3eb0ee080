//! Measures the position and angle of the outermost shock in an image, like a ruler on a
//! photograph.
//!
//! A shock is a thin line in a schlieren image, and it is usually saturated. With the default slit
//! of 1 mm, a shock of a tenth of a bar over a span of 10 cm bends light ten times farther than the
//! range from black to white. A saturated shock has a band of brightest or darkest pixels, and the
//! stronger the shock the wider the band. Its position is the outer edge of the band, where the
//! brightness changes most ([`Mark::Edge`]). A shock that covers several pixels without saturating
//! is located where its band is strongest ([`Mark::Band`]).
//!
//! The search follows rows or columns from the undisturbed stream inwards. It takes the first run
//! of pixels whose mark is at least half the largest on the line (four fifths for bands, whose
//! flanks are long), and returns the centre of that run with subpixel accuracy.

use crate::film::Framing;
use crate::render::RenderOutput;
use rt_core::math::median_high;

/// An image to measure in.
#[derive(Debug, Clone)]
pub struct Photograph {
    /// The pixels' positions in the test section.
    pub framing: Framing,
    /// Brightness of the pixels, row by row from the top.
    pub brightness: Vec<f32>,
    /// Whether light reaches a pixel. This distinguishes the edges of bodies from shocks.
    pub lit: Vec<bool>,
}

/// Where search lines begin. Each runs along a row or column of pixels to the opposite side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SearchFrom {
    /// Along rows, to the right.
    Left,
    /// Along columns, downwards.
    Top,
}

/// The feature that defines the position of a line in the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mark {
    /// The position where brightness changes most from pixel to pixel.
    Edge,
    /// The position where brightness differs most from that of the undisturbed stream.
    Band {
        /// Brightness of the undisturbed stream: 0.5 behind a half-open knife.
        undisturbed: f32,
    },
}

/// A straight line through points, by a fit that is robust against outliers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Angle counter-clockwise from the image's right, from -90 to 90 degrees.
    pub angle_rad: f64,
    /// Mean of the fitted points, along right and up.
    pub through_m: [f64; 2],
    /// Root mean square distance of the fitted points from the line.
    pub rms_m: f64,
    /// Number of fitted points.
    pub points: usize,
    /// Number of points that the fit rejected.
    pub outliers: usize,
}

impl Photograph {
    /// Converts an image rendered with [`crate::render::Layers::map`], which distinguishes bodies
    /// from dark shocks. `None` if the map was not rendered.
    pub fn from_render(rendered: &RenderOutput) -> Option<Photograph> {
        let map = rendered.map.as_ref()?;
        Some(Photograph {
            framing: rendered.framing,
            brightness: rendered.pixels.iter().map(|p| (p[0] + p[1] + p[2]) / 3.0).collect(),
            lit: map.transmission.iter().map(|t| *t > 0.5).collect(),
        })
    }

    /// The outermost strong mark on each search line, at most one point per line, along right and
    /// up in metres. Pixels within `margin_px` of a dark pixel on the line are ignored. So are
    /// lines whose largest mark is below `least`.
    pub fn fronts_m(
        &self,
        from: SearchFrom,
        mark: Mark,
        least: f32,
        margin_px: usize,
    ) -> Vec<[f64; 2]> {
        let [width, height] = [self.framing.width as usize, self.framing.height as usize];
        let [lines, length] =
            if from == SearchFrom::Left { [height, width] } else { [width, height] };
        let pixel = |line: usize, i: usize| {
            if from == SearchFrom::Left { i + line * width } else { line + i * width }
        };
        let near_dark = |line: usize, i: usize| {
            (i.saturating_sub(margin_px)..(i + margin_px + 1).min(length))
                .any(|k| !self.lit[pixel(line, k)])
        };
        // Edges lie between pixels, bands at pixel centres.
        let (count, offset, share) = if mark == Mark::Edge {
            (length.saturating_sub(1), 1.0, 0.5)
        } else {
            (length, 0.5, 0.8)
        };
        let mut points = Vec::new();
        for line in 0..lines {
            let strength = |i: usize| {
                let here = self.brightness[pixel(line, i)];
                let (other, hidden) = match mark {
                    Mark::Edge => (self.brightness[pixel(line, i + 1)], near_dark(line, i + 1)),
                    Mark::Band { undisturbed } => (undisturbed, false),
                };
                if hidden || near_dark(line, i) { 0.0 } else { (here - other).abs() }
            };
            let marks: Vec<f32> = (0..count).map(strength).collect();
            let largest = marks.iter().fold(0.0f32, |m, d| m.max(*d));
            if largest < least.max(f32::MIN_POSITIVE) {
                continue;
            }
            let strong = |d: &f32| *d >= share * largest;
            let Some(first) = marks.iter().position(strong) else { continue };
            let run = marks[first..].iter().take_while(|d| strong(d)).enumerate();
            let (sum, moment) = run.fold((0.0, 0.0), |(s, m), (i, d)| {
                (s + f64::from(*d), m + f64::from(*d) * ((first + i) as f64 + offset))
            });
            let (along, across) = (moment / sum, line as f64 + 0.5);
            let [x, y] = if from == SearchFrom::Left { [along, across] } else { [across, along] };
            points.push(self.framing.plane_from_pixel(x, y));
        }
        points
    }
}

/// Fits a line to points of which about a quarter may be outliers. The slope is the median over all
/// pairs (Theil 1950, Sen 1968). A least-squares fit of distances then uses the points within three
/// robust standard deviations of that line. `None` for fewer than three points.
pub fn fitted_line(points_m: &[[f64; 2]]) -> Option<Line> {
    if points_m.len() < 3 {
        return None;
    }
    // Slopes are relative to the axis along which the points spread most. The spread is the
    // interquartile range, which outliers do not affect.
    let spread = |c: usize| {
        let mut v: Vec<f64> = points_m.iter().map(|p| p[c]).collect();
        v.sort_unstable_by(f64::total_cmp);
        v[3 * v.len() / 4] - v[v.len() / 4]
    };
    let a = usize::from(spread(1) > spread(0));
    let b = 1 - a;
    let mut slopes = Vec::with_capacity(points_m.len() * points_m.len() / 2);
    for (i, p) in points_m.iter().enumerate() {
        slopes.extend(
            points_m[..i].iter().filter(|q| q[a] != p[a]).map(|q| (p[b] - q[b]) / (p[a] - q[a])),
        );
    }
    let slope = median_high(&mut slopes)?;
    let offset = |p: &[f64; 2]| p[b] - slope * p[a];
    let middle = median_high(&mut points_m.iter().map(offset).collect::<Vec<_>>())?;
    let off = |p: &[f64; 2]| (offset(p) - middle).abs();
    // 1.4826 is the ratio of standard deviation to median absolute deviation of a normal
    // distribution.
    let reach = 3.0 * 1.4826 * median_high(&mut points_m.iter().map(off).collect::<Vec<_>>())?;
    let kept: Vec<&[f64; 2]> = points_m.iter().filter(|p| off(p) <= reach).collect();
    let n = kept.len() as f64;
    let mean = [0, 1].map(|c| kept.iter().map(|p| p[c]).sum::<f64>() / n);
    let moment = |c: usize, d: usize| {
        kept.iter().map(|p| (p[c] - mean[c]) * (p[d] - mean[d])).sum::<f64>() / n
    };
    let [xx, xy, yy] = [moment(0, 0), moment(0, 1), moment(1, 1)];
    // The direction of the major principal axis, and the variance along the minor one.
    let angle_rad = 0.5 * (2.0 * xy).atan2(xx - yy);
    let across = 0.5 * (xx + yy) - (0.25 * (xx - yy).powi(2) + xy * xy).sqrt();
    Some(Line {
        angle_rad,
        through_m: mean,
        rms_m: across.max(0.0).sqrt(),
        points: kept.len(),
        outliers: points_m.len() - kept.len(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_found_among_outliers_at_any_angle() {
        for degrees in [-80.0f64, -37.0, 0.0, 12.0, 44.0, 46.0, 89.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let mut points: Vec<[f64; 2]> = (0..100)
                .map(|i| {
                    let (s, wiggle) = (f64::from(i) * 1e-3, 1e-5 * f64::from(i % 7 - 3));
                    [0.2 + s * cos - wiggle * sin, -0.1 + s * sin + wiggle * cos]
                })
                .collect();
            points.extend(
                (0..20).map(|i| [0.2 + 4e-3 * f64::from(i), 0.3 - 1e-3 * f64::from(i * i % 31)]),
            );
            let line = fitted_line(&points).unwrap();
            assert!((line.angle_rad.to_degrees() - degrees).abs() < 0.05, "{degrees}: {line:?}");
            assert!((80..=104).contains(&line.points) && line.rms_m < 3e-5, "{degrees}: {line:?}");
        }
        assert!(fitted_line(&[[0.0; 2]; 2]).is_none() && fitted_line(&[[0.0; 2]; 5]).is_none());
    }

    #[test]
    fn a_band_is_found_by_its_outer_edge_and_a_body_is_none() {
        // A bright band 5 pixels wide that climbs 1 in 2, and below it a dark body whose edge is
        // stronger.
        let framing = Framing { width: 60, height: 50, pixel_m: 1e-3, center_m: [0.1, 0.2] };
        let edge = |i: usize| 10.0 + 0.5 * (i as f64 + 0.5);
        let mut p = Photograph { framing, brightness: vec![], lit: vec![] };
        for j in 0..50 {
            for i in 0..60 {
                let covered = (j as f64 + 1.0 - edge(i)).clamp(0.0, 1.0)
                    - (j as f64 - 4.0 - edge(i)).clamp(0.0, 1.0);
                let body = j as f64 > edge(i) + 12.0;
                p.brightness.push(if body { 0.0 } else { 0.5 + 0.3 * covered as f32 });
                p.lit.push(!body);
            }
        }
        let points = p.fronts_m(SearchFrom::Top, Mark::Edge, 0.1, 2);
        assert_eq!(points.len(), 60);
        let line = fitted_line(&points).unwrap();
        assert!((line.angle_rad.tan() + 0.5).abs() < 0.01 && line.outliers < 3, "{line:?}");
        for (i, [x, y]) in points.iter().enumerate() {
            let [x0, y0] = framing.plane_from_pixel(i as f64 + 0.5, edge(i));
            assert!((x - x0).abs() < 1e-12 && (y - y0).abs() < 0.5e-3, "{i}: {y} {y0}");
        }
        // The middle of the band is two and a half pixels further in.
        let band = p.fronts_m(SearchFrom::Top, Mark::Band { undisturbed: 0.5 }, 0.1, 2);
        for (edge, middle) in points.iter().zip(&band) {
            assert!((edge[1] - middle[1] - 2.5e-3).abs() < 0.6e-3, "{edge:?} {middle:?}");
        }
        // No mark is strong enough.
        assert!(p.fronts_m(SearchFrom::Top, Mark::Edge, 0.4, 2).is_empty());
        // Search lines from the left find the band as well.
        assert!(p.fronts_m(SearchFrom::Left, Mark::Edge, 0.1, 2).len() > 25);
    }
}
