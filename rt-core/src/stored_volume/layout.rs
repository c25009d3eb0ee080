//! The lattice of a stored volume, the type of its values, and its division into bricks.

use super::error::StoredVolumeError;
use glam::{DVec3, UVec3};

/// Cells along the edge of a brick.
pub(crate) const BRICK_CELLS: u32 = 32;

/// Cells along the edge of a block of a brick.
pub(super) const BLOCK_CELLS: u32 = 4;

/// How a value is stored. All are little-endian.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ValueType {
    /// 8 bits, 0 to 255.
    U8,
    /// 8 bits, -128 to 127.
    I8,
    /// 16 bits, 0 to 65,535.
    U16,
    /// 16 bits, -32,768 to 32,767.
    I16,
    /// Single precision.
    F32,
}

impl ValueType {
    /// All types.
    pub const ALL: [ValueType; 5] =
        [ValueType::U8, ValueType::I8, ValueType::U16, ValueType::I16, ValueType::F32];

    /// Bytes of a value.
    pub fn bytes(self) -> usize {
        match self {
            ValueType::U8 | ValueType::I8 => 1,
            ValueType::U16 | ValueType::I16 => 2,
            ValueType::F32 => 4,
        }
    }

    /// Its number in files.
    pub(super) fn number(self) -> u32 {
        self as u32
    }

    pub(super) fn of_number(number: u32) -> Option<ValueType> {
        ValueType::ALL.into_iter().find(|t| t.number() == number)
    }
}

/// A lattice of points with a value of one type at each.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VolumeLayout {
    /// Points along x, y and z, each at least 2.
    pub dims: UVec3,
    /// World position of the first point.
    pub origin: DVec3,
    /// World distance between neighbouring points, positive.
    pub spacing: DVec3,
    /// How values are stored.
    pub values: ValueType,
}

/// Which cells and points a brick has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct BrickBox {
    /// The first cell, which is also the first point.
    pub(super) lo: UVec3,
    /// One past the last cell, which is also the last point.
    pub(super) hi: UVec3,
}

impl BrickBox {
    /// Points along each axis.
    pub(super) fn points(&self) -> UVec3 {
        self.hi - self.lo + UVec3::ONE
    }

    /// Number of points.
    pub(super) fn count(&self) -> usize {
        self.points().as_u64vec3().element_product() as usize
    }
}

impl VolumeLayout {
    /// Bytes of the points of one z.
    pub(super) fn plane_bytes(&self) -> u64 {
        u64::from(self.dims.x) * u64::from(self.dims.y) * self.values.bytes() as u64
    }

    /// Bricks along each axis.
    pub(crate) fn bricks(&self) -> UVec3 {
        self.dims.map(|points| points.saturating_sub(1).div_ceil(BRICK_CELLS))
    }

    /// The number of the brick with these places along the axes.
    pub(crate) fn number(&self, place: UVec3) -> u32 {
        let bricks = self.bricks();
        (place.z * bricks.y + place.y) * bricks.x + place.x
    }

    /// The points of a brick.
    pub(super) fn brick(&self, number: u32) -> BrickBox {
        let bricks = self.bricks();
        let (row, x) = (number / bricks.x, number % bricks.x);
        let lo = UVec3::new(x, row % bricks.y, row / bricks.y) * BRICK_CELLS;
        BrickBox { lo, hi: (lo + BRICK_CELLS).min(self.dims - UVec3::ONE) }
    }

    /// A brick that has the point.
    pub(super) fn brick_of(&self, point: UVec3) -> u32 {
        self.number((point / BRICK_CELLS).min(self.bricks() - UVec3::ONE))
    }

    /// # Errors
    /// [`StoredVolumeError::Lattice`].
    pub(super) fn check(&self) -> Result<(), StoredVolumeError> {
        let bad = |field: &'static str, found: String, rule: &'static str| {
            Err(StoredVolumeError::Lattice { field, found, rule })
        };
        if self.dims.min_element() < 2 {
            return bad("dims", self.dims.to_string(), "at least 2 along each axis");
        }
        if self.dims.max_element() > i32::MAX as u32 {
            return bad("dims", self.dims.to_string(), "below 2^31 along each axis");
        }
        if !(self.spacing.is_finite() && self.spacing.cmpgt(DVec3::ZERO).all()) {
            return bad("spacing", self.spacing.to_string(), "finite and positive in every axis");
        }
        if !self.origin.is_finite() {
            return bad("origin", self.origin.to_string(), "finite");
        }
        // `brick` and `number` count in 32 bits.
        if self.bricks().as_u64vec3().element_product() >= u64::from(u32::MAX) {
            return bad(
                "dims",
                self.dims.to_string(),
                "such that there are fewer than 2^32 bricks",
            );
        }
        Ok(())
    }
}
