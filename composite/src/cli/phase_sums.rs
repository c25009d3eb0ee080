//! A Gantt chart and a table, with IceT's columns, of what each rank did in a frame.
use super::gantt::{Bar, Chart};
use super::rank_records::RankTimes;
use std::fmt::Write as _;

/// Name, colour, and seconds of a rank.
type Phase = (&'static str, &'static str, fn(&RankTimes) -> f64);

/// The phases in the order in which they begin, in the colour-blind-safe colours of Okabe and Ito.
const PHASES: [Phase; 5] = [
    ("render", "#009e73", |line| line.render_secs),
    ("compress", "#56b4e9", |line| line.compress_secs),
    ("send", "#e69f00", |line| line.send_secs),
    ("blend", "#0072b2", |line| line.blend_secs),
    ("collect", "#cc79a7", |line| line.collect_secs),
];

/// One bar for each rank and phase. Phases of a frame alternate many times; the bars show their
/// sums, one after the other.
pub(super) fn svg(title: &str, lines: &[RankTimes]) -> String {
    let longest = lines.iter().map(|line| line.total_secs).fold(1e-9, f64::max);
    let step = nice_step(1e3 * longest / 6.0);
    let end_ms = (1e3 * longest / step).ceil() * step;
    let mut ticks = Vec::new();
    let mut tick = 0.0;
    while tick <= end_ms * 1.0001 {
        ticks.push((tick, trim(tick)));
        tick += step;
    }
    let row = |line: &RankTimes| {
        let mut begin_ms = 0.0;
        let bars = PHASES.map(|(name, color, secs)| {
            let bar = Bar { name, color, begin_ms, ms: 1e3 * secs(line) };
            begin_ms += bar.ms;
            bar
        });
        (line.rank, bars.into())
    };
    let chart = Chart {
        title,
        legend: &PHASES.map(|(name, color, _)| (name, color)),
        rows: lines.iter().map(row).collect(),
        end_ms,
        ticks,
        tick_color: "#dddddd",
        note: Some("ms since the frame began; sums of each phase, one after the other"),
        axis_px: 760.0,
        margin_px: 30.0,
    };
    chart.svg()
}

/// The same sums as a table.
pub(super) fn table(lines: &[RankTimes]) -> String {
    let mut text = format!(
        "{:>4} {:>10} {:>12} {:>9} {:>8} {:>11} {:>9} {:>12}",
        "rank",
        "render ms",
        "compress ms",
        "blend ms",
        "send ms",
        "collect ms",
        "total ms",
        "bytes sent"
    );
    for line in lines {
        let _ = write!(
            text,
            "\n{:>4} {:>10.3} {:>12.3} {:>9.3} {:>8.3} {:>11.3} {:>9.3} {:>12}",
            line.rank,
            1e3 * line.render_secs,
            1e3 * line.compress_secs,
            1e3 * line.blend_secs,
            1e3 * line.send_secs,
            1e3 * line.collect_secs,
            1e3 * line.total_secs,
            line.bytes_sent
        );
    }
    text
}

/// The smallest of 1, 2 and 5 times a power of ten that is not below `at_least`.
fn nice_step(at_least: f64) -> f64 {
    let power = 10_f64.powf(at_least.log10().floor());
    [1.0, 2.0, 5.0].iter().map(|m| m * power).find(|step| *step >= at_least).unwrap_or(10.0 * power)
}

fn trim(number: f64) -> String {
    let text = format!("{number:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(rank: usize) -> RankTimes {
        RankTimes {
            rank,
            render_secs: 0.004,
            compress_secs: 0.001,
            blend_secs: 0.002,
            send_secs: 0.0005,
            collect_secs: 0.0,
            total_secs: 0.0075,
            bytes_sent: 1234,
        }
    }

    #[test]
    fn bars_are_as_long_as_their_phases() {
        let text = svg("a frame", &[line(0), line(1)]);
        // 4 ms on an axis of 8 ms.
        assert!(text.contains("width=\"380.00\""), "{text}");
        assert_eq!(text.matches("rank 1: ").count(), PHASES.len());
    }

    #[test]
    fn steps_of_the_axis_are_round() {
        assert_eq!([0.9, 1.1, 3.0, 70.0].map(nice_step), [1.0, 2.0, 5.0, 100.0]);
    }
}
