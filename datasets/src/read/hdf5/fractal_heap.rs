//! Fractal heaps: where links and attributes lie if there are many of them.

use super::source::{Source, bytes_for, verify};
use crate::read::error::{At, BROKEN, Fault};

/// The header of a fractal heap.
pub(super) struct FractalHeap<'s> {
    source: &'s Source,
    address: u64,
    offset_bytes: usize,
    length_bytes: usize,
    width: u64,
    first_block: u64,
    largest_direct: u64,
    root: Option<u64>,
    rows: u64,
}

impl<'s> FractalHeap<'s> {
    pub(super) fn open(source: &'s Source, address: u64) -> Result<Self, Fault> {
        let size = 26 + 12 * source.length_size as u64 + 3 * source.offset_size as u64;
        let head = source.bytes(address, size, "a fractal heap")?;
        let mut f = source.fields(&head, address);
        f.signature(b"FRHP")?;
        f.version(0, "a fractal heap")?;
        f.skip(2)?;
        let filters = f.u16()?;
        if filters > 0 {
            let cure = "repack the file with h5repack";
            return Err(Fault::unsupported(f.at(), "a fractal heap with filters", cure));
        }
        verify(&head, address)?;
        f.skip(1)?;
        let largest_object = u64::from(f.u32()?);
        // Huge objects (next id, index), free space (amount, manager), managed space (size,
        // allocated, iterator, objects), huge (size, objects), tiny (size, objects).
        f.skip(10 * source.length_size + 2 * source.offset_size)?;
        let width = u64::from(f.u16()?);
        let first_block = f.length()?;
        let largest_direct = f.length()?;
        let bits = usize::from(f.u16()?);
        f.skip(2)?;
        let root = f.address()?;
        let rows = u64::from(f.u16()?);
        if !first_block.is_power_of_two()
            || !largest_direct.is_power_of_two()
            || largest_direct < first_block
            || width == 0
            || bits > 64
            || largest_object == 0
        {
            let what = format!("a fractal heap of blocks from {first_block} to {largest_direct}");
            return Err(Fault::new(At::Byte(address), what, BROKEN));
        }
        Ok(FractalHeap {
            source,
            address,
            offset_bytes: bits.div_ceil(8),
            length_bytes: bytes_for(largest_direct).min(bytes_for(largest_object)),
            width,
            first_block,
            largest_direct,
            root,
            rows,
        })
    }

    /// The object with this id.
    pub(super) fn object(&self, id: &[u8]) -> Result<Vec<u8>, Fault> {
        let mut f = self.source.fields(id, self.address);
        let flags = f.u8()?;
        match flags >> 4 & 3 {
            0 => {
                let offset = f.uint(self.offset_bytes)?;
                let length = f.uint(self.length_bytes)?;
                let address = self.locate(offset)?;
                self.source.bytes(address, length, "an object of a fractal heap")
            }
            2 => Ok(f.take(usize::from(flags & 15) + 1)?.to_vec()),
            _ => {
                let cure = "write large attributes as datasets";
                Err(Fault::unsupported(f.at(), "a huge object of a fractal heap", cure))
            }
        }
    }

    /// Size of the blocks of a row of an indirect block.
    fn block_size(&self, row: u64) -> u64 {
        self.first_block.checked_shl(row.saturating_sub(1) as u32).unwrap_or(u64::MAX)
    }

    /// Address of the byte at `offset` of the heap.
    fn locate(&self, offset: u64) -> Result<u64, Fault> {
        let beyond = || {
            let what = format!("nothing at offset {offset} of a fractal heap");
            Fault::new(At::Byte(self.address), what, BROKEN)
        };
        let mut address = self.root.ok_or_else(beyond)?;
        let mut rows = self.rows;
        let mut start = 0u64;
        if rows == 0 {
            return Ok(address.saturating_add(offset)); // the root is a direct block
        }
        let direct_rows = u64::from((self.largest_direct / self.first_block).ilog2()) + 2;
        // An indirect block is smaller than the one that holds it, so this ends.
        for _ in 0..64 {
            let mut row_start = start;
            let mut found = None;
            for row in 0..rows {
                let size = self.block_size(row);
                let row_end = row_start.saturating_add(size.saturating_mul(self.width));
                if offset < row_end {
                    let column = (offset - row_start) / size;
                    found = Some((row, column, row_start + column * size));
                    break;
                }
                row_start = row_end;
            }
            let (row, column, block_start) = found.ok_or_else(beyond)?;
            let entry = row * self.width + column;
            let head = 5 + self.source.offset_size as u64 + self.offset_bytes as u64;
            let at = address
                .saturating_add(head)
                .saturating_add(entry.saturating_mul(self.source.offset_size as u64));
            let signature = self.source.bytes(address, 4, "a block of a fractal heap")?;
            self.source.fields(&signature, address).signature(b"FHIB")?;
            let child = self.source.bytes(at, self.source.offset_size as u64, "a fractal heap")?;
            address = self.source.fields(&child, at).address()?.ok_or_else(beyond)?;
            start = block_start;
            if row < direct_rows {
                return Ok(address.saturating_add(offset - start));
            }
            let size = self.block_size(row);
            let smallest = self.first_block.saturating_mul(self.width);
            rows = u64::from((size / smallest.max(1)).max(1).ilog2()) + 1;
        }
        Err(beyond())
    }
}
