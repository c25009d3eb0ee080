//! Volumes whose values are in a file: where a ray enters a brick of the file, the part of the
//! volume there is made from it, as [`Volume::part`] would cut it out of the whole. So results have
//! the bits of the volume in memory.

use super::cell_batch::CellBatch;
use super::layer::MarchState;
use super::linear_segment::RayInLanes;
use super::{Brick, GridExtent, MACROCELL, Volume, VolumeError, VolumeOptions, VolumeReport};
use crate::grid::Grid;
use crate::paging::{PageCache, PageUse, Paged};
use crate::stored_volume::{BRICK_CELLS, StoredVolume};
use crate::transfer_function::TransferFunction;
use glam::UVec3;
use std::fmt;
use std::sync::Arc;

/// Blocks along the edge of a brick.
const BRICK_BLOCKS: u32 = BRICK_CELLS / MACROCELL;

/// The file behind a volume, and the parts of the volume that rays have used last.
pub(super) struct StoredBlocks {
    source: Arc<StoredVolume>,
    budget: usize,
    parts: PageCache<Volume>,
    /// Whether a brick has no extinction at any scalar of its range.
    clear: Vec<bool>,
}

impl fmt::Debug for StoredBlocks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (layout, budget) = (self.source.layout(), self.budget);
        f.debug_struct("StoredBlocks").field("layout", &layout).field("budget", &budget).finish()
    }
}

impl Paged for Volume {
    fn bytes(&self) -> usize {
        let blocks = size_of_val(&self.ranges[..]) + self.occupied.len() + self.filled.len();
        size_of::<Volume>() + size_of_val(self.grid.values()) + blocks
    }
}

impl StoredBlocks {
    fn new(source: Arc<StoredVolume>, budget: usize, transfer: &TransferFunction) -> StoredBlocks {
        let is_clear = |number: u32| {
            let [lo, hi] = source.brick_range(number);
            lo > hi || transfer.is_clear(lo.into(), hi.into())
        };
        let clear = (0..source.num_bricks()).map(is_clear).collect();
        let parts = PageCache::new(source.num_bricks() as usize, budget);
        StoredBlocks { source, budget, parts, clear }
    }

    /// The same file with no part in memory.
    pub(super) fn anew(&self, transfer: &TransferFunction) -> StoredBlocks {
        StoredBlocks::new(self.source.clone(), self.budget, transfer)
    }

    /// The brick that has a block. The blocks of cells around points may be one more along an axis
    /// than those of bricks: the last brick has all of its points.
    fn brick_of(&self, block: UVec3) -> UVec3 {
        (block / BRICK_BLOCKS).min(self.source.layout().bricks() - UVec3::ONE)
    }

    /// Smallest and largest finite value of the brick that begins at a cell.
    pub(super) fn range_at(&self, cell: [i64; 3]) -> [f32; 2] {
        let brick = self.brick_of(UVec3::from_array(cell.map(|c| c as u32)) / MACROCELL);
        self.source.brick_range(self.source.layout().number(brick))
    }

    fn is_clear(&self, brick: UVec3) -> bool {
        self.clear[self.source.layout().number(brick) as usize]
    }

    /// Why a brick of the file could not be read.
    pub(super) fn failure(&self) -> Option<&str> {
        self.source.failure()
    }

    pub(super) fn report(&self, blocks: UVec3, cells: UVec3) -> VolumeReport {
        let bricks = self.source.layout().bricks();
        let clear = self.clear.iter().zip(0..).filter(|(clear, _)| **clear);
        let blocks_of = |number: u32| {
            let (row, x) = (number / bricks.x, number % bricks.x);
            let brick = UVec3::new(x, row % bricks.y, row / bricks.y);
            let Brick { first, end } = brick_blocks(brick, bricks, blocks);
            (end - first).as_u64vec3().element_product()
        };
        VolumeReport {
            cells: cells.as_u64vec3().element_product(),
            cells_non_finite: 0,
            macrocells: blocks.as_u64vec3().element_product(),
            macrocells_clear: clear.map(|(_, number)| blocks_of(number)).sum(),
        }
    }
}

/// The blocks of one of `bricks`, of a volume of `blocks`.
fn brick_blocks(brick: UVec3, bricks: UVec3, blocks: UVec3) -> Brick {
    let is_last = (brick + UVec3::ONE).cmpeq(bricks);
    let end = UVec3::select(is_last, blocks, (brick + UVec3::ONE) * BRICK_BLOCKS);
    Brick { first: brick * BRICK_BLOCKS, end }
}

impl Volume {
    /// A volume whose values stay in a file and are read where rays meet them, for more points than
    /// memory holds. Results are those of [`Volume::new`] of the same values, bit for bit. Rays go
    /// through parts in single precision, each of a brick's 32³ cells and 0.2 MB. They take at most
    /// `budget` bytes, and the last 16 parts of each thread besides; `source` has its own budget.
    ///
    /// Values that cannot be read count as NaN, which is transparent, and a render fails with the
    /// reason ([`Volume::failure`]). [`Volume::grid`] has one point only, and [`Volume::report`]
    /// counts what bricks tell: blocks are clear where a whole brick is, and cells with values that
    /// are not finite are not counted.
    ///
    /// # Errors
    /// As [`Volume::new`], and with [`VolumeOptions::sample_distance`]: samples are taken of
    /// volumes in memory alone.
    pub fn stored(
        source: Arc<StoredVolume>,
        budget: usize,
        transfer: TransferFunction,
        options: VolumeOptions,
    ) -> Result<Volume, VolumeError> {
        if options.sample_distance.is_some() {
            return Err(VolumeError::StoredSamples);
        }
        let layout = source.layout();
        let whole =
            GridExtent { dims: layout.dims, origin: layout.origin, spacing: layout.spacing };
        let none = vec![f32::NAN];
        let mut volume = Volume::from_brick(whole, Brick::EMPTY, none, transfer, options)?;
        let stored = StoredBlocks::new(source, budget, &volume.transfer);
        volume.report = stored.report(volume.blocks, volume.cells());
        volume.stored = Some(Arc::new(stored));
        Ok(volume)
    }

