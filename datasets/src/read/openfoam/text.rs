//! OpenFOAM's files: words, lists and dictionaries, as text or with binary lists, plain or gzipped.
//!
//! Source: OpenFOAM User Guide, "Basic input/output file format", and `UListIO.C`: a list is its
//! length and its values in parentheses, `N(...)`; `N{value}` repeats one value. In binary files
//! the values are bytes, whose widths the header's `arch` tells.

use crate::model::{Endian, ScalarType, Values};
use crate::read::ReadError;
use crate::read::error::{At, BROKEN, Fault, TRUNCATED, fits, io_error};
use std::io::Read;
use std::ops::Range;
use std::path::{Path, PathBuf};

pub(super) const FORMAT: &str = "OpenFOAM";

/// A file whose header has been read.
pub(super) struct FoamFile {
    pub(super) path: PathBuf,
    pub(super) class: String,
    /// The number of its block, if it is one of several in a file: positions are those within it.
    block: Option<usize>,
    bytes: Vec<u8>,
    pos: usize,
    binary: bool,
    label_bytes: usize,
    scalar_bytes: usize,
    endian: Endian,
}

/// Whether a file is there, plain or gzipped.
pub(super) fn exists(path: &Path) -> bool {
    path.is_file() || zipped(path).is_file()
}

fn zipped(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".gz");
    PathBuf::from(name)
}

impl FoamFile {
    /// Reads `path`, or `path.gz`, up to `limit` bytes.
    pub(super) fn open(path: &Path, limit: Option<u64>) -> Result<FoamFile, ReadError> {
        let path = if path.is_file() { path.to_path_buf() } else { zipped(path) };
        let file = std::fs::File::open(&path).map_err(|e| io_error(&path, e))?;
        let length = file.metadata().map_err(|e| io_error(&path, e))?.len();
        let mut bytes = Vec::new();
        let is_zipped = path.extension().is_some_and(|e| e == "gz");
        let limit = limit.unwrap_or(u64::MAX);
        let read = if is_zipped {
            // Deflate gains at most 1:1032 (zlib's technical notes).
            let most = length.saturating_mul(1040).min(limit);
            flate2::read::MultiGzDecoder::new(file).take(most).read_to_end(&mut bytes)
        } else {
            file.take(limit).read_to_end(&mut bytes)
        };
        if let Err(e) = read {
            if !is_zipped {
                return Err(io_error(&path, e));
            }
            let what = format!("it cannot be unpacked: {e}");
            return Err(Fault::new(At::Byte(0), what, TRUNCATED).in_file(&path, FORMAT));
        }
        let mut file = FoamFile::of_bytes(&path, None, bytes);
        file.header().map_err(|f| file.fault(f))?;
        Ok(file)
    }

    /// A file, or a block of one, with these bytes; its header is not read.
    pub(super) fn of_bytes(path: &Path, block: Option<usize>, bytes: Vec<u8>) -> FoamFile {
        FoamFile {
            path: path.to_path_buf(),
            class: String::new(),
            block,
            bytes,
            pos: 0,
            binary: false,
            label_bytes: 4,
            scalar_bytes: 8,
            endian: Endian::Little,
        }
    }

    /// With what the header of another file says.
    pub(super) fn with_header_of(self, other: &FoamFile) -> FoamFile {
        let &FoamFile { binary, label_bytes, scalar_bytes, endian, .. } = other;
        let class = other.class.clone();
        FoamFile { class, binary, label_bytes, scalar_bytes, endian, ..self }
    }

    /// Whether a header comes next.
    pub(super) fn begins_with_header(&mut self) -> bool {
        self.peek();
        self.bytes[self.pos..].starts_with(b"FoamFile")
    }

    /// Goes into a list of bytes, whose length stands before it; returns the length.
    pub(super) fn enter_bytes(&mut self) -> Result<u64, Fault> {
        let count = self.number("the length of a block")?;
        self.expect(b'(')?;
        Ok(count)
    }

    /// Goes over a list of bytes; returns their place.
    pub(super) fn skip_bytes(&mut self) -> Result<Range<usize>, Fault> {
        let count = self.enter_bytes()?;
        let n = fits(count, 1, self.bytes.len() - self.pos, self.at(), "bytes of a block")?;
        let range = self.pos..self.pos + n;
        self.pos = range.end;
        self.expect(b')')?;
        Ok(range)
    }

