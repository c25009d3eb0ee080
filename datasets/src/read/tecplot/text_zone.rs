//! The header of a zone in a Tecplot text file, and the lists in it.

use super::File;
use super::scanner::{Scanner, Value, short};
use super::shapes::Element;
use super::zone::{Shape, ZoneHeader};
use crate::model::array::fortran_number;
use crate::read::error::{At, BROKEN, Fault, fits};

/// Words that begin a record.
const RECORDS: [&str; 11] = [
    "TITLE",
    "FILETYPE",
    "VARIABLES",
    "ZONE",
    "TEXT",
    "GEOMETRY",
    "CUSTOMLABELS",
    "DATASETAUXDATA",
    "VARAUXDATA",
    "USERREC",
    "FUNCTION",
];

/// Keys that have no meaning for the data.
const IGNORED: [&str; 5] = ["C", "DT", "NV", "PARENTZONE", "FACENEIGHBORMODE"];

/// What is read of a header before its parts fit together.
#[derive(Default)]
struct Keys {
    size: [Option<u64>; 3],
    points: Option<u64>,
    elements: Option<u64>,
    kind: Option<Element>,
    ordered: bool,
    packing: Option<bool>,
    static_strand: bool,
    face_neighbours: bool,
}

/// Reads the header of a zone, and whether connections of faces follow the zone.
pub(super) fn zone_header(s: &mut Scanner<'_>, file: &File) -> Result<(ZoneHeader, bool), Fault> {
    let mut h = ZoneHeader::new(file.variables.len());
    h.title = format!("{}", file.zones.len() + 1);
    let mut keys = Keys::default();
    loop {
        if s.next_word().is_some_and(|w| w.eq_ignore_ascii_case("AUXDATA")) {
            // AUXDATA name = "value"
            s.word();
            let name = s.word().unwrap_or_default();
            s.equals(name)?;
            s.value()?;
        } else if s.peek().is_some() && s.has_key() {
            let at = s.at();
            let key = s.word().unwrap_or_default().to_ascii_uppercase();
            s.equals(&key)?;
            let value = s.value()?;
            apply(&mut h, &mut keys, &key, &value, at, file)?;
        } else {
            break;
        }
    }
    let first_of = |w: &str| fortran_number(w.split('*').next_back().unwrap_or(w)).is_some();
    match s.next_word() {
        Some(word) if !first_of(word) && !is_record(word) => {
            s.peek();
            Err(s.fault(format!("`{}` in the header of zone `{}`", short(word), h.title)))
        }
        _ => finish(h, keys, s.at()),
    }
}

