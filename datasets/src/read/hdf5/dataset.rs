//! Values of a dataset: all of them, or those of a box.

use super::chunk_index::{Chunk, Grid, Kind, chunks};
use super::datatype::{Dataspace, Datatype};
use super::filters::{Filter, pipeline, undo};
use super::header::{Message, kind};
use super::source::{Source, unknown_version};
use crate::read::error::{At, BROKEN, Fault};

enum Layout {
    Compact(Vec<u8>),
    Contiguous(Option<u64>),
    Chunked {
        index: Kind,
        address: Option<u64>,
        chunk: Vec<u64>,
        /// Chunks that reach over the border have no filters.
        plain_border: bool,
    },
}

/// A dataset that is ready to be read.
pub(super) struct Stored<'s> {
    source: &'s Source,
    pub(super) datatype: Datatype,
    pub(super) space: Dataspace,
    layout: Layout,
    filters: Vec<Filter>,
    /// The value of elements that were never written; empty for zeros.
    fill: Vec<u8>,
}

impl<'s> Stored<'s> {
    /// From the messages of its header; `None` if they are not those of a dataset.
    pub(super) fn new(source: &'s Source, messages: &[Message]) -> Result<Option<Self>, Fault> {
        let find = |kind: u16| messages.iter().find(|m| m.kind == kind);
        let (Some(space), Some(datatype), Some(layout_at)) =
            (find(kind::DATASPACE), find(kind::DATATYPE), find(kind::LAYOUT))
        else {
            return Ok(None);
        };
        let datatype = Datatype::parse(source, &datatype.data, datatype.address)?;
        let space = Dataspace::parse(source, &space.data, space.address)?;
        if let Some(m) = find(kind::EXTERNAL_FILES) {
            let cure = "repack the file so that it holds its values itself (h5repack)";
            return Err(Fault::unsupported(At::Byte(m.address), "values in other files", cure));
        }
        let layout = layout(source, layout_at, space.dims.len(), datatype.size)?;
        let filters = find(kind::FILTERS).map_or(Ok(Vec::new()), |m| pipeline(source, m))?;
        // Not `size` zeros: a size that no file can have is only refused when values are read.
        let mut fill = Vec::new();
        if let Some(m) = find(kind::FILL).or(find(kind::OLD_FILL)) {
            let mut f = source.fields(&m.data, m.address);
            let size = if m.kind == kind::OLD_FILL {
                f.u32()? as usize
            } else {
                let version = f.u8()?;
                let there = match version {
                    1 | 2 => {
                        f.skip(2)?;
                        f.u8()? != 0 || version == 1
                    }
                    _ => f.u8()? & 0x20 != 0,
                };
                if there { f.u32()? as usize } else { 0 }
            };
            if size == datatype.size {
                fill = f.take(size)?.to_vec();
            }
        }
        Ok(Some(Stored { source, datatype, space, layout, filters, fill }))
    }

    /// The bytes of the box of `count` elements along each axis from `start`. Elements that were
    /// never written have the fill value.
    pub(super) fn bytes(&self, start: &[u64], count: &[u64]) -> Result<Vec<u8>, Fault> {
        let dims = &self.space.dims;
        let inside = start.len() == dims.len()
            && count.len() == dims.len()
            && (0..dims.len())
                .all(|a| start[a].checked_add(count[a]).is_some_and(|end| end <= dims[a]));
        if !inside {
            let what = format!("{count:?} values from {start:?} of an array of {dims:?}");
            return Err(Fault::field("the box to read", what));
        }
        let each = self.datatype.size as u64;
        let total = match self.space.is_null {
            true => Some(0),
            false => count.iter().try_fold(each, |n, &c| n.checked_mul(c)),
        };
        let Some(total) = total else {
            return Err(Fault::field("the shape", format!("{dims:?} is more than 2^64 bytes")));
        };
        if total == 0 {
            return Ok(Vec::new());
        }
        match &self.layout {
            Layout::Compact(data) => {
                let size = self.space.count().and_then(|n| n.checked_mul(each));
                if size != Some(data.len() as u64) {
                    let what = format!("{dims:?} values in {} bytes", data.len());
                    return Err(Fault::field("the shape", what));
                }
                let mut out = self.filled(total)?;
                let mut target = Window { start, count, out: &mut out, each: each as usize };
                target.copy(data, &vec![0; dims.len()], dims);
                Ok(out)
            }
            Layout::Contiguous(None) => self.filled(total),
            Layout::Contiguous(Some(address)) => self.contiguous(*address, start, count, total),
            Layout::Chunked { index, address, chunk, plain_border } => {
                self.source.allow(total, "the values of a dataset")?;
                let bytes = chunk.iter().try_fold(each, |n, &c| n.checked_mul(c));
                let Some(bytes) = bytes.filter(|&b| b <= u64::from(u32::MAX)) else {
                    return Err(Fault::field("the chunks", format!("{chunk:?} elements")));
                };
                let is_filtered = !self.filters.is_empty();
                let grid = Grid { dims, max: &self.space.max, chunk, bytes, is_filtered };
                let stored = match address {
                    Some(address) => chunks(self.source, index, *address, &grid)?,
                    None => Vec::new(),
                };
                let mut out = self.filled(total)?;
                let mut target = Window { start, count, out: &mut out, each: each as usize };
                for c in &stored {
                    if !target.meets(&c.position, chunk) {
                        continue;
                    }
                    let first: Vec<u64> =
                        c.position.iter().zip(chunk).map(|(p, n)| p * n).collect();
                    let over = (0..dims.len()).any(|a| first[a] + chunk[a] > dims[a]);
                    let data = self.chunk(c, bytes, *plain_border && over)?;
                    target.copy(&data, &first, chunk);
                }
                Ok(out)
            }
        }
    }

