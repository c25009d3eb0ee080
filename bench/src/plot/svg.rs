//! Draws a plot as SVG: frame, grid, data, legend.

use super::scale::{Mapping, label};
use super::{Kind, Plot, Series};
use std::fmt::Write as _;

const WIDTH: f64 = 720.0;
const LEFT: f64 = 78.0;
const RIGHT: f64 = 16.0;
const TOP: f64 = 34.0;
const INNER_HEIGHT: f64 = 270.0;
const LEGEND_LINE: f64 = 18.0;
/// Width of a character relative to the font size, for placing legends; an upper estimate for
/// sans-serif fonts.
const CHARACTER: f64 = 0.58;

/// Okabe and Ito's palette, distinguishable with any colour vision; without yellow, which is
/// invisible on white.
const COLORS: [&str; 7] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#777777"];
const DASHES: [&str; 4] = ["", "7 3", "2 3", "9 3 2 3"];

pub(super) fn draw(plot: &Plot) -> String {
    let bottom_labels = if plot.kind == Kind::Bars { bar_label_height(plot) } else { 20.0 };
    let axis_caption = if plot.x.caption().is_empty() { 0.0 } else { 20.0 };
    let (bottom, right) = (TOP + INNER_HEIGHT, WIDTH - RIGHT);
    let legend_top = bottom + bottom_labels + axis_caption + 14.0;
    let legend = legend_places(plot, legend_top);
    let height = legend.last().map_or(legend_top, |&(_, y)| y + LEGEND_LINE);

    let mut s = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height:.0}\" \
         width=\"{WIDTH}\" \
         height=\"{height:.0}\" role=\"img\" font-family=\"sans-serif\" font-size=\"12\" \
         fill=\"currentColor\">"
    );
    let title = escape(&plot.title);
    write(&mut s, format_args!("<title>{title}</title>"));
    text(&mut s, LEFT, 18.0, "start", "font-weight=\"bold\"", &plot.title);

    // Axes, grid and their labels.
    let points = || plot.series.iter().flat_map(|s| s.points.iter());
    let ys =
        points().flat_map(|p| [Some(p.y), p.range.map(|r| r.0), p.range.map(|r| r.1)]).flatten();
    let zero = plot.kind == Kind::Bars;
    let y = Mapping::covering(ys, plot.y.scale, zero, bottom, TOP);
    for t in y.ticks() {
        let Some(at) = y.at(t) else { continue };
        write(
            &mut s,
            format_args!(
                "<path d=\"M{LEFT} {at:.1}H{right}\" stroke=\"currentColor\" opacity=\"0.15\"/>"
            ),
        );
        text(&mut s, LEFT - 6.0, at + 4.0, "end", "", &label(t));
    }
    let middle = (TOP + bottom) / 2.0;
    let line_across = plot.mark.and_then(|m| y.at(m)).filter(|at| (TOP..=bottom).contains(at));
    let turn = format!("transform=\"rotate(-90 16 {middle:.0})\"");
    text(&mut s, 16.0, middle, "middle", &turn, &plot.y.caption());
    let frame = format_args!(
        "<rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{}\" height=\"{INNER_HEIGHT}\" fill=\"none\" \
         stroke=\"currentColor\" opacity=\"0.5\"/>",
        right - LEFT
    );
    write(&mut s, frame);

    match plot.kind {
        Kind::Lines => {
            let x = Mapping::covering(points().map(|p| p.x), plot.x.scale, false, LEFT, right);
            for t in x.ticks() {
                let Some(at) = x.at(t) else { continue };
                write(
                    &mut s,
                    format_args!(
                        "<path d=\"M{at:.1} {TOP}V{bottom}\" stroke=\"currentColor\" \
                         opacity=\"0.15\"/>"
                    ),
                );
                text(&mut s, at, bottom + 16.0, "middle", "", &label(t));
            }
            for (i, series) in plot.series.iter().enumerate() {
                line(&mut s, series, i, &x, &y);
            }
        }
        Kind::Bars => bars(&mut s, plot, &y, right, bottom),
    }
    if let Some(at) = line_across {
        let line = format!(
            "<path d=\"M{LEFT} {at:.1}H{right}\" stroke=\"currentColor\" stroke-dasharray=\"5 4\"/>"
        );
        s.push_str(&line);
    }
    let caption_y = bottom + bottom_labels + 14.0;
    text(&mut s, (LEFT + right) / 2.0, caption_y, "middle", "", &plot.x.caption());

    for (i, &(lx, ly)) in legend.iter().enumerate() {
        match plot.kind {
            Kind::Lines => {
                write(&mut s, format_args!("<path d=\"M{lx:.1} {ly:.1}h26\" {}/>", stroke(i)));
                mark(&mut s, i, lx + 13.0, ly);
            }
            Kind::Bars => {
                let (color, opacity) = fill(i);
                write(
                    &mut s,
                    format_args!(
                        "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"14\" height=\"10\" fill=\"{color}\" \
                         fill-opacity=\"{opacity}\"/>",
                        lx + 6.0,
                        ly - 5.0
                    ),
                );
            }
        }
        text(&mut s, lx + 32.0, ly + 4.0, "start", "", &plot.series[i].name);
    }
    s + "</svg>"
}

