//! Makes one HTML page from a set of records.
//!
//! The page has no external references: no scripts, fonts or style sheets from elsewhere, and
//! images are data URIs. It can therefore be mailed, archived and opened without a network.

mod table;

use crate::plot::escape;
use crate::record::Record;
use crate::runner::{Ratio, Verdict};
use std::collections::BTreeMap;

/// The whole page. Records are shown by chapter, then by id.
///
/// ```
/// use bench::{machine::Machine, record::Record, report};
/// let page = report::page(&[Record::new("fig4.7", "Build time", 4, true, Machine::describe())]);
/// assert!(page.starts_with("<!doctype html>") && page.contains("id=\"fig4.7\""));
/// ```
pub fn page(records: &[Record]) -> String {
    let mut by_chapter: BTreeMap<u8, Vec<&Record>> = BTreeMap::new();
    for r in records {
        by_chapter.entry(r.chapter).or_default().push(r);
    }
    for chapter in by_chapter.values_mut() {
        chapter.sort_by_key(|r| natural(&r.id));
    }

    let mut s = String::from("<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">");
    s += "<meta name=\"viewport\" \
          content=\"width=device-width,initial-scale=1\"><title>Measurements</title>";
    s += &format!("<style>{}</style></head><body>\n", include_str!("page.css"));
    s += "<h1>Measurements</h1>\n<p>The tables and figures of <cite>Parallel Ray Tracing in \
          Scientific \
          Visualization</cite> (Brownlee, 2012), measured again, and what accuracy costs in time. \
          Ratios are \
          <em>baseline’s time / our time</em>: above 1 we are faster.</p>\n";
    s += &machines(records);
    s += "<nav><h2>Contents</h2>";
    for (chapter, list) in &by_chapter {
        s += &format!("<h3>Chapter {chapter}: {}</h3><ul>", chapter_title(*chapter));
        for r in list {
            let (id, title) = (escape(&r.id), escape(&r.title));
            let gaps =
                if r.missing.is_empty() { "" } else { " <span class=\"gap\">(with gaps)</span>" };
            let doubt =
                if r.doubts().is_empty() { "" } else { " <span class=\"doubt\">(in doubt)</span>" };
            s += &format!("<li><a href=\"#{id}\">{id}</a> {title}{gaps}{doubt}</li>");
        }
        s += "</ul>";
    }
    s += "</nav>\n";
    for (chapter, list) in &by_chapter {
        s += &format!("<h2>Chapter {chapter}: {}</h2>\n", chapter_title(*chapter));
        for r in list {
            s += &section(r);
        }
    }
    s + "</body></html>\n"
}

fn section(r: &Record) -> String {
    let id = escape(&r.id);
    let mut s = format!("<section id=\"{id}\"><h3>{id}: {}</h3>\n", escape(&r.title));
    let form = if r.quick { "Quick form: smaller data, fewer rounds. " } else { "" };
    let m = &r.machine;
    let load = m.load_1_min.map_or("load not known".into(), |l| format!("load {l:.2}"));
    s += &format!(
        "<p class=\"when\">{form}{}, took {:.1} s{}; {load} on {} cores when it began.</p>\n",
        escape(&m.date),
        r.elapsed_secs,
        r.peak_memory.map_or(String::new(), |p| format!(" and {} MB", p.allocated_mb)),
        m.cores
    );
    if !r.recorded_despite.is_empty() {
        s += "<p class=\"doubt\">Recorded despite what spoke against it \
              (<code>--record-despite-doubts</code>).</p>\n";
    }
    for doubt in r.doubts() {
        s += &format!("<p class=\"doubt\">In doubt: {}</p>\n", escape(&doubt));
    }
    for m in &r.missing {
        s += &format!("<p class=\"missing\">Missing: {}</p>\n", escape(m));
    }
    for n in &r.notes {
        s += &format!("<p>{}</p>\n", escape(n));
    }
    for p in &r.plots {
        s += &format!("<figure>{}</figure>\n", p.to_svg());
    }
    for a in r.attachments.iter().filter(|a| a.name.ends_with(".svg") && !a.bytes.is_empty()) {
        let (name, caption) = (escape(&a.name), escape(&a.caption));
        let data = base64::encode(&a.bytes);
        s += &format!(
            "<figure><img alt=\"{name}\" \
             src=\"data:image/svg+xml;base64,{data}\"><figcaption>{caption}</figcaption></figure>\n"
        );
    }
    for p in r.images.iter().filter(|p| !p.png.is_empty()) {
        let (name, caption) = (escape(&p.name), escape(&p.caption));
        let data = base64::encode(&p.png);
        s += "<figure class=\"image\">";
        s += &format!(
            "<img alt=\"{name}\" \
             src=\"data:image/png;base64,{data}\"><figcaption>{caption}</figcaption>"
        );
        s += "</figure>\n";
    }
    s += &ratios(&r.ratios);
    s += &table::rows(r);
    s + "</section>\n"
}

fn ratios(ratios: &[Ratio]) -> String {
    if ratios.is_empty() {
        return String::new();
    }
    let mut s = String::from(
        "<div class=\"scroll\"><table><thead><tr><th>ours</th><th>baseline</th><th class=\"n\">baseline \
         / ours</th>\
         <th class=\"n\">spread</th><th class=\"n\">lowest to highest</th><th \
         class=\"n\">rounds</th></tr></thead><tbody>",
    );
    for r in ratios {
        let class = match r.verdict() {
            Verdict::Faster => "faster",
            Verdict::Slower => "slower",
            Verdict::Even => "even",
            Verdict::Open => "open",
        };
        let rounds =
            r.why_open().map_or(r.rounds.to_string(), |why| format!("{} ({why})", r.rounds));
        s += &format!(
            "<tr><td>{}</td><td>{}</td><td class=\"n {class}\">{:.2}</td><td class=\"n\">{:.2}</td>\
             <td class=\"n\">{:.2} to {:.2}</td><td class=\"n\">{rounds}</td></tr>",
            escape(&r.name),
            escape(&r.baseline),
            r.value,
            r.spread,
            r.low,
            r.high
        );
    }
    s + "</tbody></table></div>\n"
}

fn machines(records: &[Record]) -> String {
    let mut lines: Vec<String> = records
        .iter()
        .map(|r| {
            let m = &r.machine;
            let commit =
                m.commit.as_ref().map_or(", commit not known".into(), |c| format!(", commit {c}"));
            let changed = if m.is_dirty() { ", with uncommitted changes" } else { "" };
            let memory = m.memory_gib;
            format!(
                "{}, {} cores, {}, {memory:.0} GiB, {}; version {}{commit}{changed}",
                m.cpu, m.cores, m.simd, m.os, m.version
            )
        })
        .collect();
    lines.sort();
    lines.dedup();
    lines.iter().map(|l| format!("<p class=\"machine\">{}</p>\n", escape(l))).collect()
}

fn chapter_title(chapter: u8) -> &'static str {
    match chapter {
        3 => "ray tracing inside visualization programs",
        4 => "ray tracing inside OpenGL programs",
        5 => "optics: schlieren, shadowgraphs, interferograms",
        _ => "further measurements",
    }
}