    /// Why values could not be read from the file of a [stored](Volume::stored) volume, or of the
    /// one that this is a [part](Volume::part) of.
    pub fn failure(&self) -> Option<&str> {
        let of_file = self.stored.as_ref().and_then(|stored| stored.failure());
        of_file.or(self.unread.as_deref())
    }

    /// What the parts of a [stored](Volume::stored) volume take; `None` for others.
    pub fn page_use(&self) -> Option<PageUse> {
        self.stored.as_ref().map(|stored| stored.parts.page_use())
    }

    /// The part with these blocks, from the file.
    pub(super) fn read_part(&self, stored: &StoredBlocks, brick: Brick) -> Volume {
        let [low, end] = brick.points(self.dims, self.is_nearest());
        let size = end - low;
        let values = stored.source.values_in(low, end);
        let unread = values.is_none().then(|| stored.failure().map(String::from)).flatten();
        let count = size.as_usizevec3().element_product();
        let values = values.unwrap_or_else(|| vec![f32::NAN; count]);
        let spacing = self.grid.spacing;
        let origin = self.origin + spacing * low.as_dvec3();
        let grid = Grid { dims: size, origin, spacing, values };
        Volume { unread, ..self.part_of_points(brick, low, grid) }
    }

    /// Calls `work` with the part that has a brick. `None` where that cannot be read.
    fn with_part<R>(
        &self,
        stored: &StoredBlocks,
        brick: UVec3,
        work: impl FnOnce(&Volume) -> R,
    ) -> Option<R> {
        let layout = stored.source.layout();
        let read = || {
            let blocks = brick_blocks(brick, layout.bricks(), self.blocks);
            let part = self.read_part(stored, blocks);
            part.unread.is_none().then_some(part)
        };
        stored.parts.with(layout.number(brick), read, work)
    }

    /// Calls `work` with the part that begins at a cell.
    pub(super) fn with_part_at<R>(
        &self,
        stored: &StoredBlocks,
        cell: [i64; 3],
        work: impl FnOnce(&Volume) -> R,
    ) -> Option<R> {
        let block = UVec3::from_array(cell.map(|c| c as u32)) / MACROCELL;
        self.with_part(stored, stored.brick_of(block), work)
    }

    /// Whether a block of the file has any extinction.
    pub(super) fn is_occupied_in(&self, stored: &StoredBlocks, block: UVec3) -> bool {
        let brick = stored.brick_of(block);
        block.cmplt(self.blocks).all()
            && !stored.is_clear(brick)
            && self.with_part(stored, brick, |part| part.is_occupied(block)).unwrap_or(false)
    }

    /// [`Volume::march_block`] of a block in the file.
    pub(super) fn march_block_in(
        &self,
        stored: &StoredBlocks,
        ray: &RayInLanes<'_>,
        anchor: f64,
        block: UVec3,
        span: [f64; 2],
        m: &mut MarchState,
    ) {
        let brick = stored.brick_of(block);
        if !stored.is_clear(brick) {
            self.with_part(stored, brick, |part| part.march_block(ray, anchor, block, span, m));
        }
    }

    /// Continues through all bricks between `t0` and `t1`. The ray enters the grid at `anchor`.
    pub(super) fn march_bricks(
        &self,
        stored: &StoredBlocks,
        ray: &RayInLanes<'_>,
        anchor: f64,
        [t0, t1]: [f64; 2],
        m: &mut MarchState,
    ) {
        let cells = self.cells().to_array().map(i64::from);
        let mut batch = CellBatch::new();
        let (brick_cells, block_cells) = (i64::from(BRICK_CELLS), i64::from(MACROCELL));
        // Walks of parts have the cells and parameters of a walk of the whole (`grid_walk`).
        ray.index_ray.walk([0; 3], cells, cells, brick_cells, t0, t1, |brick| {
            let first = brick.cell.map(|c| c as u32 / MACROCELL);
            if stored.is_clear(stored.brick_of(UVec3::from_array(first))) {
                return true;
            }
            let end = std::array::from_fn(|a| (brick.cell[a] + brick_cells).min(cells[a]));
            self.with_part_at(stored, brick.cell, |part| {
                ray.index_ray.walk(brick.cell, end, cells, block_cells, t0, t1, |passed| {
                    let block = UVec3::from_array(passed.cell.map(|c| c as u32 / MACROCELL));
                    let span = [passed.t0, passed.t1];
                    part.enter_block(ray, anchor, block, span, &mut batch, m);
                    !m.is_opaque()
                });
                // What the batch holds refers to cells of this part.
                part.finish_batch(ray, &mut batch, m);
            });
            !m.is_opaque()
        });
    }
}
