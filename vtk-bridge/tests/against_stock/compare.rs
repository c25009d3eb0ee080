//! Compares two images of the same script: how much they differ, and how much is allowed.
//!
//! Near edges they may disagree by a pixel, because VTK's rasterizer rounds corners to 1/256 of a
//! pixel and rays do not. Colours and depths are therefore compared away from edges, and edges by
//! the silhouette.

use crate::capture::Capture;
use std::fmt;

/// Limits of the comparison. [`Limits::STRICT`] unless a script has a reason for others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Limits {
    /// Fraction of the pixels where only one of the images shows a surface.
    pub(crate) silhouette: f64,
    /// Limit in ulps of the window depth, away from edges, for all but [`ROUNDED`] of these pixels.
    pub(crate) depth_ulp: u32,
    /// Fraction of the pixels that may differ by more than [`ROUNDING_ULP`].
    pub(crate) depth_strays: f64,
    /// Mean difference of colours, of 255, over the pixels where either image shows something.
    pub(crate) color_mean: f64,
    /// Fraction of the pixels away from edges whose colour may differ by more than 16 of 255. This
    /// limit finds a small object in a wrong colour.
    pub(crate) color_strays: f64,
}

impl Limits {
    /// The limits for the bridge.
    pub(crate) const STRICT: Limits = Limits {
        silhouette: 0.0002,
        depth_ulp: 4,
        depth_strays: 0.0005,
        color_mean: 0.5,
        color_strays: 0.0005,
    };
}

/// Possible error of OpenGL's own depths: llvmpipe interpolates in f32. The measured error is up to
/// 22 ulps from the plane through a triangle's corners, and largest where a triangle covers many
/// pixels. Ours are exact: see `our_window_depth_is_exact_where_opengl_rounds`.
const ROUNDING_ULP: u32 = 32;
/// Fraction of the pixels away from edges where OpenGL may have this error.
const ROUNDED: f64 = 0.1;

/// Measured differences.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Measured {
    pub(crate) pixels: usize,
    pub(crate) silhouette: usize,
    /// Pixels away from edges with a surface.
    pub(crate) inner: usize,
    pub(crate) depth_beyond: usize,
    pub(crate) depth_far: usize,
    pub(crate) depth_median_ulp: u32,
    pub(crate) depth_p99_ulp: u32,
    pub(crate) depth_worst_ulp: u32,
    pub(crate) color_mean: f64,
    pub(crate) color_strays: usize,
    pub(crate) color_worst: u8,
}

impl fmt::Display for Measured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let part = |n: usize| 100.0 * n as f64 / self.pixels as f64;
        write!(
            f,
            "silhouette {} px ({:.4} %), depth median {} p99 {} worst {} ulp ({} beyond the limit, \
             {} far beyond), colour mean {:.3} worst {} ({} far off), {} of {} px away from edges",
            self.silhouette,
            part(self.silhouette),
            self.depth_median_ulp,
            self.depth_p99_ulp,
            self.depth_worst_ulp,
            self.depth_beyond,
            self.depth_far,
            self.color_mean,
            self.color_worst,
            self.color_strays,
            self.inner,
            self.pixels
        )
    }
}

/// Largest change of the depth's slope between neighbours on one surface; a larger change is an
/// edge. About one thousandth of the depth range per pixel squared.
const BEND: f32 = 1e-3;

/// Marks pixels whose 3 by 3 neighbourhood lies on one surface in both images, or shows background
/// in both.
fn away_from_edges(a: &Capture, b: &Capture) -> Vec<bool> {
    let (w, h) = (a.width, a.height);
    let mut inner = vec![false; w * h];
    let shows = |c: &Capture, i: usize| c.depth[i] < 1.0;
    for y in 1..h.saturating_sub(1) {
        for x in 1..w.saturating_sub(1) {
            let at = y * w + x;
            let around = (y - 1..=y + 1).flat_map(|v| (x - 1..=x + 1).map(move |u| v * w + u));
            let same = around
                .into_iter()
                .all(|i| shows(a, i) == shows(a, at) && shows(b, i) == shows(a, at));
            let bends = |c: &Capture| {
                let d = |i: usize| c.depth[i];
                // Horizontally, vertically, and along both diagonals.
                [1, w, w + 1, w - 1]
                    .iter()
                    .any(|&s| (d(at + s) - 2.0 * d(at) + d(at - s)).abs() > BEND)
            };
            inner[at] = same && !bends(a) && !bends(b);
        }
    }
    inner
}

/// Distance in ulps; both are positive.
fn ulps(a: f32, b: f32) -> u32 {
    a.to_bits().abs_diff(b.to_bits())
}

