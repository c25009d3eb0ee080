//! The header of a NumPy array: a Python dictionary with the type, the order and the shape.
//!
//! Source: "NEP 1 — A simple file format for NumPy arrays", and `numpy.lib.format` for versions 2
//! (longer headers) and 3 (UTF-8). The crate npyz reads it with a parser of any Python literal,
//! which brings a second version of num-bigint; the grammar here has three keys.

use crate::model::{Endian, ScalarType};
use crate::read::error::{At, BROKEN, Fault, TRUNCATED};
use std::io::Read;

/// What precedes the numbers.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header {
    pub(super) kind: ScalarType,
    pub(super) endian: Endian,
    /// First index fastest, instead of last.
    pub(super) fortran_order: bool,
    pub(super) shape: Vec<u64>,
}

pub(in crate::read) const MAGIC: &[u8] = b"\x93NUMPY";
/// numpy itself refuses headers above 10,000 characters.
const LONGEST_HEADER: u32 = 1 << 16;
/// numpy's own limit.
const MOST_AXES: usize = 64;

impl Header {
    /// Reads the header; what follows in `source` are the numbers. Also returns the number of bytes
    /// read.
    pub(super) fn read(source: &mut impl Read) -> Result<(Header, u64), Fault> {
        let mut take = |n: usize, at: u64, what: &str| -> Result<Vec<u8>, Fault> {
            let mut bytes = vec![0; n];
            source.read_exact(&mut bytes).map_err(|e| {
                Fault::new(At::Byte(at), format!("the file ends within {what} ({e})"), TRUNCATED)
            })?;
            Ok(bytes)
        };
        let start = take(8, 0, "the signature")?;
        if start[..6] != *MAGIC {
            let what = "it does not begin with \\x93NUMPY";
            return Err(Fault::new(At::Byte(0), what, "save it with numpy.save"));
        }
        let (length, at) = match start[6] {
            1 => {
                let b = take(2, 8, "the length of the header")?;
                (u32::from(u16::from_le_bytes([b[0], b[1]])), 10)
            }
            2 | 3 => {
                let b = take(4, 8, "the length of the header")?;
                (u32::from_le_bytes([b[0], b[1], b[2], b[3]]), 12)
            }
            v => {
                let what = format!("version {v}.{} of the format", start[7]);
                let cure = "save it with a numpy that writes version 1, 2 or 3";
                return Err(Fault::unsupported(At::Byte(6), what, cure));
            }
        };
        if length > LONGEST_HEADER {
            let what = format!("the header is {length} bytes long");
            return Err(Fault::new(At::Byte(8), what, BROKEN));
        }
        let text = take(length as usize, at, "the header")?;
        let text = String::from_utf8_lossy(&text).into_owned();
        let header = Dictionary { text: &text, pos: 0, first: at }.header()?;
        Ok((header, at + u64::from(length)))
    }

    /// Number of values; a fault if it does not fit in 64 bits.
    pub(super) fn count(&self) -> Result<u64, Fault> {
        self.shape.iter().try_fold(1u64, |n, &d| n.checked_mul(d)).ok_or_else(|| {
            Fault::field(
                "`shape` of the header",
                format!("{:?} has more than 2^64 values", self.shape),
            )
        })
    }
}

/// A reader of the dictionary.
struct Dictionary<'a> {
    text: &'a str,
    pos: usize,
    /// Position of the text in the file.
    first: u64,
}

