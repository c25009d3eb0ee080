//! The values of a box (FAB): a line that tells type, byte order, cells and number of variables,
//! and then one variable after the other, x fastest.

use super::header::{index_box, integers};
use crate::model::{Endian, ScalarType, Values};
use crate::read::error::{At, BROKEN, Cursor, Fault, TRUNCATED};
use crate::read::refinement::IndexBox;

/// The values of the variables in `cells`; the box in the file may have ghost cells around them.
pub(super) fn read(
    bytes: &[u8],
    offset: u64,
    cells: &IndexBox,
    variables: usize,
    axes: usize,
) -> Result<Vec<Values>, Fault> {
    let at = At::Byte(offset);
    let Some(pos) = usize::try_from(offset).ok().filter(|p| *p < bytes.len()) else {
        let what = format!("a box begins there, but the file has {} bytes", bytes.len());
        return Err(Fault::new(at, what, TRUNCATED));
    };
    let mut cursor = Cursor { data: bytes, pos };
    let line = cursor.line().unwrap_or_default();
    let shown: String = line.chars().take(60).collect();
    let wrong = |what: &str| Fault::new(at.clone(), format!("{what}: `{shown}`"), BROKEN);
    if !line.starts_with("FAB ((8,") {
        let cure = "write the plotfile in the native format";
        return Err(Fault::unsupported(at.clone(), format!("a box begins with `{shown}`"), cure));
    }
    // FAB ((8, (bits of the format)),(bytes, (order)))(box) variables
    let numbers = integers(&line);
    let size = numbers.get(9).copied();
    let kind = match size {
        Some(4) => ScalarType::F32,
        Some(8) => ScalarType::F64,
        _ => return Err(wrong("values of 4 or 8 bytes are read")),
    };
    let width = kind.size();
    let order = numbers.get(10..10 + width).unwrap_or_default();
    let up = (1..=width as i64).collect::<Vec<i64>>();
    let endian = if order == up {
        Endian::Big
    } else if order.iter().rev().eq(&up) {
        Endian::Little
    } else {
        return Err(wrong("the order of bytes"));
    };
    let rest = &numbers[10 + width..];
    let stored = index_box(rest, axes).ok_or_else(|| wrong("the cells of a box"))?;
    let count = rest.get(3 * axes).copied();
    if count != Some(variables as i64) || !stored.contains(cells) {
        return Err(wrong("a box that does not fit the list of boxes"));
    }
    let along: Vec<usize> = (0..3).map(|a| (stored.high[a] - stored.low[a] + 1) as usize).collect();
    let n = stored.count().unwrap_or(u64::MAX);
    let mut out = Vec::with_capacity(variables);
    for _ in 0..variables {
        let values = Values::from_bytes(kind, cursor.take(n, width, "values of a box")?, endian);
        if stored == *cells {
            out.push(values);
            continue;
        }
        let shift = [0, 1, 2].map(|a| (cells.low[a] - stored.low[a]) as usize);
        let size = [0, 1, 2].map(|a| (cells.high[a] - cells.low[a] + 1) as usize);
        let row =
            |j: usize, k: usize| shift[0] + along[0] * (shift[1] + j + along[1] * (shift[2] + k));
        let rows = (0..size[2]).flat_map(|k| (0..size[1]).map(move |j| (j, k)));
        out.push(values.gathered(rows.flat_map(|(j, k)| row(j, k)..row(j, k) + size[0])));
    }
    Ok(out)
}