    /// Bytes at a place that [`Self::skip_bytes`] returned.
    pub(super) fn bytes_at(&self, range: Range<usize>) -> &[u8] {
        &self.bytes[range]
    }

    /// Adds the name of the file.
    pub(super) fn fault(&self, mut fault: Fault) -> ReadError {
        if let Some(block) = self.block {
            fault.what = format!("{} (in the block of part {block})", fault.what);
        }
        fault.in_file(&self.path, FORMAT)
    }

    /// Reads the header.
    pub(super) fn header(&mut self) -> Result<(), Fault> {
        let first = self.word();
        if first.as_deref() != Some("FoamFile") {
            let what = "it does not begin with the dictionary FoamFile";
            let cure = "it is no file of OpenFOAM, or damaged: write it again";
            return Err(Fault::new(self.at(), what, cure));
        }
        self.expect(b'{')?;
        loop {
            let key = self.word().ok_or_else(|| self.ended("the header"))?;
            match key.as_str() {
                "}" => return Ok(()),
                // The word `format` with a value in quotes is possible, too.
                "format" | "class" | "arch" => {
                    let value = self.word().ok_or_else(|| self.ended("the header"))?;
                    match key.as_str() {
                        "format" => self.binary = value == "binary",
                        "class" => self.class = value,
                        _ => self.architecture(&value)?,
                    }
                    self.expect(b';')?;
                }
                _ => self.skip_value()?,
            }
        }
    }

    /// `LSB;label=32;scalar=64`
    fn architecture(&mut self, arch: &str) -> Result<(), Fault> {
        for word in arch.split(';') {
            let bits = |text: &str| match text {
                "32" => Ok(4),
                "64" => Ok(8),
                _ => Err(Fault::field("`arch` of the header", format!("`{word}`"))),
            };
            match word.split_once('=') {
                Some(("label", n)) => self.label_bytes = bits(n)?,
                Some(("scalar", n)) => self.scalar_bytes = bits(n)?,
                None if word == "MSB" => self.endian = Endian::Big,
                _ => {}
            }
        }
        Ok(())
    }

    /// The present position: a line of text, an offset in binary files.
    pub(super) fn at(&self) -> At {
        let pos = self.pos.min(self.bytes.len());
        if self.binary {
            return At::Byte(pos as u64);
        }
        At::Line(1 + self.bytes[..pos].iter().filter(|b| **b == b'\n').count() as u64)
    }

    fn ended(&self, within: &str) -> Fault {
        Fault::new(self.at(), format!("the file ends within {within}"), TRUNCATED)
    }

    /// A fault about what comes next.
    pub(super) fn unexpected(&mut self, wanted: &str) -> Fault {
        match self.peek() {
            None => self.ended(wanted),
            Some(_) => {
                let next = self.bytes[self.pos..].iter().take(20).copied().collect::<Vec<u8>>();
                let next = String::from_utf8_lossy(&next).escape_default().to_string();
                Fault::new(self.at(), format!("`{next}` in place of {wanted}"), BROKEN)
            }
        }
    }

    /// The next byte that is neither blank nor comment.
    pub(super) fn peek(&mut self) -> Option<u8> {
        loop {
            let rest = &self.bytes[self.pos..];
            let blank = rest.iter().take_while(|b| b.is_ascii_whitespace()).count();
            let rest = &rest[blank..];
            self.pos += blank;
            let comment = if rest.starts_with(b"//") {
                rest.iter().position(|b| *b == b'\n').unwrap_or(rest.len())
            } else if rest.starts_with(b"/*") {
                rest.windows(2).position(|w| w == b"*/").map_or(rest.len(), |p| p + 2)
            } else {
                return rest.first().copied();
            };
            self.pos += comment;
        }
    }

    pub(super) fn expect(&mut self, what: u8) -> Result<(), Fault> {
        if self.peek() != Some(what) {
            return Err(self.unexpected(&format!("`{}`", what as char)));
        }
        self.pos += 1;
        Ok(())
    }

