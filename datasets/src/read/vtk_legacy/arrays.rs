//! Numbers, strings and attributes of legacy files.

use super::Section;
use crate::model::{Attributes, DataArray, Endian, ScalarType, Values};
use crate::read::error::{BROKEN, Cursor, Fault, fits};
use crate::read::percent::decoded;

/// A legacy file during parsing.
pub(super) struct Input<'a> {
    pub(super) cursor: Cursor<'a>,
    pub(super) binary: bool,
    /// Version 5: cells are stored as offsets and connectivity.
    pub(super) offsets_and_connectivity: bool,
}

impl<'a> Input<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Input { cursor: Cursor::new(bytes), binary: false, offsets_and_connectivity: false }
    }

    /// The next word as text.
    pub(super) fn text_word(&mut self) -> Option<String> {
        self.cursor.word().map(|w| String::from_utf8_lossy(w).into_owned())
    }

    /// The next word, without consuming it.
    pub(super) fn peek(&mut self) -> String {
        let at = self.cursor.pos;
        let word = self.text_word().unwrap_or_default();
        self.cursor.pos = at;
        word
    }

    fn need_word(&mut self, what: &str) -> Result<String, Fault> {
        let at = self.cursor.at();
        self.text_word()
            .ok_or_else(|| Fault::new(at, format!("the file ends before the {what}"), BROKEN))
    }

    /// The next word as a count.
    pub(super) fn count(&mut self, what: &str) -> Result<u64, Fault> {
        let at = self.cursor.at();
        let word = self.need_word(what)?;
        word.parse().map_err(|_| {
            let shown: String = word.chars().take(40).collect();
            Fault::new(at, format!("`{shown}` is not a {what}"), BROKEN)
        })
    }

    pub(super) fn type_word(&mut self) -> Result<String, Fault> {
        Ok(self.need_word("type")?.to_ascii_lowercase())
    }

    /// `N` numbers after a keyword.
    pub(super) fn numbers_in_line<T: std::str::FromStr, const N: usize>(
        &mut self,
        what: &str,
    ) -> Result<[T; N], Fault> {
        let at = self.cursor.at();
        let list: Option<Vec<T>> = (0..N).map(|_| self.text_word()?.parse().ok()).collect();
        let bad = || Fault::new(at, format!("{what} needs {N} numbers"), BROKEN);
        list.ok_or_else(bad)?.try_into().map_err(|_| Fault::field(what, "wrong number of numbers"))
    }

    /// Reads `count` values of the file's type `ty`; they start on the next line.
    pub(super) fn values(&mut self, ty: &str, count: u64, what: &str) -> Result<Values, Fault> {
        if ty == "bit" {
            return self.bits(count, what);
        }
        let Some(kind) = scalar_type(ty, self.binary) else {
            let shown: String = ty.chars().take(40).collect();
            return Err(Fault::unsupported(
                self.cursor.at(),
                format!("type `{shown}`"),
                "use one of VTK's number types",
            ));
        };
        if !self.binary {
            return self.cursor.numbers(kind, count, what);
        }
        self.end_of_line();
        let bytes = self.cursor.take(count, kind.size(), what)?;
        Ok(Values::from_bytes(kind, bytes, Endian::Big))
    }

    /// Reads bits, eight per byte in binary files, as bytes 0 and 1.
    fn bits(&mut self, count: u64, what: &str) -> Result<Values, Fault> {
        if !self.binary {
            return self.cursor.numbers(ScalarType::U8, count, what);
        }
        self.end_of_line();
        let bytes = self.cursor.take(count.div_ceil(8), 1, what)?;
        Ok(Values::U8((0..count as usize).map(|i| bytes[i / 8] >> (7 - i % 8) & 1).collect()))
    }

    /// Moves past the end of the current line, where binary data starts.
    pub(super) fn end_of_line(&mut self) {
        self.cursor.line();
    }

    /// A METADATA block ends at an empty line.
    pub(super) fn skip_metadata(&mut self) {
        self.end_of_line();
        while let Some(line) = self.cursor.line() {
            if line.trim().is_empty() {
                break;
            }
        }
    }

    /// Reads one attribute of the current section.
    pub(super) fn attribute(
        &mut self,
        keyword: &str,
        section: Section,
        out: &mut Attributes,
        warnings: &mut Vec<String>,
    ) -> Result<(), Fault> {
        let at = self.cursor.at();
        if keyword == "FIELD" {
            return self.field(section, out, warnings);
        }
        if keyword == "LOOKUP_TABLE" {
            // A lookup table: name and number of entries. The files' own colour maps are not used.
            let name = self.need_word("name of the lookup table")?;
            let n = self.count("size of the lookup table")?;
            let ty = if self.binary { "unsigned_char" } else { "float" };
            self.values(ty, n.saturating_mul(4), "lookup table entries")?;
            warnings.push(format!("lookup table `{name}` left out; choose a colour map instead"));
            return Ok(());
        }
        let n = match section {
            Section::Points(n) | Section::Cells(n) => n,
            Section::Geometry => {
                let shown: String = keyword.chars().take(40).collect();
                return Err(Fault::new(at, format!("unknown keyword `{shown}`"), BROKEN));
            }
        };
        let name = decoded(&self.need_word("name of the array")?);
        let (components, ty) = match keyword {
            "SCALARS" => {
                let ty = self.type_word()?;
                let mut components = 1;
                if !self.peek().eq_ignore_ascii_case("LOOKUP_TABLE")
                    && let Ok(c) = self.peek().parse::<u64>()
                    && self.rest_of_line_has_word()
                {
                    self.cursor.word();
                    components = c;
                }
                if self.peek().eq_ignore_ascii_case("LOOKUP_TABLE") {
                    self.cursor.word();
                    self.need_word("name of the lookup table")?;
                }
                (components, ty)
            }
            "COLOR_SCALARS" => {
                let components = self.count("number of colour components")?;
                if !self.binary {
                    // Text files store colours as fractions, binary files as bytes: convert both to
                    // bytes.
                    let total = n.saturating_mul(components);
                    let v = self.cursor.numbers(ScalarType::F32, total, "colours")?.to_f32();
                    let bytes = v.iter().map(|x| (x * 255.0).round() as u8).collect();
                    return push(
                        section,
                        out,
                        DataArray::new(name, components.max(1) as usize, Values::U8(bytes)),
                        keyword,
                    );
                }
                (components, "unsigned_char".into())
            }
            "VECTORS" | "NORMALS" => (3, self.type_word()?),
            "TEXTURE_COORDINATES" => {
                let components = self.count("number of texture coordinates")?;
                (components, self.type_word()?)
            }
            "TENSORS" => (9, self.type_word()?),
            "TENSORS6" => (6, self.type_word()?),
            "GLOBAL_IDS" | "PEDIGREE_IDS" | "EDGE_FLAGS" => (1, self.type_word()?),
            other => {
                let shown: String = other.chars().take(40).collect();
                return Err(Fault::new(at, format!("unknown keyword `{shown}`"), BROKEN));
            }
        };
        if components == 0 || components > 1 << 20 {
            return Err(Fault::new(
                at,
                format!("array `{name}` has {components} components"),
                BROKEN,
            ));
        }
        let values =
            self.values(&ty, n.saturating_mul(components), &format!("values of `{name}`"))?;
        push(section, out, DataArray::new(name, components as usize, values), keyword)
    }

    fn rest_of_line_has_word(&self) -> bool {
        let rest = &self.cursor.data[self.cursor.pos..];
        rest.iter().take_while(|&&b| b != b'\n').any(|b| !b.is_ascii_whitespace())
    }

    /// Any number of named arrays.
    fn field(
        &mut self,
        section: Section,
        out: &mut Attributes,
        warnings: &mut Vec<String>,
    ) -> Result<(), Fault> {
        self.need_word("name of the field")?;
        let arrays = self.count("number of arrays")?;
        // An array takes at least one line.
        let arrays = fits(arrays, 8, self.cursor.remaining() + 8, self.cursor.at(), "arrays")?;
        for _ in 0..arrays {
            while self.peek().eq_ignore_ascii_case("METADATA") {
                self.skip_metadata();
            }
            let name = decoded(&self.need_word("name of an array")?);
            if name == "NULL_ARRAY" {
                self.end_of_line();
                continue;
            }
            let components = self.count("number of components")?;
            let tuples = self.count("number of tuples")?;
            let ty = self.type_word()?;
            let total = components.saturating_mul(tuples);
            if matches!(ty.as_str(), "string" | "utf8_string" | "variant") {
                let texts = self.texts(total, ty == "variant")?;
                if section == Section::Geometry {
                    out.text.push((name, texts));
                } else {
                    warnings.push(format!("array `{name}` of texts left out"));
                }
                continue;
            }
            if components > 1 << 20 {
                return Err(Fault::field(
                    format!("array `{name}`"),
                    format!("{components} components"),
                ));
            }
            let values = self.values(&ty, total, &format!("values of `{name}`"))?;
            push(section, out, DataArray::new(name, components.max(1) as usize, values), "FIELD")?;
        }
        Ok(())
    }

    /// Strings: one per line and percent-encoded, or in binary files preceded by their length
    /// (vtkDataWriter.cxx: the two high bits of the first byte give the number of bytes of the
    /// length).
    fn texts(&mut self, count: u64, variants: bool) -> Result<Vec<String>, Fault> {
        if variants {
            let cure = "write the file again without variant arrays";
            return Err(Fault::unsupported(self.cursor.at(), "an array of variants", cure));
        }
        let count = fits(count, 1, self.cursor.remaining() + 1, self.cursor.at(), "texts")?;
        self.end_of_line();
        let mut texts = Vec::new();
        for _ in 0..count {
            if !self.binary {
                texts.push(decoded(self.cursor.line().unwrap_or_default().trim()));
                continue;
            }
            let first = self.cursor.data.get(self.cursor.pos).copied().unwrap_or(0);
            let bytes = [8, 4, 2, 1][usize::from(first >> 6)];
            let head = self.cursor.take(1, bytes, "length of a text")?;
            let len = head.iter().fold(0u64, |n, &b| n << 8 | u64::from(b))
                & (u64::MAX >> (64 - 8 * bytes + 2));
            let text = self.cursor.take(len, 1, "letters of a text")?;
            texts.push(String::from_utf8_lossy(text).into_owned());
        }
        Ok(texts)
    }
}

