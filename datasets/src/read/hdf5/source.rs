//! Reads parts of a file: nothing beyond its end, and never more in sum than its length justifies.

use crate::read::error::{At, BROKEN, Fault, TRUNCATED};
use std::cell::{Cell, RefCell};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

/// Bytes that may be read or unpacked for each byte of the file. Deflate gains at most 1:1032
/// (zlib's technical notes), and a dataset may be read more than once. It bounds memory, and the
/// time for structures that name themselves.
const GAIN: u64 = 4096;

/// A file with the sizes that its superblock gives.
#[derive(Debug)]
pub(super) struct Source {
    file: RefCell<File>,
    len: u64,
    left: Cell<u64>,
    /// Where address 0 lies in the file.
    pub(super) base: u64,
    /// Bytes of an address.
    pub(super) offset_size: usize,
    /// Bytes of a length.
    pub(super) length_size: usize,
}

impl Source {
    pub(super) fn new(file: File, len: u64) -> Self {
        let left = Cell::new(len.saturating_mul(GAIN));
        Source { file: RefCell::new(file), len, left, base: 0, offset_size: 8, length_size: 8 }
    }

    pub(super) fn len(&self) -> u64 {
        self.len
    }

    /// Takes `bytes` from what the file may still ask for.
    pub(super) fn allow(&self, bytes: u64, what: &str) -> Result<usize, Fault> {
        let left = self.left.get().checked_sub(bytes);
        let (Some(left), Ok(bytes)) = (left, usize::try_from(bytes)) else {
            let found = format!("{bytes} bytes, in a file of {} bytes", self.len);
            return Err(Fault::field(format!("the size of {what}"), found));
        };
        self.left.set(left);
        Ok(bytes)
    }

    /// `count` bytes at `address`.
    pub(super) fn bytes(&self, address: u64, count: u64, what: &str) -> Result<Vec<u8>, Fault> {
        let at = self.base.saturating_add(address);
        if at.checked_add(count).is_none_or(|end| end > self.len) {
            let what = format!("{what} of {count} bytes ends after the file, of {}", self.len);
            return Err(Fault::new(At::Byte(at), what, TRUNCATED));
        }
        let mut out = vec![0; self.allow(count, what)?];
        let mut file = self.file.borrow_mut();
        let read = file.seek(SeekFrom::Start(at)).and_then(|_| file.read_exact(&mut out));
        read.map_err(|e| Fault::new(At::Byte(at), format!("{what}: {e}"), TRUNCATED))?;
        Ok(out)
    }

    /// As [`Self::bytes`], or what there is until the end of the file.
    pub(super) fn at_most(&self, address: u64, count: u64, what: &str) -> Result<Vec<u8>, Fault> {
        let at = self.base.saturating_add(address);
        self.bytes(address, count.min(self.len.saturating_sub(at)), what)
    }

    /// Fields of `data`, which lies at `address`.
    pub(super) fn fields<'a>(&self, data: &'a [u8], address: u64) -> Fields<'a> {
        let (offset_size, length_size) = (self.offset_size, self.length_size);
        Fields { data, pos: 0, address, offset_size, length_size }
    }
}

/// Little-endian fields, one after the other.
#[derive(Debug, Clone)]
pub(super) struct Fields<'a> {
    data: &'a [u8],
    pub(super) pos: usize,
    address: u64,
    offset_size: usize,
    length_size: usize,
}

