//! Measures how far a traced image is from a rasterized one. A single number misses some errors (a
//! shift by a pixel, a hole, a tint), so there are four, each with a limit that two valid
//! rasterizers satisfy.

use super::Picture;

/// Differences of two images.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Metrics {
    /// Percentage of pixels with a channel off by more than 8.
    pub(crate) raw: f64,
    /// The same when each pixel is compared with the best of its 3 x 3 neighbours, in both
    /// directions.
    pub(crate) tolerant: f64,
    /// Mean difference where both images are smooth.
    pub(crate) interior: f64,
    /// 99th percentile of that difference.
    pub interior_p99: f64,
    /// Overlap of the pixels that are not background.
    pub(crate) overlap: f64,
}

fn off(a: [u8; 3], b: [u8; 3]) -> i32 {
    (0..3).map(|k| (i32::from(a[k]) - i32::from(b[k])).abs()).max().unwrap_or(0)
}

fn neighbours(p: &Picture, x: usize, y: usize) -> impl Iterator<Item = [u8; 3]> + '_ {
    (0..9).map(move |k| {
        let at = |c: usize, d: usize, n: usize| (c + d).saturating_sub(1).min(n - 1);
        p.pixels[at(y, k / 3, p.height) * p.width + at(x, k % 3, p.width)]
    })
}

fn contrast(p: &Picture, x: usize, y: usize) -> i32 {
    let (mut lo, mut hi) = ([255; 3], [0; 3]);
    for n in neighbours(p, x, y) {
        for k in 0..3 {
            lo[k] = lo[k].min(i32::from(n[k]));
            hi[k] = hi[k].max(i32::from(n[k]));
        }
    }
    (0..3).map(|k| hi[k] - lo[k]).max().unwrap_or(0)
}

/// Compares images of the same size; `counts` selects the pixels.
pub(crate) fn compare_where(
    a: &Picture,
    b: &Picture,
    counts: impl Fn(usize, usize) -> bool,
) -> Metrics {
    assert_eq!((a.width, a.height), (b.width, b.height), "sizes of the pictures");
    let (mut n, mut raw, mut tolerant, mut both, mut either) = (0, 0, 0, 0, 0);
    let mut interior = Vec::new();
    for y in 0..a.height {
        for x in 0..a.width {
            if !counts(x, y) {
                continue;
            }
            let i = y * a.width + x;
            let (p, q) = (a.pixels[i], b.pixels[i]);
            let d = off(p, q);
            n += 1;
            raw += usize::from(d > 8);
            if d > 8 {
                let one = neighbours(a, x, y).map(|v| off(v, q)).min().unwrap_or(0);
                let two = neighbours(b, x, y).map(|v| off(v, p)).min().unwrap_or(0);
                tolerant += usize::from(one.max(two) > 8);
            }
            let (fa, fb) = (off(p, a.pixels[0]) > 2, off(q, b.pixels[0]) > 2);
            both += usize::from(fa && fb);
            either += usize::from(fa || fb);
            if (fa || fb) && contrast(a, x, y).min(contrast(b, x, y)) <= 16 {
                interior.push(d);
            }
        }
    }
    interior.sort_unstable();
    let percent = |v: usize| 100.0 * v as f64 / n.max(1) as f64;
    Metrics {
        raw: percent(raw),
        tolerant: percent(tolerant),
        interior: interior.iter().map(|v| f64::from(*v)).sum::<f64>()
            / interior.len().max(1) as f64,
        interior_p99: interior.get(interior.len() * 99 / 100).map_or(0.0, |v| f64::from(*v)),
        overlap: if either == 0 { 1.0 } else { both as f64 / either as f64 },
    }
}

/// Compares all pixels.
pub(crate) fn compare(a: &Picture, b: &Picture) -> Metrics {
    compare_where(a, b, |_, _| true)
}

