//! The form of the file. All numbers are little-endian.
//!
//! ```text
//! byte 0     header: 128 bytes
//!   0        the letters RTSVVOLU
//!   8        u32 version (1), u32 checksum of the header with zero in this place
//!   16       u64 length of the file, u64 byte of the table
//!   32       3 u32 points along x, y and z, u32 type of a value ([`ValueType`])
//!   48       3 f64 origin, 3 f64 spacing
//!   96       f32 smallest and f32 largest finite value (the first is the larger without any)
//!   104      u64 values that are not finite
//!   112      u32 checksum of the table, zeros
//! byte 128   bricks: the values of their points, x fastest
//! at the end the table: 24 bytes for each brick, those along x first
//!   0        u64 byte of its values; 0 where all are equal and none is stored
//!   8        f32 smallest and f32 largest finite value
//!   16       u32 checksum, u32 1 where a value is not finite, else 0
//! ```
//!
//! A brick has 32 x 32 x 32 cells, or what is left of them at the far faces, and all points of its
//! cells: neighbours share a layer of points. Checksums are CRC-32 (IEEE 802.3). The header is
//! written last: a file without it was not finished.

use super::layout::{ValueType, VolumeLayout};
use crate::paging::fields::{Fields, checksum, get, get_u32, get_u64};
use glam::{DVec3, UVec3};

pub(super) const MAGIC: &[u8; 8] = b"RTSVVOLU";
pub(super) const VERSION: u32 = 1;
pub(super) const HEADER_BYTES: usize = 128;
pub(super) const ENTRY_BYTES: usize = 24;

/// What the header says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Header {
    pub(super) length: u64,
    pub(super) table: u64,
    pub(super) layout: VolumeLayout,
    pub(super) range: [f32; 2],
    pub(super) non_finite: u64,
    pub(super) table_checksum: u32,
}

/// A brick in the table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct BrickEntry {
    /// 0 where no values are stored.
    pub(super) offset: u64,
    /// Smallest and largest finite value.
    pub(super) range: [f32; 2],
    pub(super) checksum: u32,
    pub(super) has_non_finite: bool,
}

/// Why bytes are no header.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum NoHeader {
    OtherFile,
    OtherVersion(u32),
    Damaged,
    /// No type of values has this number.
    ValueType(u32),
}

impl Header {
    pub(super) fn bytes(&self) -> [u8; HEADER_BYTES] {
        let mut bytes = [0; HEADER_BYTES];
        let mut fields = Fields(&mut bytes);
        let VolumeLayout { dims, origin, spacing, values } = self.layout;
        fields.put(0, *MAGIC);
        fields.put(8, VERSION.to_le_bytes());
        fields.put(16, self.length.to_le_bytes());
        fields.put(24, self.table.to_le_bytes());
        for (i, n) in dims.to_array().into_iter().chain([values.number()]).enumerate() {
            fields.put(32 + 4 * i, n.to_le_bytes());
        }
        for (i, x) in origin.to_array().into_iter().chain(spacing.to_array()).enumerate() {
            fields.put(48 + 8 * i, x.to_le_bytes());
        }
        for (i, x) in self.range.into_iter().enumerate() {
            fields.put(96 + 4 * i, x.to_le_bytes());
        }
        fields.put(104, self.non_finite.to_le_bytes());
        fields.put(112, self.table_checksum.to_le_bytes());
        let sum = checksum(&bytes);
        Fields(&mut bytes).put(12, sum.to_le_bytes());
        bytes
    }

    pub(super) fn read(bytes: &[u8; HEADER_BYTES]) -> Result<Header, NoHeader> {
        if bytes[..8] != *MAGIC {
            return Err(NoHeader::OtherFile);
        }
        let version = get_u32(bytes, 8);
        if version != VERSION {
            return Err(NoHeader::OtherVersion(version));
        }
        let mut without_sum = *bytes;
        without_sum[12..16].fill(0);
        if checksum(&without_sum) != get_u32(bytes, 12) {
            return Err(NoHeader::Damaged);
        }
        let number = get_u32(bytes, 44);
        let vector = |at: usize| {
            DVec3::from_array([0, 8, 16].map(|i| f64::from_le_bytes(get(bytes, at + i))))
        };
        let layout = VolumeLayout {
            dims: UVec3::from_array([32, 36, 40].map(|at| get_u32(bytes, at))),
            origin: vector(48),
            spacing: vector(72),
            values: ValueType::of_number(number).ok_or(NoHeader::ValueType(number))?,
        };
        Ok(Header {
            length: get_u64(bytes, 16),
            table: get_u64(bytes, 24),
            layout,
            range: [96, 100].map(|at| f32::from_bits(get_u32(bytes, at))),
            non_finite: get_u64(bytes, 104),
            table_checksum: get_u32(bytes, 112),
        })
    }
}

impl BrickEntry {
    pub(super) fn bytes(&self) -> [u8; ENTRY_BYTES] {
        let mut bytes = [0; ENTRY_BYTES];
        let mut fields = Fields(&mut bytes);
        fields.put(0, self.offset.to_le_bytes());
        fields.put(8, self.range[0].to_le_bytes());
        fields.put(12, self.range[1].to_le_bytes());
        fields.put(16, self.checksum.to_le_bytes());
        fields.put(20, u32::from(self.has_non_finite).to_le_bytes());
        bytes
    }

    /// The entry in the first [`ENTRY_BYTES`] of `bytes`.
    pub(super) fn read(bytes: &[u8]) -> BrickEntry {
        BrickEntry {
            offset: get_u64(bytes, 0),
            range: [8, 12].map(|at| f32::from_bits(get_u32(bytes, at))),
            checksum: get_u32(bytes, 16),
            has_non_finite: get_u32(bytes, 20) != 0,
        }
    }
}
