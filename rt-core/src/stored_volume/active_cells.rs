//! Which cells of a brick a surface may cross: one bit a cell. A ray that looks for the surface
//! reads one word for 64 cells, and the values of cells that count alone.

use super::layout::{BLOCK_CELLS, BRICK_CELLS};

/// Blocks along the edge of a whole brick.
pub(super) const BLOCKS: usize = (BRICK_CELLS / BLOCK_CELLS) as usize;
/// Cells along the edge of a block.
const CELLS: usize = BLOCK_CELLS as usize;
/// Points along the edge of a whole brick.
const POINTS: usize = BRICK_CELLS as usize + 1;
/// A bit for each cell of a row.
const ROW: u64 = (1 << BRICK_CELLS) - 1;

/// The cells of a whole brick that surfaces may cross.
pub(super) struct ActiveCells {
    /// The surfaces for which they were looked for.
    surfaces: u64,
    /// A bit for each block that has active cells, x fastest: a line of the processor's cache, so
    /// that a ray in a brick waits for memory once, and then for blocks alone that count.
    some: [u64; BLOCKS],
    /// The box of those blocks along each axis: the first, and one past the last. Nothing else of
    /// the brick needs a look; without any it is empty.
    bounds: [[u8; 2]; 3],
    /// The cells of each block, x fastest in it and among the blocks.
    cells: Box<[u64; BLOCKS * BLOCKS * BLOCKS]>,
}

impl ActiveCells {
    /// Bytes of the bits.
    pub(super) const BYTES: usize = size_of::<[u64; BLOCKS * BLOCKS * BLOCKS]>();

    /// Those of a brick for the surfaces with this number. For an isovalue, `sides_of_rows` gives
    /// the two words of each row of points that [`sides`] makes. A cell is active where a corner is
    /// below an isovalue and another is not; what is not a number counts as neither.
    pub(super) fn new(
        sides_of_rows: impl Fn(f32, &mut [[u64; 2]]),
        isovalues: &[f32],
        surfaces: u64,
    ) -> ActiveCells {
        let mut cells = Box::new([0; BLOCKS * BLOCKS * BLOCKS]);
        let mut bits = vec![[0u64; 2]; POINTS * POINTS];
        for &iso in isovalues {
            sides_of_rows(iso, &mut bits);
            add(&bits, &mut cells);
        }
        let (mut some, mut bounds) = ([0; BLOCKS], [[BLOCKS as u8, 0]; 3]);
        for (n, _) in cells.iter().enumerate().filter(|(_, cells)| **cells != 0) {
            some[n / 64] |= 1 << (n % 64);
            let place = [n % BLOCKS, n / BLOCKS % BLOCKS, n / (BLOCKS * BLOCKS)];
            for ([first, end], at) in bounds.iter_mut().zip(place) {
                (*first, *end) = ((*first).min(at as u8), (*end).max(at as u8 + 1));
            }
        }
        ActiveCells { surfaces, some, bounds, cells }
    }

    /// Whether they were looked for by these surfaces.
    #[inline]
    pub(super) fn are_of(&self, surfaces: u64) -> bool {
        self.surfaces == surfaces
    }

    /// The blocks around all active cells along each axis: the first, and one past the last. `None`
    /// where no cell is active.
    #[inline(always)]
    pub(super) fn bounds(&self) -> Option<[[u8; 2]; 3]> {
        (self.bounds[0][0] < self.bounds[0][1]).then_some(self.bounds)
    }

    /// The active cells of all blocks.
    #[inline(always)]
    pub(super) fn all(&self) -> &[u64; BLOCKS * BLOCKS * BLOCKS] {
        &self.cells
    }

    /// The active cells of block `number`, below 512.
    #[inline(always)]
    pub(super) fn in_block(&self, number: usize) -> u64 {
        match (self.some[(number / 64) & (BLOCKS - 1)] >> (number % 64)) & 1 {
            0 => 0,
            _ => self.cells[number & (self.cells.len() - 1)],
        }
    }
}

