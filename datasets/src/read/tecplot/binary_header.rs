//! The header section of a binary Tecplot file: names, zones, and the records left out.

use super::File;
use super::binary_input::Input;
use super::shapes::Element;
use super::zone::{Shape, ZoneHeader};
use crate::read::error::{BROKEN, Fault};

pub(super) const ZONE: f32 = 299.0;
const GEOMETRY: f32 = 399.0;
const TEXT: f32 = 499.0;
const CUSTOM_LABELS: f32 = 599.0;
const USER_RECORD: f32 = 699.0;
const DATA_SET_AUX: f32 = 799.0;
const VARIABLE_AUX: f32 = 899.0;
const END_OF_HEADER: f32 = 357.0;

/// The header of a zone, with what follows its values.
pub(super) struct Header {
    pub(super) zone: ZoneHeader,
    /// Whether the neighbours of each element follow.
    pub(super) raw_neighbours: bool,
    /// Mode and number of the connections of faces that follow.
    pub(super) connections: Option<(i32, u64)>,
}

/// What the header section says; the file has no zones yet.
pub(super) struct Headers {
    pub(super) file: File,
    pub(super) headers: Vec<Header>,
}

/// Reads the header section. `packing`: zones have a word that tells the packing.
pub(super) fn header(input: &mut Input<'_>, packing: bool) -> Result<Headers, Fault> {
    let mut file = File::default();
    let mut headers: Vec<Header> = Vec::new();
    if input.version >= 111 {
        let at = input.cursor.at();
        match input.i32("the type of the file")? {
            0 | 1 => {}
            2 => return Err(super::solution_without_grid(at)),
            n => return Err(Fault::new(at, format!("the type of the file is {n}"), BROKEN)),
        }
    }
    file.title = input.text("the title")?;
    let variables = input.count("the number of variables")?;
    let count = super::super::error::fits(
        variables,
        4,
        input.cursor.remaining(),
        input.cursor.at(),
        "variables",
    )?;
    for _ in 0..count {
        file.variables.push(input.text("names of variables")?);
    }
    let mut left_out = Vec::new();
    loop {
        let at = input.cursor.at();
        let marker = input.f32("the next record")?;
        let name = if marker == ZONE {
            headers.push(zone(input, count, packing, headers.len())?);
            continue;
        } else if marker == END_OF_HEADER {
            break;
        } else if marker == GEOMETRY {
            geometry(input)?;
            "geometries"
        } else if marker == TEXT {
            text(input)?;
            "texts"
        } else if marker == CUSTOM_LABELS {
            let labels = input.count("the number of labels")?;
            for _ in 0..labels {
                input.text("labels")?;
            }
            "labels"
        } else if marker == USER_RECORD {
            input.text("a user record")?;
            "user records"
        } else if marker == DATA_SET_AUX || marker == VARIABLE_AUX {
            if marker == VARIABLE_AUX {
                input.i32("the variable of auxiliary data")?;
            }
            auxiliary(input)?;
            "auxiliary data"
        } else {
            return Err(Fault::new(at, format!("a record with the marker {marker}"), BROKEN));
        };
        if !left_out.contains(&name) {
            left_out.push(name);
        }
    }
    if !left_out.is_empty() {
        file.warnings.push(format!("left out: {}", left_out.join(", ")));
    }
    Ok(Headers { file, headers })
}

fn auxiliary(input: &mut Input<'_>) -> Result<(), Fault> {
    input.text("the name of auxiliary data")?;
    input.i32("the type of auxiliary data")?;
    input.text("the value of auxiliary data")?;
    Ok(())
}

fn zone(
    input: &mut Input<'_>,
    variables: usize,
    packing: bool,
    index: usize,
) -> Result<Header, Fault> {
    let mut h = ZoneHeader::new(variables);
    h.title = input.text("the name of a zone")?;
    if h.title.trim().is_empty() {
        h.title = (index + 1).to_string();
    }
    let mut header = Header { zone: h, raw_neighbours: false, connections: None };
    if input.version == 75 {
        zone_75(input, &mut header.zone)?;
        return Ok(header);
    }
    let h = &mut header.zone;
    if input.version >= 107 {
        input.i32("the parent of a zone")?;
    }
    if input.version >= 103 {
        let strand = input.i32("the strand of a zone")?;
        let time = input.f64("the time of a zone")?;
        // -1 is a static zone, -2 one whose strand Tecplot chooses.
        h.time = Some(time).filter(|t| strand != -1 && t.is_finite());
    }
    input.i32("the colour of a zone")?;
    let kind_at = input.cursor.at();
    let kind = input.i32("the type of a zone")?;
    if packing {
        h.by_point = input.i32("the packing of a zone")? == 1;
    }
    if input.i32("the locations of variables")? != 0 {
        let locations = input.list(variables as u64, "locations of variables")?;
        h.cell_centred = locations.iter().map(|l| *l == 1).collect();
    }
    if input.version >= 108 {
        header.raw_neighbours = input.i32("neighbours of a zone")? != 0;
    }
    let connections = input.count("connections of faces")?;
    let element = match kind {
        0 => None,
        1 => Some(Element::Line),
        2 => Some(Element::Triangle),
        3 => Some(Element::Quad),
        4 => Some(Element::Tetra),
        5 => Some(Element::Brick),
        6 | 7 => {
            let name = if kind == 6 { "FEPOLYGON" } else { "FEPOLYHEDRON" };
            let cure = "save the zone with elements of one kind (FETRIANGLE, FEQUADRILATERAL, \
                        FETETRAHEDRON, FEBRICK), or as .vtu";
            let what = format!("zone `{}` is {name}", h.title);
            return Err(Fault::unsupported(kind_at, what, cure));
        }
        _ => {
            let what = format!("zone `{}` is of type {kind}", h.title);
            return Err(Fault::new(kind_at, what, BROKEN));
        }
    };
    if connections != 0 {
        let mode = input.i32("the mode of connections")?;
        if element.is_some() && input.version >= 108 {
            input.i32("whether connections are complete")?;
        }
        header.connections = Some((mode, connections));
    }
    let h = &mut header.zone;
    match element {
        None => {
            let mut size = [0; 3];
            for n in &mut size {
                *n = along(input, &h.title)?;
            }
            h.shape = Shape::Ordered(size);
        }
        Some(kind) => {
            let points = input.count("points of a zone")?;
            let elements = input.count("elements of a zone")?;
            input.list(3, "sizes of cells")?;
            h.shape = Shape::Elements { kind, points, elements };
        }
    }
    while input.i32("auxiliary data of a zone")? != 0 {
        auxiliary(input)?;
    }
    Ok(header)
}