fn line(s: &mut String, series: &Series, i: usize, x: &Mapping, y: &Mapping) {
    let color = COLORS[i % COLORS.len()];
    let mut path = String::new();
    let mut pen_down = false;
    for p in &series.points {
        // A point that the axes cannot show interrupts the line.
        let (Some(px), Some(py)) = (x.at(p.x), y.at(p.y)) else {
            pen_down = false;
            continue;
        };
        write(&mut path, format_args!("{}{px:.1} {py:.1}", if pen_down { "L" } else { "M" }));
        pen_down = true;
    }
    if !path.is_empty() {
        write(s, format_args!("<path d=\"{path}\" {}/>", stroke(i)));
    }
    for p in &series.points {
        let (Some(px), Some(py)) = (x.at(p.x), y.at(p.y)) else { continue };
        if let Some((low, high)) = p.range
            && let (Some(a), Some(b)) = (y.at(low), y.at(high))
        {
            let whisker = format!("M{px:.1} {a:.1}V{b:.1}m-3 0h6M{:.1} {a:.1}h6", px - 3.0);
            write(s, format_args!("<path d=\"{whisker}\" stroke=\"{color}\" fill=\"none\"/>"));
        }
        mark(s, i, px, py);
    }
}

fn bars(s: &mut String, plot: &Plot, y: &Mapping, right: f64, bottom: f64) {
    let slot = (right - LEFT) / plot.categories.len().max(1) as f64;
    let width = (slot * 0.8 / plot.series.len().max(1) as f64).min(60.0);
    let base = y.base();
    for (i, series) in plot.series.iter().enumerate() {
        let (color, opacity) = fill(i);
        for p in &series.points {
            let Some(top) = y.at(p.y) else { continue };
            let center = LEFT + slot * (p.x + 0.5);
            let left = center + width * (i as f64 - plot.series.len() as f64 / 2.0);
            write(
                s,
                format_args!(
                    "<rect x=\"{left:.1}\" y=\"{:.1}\" width=\"{width:.1}\" height=\"{:.1}\" \
                     fill=\"{color}\" \
                     fill-opacity=\"{opacity}\"><title>{}: {}</title></rect>",
                    top.min(base),
                    (top - base).abs(),
                    escape(&series.name),
                    label(p.y)
                ),
            );
            if let Some((low, high)) = p.range
                && let (Some(a), Some(b)) = (y.at(low), y.at(high))
            {
                let x = left + width / 2.0;
                write(
                    s,
                    format_args!(
                        "<path d=\"M{x:.1} {a:.1}V{b:.1}\" stroke=\"currentColor\" fill=\"none\"/>"
                    ),
                );
            }
        }
    }
    let turned = labels_turned(plot);
    for (k, name) in plot.categories.iter().enumerate() {
        let (x, top) = (LEFT + slot * (k as f64 + 0.5), bottom + 16.0);
        if turned {
            text(s, x, top, "end", &format!("transform=\"rotate(-35 {x:.1} {top:.1})\""), name);
        } else {
            text(s, x, top, "middle", "", name);
        }
    }
}

