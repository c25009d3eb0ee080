//! A brick in memory: its values as they are stored, and the ranges of small blocks of them, so
//! that rays pass over what no surface crosses.

use super::active_cells::{ActiveCells, sides};
use super::layout::{BLOCK_CELLS, BRICK_CELLS, BrickBox, ValueType};
use crate::paging::Paged;
use glam::UVec3;
use std::sync::OnceLock;

/// Values of one type.
pub(super) enum Values {
    U8(Vec<u8>),
    I8(Vec<i8>),
    U16(Vec<u16>),
    I16(Vec<i16>),
    F32(Vec<f32>),
}

/// Does `$work` with the slice of values `$values` of any type.
macro_rules! with_values {
    ($all:expr, |$values:ident| $work:expr) => {
        match $all {
            Values::U8($values) => $work,
            Values::I8($values) => $work,
            Values::U16($values) => $work,
            Values::I16($values) => $work,
            Values::F32($values) => $work,
        }
    };
}

impl Values {
    /// `count` zeros.
    pub(super) fn zeros(of: ValueType, count: usize) -> Values {
        match of {
            ValueType::U8 => Values::U8(vec![0; count]),
            ValueType::I8 => Values::I8(vec![0; count]),
            ValueType::U16 => Values::U16(vec![0; count]),
            ValueType::I16 => Values::I16(vec![0; count]),
            ValueType::F32 => Values::F32(vec![0.0; count]),
        }
    }

    /// Their bytes, as they are in little-endian files.
    pub(super) fn bytes_mut(&mut self) -> &mut [u8] {
        match self {
            Values::U8(v) => v,
            Values::I8(v) => bytemuck::cast_slice_mut(v),
            Values::U16(v) => bytemuck::cast_slice_mut(v),
            Values::I16(v) => bytemuck::cast_slice_mut(v),
            Values::F32(v) => bytemuck::cast_slice_mut(v),
        }
    }

    pub(super) fn bytes(&self) -> &[u8] {
        match self {
            Values::U8(v) => v,
            Values::I8(v) => bytemuck::cast_slice(v),
            Values::U16(v) => bytemuck::cast_slice(v),
            Values::I16(v) => bytemuck::cast_slice(v),
            Values::F32(v) => bytemuck::cast_slice(v),
        }
    }

    /// For each row of a whole brick, a bit for each value that is below `iso`, and one for each
    /// that is not.
    fn sides_of_rows(&self, iso: f32, out: &mut [[u64; 2]]) {
        with_values!(self, |values| sides(values, iso, out));
    }

    /// Smallest and largest finite value, and whether there are others.
    pub(super) fn range(&self) -> ([f32; 2], bool) {
        let mut range = [f32::INFINITY, f32::NEG_INFINITY];
        let mut has_non_finite = false;
        with_values!(self, |values| {
            for &value in values {
                let value = number(value);
                has_non_finite |= !value.is_finite();
                include(&mut range, value);
            }
        });
        (range, has_non_finite)
    }
}

/// A value of any type as a number.
#[inline(always)]
fn number(value: impl Into<f32>) -> f32 {
    value.into()
}

/// Adds a value to a range, if it is finite.
#[inline(always)]
fn include(range: &mut [f32; 2], value: f32) {
    if value.is_finite() {
        *range = [range[0].min(value), range[1].max(value)];
    }
}

/// The values of a brick.
pub(super) struct StoredBrick {
    pub(super) place: BrickBox,
    values: Values,
    points: [usize; 3],
    blocks: [u32; 3],
    /// Smallest and largest finite value of each block, x fastest.
    ranges: OnceLock<Vec<[f32; 2]>>,
    /// Of the surfaces that asked for them first.
    active: OnceLock<ActiveCells>,
}

impl StoredBrick {
    /// `values` are as many as `place` has points.
    pub(super) fn new(place: BrickBox, values: Values) -> StoredBrick {
        let cells = place.hi - place.lo;
        let blocks = cells.map(|n| n.div_ceil(BLOCK_CELLS));
        let points = place.points().to_array().map(|n| n as usize);
        StoredBrick {
            place,
            values,
            points,
            blocks: blocks.to_array(),
            ranges: OnceLock::new(),
            active: OnceLock::new(),
        }
    }