fn apply(
    h: &mut ZoneHeader,
    keys: &mut Keys,
    key: &str,
    value: &Value<'_>,
    at: At,
    file: &File,
) -> Result<(), Fault> {
    let text = value.text().trim();
    let upper = text.to_ascii_uppercase();
    let number = || {
        let n = text.parse::<u64>().ok().filter(|n| *n >= 1);
        n.ok_or_else(|| out_of_range(at.clone(), &h.title, key, text))
    };
    match key {
        "T" => h.title = text.to_string(),
        "I" => keys.size[0] = Some(number()?),
        "J" => keys.size[1] = Some(number()?),
        "K" => keys.size[2] = Some(number()?),
        "N" | "NODES" => keys.points = Some(number()?),
        "E" | "ELEMENTS" => keys.elements = Some(number()?),
        "SOLUTIONTIME" => {
            let time = fortran_number(text).filter(|t| t.is_finite());
            let fault = || out_of_range(at.clone(), &h.title, key, text);
            h.time = Some(time.ok_or_else(fault)?);
        }
        "STRANDID" => keys.static_strand = text == "0" || text.starts_with('-'),
        "F" => {
            keys.packing = Some(upper.ends_with("POINT"));
            keys.ordered |= !upper.starts_with("FE");
        }
        "DATAPACKING" => keys.packing = Some(upper == "POINT"),
        "ZONETYPE" if upper == "ORDERED" => keys.ordered = true,
        "ZONETYPE" | "ET" => match Element::named(&upper) {
            Some(kind) => keys.kind = Some(kind),
            None => {
                let cure = "save the zone with elements of one kind (FETRIANGLE, \
                            FEQUADRILATERAL, FETETRAHEDRON, FEBRICK), or as .vtu";
                let what = format!("zone `{}` is {key} = {}", h.title, short(text));
                return Err(Fault::unsupported(at, what, cure));
            }
        },
        "VARLOCATION" => {
            let location = |of: &str| match of.trim().to_ascii_uppercase().as_str() {
                "CELLCENTERED" => Some(true),
                "NODAL" => Some(false),
                _ => None,
            };
            for (variables, of) in assigned(text, file.variables.len(), &at)? {
                let Some(cells) = location(&of) else {
                    let what = format!("VARLOCATION of `{}`", short(&of));
                    return Err(Fault::new(at, what, "it is NODAL or CELLCENTERED"));
                };
                variables.into_iter().for_each(|v| h.cell_centred[v] = cells);
            }
        }
        "PASSIVEVARLIST" => {
            for v in numbers(text, file.variables.len(), &at)? {
                h.passive[v] = true;
            }
        }
        "VARSHARELIST" => {
            for (variables, of) in assigned(text, file.variables.len(), &at)? {
                let zone = match of.trim() {
                    "" => Some(file.zones.len()),
                    n => n.parse::<usize>().ok(),
                };
                let from = zone.and_then(|z| z.checked_sub(1));
                let Some(from) = from.filter(|z| *z < file.zones.len()) else {
                    let what = format!("VARSHARELIST names zone `{}`", short(&of));
                    return Err(Fault::new(at, what, "it must name a zone that comes before"));
                };
                variables.into_iter().for_each(|v| h.shared[v] = Some(from));
            }
        }
        "CONNECTIVITYSHAREZONE" => {
            let zone = number()?;
            h.cells_from = usize::try_from(zone - 1).ok();
        }
        "D" => {
            let cure = "write it with VARSHARELIST and CONNECTIVITYSHAREZONE";
            let what = format!("zone `{}` has D = ({})", h.title, short(text));
            return Err(Fault::unsupported(at, what, cure));
        }
        "FACENEIGHBORCONNECTIONS" => keys.face_neighbours = text != "0",
        _ if IGNORED.contains(&key) => {}
        _ => {
            let what = format!("unknown key `{}` in the header of zone `{}`", short(key), h.title);
            return Err(Fault::new(at, what, "check its spelling, or leave it out"));
        }
    }
    Ok(())
}

/// Puts the parts of a header together.
fn finish(mut h: ZoneHeader, keys: Keys, at: At) -> Result<(ZoneHeader, bool), Fault> {
    // Without a packing, zones with variables of cells or elements are in blocks.
    let blocks = h.cell_centred.contains(&true);
    h.by_point = keys.packing.unwrap_or(!blocks && keys.kind.is_none());
    if keys.static_strand {
        h.time = None;
    }
    let elements = keys.kind.is_some() && !keys.ordered;
    h.shape = if elements || keys.points.is_some() {
        let lacks = |what: &str| {
            let what = format!("zone `{}` of elements without {what}", h.title);
            Fault::new(at.clone(), what, "add N, E and ZONETYPE to the zone")
        };
        Shape::Elements {
            kind: keys.kind.ok_or_else(|| lacks("a kind"))?,
            points: keys.points.or(keys.size[0]).ok_or_else(|| lacks("N"))?,
            elements: keys.elements.or(keys.size[1]).ok_or_else(|| lacks("E"))?,
        }
    } else {
        if keys.size == [None; 3] {
            let what = format!("zone `{}` has no I, J and K", h.title);
            return Err(Fault::new(at, what, "add the numbers of its points, I=..., J=..., K=..."));
        }
        Shape::Ordered(keys.size.map(|n| n.unwrap_or(1)))
    };
    Ok((h, keys.face_neighbours))
}

/// The corners of the elements, which count from 1 in the file.
pub(super) fn elements(
    s: &mut Scanner<'_>,
    h: &ZoneHeader,
    ids: u64,
    points: u64,
) -> Result<Vec<u32>, Fault> {
    let title = &h.title;
    let count = fits(ids, 2, s.remaining() + 1, s.at(), "corners of elements")?;
    let mut out = Vec::with_capacity(count);
    let what = || format!("elements of zone `{title}`");
    while out.len() < count {
        let (times, id) = s.repeated(&what, |w| w.parse::<u64>().ok())?;
        let index = id.checked_sub(1).filter(|i| *i < points);
        let Some(index) = index.and_then(|i| u32::try_from(i).ok()) else {
            return Err(s.fault(format!(
                "element {} of zone `{title}` has point {id}, of {points}",
                1 + out.len() as u64
            )));
        };
        if times > (count - out.len()) as u64 {
            return Err(s.fault(format!("{times} times {id} among the elements")));
        }
        out.resize(out.len() + times as usize, index);
    }
    Ok(out)
}

