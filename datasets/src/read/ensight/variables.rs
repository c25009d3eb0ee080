//! Files of variables: values of the points or elements of parts.

use super::case_file::{Variable, short};
use super::geometry::Part;
use super::source::Source;
use crate::model::{DataArray, Values};
use crate::read::error::{At, BROKEN, Fault};

/// Order of the components of a symmetric tensor in VTK's arrays; EnSight has XX YY ZZ XY XZ YZ,
/// VTK XX YY ZZ XY YZ XZ.
const SYMMETRIC: [usize; 6] = [0, 1, 2, 3, 5, 4];

/// Adds the array to the parts that have values; a warning counts the others.
pub(super) fn read(
    s: &mut Source<'_>,
    v: &Variable,
    parts: &mut [Part],
    warnings: &mut Vec<String>,
) -> Result<(), Fault> {
    s.need_text("the description")?;
    let mut values: Vec<Option<Vec<f32>>> = parts.iter().map(|_| None).collect();
    let mut undefined = 0;
    while let Some(word) = s.keyword()? {
        if word != "part" {
            return Err(s.fault(format!("`{}` instead of a part", short(&word))));
        }
        let number = s.ints(1, "the number of a part")?.first().copied().unwrap_or(0);
        let Some(at) = parts.iter().position(|p| p.number == number) else {
            let what = format!("part {number} is not one of the geometry");
            return Err(s.fault(what));
        };
        values[at] = Some(part(s, v, &parts[at], &mut undefined)?);
    }
    let missing = values.iter().filter(|x| x.is_none()).count();
    if missing > 0 && missing < parts.len() {
        warnings.push(format!(
            "variable `{}`: {missing} of {} parts have no values",
            v.name,
            parts.len()
        ));
    }
    if undefined > 0 {
        warnings.push(format!("variable `{}`: {undefined} undefined values are NaN", v.name));
    }
    if missing == parts.len() {
        warnings.push(format!("variable `{}` has no values", v.name));
        return Ok(());
    }
    for (part, values) in parts.iter_mut().zip(values) {
        let Some(values) = values else { continue };
        let array = DataArray::new(v.name.clone(), v.components, Values::F32(values));
        if let Some(a) = part.data.attributes_mut() {
            if v.of_elements { a.cell.push(array) } else { a.point.push(array) }
        }
        part.data.check()?;
    }
    Ok(())
}

fn part(
    s: &mut Source<'_>,
    v: &Variable,
    part: &Part,
    undefined: &mut usize,
) -> Result<Vec<f32>, Fault> {
    let (points, cells) = part.data.counts();
    let of_types = v.of_elements && !part.elements.is_empty();
    let mut out = Vec::new();
    if !of_types {
        let n = if v.of_elements { cells } else { points };
        let word = s.need_text("`coordinates` or `block`")?;
        section(s, v, &word, n, &mut out, undefined)?;
        return Ok(out);
    }
    // Elements of a type without values get NaN.
    let mut sections: Vec<Option<Vec<f32>>> = part.elements.iter().map(|_| None).collect();
    while let Some(word) = s.peek().filter(|w| w != "part") {
        s.keyword()?;
        let name = word.split_whitespace().next().unwrap_or_default();
        let at = part.elements.iter().position(|e| e.0 == name);
        let Some(at) = at.filter(|&at| sections[at].is_none()) else {
            let what = format!("`{}` in part `{}`", short(&word), part.name);
            return Err(s.fault(what));
        };
        let mut values = Vec::new();
        section(s, v, &word, part.elements[at].1 as u64, &mut values, undefined)?;
        sections[at] = Some(values);
    }
    for (section, (_, n)) in sections.into_iter().zip(&part.elements) {
        *undefined += if section.is_none() { *n } else { 0 };
        out.extend(section.unwrap_or_else(|| vec![f32::NAN; n * v.components]));
    }
    Ok(out)
}

/// The values of one section: each component after the other.
fn section(
    s: &mut Source<'_>,
    v: &Variable,
    word: &str,
    n: u64,
    out: &mut Vec<f32>,
    undefined: &mut usize,
) -> Result<(), Fault> {
    if word.split_whitespace().any(|w| w == "partial") {
        let what = format!("variable `{}` has values of some points only (partial)", v.name);
        return Err(Fault::unsupported(s.at(), what, "write it with `undef` and all values"));
    }
    let mark = match word.split_whitespace().any(|w| w == "undef") {
        true => s.reals(1, "the undefined value")?.first().copied(),
        false => None,
    };
    let total = n.saturating_mul(v.components as u64);
    let mut flat = s.reals(total, &format!("values of `{}`", v.name))?;
    if flat.len() as u64 != total {
        return Err(Fault::new(At::Field(v.name.clone()), "too few values", BROKEN));
    }
    for x in &mut flat {
        if Some(*x) == mark {
            *undefined += 1;
            *x = f32::NAN;
        }
    }
    let n = n as usize;
    out.reserve(flat.len());
    for i in 0..n {
        for c in 0..v.components {
            let c = if v.components == 6 { SYMMETRIC[c] } else { c };
            out.push(flat[c * n + i]);
        }
    }
    Ok(())
}
