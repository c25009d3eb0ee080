//! One binary array of a VTK XML file, of which any part can be read without the rest.
//!
//! [`super::blocks`] says how such arrays are stored.

use super::blocks::{Compressor, Encoding, decompress, most_from, number};
use crate::model::{DataArray, ScalarType, Values};
use crate::read::base64::Decoder;
use crate::read::error::{At, BROKEN, Fault, TRUNCATED, io_fault};
use std::fs::File;
use std::io;
use std::ops::Range;
use std::sync::Arc;

/// Bytes of a file that hold an array, and what may follow it.
#[derive(Clone)]
pub(super) struct Place {
    pub(super) file: Arc<File>,
    pub(super) start: u64,
    /// At most this many bytes belong to the array.
    pub(super) length: u64,
    pub(super) base64: bool,
}

/// A binary array in a file.
pub(super) struct StoredArray {
    pub(super) name: String,
    pub(super) components: usize,
    pub(super) kind: ScalarType,
    place: Place,
    encoding: Encoding,
    /// Bytes of the array, uncompressed.
    length: u64,
    blocks: Blocks,
    /// The last block that was read, and its number.
    last: Option<(usize, Vec<u8>)>,
}

/// Where the bytes are, in bytes after base64 is undone.
enum Blocks {
    /// From there on.
    Plain(u64),
    /// Compressed: uncompressed size of each but the last, and the start of each and the end.
    Compressed { size: u64, starts: Vec<u64> },
}

impl StoredArray {
    /// Reads the header of an array. `None` for one that is stored in a way that allows no part to
    /// be read alone.
    pub(super) fn open(
        place: Place,
        encoding: Encoding,
        (name, components, kind): (String, usize, ScalarType),
    ) -> Result<Option<StoredArray>, Fault> {
        let w = encoding.header_bytes as u64;
        let stored = place.most_bytes();
        let fault = |what: String| Fault::new(At::Field(format!("array `{name}`")), what, BROKEN);
        let head = |from: u64, count: u64| -> Result<Option<Vec<u64>>, Fault> {
            if from + count * w > stored {
                return Ok(None);
            }
            let bytes = place.read(0, from, count * w).map_err(|e| io_fault(&name, e))?;
            Ok(bytes.map(|bytes| {
                bytes.chunks(w as usize).map(|b| number(b, encoding.endian)).collect()
            }))
        };
        let (length, blocks) = if encoding.compressor == Compressor::None {
            let Some(length) = head(0, 1)? else { return Ok(None) };
            (length[0], Blocks::Plain(w))
        } else {
            let Some(first) = head(0, 1)? else { return Ok(None) };
            if first[0] == 0 {
                (0, Blocks::Compressed { size: 0, starts: vec![0] })
            } else {
                let Some(start) = head(0, 3)? else { return Ok(None) };
                let [count, size, last] = [start[0], start[1], start[2]];
                // Each has a size in the file, so there cannot be more.
                if count > stored / w {
                    return Err(fault(format!("{count} blocks do not fit into the file")));
                }
                let Some(sizes) = head(3 * w, count)? else { return Ok(None) };
                let mut starts = vec![0u64];
                for compressed in sizes {
                    let start = starts[starts.len() - 1];
                    starts.push(start.saturating_add(compressed));
                }
                let compressed = starts[starts.len() - 1];
                let full = count - u64::from(last > 0);
                let length = full.checked_mul(size).and_then(|n| n.checked_add(last));
                let length = length.unwrap_or(u64::MAX);
                if last > size || compressed > stored || length > most_from(compressed) {
                    return Err(fault(format!(
                        "{count} blocks of {size} bytes (last {last}) cannot come from \
                         {compressed} compressed bytes"
                    )));
                }
                (length, Blocks::Compressed { size, starts })
            }
        };
        if length > most_from(stored) || matches!(blocks, Blocks::Plain(at) if length > stored - at)
        {
            return Err(Fault::new(
                At::Field(format!("array `{name}`")),
                format!("{length} bytes declared, but only {stored} bytes follow"),
                TRUNCATED,
            ));
        }
        let last = None;
        Ok(Some(StoredArray { name, components, kind, place, encoding, length, blocks, last }))
    }

    /// Whole tuples.
    pub(super) fn tuples(&self) -> u64 {
        self.length / (self.components * self.kind.size()) as u64
    }

    /// The values of some tuples, which must exist.
    pub(super) fn tuples_in(&mut self, range: Range<u64>) -> Result<Values, Fault> {
        let size = (self.components * self.kind.size()) as u64;
        let bytes = self.bytes(range.start * size..range.end * size)?;
        Ok(match self.kind {
            ScalarType::U8 => Values::U8(bytes),
            kind => Values::from_bytes(kind, &bytes, self.encoding.endian),
        })
    }

