//! A square of pixels: the unit of work, with its layers.

use super::frame_context::FrameContext;
use crate::frame::Layers;
use crate::ray::{Hit, LANES, Ray};
use crate::sampler::Sampler;
use glam::Vec3;

/// Pixels along a tile's side.
pub(crate) const TILE: u32 = 32;
/// Pixels of a tile.
pub(crate) const PIXELS: usize = (TILE * TILE) as usize;

/// Position of a tile: `x..x+width`, `y..y+height` of the whole image.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TileArea {
    pub(crate) x: u32,
    pub(crate) y: u32,
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Sample that is being rendered.
    pub(crate) sample: u32,
}

impl TileArea {
    /// Pixel of a slot. Slots follow a Morton curve: 16 of them are 4 x 4 pixels, so a block of
    /// rays is square.
    #[inline]
    pub(crate) fn pixel(&self, slot: u16) -> Option<[u32; 2]> {
        let (x, y) = (even_bits(slot), even_bits(slot >> 1));
        (x < self.width && y < self.height).then(|| [self.x + x, self.y + y])
    }

    /// Slot of the pixel (`x`, `y`) counted from the tile's corner.
    #[inline]
    pub(crate) fn slot(x: u32, y: u32) -> usize {
        const SPREAD: [u16; TILE as usize] = {
            let (mut table, mut v) = ([0; TILE as usize], 0);
            while v < table.len() {
                let v16 = v as u16;
                table[v] =
                    v16 & 1 | (v16 & 2) << 1 | (v16 & 4) << 2 | (v16 & 8) << 3 | (v16 & 16) << 4;
                v += 1;
            }
            table
        };
        (SPREAD[x as usize] | SPREAD[y as usize] << 1) as usize
    }

    /// Sample points of a slot for the current sample.
    #[inline]
    pub(crate) fn sampler(&self, context: &FrameContext<'_>, slot: u16) -> Sampler {
        let (x, y) = (even_bits(slot), even_bits(slot >> 1));
        context.sampler(self.x + x, self.y + y, self.sample)
    }
}

/// Pixel of a lane within its block of 4 x 4.
#[inline]
pub(crate) const fn lane_pixel(lane: usize) -> [usize; 2] {
    [even_bits(lane as u16) as usize, even_bits(lane as u16 >> 1) as usize]
}

/// Column and row of a block among the tile's 8 x 8.
#[inline]
pub(crate) const fn block_place(block: usize) -> [usize; 2] {
    lane_pixel(block)
}

/// Extracts bits 0, 2, 4, 6 and 8 into adjacent bits.
#[inline]
const fn even_bits(v: u16) -> u32 {
    let mut x = v as u32 & 0x155;
    x = (x | x >> 1) & 0x133;
    x = (x | x >> 2) & 0x10f;
    (x | x >> 4) & 0x1f
}

/// The results of a tile so far, in slot order. Layers that were not requested are empty.
pub(crate) struct TileLayers {
    /// Sum over the samples.
    pub(crate) color: Vec<[f32; 4]>,
    /// Sum of squared luminance over the samples, for the error estimate.
    pub(crate) luminance_sq: Vec<f32>,
    pub(crate) depth: Vec<f32>,
    pub(crate) distance: Vec<f32>,
    pub(crate) normal: Vec<[f32; 3]>,
    pub(crate) instance: Vec<u32>,
    pub(crate) primitive: Vec<u32>,
    pub(crate) cost: Vec<f32>,
    recorded: Vec<bool>,
    made_for: (Layers, bool),
}

impl TileLayers {
    pub(crate) fn new(layers: Layers, background_depth: f32, estimate_error: bool) -> TileLayers {
        fn plane<T: Clone>(wanted: bool, value: T) -> Vec<T> {
            if wanted { vec![value; PIXELS] } else { Vec::new() }
        }
        let has = |l| layers.contains(l);
        TileLayers {
            color: plane(has(Layers::COLOR), [0.0; 4]),
            luminance_sq: plane(has(Layers::COLOR) && estimate_error, 0.0),
            depth: plane(has(Layers::DEPTH), background_depth),
            distance: plane(has(Layers::DISTANCE), f32::INFINITY),
            normal: plane(has(Layers::NORMAL), [0.0; 3]),
            instance: plane(has(Layers::IDS), u32::MAX),
            primitive: plane(has(Layers::IDS), u32::MAX),
            cost: plane(has(Layers::COST), 0.0),
            recorded: plane(layers.intersects(Layers::GEOMETRY), false),
            made_for: (layers, estimate_error),
        }
    }

    /// Clears the colour, as before the first sample.
    pub(crate) fn clear_color(&mut self) {
        self.color.fill([0.0; 4]);
    }

    /// Resets the layers in the same memory; false when other layers are requested. Sums are not
    /// cleared: the first sample replaces them.
    pub(crate) fn reset(
        &mut self,
        layers: Layers,
        background_depth: f32,
        estimate_error: bool,
    ) -> bool {
        if self.made_for != (layers, estimate_error) {
            return false;
        }
        self.depth.fill(background_depth);
        self.distance.fill(f32::INFINITY);
        self.normal.fill([0.0; 3]);
        self.instance.fill(u32::MAX);
        self.primitive.fill(u32::MAX);
        self.cost.fill(0.0);
        self.recorded.fill(false);
        true
    }

