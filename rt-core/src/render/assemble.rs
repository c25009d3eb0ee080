//! Copies tiles into rows of pixels: all at once where tiles accumulate samples, or tile by tile
//! while each is still in the cache.

use super::RenderOptions;
use crate::camera::Camera;
use crate::frame::{Frame, Layers};
use crate::shade::{TILE, TileArea, TileLayers};
use rayon::prelude::*;

/// A tile with what it has computed.
pub(super) struct Tile {
    pub(super) area: TileArea,
    pub(super) layers: TileLayers,
    /// Samples per pixel so far.
    pub(super) samples: u32,
}

/// Tiles that cover the area to draw, row by row. Reuses the memory of `old` tiles where they fit.
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
            let layers = used.unwrap_or_else(|| {
                TileLayers::new(options.layers, background_depth, estimate_error)
            });
            out.push(Tile { area, layers, samples: 0 });
        }
    }
    out
}

/// The image so far. Reuses the memory of `old` where it fits.
pub(super) fn assemble(options: &RenderOptions, tiles: &[Tile], old: Frame) -> Frame {
    let crop = options.area();
    let (width, height) = (crop.width as usize, crop.height as usize);
    let grid = TileGrid { width, tiles_across: width.div_ceil(TILE as usize), tiles };
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
        depth: grid
            .plane(old.depth, has(|l| !l.depth.is_empty()), n, 0.0, |t, i| t.layers.depth[i]),
        distance: grid.plane(old.distance, has(|l| !l.distance.is_empty()), n, 0.0, |t, i| {
            t.layers.distance[i]
        }),
        normal: grid.plane(old.normal, has(|l| !l.normal.is_empty()), n, [0.0; 3], |t, i| {
            t.layers.normal[i]
        }),
        instance: grid.plane(old.instance, has(|l| !l.instance.is_empty()), n, 0, |t, i| {
            t.layers.instance[i]
        }),
        primitive: grid.plane(old.primitive, has(|l| !l.primitive.is_empty()), n, 0, |t, i| {
            t.layers.primitive[i]
        }),
        cost: grid.plane(old.cost, has(|l| !l.cost.is_empty()), n, 0.0, |t, i| t.layers.cost[i]),
    }
}

struct TileGrid<'a> {
    width: usize,
    tiles_across: usize,
    tiles: &'a [Tile],
}

impl TileGrid<'_> {
    /// One layer in row order. Each row of tiles fills its band of rows.
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
                    for (x, out) in
                        band[start..start + tile.area.width as usize].iter_mut().enumerate()
                    {
                        *out = value(tile, TileArea::slot(x as u32, y));
                    }
                }
            }
        });
        out
    }
}

/// An image of blank pixels. Reuses the memory of `old` where it fits; reused pixels keep their old
/// values.
pub(super) fn blank_frame(options: &RenderOptions, camera: &Camera, old: Frame) -> Frame {
    let crop = options.area();
    let n = crop.width as usize * crop.height as usize;
    fn plane<T: Clone>(old: Vec<T>, wanted: bool, n: usize, blank: T) -> Vec<T> {
        match (wanted, old.len() == n) {
            (false, _) => Vec::new(),
            (true, true) => old,
            (true, false) => vec![blank; n],
        }
    }
    let has = |l| options.layers.contains(l);
    Frame {
        width: crop.width,
        height: crop.height,
        color: plane(old.color, has(Layers::COLOR), n, [0.0; 4]),
        depth: plane(old.depth, has(Layers::DEPTH), n, camera.background_depth() as f32),
        distance: plane(old.distance, has(Layers::DISTANCE), n, f32::INFINITY),
        normal: plane(old.normal, has(Layers::NORMAL), n, [0.0; 3]),
        instance: plane(old.instance, has(Layers::IDS), n, u32::MAX),
        primitive: plane(old.primitive, has(Layers::IDS), n, u32::MAX),
        cost: plane(old.cost, has(Layers::COST), n, 0.0),
    }
}

/// The pixels of an image that belong to one row of tiles, or to one tile: slices of each layer's
/// rows.
pub(super) struct FrameSlices<'a> {
    pub(super) area: TileArea,
    color: Vec<&'a mut [[f32; 4]]>,
    depth: Vec<&'a mut [f32]>,
    distance: Vec<&'a mut [f32]>,
    normal: Vec<&'a mut [[f32; 3]]>,
    instance: Vec<&'a mut [u32]>,
    primitive: Vec<&'a mut [u32]>,
    cost: Vec<&'a mut [f32]>,
}

