//! PLY polygon files ("Stanford triangle format"), text and binary of either byte order, with all
//! vertex properties.
//!
//! Source: Greg Turk's description of the format (1994).

use super::error::{At, BROKEN, Cursor, Fault, TRUNCATED, fits, read_bytes};
use super::{Content, LoadedFile, ReadError};
use crate::model::{Cells, DataArray, Dataset, Endian, Points, PolyData, ScalarType, Values};
use std::path::Path;

pub(crate) const FORMAT: &str = "PLY";

/// Reads a `.ply` file.
pub fn read(path: &Path) -> Result<LoadedFile, ReadError> {
    read_from_bytes(path, &read_bytes(path)?)
}

/// Reads the content of a `.ply` file; `path` is used in messages only.
pub fn read_from_bytes(path: &Path, bytes: &[u8]) -> Result<LoadedFile, ReadError> {
    let mut warnings = Vec::new();
    let data = parse(bytes, &mut warnings).map_err(|f| f.in_file(path, FORMAT))?;
    Ok(LoadedFile {
        format: FORMAT,
        content: Content::Data(Dataset::PolyData(data)),
        warnings,
        time_steps: Vec::new(),
    })
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Encoding {
    Text,
    Binary(Endian),
}

#[derive(Debug, Clone)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: ScalarType,
    /// For lists: the type of the length.
    pub(super) list: Option<ScalarType>,
}

#[derive(Debug, Clone)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

/// The columns of an element. A column holds one value per row; for lists, it holds all entries and
/// the end of each row.
pub(super) struct Columns {
    plain: Vec<Values>,
    lists: Vec<(Values, Vec<usize>)>,
}

fn parse(bytes: &[u8], warnings: &mut Vec<String>) -> Result<PolyData, Fault> {
    let mut cursor = Cursor::new(bytes);
    let (encoding, elements) = header(&mut cursor)?;
    let mut out = PolyData::default();
    for element in &elements {
        let columns = rows(&mut cursor, element, encoding)?;
        match element.name.as_str() {
            "vertex" => vertices(element, columns, &mut out)?,
            "face" | "tristrips" => faces(element, columns, &mut out, warnings)?,
            other => {
                warnings.push(format!("element `{other}` ({} entries) left out", element.count))
            }
        }
    }
    let n = out.points.len();
    let bad = out
        .polys
        .connectivity()
        .iter()
        .chain(out.strips.connectivity())
        .filter(|&&k| k as usize >= n)
        .count();
    if bad > 0 {
        warnings.push(format!("{bad} point ids do not exist; their faces will be left out"));
    }
    Dataset::check(&Dataset::PolyData(out.clone()))?;
    Ok(out)
}

pub(super) fn header(cursor: &mut Cursor<'_>) -> Result<(Encoding, Vec<Element>), Fault> {
    let mut number = 0;
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    loop {
        number += 1;
        let at = At::Line(number);
        let Some(line) = cursor.line() else {
            return Err(Fault::new(at, "the header has no `end_header`", TRUNCATED));
        };
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match (number, words.as_slice()) {
            (1, ["ply"]) => {}
            (1, _) => {
                return Err(Fault::new(
                    at,
                    "the first line is not `ply`",
                    "this is another kind of file",
                ));
            }
            (_, ["format", "ascii", _]) => encoding = Some(Encoding::Text),
            (_, ["format", "binary_little_endian", _]) => {
                encoding = Some(Encoding::Binary(Endian::Little))
            }
            (_, ["format", "binary_big_endian", _]) => {
                encoding = Some(Encoding::Binary(Endian::Big))
            }
            (_, [] | ["comment", ..] | ["obj_info", ..]) => {}
            (_, ["element", name, count]) => {
                let count = count
                    .parse()
                    .map_err(|_| Fault::new(at, format!("`{count}` is not a count"), BROKEN))?;
                elements.push(Element { name: name.to_string(), count, properties: Vec::new() });
            }
            (_, ["property", rest @ ..]) => {
                let (list, kind, name) = match rest {
                    ["list", length, kind, name] => {
                        (Some(scalar_type(length)), scalar_type(kind), name)
                    }
                    [kind, name] => (None, scalar_type(kind), name),
                    _ => return Err(Fault::new(at, "a property needs a type and a name", BROKEN)),
                };
                let unknown = || {
                    Fault::new(At::Line(number), "unknown type of a property", "use char to double")
                };
                let list = list.map(|l| l.ok_or_else(unknown)).transpose()?;
                let property =
                    Property { name: name.to_string(), kind: kind.ok_or_else(unknown)?, list };
                let Some(element) = elements.last_mut() else {
                    return Err(Fault::new(at, "a property before the first element", BROKEN));
                };
                element.properties.push(property);
            }
            (_, ["end_header"]) => break,
            (_, [other, ..]) => {
                let shown: String = other.chars().take(40).collect();
                return Err(Fault::new(at, format!("unknown word `{shown}`"), BROKEN));
            }
        }
    }
    match encoding {
        Some(e) => Ok((e, elements)),
        None => {
            Err(Fault::new(At::Field("the header".into()), "there is no `format` line", BROKEN))
        }
    }
}

