//! Reads one binary array of a VTK XML file: length header, base64 or raw bytes, compressed blocks.
//!
//! Layout (VTK file formats guide, "XML file formats"; vtkXMLDataParser.cxx): uncompressed = number
//! of bytes, bytes. Compressed = number of blocks, size of a block, size of the last block if it is
//! partial (else 0), compressed size of each block, then the blocks. In base64, the header of
//! compressed data is padded and encoded separately, whereas the length of uncompressed data is
//! encoded together with the data.

use crate::model::Endian;
use crate::read::base64::{BadByte, Decoder};
use crate::read::error::{At, BROKEN, Fault, TRUNCATED, fits};

/// The compression of arrays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Compressor {
    None,
    Zlib,
    Lz4,
}

/// Properties of the whole file.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Encoding {
    pub(crate) endian: Endian,
    /// Bytes per number in the headers: 4 or 8.
    pub(crate) header_bytes: usize,
    pub(crate) compressor: Compressor,
}

/// The encoded bytes of an array, as stored in the file.
#[derive(Clone, Copy)]
pub(crate) enum EncodedBytes<'a> {
    Base64(&'a [u8]),
    Raw(&'a [u8]),
}

/// The highest ratio of any compressor: zlib 1:1032 (zlib's technical notes), LZ4 1:255.
const MAX_RATIO: u64 = 1040;

/// The bytes of the array `name`, uncompressed.
pub(crate) fn decode(stored: EncodedBytes<'_>, e: Encoding, name: &str) -> Result<Vec<u8>, Fault> {
    let mut source = Source::new(stored, name);
    let w = e.header_bytes;
    let number = |bytes: &[u8]| number(bytes, e.endian);
    let at = || At::Field(format!("array `{name}`"));

    if e.compressor == Compressor::None {
        let head = source.piece(w)?;
        if head.len() < w {
            return if head.is_empty() { Ok(head) } else { Err(source.ended("its length")) };
        }
        let size = number(&head[..w]);
        let size = fits(size, 1, source.most_bytes_left() + head.len() - w, at(), "bytes")?;
        let mut bytes = head[w..].to_vec();
        source.fill(&mut bytes, size)?;
        return if bytes.len() < size {
            Err(source.ended(&format!("{size} bytes ({} found)", bytes.len())))
        } else {
            bytes.truncate(size);
            Ok(bytes)
        };
    }

    // Header. Some writers shorten the header of an empty array to the zero.
    let start = source.clone();
    let head = source.piece(3 * w)?;
    if head.len() < w || number(&head[..w]) == 0 {
        return if head.is_empty() || head.len() >= w {
            Ok(Vec::new())
        } else {
            Err(source.ended("its header"))
        };
    }
    if head.len() < 3 * w {
        return Err(source.ended("its header"));
    }
    let [blocks, block_size, last] = [0, 1, 2].map(|i| number(&head[i * w..(i + 1) * w]));
    let blocks = fits(blocks, w, source.most_bytes_left(), at(), "blocks")?;
    source = start;
    let head = source.piece((3 + blocks) * w)?;
    if head.len() < (3 + blocks) * w {
        return Err(source.ended("the sizes of its blocks"));
    }
    let sizes: Vec<u64> = (3..3 + blocks).map(|i| number(&head[i * w..(i + 1) * w])).collect();

    // Sizes that the bytes cannot justify are rejected before memory is allocated.
    let compressed = sizes.iter().try_fold(0u64, |n, &s| n.checked_add(s)).unwrap_or(u64::MAX);
    fits(compressed, 1, source.most_bytes_left(), at(), "compressed bytes")?;
    let full = blocks as u64 - u64::from(last > 0);
    let total = full.checked_mul(block_size).and_then(|n| n.checked_add(last)).unwrap_or(u64::MAX);
    if last > block_size || total > most_from(compressed) {
        let what = format!(
            "{blocks} blocks of {block_size} bytes (last {last}) cannot come from {compressed} \
             compressed bytes"
        );
        return Err(Fault::new(at(), what, BROKEN));
    }

    let mut out = vec![0u8; total as usize];
    let (mut done, mut packed) = (0usize, Vec::new());
    for (i, &size) in sizes.iter().enumerate() {
        packed.drain(..packed.len().min(if i == 0 { 0 } else { sizes[i - 1] as usize }));
        source.fill(&mut packed, size as usize)?;
        let Some(block) = packed.get(..size as usize) else {
            return Err(source.ended(&format!("block {i}")));
        };
        let want = if last > 0 && i + 1 == blocks { last } else { block_size } as usize;
        decompress(e.compressor, block, &mut out[done..done + want], i, name)?;
        done += want;
    }
    Ok(out)
}

/// A number of 4 or 8 bytes in a header.
pub(super) fn number(bytes: &[u8], endian: Endian) -> u64 {
    let mut b = [0u8; 8];
    b[..bytes.len()].copy_from_slice(bytes);
    if endian == Endian::Big {
        b[..bytes.len()].reverse();
    }
    u64::from_le_bytes(b)
}

/// The most bytes that so many compressed ones can give.
pub(super) fn most_from(compressed: u64) -> u64 {
    compressed.saturating_mul(MAX_RATIO)
}

/// Fills `target` from block `i` of the array `name`.
pub(super) fn decompress(
    compressor: Compressor,
    block: &[u8],
    target: &mut [u8],
    i: usize,
    name: &str,
) -> Result<(), Fault> {
    let want = target.len();
    let got = match compressor {
        Compressor::Zlib => inflate(block, target),
        _ => lz4_flex::block::decompress_into(block, target).map_err(|e| e.to_string()),
    };
    let (what, cure) = match got {
        Ok(n) if n == want => return Ok(()),
        Ok(n) => (format!("block {i} gives {n} bytes instead of {want}"), BROKEN),
        Err(e) => (format!("block {i} cannot be decompressed: {e}"), TRUNCATED),
    };
    Err(Fault::new(At::Field(format!("array `{name}`")), what, cure))
}

fn inflate(block: &[u8], target: &mut [u8]) -> Result<usize, String> {
    let mut z = flate2::Decompress::new(true);
    match z.decompress(block, target, flate2::FlushDecompress::Finish) {
        Ok(flate2::Status::StreamEnd) => Ok(z.total_out() as usize),
        Ok(_) => Err(format!("the stream does not end after {} bytes", z.total_out())),
        Err(e) => Err(e.to_string()),
    }
}

/// A sequential reader of bytes from raw data or base64 text.
#[derive(Clone)]
struct Source<'a> {
    stored: EncodedBytes<'a>,
    pos: usize,
    name: &'a str,
}