impl<'a> Fields<'a> {
    pub(super) fn at(&self) -> At {
        At::Byte(self.address.saturating_add(self.pos as u64))
    }
    pub(super) fn remaining(&self) -> usize {
        self.data.len() - self.pos
    }
    pub(super) fn take(&mut self, n: usize) -> Result<&'a [u8], Fault> {
        let Some(bytes) = self.pos.checked_add(n).and_then(|end| self.data.get(self.pos..end))
        else {
            let what = format!("{n} bytes expected, {} left of this structure", self.remaining());
            return Err(Fault::new(self.at(), what, BROKEN));
        };
        self.pos += n;
        Ok(bytes)
    }
    pub(super) fn skip(&mut self, n: usize) -> Result<(), Fault> {
        self.take(n).map(|_| ())
    }
    /// An unsigned number of at most 8 bytes.
    pub(super) fn uint(&mut self, size: usize) -> Result<u64, Fault> {
        Ok(self.take(size)?.iter().rev().fold(0, |n, &b| n << 8 | u64::from(b)))
    }
    pub(super) fn u8(&mut self) -> Result<u8, Fault> {
        Ok(self.take(1)?[0])
    }
    pub(super) fn u16(&mut self) -> Result<u16, Fault> {
        Ok(self.uint(2)? as u16)
    }
    pub(super) fn u32(&mut self) -> Result<u32, Fault> {
        Ok(self.uint(4)? as u32)
    }
    pub(super) fn length(&mut self) -> Result<u64, Fault> {
        self.uint(self.length_size)
    }
    /// An address; `None` for the undefined one, whose bits are all set.
    pub(super) fn address(&mut self) -> Result<Option<u64>, Fault> {
        let bytes = self.take(self.offset_size)?;
        let value = bytes.iter().rev().fold(0, |n, &b| n << 8 | u64::from(b));
        Ok((!bytes.iter().all(|&b| b == 0xff)).then_some(value))
    }
    /// An address that must be there.
    pub(super) fn defined(&mut self, what: &str) -> Result<u64, Fault> {
        let at = self.at();
        self.address()?.ok_or_else(|| Fault::new(at, format!("{what} has no address"), BROKEN))
    }
    pub(super) fn signature(&mut self, expected: &[u8; 4]) -> Result<(), Fault> {
        let at = self.at();
        let found = self.take(4)?;
        if found == expected {
            return Ok(());
        }
        let (found, expected) = (found.escape_ascii(), expected.escape_ascii());
        Err(Fault::new(at, format!("`{found}` where `{expected}` begins"), BROKEN))
    }
    /// A version, which must be `known`.
    pub(super) fn version(&mut self, known: u8, what: &str) -> Result<(), Fault> {
        let at = self.at();
        match self.u8()? {
            v if v == known => Ok(()),
            v => Err(unknown_version(at, v, what)),
        }
    }
}

/// Refuses a version that this reader does not know.
pub(super) fn unknown_version(at: At, version: u8, what: &str) -> Fault {
    let cure = "write the file with HDF5 1.8 to 1.14, or repack it with h5repack --high=2";
    Fault::unsupported(at, format!("version {version} of {what}"), cure)
}

/// Bytes that hold a number up to `limit`.
pub(super) fn bytes_for(limit: u64) -> usize {
    limit.max(1).ilog2() as usize / 8 + 1
}

/// Compares the checksum in the last four bytes with that of the rest.
pub(super) fn verify(block: &[u8], address: u64) -> Result<(), Fault> {
    let (data, stored) = block.split_at(block.len().saturating_sub(4));
    let found = lookup3(data);
    if stored == found.to_le_bytes() {
        return Ok(());
    }
    let what = format!("the checksum of a structure of {} bytes is {found:08x}", data.len());
    Err(Fault::new(At::Byte(address), what, "the file is damaged: copy or write it again"))
}

/// Jenkins' hash `lookup3` (hashlittle), with the initial value 0: HDF5's checksum of metadata.
pub(super) fn lookup3(data: &[u8]) -> u32 {
    let mut state = [0xdead_beef_u32.wrapping_add(data.len() as u32); 3];
    let mut rest = data;
    let add = |state: &mut [u32; 3], block: &[u8]| {
        for (i, &b) in block.iter().enumerate() {
            state[i / 4] = state[i / 4].wrapping_add(u32::from(b) << (8 * (i % 4)));
        }
    };
    while rest.len() > 12 {
        let (block, after) = rest.split_at(12);
        add(&mut state, block);
        rest = after;
        let [a, b, c] = &mut state;
        let step = |x: &mut u32, y: &mut u32, z: &mut u32, turn: u32| {
            *x = x.wrapping_sub(*z) ^ z.rotate_left(turn);
            *z = z.wrapping_add(*y);
        };
        step(a, b, c, 4);
        step(b, c, a, 6);
        step(c, a, b, 8);
        step(a, b, c, 16);
        step(b, c, a, 19);
        step(c, a, b, 4);
    }
    if rest.is_empty() {
        return state[2];
    }
    add(&mut state, rest);
    let [mut a, mut b, mut c] = state;
    let step = |x: &mut u32, y: u32, turn: u32| *x = (*x ^ y).wrapping_sub(y.rotate_left(turn));
    step(&mut c, b, 14);
    step(&mut a, c, 11);
    step(&mut b, a, 25);
    step(&mut c, b, 16);
    step(&mut a, c, 4);
    step(&mut b, a, 14);
    step(&mut c, b, 24);
    c
}

#[cfg(test)]
mod tests {
    #[test]
    fn lookup3_has_its_authors_values() {
        // Jenkins, lookup3.c, driver5.
        assert_eq!(super::lookup3(b""), 0xdead_beef);
        assert_eq!(super::lookup3(b"Four score and seven years ago"), 0x1777_0551);
    }
}
