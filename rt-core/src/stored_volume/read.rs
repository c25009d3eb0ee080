//! Reads the bricks of a stored volume as rays need them.

use super::StoredVolumeReport;
use super::brick::{StoredBrick, Values};
use super::error::StoredVolumeError;
use super::format::{BrickEntry, ENTRY_BYTES, HEADER_BYTES, Header, MAGIC, NoHeader, VERSION};
#[cfg(feature = "render")]
use super::layout::BRICK_CELLS;
use super::layout::VolumeLayout;
use crate::paging::fields::checksum;
use crate::paging::{PageCache, PageSource, PageUse};
use glam::UVec3;
use std::sync::OnceLock;

/// A volume in bytes elsewhere: its bricks are read when something asks for their values.
/// [`super::StoredVolumeWriter`] stores volumes, and has an example. The member `datasets` opens
/// files (`datasets::stored_volume`).
pub struct StoredVolume {
    source: Box<dyn PageSource>,
    header: Header,
    table: Vec<BrickEntry>,
    cache: PageCache<StoredBrick>,
    /// The first brick that could not be read, and why.
    failure: OnceLock<String>,
}

const WRONG_CHECKSUM: &str = "its checksum is wrong";

fn damaged(source: &dyn PageSource, part: &str, offset: u64, reason: &str) -> StoredVolumeError {
    let (name, part, reason) = (source.name(), part.into(), reason.into());
    StoredVolumeError::Damaged { name, part, offset, reason }
}

impl StoredVolume {
    /// Reads the table of bricks. Bricks in memory take at most `budget` bytes, and the brick at
    /// hand and the last 16 of each thread besides.
    ///
    /// # Errors
    /// When the source cannot be read, is no stored volume, has another version, was cut, or its
    /// header or table is damaged; and on big-endian machines.
    pub fn open(
        source: impl PageSource + 'static,
        budget: usize,
    ) -> Result<StoredVolume, StoredVolumeError> {
        if cfg!(target_endian = "big") {
            return Err(StoredVolumeError::BigEndian);
        }
        let io = |reason| StoredVolumeError::Io { name: source.name(), reason };
        let found = source.length().map_err(io)?;
        let mut bytes = [0; HEADER_BYTES];
        if found < HEADER_BYTES as u64 {
            return Err(StoredVolumeError::NotAStoredVolume { name: source.name() });
        }
        source.read(0, &mut bytes).map_err(io)?;
        let bad_header = |reason: &str| damaged(&source, "the header", 0, reason);
        let header = Header::read(&bytes).map_err(|e| match e {
            NoHeader::OtherFile => StoredVolumeError::NotAStoredVolume { name: source.name() },
            NoHeader::OtherVersion(found) => {
                StoredVolumeError::Version { name: source.name(), found, expected: VERSION }
            }
            NoHeader::Damaged => bad_header(WRONG_CHECKSUM),
            NoHeader::ValueType(n) => bad_header(&format!("there is no type {n} of values")),
        })?;
        if header.length != found {
            let expected = header.length;
            return Err(StoredVolumeError::Length { name: source.name(), found, expected });
        }
        header.layout.check().map_err(|e| bad_header(&e.to_string()))?;
        let bricks = header.layout.bricks().as_u64vec3().element_product();
        let at = header.table;
        let bad_table = |reason: &str| damaged(&source, "the table of bricks", at, reason);
        if at.checked_add(bricks * ENTRY_BYTES as u64) != Some(found) {
            return Err(bad_table("it does not end where the file does"));
        }
        let mut bytes = vec![0; bricks as usize * ENTRY_BYTES];
        source.read(at, &mut bytes).map_err(io)?;
        if checksum(&bytes) != header.table_checksum {
            return Err(bad_table(WRONG_CHECKSUM));
        }
        let table: Vec<BrickEntry> =
            bytes.chunks_exact(ENTRY_BYTES).map(BrickEntry::read).collect();
        let size = header.layout.values.bytes() as u64;
        for (number, brick) in table.iter().enumerate().filter(|(_, brick)| brick.offset != 0) {
            let bytes = header.layout.brick(number as u32).count() as u64 * size;
            if brick.offset.checked_add(bytes).is_none_or(|end| end > at) {
                return Err(bad_table(&format!("brick {number} lies outside")));
            }
        }
        let cache = PageCache::new(table.len(), budget);
        let source = Box::new(source);
        Ok(StoredVolume { source, header, table, cache, failure: OnceLock::new() })
    }

    /// Whether a file that starts with these bytes, 8 at least, is a stored volume of any version.
    pub fn recognizes(start: &[u8]) -> bool {
        start.starts_with(MAGIC)
    }

    /// The lattice, and how values are stored.
    pub fn layout(&self) -> VolumeLayout {
        self.header.layout
    }