/// Measures the difference between `ours` and `stock`. An error when they cannot be compared.
pub(crate) fn measure(
    stock: &Capture,
    ours: &Capture,
    limits: &Limits,
) -> Result<Measured, String> {
    if (stock.width, stock.height) != (ours.width, ours.height) {
        return Err(format!(
            "{} x {} pixels against {} x {}",
            stock.width, stock.height, ours.width, ours.height
        ));
    }
    let pixels = stock.width * stock.height;
    let mut m = Measured { pixels, ..Measured::default() };
    let has_depth = stock.depth.len() == pixels && ours.depth.len() == pixels;
    let inner = if has_depth { away_from_edges(stock, ours) } else { vec![true; pixels] };
    let mut depths = Vec::new();
    // The pixel at the corner is background in every script.
    let background = stock.rgb[pixels - 1];
    let (mut sum, mut shown) = (0.0, 0usize);
    for i in 0..pixels {
        if has_depth {
            m.silhouette += usize::from((stock.depth[i] < 1.0) != (ours.depth[i] < 1.0));
            if inner[i] && stock.depth[i] < 1.0 {
                depths.push(ulps(stock.depth[i], ours.depth[i]));
            }
        }
        let off = (0..3).map(|c| stock.rgb[i][c].abs_diff(ours.rgb[i][c]));
        if stock.rgb[i] != background || ours.rgb[i] != background {
            sum += off.clone().map(f64::from).sum::<f64>() / 3.0;
            shown += 1;
        }
        if inner[i] {
            let worst = off.max().unwrap_or(0);
            m.color_worst = m.color_worst.max(worst);
            m.color_strays += usize::from(worst > 16);
        }
    }
    m.color_mean = sum / shown.max(1) as f64;
    m.inner = depths.len();
    m.depth_beyond = depths.iter().filter(|&&d| d > limits.depth_ulp).count();
    m.depth_far = depths.iter().filter(|&&d| d > ROUNDING_ULP.max(limits.depth_ulp)).count();
    depths.sort_unstable();
    if let Some(&worst) = depths.last() {
        m.depth_median_ulp = depths[depths.len() / 2];
        m.depth_p99_ulp = depths[depths.len() * 99 / 100];
        m.depth_worst_ulp = worst;
    }
    Ok(m)
}

/// The limits that are exceeded, one line each; empty when there are none.
pub(crate) fn faults(stock: &Capture, ours: &Capture, limits: &Limits) -> Vec<String> {
    let m = match measure(stock, ours, limits) {
        Ok(m) => m,
        Err(fault) => return vec![fault],
    };
    let mut faults = Vec::new();
    let part = |n: usize| n as f64 / m.pixels as f64;
    if part(m.silhouette) > limits.silhouette {
        faults.push(format!("silhouette beyond {} %", 100.0 * limits.silhouette));
    }
    if m.depth_beyond as f64 > ROUNDED * m.inner as f64 {
        faults.push(format!(
            "depth beyond {} ulp in more than {} % away from edges",
            limits.depth_ulp,
            100.0 * ROUNDED
        ));
    }
    if part(m.depth_far) > limits.depth_strays {
        faults.push(format!(
            "depth beyond {ROUNDING_ULP} ulp in more than {} %",
            100.0 * limits.depth_strays
        ));
    }
    if m.color_mean > limits.color_mean {
        faults.push(format!("colour mean beyond {}", limits.color_mean));
    }
    if part(m.color_strays) > limits.color_strays {
        faults.push(format!("colours far off in more than {} %", 100.0 * limits.color_strays));
    }
    if stock.facts != ours.facts {
        faults.push(format!(
            "facts (picks, selections, counts) differ:\n  {}\n  {}",
            stock.facts, ours.facts
        ));
    }
    if !faults.is_empty() {
        faults.push(m.to_string());
    }
    faults
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// A slanted disk in front of a background.
    fn disk() -> Capture {
        let (width, height) = (120, 100);
        let (mut rgb, mut depth) = (vec![[30, 40, 50]; width * height], vec![1.0; width * height]);
        for y in 0..height {
            for x in 0..width {
                let (u, v) = (x as f32 - 60.0, y as f32 - 50.0);
                if u * u + v * v < 900.0 {
                    rgb[y * width + x] = [200, 100 + (x / 2) as u8, 50];
                    depth[y * width + x] = 0.9 + 1e-4 * u + 3e-5 * v;
                }
            }
        }
        Capture { width, height, rgb, depth, facts: json!({"picks": [1, 2]}), report: None }
    }

    fn change(edit: impl FnOnce(&mut Capture)) -> Vec<String> {
        let (stock, mut ours) = (disk(), disk());
        edit(&mut ours);
        faults(&stock, &ours, &Limits::STRICT)
    }

    #[test]
    fn an_image_passes_against_itself() {
        assert_eq!(change(|_| ()), Vec::<String>::new());
    }

    #[test]
    fn planted_faults_are_noticed() {
        let shifted = |c: &mut Capture| {
            c.rgb.rotate_right(1);
            c.depth.rotate_right(1);
        };
        let found = change(shifted).join("; ");
        assert!(
            found.contains("silhouette") && found.contains("depth"),
            "shifted by a pixel: {found}"
        );
        let found = change(|c| c.depth.iter_mut().filter(|d| **d < 1.0).for_each(|d| *d += 4e-7))
            .join("; ");
        assert!(
            found.contains("depth beyond 4 ulp") && !found.contains("silhouette beyond"),
            "{found}"
        );
        let found =
            change(|c| c.rgb.iter_mut().filter(|p| p[0] == 200).for_each(|p| p[0] += 2)).join("; ");
        assert!(found.contains("colour mean"), "{found}");
        let found =
            change(|c| (0..9).for_each(|i| c.rgb[50 * 120 + 56 + i] = [9, 9, 200])).join("; ");
        assert!(
            found.contains("far off") && !found.contains("silhouette beyond"),
            "nine pixels: {found}"
        );
        let found = change(|c| c.facts = json!({"picks": [1, 3]})).join("; ");
        assert!(found.contains("picks"), "{found}");
        let found = change(|c| c.width = 60).join("; ");
        assert!(found.contains("pixels against"), "{found}");
    }
}