    fn chunk(&self, c: &Chunk, bytes: u64, is_plain: bool) -> Result<Vec<u8>, Fault> {
        let data = self.source.bytes(c.address, c.size, "a chunk")?;
        let size = self.source.allow(bytes, "a chunk")?;
        let filters = if is_plain { &[][..] } else { &self.filters };
        undo(filters, c.mask, data, size, c.address)
    }

    /// `total` bytes of fill values.
    fn filled(&self, total: u64) -> Result<Vec<u8>, Fault> {
        let total = self.source.allow(total, "the values of a dataset")?;
        if self.fill.iter().all(|&b| b == 0) {
            return Ok(vec![0; total]);
        }
        Ok(self.fill.iter().copied().cycle().take(total).collect())
    }

    fn contiguous(
        &self,
        address: u64,
        start: &[u64],
        count: &[u64],
        total: u64,
    ) -> Result<Vec<u8>, Fault> {
        let dims = &self.space.dims;
        let each = self.datatype.size as u64;
        // Axes behind the last one that is cut are read in one go.
        let cut = (0..dims.len()).rev().find(|&a| count[a] != dims[a]).unwrap_or(0);
        let run = count.iter().skip(cut).fold(each, |n, &c| n.saturating_mul(c));
        let mut index: Vec<u64> = start.to_vec();
        let mut out = Vec::new();
        while (out.len() as u64) < total {
            let mut offset = 0u64;
            for a in 0..dims.len() {
                let i = if a <= cut { index[a] } else { 0 };
                offset = offset.saturating_mul(dims[a]).saturating_add(i);
            }
            let at = address.saturating_add(offset.saturating_mul(each));
            out.extend(self.source.bytes(at, run, "the values of a dataset")?);
            for a in (0..cut).rev() {
                index[a] += 1;
                if index[a] < start[a] + count[a] {
                    break;
                }
                index[a] = start[a];
            }
        }
        Ok(out)
    }
}

/// A box of an array, into which parts of it are copied.
struct Window<'a> {
    start: &'a [u64],
    count: &'a [u64],
    out: &'a mut [u8],
    each: usize,
}

impl Window<'_> {
    fn meets(&self, position: &[u64], chunk: &[u64]) -> bool {
        (0..self.start.len()).all(|a| {
            let Some(first) = position[a].checked_mul(chunk[a]) else { return false };
            first < self.start[a] + self.count[a]
                && first.checked_add(chunk[a]).is_some_and(|end| end > self.start[a])
        })
    }

    /// Copies what lies inside of the box of `size` elements from `first`.
    fn copy(&mut self, data: &[u8], first: &[u64], size: &[u64]) {
        let rank = self.start.len();
        if rank == 0 {
            self.out.copy_from_slice(&data[..self.out.len()]);
            return;
        }
        let low: Vec<u64> = (0..rank).map(|a| first[a].max(self.start[a])).collect();
        let high: Vec<u64> =
            (0..rank).map(|a| (first[a] + size[a]).min(self.start[a] + self.count[a])).collect();
        if (0..rank).any(|a| low[a] >= high[a]) {
            return;
        }
        let run = (high[rank - 1] - low[rank - 1]) as usize * self.each;
        let mut index = low.clone();
        loop {
            let offset = |origin: &[u64], lengths: &[u64]| {
                (0..rank).fold(0, |n, a| n * lengths[a] + (index[a] - origin[a])) as usize
                    * self.each
            };
            let (from, to) = (offset(first, size), offset(self.start, self.count));
            self.out[to..to + run].copy_from_slice(&data[from..from + run]);
            let mut axis = rank - 1;
            loop {
                if axis == 0 {
                    return;
                }
                axis -= 1;
                index[axis] += 1;
                if index[axis] < high[axis] {
                    break;
                }
                index[axis] = low[axis];
            }
        }
    }
}

