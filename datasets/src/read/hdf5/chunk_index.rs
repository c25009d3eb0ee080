//! Where the chunks of a dataset lie: the index of version 3 of the layout and those of version 4.

use super::source::{Fields, Source};
use super::{btree_v1, btree_v2};
use crate::read::error::{At, BROKEN, Fault};

/// A stored chunk.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Chunk {
    /// Its position, in chunks along each axis.
    pub(super) position: Vec<u64>,
    pub(super) address: u64,
    /// Stored bytes.
    pub(super) size: u64,
    /// Filters that were not applied to it.
    pub(super) mask: u32,
}

/// Kinds of index.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Kind {
    BtreeV1,
    /// Stored bytes and mask of a chunk with filters.
    Single(Option<(u64, u32)>),
    Implicit,
    FixedArray,
    ExtensibleArray,
    BtreeV2,
}

/// The chunks along the axes of a dataset, and the size of one.
pub(super) struct Grid<'a> {
    pub(super) dims: &'a [u64],
    pub(super) max: &'a [Option<u64>],
    /// Elements of a chunk along each axis.
    pub(super) chunk: &'a [u64],
    /// Bytes of a chunk without filters.
    pub(super) bytes: u64,
    pub(super) is_filtered: bool,
}

impl Grid<'_> {
    /// Position of the chunk with a number. In extensible arrays, the axis without a limit varies
    /// slowest.
    fn position(&self, number: u64, kind: &Kind) -> Option<Vec<u64>> {
        let rank = self.dims.len();
        let mut order: Vec<usize> = (0..rank).collect();
        if *kind == Kind::ExtensibleArray
            && let Some(axis) = self.max.iter().position(Option::is_none)
        {
            order.remove(axis);
            order.insert(0, axis);
        }
        let mut rest = number;
        let mut out = vec![0; rank];
        for (nth, &axis) in order.iter().enumerate().rev() {
            let along = self.max[axis].unwrap_or(u64::MAX).div_ceil(self.chunk[axis]).max(1);
            out[axis] = if nth == 0 { rest } else { rest % along };
            rest /= along;
        }
        let inside = (0..rank).all(|a| out[a] < self.dims[a].div_ceil(self.chunk[a]));
        inside.then_some(out)
    }

    /// Address, size and mask of an element of an array of chunks.
    fn element(&self, f: &mut Fields<'_>, size: usize) -> Result<Option<(u64, u64, u32)>, Fault> {
        let start = f.pos;
        let address = f.address()?;
        let (bytes, mask) = if self.is_filtered {
            let width = size.saturating_sub(f.pos - start + 4);
            if width > 8 {
                return Err(Fault::new(f.at(), format!("a size of {width} bytes"), BROKEN));
            }
            (f.uint(width)?, f.u32()?)
        } else {
            (self.bytes, 0)
        };
        Ok(address.map(|a| (a, bytes, mask)))
    }
}

/// All stored chunks that lie in the dataset, by the index at `address`.
pub(super) fn chunks(
    source: &Source,
    kind: &Kind,
    address: u64,
    grid: &Grid<'_>,
) -> Result<Vec<Chunk>, Fault> {
    let mut out = Vec::new();
    let rank = grid.dims.len();
    let mut numbered = |number: u64, (address, size, mask): (u64, u64, u32)| {
        if let Some(position) = grid.position(number, kind) {
            out.push(Chunk { position, address, size, mask });
        }
    };
    match kind {
        Kind::Single(stored) => {
            let (size, mask) = stored.unwrap_or((grid.bytes, 0));
            numbered(0, (address, size, mask));
        }
        Kind::Implicit => {
            // Every chunk takes room, so the length of the file bounds their number.
            let most = source.len() / grid.bytes.max(1);
            for number in 0..most {
                let at = address.saturating_add(number * grid.bytes);
                numbered(number, (at, grid.bytes, 0));
            }
        }
        Kind::FixedArray => fixed_array(source, address, grid, &mut numbered)?,
        Kind::ExtensibleArray => extensible_array(source, address, grid, &mut numbered)?,
        Kind::BtreeV1 => {
            btree_v1::visit(source, address, 1, 8 + 8 * (rank + 1), &mut |key, at| {
                let mut f = source.fields(key, at);
                let (size, mask) = (u64::from(f.u32()?), f.u32()?);
                let mut position = Vec::with_capacity(rank);
                for &c in grid.chunk {
                    position.push(f.uint(8)? / c);
                }
                out.push(Chunk { position, address: at, size, mask });
                Ok(())
            })?
        }
        Kind::BtreeV2 => btree_v2::records(source, address, &[10, 11], &mut |record, kind| {
            let mut f = source.fields(record, address);
            let element = record.len().saturating_sub(8 * rank);
            if (kind == 11) != grid.is_filtered {
                return Err(Fault::new(f.at(), "chunks with other filters", BROKEN));
            }
            let found = grid.element(&mut f, element)?;
            let position = (0..rank).map(|_| f.uint(8)).collect::<Result<_, _>>()?;
            if let Some((address, size, mask)) = found {
                out.push(Chunk { position, address, size, mask });
            }
            Ok(())
        })?,
    }
    Ok(out)
}