    /// The tuples with the given numbers, which must exist and ascend.
    pub(super) fn gathered(&mut self, numbers: &[u64]) -> Result<DataArray, Fault> {
        /// Tuples that are read at once.
        const AT_ONCE: u64 = 1 << 14;
        let (n, mut values) = (self.components, Values::empty(self.kind));
        for near in numbers.chunk_by(|a, b| a / AT_ONCE == b / AT_ONCE) {
            let (first, end) = (near[0], near[near.len() - 1] + 1);
            let some = self.tuples_in(first..end)?;
            let places = near.iter().map(|number| n * (number - first) as usize);
            values.append(&some.gathered(places.flat_map(|at| at..at + n)));
        }
        Ok(DataArray::new(self.name.clone(), n, values))
    }

    fn bytes(&mut self, range: Range<u64>) -> Result<Vec<u8>, Fault> {
        let (size, count) = match &self.blocks {
            Blocks::Plain(start) => {
                let bytes = self.place.read(0, start + range.start, range.end - range.start);
                let bytes = bytes.map_err(|e| io_fault(&self.name, e))?;
                return bytes.ok_or_else(|| self.not_base64());
            }
            Blocks::Compressed { size, starts } => (*size, starts.len() - 1),
        };
        let mut out = Vec::with_capacity((range.end - range.start) as usize);
        let mut at = range.start;
        while at < range.end {
            let block = (at / size) as usize;
            if self.last.as_ref().is_none_or(|(number, _)| *number != block) {
                let bytes = self.block(block, size, count)?;
                self.last = Some((block, bytes));
            }
            let Some((_, bytes)) = &self.last else { unreachable!("read above") };
            let start = block as u64 * size;
            let end = range.end.min(start + bytes.len() as u64);
            out.extend_from_slice(&bytes[(at - start) as usize..(end - start) as usize]);
            at = end;
        }
        Ok(out)
    }

    /// One block, uncompressed.
    fn block(&self, block: usize, size: u64, count: usize) -> Result<Vec<u8>, Fault> {
        let Blocks::Compressed { starts, .. } = &self.blocks else {
            unreachable!("plain bytes have no blocks")
        };
        let header = (3 + count as u64) * self.encoding.header_bytes as u64;
        let (start, end) = (starts[block], starts[block + 1]);
        let packed = self.place.read(header, start, end - start);
        let packed = packed.map_err(|e| io_fault(&self.name, e))?;
        let packed = packed.ok_or_else(|| self.not_base64())?;
        let mut bytes = vec![0; size.min(self.length - block as u64 * size) as usize];
        decompress(self.encoding.compressor, &packed, &mut bytes, block, &self.name)?;
        Ok(bytes)
    }

    fn not_base64(&self) -> Fault {
        let what = "a part of it is missing, is not base64, or has white space in it";
        Fault::new(
            At::Field(format!("array `{}`", self.name)),
            what,
            "copy the file again; or write it with raw appended data (in ParaView: Save Data, Data \
             Mode Appended, Encode Appended Data off)",
        )
    }
}

impl Place {
    /// The place without the white space that it begins with. `None` if it cannot be read, or has
    /// nothing else.
    pub(super) fn without_white_space(mut self) -> Option<Place> {
        /// As much as any program indents.
        const MOST: u64 = 4096;
        let mut start = vec![0; self.length.min(MOST) as usize];
        crate::paged_file::read_at(&self.file, &mut start, self.start).ok()?;
        let skip = start.iter().position(|b| !b.is_ascii_whitespace())? as u64;
        self.start += skip;
        self.length -= skip;
        Some(self)
    }

    /// The most bytes that can be there, after base64 is undone.
    fn most_bytes(&self) -> u64 {
        if self.base64 { self.length / 4 * 3 } else { self.length }
    }

    /// `count` bytes from `from` on, in the stream that begins behind one of `header` bytes. In
    /// base64, each stream is padded. `None` when they are not base64.
    fn read(&self, header: u64, from: u64, count: u64) -> io::Result<Option<Vec<u8>>> {
        let read = |from: u64, count: u64| {
            let end = from.checked_add(count).filter(|&end| end <= self.length);
            if end.is_none() {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            let mut bytes = vec![0; count as usize];
            crate::paged_file::read_at(&self.file, &mut bytes, self.start + from)?;
            Ok(bytes)
        };
        if !self.base64 {
            return read(header + from, count).map(Some);
        }
        let groups = |bytes: u64| bytes.div_ceil(3);
        let first = from / 3;
        let text_start = 4 * (groups(header) + first);
        let text = read(text_start, 4 * (groups(from + count) - first))?;
        let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
        let mut decoder = Decoder::new(&text);
        let skip = (from - 3 * first) as usize;
        let want = skip + count as usize;
        // White space would shift all that follows: then the text ends too early.
        if decoder.fill(&mut bytes, want).is_err() || bytes.len() < want {
            return Ok(None);
        }
        Ok(Some(bytes[skip..want].to_vec()))
    }
}