fn push(
    section: Section,
    out: &mut Attributes,
    array: DataArray,
    keyword: &str,
) -> Result<(), Fault> {
    let name = array.name.clone();
    match section {
        Section::Geometry => out.field.push(array),
        Section::Points(_) => {
            match keyword {
                "NORMALS" => out.point_normals = Some(name),
                "TEXTURE_COORDINATES" => out.point_texcoords = Some(name),
                "SCALARS" | "COLOR_SCALARS" => out.point_scalars = Some(name),
                _ => {}
            }
            out.point.push(array);
        }
        Section::Cells(_) => {
            match keyword {
                "NORMALS" => out.cell_normals = Some(name),
                "SCALARS" | "COLOR_SCALARS" => out.cell_scalars = Some(name),
                _ => {}
            }
            out.cell.push(array);
        }
    }
    Ok(())
}

/// The scalar type with the given name in legacy files. `vtkIdType` is written with 32 bits in
/// binary files.
fn scalar_type(name: &str, binary: bool) -> Option<ScalarType> {
    Some(match name {
        "char" | "signed_char" | "vtktypeint8" => ScalarType::I8,
        "unsigned_char" | "vtktypeuint8" => ScalarType::U8,
        "short" | "vtktypeint16" => ScalarType::I16,
        "unsigned_short" | "vtktypeuint16" => ScalarType::U16,
        "vtkidtype" if !binary => ScalarType::I64,
        "int" | "vtkidtype" | "vtktypeint32" => ScalarType::I32,
        "unsigned_int" | "vtktypeuint32" => ScalarType::U32,
        "long" | "long_long" | "vtktypeint64" => ScalarType::I64,
        "unsigned_long" | "unsigned_long_long" | "vtktypeuint64" => ScalarType::U64,
        "float" => ScalarType::F32,
        "double" => ScalarType::F64,
        _ => return None,
    })
}