/// Points along an axis; at least 1.
fn along(input: &mut Input<'_>, title: &str) -> Result<u64, Fault> {
    let at = input.cursor.at();
    match input.i32("points along an axis")? {
        n if n >= 1 => Ok(n as u64),
        n => {
            let what = format!("zone `{title}` has {n} points along an axis");
            Err(Fault::new(at, what, BROKEN))
        }
    }
}

/// Version 75: the format tells packing and kind, and of elements the sizes are those of points,
/// elements, and the shape.
fn zone_75(input: &mut Input<'_>, h: &mut ZoneHeader) -> Result<(), Fault> {
    let format = input.i32("the format of a zone")?;
    h.by_point = format == 1 || format == 3;
    input.i32("the colour of a zone")?;
    h.shape = match format {
        0 | 1 => {
            let mut size = [0; 3];
            for n in &mut size {
                *n = along(input, &h.title)?;
            }
            Shape::Ordered(size)
        }
        2 | 3 => {
            let points = input.count("points of a zone")?;
            let elements = input.count("elements of a zone")?;
            let kind = match input.i32("the kind of elements")? {
                0 => Element::Triangle,
                1 => Element::Quad,
                2 => Element::Tetra,
                3 => Element::Brick,
                n => return Err(input.fault(format!("elements of kind {n}"))),
            };
            Shape::Elements { kind, points, elements }
        }
        _ => return Err(input.fault(format!("a zone of format {format}"))),
    };
    Ok(())
}

/// Skips a geometry.
fn geometry(input: &mut Input<'_>) -> Result<(), Fault> {
    let space = input.i32("a geometry")?;
    let words = if input.version >= 102 { 2 } else { 1 };
    input.list(words, "a geometry")?;
    input.cursor.take(3, 8, "a geometry")?;
    input.list(4, "a geometry")?;
    let kind = input.i32("the kind of a geometry")?;
    input.list(1, "a geometry")?;
    input.cursor.take(2, 8, "a geometry")?;
    input.list(3, "a geometry")?;
    input.cursor.take(2, 8, "a geometry")?;
    input.text("the macro of a geometry")?;
    let size = if input.i32("the type of a geometry")? == 2 { 8 } else { 4 };
    if input.version >= 102 {
        input.list(1, "a geometry")?;
    }
    let numbers = match kind {
        // The old kind 5 is a line in space.
        0 | 5 => {
            let lines = input.count("the number of lines")?;
            let axes = if space == 4 || kind == 5 { 3 } else { 2 };
            for _ in 0..lines {
                let points = input.count("the points of a line")?;
                input.cursor.take(points.saturating_mul(axes), size, "points of lines")?;
            }
            0
        }
        1 | 4 => 2,
        2 | 3 => 1,
        _ => return Err(input.fault(format!("a geometry of kind {kind}"))),
    };
    input.cursor.take(numbers, size, "a geometry").map(|_| ())
}

/// Skips a text.
fn text(input: &mut Input<'_>) -> Result<(), Fault> {
    input.list(2, "a text")?;
    let anchor = if input.version >= 102 { 3 } else { 2 };
    input.cursor.take(anchor, 8, "a text")?;
    input.list(2, "a text")?;
    input.cursor.take(1, 8, "a text")?;
    input.list(1, "a text")?;
    input.cursor.take(2, 8, "a text")?;
    input.list(2, "a text")?;
    input.cursor.take(2, 8, "a text")?;
    input.list(3, "a text")?;
    input.text("the macro of a text")?;
    if input.version >= 102 {
        input.list(1, "a text")?;
    }
    input.text("a text").map(|_| ())
}
