//! Figure 4.10: replicated data with image tiles distributed over ranks (section 4.2.3). Compared
//! with the same scene partitioned, and with processes that share the images of an unmodified
//! program ([`super::program_ranks`]).

use super::many_ranks::{Sharing, cost_columns, frames, powers, with_cost};
use super::{Context, program_ranks};
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, Row};
use composite::render::demo::Demo;
use composite::render::{FrameOptions, Partition, Split};

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    cost_columns(record);
    record.column(
        "sharing",
        "",
        "replicated: every rank has the scene; parts: every rank has a \
                                  share of it; gluray: a program and its helpers, which have the \
                                  scene",
    );
    record.column("speedup", "", "frame time of one rank over that of this many, same sharing");
    program_ranks::columns(record);
    record.column("imbalance", "", "slowest rank’s render time over the mean");
    record.notes.push(
        "The wavelet with a lamp’s shadows and ambient occlusion. Replicated data need a whole \
         scene’s memory on every rank, and then no ray leaves \
         its rank; parts need a share of it, and rays travel. That both give the image of one \
         node is for composite's tests, and not looked at here."
            .into(),
    );
    // One frame after the first is enough: a frame takes seconds.
    let (size, pixels, count) = if context.quick { ("1M", 320, 1) } else { ("4M", 1024, 1) };
    let demo = Demo {
        size: Some(size.into()),
        size_px: [pixels; 2],
        color_by_rank: false,
        ..Demo::default()
    };
    context.report_step("data")?;
    let mut prepared = demo.prepare(1, &mut |_, _| true)?;
    let quick = context.quick;
    for (name, sharing) in [("replicated", Sharing::RayParallel), ("parts", Sharing::SortLast)] {
        let mut alone = None;
        for ranks in powers(1, 128).filter(|r| !quick || matches!(r, 1 | 4 | 16 | 64 | 128)) {
            context.report_step(format!("{name}, {ranks} ranks"))?;
            if matches!(sharing, Sharing::SortLast) {
                prepared.partition = Partition::new(&prepared.scene, ranks, &Split::Triangles);
            }
            let measured = frames(&prepared, ranks, count, sharing, &FrameOptions::default())?;
            let cost = measured.median();
            let alone: f64 = *alone.get_or_insert(cost.frame_secs);
            record.rows.push(
                with_cost(Row::new(), ranks, &measured)
                    .with("sharing", name)
                    .with("speedup", alone / cost.frame_secs)
                    .with("imbalance", cost.render_max_secs / cost.render_mean_secs),
            );
        }
    }
    program_ranks::run(context, record)?;
    let mut plot =
        Plot::lines("Sharing", Axis::log("ranks", ""), Axis::log("time of a frame", "ms"));
    for name in ["replicated", "parts"].into_iter().chain(program_ranks::SHARING) {
        for (column, of_what) in [("frame", ""), ("render_max", ", slowest rank’s render")] {
            let of = record.rows.iter().filter(|r| r.text("sharing") == Some(name));
            let points = of.filter_map(|r| r.number("ranks").zip(r.number(column))).collect();
            plot.series.push(Series::new(format!("{name}{of_what}"), points));
        }
    }
    record.plots.push(plot);
    Ok(())
}
