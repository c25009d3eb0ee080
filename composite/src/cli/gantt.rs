//! A Gantt chart as SVG: a row for each rank, a bar for each span of time.
use std::fmt::Write as _;

const LEFT: f64 = 70.0;
const ROW: f64 = 22.0;
const TOP: f64 = 64.0;

/// Content and size of a chart.
pub(super) struct Chart<'a> {
    pub(super) title: &'a str,
    /// Names and colours of the bars.
    pub(super) legend: &'a [(&'static str, &'static str)],
    /// Ranks and their bars, from the top.
    pub(super) rows: Vec<(usize, Vec<Bar>)>,
    /// The time axis goes from 0 to here.
    pub(super) end_ms: f64,
    /// Positions on the axis and their labels.
    pub(super) ticks: Vec<(f64, String)>,
    pub(super) tick_color: &'static str,
    /// Text under the axis.
    pub(super) note: Option<&'static str>,
    /// Length of the axis.
    pub(super) axis_px: f64,
    /// Margin right of the axis.
    pub(super) margin_px: f64,
}

/// A span of time.
pub(super) struct Bar {
    pub(super) name: &'static str,
    pub(super) color: &'static str,
    pub(super) begin_ms: f64,
    pub(super) ms: f64,
}

impl Chart<'_> {
    pub(super) fn svg(&self) -> String {
        let (width, margin) = (self.axis_px, self.margin_px);
        let x = |ms: f64| LEFT + width * ms / self.end_ms;
        let bottom = TOP + ROW * self.rows.len() as f64;
        let mut text = String::new();
        // Writing to a String cannot fail.
        let _ = write!(
            text,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{:.0}\" height=\"{:.0}\" \
             font-family=\"sans-serif\" font-size=\"12\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
             <text x=\"{LEFT}\" y=\"22\" font-size=\"14\">{}</text>\n",
            LEFT + width + margin,
            bottom + 48.0,
            escaped(self.title)
        );
        for (index, (name, color)) in self.legend.iter().enumerate() {
            let at = LEFT + 100.0 * index as f64;
            let _ = writeln!(
                text,
                "<rect x=\"{at}\" y=\"36\" width=\"12\" height=\"12\" fill=\"{color}\"/>\
                 <text x=\"{}\" y=\"46\">{name}</text>",
                at + 17.0
            );
        }
        for (ms, label) in &self.ticks {
            let _ = writeln!(
                text,
                "<line x1=\"{0:.1}\" x2=\"{0:.1}\" y1=\"{TOP}\" y2=\"{bottom:.1}\" stroke=\"{2}\"/>\
                 <text x=\"{0:.1}\" y=\"{1:.1}\" text-anchor=\"middle\">{label}</text>",
                x(*ms),
                bottom + 17.0,
                self.tick_color
            );
        }
        for (row, (rank, bars)) in self.rows.iter().enumerate() {
            let y = TOP + ROW * row as f64;
            let _ = writeln!(
                text,
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">rank {rank}</text>",
                LEFT - 8.0,
                y + 15.0
            );
            for bar in bars {
                let _ = writeln!(
                    text,
                    "<rect x=\"{:.2}\" y=\"{:.1}\" width=\"{:.2}\" height=\"{:.1}\" \
                     fill=\"{}\"><title>rank {rank}: {} {:.3} ms</title></rect>",
                    x(bar.begin_ms),
                    y + 3.0,
                    width * bar.ms / self.end_ms,
                    ROW - 6.0,
                    bar.color,
                    bar.name,
                    bar.ms
                );
            }
        }
        if let Some(note) = self.note {
            let _ = writeln!(
                text,
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{note}</text>",
                LEFT + width / 2.0,
                bottom + 38.0
            );
        }
        text.push_str("</svg>\n");
        text
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn titles_cannot_break_the_file() {
        let chart = Chart {
            title: "a < b & c",
            legend: &[],
            rows: Vec::new(),
            end_ms: 1.0,
            ticks: Vec::new(),
            tick_color: "black",
            note: None,
            axis_px: 100.0,
            margin_px: 0.0,
        };
        assert!(chart.svg().contains("a &lt; b &amp; c"));
    }
}