/// Describes pixels that no difference between two rasterizers explains. Where an edge passes near
/// the middle of a pixel, one rasterizer may draw what the other draws in the next pixel. Both
/// colours must therefore occur among the neighbours in the other image, which is not true for a
/// lost or added triangle, and the differences may form a line but not an area.
pub(crate) fn wrong_beyond_edges(native: &Picture, ours: &Picture) -> Vec<String> {
    const LEVELS: i32 = 8;
    let mut out = Vec::new();
    let (w, h) = (native.width, native.height);
    let is_off =
        |x: usize, y: usize| off(native.pixels[y * w + x], ours.pixels[y * w + x]) > LEVELS;
    for y in 0..h {
        for x in (0..w).filter(|x| is_off(*x, y)) {
            let (p, q) = (native.pixels[y * w + x], ours.pixels[y * w + x]);
            let is_near = |all: &Picture, one| neighbours(all, x, y).any(|v| off(v, one) <= LEVELS);
            if !is_near(ours, p) {
                out.push(format!(
                    "({x}, {y}): the driver's {p:?} is nowhere around, ours is {q:?}"
                ));
            } else if !is_near(native, q) {
                out.push(format!(
                    "({x}, {y}): {q:?} is nowhere around in the driver's picture, {p:?}"
                ));
            } else if x + 1 < w
                && y + 1 < h
                && is_off(x + 1, y)
                && is_off(x, y + 1)
                && is_off(x + 1, y + 1)
            {
                out.push(format!("({x}, {y}) and the pixels beside and above it: an area differs"));
            }
        }
    }
    out
}

/// The same for depths in rows of `w`: at edges, depths lie between those of their neighbours, or
/// continue a surface that ends there, in both images. The last pixel of a silhouette is where its
/// surface is nearest or farthest, so its depth need not lie between any two.
pub(crate) fn depths_beyond_edges(
    w: usize,
    native: &[f32],
    ours: &[f32],
    slack: f32,
) -> Vec<String> {
    let h = native.len() / w;
    let is_off = |x: usize, y: usize| (native[y * w + x] - ours[y * w + x]).abs() > slack;
    let is_between = |all: &[f32], x: usize, y: usize, one: f32| {
        let near = (0..9).map(|k| {
            let at = |c: usize, d: usize, n: usize| (c + d).saturating_sub(1).min(n - 1);
            all[at(y, k / 3, h) * w + at(x, k % 3, w)]
        });
        let (lo, hi) = near.fold((f32::MAX, f32::MIN), |(lo, hi), v| (lo.min(v), hi.max(v)));
        (lo - slack..=hi + slack).contains(&one)
    };
    // Three neighbouring pixels in a row. If an edge passes through them, the smaller of their two
    // steps belongs to the surface; the next step of a curved surface is up to twice as large.
    let continues = |all: &[f32], x: usize, y: usize, one: f32| {
        (0..9).filter(|k| *k != 4).any(|k| {
            let (dx, dy) = (k % 3 - 1, k / 3 - 1);
            let at = |far: i32| {
                let x = usize::try_from(x as i32 + far * dx).ok().filter(|x| *x < w)?;
                let y = usize::try_from(y as i32 + far * dy).ok().filter(|y| *y < h)?;
                Some(all[y * w + x])
            };
            let (Some(a), Some(b), Some(c)) = (at(1), at(2), at(3)) else { return false };
            let step = if (a - b).abs() < (b - c).abs() { a - b } else { b - c };
            let (lo, hi) = (a.min(a + 2.0 * step), a.max(a + 2.0 * step));
            (lo - slack..=hi + slack).contains(&one)
        })
    };
    let is_there = |all: &[f32], x, y, one| is_between(all, x, y, one) || continues(all, x, y, one);
    let mut out = Vec::new();
    for y in 0..h {
        for x in (0..w).filter(|x| is_off(*x, y)) {
            let (p, q) = (native[y * w + x], ours[y * w + x]);
            let area = x + 1 < w
                && y + 1 < h
                && is_off(x + 1, y)
                && is_off(x, y + 1)
                && is_off(x + 1, y + 1);
            if area || !is_there(ours, x, y, p) || !is_there(native, x, y, q) {
                let steps = (p - q) / slack;
                out.push(format!(
                    "({x}, {y}): {p} and {q}, {steps:.1} times what may be, an area: {area}"
                ));
            }
        }
    }
    out
}

impl Metrics {
    /// Checks the limits for filled surfaces.
    pub(crate) fn assert_filled(&self, what: &str) {
        let ok = self.tolerant <= 0.02
            && self.raw <= 0.2
            && self.interior <= 1.0
            && self.interior_p99 <= 4.0
            && self.overlap >= 0.999;
        assert!(ok, "{what}: {self:?}");
    }

    /// Checks the limits for images full of lines.
    pub(crate) fn assert_lines(&self, what: &str) {
        assert!(self.tolerant <= 0.1 && self.overlap >= 0.97, "{what}: {self:?}");
    }
}
