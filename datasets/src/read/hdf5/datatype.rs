//! Types of values, and the shapes of arrays.

use super::global_heap::GlobalHeap;
use super::source::{Source, unknown_version};
use crate::model::{Endian, ScalarType, Values};
use crate::read::error::{BROKEN, Fault};

/// What an element is.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Kind {
    Number(ScalarType, Endian),
    /// Text of a fixed length.
    Text,
    /// Text of any length, in a global heap.
    VariableText,
    /// The address of an object.
    Reference,
    /// A list of references in a global heap, as netCDF writes the dimensions of a variable.
    References,
    /// Something else, by name.
    Other(String),
}

/// The type of the elements of a dataset or attribute.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Datatype {
    pub(super) kind: Kind,
    /// Bytes of an element.
    pub(super) size: usize,
}

/// Values of a dataset or attribute.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Data {
    Numbers(Values),
    Texts(Vec<String>),
    /// Lists of addresses of objects.
    References(Vec<Vec<u64>>),
    /// Values of a type that is not read; its name.
    Other(String),
}

impl Datatype {
    /// Decodes a datatype message.
    pub(super) fn parse(source: &Source, data: &[u8], address: u64) -> Result<Self, Fault> {
        Self::nested(source, data, address, 0)
    }

    fn nested(source: &Source, data: &[u8], address: u64, depth: usize) -> Result<Self, Fault> {
        let mut f = source.fields(data, address);
        let at = f.at();
        let head = f.u8()?;
        let (class, version) = (head & 15, head >> 4);
        if !(1..=5).contains(&version) {
            return Err(unknown_version(at, version, "a datatype"));
        }
        let bits = f.uint(3)?;
        let size = f.u32()? as usize;
        let endian = if bits & 1 == 0 { Endian::Little } else { Endian::Big };
        let other = |text: String| Kind::Other(text);
        let kind = match class {
            0 | 4 => {
                let (offset, precision) = (f.u16()?, f.u16()?);
                let signed = class == 0 && bits & 8 != 0;
                match integer(size, signed) {
                    Some(t) if offset == 0 && usize::from(precision) == 8 * size => {
                        Kind::Number(t, endian)
                    }
                    _ => other(format!("integers of {precision} bits in {size} bytes")),
                }
            }
            1 => {
                let (offset, precision) = (f.u16()?, f.u16()?);
                let layout = [f.u8()?, f.u8()?, f.u8()?, f.u8()?];
                let ieee = offset == 0 && usize::from(precision) == 8 * size && bits & 0x40 == 0;
                match (size, layout) {
                    (4, [23, 8, 0, 23]) if ieee => Kind::Number(ScalarType::F32, endian),
                    (8, [52, 11, 0, 52]) if ieee => Kind::Number(ScalarType::F64, endian),
                    _ => {
                        other(format!("floats of {precision} bits that are not IEEE's of 32 or 64"))
                    }
                }
            }
            2 => other("times".into()),
            3 => Kind::Text,
            5 => other("opaque values".into()),
            6 => other("compound values".into()),
            7 if bits & 15 == 0 && size == source.offset_size => Kind::Reference,
            7 => other("references to regions".into()),
            8 if depth == 0 => {
                // An enumeration holds numbers of its base type.
                let rest = f.take(f.remaining())?;
                let base = Self::nested(source, rest, address, depth + 1)?;
                if base.size != size {
                    let what = format!("an enumeration of {size} bytes, its base of {}", base.size);
                    return Err(Fault::new(at, what, BROKEN));
                }
                base.kind
            }
            9 if bits & 15 == 1 => Kind::VariableText,
            9 if depth == 0 => {
                let rest = f.take(f.remaining())?;
                match Self::nested(source, rest, address, depth + 1)?.kind {
                    Kind::Reference => Kind::References,
                    _ => other("lists of variable length".into()),
                }
            }
            10 => other("arrays as elements".into()),
            n => other(format!("values of class {n}")),
        };
        let stored = 8 + source.offset_size;
        let in_heap = matches!(kind, Kind::VariableText | Kind::References);
        if size == 0 || in_heap && size != stored {
            return Err(Fault::new(at, format!("elements of {size} bytes"), BROKEN));
        }
        Ok(Datatype { kind, size })
    }

