//! The three encodings of EnSight's files, read in one way: texts of a line, whole numbers, reals.

use crate::model::{Endian, ScalarType, Values};
use crate::read::error::{At, BROKEN, Cursor, Fault, TRUNCATED};
use std::borrow::Cow;

/// Bytes of a text in binary files.
const TEXT_BYTES: u64 = 80;

/// A file with a read position.
pub(super) struct Source<'a> {
    cursor: Cursor<'a>,
    binary: bool,
    /// Of binary files, once the first whole number was read.
    endian: Option<Endian>,
}

/// The content without the marks of Fortran's records, which makes it that of a C file, and its
/// byte order.
pub(super) fn without_records(bytes: &[u8]) -> Result<(Cow<'_, [u8]>, Option<Endian>), Fault> {
    let endian = match bytes.get(..4) {
        Some([80, 0, 0, 0]) => Endian::Little,
        Some([0, 0, 0, 80]) => Endian::Big,
        _ => return Ok((Cow::Borrowed(bytes), None)),
    };
    let mut cursor = Cursor::new(bytes);
    let mut out = Vec::with_capacity(bytes.len());
    while cursor.remaining() > 0 {
        let at = cursor.at();
        let mut mark = || -> Result<u64, Fault> {
            let b = cursor.take(4, 1, "the mark of a record")?;
            let b = [b[0], b[1], b[2], b[3]];
            Ok(u64::from(match endian {
                Endian::Little => u32::from_le_bytes(b),
                Endian::Big => u32::from_be_bytes(b),
            }))
        };
        let length = mark()?;
        out.extend_from_slice(cursor.take(length, 1, "bytes of a record")?);
        let mut end = Cursor { data: cursor.data, pos: cursor.pos };
        let b = end.take(4, 1, "the mark of a record")?;
        if b != &bytes[at_byte(&at)..at_byte(&at) + 4] {
            return Err(Fault::new(
                at,
                format!("a record of {length} bytes has two lengths"),
                BROKEN,
            ));
        }
        cursor.pos = end.pos;
    }
    Ok((Cow::Owned(out), Some(endian)))
}

fn at_byte(at: &At) -> usize {
    if let At::Byte(n) = at { *n as usize } else { 0 }
}

impl<'a> Source<'a> {
    pub(super) fn new(data: &'a [u8], binary: bool, endian: Option<Endian>) -> Self {
        Source { cursor: Cursor::new(data), binary, endian }
    }

    /// Goes to a step of a file that has all of them, between the lines BEGIN TIME STEP and END
    /// TIME STEP. A file without these lines is its only step.
    pub(super) fn go_to_step(&mut self, step: usize) -> Result<(), Fault> {
        const BEGIN: &[u8] = b"BEGIN TIME STEP";
        const END: &[u8] = b"END TIME STEP";
        let data = self.cursor.data;
        let find = |what: &[u8], from: usize| {
            let rest = data.get(from..).unwrap_or_default();
            rest.windows(what.len()).position(|w| w == what).map(|at| from + at)
        };
        let Some(mut begin) = find(BEGIN, 0) else {
            let what = format!("step {}, but no line BEGIN TIME STEP", step + 1);
            return if step == 0 { Ok(()) } else { Err(self.fault(what)) };
        };
        for n in 0..step {
            begin = find(BEGIN, begin + BEGIN.len()).ok_or_else(|| {
                Fault::new(self.at(), format!("{} steps, not {}", n + 1, step + 1), TRUNCATED)
            })?;
        }
        let end = find(END, begin).unwrap_or(data.len());
        self.cursor = Cursor { data: &data[..end], pos: begin };
        self.text().map(drop)
    }

    pub(super) fn at(&self) -> At {
        if self.binary {
            return self.cursor.at();
        }
        let before = &self.cursor.data[..self.cursor.pos];
        At::Line(1 + before.iter().filter(|&&b| b == b'\n').count() as u64)
    }

