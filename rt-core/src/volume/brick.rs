//! Volumes in bricks, which together give the result of the whole volume.
//!
//! The order in which a ray visits the blocks of a grid depends on the ray alone, and the
//! contribution of a block depends only on what was collected in front of it. So a ray may be
//! passed from brick to brick together with what it has collected ([`PartialIntegral`]): the result
//! has the bits of one march through the whole volume.

use super::layer::MarchState;
use super::{MACROCELL, Volume, VolumeQuality, VolumeReport, VolumeSample, scan};
use crate::grid::Grid;
use glam::UVec3;
use std::sync::Arc;

/// Ghost layers of points around a brick: a gradient uses the points on both sides of a cell's
/// corners, and the end of a ray's segment in a cell may be rounded into the next one.
const GHOSTS: u32 = 2;

/// A box of blocks of [`MACROCELL`]³ cells: from `first` to before `end`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Brick {
    /// Lowest block.
    pub first: UVec3,
    /// One past the highest block, on each axis.
    pub end: UVec3,
}

impl Brick {
    /// Whether it contains no block.
    pub fn is_empty(&self) -> bool {
        self.first.cmpge(self.end).any()
    }

    /// Whether it contains a block.
    pub fn contains(&self, block: UVec3) -> bool {
        block.cmpge(self.first).all() && block.cmplt(self.end).all()
    }
}

/// What a ray has collected so far, passed from brick to brick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PartialIntegral {
    /// Linear colour, premultiplied by its opacity.
    pub color: [f64; 3],
    /// Share of the light behind that passes.
    pub transmittance: f64,
    /// Ray parameter at which the opacity reaches 50 %; infinite when it does not.
    pub depth: f64,
    /// Intervals of the ray whose transfer function was integrated (or samples taken, with fixed
    /// steps).
    pub samples: u32,
}

impl Default for PartialIntegral {
    /// Nothing yet.
    fn default() -> Self {
        PartialIntegral { color: [0.0; 3], transmittance: 1.0, depth: f64::INFINITY, samples: 0 }
    }
}

impl PartialIntegral {
    /// The result at the end of the ray.
    pub fn sample(&self) -> VolumeSample {
        let [r, g, b] = self.color.map(|c| c as f32);
        VolumeSample {
            rgba: [r, g, b, (1.0 - self.transmittance) as f32],
            depth: self.depth as f32,
            samples: self.samples,
        }
    }

    /// Whether so little light passes that nothing behind matters.
    pub fn is_opaque(&self, quality: &VolumeQuality) -> bool {
        self.samples > 0 && self.march(*quality, 1.0).is_opaque()
    }

    pub(super) fn march(&self, quality: VolumeQuality, path: f64) -> MarchState {
        let mut m = MarchState::new(quality, path);
        (m.color, m.transmittance) = (self.color, self.transmittance);
        (m.depth, m.samples) = (self.depth, self.samples);
        m
    }
}

impl From<MarchState> for PartialIntegral {
    fn from(m: MarchState) -> PartialIntegral {
        PartialIntegral {
            color: m.color,
            transmittance: m.transmittance,
            depth: m.depth,
            samples: m.samples,
        }
    }
}

impl Volume {
    /// Blocks per axis of the whole volume.
    pub fn blocks(&self) -> UVec3 {
        self.blocks
    }

    /// Whether a block that is held here has any extinction. False for blocks that a brick does not
    /// hold.
    pub fn is_occupied(&self, block: UVec3) -> bool {
        block.cmplt(self.blocks).all() && self.occupied[self.block_index(block)]
    }

    pub(super) fn block_index(&self, block: UVec3) -> usize {
        let [x, y, z] = block.to_array().map(|b| b as usize);
        (z * self.blocks.y as usize + y) * self.blocks.x as usize + x
    }

    /// The data that `brick` needs: the values of its cells with two ghost layers of points, for
    /// gradients. The rest of the volume is clear here. See [`RaySegments`](super::RaySegments) for
    /// an example.
    pub fn part(&self, brick: Brick) -> Volume {
        let cells = self.cells();
        let (mut ranges, mut report) =
            (vec![[f32::INFINITY, f32::NEG_INFINITY]; self.ranges.len()], VolumeReport::default());
        let brick = Brick { first: brick.first, end: brick.end.min(self.blocks) };
        let (low, high) = if brick.is_empty() {
            (UVec3::ZERO, UVec3::ONE)
        } else {
            let low = (brick.first * MACROCELL).saturating_sub(UVec3::splat(GHOSTS));
            (low, ((brick.end * MACROCELL).min(cells) + UVec3::splat(GHOSTS + 1)).min(self.dims))
        };
        let low = low.max(self.first_point);
        let high = high.min(self.first_point + self.grid.dims);
        let size = high - low;
        let mut values = Vec::with_capacity(size.as_usizevec3().element_product());
        for k in low.z..high.z {
            for j in low.y..high.y {
                let row = self.grid.index(
                    low.x - self.first_point.x,
                    j - self.first_point.y,
                    k - self.first_point.z,
                );
                values.extend_from_slice(&self.grid.values[row..row + size.x as usize]);
            }
        }
        let spacing = self.grid.spacing;
        let origin = self.origin + spacing * low.as_dvec3();
        let grid = Grid { dims: size, origin, spacing, values };
        for z in brick.first.z..brick.end.z {
            for y in brick.first.y..brick.end.y {
                for x in brick.first.x..brick.end.x {
                    let block = UVec3::new(x, y, z);
                    let (first, end) =
                        (block * MACROCELL, ((block + UVec3::ONE) * MACROCELL).min(cells));
                    let (range, bad) = scan(&grid, first - low, end - low, self.is_nearest());
                    ranges[self.block_index(block)] = range;
                    report.cells += (end - first).as_u64vec3().element_product();
                    report.cells_non_finite += bad;
                    report.macrocells += 1;
                }
            }
        }
        let mut part = Volume {
            grid: Arc::new(grid),
            transfer: self.transfer.clone(),
            options: self.options.clone(),
            dims: self.dims,
            origin: self.origin,
            first_point: low,
            ranges,
            occupied: Vec::new(),
            filled: Vec::new(),
            blocks: self.blocks,
            report,
            level: self.level,
        };
        part.find_occupied();
        part
    }
}