    /// Decodes elements.
    pub(super) fn decode(&self, source: &Source, bytes: &[u8]) -> Result<Data, Fault> {
        let heap = |each: &mut dyn FnMut(Vec<u8>) -> Result<(), Fault>| {
            let mut heap = GlobalHeap::new(source);
            for element in bytes.chunks_exact(self.size) {
                let mut f = source.fields(element, 0);
                let _count = f.u32()?;
                let address = f.address()?;
                let index = f.u32()?;
                each(match address {
                    Some(address) if index > 0 => heap.object(address, index)?,
                    _ => Vec::new(),
                })?;
            }
            Ok::<(), Fault>(())
        };
        Ok(match &self.kind {
            Kind::Number(kind, endian) => Data::Numbers(Values::from_bytes(*kind, bytes, *endian)),
            Kind::Text => Data::Texts(bytes.chunks_exact(self.size).map(text).collect()),
            Kind::VariableText => {
                let mut out = Vec::new();
                heap(&mut |object| {
                    out.push(text(&object));
                    Ok(())
                })?;
                Data::Texts(out)
            }
            Kind::Reference => {
                let one = |b: &[u8]| b.iter().rev().fold(0, |n, &b| n << 8 | u64::from(b));
                Data::References(bytes.chunks_exact(self.size).map(|b| vec![one(b)]).collect())
            }
            Kind::References => {
                let mut out = Vec::new();
                heap(&mut |object| {
                    let one = |b: &[u8]| b.iter().rev().fold(0, |n, &b| n << 8 | u64::from(b));
                    out.push(object.chunks_exact(source.offset_size).map(one).collect());
                    Ok(())
                })?;
                Data::References(out)
            }
            Kind::Other(name) => Data::Other(name.clone()),
        })
    }
}

fn integer(size: usize, signed: bool) -> Option<ScalarType> {
    use ScalarType::*;
    Some(match (size, signed) {
        (1, true) => I8,
        (1, false) => U8,
        (2, true) => I16,
        (2, false) => U16,
        (4, true) => I32,
        (4, false) => U32,
        (8, true) => I64,
        (8, false) => U64,
        _ => return None,
    })
}

/// Text until its first zero, without the spaces that pad it.
fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).trim_end_matches(' ').to_string()
}

/// Lengths of the axes of an array; none for a single value.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Dataspace {
    pub(super) dims: Vec<u64>,
    /// Largest lengths; `None` for an axis without a limit.
    pub(super) max: Vec<Option<u64>>,
    /// No value at all.
    pub(super) is_null: bool,
}

impl Dataspace {
    /// Decodes a dataspace message.
    pub(super) fn parse(source: &Source, data: &[u8], address: u64) -> Result<Self, Fault> {
        let mut f = source.fields(data, address);
        let at = f.at();
        let version = f.u8()?;
        let rank = usize::from(f.u8()?);
        let flags = f.u8()?;
        let is_null = match version {
            1 => {
                f.skip(5)?;
                false
            }
            2 => f.u8()? == 2,
            v => return Err(unknown_version(at, v, "a dataspace")),
        };
        if rank > 32 {
            return Err(Fault::new(at, format!("{rank} axes; HDF5 allows 32"), BROKEN));
        }
        let dims: Vec<u64> = (0..rank).map(|_| f.length()).collect::<Result<_, _>>()?;
        let unlimited =
            if source.length_size == 8 { u64::MAX } else { (1 << (8 * source.length_size)) - 1 };
        let max = if flags & 1 != 0 {
            let of = |m: u64| (m != unlimited).then_some(m);
            (0..rank).map(|_| f.length().map(of)).collect::<Result<_, _>>()?
        } else {
            dims.iter().map(|&d| Some(d)).collect()
        };
        Ok(Dataspace { dims, max, is_null })
    }

    /// Number of elements.
    pub(super) fn count(&self) -> Option<u64> {
        match self.is_null {
            true => Some(0),
            false => self.dims.iter().try_fold(1u64, |n, &d| n.checked_mul(d)),
        }
    }
}
