//! Measuring in pictures: where the outermost shock stands and at which angle, as with a ruler on a
//! photograph.
//!
//! A shock is a thin line in a schlieren picture, saturated more often than not: behind a customary
//! slit of 1 mm a shock of a tenth of a bar over a span of 10 cm bends light ten times farther than
//! from black to white. Then there is no brightest or darkest pixel but a band of them, as wide as
//! the shock is strong, and the place to look at is its outer edge, where brightness changes most
//! ([`Mark::Edge`]). A shock that is drawn over several pixels and does not saturate stands where
//! its band is strongest ([`Mark::Band`]). Either way the search goes along rows or columns from
//! the undisturbed stream inwards, takes the first place whose mark is at least half the largest of
//! its line (four fifths for bands, whose flanks are long), and in it the centre, to parts of a
//! pixel.

use crate::film::Framing;
use crate::render::RenderOutput;
use rt_core::math::median_high;

/// A picture to measure in.
#[derive(Debug, Clone)]
pub struct Photograph {
    /// Where its pixels lie in the test section.
    pub framing: Framing,
    /// Row by row from the top.
    pub brightness: Vec<f32>,
    /// Whether light comes through at all there: edges of bodies are no shocks.
    pub lit: Vec<bool>,
}

/// Where lines of search begin. They run to the opposite side, a row or column of pixels each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum From {
    /// Along rows, to the right.
    Left,
    /// Along columns, downwards.
    Top,
}

/// What of a line in the picture counts as its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mark {
    /// Where brightness changes most from pixel to pixel.
    Edge,
    /// Where brightness is farthest from that of the undisturbed stream.
    Band {
        /// The undisturbed stream's: 0.5 behind a half-open knife.
        undisturbed: f32,
    },
}

/// A straight line through points, fitted against outliers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// From the picture's right, counter-clockwise, -90 to 90 degrees.
    pub angle_rad: f64,
    /// The middle of the points that it was fitted to, along right and up.
    pub through_m: [f64; 2],
    /// Root mean square distance of those points.
    pub rms_m: f64,
    /// Points that it was fitted to.
    pub points: usize,
    /// Points that were left out.
    pub outliers: usize,
}

impl Photograph {
    /// Of a picture that was rendered with [`crate::render::Layers::map`], which tells bodies from
    /// dark shocks. `None` without.
    pub fn of(rendered: &RenderOutput) -> Option<Photograph> {
        let map = rendered.map.as_ref()?;
        Some(Photograph {
            framing: rendered.framing,
            brightness: rendered.pixels.iter().map(|p| (p[0] + p[1] + p[2]) / 3.0).collect(),
            lit: map.transmission.iter().map(|t| *t > 0.5).collect(),
        })
    }

    /// The outermost strong mark on each line of search, at most one point a line, along right and
    /// up in metres. Pixels that are `margin_px` or less from a dark one along that line do not
    /// count, nor do lines whose largest mark is below `least`.
    pub fn fronts_m(&self, from: From, mark: Mark, least: f32, margin_px: usize) -> Vec<[f64; 2]> {
        let [width, height] = [self.framing.width as usize, self.framing.height as usize];
        let [lines, length] = if from == From::Left { [height, width] } else { [width, height] };
        let pixel = |line: usize, i: usize| {
            if from == From::Left { i + line * width } else { line + i * width }
        };
        let near_dark = |line: usize, i: usize| {
            (i.saturating_sub(margin_px)..(i + margin_px + 1).min(length))
                .any(|k| !self.lit[pixel(line, k)])
        };
        // Edges lie between pixels, bands in their centres.
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
            let [x, y] = if from == From::Left { [along, across] } else { [across, along] };
            points.push(self.framing.plane_from_pixel(x, y));
        }
        points
    }
}

/// The line through points of which up to a quarter or so may be anything: the median of all pairs'
/// slopes (Theil 1950, Sen 1968), then least squares of distances over the points within three
/// robust standard deviations of that. `None` for fewer than three points.
pub fn fitted_line(points_m: &[[f64; 2]]) -> Option<Line> {
    if points_m.len() < 3 {
        return None;
    }
    // Slopes against the axis along which the points are spread: between their quartiles, which no
    // outliers reach.
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
    // 1.4826: standard deviation of a normal distribution over its median deviation.
    let reach = 3.0 * 1.4826 * median_high(&mut points_m.iter().map(off).collect::<Vec<_>>())?;
    let kept: Vec<&[f64; 2]> = points_m.iter().filter(|p| off(p) <= reach).collect();
    let n = kept.len() as f64;
    let mean = [0, 1].map(|c| kept.iter().map(|p| p[c]).sum::<f64>() / n);
    let moment = |c: usize, d: usize| {
        kept.iter().map(|p| (p[c] - mean[c]) * (p[d] - mean[d])).sum::<f64>() / n
    };
    let [xx, xy, yy] = [moment(0, 0), moment(0, 1), moment(1, 1)];
    // The direction of the larger principal axis, and the variance along the smaller.
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
        let points = p.fronts_m(From::Top, Mark::Edge, 0.1, 2);
        assert_eq!(points.len(), 60);
        let line = fitted_line(&points).unwrap();
        assert!((line.angle_rad.tan() + 0.5).abs() < 0.01 && line.outliers < 3, "{line:?}");
        for (i, [x, y]) in points.iter().enumerate() {
            let [x0, y0] = framing.plane_from_pixel(i as f64 + 0.5, edge(i));
            assert!((x - x0).abs() < 1e-12 && (y - y0).abs() < 0.5e-3, "{i}: {y} {y0}");
        }
        // Its middle is two and a half pixels further in.
        let band = p.fronts_m(From::Top, Mark::Band { undisturbed: 0.5 }, 0.1, 2);
        for (edge, middle) in points.iter().zip(&band) {
            assert!((edge[1] - middle[1] - 2.5e-3).abs() < 0.6e-3, "{edge:?} {middle:?}");
        }
        // Nothing to see.
        assert!(p.fronts_m(From::Top, Mark::Edge, 0.4, 2).is_empty());
        // From the left the band is met as well where it comes in from there.
        assert!(p.fronts_m(From::Left, Mark::Edge, 0.1, 2).len() > 25);
    }
}
