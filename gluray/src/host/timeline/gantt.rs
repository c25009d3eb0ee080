//! Draws a Gantt chart as SVG: one row per thread, one box per span, one line at the end of each
//! frame.

use super::{Span, in_order_of_appearance};
use std::fmt::Write as _;

/// What is drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct GanttOptions {
    /// Above the chart.
    pub title: String,
    /// Width of the picture, pixels.
    pub width: u32,
    /// Milliseconds shown, from and to; all when `None`.
    pub window_ms: Option<[f64; 2]>,
}

impl Default for GanttOptions {
    fn default() -> Self {
        GanttOptions { title: String::new(), width: 1000, window_ms: None }
    }
}

const LEFT: f64 = 110.0;
const RIGHT: f64 = 16.0;
const TOP: f64 = 34.0;
const ROW: f64 = 30.0;
const BOX: f64 = 22.0;
/// Told apart by people who see colours otherwise, too (Okabe and Ito 2008), and beyond eight by
/// their order.
const COLORS: [&str; 8] =
    ["#56b4e9", "#e69f00", "#009e73", "#cc79a7", "#0072b2", "#d55e00", "#f0e442", "#999999"];
/// Boxes narrower than this are joined with their neighbours of the same phase: a run of minutes
/// would make a file of gigabytes.
const NARROWEST: f64 = 0.25;

