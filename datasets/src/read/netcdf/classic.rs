//! Classic files: a header, and values with the most significant byte first.

use super::{AttributeValue, Container, Dimension, Header, Variable};
use crate::model::{Endian, ScalarType, Values};
use crate::read::error::{At, BROKEN, Cursor, Fault, TRUNCATED};
use std::cell::RefCell;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

/// Where the values of a variable lie.
#[derive(Debug)]
struct Place {
    kind: ScalarType,
    begin: u64,
    /// Whether the first axis is that of records, which all such variables take turns in.
    is_record: bool,
}

#[derive(Debug)]
pub(super) struct ClassicFile {
    file: RefCell<File>,
    length: u64,
    header: Header,
    places: Vec<Place>,
    /// Bytes from one record to the next.
    record_size: u64,
}

/// Most bytes of a header: thousands of variables with long texts.
const MAX_HEADER: u64 = 64 << 20;

/// Fields of a header.
struct Fields<'a> {
    cursor: Cursor<'a>,
    /// Bytes of counts, and of positions.
    count_size: u64,
    position_size: u64,
}

impl Fields<'_> {
    fn uint(&mut self, size: u64) -> Result<u64, Fault> {
        let bytes = self.cursor.take(size, 1, "bytes of a number")?;
        Ok(bytes.iter().fold(0, |n, &b| n << 8 | u64::from(b)))
    }
    fn count(&mut self) -> Result<u64, Fault> {
        self.uint(self.count_size)
    }
    /// Bytes that are filled up to a multiple of four.
    fn padded(&mut self, count: u64, each: usize, what: &str) -> Result<&[u8], Fault> {
        let bytes = self.cursor.take(count, each, what)?;
        let rest = (bytes.len().wrapping_neg() % 4).min(self.cursor.remaining());
        self.cursor.pos += rest;
        Ok(bytes)
    }
    fn name(&mut self) -> Result<String, Fault> {
        let length = self.count()?;
        Ok(String::from_utf8_lossy(self.padded(length, 1, "characters of a name")?).into_owned())
    }
    /// The length of a list with this tag; an absent list has none.
    fn list(&mut self, tag: u64, what: &str) -> Result<u64, Fault> {
        let at = self.cursor.at();
        let found = self.uint(4)?;
        let count = self.count()?;
        if found != tag && (found, count) != (0, 0) {
            return Err(Fault::new(at, format!("tag {found} where {what} begin"), BROKEN));
        }
        // Each entry takes room, so a wrong count ends with the header.
        Ok(count)
    }
    fn kind(&mut self) -> Result<Option<ScalarType>, Fault> {
        use ScalarType::*;
        let at = self.cursor.at();
        Ok(Some(match self.uint(4)? {
            1 => I8,
            2 => return Ok(None), // characters
            3 => I16,
            4 => I32,
            5 => F32,
            6 => F64,
            7 => U8,
            8 => U16,
            9 => U32,
            10 => I64,
            11 => U64,
            n => return Err(Fault::new(at, format!("type {n}"), BROKEN)),
        }))
    }
    fn attributes(&mut self) -> Result<Vec<(String, AttributeValue)>, Fault> {
        let mut out = Vec::new();
        for _ in 0..self.list(0x0c, "attributes")? {
            let name = self.name()?;
            let kind = self.kind()?;
            let count = self.count()?;
            let bytes = self.padded(count, kind.map_or(1, ScalarType::size), "values")?;
            out.push((
                name,
                match kind {
                    None => {
                        let text = bytes.iter().copied();
                        AttributeValue::Text(crate::read::hdf5::from_characters(text))
                    }
                    Some(k) => AttributeValue::Numbers(Values::from_bytes(k, bytes, Endian::Big)),
                },
            ));
        }
        Ok(out)
    }
}