/// Whether the names are rotated because they do not fit side by side.
fn labels_turned(plot: &Plot) -> bool {
    let slot = (WIDTH - LEFT - RIGHT) / plot.categories.len().max(1) as f64;
    plot.categories.iter().any(|c| c.chars().count() as f64 * 12.0 * CHARACTER > slot)
}

fn bar_label_height(plot: &Plot) -> f64 {
    let longest = plot.categories.iter().map(|c| c.chars().count()).max().unwrap_or(0) as f64;
    if labels_turned(plot) {
        20.0 + longest * 12.0 * CHARACTER * 35f64.to_radians().sin()
    } else {
        20.0
    }
}

/// Position of each series' legend entry, filled row by row.
fn legend_places(plot: &Plot, top: f64) -> Vec<(f64, f64)> {
    let (mut x, mut y) = (LEFT, top);
    let mut places = vec![];
    for s in &plot.series {
        let width = 32.0 + s.name.chars().count() as f64 * 12.0 * CHARACTER + 18.0;
        if x > LEFT && x + width > WIDTH - RIGHT {
            (x, y) = (LEFT, y + LEGEND_LINE);
        }
        places.push((x, y));
        x += width;
    }
    places
}

fn stroke(i: usize) -> String {
    let dash = DASHES[i / COLORS.len() % DASHES.len()];
    let color = COLORS[i % COLORS.len()];
    format!("fill=\"none\" stroke=\"{color}\" stroke-width=\"1.8\" stroke-dasharray=\"{dash}\"")
}

fn fill(i: usize) -> (&'static str, f64) {
    (COLORS[i % COLORS.len()], if (i / COLORS.len()).is_multiple_of(2) { 0.9 } else { 0.45 })
}

/// Draws a marker with a different shape for each series.
fn mark(s: &mut String, i: usize, x: f64, y: f64) {
    let color = COLORS[i % COLORS.len()];
    let d = match i % 5 {
        0 => format!("M{:.1} {y:.1}a3.5 3.5 0 1 0 7 0a3.5 3.5 0 1 0 -7 0", x - 3.5),
        1 => format!("M{:.1} {:.1}h6.4v6.4h-6.4z", x - 3.2, y - 3.2),
        2 => format!("M{x:.1} {:.1}l4 7h-8z", y - 4.0),
        3 => format!("M{x:.1} {:.1}l4.2 4.2l-4.2 4.2l-4.2 -4.2z", y - 4.2),
        _ => format!("M{x:.1} {:.1}l4 -7h-8z", y + 4.0),
    };
    write(s, format_args!("<path d=\"{d}\" fill=\"{color}\"/>"));
}

fn text(s: &mut String, x: f64, y: f64, anchor: &str, attributes: &str, content: &str) {
    if !content.is_empty() {
        write(
            s,
            format_args!(
                "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" {attributes}>{}</text>",
                escape(content)
            ),
        );
    }
}

fn write(s: &mut String, args: std::fmt::Arguments<'_>) {
    // Writing to a String cannot fail.
    s.write_fmt(args).ok();
}

/// Text for use inside XML and HTML. Characters that XML forbids become U+FFFD.
pub(crate) fn escape(text: &str) -> String {
    let mut s = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => s += "&amp;",
            '<' => s += "&lt;",
            '>' => s += "&gt;",
            '"' => s += "&quot;",
            '\'' => s += "&#39;",
            '\n' | '\t' | '\r' => s.push(c),
            c if (c as u32) < 32 => s.push('\u{fffd}'),
            c => s.push(c),
        }
    }
    s
}