type Numbered<'f> = &'f mut dyn FnMut(u64, (u64, u64, u32));

fn fixed_array(
    source: &Source,
    address: u64,
    grid: &Grid<'_>,
    visit: Numbered<'_>,
) -> Result<(), Fault> {
    let size = 12 + source.offset_size as u64 + source.length_size as u64;
    let head = source.bytes(address, size, "a fixed array")?;
    super::source::verify(&head, address)?;
    let mut f = source.fields(&head, address);
    f.signature(b"FAHD")?;
    f.version(0, "a fixed array")?;
    f.skip(1)?;
    let each = usize::from(f.u8()?);
    let page_bits = u32::from(f.u8()?);
    let count = f.length()?;
    let Some(block) = f.address()? else { return Ok(()) };
    let per_page = 1u64.checked_shl(page_bits).unwrap_or(u64::MAX);
    let paged = count > per_page;
    let pages = if paged { count.div_ceil(per_page) } else { 0 };
    let bitmap_size = pages.div_ceil(8);
    let prefix = 6 + source.offset_size as u64;
    let head = source.bytes(block, prefix.saturating_add(bitmap_size), "a fixed array")?;
    let mut f = source.fields(&head, block);
    f.signature(b"FADB")?;
    f.skip(2 + source.offset_size)?;
    let bitmap = f.take(bitmap_size as usize)?;
    let mut at = block + head.len() as u64;
    if !paged {
        return elements(source, grid, at, 0, count, each, visit);
    }
    at += 4; // the checksum of the block, before its pages
    for page in 0..pages {
        let first = page * per_page;
        let in_page = per_page.min(count - first);
        if bitmap[page as usize / 8] & (0x80 >> (page % 8)) != 0 {
            elements(source, grid, at, first, in_page, each, visit)?;
        }
        at = at.saturating_add(per_page.saturating_mul(each as u64).saturating_add(4));
    }
    Ok(())
}

/// `count` elements of an array at `at`, the first of which is chunk `first`.
fn elements(
    source: &Source,
    grid: &Grid<'_>,
    at: u64,
    first: u64,
    count: u64,
    each: usize,
    visit: Numbered<'_>,
) -> Result<(), Fault> {
    let block = source.bytes(at, count.saturating_mul(each as u64), "an array of chunks")?;
    let mut f = source.fields(&block, at);
    for i in 0..count {
        let start = f.pos;
        if let Some(found) = grid.element(&mut f, each)? {
            visit(first + i, found);
        }
        if f.pos - start != each {
            return Err(Fault::new(At::Byte(at), format!("elements of {each} bytes"), BROKEN));
        }
    }
    Ok(())
}

