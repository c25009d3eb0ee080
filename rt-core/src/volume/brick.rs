//! Volumes in bricks, which together give the result of the whole volume.
//!
//! The order in which a ray visits the blocks of a grid depends on the ray alone, and the
//! contribution of a block depends only on what was collected in front of it. So a ray may be
//! passed from brick to brick together with what it has collected ([`PartialIntegral`]): the result
//! has the bits of one march through the whole volume.

use super::layer::MarchState;
use super::{
    Interpolation, MACROCELL, Volume, VolumeError, VolumeOptions, VolumeQuality, VolumeReport,
    VolumeSample, scan,
};
use crate::grid::Grid;
use crate::transfer_function::TransferFunction;
use fearless_simd::Level;
use glam::{DVec3, UVec3};
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

/// A uniform grid without its values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridExtent {
    /// Points per axis.
    pub dims: UVec3,
    /// World position of the first point.
    pub origin: DVec3,
    /// World distance between neighbouring points, positive.
    pub spacing: DVec3,
}

impl GridExtent {
    /// Cells per axis: between points, or boxes around them.
    fn cells(&self, around_points: bool) -> UVec3 {
        if around_points { self.dims } else { self.dims.saturating_sub(UVec3::ONE) }
    }

    /// World position of the last point.
    pub fn max_corner(&self) -> DVec3 {
        self.origin + self.spacing * (self.dims - UVec3::ONE).as_dvec3()
    }

    /// Blocks per axis, of cells between points or of boxes around them.
    pub fn blocks(&self, around_points: bool) -> UVec3 {
        self.cells(around_points).map(|cells| cells.div_ceil(MACROCELL))
    }
}

impl Brick {
    /// No block.
    pub const EMPTY: Brick = Brick { first: UVec3::ZERO, end: UVec3::ZERO };

    /// The points of a grid of `dims` points that the part with this brick holds: from the first
    /// to before the second. A brick without blocks holds one.
    pub fn points(&self, dims: UVec3, around_points: bool) -> [UVec3; 2] {
        if self.is_empty() {
            return [UVec3::ZERO, UVec3::ONE];
        }
        let cells = if around_points { dims } else { dims - UVec3::ONE };
        let low = (self.first * MACROCELL).saturating_sub(UVec3::splat(GHOSTS));
        let end = (self.end.saturating_mul(UVec3::splat(MACROCELL))).min(cells);
        [low, (end + UVec3::splat(GHOSTS + 1)).min(dims)]
    }

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
    /// hold. A stored volume reads the block.
    pub fn is_occupied(&self, block: UVec3) -> bool {
        if let Some(stored) = &self.stored {
            return self.is_occupied_in(stored, block);
        }
        self.held.contains(block) && self.occupied[self.block_index(block)]
    }

    /// The index of a block that is held here.
    pub(super) fn block_index(&self, block: UVec3) -> usize {
        let size = (self.held.end - self.held.first).as_usizevec3();
        let at = (block - self.held.first).as_usizevec3();
        (at.z * size.y + at.y) * size.x + at.x
    }

    /// The data that `brick` needs: the values of its cells with two ghost layers of points, for
    /// gradients. The rest of the volume is clear here. See [`RaySegments`](super::RaySegments) for
    /// an example. The part of a stored volume is in memory, without values where they cannot be
    /// read ([`Volume::failure`]).
    pub fn part(&self, brick: Brick) -> Volume {
        let brick = Brick { first: brick.first, end: brick.end.min(self.blocks) };
        if let Some(stored) = &self.stored {
            return self.read_part(stored, brick);
        }
        let [low, high] = if brick.is_empty() {
            [self.first_point, self.first_point + UVec3::ONE]
        } else {
            brick.points(self.dims, self.is_nearest())
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
        self.part_of_points(brick, low, grid)
    }

    /// The part of this volume that holds `grid`, whose first point is `low` in the whole.
    pub(super) fn part_of_points(&self, brick: Brick, low: UVec3, grid: Grid) -> Volume {
        let (transfer, options) = (self.transfer.clone(), self.options.clone());
        Volume {
            level: self.level,
            ..Volume::of_points(self.extent(), brick, low, grid, transfer, options)
        }
    }

    /// The part of a volume that [`Volume::part`] of the whole would give, where nobody has the
    /// whole. `values` are those of the points [`Brick::points`] of `brick`, x fastest.
    ///
    /// # Errors
    /// [`VolumeError::NoCells`] and [`VolumeError::Shading`] as [`Volume::new`], and
    /// [`VolumeError::Brick`] for another number of values or a grid that is none.
    pub fn from_brick(
        whole: GridExtent,
        brick: Brick,
        values: Vec<f32>,
        transfer: TransferFunction,
        options: VolumeOptions,
    ) -> Result<Volume, VolumeError> {
        if whole.dims.min_element() < 2 {
            return Err(VolumeError::NoCells { dims: whole.dims });
        }
        options.check((whole.spacing * (whole.dims - 1).as_dvec3()).length())?;
        let nearest = options.interpolation == Interpolation::Nearest;
        let blocks = whole.blocks(nearest);
        let brick = Brick { first: brick.first.min(brick.end), end: brick.end.min(blocks) };
        let [low, high] = brick.points(whole.dims, nearest);
        let origin = whole.origin + whole.spacing * low.as_dvec3();
        let grid = Grid::new(high - low, origin, whole.spacing, values)?;
        Ok(Volume::of_points(whole, brick, low, grid, Arc::new(transfer), options))
    }

    /// A part that holds `grid`, whose first point is `low` in the whole.
    fn of_points(
        whole: GridExtent,
        brick: Brick,
        low: UVec3,
        grid: Grid,
        transfer: Arc<TransferFunction>,
        options: VolumeOptions,
    ) -> Volume {
        let nearest = options.interpolation == Interpolation::Nearest;
        let cells = whole.cells(nearest);
        let held = if brick.is_empty() { Brick::EMPTY } else { brick };
        let (mut ranges, mut report) = (Vec::new(), VolumeReport::default());
        for z in held.first.z..held.end.z {
            for y in held.first.y..held.end.y {
                for x in held.first.x..held.end.x {
                    let first = UVec3::new(x, y, z) * MACROCELL;
                    let end = (first + MACROCELL).min(cells);
                    let (range, bad) = scan(&grid, first - low, end - low, nearest);
                    ranges.push(range);
                    report.cells += (end - first).as_u64vec3().element_product();
                    report.cells_non_finite += bad;
                    report.macrocells += 1;
                }
            }
        }
        let mut part = Volume {
            grid: Arc::new(grid),
            transfer,
            // Samples near the border of a brick would need more ghosts.
            options: VolumeOptions { sample_distance: None, ..options },
            dims: whole.dims,
            origin: whole.origin,
            first_point: low,
            held,
            ranges,
            occupied: Vec::new(),
            filled: Vec::new(),
            blocks: whole.blocks(nearest),
            report,
            level: Level::new(),
            samples: None,
            stored: None,
            unread: None,
        };
        part.find_occupied();
        part
    }
}