/// Sort key that places `fig4.10` after `fig4.9`.
fn natural(id: &str) -> Vec<(String, u32)> {
    let mut parts = vec![];
    let mut rest = id;
    while !rest.is_empty() {
        let digits = rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len());
        let end =
            rest[digits..].find(|c: char| !c.is_ascii_digit()).map_or(rest.len(), |e| digits + e);
        parts.push((rest[..digits].to_string(), rest[digits..end].parse().unwrap_or(0)));
        rest = &rest[end..];
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;
    use crate::plot::{Axis, Plot, Series};
    use crate::record::{RecordImage, Row};

    fn records() -> Vec<Record> {
        let mut r =
            Record::new("fig4.10", "Time <of> a frame & more", 4, true, Machine::describe());
        r.column("mesh", "", "which");
        r.column("time", "ms", "median");
        r.rows.push(Row::new().with("mesh", "<script>alert(1)</script>").with("time", 12.345678));
        let mut p = Plot::lines("p", Axis::log("x", ""), Axis::log("y", "s"));
        p.series.push(Series::new("a", vec![(1.0, 1.0), (2.0, 3.0)]));
        r.plots.push(p);
        r.images.push(RecordImage {
            name: "v".into(),
            caption: "view".into(),
            png: b"\x89PNG".to_vec(),
        });
        r.missing.push("Embree 4: not installed".into());
        vec![r, Record::new("fig4.9", "Earlier", 4, false, Machine::describe())]
    }

    #[test]
    fn page_refers_to_nothing_outside_itself() {
        let page = page(&records());
        for attribute in ["src=\"", "href=\"", "url("] {
            for (i, _) in page.match_indices(attribute) {
                let target = &page[i + attribute.len()..];
                let inside = target.starts_with("data:") || target.starts_with('#');
                assert!(inside, "{}", &target[..target.len().min(60)]);
            }
        }
        assert!(!page.contains("<script") && !page.contains("@import") && !page.contains("<link"));
        assert!(page.contains("data:image/png;base64,iVBORw=="));
    }

    #[test]
    fn page_is_well_formed() {
        // Apart from the doctype and void tags, the page is XML, so the parser finds elements that
        // are not closed.
        let page = page(&records()).replace("<!doctype html>", "");
        let mut closed = String::new();
        let mut rest = page.as_str();
        while let Some(i) = rest.find(['<']) {
            let end = i + rest[i..].find('>').expect("every tag ends") + 1;
            let tag = &rest[i..end];
            let void = ["<meta", "<img", "<br"].iter().any(|v| tag.starts_with(v));
            closed += &rest[..i];
            closed += &if void { tag.replace('>', "/>") } else { tag.to_string() };
            rest = &rest[end..];
        }
        closed += rest;
        roxmltree::Document::parse(&closed).unwrap_or_else(|e| panic!("{e}\n{closed}"));
    }

    #[test]
    fn ratios_whose_rounds_contradict_each_other_are_neither_faster_nor_slower() {
        let ratio = |low: f64, value: f64, high: f64| Ratio {
            name: "ours".into(),
            baseline: "theirs".into(),
            value,
            spread: 0.1,
            low,
            high,
            rounds: 7,
            in_turns: true,
        };
        for (r, class) in [
            (ratio(1.1, 1.2, 1.3), "faster"),
            (ratio(0.9, 1.2, 1.3), "even"),
            (ratio(0.7, 0.8, 0.9), "slower"),
        ] {
            assert!(ratios(&[r]).contains(&format!("class=\"n {class}\"")), "{class}");
        }
    }

    #[test]
    fn gaps_are_shown_and_figures_are_in_order() {
        let page = page(&records());
        assert!(page.contains("Missing: Embree 4: not installed"));
        let place = |id: &str| page.find(&format!("<section id=\"{id}\"")).unwrap();
        assert!(place("fig4.9") < place("fig4.10"), "9 comes before 10");
    }
}
