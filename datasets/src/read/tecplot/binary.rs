//! Binary files of Tecplot (`.plt`), versions 75 and 101 to 112, in both byte orders.
//!
//! Sources: Tecplot 360 Data Format Guide, appendix "Binary data file format" (versions 102, 107,
//! 108 and 112), and the comment of the same kind on version 75.

use super::binary_header::{Header, ZONE, header};
use super::binary_input::Input;
use super::shapes::Element;
use super::zone::{Shape, Zone, ZoneHeader, cells_along};
use super::{FORMAT_CURE, File};
use crate::model::{Endian, ScalarType, Values};
use crate::read::error::{At, BROKEN, Cursor, Fault};
use std::rc::Rc;

/// How every binary file begins; the version follows.
pub(super) const MAGIC: &[u8] = b"#!TDV";

/// Reads the zones of a file.
pub(super) fn read(bytes: &[u8]) -> Result<File, Fault> {
    let version = std::str::from_utf8(bytes.get(MAGIC.len()..8).unwrap_or_default())
        .ok()
        .and_then(|v| v.trim_end_matches(['\0', ' ']).parse::<u32>().ok());
    let version = match version {
        Some(v @ (75 | 101..=112)) => v,
        _ => {
            let shown = String::from_utf8_lossy(&bytes[..bytes.len().min(8)]).into_owned();
            let cure = "versions 75 and 101 to 112 are read; save it as one of them, or as text";
            return Err(Fault::unsupported(At::Byte(0), format!("version `{shown}`"), cure));
        }
    };
    let order = bytes.get(8..12).unwrap_or_default();
    let endian = match order {
        [1, 0, 0, 0] => Endian::Little,
        [0, 0, 0, 1] => Endian::Big,
        _ => {
            let what = format!("the byte order is {order:?}, and should be 1");
            return Err(Fault::new(At::Byte(8), what, FORMAT_CURE));
        }
    };
    let input = |pos| Input { cursor: Cursor { data: bytes, pos }, endian, version };
    let mut source = input(12);
    // Up to version 111 a word tells the packing. Some programs write it in version 112 too.
    let mut file = match header(&mut source, version < 112) {
        Err(fault) if version == 112 => {
            source = input(12);
            header(&mut source, true).map_err(|_| fault)?
        }
        other => other?,
    };
    let headers = std::mem::take(&mut file.headers);
    for h in headers {
        let zone = zone(&mut source, h, &file.file.zones)?;
        file.file.zones.push(zone);
    }
    if source.cursor.remaining() > 0 {
        let left = source.cursor.remaining();
        file.file.warnings.push(format!("{left} bytes after the last zone are left out"));
    }
    Ok(file.file)
}

/// The type of values with this number.
fn scalar_type(number: i32) -> Option<ScalarType> {
    Some(match number {
        1 => ScalarType::F32,
        2 => ScalarType::F64,
        3 => ScalarType::I32,
        4 => ScalarType::I16,
        5 => ScalarType::U8,
        _ => return None,
    })
}

fn zone(input: &mut Input<'_>, header: Header, earlier: &[Zone]) -> Result<Zone, Fault> {
    let Header { zone: mut h, raw_neighbours, connections } = header;
    let at = input.cursor.at();
    let marker = input.f32("the data of a zone")?;
    if marker != ZONE {
        let what = format!("the data of zone `{}` begin with {marker}, not with 299", h.title);
        return Err(Fault::new(at, what, BROKEN));
    }
    let variables = h.passive.len() as u64;
    if input.version == 75 {
        let repeated = input.count("the number of repeated variables")?;
        for v in input.list(repeated, "repeated variables")? {
            let Some(v) = usize::try_from(v - 1).ok().filter(|v| *v < h.passive.len()) else {
                return Err(input.fault(format!("variable {v} is repeated")));
            };
            h.shared[v] = earlier.len().checked_sub(1);
        }
    }
    let formats = input.list(variables, "formats of variables")?;
    if input.version >= 103 && input.i32("passive variables")? != 0 {
        let passive = input.list(variables, "passive variables")?;
        h.passive = passive.iter().map(|p| *p != 0).collect();
    }
    if input.version != 75 {
        if input.i32("shared variables")? != 0 {
            let shared = input.list(variables, "shared variables")?;
            h.shared = shared.iter().map(|z| usize::try_from(*z).ok()).collect();
        }
        h.cells_from = usize::try_from(input.i32("the zone with the elements")?).ok();
    }
    let own = h.own();
    if input.version >= 103 {
        input.cursor.take(own.len() as u64, 16, "ranges of variables")?;
    }
    let mut types = Vec::new();
    for &v in &own {
        let Some(kind) = scalar_type(formats[v]) else {
            let what =
                format!("variable {} of zone `{}` has format {}", v + 1, h.title, formats[v]);
            let cure = "save it with values of 1, 2, 4 or 8 bytes";
            return Err(Fault::unsupported(input.cursor.at(), what, cure));
        };
        types.push(kind);
    }
    let mut zone = Zone { values: vec![None; h.passive.len()], elements: None, header: h };
    let h = &zone.header;
    if h.by_point {
        by_point(input, h, &own, &types, &mut zone.values)?;
    } else {
        for (&v, &kind) in own.iter().zip(&types) {
            zone.values[v] = Some(Rc::new(block(input, h, v, kind)?));
        }
    }
    connectivity(input, &mut zone, earlier, raw_neighbours, connections)?;
    zone.share(earlier)?;
    Ok(zone)
}