/// Decodes a layout message.
fn layout(
    source: &Source,
    message: &Message,
    rank: usize,
    element: usize,
) -> Result<Layout, Fault> {
    let mut f = source.fields(&message.data, message.address);
    let at = f.at();
    let bad = |what: String| Fault::new(at.clone(), what, BROKEN);
    let version = f.u8()?;
    // A chunk has one more length: that of an element.
    let chunk_of = |lengths: Vec<u64>| match lengths.split_last() {
        Some((last, chunk))
            if chunk.len() == rank && *last == element as u64 && !chunk.contains(&0) =>
        {
            Ok(chunk.to_vec())
        }
        _ => Err(bad(format!("chunks of {lengths:?} for {rank} axes and {element} bytes"))),
    };
    match version {
        1 | 2 => {
            let axes = usize::from(f.u8()?);
            let class = f.u8()?;
            f.skip(5)?;
            let address = if class == 0 { None } else { f.address()? };
            let lengths = (0..axes).map(|_| f.uint(4)).collect::<Result<Vec<_>, _>>()?;
            match class {
                0 => {
                    let size = f.u32()? as usize;
                    Ok(Layout::Compact(f.take(size)?.to_vec()))
                }
                1 => Ok(Layout::Contiguous(address)),
                2 => {
                    let mut lengths = lengths;
                    if lengths.len() == rank {
                        lengths.push(f.uint(4)?);
                    }
                    let chunk = chunk_of(lengths)?;
                    let index = Kind::BtreeV1;
                    Ok(Layout::Chunked { index, address, chunk, plain_border: false })
                }
                c => Err(bad(format!("layout class {c}"))),
            }
        }
        // Version 5 (HDF5 2.0) allows larger chunks, whose sizes take more bytes.
        3..=5 => match f.u8()? {
            0 => {
                let size = usize::from(f.u16()?);
                Ok(Layout::Compact(f.take(size)?.to_vec()))
            }
            1 => Ok(Layout::Contiguous(f.address()?)),
            2 if version == 3 => {
                let axes = usize::from(f.u8()?);
                let address = f.address()?;
                let lengths = (0..axes).map(|_| f.uint(4)).collect::<Result<Vec<_>, _>>()?;
                let chunk = chunk_of(lengths)?;
                Ok(Layout::Chunked { index: Kind::BtreeV1, address, chunk, plain_border: false })
            }
            2 => {
                let flags = f.u8()?;
                let axes = usize::from(f.u8()?);
                let width = usize::from(f.u8()?);
                if width > 8 {
                    return Err(bad(format!("lengths of {width} bytes")));
                }
                let lengths = (0..axes).map(|_| f.uint(width)).collect::<Result<Vec<_>, _>>()?;
                let chunk = chunk_of(lengths)?;
                let index = match f.u8()? {
                    1 if flags & 2 != 0 => Kind::Single(Some((f.length()?, f.u32()?))),
                    1 => Kind::Single(None),
                    2 => Kind::Implicit,
                    3 => {
                        f.skip(1)?;
                        Kind::FixedArray
                    }
                    4 => {
                        f.skip(5)?;
                        Kind::ExtensibleArray
                    }
                    5 => {
                        f.skip(6)?;
                        Kind::BtreeV2
                    }
                    n => return Err(bad(format!("chunk index {n}"))),
                };
                let address = f.address()?;
                Ok(Layout::Chunked { index, address, chunk, plain_border: flags & 1 != 0 })
            }
            3 => {
                let cure = "write the values into the file itself (h5repack)";
                Err(Fault::unsupported(at, "a virtual dataset", cure))
            }
            c => Err(bad(format!("layout class {c}"))),
        },
        v => Err(unknown_version(at, v, "a layout")),
    }
}
