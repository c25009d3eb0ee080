//! Compares partitions of equal triangle count with partitions of equal expected work for the view
//! (sections 3.2.1 and 3.2.2).

use super::Context;
use super::many_ranks::{Sharing, cost_columns, frames, powers, with_cost};
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use composite::render::demo::Demo;
use composite::render::{FrameOptions, Partition, Split};

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    cost_columns(record);
    record.column("view", "", "data set and view");
    record.column(
        "partition",
        "",
        "triangles: the same number for each rank; view: the same expected work in this image",
    );
    record.column("imbalance", "", "slowest rank’s render time over the mean");
    record.column("most_triangles", "", "triangles of the rank that has most");
    record.notes.push(
        "A partition for the view must be made anew for every view: that cost is not in these \
         times."
            .into(),
    );
    let quick = context.quick;
    let (pixels, count) = if quick { (320, 1) } else { (1024, 3) };
    let cases = [
        ("mixing-layer", "RMI", if quick { "small" } else { "medium" }),
        ("wavelet", "close", if quick { "1M" } else { "4M" }),
        ("wavelet", "orbit", if quick { "1M" } else { "4M" }),
    ];
    for (data, view, size) in cases {
        let demo = Demo {
            data: data.into(),
            size: Some(size.into()),
            view: Some(view.into()),
            size_px: [pixels; 2],
            global_light: false,
            color_by_rank: false,
            ..Demo::default()
        };
        context.report_step(format!("{data} {view}: data"))?;
        let mut prepared = demo.prepare(1, &mut |_, _| true)?;
        for ranks in powers(4, 64).filter(|r| !quick || matches!(r, 8 | 64)) {
            let by_view = Split::View { camera: Box::new(prepared.camera), size_px: [pixels; 2] };
            for (name, split) in [("triangles", Split::Triangles), ("view", by_view)] {
                context.report_step(format!("{data} {view}: {ranks} ranks by {name}"))?;
                prepared.partition = Partition::new(&prepared.scene, ranks, &split);
                let measured =
                    frames(&prepared, ranks, count, Sharing::SortLast, &FrameOptions::default())?;
                let cost = measured.median();
                record.rows.push(
                    with_cost(Row::new(), ranks, &measured)
                        .with("view", format!("{data} {view}"))
                        .with("partition", name)
                        .with("imbalance", cost.render_max_secs / cost.render_mean_secs)
                        .with(
                            "most_triangles",
                            prepared.partition.sizes().into_iter().max().unwrap_or(0),
                        ),
                );
            }
        }
    }
    record.notes.push(describe(&record.rows));
    let mut plot =
        Plot::lines("Partitions", Axis::log("ranks", ""), Axis::log("slowest rank’s render", "ms"));
    for (data, view, _) in cases {
        for name in ["triangles", "view"] {
            let view = format!("{data} {view}");
            let of = record.rows.iter().filter(|r| {
                r.text("view") == Some(view.as_str()) && r.text("partition") == Some(name)
            });
            let points = of.filter_map(|r| r.number("ranks").zip(r.number("render_max"))).collect();
            plot.series.push(Series::new(format!("{view}, by {name}"), points));
        }
    }
    record.plots.push(plot);
    Ok(())
}

/// Describes, view by view, the ratio of the slowest rank's times: parts of equal triangle count
/// over parts of equal work.
fn describe(rows: &[Row]) -> String {
    let mut views: Vec<&str> = rows.iter().filter_map(|r| r.text("view")).collect();
    views.dedup();
    let most = rows.iter().filter_map(|r| r.number("ranks")).fold(0.0, f64::max);
    let slowest = |view: &str, partition: &str| {
        let here = |r: &&Row| {
            r.text("view") == Some(view)
                && r.text("partition") == Some(partition)
                && r.number("ranks") == Some(most)
        };
        rows.iter().find(here).and_then(|r| r.number("render_max"))
    };
    let each: Vec<String> = views
        .iter()
        .filter_map(|v| Some(format!("{v} {:.2}", slowest(v, "triangles")? / slowest(v, "view")?)))
        .collect();
    format!(
        "On {most:.0} ranks the slowest rank's render time with parts of as many triangles, by \
         that with parts of as much work, was: {}. Above 1 the \
         partition for the view has gained.",
        each.join(", ")
    )
}
