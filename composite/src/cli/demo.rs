//! `composite demo`: renders a data set in parts ([`demo_data`]) or composites synthetic frames,
//! with a plot of each rank's activities over time.
use super::demo_args::DemoArgs;
use super::rank_records::RankTimes;
use super::ranks::RankComm;
use super::{demo_data, phase_sums};
use crate::compositor::{Compositor, Options};
use crate::frame::Frame;
use crate::pixel::DepthPixel;
use crate::report::Report;
use crate::workload::{SyntheticFrame, Workload};
use anyhow::Context as _;
use datasets::cli::{CommonArgs, CureExt as _, Status, UsageError};
use datasets::image_io::{LayeredImage, PngDepth, write_png};
use serde::Serialize;
use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Duration;

#[derive(Debug, Serialize)]
struct DemoReport {
    transport: String,
    scene: &'static str,
    size_px: u32,
    frame_ms: f64,
    picture: PathBuf,
    plot: PathBuf,
    ranks: Vec<RankTimes>,
}

/// The last frame, on rank 0.
type FinishedDemo = (String, f64, Vec<[u8; 4]>, Vec<RankTimes>);

pub(super) fn demo(
    common: CommonArgs,
    args: &DemoArgs,
    arguments: &[OsString],
) -> anyhow::Result<Status> {
    if args.size == 0 || args.size > 32_768 || args.frames == 0 {
        return Err(UsageError(
            "give a size of 1 to 32768 pixels and at least one frame".to_string(),
        )
        .into());
    }
    // Before anything is rendered, so that a folder that cannot be made is reported now.
    if !args.ranks.is_rank() {
        args.output_files().cure("name another in --out or --output")?;
    }
    let Some(scene) = args.scene else {
        return demo_data::demo(common, args, arguments);
    };
    args.ranks.run(
        common,
        arguments,
        |comm| frames(comm, args, scene),
        |(transport, frame_secs, colors, lines): FinishedDemo| {
            let [picture, plot] = args.output_files()?;
            write_image(&picture, args.size, &colors)?;
            let title = format!(
                "{} ranks over {transport}, {}x{} {}: {:.2} ms",
                lines.len(),
                args.size,
                args.size,
                scene,
                1e3 * frame_secs
            );
            std::fs::write(&plot, phase_sums::svg(&title, &lines))
                .with_context(|| plot.display().to_string())?;
            let shown = DemoReport {
                transport,
                scene: scene.name(),
                size_px: args.size,
                frame_ms: 1e3 * frame_secs,
                picture,
                plot,
                ranks: lines,
            };
            common.result(&shown, || {
                format!(
                    "{title}\n{}\nimage: {}\nplot:  {}",
                    phase_sums::table(&shown.ranks),
                    shown.picture.display(),
                    shown.plot.display()
                )
            })?;
            Ok(Status::Success)
        },
    )
}

/// Colours are taken as linear light; pixels that nobody drew stay transparent.
fn write_image(path: &std::path::Path, size: u32, colors: &[[u8; 4]]) -> anyhow::Result<()> {
    let linear: Vec<[f32; 4]> =
        colors.iter().map(|c| c.map(|channel| f32::from(channel) / 255.0)).collect();
    let mut image = LayeredImage::new(size, size);
    image.add_rgba(&linear)?;
    write_png(path, &image, PngDepth::Eight)?;
    Ok(())
}

fn frames(comm: &mut RankComm, args: &DemoArgs, scene: Workload) -> anyhow::Result<FinishedDemo> {
    let timeout: Duration = args.ranks.timeout();
    let transport = comm.transport();
    let comm = comm.comm();
    let (rank, ranks) = (comm.rank(), comm.size());
    let mut compositor = Compositor::<DepthPixel<[u8; 4]>>::new(Options {
        depth: false,
        timeout,
        ..Options::default()
    });
    let mut drawn = SyntheticFrame::new(args.size, args.size);
    let mut colors = Vec::new();
    let mut line = RankTimes::new(rank, 0.0, &Report::default());
    let mut frame_secs = 0.0;
    for moment in 0..args.frames {
        comm.barrier(timeout)?;
        let begin = comm.now();
        scene.draw(moment, rank, ranks, &mut drawn);
        let render_secs = comm.now() - begin;
        let frame = Frame::with_depth(args.size, args.size, &drawn.colors, &drawn.depths)?;
        let done = compositor.composite(comm, &frame.with_bounds(drawn.bounds)?)?;
        frame_secs = comm.now() - begin;
        line = RankTimes::new(rank, render_secs, &done.report);
        if let Some(image) = done.image {
            colors = image.colors().to_vec();
            compositor.recycle(image);
        }
    }
    let all = comm.all_gather(&line.to_bytes(), RankTimes::BYTES, timeout)?;
    let lines = all
        .iter()
        .enumerate()
        .filter_map(|(rank, bytes)| RankTimes::from_bytes(rank, bytes))
        .collect();
    Ok((transport, frame_secs, colors, lines))
}