    /// The next word, text in quotes or punctuation; `None` at the end.
    pub(super) fn word(&mut self) -> Option<String> {
        let first = self.peek()?;
        let rest = &self.bytes[self.pos..];
        let (from, to, after) = if first == b'"' {
            let end = rest[1..].iter().position(|b| *b == b'"').map_or(rest.len(), |e| e + 1);
            (1, end, (end + 1).min(rest.len()))
        } else if is_punctuation(first) {
            (0, 1, 1)
        } else {
            let end = rest.iter().position(|b| b.is_ascii_whitespace() || is_punctuation(*b));
            let end = end.unwrap_or(rest.len());
            (0, end, end)
        };
        let word = String::from_utf8_lossy(&rest[from.min(to)..to]).into_owned();
        self.pos += after;
        Some(word)
    }

    /// Skips what follows a key: a dictionary, or values up to a semicolon.
    pub(super) fn skip_value(&mut self) -> Result<(), Fault> {
        let mut depth = 0usize;
        loop {
            let word = self.word().ok_or_else(|| self.ended("an entry"))?;
            match word.as_str() {
                "{" | "(" => depth += 1,
                "}" | ")" => {
                    let Some(outer) = depth.checked_sub(1) else {
                        return Err(Fault::new(
                            self.at(),
                            format!("an unexpected `{word}`"),
                            BROKEN,
                        ));
                    };
                    depth = outer;
                    if depth == 0 && word == "}" {
                        return Ok(());
                    }
                }
                ";" if depth == 0 => return Ok(()),
                _ => {}
            }
        }
    }

    /// Goes behind the first of these keys at the top level; false if there is none.
    pub(super) fn find_entry(&mut self, keys: &[&str]) -> Result<bool, Fault> {
        while let Some(key) = self.word() {
            if keys.contains(&key.as_str()) {
                return Ok(true);
            }
            if key.starts_with('#') {
                // A directive takes the rest of its line.
                let rest = &self.bytes[self.pos..];
                self.pos += rest.iter().position(|b| *b == b'\n').unwrap_or(rest.len());
            } else {
                self.skip_value()?;
            }
        }
        Ok(false)
    }

    /// The next word as a number.
    pub(super) fn number<T: std::str::FromStr>(&mut self, what: &str) -> Result<T, Fault> {
        self.peek();
        let rest = &self.bytes[self.pos..];
        let end = rest.iter().position(|b| b.is_ascii_whitespace() || is_punctuation(*b));
        let end = end.unwrap_or(rest.len());
        match std::str::from_utf8(&rest[..end]).ok().and_then(|w| w.parse().ok()) {
            Some(n) => {
                self.pos += end;
                Ok(n)
            }
            None => Err(self.unexpected(what)),
        }
    }

    /// The length of a list, if one is written; whether a parenthesis follows is not checked.
    fn length(&mut self) -> Result<Option<u64>, Fault> {
        match self.peek() {
            Some(b'(') => Ok(None),
            _ => self.number("the length of a list").map(Some),
        }
    }

    /// The bytes of a binary list of `count` items, within its parentheses.
    fn raw(&mut self, count: u64, each: usize) -> Result<&[u8], Fault> {
        self.expect(b'(')?;
        let at = self.at();
        let n = fits(count, each, self.bytes.len() - self.pos, at, "values")? * each;
        let start = self.pos;
        self.pos += n;
        if self.bytes.get(self.pos) != Some(&b')') {
            let what = format!(
                "no `)` after {count} values of {each} bytes (label {}, scalar {} bytes)",
                self.label_bytes, self.scalar_bytes
            );
            return Err(Fault::new(self.at(), what, BROKEN));
        }
        self.pos += 1;
        Ok(&self.bytes[start..start + n])
    }

    /// A list of labels.
    pub(super) fn labels(&mut self) -> Result<Vec<i64>, Fault> {
        let length = self.length()?;
        if length == Some(0) && self.peek() != Some(b'(') {
            return Ok(Vec::new());
        }
        if let Some(count) = length
            && self.binary
        {
            let (each, endian) = (self.label_bytes, self.endian);
            let bytes = self.raw(count, each)?;
            let kind = if each == 4 { ScalarType::I32 } else { ScalarType::I64 };
            return Ok(match Values::from_bytes(kind, bytes, endian) {
                Values::I32(v) => v.into_iter().map(i64::from).collect(),
                Values::I64(v) => v,
                _ => Vec::new(),
            });
        }
        self.items(length, |file| file.number("a label"))
    }