impl Dictionary<'_> {
    fn header(mut self) -> Result<Header, Fault> {
        let (mut descr, mut fortran, mut shape) = (None, None, None);
        self.expect('{')?;
        while self.peek() != Some('}') {
            let key = self.string()?;
            self.expect(':')?;
            match key.as_str() {
                "descr" => descr = Some(self.type_name()?),
                "fortran_order" => fortran = Some(self.truth()?),
                "shape" => shape = Some(self.tuple()?),
                _ => return Err(self.wrong(&format!("a key `{key}`"))),
            }
            if self.peek() == Some(',') {
                self.pos += 1;
            } else if self.peek() != Some('}') {
                return Err(self.wrong("no comma after a value"));
            }
        }
        let missing = |key: &str| Fault::field("the header", format!("there is no `{key}`"));
        let (kind, endian) = descr.ok_or_else(|| missing("descr"))?;
        Ok(Header {
            kind,
            endian,
            fortran_order: fortran.ok_or_else(|| missing("fortran_order"))?,
            shape: shape.ok_or_else(|| missing("shape"))?,
        })
    }

    fn peek(&mut self) -> Option<char> {
        let rest = &self.text[self.pos..];
        self.pos += rest.len() - rest.trim_start().len();
        self.text[self.pos..].chars().next()
    }

    fn wrong(&self, found: &str) -> Fault {
        let shown: String = self.text[self.pos..].chars().take(20).collect();
        let at = At::Byte(self.first + self.pos as u64);
        Fault::new(at, format!("the header has {found} at `{shown}`"), "save it with numpy.save")
    }

    fn expect(&mut self, what: char) -> Result<(), Fault> {
        if self.peek() != Some(what) {
            return Err(self.wrong(&format!("no `{what}`")));
        }
        self.pos += what.len_utf8();
        Ok(())
    }

    fn string(&mut self) -> Result<String, Fault> {
        let quote = self.peek().filter(|c| *c == '\'' || *c == '"');
        let Some(quote) = quote else { return Err(self.wrong("no text in quotes")) };
        let rest = &self.text[self.pos + 1..];
        let Some(end) = rest.find(quote) else { return Err(self.wrong("a quote without end")) };
        self.pos += end + 2;
        Ok(rest[..end].to_string())
    }

    fn truth(&mut self) -> Result<bool, Fault> {
        self.peek();
        for (word, value) in [("True", true), ("False", false)] {
            if self.text[self.pos..].starts_with(word) {
                self.pos += word.len();
                return Ok(value);
            }
        }
        Err(self.wrong("neither True nor False"))
    }

    fn tuple(&mut self) -> Result<Vec<u64>, Fault> {
        self.expect('(')?;
        let mut numbers = Vec::new();
        while self.peek() != Some(')') {
            let rest = &self.text[self.pos..];
            let end = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
            let Ok(n) = rest[..end].parse() else { return Err(self.wrong("no whole number")) };
            // Python 2 wrote long integers with an L.
            self.pos += end + usize::from(rest[end..].starts_with('L'));
            numbers.push(n);
            if numbers.len() > MOST_AXES {
                return Err(self.wrong(&format!("more than {MOST_AXES} axes")));
            }
            if self.peek() == Some(',') {
                self.pos += 1;
            } else if self.peek() != Some(')') {
                return Err(self.wrong("no comma after a number"));
            }
        }
        self.pos += 1;
        Ok(numbers)
    }

    fn type_name(&mut self) -> Result<(ScalarType, Endian), Fault> {
        let at = || At::Field("`descr` of the header".into());
        if self.peek() == Some('[') {
            let cure = "save each field as an array of its own, with numpy.savez";
            return Err(Fault::unsupported(at(), "a record of several fields", cure));
        }
        let name = self.string()?;
        let (order, code) = match name.chars().next() {
            Some('<' | '=' | '|') => (Endian::Little, &name[1..]),
            Some('>') => (Endian::Big, &name[1..]),
            _ => (Endian::Little, name.as_str()),
        };
        let kind = match code {
            "f4" => ScalarType::F32,
            "f8" => ScalarType::F64,
            "i1" => ScalarType::I8,
            "i2" => ScalarType::I16,
            "i4" => ScalarType::I32,
            "i8" => ScalarType::I64,
            "u1" | "b1" => ScalarType::U8,
            "u2" => ScalarType::U16,
            "u4" => ScalarType::U32,
            "u8" => ScalarType::U64,
            _ => {
                let cure = "save it as floats: numpy.save(name, array.astype('float64'))";
                return Err(Fault::unsupported(at(), format!("type `{name}`"), cure));
            }
        };
        Ok((kind, order))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(dictionary: &str) -> Result<Header, String> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((dictionary.len() as u16).to_le_bytes());
        bytes.extend(dictionary.as_bytes());
        let header = Header::read(&mut bytes.as_slice());
        header.map(|h| h.0).map_err(|f| format!("{} {}; {}", f.at, f.what, f.cure))
    }

    #[test]
    fn dictionaries_as_numpy_writes_them() {
        let h = read("{'descr': '>f4', 'fortran_order': True, 'shape': (3, 40L,), }   \n").unwrap();
        let expected = Header {
            kind: ScalarType::F32,
            endian: Endian::Big,
            fortran_order: true,
            shape: vec![3, 40],
        };
        assert_eq!(h, expected);
        let h = read("{\"shape\": (), \"fortran_order\": False, \"descr\": \"|u1\"}").unwrap();
        assert_eq!((h.shape.len(), h.count(), h.kind), (0, Ok(1), ScalarType::U8));
    }

    #[test]
    fn what_is_not_a_lattice_of_numbers_is_refused_by_name() {
        for (text, word) in [
            ("{'descr': '<c16', 'fortran_order': False, 'shape': (2,)}", "astype('float64')"),
            ("{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (2,)}", "numpy.savez"),
            ("{'descr': '<f4', 'fortran_order': 0, 'shape': (2,)}", "neither True nor False"),
            ("{'descr': '<f4', 'fortran_order': False, 'shape': (-2,)}", "no whole number"),
            ("{'descr': '<f4', 'fortran_order': False}", "no `shape`"),
            ("{'descr': '<f4' 'shape': (2,)}", "no comma"),
            ("{'descr': '<é4", "without end"),
            ("", "no `{`"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(word), "{text}: {error}");
        }
    }
}