impl ClassicFile {
    /// `None` if the file is not a classic one.
    pub(super) fn open(mut file: File, length: u64) -> Result<Option<Self>, Fault> {
        let mut head = Vec::new();
        let read = file.by_ref().take(MAX_HEADER.min(length)).read_to_end(&mut head);
        read.map_err(|e| Fault::new(At::Byte(0), e.to_string(), TRUNCATED))?;
        let version = match head.get(..4) {
            Some([b'C', b'D', b'F', v]) => *v,
            _ => return Ok(None),
        };
        let (count_size, position_size) = match version {
            1 => (4, 4),
            2 => (4, 8),
            5 => (8, 8),
            v => {
                let cure = "save it as one of CDF-1, CDF-2, CDF-5 or NetCDF-4 (nccopy -k)";
                return Err(Fault::unsupported(At::Byte(3), format!("version {v}"), cure));
            }
        };
        let cursor = Cursor { data: &head, pos: 4 };
        let mut f = Fields { cursor, count_size, position_size };
        let records = f.count()?;
        let mut header = Header::default();
        for _ in 0..f.list(0x0a, "dimensions")? {
            let (name, length) = (f.name()?, f.count()?);
            header.dimensions.push(Dimension { name, length, is_unlimited: length == 0 });
        }
        f.attributes()?;
        let mut places = Vec::new();
        let mut sizes = Vec::new();
        for _ in 0..f.list(0x0b, "variables")? {
            let name = f.name()?;
            let at = f.cursor.at();
            let rank = f.count()?;
            crate::read::error::fits(rank, count_size as usize, f.cursor.remaining(), at, "axes")?;
            let mut axes = Vec::new();
            for _ in 0..rank {
                let at = f.cursor.at();
                let axis = f.count()? as usize;
                if axis >= header.dimensions.len() {
                    let what = format!("variable `{name}` has dimension {axis}");
                    return Err(Fault::new(at, what, BROKEN));
                }
                axes.push(axis);
            }
            let attributes = f.attributes()?;
            let kind = f.kind()?;
            f.count()?; // its size, which follows from the lengths and overflows for large ones
            let begin = f.uint(f.position_size)?;
            let is_record = axes.first().is_some_and(|&a| header.dimensions[a].is_unlimited);
            let each = kind.map_or(1, ScalarType::size) as u64;
            let fixed = axes.iter().skip(usize::from(is_record));
            let size = fixed.fold(each, |n, &a| n.saturating_mul(header.dimensions[a].length));
            sizes.push((is_record, size));
            places.push(Place { kind: kind.unwrap_or(ScalarType::U8), begin, is_record });
            header.variables.push(Variable { name, axes, attributes, is_number: kind.is_some() });
        }
        let of_records: Vec<u64> = sizes.iter().filter(|s| s.0).map(|s| s.1).collect();
        let record_size = match of_records[..] {
            [only] => only, // a single variable is not padded
            _ => of_records.iter().fold(0u64, |sum, s| {
                sum.saturating_add(s.checked_next_multiple_of(4).unwrap_or(u64::MAX))
            }),
        };
        // Programs that were interrupted leave the number of records open.
        let is_open = records == if count_size == 4 { u64::from(u32::MAX) } else { u64::MAX };
        let first = places.iter().filter(|p| p.is_record).map(|p| p.begin).min();
        let there = match (first, record_size) {
            (Some(first), 1..) => length.saturating_sub(first).div_ceil(record_size),
            _ => 0,
        };
        let records = if is_open { there } else { records };
        if records > there && first.is_some() {
            let what = format!("{records} records declared, {there} there");
            return Err(Fault::new(At::Byte(4), what, TRUNCATED));
        }
        for d in header.dimensions.iter_mut().filter(|d| d.is_unlimited) {
            d.length = records;
        }
        let file = RefCell::new(file);
        Ok(Some(ClassicFile { file, length, header, places, record_size }))
    }

    /// `count` bytes at `at`.
    fn bytes(&self, at: u64, count: u64, out: &mut Vec<u8>) -> Result<(), Fault> {
        if at.checked_add(count).is_none_or(|end| end > self.length) {
            let what = format!("{count} bytes of values end after the file, of {}", self.length);
            return Err(Fault::new(At::Byte(at), what, TRUNCATED));
        }
        let mut file = self.file.borrow_mut();
        let start = out.len();
        out.resize(start + count as usize, 0);
        let read = file.seek(SeekFrom::Start(at)).and_then(|_| file.read_exact(&mut out[start..]));
        read.map_err(|e| Fault::new(At::Byte(at), e.to_string(), TRUNCATED))
    }
}

impl Container for ClassicFile {
    fn header(&self) -> &Header {
        &self.header
    }

    fn values(&self, variable: usize, start: &[u64], count: &[u64]) -> Result<Values, Fault> {
        let (v, place) = (&self.header.variables[variable], &self.places[variable]);
        let each = place.kind.size() as u64;
        let dims: Vec<u64> = v.axes.iter().map(|&a| self.header.dimensions[a].length).collect();
        // Only the first axis is ever cut: the times.
        let rest = dims.iter().skip(1).fold(each, |n, &d| n.saturating_mul(d));
        let is_whole = dims.iter().skip(1).eq(count.iter().skip(1));
        let first = start.first().copied().unwrap_or(0);
        let rows = if dims.is_empty() { 1 } else { count[0] };
        if !is_whole || dims.first().is_some_and(|&d| first.saturating_add(rows) > d) {
            let what = format!("{count:?} values from {start:?} of {dims:?}");
            return Err(Fault::field(format!("variable `{}`", v.name), what));
        }
        let stride = if place.is_record { self.record_size } else { rest };
        let mut out = Vec::new();
        for row in 0..rows {
            let at = first.saturating_add(row).saturating_mul(stride);
            self.bytes(place.begin.saturating_add(at), rest, &mut out)?;
            if rest == 0 {
                break;
            }
        }
        Ok(Values::from_bytes(place.kind, &out, Endian::Big))
    }

    fn characters(&self, variable: usize) -> Result<Vec<u8>, Fault> {
        let v = &self.header.variables[variable];
        let dims: Vec<u64> = v.axes.iter().map(|&a| self.header.dimensions[a].length).collect();
        match self.values(variable, &vec![0; dims.len()], &dims)? {
            Values::U8(bytes) if !v.is_number => Ok(bytes),
            _ => Err(Fault::field(format!("variable `{}`", v.name), "it does not hold texts")),
        }
    }
}
