//! The form of the file. All numbers are little-endian.
//!
//! ```text
//! byte 0     header: 128 bytes
//!   0        the letters RTSVMESH
//!   8        u32 version (6), u32 checksum of the header with zero in this place
//!   16       u64 length of the file, u64 byte of the table, u64 pages, u64 triangles,
//!            u64 triangles that were left out
//!   56       3 f64 origin
//!   80       3 f32 smallest and 3 f32 largest coordinates of the boxes
//!   104      u32 checksum of the table, u32 which attributes there are ([`Attributes::bits`])
//!   112      f32 smallest and f32 largest finite scalar; zeros
//! byte 128   pages, each a compact tree ([`crate::bvh::compact`]) of whole 32-byte units, and
//!            behind it the attributes of its triangles ([`super::attributes`]), if any
//! at the end the table: 64 bytes for each page
//!   0        u64 byte of the page, u64 number of its triangle 0
//!   16       u32 units, u32 triangles, u32 depth, u32 checksum
//!   32       3 f32 smallest and 3 f32 largest coordinates
//!   56       u32 words of attributes (32 bits each), u32 their checksum
//! ```
//!
//! Versions 1 and 2 had the numbers of meshlets in another order, and version 1 no attributes.
//! Versions 3 and 4 had other headers of meshlets, and version 5 one group of triangle numbers.
//!
//! Checksums are CRC-32 (IEEE 802.3). The header is written last: a file without it was not
//! finished.

use super::attributes::MeshAttributes;
use crate::math::Aabb;
use crate::paging::fields::{Fields, checksum, get, get_u32, get_u64};
use glam::{DVec3, Vec3};

pub(super) const MAGIC: &[u8; 8] = b"RTSVMESH";
pub(super) const VERSION: u32 = 6;
pub(super) const HEADER_BYTES: usize = 128;
pub(super) const ENTRY_BYTES: usize = 64;
/// Bytes of a unit of a page.
pub(super) const UNIT_BYTES: u64 = 32;

/// What the header says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Header {
    pub(super) length: u64,
    pub(super) table: u64,
    pub(super) pages: u64,
    pub(super) triangles: u64,
    pub(super) skipped: u64,
    pub(super) origin: DVec3,
    pub(super) bounds: Aabb,
    pub(super) table_checksum: u32,
    pub(super) attributes: Attributes,
}

/// What the triangles have beside their corners, in some page at least.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Attributes {
    pub(super) normals: bool,
    pub(super) colors: bool,
    /// Whether an alpha is below 1.
    pub(super) transparent: bool,
    /// The smallest and the largest finite scalar.
    pub(super) scalars: Option<[f32; 2]>,
}

impl Attributes {
    /// Bit 0: normals, 1: colours, 2: transparent colours, 3: scalars.
    fn bits(&self) -> u32 {
        let bits = [self.normals, self.colors, self.transparent, self.scalars.is_some()];
        bits.iter().enumerate().fold(0, |all, (i, &bit)| all | u32::from(bit) << i)
    }

    fn of_bits(bits: u32, range: [f32; 2]) -> Attributes {
        let bit = |i: u32| bits >> i & 1 == 1;
        let scalars = bit(3).then_some(range);
        Attributes { normals: bit(0), colors: bit(1), transparent: bit(2), scalars }
    }

    /// Adds those of a piece.
    pub(super) fn include(&mut self, piece: &MeshAttributes<'_>) {
        self.normals |= piece.normals.is_some();
        self.colors |= piece.colors.is_some();
        self.transparent |= piece.colors.is_some_and(|c| c.values.iter().any(|c| c[3] < 1.0));
        let scalars = piece.scalars.iter().flat_map(|s| &s.values).filter(|x| x.is_finite());
        for &x in scalars {
            let [low, high] = self.scalars.unwrap_or([x; 2]);
            self.scalars = Some([low.min(x), high.max(x)]);
        }
    }

    /// Whether there are any.
    pub(super) fn any(&self) -> bool {
        self.bits() != 0
    }
}

/// A page in the table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PageEntry {
    pub(super) offset: u64,
    /// Number of the triangle with the number 0 in the page.
    pub(super) first: u64,
    pub(super) units: u32,
    pub(super) triangles: u32,
    pub(super) depth: u32,
    pub(super) checksum: u32,
    pub(super) bounds: Aabb,
    /// Words of 32 bits of the attributes, which follow the page.
    pub(super) attribute_words: u32,
    pub(super) attribute_checksum: u32,
}