    pub(crate) fn cost_mut(&mut self) -> Option<&mut [f32]> {
        (!self.cost.is_empty()).then_some(&mut self.cost)
    }

    #[inline]
    pub(crate) fn is_recorded(&self, slot: u16) -> bool {
        self.recorded[slot as usize]
    }

    /// Fills the geometry layers of a pixel. `normal` is called only when that layer is requested.
    pub(crate) fn record(
        &mut self,
        context: &FrameContext<'_>,
        area: &TileArea,
        slot: u16,
        ray: &Ray,
        hit: &Hit,
        normal: impl FnOnce() -> Vec3,
    ) {
        let i = slot as usize;
        self.recorded[i] = true;
        if !self.depth.is_empty() || !self.distance.is_empty() {
            let [x, y] = area.pixel(slot).unwrap_or_default();
            let (depth, distance) =
                context.depth_and_distance(context.ndc(x, y, [0.5; 2]), ray, hit);
            if let Some(d) = self.depth.get_mut(i) {
                *d = depth;
            }
            if let Some(d) = self.distance.get_mut(i) {
                *d = distance;
            }
        }
        if let Some(n) = self.normal.get_mut(i) {
            *n = normal().to_array();
        }
        if let (Some(a), Some(b)) = (self.instance.get_mut(i), self.primitive.get_mut(i)) {
            (*a, *b) = (hit.instance, hit.prim);
        }
    }

    /// Fills the geometry layers of a pixel with given values: depth and distance, normal, instance
    /// and primitive.
    pub(crate) fn record_given(
        &mut self,
        slot: u16,
        numbers: [f32; 2],
        normal: Vec3,
        ids: [u32; 2],
    ) {
        let i = slot as usize;
        // There are no marks when no geometry layer is requested.
        if let Some(r) = self.recorded.get_mut(i) {
            *r = true;
        }
        for (layer, number) in [&mut self.depth, &mut self.distance].into_iter().zip(numbers) {
            if let Some(v) = layer.get_mut(i) {
                *v = number;
            }
        }
        if let Some(n) = self.normal.get_mut(i) {
            *n = normal.to_array();
        }
        if let (Some(a), Some(b)) = (self.instance.get_mut(i), self.primitive.get_mut(i)) {
            [*a, *b] = ids;
        }
    }

    /// Fills the normals of the lanes `lanes` of block `b`, if that layer is requested.
    pub(crate) fn record_normals(&mut self, b: usize, lanes: u16, normal: impl Fn(usize) -> Vec3) {
        if let Some(normals) = self.normal.get_mut(b * LANES..(b + 1) * LANES) {
            for lane in (0..LANES).filter(|l| lanes >> l & 1 != 0) {
                normals[lane] = normal(lane).to_array();
            }
        }
    }

    /// Sets the sums to the first sample.
    pub(crate) fn start_samples(&mut self, pixels: Vec<[f32; 4]>) {
        self.color = pixels;
        for (sum, p) in self.luminance_sq.iter_mut().zip(&self.color) {
            *sum = luminance(p).powi(2);
        }
    }

    /// Adds a further sample to the sums.
    pub(crate) fn add_sample(&mut self, pixels: &[[f32; 4]]) {
        for (sum, p) in self.color.iter_mut().zip(pixels) {
            for c in 0..4 {
                sum[c] += p[c];
            }
        }
        for (sum, p) in self.luminance_sq.iter_mut().zip(pixels) {
            let l = luminance(p);
            *sum += l * l;
        }
    }

    /// Sum over the pixels of the squared standard error of the mean luminance after `n` samples.
    pub(crate) fn squared_error(&self, area: &TileArea, n: u32) -> f64 {
        let (n, mut sum) = (n as f64, 0.0);
        for slot in 0..PIXELS as u16 {
            if area.pixel(slot).is_some() {
                let mean = luminance(&self.color[slot as usize]) as f64 / n;
                let variance = (self.luminance_sq[slot as usize] as f64 / n - mean * mean).max(0.0);
                sum += variance / (n - 1.0);
            }
        }
        sum
    }
}

/// Luminance of linear RGB with Rec. 709 primaries.
#[inline]
fn luminance(p: &[f32; 4]) -> f32 {
    0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_and_pixels_are_inverse_and_blocks_are_four_by_four() {
        let area = TileArea { x: 0, y: 0, width: TILE, height: TILE, sample: 0 };
        for slot in 0..PIXELS as u16 {
            let [x, y] = area.pixel(slot).unwrap();
            assert_eq!(TileArea::slot(x, y), slot as usize);
        }
        let first: Vec<_> = (0..16).map(|s| area.pixel(s).unwrap()).collect();
        assert!(first.iter().all(|[x, y]| *x < 4 && *y < 4));
    }
}