    /// Smallest and largest finite value of each block.
    fn ranges_of_blocks(&self) -> Vec<[f32; 2]> {
        let (cells, points) = (self.place.hi - self.place.lo, self.points);
        let blocks = UVec3::from_array(self.blocks);
        let mut ranges = Vec::with_capacity(blocks.element_product() as usize);
        with_values!(&self.values, |values| {
            for z in 0..blocks.z {
                for y in 0..blocks.y {
                    for x in 0..blocks.x {
                        let lo = UVec3::new(x, y, z) * BLOCK_CELLS;
                        let hi = (lo + BLOCK_CELLS).min(cells);
                        let mut range = [f32::INFINITY, f32::NEG_INFINITY];
                        for k in lo.z..=hi.z {
                            for j in lo.y..=hi.y {
                                let row = (k as usize * points[1] + j as usize) * points[0];
                                for &value in &values[row + lo.x as usize..=row + hi.x as usize] {
                                    include(&mut range, number(value));
                                }
                            }
                        }
                        ranges.push(range);
                    }
                }
            }
        });
        ranges
    }

    /// Smallest and largest finite value of the block whose lowest cell is `cell` of the lattice.
    #[inline]
    pub(super) fn block_range(&self, cell: UVec3) -> [f32; 2] {
        let [x, y, z] = ((cell - self.place.lo) / BLOCK_CELLS).to_array();
        let ranges = self.ranges.get_or_init(|| self.ranges_of_blocks());
        ranges[((z * self.blocks[1] + y) * self.blocks[0] + x) as usize]
    }

    /// The cells that these surfaces may cross. `None` in a brick at a far face that is not whole,
    /// and where surfaces with another number asked first: [`Self::block_range`] serves all.
    #[inline]
    pub(super) fn active_cells(&self, isovalues: &[f32], surfaces: u64) -> Option<&ActiveCells> {
        if self.place.hi - self.place.lo != UVec3::splat(BRICK_CELLS) {
            return None;
        }
        let sides = |iso: f32, out: &mut [[u64; 2]]| self.values.sides_of_rows(iso, out);
        let make = || ActiveCells::new(sides, isovalues, surfaces);
        let active = self.active.get_or_init(make);
        active.are_of(surfaces).then_some(active)
    }

    /// Whether it has a point of the lattice.
    #[inline]
    pub(super) fn has(&self, point: UVec3) -> bool {
        point.cmpge(self.place.lo).all() && point.cmple(self.place.hi).all()
    }

    #[inline(always)]
    fn index(&self, point: UVec3) -> usize {
        let UVec3 { x, y, z } = point - self.place.lo;
        let (x, y, z) = (x as usize, y as usize, z as usize);
        (z * self.points[1] + y) * self.points[0] + x
    }

    /// The value of a point that it [has](Self::has).
    #[inline]
    pub(super) fn at(&self, point: UVec3) -> f32 {
        let index = self.index(point);
        with_values!(&self.values, |values| number(values[index]))
    }

    /// The values of neighbours along x, from a point on; all are points that it [has](Self::has).
    #[cfg(feature = "render")]
    pub(super) fn row(&self, first: UVec3, out: &mut [f32]) {
        let index = self.index(first);
        with_values!(&self.values, |values| {
            for (out, &value) in out.iter_mut().zip(&values[index..]) {
                *out = number(value);
            }
        });
    }

    /// The values of 4 x 4 x 4 points around a cell, x fastest, where it has them all.
    #[inline]
    pub(super) fn around(&self, cell: UVec3) -> Option<[f32; 64]> {
        let inside = cell.cmpgt(self.place.lo).all() && (cell + 2).cmple(self.place.hi).all();
        if !inside {
            return None;
        }
        let first = self.index(cell - 1);
        let mut around = [0.0; 64];
        with_values!(&self.values, |values| {
            for (n, four) in around.chunks_exact_mut(4).enumerate() {
                let row = first + (n / 4 * self.points[1] + n % 4) * self.points[0];
                for (to, &from) in four.iter_mut().zip(&values[row..row + 4]) {
                    *to = number(from);
                }
            }
        });
        Some(around)
    }

    /// The values at the corners of a cell of this brick, x fastest.
    #[inline(always)]
    pub(super) fn corners(&self, cell: UVec3) -> [f32; 8] {
        let i = self.index(cell);
        let (y, z) = (self.points[0], self.points[0] * self.points[1]);
        with_values!(&self.values, |v| {
            // One check for all of them.
            let v = &v[i..=i + z + y + 1];
            let (low, high) =
                ([v[0], v[1], v[y], v[y + 1]], [v[z], v[z + 1], v[z + y], v[z + y + 1]]);
            let mut corners = [0.0; 8];
            for k in 0..4 {
                (corners[k], corners[4 + k]) = (number(low[k]), number(high[k]));
            }
            corners
        })
    }
}

impl Paged for StoredBrick {
    fn bytes(&self) -> usize {
        // What is made when a ray first asks for it counts from the start.
        let blocks = self.blocks.iter().product::<u32>() as usize;
        self.values.bytes().len() + blocks * size_of::<[f32; 2]>() + ActiveCells::BYTES
    }
}