/// Numbers of variables, from 0: `1,3-5` or `[1,3-5]`.
fn numbers(text: &str, variables: usize, at: &At) -> Result<Vec<usize>, Fault> {
    let mut out = Vec::new();
    let inside = text.trim().trim_start_matches('[').trim_end_matches(']');
    for part in inside.split([',', ' ', '\t', '\n', '\r']).filter(|p| !p.is_empty()) {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let number = |n: &str| n.trim().parse::<usize>().ok().filter(|n| *n >= 1);
        match (number(first), number(last)) {
            (Some(a), Some(b)) if a <= b && b <= variables => out.extend(a - 1..b),
            _ => {
                let what = format!("`{}` in a list of the {variables} variables", short(part));
                return Err(Fault::new(at.clone(), what, BROKEN));
            }
        }
    }
    Ok(out)
}

/// The assignments of a list: `[4-5]=CELLCENTERED, [6]=NODAL`, one word for each variable, or
/// variables alone, whose word is empty.
fn assigned(text: &str, variables: usize, at: &At) -> Result<Vec<(Vec<usize>, String)>, Fault> {
    let mut out = Vec::new();
    let mut rest = text.trim();
    if !rest.contains('[') && !rest.contains('=') && rest.contains(|c: char| c.is_alphabetic()) {
        let words = rest.split([',', ' ', '\t', '\n']).filter(|w| !w.is_empty());
        let words: Vec<(Vec<usize>, String)> =
            words.enumerate().map(|(v, w)| (vec![v], w.to_string())).collect();
        if words.len() > variables {
            let what = format!("{} entries for {variables} variables", words.len());
            return Err(Fault::new(at.clone(), what, BROKEN));
        }
        return Ok(words);
    }
    while !rest.is_empty() {
        let (list, after) = match rest.strip_prefix('[') {
            Some(inside) => inside.split_once(']').unwrap_or((inside, "")),
            None => rest.split_at(rest.find(['=', ',']).unwrap_or(rest.len())),
        };
        let list = numbers(list, variables, at)?;
        let after = after.trim_start();
        let (word, after) = match after.strip_prefix('=') {
            Some(word) => word.split_at(word.find(',').unwrap_or(word.len())),
            None => ("", after),
        };
        out.push((list, word.trim().to_string()));
        rest = after.trim_start_matches([',', ' ', '\t', '\n', '\r']);
    }
    Ok(out)
}

/// Whether the word begins a record.
pub(super) fn is_record(word: &str) -> bool {
    RECORDS.iter().any(|r| r.eq_ignore_ascii_case(word))
}

/// The fault of a number of a zone that is out of range.
pub(super) fn out_of_range(at: At, title: &str, key: &str, value: &str) -> Fault {
    let what = format!("zone `{title}`: {key} is `{}`", short(value));
    Fault::new(at, what, "write a whole number from 1 on")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_variables() {
        let at = At::Line(1);
        assert_eq!(numbers("[1,3-5]", 5, &at).unwrap(), [0, 2, 3, 4]);
        assert!(numbers("6", 5, &at).is_err() && numbers("0", 5, &at).is_err());
        let list = assigned("[3,4]=CELLCENTERED, [5]=NODAL", 5, &at).unwrap();
        assert_eq!(list, [(vec![2, 3], "CELLCENTERED".into()), (vec![4], "NODAL".into())]);
        let list = assigned("NODAL, CELLCENTERED", 2, &at).unwrap();
        assert_eq!(list, [(vec![0], "NODAL".into()), (vec![1], "CELLCENTERED".into())]);
        assert_eq!(assigned("[1-2]=1,[3]=2", 3, &at).unwrap()[1], (vec![2], "2".into()));
        assert_eq!(assigned("[1-2]", 3, &at).unwrap(), [(vec![0, 1], String::new())]);
        assert_eq!(assigned("1-2", 3, &at).unwrap(), [(vec![0, 1], String::new())]);
    }
}
