//! What a window shows, and how far two windows are apart.

use std::path::Path;

/// A window's pixels, rows from the bottom.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Shot {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) rgba: Vec<[u8; 4]>,
    pub(crate) depth: Vec<f32>,
    pub(crate) answers: serde_json::Value,
    pub(crate) classes: Vec<String>,
}

/// Distance of two pictures.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Difference {
    /// Share of pixels that are covered in one of them only.
    pub(crate) silhouette: f64,
    /// Largest difference of depth away from edges, in units of 2^-24 (the step of a 24-bit depth buffer, and of f32 below 1).
    pub(crate) depth_steps: f64,
    /// Mean difference of colour over all pixels and channels, levels of 255.
    pub(crate) color_mean: f64,
    /// The same over pixels that both cover, away from edges.
    pub(crate) inner_color_mean: f64,
}

impl Shot {
    pub(crate) fn read(path: &Path) -> Shot {
        let bytes = |extension: &str| {
            let file = path.with_extension(extension);
            std::fs::read(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()))
        };
        let about: serde_json::Value = serde_json::from_slice(&bytes("json")).expect("JSON");
        let number = |key: &str| about[key].as_u64().expect("a size") as usize;
        let classes = about["classes"].as_array().expect("a list");
        Shot {
            width: number("width"),
            height: number("height"),
            rgba: bytes("rgba").chunks_exact(4).map(|c| [c[0], c[1], c[2], c[3]]).collect(),
            depth: bytes("z").chunks_exact(4).map(|c| f32::from_le_bytes([c[0], c[1], c[2], c[3]])).collect(),
            answers: about["answers"].clone(),
            classes: classes.iter().map(|c| c.as_str().expect("a name").to_owned()).collect(),
        }
    }

    /// Pixels with something in them.
    pub(crate) fn covered(&self) -> usize {
        self.depth.iter().filter(|d| **d < 1.0).count()
    }

    /// Mean of all channels.
    pub(crate) fn brightness(&self) -> f64 {
        let sum: u64 = self.rgba.iter().flat_map(|p| &p[..3]).map(|v| u64::from(*v)).sum();
        sum as f64 / (3 * self.rgba.len()) as f64
    }

    /// Whether pixel (`x`, `y`) lies on a smooth piece of surface in both pictures: all nine neighbours are covered, and depth changes
    /// evenly from one to the next.
    fn is_inner(&self, other: &Shot, x: usize, y: usize) -> bool {
        if x == 0 || y == 0 || x + 1 >= self.width || y + 1 >= self.height {
            return false;
        }
        [self, other].iter().all(|s| {
            let at = |dx: usize, dy: usize| s.depth[(y + dy - 1) * s.width + x + dx - 1];
            let neighbours = (0..9).map(|i| at(i % 3, i / 3));
            let bend = |a: f32, b: f32, c: f32| (a - 2.0 * b + c).abs();
            let step = |a: f32, c: f32| (a - c).abs();
            let smooth = |a: f32, b: f32, c: f32| bend(a, b, c) <= 1e-6 + 0.2 * step(a, c);
            neighbours.clone().all(|d| d < 1.0)
                && smooth(at(0, 1), at(1, 1), at(2, 1))
                && smooth(at(1, 0), at(1, 1), at(1, 2))
                && neighbours.into_iter().all(|d| (d - at(1, 1)).abs() < 0.01)
        })
    }

    pub(crate) fn difference(&self, other: &Shot) -> Difference {
        assert_eq!((self.width, self.height), (other.width, other.height));
        let mut d = Difference::default();
        let (mut colors, mut inner_colors, mut inner) = (0.0, 0.0, 0usize);
        for y in 0..self.height {
            for x in 0..self.width {
                let i = y * self.width + x;
                d.silhouette += f64::from(u8::from((self.depth[i] < 1.0) != (other.depth[i] < 1.0)));
                let (a, b) = (self.rgba[i], other.rgba[i]);
                let apart: f64 = (0..3).map(|c| f64::from(a[c].abs_diff(b[c]))).sum::<f64>() / 3.0;
                colors += apart;
                if self.is_inner(other, x, y) {
                    inner += 1;
                    inner_colors += apart;
                    let steps = (f64::from(self.depth[i]) - f64::from(other.depth[i])).abs() * 24f64.exp2();
                    d.depth_steps = d.depth_steps.max(steps);
                }
            }
        }
        let pixels = self.rgba.len() as f64;
        d.silhouette /= pixels;
        d.color_mean = colors / pixels;
        d.inner_color_mean = inner_colors / inner.max(1) as f64;
        d
    }
}
