//! A record's rows as an HTML table.

use crate::plot::escape;
use crate::record::{Column, Record};
use serde_json::Value;

/// Longer tables are collapsed.
const ROWS_SHOWN: usize = 12;

pub(super) fn rows(r: &Record) -> String {
    if r.rows.is_empty() {
        return String::new();
    }
    let numeric = |c: &Column| r.rows.iter().any(|row| row.number(&c.name).is_some());
    let mut t = String::from("<div class=\"scroll\"><table><thead><tr>");
    for c in &r.columns {
        let unit =
            if c.unit.is_empty() { String::new() } else { format!(" [{}]", escape(&c.unit)) };
        let class = if numeric(c) { " class=\"n\"" } else { "" };
        t += &format!("<th{class} title=\"{}\">{}{unit}</th>", escape(&c.meaning), escape(&c.name));
    }
    t += "</tr></thead><tbody>";
    for row in &r.rows {
        t += "<tr>";
        for c in &r.columns {
            let class = if numeric(c) { " class=\"n\"" } else { "" };
            t += &format!("<td{class}>{}</td>", cell(row.0.get(&c.name)));
        }
        t += "</tr>";
    }
    t += "</tbody></table></div>\n";
    if r.rows.len() > ROWS_SHOWN {
        format!("<details><summary>{} rows</summary>{t}</details>\n", r.rows.len())
    } else {
        t
    }
}

fn cell(v: Option<&Value>) -> String {
    match v {
        None | Some(Value::Null) => "–".into(),
        Some(Value::String(t)) => escape(t),
        Some(Value::Number(n)) => match (n.as_i64(), n.as_f64()) {
            (Some(i), _) => i.to_string(),
            (None, Some(x)) => four_digits(x),
            _ => escape(&n.to_string()),
        },
        Some(v) => escape(&v.to_string()),
    }
}

/// Four significant digits; more would exceed the repeatability of the machine. The CSV has all
/// digits.
fn four_digits(x: f64) -> String {
    if x == 0.0 {
        return "0".into();
    }
    let exponent = x.abs().log10().floor() as i32;
    if (-4..9).contains(&exponent) {
        let decimals = (3 - exponent).max(0) as usize;
        format!("{x:.decimals$}")
    } else {
        format!("{x:.3e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{machine::Machine, record::Row};

    #[test]
    fn numbers_keep_four_digits_and_counts_all() {
        let cells = [serde_json::json!(12.345678), 1e-9.into(), 123_456_789.into(), Value::Null];
        assert_eq!(cells.map(|v| cell(Some(&v))), ["12.35", "1.000e-9", "123456789", "–"]);
    }

    #[test]
    fn long_tables_are_folded_and_complete() {
        let mut r = Record::new("x", "x", 4, false, Machine::describe());
        r.column("i", "", "number");
        r.rows = (0..40).map(|i| Row::new().with("i", i)).collect();
        let html = rows(&r);
        assert!(html.starts_with("<details><summary>40 rows"));
        assert_eq!(html.matches("<tr>").count(), 41);
    }
}
