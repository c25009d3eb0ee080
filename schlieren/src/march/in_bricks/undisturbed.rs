//! Which cells of a brick have the gas of the reference medium around them.
//!
//! There a sample gives an eps of 0 and no gradient, whatever its place in the cell. So the march
//! need not take it, with the same bits: ahead of a blast, a jet or a body in a free stream that is
//! most of the light's way.

use super::Brick;
use rayon::prelude::*;

/// Cells along each side of a block. Smaller blocks follow the gas more closely; each reads the
/// nodes around its cells again, 2.6 times as many as it has cells.
const SIDE: usize = 8;

/// Blocks of a brick's cells, each with whether all samples in it give exactly 0.
#[derive(Debug, Clone)]
pub struct Undisturbed {
    first: [usize; 3],
    blocks: [usize; 3],
    is_undisturbed: Vec<bool>,
}

impl Undisturbed {
    /// Reads the nodes that samples in the cells of `brick` need: `layers` more on each side than
    /// those of its cells, within a lattice of `dims` nodes. Uses rayon's threads if `parallel`.
    pub(super) fn of(
        brick: &impl Brick,
        dims: [usize; 3],
        layers: usize,
        parallel: bool,
    ) -> Undisturbed {
        let [first, end] = brick.cells();
        let mut blocks = [0; 3];
        for c in 0..3 {
            blocks[c] = end[c].saturating_sub(first[c]).div_ceil(SIDE);
        }
        let is_zero = |block: usize| {
            let at =
                [block % blocks[0], block / blocks[0] % blocks[1], block / (blocks[0] * blocks[1])];
            let (mut low, mut high) = ([0; 3], [0; 3]);
            for c in 0..3 {
                let cell = first[c] + at[c] * SIDE;
                low[c] = cell.saturating_sub(layers);
                // The last node of the last cell, and those behind it.
                high[c] = ((cell + SIDE).min(end[c]) + layers).min(dims[c] - 1);
            }
            (low[2]..=high[2]).all(|z| {
                (low[1]..=high[1]).all(|y| (low[0]..=high[0]).all(|x| brick.eps([x, y, z]) == 0.0))
            })
        };
        let count = blocks.iter().product();
        let is_undisturbed = match parallel {
            true => (0..count).into_par_iter().map(is_zero).collect(),
            false => (0..count).map(is_zero).collect(),
        };
        Undisturbed { first, blocks, is_undisturbed }
    }

    /// Whether a sample in this cell of the brick gives 0.
    #[inline(always)]
    pub fn contains(&self, cell: [usize; 3]) -> bool {
        let [x, y, z] = cell;
        let [fx, fy, fz] = self.first;
        let (x, y, z) = (x.wrapping_sub(fx), y.wrapping_sub(fy), z.wrapping_sub(fz));
        let block = (z / SIDE * self.blocks[1] + y / SIDE) * self.blocks[0] + x / SIDE;
        self.is_undisturbed.get(block).is_some_and(|is| *is)
    }
}