/// Reads all rows of an element.
pub(super) fn rows(
    cursor: &mut Cursor<'_>,
    element: &Element,
    encoding: Encoding,
) -> Result<Columns, Fault> {
    // The minimum size of a row: in binary its numbers, in text a digit and a separator each.
    let least: usize = element
        .properties
        .iter()
        .map(|p| if encoding == Encoding::Text { 2 } else { p.list.unwrap_or(p.kind).size() })
        .sum();
    if least == 0 {
        return Ok(Columns { plain: Vec::new(), lists: Vec::new() });
    }
    let at = cursor.at();
    let rows = fits(
        element.count,
        least,
        cursor.remaining() + 1,
        at,
        &format!("rows of `{}`", element.name),
    )?;
    let mut columns = Columns { plain: Vec::new(), lists: Vec::new() };
    let mut plain: Vec<(ScalarType, Vec<u8>)> = Vec::new();
    let mut lists: Vec<(ScalarType, Vec<u8>, Vec<usize>)> = Vec::new();
    let mut slots: Vec<(usize, bool)> = Vec::new();
    for p in &element.properties {
        if p.list.is_some() {
            slots.push((lists.len(), true));
            lists.push((p.kind, Vec::new(), Vec::new()));
        } else {
            slots.push((plain.len(), false));
            plain.push((p.kind, Vec::new()));
        }
    }
    // One value as bytes, least significant first.
    let value = |cursor: &mut Cursor<'_>,
                 kind: ScalarType,
                 what: &str,
                 out: &mut Vec<u8>|
     -> Result<(), Fault> {
        match encoding {
            Encoding::Text => out.extend(cursor.numbers(kind, 1, what)?.to_le_bytes()),
            Encoding::Binary(endian) => {
                let start = out.len();
                out.extend_from_slice(cursor.take(1, kind.size(), what)?);
                if endian == Endian::Big {
                    out[start..].reverse();
                }
            }
        }
        Ok(())
    };
    let mut scratch = Vec::new();
    for _ in 0..rows {
        for (p, &(slot, is_list)) in element.properties.iter().zip(&slots) {
            if !is_list {
                value(cursor, p.kind, &p.name, &mut plain[slot].1)?;
                continue;
            }
            scratch.clear();
            let length_kind = p.list.unwrap_or(ScalarType::U8);
            let at = cursor.at();
            value(cursor, length_kind, "length of a list", &mut scratch)?;
            let length = Values::from_bytes(length_kind, &scratch, Endian::Little).get_f64(0);
            if !(length >= 0.0 && length.fract() == 0.0) {
                return Err(Fault::new(at, format!("the length of a list is {length}"), BROKEN));
            }
            let each = if encoding == Encoding::Text { 2 } else { p.kind.size() };
            let length =
                fits(length as u64, each, cursor.remaining() + 1, at, "entries of a list")?;
            let (_, bytes, ends) = &mut lists[slot];
            for _ in 0..length {
                value(cursor, p.kind, &p.name, bytes)?;
            }
            ends.push(ends.last().copied().unwrap_or(0) + length);
        }
    }
    columns.plain.extend(plain.into_iter().map(|(k, b)| Values::from_bytes(k, &b, Endian::Little)));
    columns.lists.extend(
        lists.into_iter().map(|(k, b, ends)| (Values::from_bytes(k, &b, Endian::Little), ends)),
    );
    Ok(columns)
}

