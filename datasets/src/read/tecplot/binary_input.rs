//! Numbers and texts of a binary Tecplot file.

use crate::model::{Endian, ScalarType, Values};
use crate::read::error::{BROKEN, Cursor, Fault};

/// Bytes with a position and a byte order.
pub(super) struct Input<'a> {
    pub(super) cursor: Cursor<'a>,
    pub(super) endian: Endian,
    pub(super) version: u32,
}

impl<'a> Input<'a> {
    fn array<const N: usize>(&mut self, what: &str) -> Result<[u8; N], Fault> {
        let mut bytes = [0; N];
        bytes.copy_from_slice(self.cursor.take(N as u64, 1, what)?);
        if self.endian == Endian::Big {
            bytes.reverse();
        }
        Ok(bytes)
    }
    pub(super) fn i32(&mut self, what: &str) -> Result<i32, Fault> {
        self.array(what).map(i32::from_le_bytes)
    }
    pub(super) fn f32(&mut self, what: &str) -> Result<f32, Fault> {
        self.array(what).map(f32::from_le_bytes)
    }
    pub(super) fn f64(&mut self, what: &str) -> Result<f64, Fault> {
        self.array(what).map(f64::from_le_bytes)
    }
    /// A number that counts something.
    pub(super) fn count(&mut self, what: &str) -> Result<u64, Fault> {
        let at = self.cursor.at();
        let n = self.i32(what)?;
        u64::try_from(n).map_err(|_| Fault::new(at, format!("{what} is {n}"), BROKEN))
    }
    /// A text: a number for each letter, and a 0.
    pub(super) fn text(&mut self, what: &str) -> Result<String, Fault> {
        let mut text = String::new();
        loop {
            match self.i32(what)? {
                0 => return Ok(text),
                c => text.push(u8::try_from(c).map_or('\u{fffd}', char::from)),
            }
        }
    }
    pub(super) fn list(&mut self, count: u64, what: &str) -> Result<Vec<i32>, Fault> {
        let bytes = self.cursor.take(count, 4, what)?;
        match Values::from_bytes(ScalarType::I32, bytes, self.endian) {
            Values::I32(v) => Ok(v),
            _ => Ok(Vec::new()),
        }
    }
    pub(super) fn fault(&self, what: impl Into<String>) -> Fault {
        Fault::new(self.cursor.at(), what, BROKEN)
    }
}
