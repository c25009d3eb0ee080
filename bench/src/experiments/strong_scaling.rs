//! Figures 3.7 to 3.10: strong scaling of data-parallel rendering; the same scene is divided into
//! more and more parts.

use super::Context;
use super::many_ranks::{Sharing, cost_columns, frames, powers, with_cost};
use crate::image::save;
use crate::plot::{Axis, Plot, Series};
use crate::record::{Record, RecordImage, Row};
use anyhow::Context as _;
use composite::render::demo::Demo;
use composite::render::{FrameOptions, Partition, Split};
use composite::threads;

/// Figure 3.7: the mixing layer from outside.
pub(super) fn rmo(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    run(context, record, "mixing-layer", "RMO", ["small", "medium"])
}

/// Figure 3.8: the mixing layer from within.
pub(super) fn rmi(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    run(context, record, "mixing-layer", "RMI", ["small", "medium"])
}

/// Figure 3.9: flux ropes, in place of the VPIC simulation.
pub(super) fn vpic(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    run(context, record, "plasma", "whole", ["small", "medium"])
}

/// Figure 3.10: the wavelet.
pub(super) fn wavelet(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    run(context, record, "wavelet", "orbit", ["1M", "4M"])
}

const HEADLIGHT: &str = "headlight";
const NOT_STREAMED: &str = "headlight, not streamed";
const LAMP: &str = "lamp and occlusion";

/// Describes the gain from streaming.
fn streaming(record: &Record) -> String {
    let frame = |light: &str, ranks: f64| {
        let row = record
            .rows
            .iter()
            .find(|r| r.text("light") == Some(light) && r.number("ranks") == Some(ranks))?;
        row.number("frame").zip(row.number("render_max"))
    };
    let ranks: Vec<f64> =
        record.rows.iter().filter_map(|r| r.number("ranks")).filter(|r| *r > 1.0).collect();
    let gains: Vec<String> = ranks
        .iter()
        .enumerate()
        .filter(|(i, r)| !ranks[..*i].contains(r))
        .filter_map(|(_, &r)| {
            let ((streamed, render), (one_by_one, _)) =
                (frame(HEADLIGHT, r)?, frame(NOT_STREAMED, r)?);
            Some(format!("{r:.0} ranks {one_by_one:.1} to {streamed:.1} (render {render:.1})"))
        })
        .collect();
    format!(
        "Messages that travel while rays are traced, and tiles that are collected while others are \
         not finished, take a headlight’s frame, ms: {}.",
        gains.join(", ")
    )
}

fn run(
    context: &mut Context<'_>,
    record: &mut Record,
    data: &str,
    view: &str,
    [small, large]: [&str; 2],
) -> anyhow::Result<()> {
    cost_columns(record);
    record.column(
        "light",
        "",
        "headlight (no ray leaves a hit; not streamed: messages only when all rays are traced), or \
         lamp with shadows and ambient occlusion",
    );
    record.column("speedup", "", "frame time of one rank over that of this many");
    record.column("rounds", "", "rounds of questions between ranks");
    record.column("choice", "", "how light crosses the borders of parts, on rank 0");
    let quick = context.quick;
    let (size, pixels, count) = if quick { (small, 320, 1) } else { (large, 1024, 3) };
    let demo = Demo {
        data: data.into(),
        size: Some(size.into()),
        view: Some(view.into()),
        size_px: [pixels; 2],
        color_by_rank: false,
        ..Demo::default()
    };
    let cases = [(HEADLIGHT, false, true), (NOT_STREAMED, false, false), (LAMP, true, true)];
    for (light, global_light, stream) in cases {
        context.report_step(format!("{data} {size}, {light}: data"))?;
        let demo = Demo { global_light, ..demo.clone() };
        let mut prepared = demo.prepare(1, &mut |_, _| true)?;
        let mut alone = None;
        // Every other number of ranks is enough to show the gain from streaming.
        let some = quick || !stream;
        for ranks in powers(1, 128).filter(|r| !some || matches!(r, 1 | 2 | 8 | 32 | 128)) {
            context.report_step(format!("{data} {size}, {light}: {ranks} ranks"))?;
            prepared.partition = Partition::new(&prepared.scene, ranks, &Split::Triangles);
            let count = if global_light { 1 } else { count };
            let options = FrameOptions { stream, ..FrameOptions::default() };
            let measured = frames(&prepared, ranks, count, Sharing::SortLast, &options)?;
            let cost = measured.median();
            let alone: f64 = *alone.get_or_insert(cost.frame_secs);
            record.rows.push(
                with_cost(Row::new(), ranks, &measured)
                    .with("light", light)
                    .with("speedup", alone / cost.frame_secs)
                    .with("rounds", cost.rounds)
                    .with("choice", measured.last.first().map(|r| r.secondary_rays.clone())),
            );
        }
    }
    context.report_step(format!("{data} {size}: image"))?;
    record.images.push(image(&demo)?);
    record.notes.push(streaming(record));
    let mut plot =
        Plot::lines("Strong scaling", Axis::log("ranks", ""), Axis::log("time of a frame", "ms"));
    for (light, column, name) in [
        (HEADLIGHT, "frame", "frame, headlight"),
        (NOT_STREAMED, "frame", "frame, headlight, not streamed"),
        (HEADLIGHT, "render_max", "slowest rank’s render, headlight"),
        (LAMP, "frame", "frame, lamp and occlusion"),
        (LAMP, "render_max", "slowest rank’s render, lamp and occlusion"),
    ] {
        let of = record.rows.iter().filter(|r| r.text("light") == Some(light));
        plot.series.push(Series::new(
            name,
            of.filter_map(|r| r.number("ranks").zip(r.number(column))).collect(),
        ));
    }
    record.plots.push(plot);
    Ok(())
}

/// The scene in eight parts, each in its own colour.
fn image(demo: &Demo) -> anyhow::Result<RecordImage> {
    const RANKS: usize = 8;
    let demo = Demo { color_by_rank: true, global_light: true, ..demo.clone() };
    let prepared = demo.prepare(RANKS, &mut |_, _| true)?;
    let mut outputs =
        threads::run(RANKS, |mut comm| prepared.run(&mut comm, &FrameOptions::default()));
    let frame = outputs.swap_remove(0)??.frame.context("rank 0 has the image")?;
    Ok(RecordImage {
        name: format!("{}-{}-parts", demo.data, demo.view.unwrap_or_default()),
        caption: format!(
            "{} in {RANKS} parts, a colour for each rank, rendered by {RANKS} ranks: shadows and \
             ambient occlusion cross the borders of parts.",
            demo.data
        ),
        png: save::png_bytes(&frame)?,
    })
}
