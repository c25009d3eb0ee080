//! Synthetic frames to measure compositing without a renderer: what each of p ranks would have
//! drawn of its brick of a volume.
//!
//! There are three distributions of pixels, after what chapter 3 of the thesis renders: solid
//! bricks (*discs*), bricks that all cover the whole image (*dense*, the worst case of volume
//! rendering), and discs as scattered short runs (*frag*: streamlines, particles). Everything is a
//! function of workload, moment, rank and size, so each rank makes its own frame.
use crate::mix64::mix64;
use crate::rect::Rect;
use std::fmt;
use std::str::FromStr;

/// How the pixels of the ranks are distributed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Workload {
    /// Every rank's brick is one solid, shaded ellipse, and neighbours overlap. 1 to 4 layers where
    /// anything is drawn.
    Discs,
    /// Every rank draws every pixel, as a tilted plane; planes intersect.
    Dense,
    /// A sixth of the pixels of the discs, in runs of three.
    Frag,
}

impl Workload {
    /// All workloads.
    pub const ALL: [Self; 3] = [Self::Discs, Self::Dense, Self::Frag];

    /// Name as on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Discs => "discs",
            Self::Dense => "dense",
            Self::Frag => "frag",
        }
    }
}

impl fmt::Display for Workload {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Workload {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|workload| workload.name() == name);
        found.ok_or_else(|| format!("there is no scene `{name}`: use discs, dense or frag"))
    }
}

/// What one rank has drawn.
#[derive(Clone, Debug)]
pub struct SyntheticFrame {
    /// Width of the image.
    pub width_px: u32,
    /// Height of the image.
    pub height_px: u32,
    /// RGBA8, row after row; zero where nothing is drawn.
    pub colors: Vec<[u8; 4]>,
    /// 0 (near) to 1 (background).
    pub depths: Vec<f32>,
    /// Bounding rectangle of everything drawn, as a renderer knows it from the projection of its
    /// bounding box.
    pub bounds: Rect,
}

impl SyntheticFrame {
    /// An empty image.
    pub fn new(width_px: u32, height_px: u32) -> Self {
        let pixels = width_px as usize * height_px as usize;
        Self {
            width_px,
            height_px,
            colors: vec![[0; 4]; pixels],
            depths: vec![1.0; pixels],
            bounds: Rect::EMPTY,
        }
    }

    /// Number of active pixels.
    pub fn active(&self) -> u64 {
        self.depths.iter().filter(|&&depth| depth < 1.0).count() as u64
    }

    /// The colours as thin glass: premultiplied, alpha 0.1 to 0.6 by brightness.
    pub fn premultiplied(&self, out: &mut Vec<[f32; 4]>) {
        out.clear();
        out.extend(self.colors.iter().map(|&[r, g, b, a]| {
            if a == 0 {
                return [0.0; 4];
            }
            let brightness = (f32::from(r) + f32::from(g) + f32::from(b)) / (3.0 * 255.0);
            let alpha = 0.1 + 0.5 * brightness;
            let glass = |channel: u8| f32::from(channel) / 255.0 * alpha;
            [glass(r), glass(g), glass(b), alpha]
        }));
    }
}

/// A projected brick: centre and radii in pixels, depth of its centre.
struct ProjectedBrick {
    center_px: (f32, f32),
    radii_px: (f32, f32),
    depth: f32,
}

/// Divides a cube into `ranks` bricks, in a grid as even as the factors of `ranks` allow.
fn grid(ranks: usize) -> [usize; 3] {
    let mut factors = Vec::new();
    let (mut left, mut divisor) = (ranks, 2);
    while left > 1 {
        while left.is_multiple_of(divisor) {
            factors.push(divisor);
            left /= divisor;
        }
        divisor += 1;
    }
    let mut sides = [1, 1, 1];
    for factor in factors.into_iter().rev() {
        if let Some(shortest) = sides.iter_mut().min_by_key(|side| **side) {
            *shortest *= factor;
        }
    }
    sides
}

/// Projects brick `rank` of `ranks`; the camera orbits the cube.
fn project(
    moment: u64,
    rank: usize,
    ranks: usize,
    width_px: f32,
    height_px: f32,
) -> ProjectedBrick {
    let [nx, ny, nz] = grid(ranks);
    let middle = |i: usize, n: usize| (i as f32 + 0.5) / n as f32 - 0.5;
    let (x, y, z) =
        (middle(rank % nx, nx), middle((rank / nx) % ny, ny), middle(rank / (nx * ny), nz));
    let (sin, cos) = (0.3 + 0.37 * moment as f32).sin_cos();
    let (across, into) = (x * cos - z * sin, x * sin + z * cos);
    let widest = nx.max(nz) as f32;
    ProjectedBrick {
        center_px: (
            (0.5 + 0.75 * across) * width_px,
            (0.5 + 0.75 * (0.9 * y - 0.3 * into)) * height_px,
        ),
        radii_px: ((0.54 * width_px / widest).max(8.0), (0.54 * height_px / ny as f32).max(8.0)),
        depth: 0.5 + 0.35 * (0.9 * into + 0.3 * y),
    }
}

/// A pseudorandom number: the first output of SplitMix64 with this seed.
fn scatter(number: u64) -> u64 {
    mix64(number.wrapping_add(0x9e37_79b9_7f4a_7c15))
}

