//! Text files of Tecplot.
//!
//! Source: Tecplot 360 Data Format Guide, chapter "ASCII data".

use super::scanner::{Scanner, short};
use super::text_zone::{self, is_record, zone_header};
use super::zone::{Shape, Zone, ZoneHeader};
use super::{FORMAT_CURE, File};
use crate::model::Values;
use crate::model::array::fortran_number;
use crate::read::error::{Fault, TRUNCATED};
use std::rc::Rc;

/// Values that a file may hold for each of its bytes, by repeat counts and shared variables. A
/// uniform field takes a few bytes, but its points have coordinates.
pub(super) const MOST_PER_BYTE: u64 = 128;

/// Whether a text begins as a Tecplot file does.
pub(super) fn begins_as_tecplot(head: &str) -> bool {
    let mut s = Scanner::new(head);
    let Some(first) = s.word() else { return false };
    match first.to_ascii_uppercase().as_str() {
        "TITLE" | "VARIABLES" | "FILETYPE" => s.peek() == Some(b'='),
        "ZONE" => s.has_key(),
        _ => false,
    }
}

/// Reads the zones of a text.
pub(super) fn read(text: &str) -> Result<File, Fault> {
    let mut file = File::default();
    let mut s = Scanner::new(text);
    let mut budget = (text.len() as u64).saturating_mul(MOST_PER_BYTE);
    let mut left_out: Vec<String> = Vec::new();
    while s.peek().is_some() {
        let at = s.at();
        let word = s.word().unwrap_or_default().to_ascii_uppercase();
        match word.as_str() {
            "TITLE" => {
                s.equals("TITLE")?;
                file.title = s.value()?.text().trim().to_string();
            }
            "FILETYPE" => {
                s.equals("FILETYPE")?;
                let kind = s.value()?.text().to_ascii_uppercase();
                if kind == "SOLUTION" {
                    return Err(super::solution_without_grid(at));
                }
            }
            "VARIABLES" => {
                s.equals("VARIABLES")?;
                variables(&mut s, &mut file.variables)?;
            }
            "ZONE" => {
                if file.variables.is_empty() {
                    let what = "a zone without a record VARIABLES before it";
                    return Err(Fault::new(at, what, "add VARIABLES = \"X\", \"Y\", ..."));
                }
                let header = zone_header(&mut s, &file)?;
                let zone = zone(&mut s, header, &file.zones, &mut budget)?;
                file.zones.push(zone);
            }
            _ if is_record(&word) => {
                if !left_out.contains(&word) {
                    left_out.push(word);
                }
                skip_record(&mut s)?;
            }
            _ if fortran_number(&word).is_some() && !file.zones.is_empty() => {
                let zone = &file.zones[file.zones.len() - 1].header;
                let what =
                    format!("`{}`: there are more numbers than zone `{}` has", word, zone.title);
                return Err(Fault::new(at, what, "check its I, J, K, N and E, and VARIABLES"));
            }
            _ => {
                let what = format!("`{}` is no record of a Tecplot file", short(&word));
                return Err(Fault::new(at, what, FORMAT_CURE));
            }
        }
    }
    if !left_out.is_empty() {
        file.warnings.push(format!("records left out: {}", left_out.join(", ")));
    }
    Ok(file)
}

fn variables(s: &mut Scanner<'_>, names: &mut Vec<String>) -> Result<(), Fault> {
    names.clear();
    while let Some(next) = s.peek() {
        if next != b'"' {
            let Some(word) = s.next_word() else { break };
            if is_record(word) || s.has_key() {
                break;
            }
        }
        names.push(s.value()?.text().trim().to_string());
    }
    Ok(())
}

/// Goes to the next record.
fn skip_record(s: &mut Scanner<'_>) -> Result<(), Fault> {
    while s.peek().is_some() && !s.next_word().is_some_and(is_record) {
        s.value()?;
    }
    Ok(())
}

/// The values and elements of a zone, with those that it shares with earlier ones.
fn zone(
    s: &mut Scanner<'_>,
    (header, face_neighbours): (ZoneHeader, bool),
    earlier: &[Zone],
    budget: &mut u64,
) -> Result<Zone, Fault> {
    let own = header.own();
    let mut zone = Zone { values: vec![None; header.passive.len()], elements: None, header };
    let h = &zone.header;
    let mut counts = own.iter().map(|&v| h.count(v)).collect::<Result<Vec<u64>, Fault>>()?;
    if h.by_point {
        if let Some(v) = own.iter().find(|&&v| h.cell_centred[v]) {
            let what = format!("variable {} is one of cells, in point packing", v + 1);
            return Err(h.fault(what));
        }
        let per_point = own.len().max(1) as u64;
        let values = counts.first().copied().unwrap_or(0).checked_mul(per_point);
        let all = reals(s, values.unwrap_or(u64::MAX), budget, &|| names_of(h, None))?;
        for (i, &v) in own.iter().enumerate() {
            let column = all.iter().skip(i).step_by(own.len()).copied().collect();
            zone.values[v] = Some(Rc::new(Values::F64(column)));
        }
    } else {
        for (&v, count) in own.iter().zip(counts.drain(..)) {
            let column = reals(s, count, budget, &|| names_of(h, Some(v)))?;
            zone.values[v] = Some(Rc::new(Values::F64(column)));
        }
    }
    if let (Shape::Elements { kind, points, elements }, None) = (h.shape, h.cells_from) {
        let ids = elements.saturating_mul(kind.corners() as u64);
        zone.elements = Some(Rc::new(text_zone::elements(s, h, ids, points)?));
    }
    if face_neighbours {
        while s.peek().is_some_and(|b| b.is_ascii_digit() || b == b'-') {
            s.word();
        }
    }
    zone.share(earlier)?;
    Ok(zone)
}

fn names_of(h: &ZoneHeader, variable: Option<usize>) -> String {
    match variable {
        Some(v) => format!("values of variable {} in zone `{}`", v + 1, h.title),
        None => format!("values of zone `{}`", h.title),
    }
}

/// The next `count` numbers. Repeat counts may not make more of them than `budget` allows.
fn reals(
    s: &mut Scanner<'_>,
    count: u64,
    budget: &mut u64,
    what: &dyn Fn() -> String,
) -> Result<Vec<f64>, Fault> {
    if count > *budget {
        let what = format!("{count} {} declared, but only {} bytes follow", what(), s.remaining());
        return Err(Fault::new(s.at(), what, TRUNCATED));
    }
    let mut out = Vec::with_capacity(count.min(s.remaining() as u64) as usize);
    while (out.len() as u64) < count {
        let (times, value) = s.repeated(what, fortran_number)?;
        if times > count - out.len() as u64 {
            let what = format!("{times} times {value} among the {}, which are {count}", what());
            return Err(s.fault(what));
        }
        out.resize(out.len() + times as usize, value);
    }
    *budget -= count;
    Ok(out)
}