/// The chart. Spans outside the window are left out; an empty list gives a chart that says so.
pub fn gantt_svg(spans: &[Span], options: &GanttOptions) -> String {
    let sound: Vec<&Span> = spans.iter().filter(|s| s.is_sound()).collect();
    let tracks = in_order_of_appearance(spans, |s| &s.track);
    let phases = in_order_of_appearance(spans, |s| &s.phase);
    let all = sound.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], s| {
        [a.min(s.start_ms), b.max(s.end_ms())]
    });
    let [from, to] = options.window_ms.unwrap_or(if sound.is_empty() { [0.0, 1.0] } else { all });
    let to = if to > from { to } else { from + 1.0 };
    let width = f64::from(options.width.max(300));
    let inner = width - LEFT - RIGHT;
    let x = |ms: f64| LEFT + inner * (ms - from) / (to - from);
    let bottom = TOP + ROW * tracks.len().max(1) as f64;
    let legend_rows = phases.len().div_ceil(legend_columns(inner));
    let height = bottom + 34.0 + 18.0 * legend_rows as f64;

    let mut s = String::new();
    let mut line = |text: std::fmt::Arguments<'_>| {
        // Writing to a String cannot fail.
        let _ = writeln!(s, "{text}");
    };
    line(format_args!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
         viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"sans-serif\" font-size=\"12\">"
    ));
    line(format_args!("<rect width=\"100%\" height=\"100%\" fill=\"white\"/>"));
    line(format_args!(
        "<text x=\"{LEFT}\" y=\"18\" font-size=\"14\">{}</text>",
        escaped(&options.title)
    ));

    // Time: a grid at round numbers.
    let step = round_step((to - from) / 8.0);
    let mut tick = (from / step).ceil() * step;
    while tick <= to {
        let at = x(tick);
        line(format_args!(
            "<line x1=\"{at:.2}\" y1=\"{TOP}\" x2=\"{at:.2}\" y2=\"{bottom}\" stroke=\"#ddd\"/>"
        ));
        let decimals = if step < 1.0 { (-step.log10()).ceil() as usize } else { 0 };
        let label = format!("{:.decimals$}", tick + 0.0);
        line(format_args!(
            "<text x=\"{at:.2}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"#555\">{label}</text>",
            bottom + 15.0
        ));
        tick += step;
    }
    line(format_args!(
        "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"#555\">milliseconds</text>",
        LEFT - 8.0,
        bottom + 15.0
    ));

    // Rows.
    for (row, track) in tracks.iter().enumerate() {
        let y = TOP + ROW * row as f64;
        line(format_args!(
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            LEFT - 8.0,
            y + 0.5 * ROW + 4.0,
            escaped(track)
        ));
        line(format_args!(
            "<line x1=\"{LEFT}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke=\"#ccc\"/>",
            y + ROW,
            width - RIGHT,
            y + ROW
        ));
        let mut own: Vec<&Span> = sound
            .iter()
            .copied()
            .filter(|s| s.track == **track && s.end_ms() >= from && s.start_ms <= to)
            .collect();
        own.sort_by(|a, b| a.start_ms.total_cmp(&b.start_ms));
        for b in boxes(&own, x(from), x(to), x) {
            let color =
                COLORS[phases.iter().position(|p| *p == b.phase).unwrap_or(0) % COLORS.len()];
            let text = match b.count {
                1 => format!("{} frame {} {:.3} ms", b.phase, b.frame, b.ms),
                n => format!("{} {n} times, {:.3} ms", b.phase, b.ms),
            };
            line(format_args!(
                "<rect x=\"{:.2}\" y=\"{:.1}\" width=\"{:.2}\" height=\"{BOX}\" \
                 fill=\"{color}\"><title>{}</title></rect>",
                b.left,
                y + 0.5 * (ROW - BOX),
                (b.right - b.left).max(NARROWEST),
                escaped(&text)
            ));
        }
    }
    if sound.is_empty() {
        line(format_args!(
            "<text x=\"{:.1}\" y=\"{:.1}\" fill=\"#555\">nothing was recorded</text>",
            LEFT + 8.0,
            TOP + 20.0
        ));
    }

    // Ends of frames.
    let mut frame = None;
    let mut marks: Vec<f64> = Vec::new();
    for s in sound.iter().filter(|s| s.frame > 0 && tracks.first() == Some(&s.track.as_str())) {
        if frame.is_some_and(|f| f < s.frame) && (from..=to).contains(&s.start_ms) {
            marks.push(s.start_ms);
        }
        frame = frame.max(Some(s.frame));
    }
    // Marks that would make a grey block say nothing.
    if marks.len() < inner as usize / 8 {
        for ms in &marks {
            line(format_args!(
                "<line x1=\"{0:.2}\" y1=\"{TOP}\" x2=\"{0:.2}\" y2=\"{bottom}\" stroke=\"#333\" \
                 stroke-dasharray=\"3 3\"/>",
                x(*ms)
            ));
        }
    }

    // Legend: each phase with its time in the chart.
    for (i, phase) in phases.iter().enumerate() {
        let columns = legend_columns(inner);
        let (left, y) = (
            LEFT + inner / columns as f64 * (i % columns) as f64,
            bottom + 38.0 + 18.0 * (i / columns) as f64,
        );
        let inside = |s: &&&Span| s.phase == **phase && s.end_ms() >= from && s.start_ms <= to;
        // Nothing adds up to -0.0, which nobody wants to read.
        let sum = sound
            .iter()
            .filter(inside)
            .map(|s| s.end_ms().min(to) - s.start_ms.max(from))
            .sum::<f64>()
            + 0.0;
        line(format_args!(
            "<rect x=\"{left:.1}\" y=\"{:.1}\" width=\"11\" height=\"11\" fill=\"{}\"/>",
            y - 10.0,
            COLORS[i % COLORS.len()]
        ));
        line(format_args!(
            "<text x=\"{:.1}\" y=\"{y:.1}\">{} {sum:.1} ms</text>",
            left + 16.0,
            escaped(phase)
        ));
    }
    line(format_args!("</svg>"));
    s
}

struct GanttBox<'a> {
    phase: &'a str,
    frame: u64,
    left: f64,
    right: f64,
    ms: f64,
    count: usize,
}