impl Workload {
    /// Draws what `rank` of `ranks` sees at `moment` (the number of a frame) into `target`, which
    /// is cleared first.
    pub fn draw(self, moment: u64, rank: usize, ranks: usize, target: &mut SyntheticFrame) {
        target.colors.fill([0; 4]);
        target.depths.fill(1.0);
        let tint = scatter(rank as u64 + 7).to_le_bytes();
        match self {
            Self::Dense => draw_plane(moment, rank, ranks, tint, target),
            Self::Discs => draw_disc(moment, rank, ranks, tint, target, |_| true),
            Self::Frag => draw_disc(moment, rank, ranks, tint, target, |index| {
                scatter(index / 3 * 131 + rank as u64).is_multiple_of(6)
            }),
        }
    }

    /// Ranks from front to back, for blending.
    pub fn front_to_back(self, moment: u64, ranks: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..ranks).collect();
        if self != Self::Dense {
            let depth = |rank: &usize| project(moment, *rank, ranks, 1.0, 1.0).depth;
            order.sort_by(|a, b| depth(a).total_cmp(&depth(b)));
        }
        order
    }
}

fn draw_plane(moment: u64, rank: usize, ranks: usize, tint: [u8; 8], target: &mut SyntheticFrame) {
    let tilt = scatter(1000 * moment + rank as u64).to_le_bytes();
    let (tilt_x, tilt_y) = (f32::from(tilt[0]) / 255.0 - 0.5, f32::from(tilt[1]) / 255.0 - 0.5);
    let (width, height) = (target.width_px as f32, target.height_px as f32);
    let middle = 0.5 + 0.001 * rank as f32 / ranks as f32;
    let mut pixels = target.colors.iter_mut().zip(&mut target.depths);
    for y in 0..target.height_px {
        for x in 0..target.width_px {
            let Some((color, depth)) = pixels.next() else { return };
            let (u, v) = (x as f32 / width - 0.5, y as f32 / height - 0.5);
            *depth = middle + 0.3 * (tilt_x * u + tilt_y * v);
            let pattern = (x ^ y) as u8;
            *color = [tint[0] ^ pattern, tint[1], tint[2], 255];
        }
    }
    target.bounds = Rect::of_size(target.width_px, target.height_px);
}

fn draw_disc(
    moment: u64,
    rank: usize,
    ranks: usize,
    tint: [u8; 8],
    target: &mut SyntheticFrame,
    keep: impl Fn(u64) -> bool,
) {
    let (width, height) = (target.width_px as f32, target.height_px as f32);
    let ProjectedBrick { center_px: (cx, cy), radii_px: (rx, ry), depth } =
        project(moment, rank, ranks, width, height);
    let clip =
        |from: f32, to: f32, end: u32| (from.max(0.0) as u32, (to.ceil().max(0.0) as u32).min(end));
    let (x0, x1) = clip(cx - rx, cx + rx, target.width_px);
    let (y0, y1) = clip(cy - ry, cy + ry, target.height_px);
    let bounds = Rect { x0, y0, x1, y1 };
    target.bounds = if bounds.is_empty() { Rect::EMPTY } else { bounds };
    for y in y0..y1 {
        let row = y as usize * target.width_px as usize;
        for x in x0..x1 {
            let (u, v) = ((x as f32 + 0.5 - cx) / rx, (y as f32 + 0.5 - cy) / ry);
            let square = u * u + v * v;
            let index = row + x as usize;
            if square >= 1.0 || !keep(index as u64) {
                continue;
            }
            let towards = (1.0 - square).sqrt();
            // The rank's share of depth prevents most ties, but equal depths of symmetric bricks
            // remain.
            target.depths[index] = (depth - 0.05 * towards + 1e-5 * rank as f32).clamp(0.01, 0.99);
            let light = 0.25 + 0.75 * towards;
            let shade = |channel: u8| (f32::from(channel) * light) as u8;
            target.colors[index] = [shade(tint[0]), shade(tint[1]), shade(tint[2]), 255];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scattered_numbers_are_splitmix64s() {
        // Of the generator that the records of synthetic frames were made with.
        assert_eq!([5, 131].map(scatter), [0x6303_3b0c_a389_c35a, 0x8e48_a85c_3260_d9d0]);
    }

    #[test]
    fn bounds_hold_all_that_is_drawn_and_scenes_differ_in_how_much_that_is() {
        for ranks in [1, 2, 7, 8, 127] {
            for rank in [0, ranks - 1] {
                let mut active = Vec::new();
                for workload in Workload::ALL {
                    let mut drawn = SyntheticFrame::new(130, 70);
                    workload.draw(3, rank, ranks, &mut drawn);
                    for (index, depth) in drawn.depths.iter().enumerate() {
                        let (x, y) = (index as u32 % 130, index as u32 / 130);
                        let inside = x >= drawn.bounds.x0
                            && x < drawn.bounds.x1
                            && y >= drawn.bounds.y0
                            && y < drawn.bounds.y1;
                        assert!(
                            *depth == 1.0 || inside,
                            "{workload} rank {rank} of {ranks}: {x} {y}"
                        );
                        assert_eq!(*depth < 1.0, drawn.colors[index][3] == 255);
                    }
                    active.push(drawn.active());
                }
                assert_eq!(active[1], 130 * 70);
                assert!(active[0] < active[1] && active[2] < active[0], "{active:?}");
            }
        }
    }

    #[test]
    fn the_order_names_every_rank_once_and_changes_with_the_view() {
        let mut sorted = Workload::Discs.front_to_back(0, 27);
        assert_ne!(sorted, Workload::Discs.front_to_back(8, 27));
        sorted.sort_unstable();
        assert_eq!(sorted, (0..27).collect::<Vec<_>>());
    }
}
