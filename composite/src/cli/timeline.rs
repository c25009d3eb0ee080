//! What each rank of a data-parallel frame did when: a Gantt chart and a table.
use super::gantt::{Bar, Chart};
use super::rank_records::RankRecord;
use crate::render::Activity;
use std::fmt::Write as _;

/// Colour-blind-safe colours of Okabe and Ito, in the order of [`Activity::ALL`].
const COLORS: [&str; 6] = ["#009e73", "#0072b2", "#f0e442", "#56b4e9", "#dddddd", "#cc79a7"];

/// A row for each rank, a bar for each span.
pub(super) fn svg(title: &str, lines: &[RankRecord]) -> String {
    let longest_ms = lines.iter().map(|line| line.total_ms).fold(1e-6, f64::max);
    let legend: Vec<_> = Activity::ALL.iter().map(|a| a.name()).zip(COLORS).collect();
    let row = |line: &RankRecord| {
        let bar = |&(activity, begin_ms, end_ms): &(usize, f64, f64)| Bar {
            name: Activity::ALL.get(activity).map_or("", |a| a.name()),
            color: COLORS.get(activity).unwrap_or(&"black"),
            begin_ms,
            ms: end_ms - begin_ms,
        };
        (line.rank, line.spans.iter().map(bar).collect())
    };
    let tick = |k: u32| {
        let ms = longest_ms * f64::from(k) / 4.0;
        (ms, format!("{ms:.2}{}", if k == 4 { " ms" } else { "" }))
    };
    let chart = Chart {
        title,
        legend: &legend,
        rows: lines.iter().map(row).collect(),
        end_ms: longest_ms,
        ticks: (0..=4).map(tick).collect(),
        tick_color: "#bbbbbb",
        note: None,
        axis_px: 860.0,
        margin_px: 40.0,
    };
    chart.svg()
}

/// A line for each rank, milliseconds.
pub(super) fn table(lines: &[RankRecord]) -> String {
    let values = lines.iter().any(|l| l.values > 0);
    let mut text = format!("{:>5} {:>10}", "rank", if values { "values" } else { "triangles" });
    for activity in Activity::ALL {
        let _ = write!(text, " {:>9}", activity.name());
    }
    let _ = write!(
        text,
        " {:>9} {:>7} {:>11} {:>11} {:>12} {:>14}",
        "total ms", "rounds", "camera rays", "rays sent", "bytes sent", "bytes received"
    );
    for l in lines {
        let _ = write!(text, "\n{:>5} {:>10}", l.rank, if values { l.values } else { l.triangles });
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
        let _ = write!(
            text,
            " {:>7} {:>11} {:>11} {:>12} {:>14}",
            l.rounds, l.camera_rays, l.rays_sent, l.bytes_sent, l.bytes_received
        );
    }
    text
}