impl<'a> Source<'a> {
    fn new(stored: EncodedBytes<'a>, name: &'a str) -> Self {
        Source { stored, pos: 0, name }
    }

    /// An upper bound on the number of remaining bytes.
    fn most_bytes_left(&self) -> usize {
        match self.stored {
            EncodedBytes::Raw(b) => b.len() - self.pos,
            EncodedBytes::Base64(t) => (t.len() - self.pos) / 4 * 3,
        }
    }

    /// Appends to `out` until it has `len` bytes (base64: up to two more) or the input ends.
    fn fill(&mut self, out: &mut Vec<u8>, len: usize) -> Result<(), Fault> {
        if out.len() >= len {
            return Ok(());
        }
        match self.stored {
            EncodedBytes::Raw(b) => {
                let n = (len - out.len()).min(b.len() - self.pos);
                out.extend_from_slice(&b[self.pos..self.pos + n]);
                self.pos += n;
            }
            EncodedBytes::Base64(t) => {
                out.reserve((len - out.len()).min(self.most_bytes_left()));
                let mut decoder = Decoder::new(&t[self.pos..]);
                let result = decoder.fill(out, len);
                self.pos += decoder.pos;
                if let Err(BadByte { pos, byte }) = result {
                    // Appended text is followed by the closing tag, which ends data that is too
                    // short.
                    if byte == b'<' || byte == b'_' {
                        return Err(self.ended(&format!("{len} bytes ({} found)", out.len())));
                    }
                    let what = format!("byte {byte:#04x} after {pos} letters is not base64");
                    return Err(Fault::new(
                        At::Field(format!("array `{}`", self.name)),
                        what,
                        BROKEN,
                    ));
                }
            }
        }
        Ok(())
    }

    /// Reads a header of `len` bytes. In base64, it also returns the bytes of its last group beyond
    /// the header, unless those are padding.
    fn piece(&mut self, len: usize) -> Result<Vec<u8>, Fault> {
        let mut out = Vec::new();
        if len <= self.most_bytes_left().saturating_add(2) {
            self.fill(&mut out, len)?;
        }
        Ok(out)
    }

    fn ended(&self, among: &str) -> Fault {
        Fault::new(
            At::Field(format!("array `{}`", self.name)),
            format!("the data ends within {among}"),
            TRUNCATED,
        )
    }
}