/// Boxes in pixels; what is too narrow to be seen alone is joined with what follows it closely.
fn boxes<'a>(own: &[&'a Span], least: f64, most: f64, x: impl Fn(f64) -> f64) -> Vec<GanttBox<'a>> {
    let mut out: Vec<GanttBox<'a>> = Vec::new();
    for s in own {
        let (left, right) = (x(s.start_ms).clamp(least, most), x(s.end_ms()).clamp(least, most));
        let narrow = right - left < NARROWEST;
        let last = out
            .iter_mut()
            .rev()
            .take(4)
            .find(|l| narrow && l.phase == s.phase && left - l.right < NARROWEST);
        match last {
            Some(l) => {
                l.right = l.right.max(right);
                l.ms += s.ms;
                l.count += 1;
            }
            None => out.push(GanttBox {
                phase: &s.phase,
                frame: s.frame,
                left,
                right,
                ms: s.ms,
                count: 1,
            }),
        }
    }
    out
}

fn legend_columns(inner: f64) -> usize {
    (inner / 180.0).max(1.0) as usize
}

/// 1, 2 or 5 times a power of ten, not below `v`.
fn round_step(v: f64) -> f64 {
    let power = 10f64.powf(v.log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| *s >= v * 0.999).unwrap_or(power)
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn span(track: &str, phase: &str, frame: u64, start_ms: f64, ms: f64) -> Span {
        Span { track: track.into(), phase: phase.into(), frame, start_ms, ms }
    }

    /// Numbers of an attribute of all elements of a kind, read by an XML parser: the chart must be
    /// well-formed.
    fn attributes(svg: &str, tag: &str, name: &str) -> Vec<f64> {
        let begin = format!("<{tag} ");
        let elements = svg.lines().filter(|l| l.starts_with(&begin));
        elements
            .filter_map(|l| l.split_once(&format!(" {name}=\""))?.1.split('"').next()?.parse().ok())
            .collect()
    }

    #[test]
    fn boxes_lie_where_the_clock_says() {
        let spans = [
            span("program", "capture", 1, 0.0, 25.0),
            span("program", "trace", 1, 25.0, 75.0),
            span("build", "best", 1, 50.0, 50.0),
        ];
        let options = GanttOptions { width: 1126, ..GanttOptions::default() };
        let svg = gantt_svg(&spans, &options);
        // 1000 pixels for 100 ms, from 110 on. The first rectangle is the ground, the last three
        // are the legend.
        let (x, w) = (attributes(&svg, "rect", "x"), attributes(&svg, "rect", "width"));
        assert_eq!(
            (&x[..3], &w[..3]),
            (&[110.0, 360.0, 610.0][..], &[250.0, 750.0, 500.0][..]),
            "{svg}"
        );
        assert!(
            svg.contains("capture 25.0 ms") && svg.contains(">build<") && svg.ends_with("</svg>\n")
        );
    }

    #[test]
    fn many_short_spans_make_a_small_picture_and_lose_no_time() {
        let spans: Vec<Span> = (0..100_000)
            .map(|i| span("program", "trace", i / 10, i as f64 * 0.01, 0.008))
            .collect();
        let svg = gantt_svg(&spans, &GanttOptions::default());
        assert!(svg.len() < 1_000_000, "{} bytes", svg.len());
        assert!(svg.contains("trace 800.0 ms"));
    }

    #[test]
    fn names_cannot_break_the_file_and_nothing_is_a_chart_too() {
        let svg = gantt_svg(
            &[span("a<b", "\"c\"&", 1, 0.0, 1.0), span("x", "y", 1, f64::NAN, 1.0)],
            &GanttOptions { title: "<script>".into(), ..GanttOptions::default() },
        );
        assert!(
            svg.contains("&lt;script&gt;") && svg.contains("a&lt;b") && !svg.contains("<script>")
        );
        assert!(gantt_svg(&[], &GanttOptions::default()).contains("nothing was recorded"));
    }

    #[test]
    fn steps_of_the_grid_are_round() {
        for (v, step) in [(0.13, 0.2), (1.0, 1.0), (3.1, 5.0), (70.0, 100.0)] {
            assert!((round_step(v) - step).abs() < 1e-9 * step, "{v}");
        }
    }
}
