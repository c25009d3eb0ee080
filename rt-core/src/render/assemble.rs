//! From tiles to rows of pixels.

use super::RenderOptions;
use crate::camera::Camera;
use crate::frame::Frame;
use crate::shade::{TILE, TileArea, TileLayers};
use rayon::prelude::*;

/// A tile with what it has computed.
pub(super) struct Tile {
    pub(super) area: TileArea,
    pub(super) layers: TileLayers,
    /// Samples per pixel so far.
    pub(super) samples: u32,
}

/// Tiles that cover the area to draw, row by row, in the memory of `old` ones where they fit.
pub(super) fn tiles(options: &RenderOptions, camera: &Camera, old: Vec<Tile>) -> Vec<Tile> {
    let mut old = old.into_iter();
    let crop = options.area();
    let estimate_error = options.max_error_levels.is_some() || options.samples > 1;
    let mut out = Vec::new();
    for y in (0..crop.height).step_by(TILE as usize) {
        for x in (0..crop.width).step_by(TILE as usize) {
            let area = TileArea {
                x: crop.x + x,
                y: crop.y + y,
                width: TILE.min(crop.width - x),
                height: TILE.min(crop.height - y),
                sample: 0,
            };
            let background_depth = camera.background_depth() as f32;
            let used = old.next().map(|t| t.layers).and_then(|mut layers| {
                layers.reset(options.layers, background_depth, estimate_error).then_some(layers)
            });
            let layers =
                used.unwrap_or_else(|| TileLayers::new(options.layers, background_depth, estimate_error));
            out.push(Tile { area, layers, samples: 0 });
        }
    }
    out
}

/// The picture so far, in the memory of `old` where it fits.
pub(super) fn assemble(options: &RenderOptions, tiles: &[Tile], old: Frame) -> Frame {
    let crop = options.area();
    let (width, height) = (crop.width as usize, crop.height as usize);
    let grid = Grid { width, tiles_across: width.div_ceil(TILE as usize), tiles };
    let mean = |t: &Tile, i: usize| {
        if t.samples == 0 {
            return [0.0; 4];
        }
        let scale = 1.0 / t.samples as f32;
        t.layers.color[i].map(|v| v * scale)
    };
    let has = |f: fn(&TileLayers) -> bool| tiles.first().is_some_and(|t| f(&t.layers));
    let n = width * height;
    Frame {
        width: crop.width,
        height: crop.height,
        color: grid.plane(old.color, has(|l| !l.color.is_empty()), n, [0.0; 4], mean),
        depth: grid.plane(old.depth, has(|l| !l.depth.is_empty()), n, 0.0, |t, i| t.layers.depth[i]),
        distance: grid
            .plane(old.distance, has(|l| !l.distance.is_empty()), n, 0.0, |t, i| t.layers.distance[i]),
        normal: grid.plane(old.normal, has(|l| !l.normal.is_empty()), n, [0.0; 3], |t, i| t.layers.normal[i]),
        instance: grid
            .plane(old.instance, has(|l| !l.instance.is_empty()), n, 0, |t, i| t.layers.instance[i]),
        primitive: grid
            .plane(old.primitive, has(|l| !l.primitive.is_empty()), n, 0, |t, i| t.layers.primitive[i]),
        cost: grid.plane(old.cost, has(|l| !l.cost.is_empty()), n, 0.0, |t, i| t.layers.cost[i]),
    }
}

struct Grid<'a> {
    width: usize,
    tiles_across: usize,
    tiles: &'a [Tile],
}

impl Grid<'_> {
    /// One layer in row order: each row of tiles fills its band of rows.
    fn plane<T: Copy + Send + Sync>(
        &self,
        mut out: Vec<T>,
        wanted: bool,
        pixels: usize,
        blank: T,
        value: impl Fn(&Tile, usize) -> T + Sync,
    ) -> Vec<T> {
        if !wanted {
            return Vec::new();
        }
        if out.len() != pixels {
            out = vec![blank; pixels];
        }
        let bands = out.par_chunks_mut(self.width * TILE as usize);
        bands.zip(self.tiles.par_chunks(self.tiles_across)).for_each(|(band, tiles)| {
            for (k, tile) in tiles.iter().enumerate() {
                for y in 0..tile.area.height {
                    let start = y as usize * self.width + k * TILE as usize;
                    for (x, out) in band[start..start + tile.area.width as usize].iter_mut().enumerate() {
                        *out = value(tile, TileArea::slot(x as u32, y));
                    }
                }
            }
        });
        out
    }
}
