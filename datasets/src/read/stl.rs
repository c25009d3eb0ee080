//! STL triangle files, text and binary. Corners at the same position (bit for bit) become one
//! point.
//!
//! The format repeats every corner for each triangle. Without welding, no normal could be smooth
//! and no edge shared.

use super::error::{At, BROKEN, Cursor, Fault, TRUNCATED, read_bytes};
use super::{Content, LoadedFile, ReadError};
use crate::model::{Cells, DataArray, Dataset, Points, PolyData, Values};
use std::collections::HashMap;
use std::path::Path;

pub(crate) const FORMAT: &str = "STL";

/// Header, count, then 50 bytes per triangle.
pub(super) const HEADER_BYTES: usize = 80;
pub(super) const TRIANGLE_BYTES: usize = 50;

/// Reads a `.stl` file.
pub fn read(path: &Path) -> Result<LoadedFile, ReadError> {
    read_from_bytes(path, &read_bytes(path)?)
}

/// Reads the content of a `.stl` file; `path` is used in messages only.
pub fn read_from_bytes(path: &Path, bytes: &[u8]) -> Result<LoadedFile, ReadError> {
    let mut warnings = Vec::new();
    // Binary files may begin with `solid` too, so the size decides.
    let text = bytes.trim_ascii_start().starts_with(b"solid") && !has_binary_size(bytes);
    let data = if text { text_triangles(bytes) } else { binary_triangles(bytes, &mut warnings) };
    let data = data.map_err(|f| f.in_file(path, FORMAT))?;
    Ok(LoadedFile {
        format: FORMAT,
        content: Content::Data(Dataset::PolyData(data)),
        warnings,
        time_steps: Vec::new(),
    })
}

fn declared_triangles(bytes: &[u8]) -> Option<u64> {
    let b = bytes.get(HEADER_BYTES..HEADER_BYTES + 4)?;
    Some(u64::from(u32::from_le_bytes(b.try_into().ok()?)))
}

/// True if the length matches that of a binary file with its number of triangles.
pub(crate) fn has_binary_size(bytes: &[u8]) -> bool {
    let expected = |n: u64| n * TRIANGLE_BYTES as u64 + HEADER_BYTES as u64 + 4;
    declared_triangles(bytes).is_some_and(|n| expected(n) == bytes.len() as u64)
}

#[derive(Default)]
struct Welder {
    points: Vec<[f32; 3]>,
    index: HashMap<[u32; 3], u32>,
}

impl Welder {
    fn id(&mut self, p: [f32; 3]) -> u32 {
        // -0 and 0 are the same coordinate.
        let key = p.map(|x| if x == 0.0 { 0 } else { x.to_bits() });
        *self.index.entry(key).or_insert_with(|| {
            self.points.push(p);
            self.points.len() as u32 - 1
        })
    }
}

fn binary_triangles(bytes: &[u8], warnings: &mut Vec<String>) -> Result<PolyData, Fault> {
    let Some(n) = declared_triangles(bytes) else {
        let what =
            format!("{} bytes are too few for the header of {}", bytes.len(), HEADER_BYTES + 4);
        return Err(Fault::new(At::Byte(0), what, TRUNCATED));
    };
    let mut cursor = Cursor { data: bytes, pos: HEADER_BYTES + 4 };
    let body = cursor.take(n, TRIANGLE_BYTES, "triangles")?;
    if cursor.remaining() > 0 {
        warnings.push(format!("{} bytes after the last triangle ignored", cursor.remaining()));
    }
    let mut welder = Welder::default();
    let mut ids = Vec::with_capacity(n as usize * 3);
    let mut tags = Vec::with_capacity(n as usize);
    for record in body.as_chunks::<TRIANGLE_BYTES>().0 {
        let real =
            |i: usize| f32::from_le_bytes([record[i], record[i + 1], record[i + 2], record[i + 3]]);
        // The normal comes first; it is ignored, because it follows from the corners.
        for corner in 0..3 {
            let at = 12 + 12 * corner;
            ids.push(welder.id([real(at), real(at + 4), real(at + 8)]));
        }
        tags.push(u16::from_le_bytes([record[48], record[49]]));
    }
    let mut d = PolyData {
        points: Points::F32(welder.points),
        polys: Cells::uniform(3, ids),
        ..Default::default()
    };
    if tags.iter().any(|&t| t != 0) {
        d.attributes.cell.push(DataArray::new("attribute", 1, Values::U16(tags)));
    }
    Ok(d)
}

fn text_triangles(bytes: &[u8]) -> Result<PolyData, Fault> {
    let mut cursor = Cursor::new(bytes);
    let mut welder = Welder::default();
    let mut polys = Cells::new();
    let mut corners: Vec<u32> = Vec::new();
    let mut line_number = 0;
    while let Some(line) = cursor.line() {
        line_number += 1;
        let at = At::Line(line_number);
        let mut words = line.split_ascii_whitespace();
        match words.next().map(str::to_ascii_lowercase).as_deref() {
            Some("vertex") => {
                let p: Vec<f32> = words.by_ref().take(3).filter_map(|w| w.parse().ok()).collect();
                let Ok(p) = <[f32; 3]>::try_from(p) else {
                    return Err(Fault::new(at, "a vertex needs three numbers", BROKEN));
                };
                corners.push(welder.id(p));
            }
            Some("endloop") => {
                if corners.len() < 3 {
                    return Err(Fault::new(
                        at,
                        format!("a loop of {} corners", corners.len()),
                        BROKEN,
                    ));
                }
                polys.push(corners.drain(..));
            }
            Some("solid" | "facet" | "outer" | "endfacet" | "endsolid") | None => {}
            Some(other) => {
                let shown: String = other.chars().take(40).collect();
                return Err(Fault::new(at, format!("unknown word `{shown}`"), BROKEN));
            }
        }
    }
    if !corners.is_empty() {
        return Err(Fault::new(
            At::Line(line_number),
            "the file ends inside a triangle",
            TRUNCATED,
        ));
    }
    Ok(PolyData { points: Points::F32(welder.points), polys, ..Default::default() })
}