    /// The items of a list in text, within its parentheses.
    pub(super) fn items<T>(
        &mut self,
        length: Option<u64>,
        mut item: impl FnMut(&mut Self) -> Result<T, Fault>,
    ) -> Result<Vec<T>, Fault> {
        self.expect(b'(')?;
        // An item takes a digit and a separator.
        let room = self.bytes.len() - self.pos + 1;
        if let Some(n) = length.filter(|n| n.saturating_mul(2) > room as u64) {
            // Only for the message: all lines before are counted for the place, and every face of a
            // mesh is a list.
            fits(n, 2, room, self.at(), "items")?;
        }
        let mut items = Vec::new();
        while self.peek() != Some(b')') {
            items.push(item(self)?);
        }
        self.pos += 1;
        match length {
            Some(n) if n != items.len() as u64 => {
                let what = format!("{} items in a list of {n}", items.len());
                Err(Fault::new(self.at(), what, BROKEN))
            }
            _ => Ok(items),
        }
    }

    /// A list of lists of labels: the faces of a mesh.
    pub(super) fn faces(&mut self) -> Result<Vec<Vec<i64>>, Fault> {
        if self.binary && self.class == "faceCompactList" {
            let starts = self.labels()?;
            let ids = self.labels()?;
            let face = |w: &[i64]| {
                let [from, to] = [w[0], w[1]].map(|i| usize::try_from(i).ok());
                from.zip(to).and_then(|(from, to)| Some(ids.get(from..to)?.to_vec())).ok_or_else(
                    || {
                        let what =
                            format!("a face from {} to {} of {} labels", w[0], w[1], ids.len());
                        Fault::field("the starts of the faces", what)
                    },
                )
            };
            return starts.windows(2).map(face).collect();
        }
        let length = self.length()?;
        self.items(length, Self::labels)
    }

    /// A list of `expected` tuples of `components` numbers.
    pub(super) fn tuples(
        &mut self,
        components: usize,
        expected: Option<usize>,
    ) -> Result<Values, Fault> {
        let length = self.length()?;
        if let (Some(n), Some(e)) = (length, expected)
            && n != e as u64
        {
            let what = format!("{n} values for {e} cells");
            let cure = "the field is of another mesh: use the time at which the mesh was written";
            return Err(Fault::new(self.at(), what, cure));
        }
        if length == Some(0) && self.peek() != Some(b'(') {
            return Ok(Values::F64(Vec::new()));
        }
        if self.peek() == Some(b'{') {
            let Some(n) = expected.filter(|_| length.is_some()) else {
                return Err(self.unexpected("a list with a value for each"));
            };
            self.pos += 1;
            let value = self.tuple(components)?;
            self.expect(b'}')?;
            return Ok(Values::F64(value.repeat(n)));
        }
        if let Some(count) = length
            && self.binary
        {
            let (each, endian) = (self.scalar_bytes, self.endian);
            let bytes = self.raw(count, each * components)?;
            let kind = if each == 4 { ScalarType::F32 } else { ScalarType::F64 };
            return Ok(Values::from_bytes(kind, bytes, endian));
        }
        let mut values = Vec::new();
        let read = self.items(length, |file| file.push_tuple(components, &mut values))?;
        match expected {
            Some(e) if e != read.len() => {
                let what = format!("{} values for {e} cells", read.len());
                Err(Fault::new(self.at(), what, BROKEN))
            }
            _ => Ok(Values::F64(values)),
        }
    }

    /// A number, or several in parentheses.
    pub(super) fn tuple(&mut self, components: usize) -> Result<Vec<f64>, Fault> {
        let mut out = Vec::with_capacity(components);
        self.push_tuple(components, &mut out)?;
        Ok(out)
    }

    fn push_tuple(&mut self, components: usize, out: &mut Vec<f64>) -> Result<(), Fault> {
        if components == 1 {
            out.push(self.number("a number")?);
            return Ok(());
        }
        self.expect(b'(')?;
        for _ in 0..components {
            out.push(self.number("a number")?);
        }
        self.expect(b')')
    }

    /// Goes to the start of a list whose length stands before it, and returns the length.
    pub(super) fn list_of_entries(&mut self) -> Result<Option<u64>, Fault> {
        self.length()
    }
}

fn is_punctuation(b: u8) -> bool {
    b"(){};[]\"".contains(&b)
}