    pub(super) fn fault(&self, what: impl Into<String>) -> Fault {
        Fault::new(self.at(), what, BROKEN)
    }

    /// The next text, which may be empty; `None` at the end.
    pub(super) fn text(&mut self) -> Result<Option<String>, Fault> {
        if !self.binary {
            return Ok(self.cursor.line().map(|l| l.trim().to_string()));
        }
        if self.cursor.remaining() == 0 {
            return Ok(None);
        }
        let bytes = self.cursor.take(TEXT_BYTES, 1, "letters of a text")?;
        let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
        Ok(Some(String::from_utf8_lossy(&bytes[..end]).trim().to_string()))
    }

    /// A text that must be there.
    pub(super) fn need_text(&mut self, what: &str) -> Result<String, Fault> {
        self.text()?
            .ok_or_else(|| Fault::new(self.at(), format!("the file ends before {what}"), TRUNCATED))
    }

    /// The next text that is not empty; `None` at the end.
    pub(super) fn keyword(&mut self) -> Result<Option<String>, Fault> {
        loop {
            match self.text()? {
                Some(t) if t.is_empty() => {}
                other => return Ok(other),
            }
        }
    }

    /// The text that [`Self::keyword`] would read, without going there.
    pub(super) fn peek(&mut self) -> Option<String> {
        let before = self.cursor.pos;
        let text = self.keyword().ok().flatten();
        self.cursor.pos = before;
        text
    }

    fn values(&mut self, kind: ScalarType, count: u64, what: &str) -> Result<Values, Fault> {
        if self.binary {
            let bytes = self.cursor.take(count, 4, what)?;
            if self.endian.is_none()
                && let Some(&[a, b, c, d]) = bytes.first_chunk::<4>()
            {
                // The first whole number is that of a part, which is small.
                let little = u32::from_le_bytes([a, b, c, d]) <= u32::from_be_bytes([a, b, c, d]);
                self.endian = Some(if little { Endian::Little } else { Endian::Big });
            }
            return Ok(Values::from_bytes(kind, bytes, self.endian.unwrap_or(Endian::Little)));
        }
        let at = self.at();
        let values = self.cursor.numbers(kind, count, what).map_err(|f| Fault { at, ..f })?;
        // The rest of the line is empty; a text begins on the next one.
        let rest = &self.cursor.data[self.cursor.pos..];
        if let Some(end) = rest.iter().position(|b| *b == b'\n' || !b.is_ascii_whitespace())
            && count > 0
            && rest[end] == b'\n'
        {
            self.cursor.pos += end + 1;
        }
        Ok(values)
    }

    pub(super) fn reals(&mut self, count: u64, what: &str) -> Result<Vec<f32>, Fault> {
        match self.values(ScalarType::F32, count, what)? {
            Values::F32(v) => Ok(v),
            other => Ok(other.to_f32()),
        }
    }

    /// Passes numbers that nobody needs. They tell nothing of the byte order: the first whole
    /// number does.
    pub(super) fn skip_reals(&mut self, count: u64, what: &str) -> Result<(), Fault> {
        if self.binary {
            return self.cursor.take(count, 4, what).map(drop);
        }
        self.reals(count, what).map(drop)
    }

    pub(super) fn ints(&mut self, count: u64, what: &str) -> Result<Vec<i32>, Fault> {
        match self.values(ScalarType::I32, count, what)? {
            Values::I32(v) => Ok(v),
            _ => Ok(Vec::new()),
        }
    }

    /// Numbers that count something.
    pub(super) fn counts<const N: usize>(&mut self, what: &str) -> Result<[u64; N], Fault> {
        let at = self.at();
        let read = self.ints(N as u64, what)?;
        let mut out = [0; N];
        for (to, n) in out.iter_mut().zip(read) {
            *to = u64::try_from(n)
                .map_err(|_| Fault::new(at.clone(), format!("{what}: {n}"), BROKEN))?;
        }
        Ok(out)
    }
}