/// Why bytes are no header.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum NoHeader {
    OtherFile,
    OtherVersion(u32),
    Damaged,
}

/// Puts the corners of a box at a place.
fn put_box(fields: &mut Fields<'_>, at: usize, b: Aabb) {
    for (i, x) in b.min.to_array().into_iter().chain(b.max.to_array()).enumerate() {
        fields.put(at + 4 * i, x.to_le_bytes());
    }
}

fn get_box(bytes: &[u8], at: usize) -> Aabb {
    let corner =
        |at: usize| Vec3::from_array([0, 4, 8].map(|i| f32::from_le_bytes(get(bytes, at + i))));
    Aabb { min: corner(at), max: corner(at + 12) }
}

impl Header {
    pub(super) fn bytes(&self) -> [u8; HEADER_BYTES] {
        let mut bytes = [0; HEADER_BYTES];
        let mut fields = Fields(&mut bytes);
        fields.put(0, *MAGIC);
        fields.put(8, VERSION.to_le_bytes());
        let numbers = [self.length, self.table, self.pages, self.triangles, self.skipped];
        for (i, number) in numbers.into_iter().enumerate() {
            fields.put(16 + 8 * i, number.to_le_bytes());
        }
        for (i, x) in self.origin.to_array().into_iter().enumerate() {
            fields.put(56 + 8 * i, x.to_le_bytes());
        }
        put_box(&mut fields, 80, self.bounds);
        fields.put(104, self.table_checksum.to_le_bytes());
        fields.put(108, self.attributes.bits().to_le_bytes());
        for (i, x) in self.attributes.scalars.unwrap_or_default().into_iter().enumerate() {
            fields.put(112 + 4 * i, x.to_le_bytes());
        }
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
        Ok(Header {
            length: get_u64(bytes, 16),
            table: get_u64(bytes, 24),
            pages: get_u64(bytes, 32),
            triangles: get_u64(bytes, 40),
            skipped: get_u64(bytes, 48),
            origin: DVec3::from_array([56, 64, 72].map(|at| f64::from_le_bytes(get(bytes, at)))),
            bounds: get_box(bytes, 80),
            table_checksum: get_u32(bytes, 104),
            attributes: Attributes::of_bits(
                get_u32(bytes, 108),
                [112, 116].map(|at| f32::from_bits(get_u32(bytes, at))),
            ),
        })
    }
}

impl PageEntry {
    pub(super) fn bytes(&self) -> [u8; ENTRY_BYTES] {
        let mut bytes = [0; ENTRY_BYTES];
        let mut fields = Fields(&mut bytes);
        fields.put(0, self.offset.to_le_bytes());
        fields.put(8, self.first.to_le_bytes());
        let numbers = [self.units, self.triangles, self.depth, self.checksum];
        for (i, number) in numbers.into_iter().enumerate() {
            fields.put(16 + 4 * i, number.to_le_bytes());
        }
        put_box(&mut fields, 32, self.bounds);
        fields.put(56, self.attribute_words.to_le_bytes());
        fields.put(60, self.attribute_checksum.to_le_bytes());
        bytes
    }

    /// The byte after the page and its attributes; `None` when no file can be so long.
    pub(super) fn end(&self) -> Option<u64> {
        let bytes = u64::from(self.units) * UNIT_BYTES + u64::from(self.attribute_words) * 4;
        self.offset.checked_add(bytes)
    }

    /// The first byte of the attributes. For entries with an [`PageEntry::end`].
    pub(super) fn attributes(&self) -> u64 {
        self.offset + u64::from(self.units) * UNIT_BYTES
    }

    /// The entry in the first [`ENTRY_BYTES`] of `bytes`.
    pub(super) fn read(bytes: &[u8]) -> PageEntry {
        PageEntry {
            offset: get_u64(bytes, 0),
            first: get_u64(bytes, 8),
            units: get_u32(bytes, 16),
            triangles: get_u32(bytes, 20),
            depth: get_u32(bytes, 24),
            checksum: get_u32(bytes, 28),
            bounds: get_box(bytes, 32),
            attribute_words: get_u32(bytes, 56),
            attribute_checksum: get_u32(bytes, 60),
        }
    }
}