/// Adds the cells of one isovalue. For each row of points, `rows` has a bit for each that is below
/// it and one for each that is not.
fn add(rows: &[[u64; 2]], blocks: &mut [u64; BLOCKS * BLOCKS * BLOCKS]) {
    for z in 0..BRICK_CELLS as usize {
        for y in 0..BRICK_CELLS as usize {
            let row = z * POINTS + y;
            let side = |side: usize| {
                let points = rows[row][side]
                    | rows[row + 1][side]
                    | rows[row + POINTS][side]
                    | rows[row + POINTS + 1][side];
                points | points >> 1
            };
            let mut cells = side(0) & side(1) & ROW;
            while cells != 0 {
                let block = cells.trailing_zeros() as usize / CELLS;
                let four = cells >> (block * CELLS) & 0xf;
                cells &= !(0xf << (block * CELLS));
                let place = ((z / CELLS) * BLOCKS + y / CELLS) * BLOCKS + block;
                blocks[place] |= four << (((z % CELLS) * CELLS + y % CELLS) * CELLS);
            }
        }
    }
}

/// The bits of the places whose byte is 1, for at most 64 bytes that are 0 or 1.
#[inline(always)]
fn bits_of(bytes: &[u8]) -> u64 {
    let mut bits = 0;
    for (n, eight) in bytes.chunks(8).enumerate() {
        let mut word = [0; 8];
        word[..eight.len()].copy_from_slice(eight);
        // The product brings bit 0 of byte i to bit 56 + i: no two of its terms meet there.
        let packed = u64::from_le_bytes(word).wrapping_mul(0x0102_0408_1020_4080) >> 56;
        bits |= packed << (8 * n);
    }
    bits
}

/// For each row of a whole brick's values, a bit for each that is below `iso`, and one for each
/// that is not.
#[inline(always)]
pub(super) fn sides<T: Copy + Into<f32>>(values: &[T], iso: f32, out: &mut [[u64; 2]]) {
    // Rows are longer than a brick's by what makes them whole words.
    const WHOLE: usize = POINTS.next_multiple_of(8);
    for (row, out) in values.chunks_exact(POINTS).zip(out) {
        let (mut below, mut above) = ([0u8; WHOLE], [0u8; WHOLE]);
        for ((below, above), &value) in below.iter_mut().zip(&mut above).zip(row) {
            let value: f32 = value.into();
            *below = u8::from(value < iso);
            *above = u8::from(value >= iso);
        }
        *out = [bits_of(&below), bits_of(&above)];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_is_active_where_a_corner_is_below_and_another_is_not() {
        let value = |x: usize, y: usize, z: usize| ((7 * x + 11 * y + 13 * z) % 17) as f32;
        let mut values = vec![];
        for n in 0..POINTS * POINTS * POINTS {
            let (x, y, z) = (n % POINTS, n / POINTS % POINTS, n / POINTS / POINTS);
            // A corner that is no number belongs to neither side.
            values.push(if n % 31 == 0 { f32::NAN } else { value(x, y, z) });
        }
        let isovalues = [0.5, 15.5, 16.0];
        let found = ActiveCells::new(|iso, out| sides(&values, iso, out), &isovalues, 3);
        assert!(found.are_of(3) && !found.are_of(4));
        let n = BRICK_CELLS as usize;
        for cell in 0..n * n * n {
            let (x, y, z) = (cell % n, cell / n % n, cell / n / n);
            let corners: [f32; 8] = std::array::from_fn(|c| {
                values[((z + (c >> 2)) * POINTS + y + (c >> 1 & 1)) * POINTS + x + (c & 1)]
            });
            let (lo, hi) = crate::shapes::isosurface_cell::min_max(&corners);
            let expected = isovalues.iter().any(|&iso| lo < iso && iso <= hi);
            let block = found.in_block(((z / CELLS) * BLOCKS + y / CELLS) * BLOCKS + x / CELLS);
            let bit = ((z % CELLS) * CELLS + y % CELLS) * CELLS + x % CELLS;
            assert_eq!(block >> bit & 1 == 1, expected, "cell {x} {y} {z}");
        }
    }
}