pub(super) fn vertices(
    element: &Element,
    columns: Columns,
    out: &mut PolyData,
) -> Result<(), Fault> {
    let names: Vec<&str> =
        element.properties.iter().filter(|p| p.list.is_none()).map(|p| p.name.as_str()).collect();
    let column = |name: &str| names.iter().position(|n| *n == name);
    let mut used = vec![false; names.len()];
    // Interleaves columns to one array; `None` if one is missing or (for colours) of another type.
    let mut joined = |title: &str, wanted: &[&str], bytes_only: bool| -> Option<DataArray> {
        let at: Vec<usize> = wanted.iter().map(|n| column(n)).collect::<Option<_>>()?;
        let first = columns.plain[at[0]].kind();
        if at.iter().any(|&i| columns.plain[i].kind() != first)
            || bytes_only && first != ScalarType::U8
        {
            return None;
        }
        let rows = columns.plain[at[0]].len();
        let mut bytes = Vec::with_capacity(rows * at.len() * first.size());
        let each: Vec<Vec<u8>> = at.iter().map(|&i| columns.plain[i].to_le_bytes()).collect();
        for r in 0..rows {
            each.iter().for_each(|b| {
                bytes.extend_from_slice(&b[r * first.size()..(r + 1) * first.size()])
            });
        }
        at.iter().for_each(|&i| used[i] = true);
        Some(DataArray::new(title, at.len(), Values::from_bytes(first, &bytes, Endian::Little)))
    };
    let Some(points) = joined("Points", &["x", "y", "z"], false) else {
        return Err(Fault::field("element `vertex`", "it has no properties x, y, z of one type"));
    };
    out.points = Points::from_array(points)?;
    let a = &mut out.attributes;
    if let Some(n) = joined("Normals", &["nx", "ny", "nz"], false) {
        a.point_normals = Some(n.name.clone());
        a.point.push(n);
    }
    let rgba = ["red", "green", "blue", "alpha"];
    if let Some(c) = joined("RGBA", &rgba, true).or_else(|| joined("RGB", &rgba[..3], true)) {
        a.point_scalars = Some(c.name.clone());
        a.point.push(c);
    }
    for pair in [["s", "t"], ["u", "v"], ["texture_u", "texture_v"]] {
        if a.point_texcoords.is_none()
            && let Some(t) = joined("TCoords", &pair, false)
        {
            a.point_texcoords = Some(t.name.clone());
            a.point.push(t);
        }
    }
    for (i, values) in columns.plain.into_iter().enumerate() {
        if !used[i] {
            a.point.push(DataArray::new(names[i], 1, values));
        }
    }
    Ok(())
}

pub(super) fn faces(
    element: &Element,
    columns: Columns,
    out: &mut PolyData,
    warnings: &mut Vec<String>,
) -> Result<(), Fault> {
    let lists: Vec<&Property> = element.properties.iter().filter(|p| p.list.is_some()).collect();
    let plain: Vec<&Property> = element.properties.iter().filter(|p| p.list.is_none()).collect();
    for (p, (values, ends)) in lists.iter().zip(columns.lists) {
        if !is_corners(&p.name) {
            warnings.push(format!("list `{}` of `{}` left out", p.name, element.name));
            continue;
        }
        let ids: Vec<i64> = (0..values.len()).map(|i| values.get_f64(i) as i64).collect();
        if element.name == "face" {
            let cells = Cells::from_ends(
                ends.iter().map(|&e| e as i64),
                ids.iter().map(|&k| Cells::id(k)).collect(),
            );
            out.polys = cells.map_err(|b| {
                Fault::field("element `face`", format!("face {} has no end", b.cell))
            })?;
        } else {
            // Strips are separated by -1.
            ids.split(|&k| k == -1)
                .filter(|s| !s.is_empty())
                .for_each(|s| out.strips.push(s.iter().map(|&k| Cells::id(k))));
        }
    }
    if element.name == "face" {
        for (p, values) in plain.iter().zip(columns.plain) {
            out.attributes.cell.push(DataArray::new(p.name.clone(), 1, values));
        }
    }
    Ok(())
}

/// Whether a list of this name has the vertices of faces.
pub(super) fn is_corners(name: &str) -> bool {
    ["vertex_indices", "vertex_index"].contains(&name)
}

fn scalar_type(name: &str) -> Option<ScalarType> {
    Some(match name {
        "char" | "int8" => ScalarType::I8,
        "uchar" | "uint8" => ScalarType::U8,
        "short" | "int16" => ScalarType::I16,
        "ushort" | "uint16" => ScalarType::U16,
        "int" | "int32" => ScalarType::I32,
        "uint" | "uint32" => ScalarType::U32,
        "float" | "float32" => ScalarType::F32,
        "double" | "float64" => ScalarType::F64,
        _ => return None,
    })
}