/// The values of one variable. Cells of ordered zones are stored as if there were as many along I
/// and J as points; from version 104 on, not along the last axis.
fn block(
    input: &mut Input<'_>,
    h: &ZoneHeader,
    variable: usize,
    kind: ScalarType,
) -> Result<Values, Fault> {
    let what = format!("values of variable {} in zone `{}`", variable + 1, h.title);
    let Shape::Ordered(d) = h.shape else {
        let bytes = input.cursor.take(h.count(variable)?, kind.size(), &what)?;
        return Ok(Values::from_bytes(kind, bytes, input.endian));
    };
    let mut stored = d;
    if h.cell_centred[variable] && input.version >= 104 {
        let last = (0..3).rev().find(|&a| d[a] > 1).unwrap_or(0);
        stored[last] = cells_along(d[last]);
    }
    let count = Shape::Ordered(stored).points().unwrap_or(u64::MAX);
    let bytes = input.cursor.take(count, kind.size(), &what)?;
    let values = Values::from_bytes(kind, bytes, input.endian);
    if !h.cell_centred[variable] {
        return Ok(values);
    }
    // The bytes are there, so the sizes fit.
    let [nx, ny, _] = stored.map(|n| n as usize);
    let [cx, cy, cz] = d.map(|n| cells_along(n) as usize);
    let rows = (0..cz).flat_map(|k| (0..cy).map(move |j| nx * (j + ny * k)));
    Ok(values.gathered(rows.flat_map(|row| row..row + cx)))
}

fn by_point(
    input: &mut Input<'_>,
    h: &ZoneHeader,
    own: &[usize],
    types: &[ScalarType],
    values: &mut [Option<Rc<Values>>],
) -> Result<(), Fault> {
    if let Some(v) = own.iter().find(|&&v| h.cell_centred[v]) {
        return Err(h.fault(format!("variable {} is one of cells, in point packing", v + 1)));
    }
    let record: usize = types.iter().map(|t| t.size()).sum();
    let points = h.shape.points().unwrap_or(u64::MAX);
    let bytes = input.cursor.take(points, record, &format!("points of zone `{}`", h.title))?;
    let mut start = 0;
    for (&v, &kind) in own.iter().zip(types) {
        let parts = bytes.chunks_exact(record.max(1)).map(|r| &r[start..start + kind.size()]);
        let column: Vec<u8> = parts.flatten().copied().collect();
        values[v] = Some(Rc::new(Values::from_bytes(kind, &column, input.endian)));
        start += kind.size();
    }
    Ok(())
}

/// The elements of a zone; what it says about neighbours is skipped.
fn connectivity(
    input: &mut Input<'_>,
    zone: &mut Zone,
    earlier: &[Zone],
    raw_neighbours: bool,
    connections: Option<(i32, u64)>,
) -> Result<(), Fault> {
    let h = &mut zone.header;
    if let Shape::Elements { kind, points, elements } = h.shape {
        if input.version == 75 && input.i32("repeated elements")? != 0 {
            h.cells_from = Some(earlier.len().saturating_sub(1));
        }
        if h.cells_from.is_none() {
            let count = elements.saturating_mul(kind.corners() as u64);
            let ids = input.list(count, &format!("corners of elements in zone `{}`", h.title))?;
            let first = i32::from(input.version == 75);
            let mut out = Vec::with_capacity(ids.len());
            for (i, id) in ids.into_iter().enumerate() {
                let index = id.checked_sub(first).and_then(|i| u32::try_from(i).ok());
                let Some(index) = index.filter(|i| u64::from(*i) < points) else {
                    let element = i / kind.corners();
                    let what = format!("element {element} has point {id}, of {points}");
                    return Err(h.fault(what));
                };
                out.push(index);
            }
            zone.elements = Some(Rc::new(out));
            if raw_neighbours {
                input.cursor.take(elements, 4 * faces(kind), "neighbours of elements")?;
            }
        }
    }
    if let (Some((mode, count)), None) = (connections, zone.header.cells_from) {
        skip_connections(input, mode, count)?;
    }
    Ok(())
}

fn faces(kind: Element) -> usize {
    match kind {
        Element::Line => 2,
        Element::Triangle => 3,
        Element::Quad | Element::Tetra => 4,
        Element::Brick => 6,
    }
}

/// Skips connections of faces. Modes: local one to one (3 numbers), local one to many (4 and one
/// for each neighbour), global one to one (4), global one to many (4 and two for each neighbour).
fn skip_connections(input: &mut Input<'_>, mode: i32, count: u64) -> Result<(), Fault> {
    let per_neighbour = match mode {
        0 => return input.cursor.take(count, 12, "connections of faces").map(|_| ()),
        2 => return input.cursor.take(count, 16, "connections of faces").map(|_| ()),
        1 => 1,
        3 => 2,
        _ => return Err(input.fault(format!("connections of faces with mode {mode}"))),
    };
    for _ in 0..count {
        let head = input.list(4, "connections of faces")?;
        let neighbours = u64::try_from(head[3]).unwrap_or(u64::MAX);
        let numbers = neighbours.saturating_mul(per_neighbour);
        input.cursor.take(numbers, 4, "connections of faces")?;
    }
    Ok(())
}