#[cfg(test)]
mod tests {
    use super::super::{Axis, Point};
    use super::*;

    /// Parses the text as XML, to check that it is well-formed, and returns the number of elements
    /// with a name.
    fn count(svg: &str, element: &str) -> usize {
        let doc = roxmltree::Document::parse(svg).unwrap_or_else(|e| panic!("{e}\n{svg}"));
        doc.descendants()
            .filter(|n| n.has_tag_name(("http://www.w3.org/2000/svg", element)))
            .count()
    }

    fn no_number_is_nan(svg: &str) {
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    }

    #[test]
    fn lines_with_hostile_names_and_values_are_well_formed() {
        let mut p = Plot::lines("a < b & \"c\"", Axis::log("n>1", ""), Axis::log("time", "s"));
        let points =
            [(1.0, 1.0), (10.0, f64::NAN), (0.0, 3.0), (1e9, f64::INFINITY), (100.0, 2e-9)];
        p.series.push(Series::new("fast & <loose>\u{1}", points.to_vec()));
        p.series.push(Series {
            name: "spread".into(),
            points: vec![Point { x: 5.0, y: 2.0, range: Some((1.0, 4.0)) }],
        });
        let svg = p.to_svg();
        no_number_is_nan(&svg);
        assert!(count(&svg, "path") > 10);
        let doc = roxmltree::Document::parse(&svg).unwrap();
        let texts: Vec<&str> = doc.descendants().filter_map(|n| n.text()).collect();
        assert!(texts.contains(&"time [s]") && texts.contains(&"a < b & \"c\""), "{texts:?}");
    }

    #[test]
    fn every_bar_is_drawn_inside_the_frame() {
        let names: Vec<String> = (0..5).map(|i| format!("category with a long name {i}")).collect();
        let mut p = Plot::bars("ratios", Axis::linear("ratio", ""), names);
        for k in 0..9 {
            p.series.push(Series::new(
                format!("s{k}"),
                (0..5).map(|i| (i as f64, 0.2 + (i * k) as f64)).collect(),
            ));
        }
        let svg = p.to_svg();
        no_number_is_nan(&svg);
        // 45 bars, 9 legend entries, 1 frame.
        assert_eq!(count(&svg, "rect"), 45 + 9 + 1);
        let doc = roxmltree::Document::parse(&svg).unwrap();
        for r in doc.descendants().filter(|n| n.tag_name().name() == "rect") {
            let v = |a: &str| r.attribute(a).unwrap().parse::<f64>().unwrap();
            assert!(v("x") >= LEFT - 0.1 && v("x") + v("width") <= WIDTH - RIGHT + 0.1);
            assert!(v("height") >= 0.0);
        }
    }

    #[test]
    fn empty_plots_are_valid_svg() {
        for p in [
            Plot::lines("", Axis::linear("", ""), Axis::log("y", "")),
            Plot::bars("nothing", Axis::log("y", "s"), vec![]),
        ] {
            let svg = p.to_svg();
            no_number_is_nan(&svg);
            assert!(count(&svg, "svg") == 1);
        }
    }

    #[test]
    fn a_mark_is_drawn_inside_the_frame_only() {
        let mut p = Plot::bars("ratios", Axis::linear("ratio", ""), vec!["a".into()]);
        p.series.push(Series::new("s", vec![(0.0, 2.0)]));
        let without = count(&p.to_svg(), "path");
        p.mark = Some(1.0);
        assert_eq!(count(&p.to_svg(), "path"), without + 1);
        p.mark = Some(50.0);
        assert_eq!(count(&p.to_svg(), "path"), without);
    }

    #[test]
    fn the_same_plot_is_drawn_the_same_every_time() {
        let mut p = Plot::lines("t", Axis::linear("x", "m"), Axis::linear("y", "s"));
        p.series.push(Series::new("a", vec![(0.0, 1.0), (1.0, 3.0)]));
        assert_eq!(p.to_svg(), p.to_svg());
    }
}