    /// Smallest and largest finite value; `None` when there is none.
    pub fn range(&self) -> Option<(f32, f32)> {
        let [lo, hi] = self.header.range;
        (lo <= hi).then_some((lo, hi))
    }

    /// What the file has.
    pub fn report(&self) -> StoredVolumeReport {
        StoredVolumeReport {
            points: self.header.layout.dims.as_u64vec3().element_product(),
            non_finite: self.header.non_finite,
            bricks: self.table.len() as u64,
            bricks_constant: self.table.iter().filter(|b| b.offset == 0).count() as u64,
            bytes: self.header.length,
        }
    }

    /// What the bricks in memory take.
    pub fn page_use(&self) -> PageUse {
        self.cache.page_use()
    }

    /// Why a brick could not be read, the first time that this was so. Its values were NaN.
    pub fn failure(&self) -> Option<&str> {
        self.failure.get().map(String::as_str)
    }

    /// The value of a point. NaN outside of the lattice, and where it cannot be read
    /// ([`StoredVolume::failure`]).
    pub fn value(&self, point: UVec3) -> f32 {
        if point.cmpge(self.header.layout.dims).any() {
            return f32::NAN;
        }
        let number = self.header.layout.brick_of(point);
        let entry = &self.table[number as usize];
        if entry.offset == 0 {
            return entry.range[0];
        }
        self.with_brick(number, |brick| brick.at(point)).unwrap_or(f32::NAN)
    }

    /// The values of a box of points of the lattice, x fastest: from `low` to before `end`. `None`
    /// when a brick cannot be read ([`StoredVolume::failure`]).
    #[cfg(feature = "render")]
    pub(crate) fn values_in(&self, low: UVec3, end: UVec3) -> Option<Vec<f32>> {
        let size = (end - low).as_usizevec3();
        let mut values = vec![f32::NAN; size.element_product()];
        let layout = self.header.layout;
        let last = layout.bricks() - UVec3::ONE;
        let brick_of = |point: UVec3| (point / BRICK_CELLS).min(last);
        let (first, past) = (brick_of(low), brick_of(end - UVec3::ONE) + UVec3::ONE);
        for z in first.z..past.z {
            for y in first.y..past.y {
                for x in first.x..past.x {
                    let place = UVec3::new(x, y, z);
                    let from = low.max(place * BRICK_CELLS);
                    // Points between two bricks are taken from the upper one.
                    let own = (place + UVec3::ONE) * BRICK_CELLS;
                    let to = end.min(UVec3::select(place.cmpeq(last), layout.dims, own));
                    let number = layout.number(place);
                    let entry = &self.table[number as usize];
                    let rows = (from.z..to.z).flat_map(|k| (from.y..to.y).map(move |j| (j, k)));
                    let mut put = |row: &mut dyn FnMut(UVec3, &mut [f32])| {
                        for (j, k) in rows.clone() {
                            let p = UVec3::new(from.x, j, k);
                            let at = (p - low).as_usizevec3();
                            let at = (at.z * size.y + at.y) * size.x + at.x;
                            row(p, &mut values[at..at + (to.x - from.x) as usize]);
                        }
                    };
                    if entry.offset == 0 {
                        put(&mut |_, row| row.fill(entry.range[0]));
                    } else {
                        self.with_brick(number, |brick| put(&mut |p, row| brick.row(p, row)))?;
                    }
                }
            }
        }
        Some(values)
    }

    pub(crate) fn num_bricks(&self) -> u32 {
        self.table.len() as u32
    }

    /// Smallest and largest finite value of a brick.
    pub(crate) fn brick_range(&self, number: u32) -> [f32; 2] {
        self.table[number as usize].range
    }

    /// Calls `work` with a brick whose values are not all equal. `None` when it cannot be read.
    pub(super) fn with_brick<R>(
        &self,
        number: u32,
        work: impl FnOnce(&StoredBrick) -> R,
    ) -> Option<R> {
        let read = || {
            let read = self.read_brick(number);
            read.map_err(|e| self.failure.get_or_init(|| e.to_string())).ok()
        };
        self.cache.with(number, read, work)
    }

    fn read_brick(&self, number: u32) -> Result<StoredBrick, StoredVolumeError> {
        let (entry, place) = (&self.table[number as usize], self.header.layout.brick(number));
        let mut values = Values::zeros(self.header.layout.values, place.count());
        let io = |reason| StoredVolumeError::Io { name: self.source.name(), reason };
        self.source.read(entry.offset, values.bytes_mut()).map_err(io)?;
        if checksum(values.bytes()) != entry.checksum {
            let part = format!("brick {number}");
            return Err(damaged(&*self.source, &part, entry.offset, WRONG_CHECKSUM));
        }
        Ok(StoredBrick::new(place, values))
    }
}
