//! When each rank of a data-parallel frame did what: a Gantt plot (SVG) and a table.
use super::rank_records::RankRecord;
use crate::render::Activity;
use std::fmt::Write as _;

const LEFT: f64 = 70.0;
const PLOT_WIDTH: f64 = 860.0;
const ROW: f64 = 22.0;
const TOP: f64 = 64.0;

/// Colours of Okabe and Ito, which the colour-blind can tell apart, in the order of
/// [`Activity::ALL`].
const COLORS: [&str; 6] = ["#009e73", "#0072b2", "#f0e442", "#56b4e9", "#dddddd", "#cc79a7"];

/// A row for each rank, a bar for each span.
pub(super) fn svg(title: &str, lines: &[RankRecord]) -> String {
    let longest_ms = lines.iter().map(|line| line.total_ms).fold(1e-6, f64::max);
    let x = |ms: f64| LEFT + PLOT_WIDTH * ms / longest_ms;
    let bottom = TOP + ROW * lines.len() as f64;
    let title = title.replace('&', "&amp;").replace('<', "&lt;");
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = write!(
        text,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{:.0}\" height=\"{:.0}\" \
         font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n<text x=\"{LEFT}\" y=\"22\" \
         font-size=\"14\">{title}</text>\n",
        LEFT + PLOT_WIDTH + 40.0,
        bottom + 48.0,
    );
    for (index, (activity, color)) in Activity::ALL.iter().zip(COLORS).enumerate() {
        let at = LEFT + 100.0 * index as f64;
        let _ = writeln!(
            text,
            "<rect x=\"{at}\" y=\"36\" width=\"12\" height=\"12\" fill=\"{color}\"/><text x=\"{}\" \
             y=\"46\">{}</text>",
            at + 17.0,
            activity.name()
        );
    }
    for k in 0..=4 {
        let ms = longest_ms * f64::from(k) / 4.0;
        let _ = writeln!(
            text,
            "<line x1=\"{0:.1}\" x2=\"{0:.1}\" y1=\"{TOP}\" y2=\"{bottom:.1}\" stroke=\"#bbbbbb\"/>\
             <text x=\"{0:.1}\" y=\"{1:.1}\" text-anchor=\"middle\">{ms:.2}{2}</text>",
            x(ms),
            bottom + 17.0,
            if k == 4 { " ms" } else { "" }
        );
    }
    for (row, line) in lines.iter().enumerate() {
        let y = TOP + ROW * row as f64;
        let _ = writeln!(
            text,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">rank {}</text>",
            LEFT - 8.0,
            y + 15.0,
            line.rank
        );
        for &(activity, begin_ms, end_ms) in &line.spans {
            let name = Activity::ALL.get(activity).map_or("", |a| a.name());
            let _ = writeln!(
                text,
                "<rect x=\"{:.2}\" y=\"{:.1}\" width=\"{:.2}\" height=\"{:.1}\" \
                 fill=\"{}\"><title>rank {}: {name} {:.3} ms</title></rect>",
                x(begin_ms),
                y + 3.0,
                PLOT_WIDTH * (end_ms - begin_ms) / longest_ms,
                ROW - 6.0,
                COLORS.get(activity).unwrap_or(&"black"),
                line.rank,
                end_ms - begin_ms
            );
        }
    }
    text.push_str("</svg>\n");
    text
}

/// A line for each rank, milliseconds.
pub(super) fn table(lines: &[RankRecord]) -> String {
    let mut text = format!("{:>5} {:>10}", "rank", "triangles");
    for activity in Activity::ALL {
        let _ = write!(text, " {:>9}", activity.name());
    }
    let _ = write!(text, " {:>9} {:>7} {:>12}", "total ms", "rounds", "bytes sent");
    for l in lines {
        let _ = write!(text, "\n{:>5} {:>10}", l.rank, l.triangles);
        let columns = [
            l.render_ms,
            l.composite_ms,
            l.shade_ms,
            l.answer_ms,
            l.exchange_ms,
            l.collect_ms,
            l.total_ms,
        ];
        for ms in columns {
            let _ = write!(text, " {ms:>9.2}");
        }
        let _ = write!(text, " {:>7} {:>12}", l.rounds, l.bytes_sent);
    }
    text
}