/// Source: the HDF5 file format specification, III.D "Extensible array index". Blocks double in
/// size; the numbers of their data blocks follow from two parameters.
fn extensible_array(
    source: &Source,
    address: u64,
    grid: &Grid<'_>,
    visit: Numbered<'_>,
) -> Result<(), Fault> {
    let size = 16 + source.offset_size as u64 + 6 * source.length_size as u64;
    let head = source.bytes(address, size, "an extensible array")?;
    super::source::verify(&head, address)?;
    let mut f = source.fields(&head, address);
    f.signature(b"EAHD")?;
    f.version(0, "an extensible array")?;
    f.skip(1)?;
    let each = usize::from(f.u8()?);
    let bits = u32::from(f.u8()?);
    let in_index = u64::from(f.u8()?);
    let smallest = u64::from(f.u8()?);
    let pointers = u64::from(f.u8()?);
    let page_bits = u32::from(f.u8()?);
    f.skip(4 * source.length_size)?;
    let stored = f.length()?;
    f.skip(source.length_size)?;
    let Some(index) = f.address()? else { return Ok(()) };
    let bad = |what: String| Fault::new(At::Byte(address), what, BROKEN);
    if !smallest.is_power_of_two()
        || !pointers.is_power_of_two()
        || bits > 64
        || smallest.ilog2() > bits
        || each == 0
    {
        return Err(bad(format!("an extensible array of blocks of {smallest}, {pointers}")));
    }
    let blocks = u64::from(1 + bits - smallest.ilog2());
    let direct = 2 * u64::from(pointers.ilog2()); // super blocks whose data blocks the index names
    let data_addresses = 2 * (pointers - 1);
    let super_addresses = blocks.saturating_sub(direct);
    let position_size = bits.div_ceil(8) as usize;
    let per_page = 1u64.checked_shl(page_bits).unwrap_or(u64::MAX);
    let prefix = 6 + source.offset_size;

    let head = source.bytes(index, prefix as u64, "an extensible array")?;
    source.fields(&head, index).signature(b"EAIB")?;
    let mut at = index + prefix as u64;
    elements(source, grid, at, 0, in_index, each, visit)?;
    at = at.saturating_add(in_index * each as u64);
    let width = source.offset_size as u64;
    let names =
        source.bytes(at, (data_addresses + super_addresses) * width, "an array of chunks")?;
    let mut names = source.fields(&names, at);

    let data_block =
        |at: Option<u64>, first: u64, count: u64, bitmap: Option<&[u8]>, visit: Numbered<'_>| {
            let Some(block) = at else { return Ok(()) };
            let head_size = (prefix + position_size) as u64;
            let head = source.bytes(block, head_size, "a block of an extensible array")?;
            source.fields(&head, block).signature(b"EADB")?;
            let mut at = block.saturating_add(head_size);
            if count <= per_page {
                return elements(source, grid, at, first, count, each, visit);
            }
            at = at.saturating_add(4);
            for page in 0..count / per_page {
                let there = bitmap.is_none_or(|b| {
                    b.get(page as usize / 8).is_some_and(|b| b & (0x80 >> (page % 8)) != 0)
                });
                if there {
                    elements(source, grid, at, first + page * per_page, per_page, each, visit)?;
                }
                at = at.saturating_add(per_page.saturating_mul(each as u64).saturating_add(4));
            }
            Ok::<(), Fault>(())
        };

    let mut first = in_index;
    for block in 0..blocks.min(62) {
        if first >= stored.max(in_index) {
            break;
        }
        let count = 1u64 << (block / 2);
        let per_block = smallest.saturating_mul(1 << block.div_ceil(2));
        if block < direct {
            for _ in 0..count {
                let at = names.address()?;
                data_block(at, first, per_block, None, visit)?;
                first = first.saturating_add(per_block);
            }
            continue;
        }
        let Some(at) = names.address()? else {
            first = first.saturating_add(count.saturating_mul(per_block));
            continue;
        };
        let pages = if per_block > per_page { per_block / per_page } else { 0 };
        let bitmap_size = pages.div_ceil(8);
        let head_size = (prefix + position_size) as u64;
        let size =
            count.saturating_mul(bitmap_size.saturating_add(width)).saturating_add(head_size);
        let body = source.bytes(at, size, "a block of an extensible array")?;
        let mut f = source.fields(&body, at);
        f.signature(b"EASB")?;
        f.skip(head_size as usize - 4)?;
        let bitmaps = f.take((count * bitmap_size) as usize)?;
        for i in 0..count {
            let data = f.address()?;
            let bitmap = (pages > 0)
                .then(|| &bitmaps[(i * bitmap_size) as usize..((i + 1) * bitmap_size) as usize]);
            data_block(data, first, per_block, bitmap, visit)?;
            first = first.saturating_add(per_block);
        }
    }
    Ok(())
}