/// The rows of tiles, each with its pixels.
pub(super) fn bands<'a>(options: &RenderOptions, frame: &'a mut Frame) -> Vec<FrameSlices<'a>> {
    let crop = options.area();
    let size = crop.width as usize * TILE as usize;
    // A layer that was not requested has no bands.
    fn next<'a, T>(chunks: &mut std::slice::ChunksMut<'a, T>) -> Vec<&'a mut [T]> {
        chunks.next().into_iter().collect()
    }
    let (mut color, mut depth) = (frame.color.chunks_mut(size), frame.depth.chunks_mut(size));
    let (mut distance, mut normal) =
        (frame.distance.chunks_mut(size), frame.normal.chunks_mut(size));
    let (mut instance, mut primitive) =
        (frame.instance.chunks_mut(size), frame.primitive.chunks_mut(size));
    let mut cost = frame.cost.chunks_mut(size);
    (0..crop.height)
        .step_by(TILE as usize)
        .map(|y| FrameSlices {
            area: TileArea {
                x: crop.x,
                y: crop.y + y,
                width: crop.width,
                height: TILE.min(crop.height - y),
                sample: 0,
            },
            color: next(&mut color),
            depth: next(&mut depth),
            distance: next(&mut distance),
            normal: next(&mut normal),
            instance: next(&mut instance),
            primitive: next(&mut primitive),
            cost: next(&mut cost),
        })
        .collect()
}

impl<'a> FrameSlices<'a> {
    /// Splits a row of tiles into its tiles.
    pub(super) fn tiles(self) -> Vec<FrameSlices<'a>> {
        let FrameSlices { area, color, depth, distance, normal, instance, primitive, cost } = self;
        let mut tiles: Vec<FrameSlices<'a>> = (0..area.width)
            .step_by(TILE as usize)
            .map(|x| FrameSlices {
                area: TileArea { x: area.x + x, width: TILE.min(area.width - x), ..area },
                color: Vec::new(),
                depth: Vec::new(),
                distance: Vec::new(),
                normal: Vec::new(),
                instance: Vec::new(),
                primitive: Vec::new(),
                cost: Vec::new(),
            })
            .collect();
        fn distribute<'a, T>(
            band: Vec<&'a mut [T]>,
            width: u32,
            mut give: impl FnMut(usize, &'a mut [T]),
        ) {
            for rows in band {
                for row in rows.chunks_mut(width as usize) {
                    row.chunks_mut(TILE as usize).enumerate().for_each(|(k, piece)| give(k, piece));
                }
            }
        }
        let w = area.width;
        distribute(color, w, |k, piece| tiles[k].color.push(piece));
        distribute(depth, w, |k, piece| tiles[k].depth.push(piece));
        distribute(distance, w, |k, piece| tiles[k].distance.push(piece));
        distribute(normal, w, |k, piece| tiles[k].normal.push(piece));
        distribute(instance, w, |k, piece| tiles[k].instance.push(piece));
        distribute(primitive, w, |k, piece| tiles[k].primitive.push(piece));
        distribute(cost, w, |k, piece| tiles[k].cost.push(piece));
        tiles
    }

    /// Copies a tile after its only sample.
    pub(super) fn write(&mut self, tile: &TileLayers) {
        fn plane<T: Copy>(rows: &mut [&mut [T]], slots: &[T]) {
            for (y, row) in rows.iter_mut().enumerate() {
                // Two neighbours in a row are also neighbours along the Morton curve.
                for (pair, out) in row.chunks_mut(2).enumerate() {
                    let slot = TileArea::slot(2 * pair as u32, y as u32);
                    out.copy_from_slice(&slots[slot..slot + out.len()]);
                }
            }
        }
        plane(&mut self.color, &tile.color);
        plane(&mut self.depth, &tile.depth);
        plane(&mut self.distance, &tile.distance);
        plane(&mut self.normal, &tile.normal);
        plane(&mut self.instance, &tile.instance);
        plane(&mut self.primitive, &tile.primitive);
        plane(&mut self.cost, &tile.cost);
    }
}
