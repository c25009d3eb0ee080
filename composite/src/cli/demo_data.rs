//! `composite demo` of a data set: generates it, cuts it into parts, and renders it on all ranks.
use super::demo_args::DemoArgs;
use super::rank_records::RankRecord;
use super::ranks::RankComm;
use super::timeline;
use crate::render::demo::{Demo, PreparedDemo};
use crate::render::{DataParallel, FrameOptions, RankReport, SecondaryRayPolicy};
use anyhow::Context as _;
use datasets::cli::{CommonArgs, Status, UsageError};
use datasets::image_io::{LayeredImage, PngDepth, write_png};
use rt_core::bvh::BuildOptions;
use serde::Serialize;
use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

#[derive(Debug, Serialize)]
struct DemoReport {
    transport: String,
    data: String,
    size_px: u32,
    frame_ms: f64,
    light: String,
    /// Primitives that cannot be hit: with NaN, infinite or absurd corners.
    unusable: usize,
    picture: PathBuf,
    plot: PathBuf,
    ranks: Vec<RankRecord>,
}

/// The last frame, on rank 0.
struct FinishedDemo {
    transport: String,
    light: String,
    unusable: usize,
    colors: Vec<[f32; 4]>,
    lines: Vec<RankRecord>,
}

pub(super) fn demo(
    common: CommonArgs,
    args: &DemoArgs,
    arguments: &[OsString],
) -> anyhow::Result<Status> {
    let wanted = Demo {
        data: args.data.clone(),
        size: args.data_size.clone(),
        view: args.view.clone(),
        size_px: [args.size; 2],
        global_light: !args.headlight,
        color_by_rank: !args.grey,
        cut_by_view: args.cut_by_view,
        ..Demo::default()
    };
    // Ranks that are threads share the data made before the frame.
    let shared: Mutex<Option<Arc<PreparedDemo>>> = Mutex::new(None);
    args.ranks.run(
        common,
        arguments,
        |comm| {
            let ranks = comm.comm().size();
            let prepared = {
                let mut shared = shared.lock().unwrap_or_else(PoisonError::into_inner);
                match &*shared {
                    Some(prepared) => prepared.clone(),
                    None => {
                        let prepared = wanted.prepare(ranks, &mut |_, _| true);
                        let prepared = Arc::new(prepared.map_err(|e| match e {
                            crate::render::demo::DemoError::Frame(e) => anyhow::Error::new(e),
                            e => UsageError(e.to_string()).into(),
                        })?);
                        shared.insert(prepared).clone()
                    }
                }
            };
            frames(comm, args, &prepared)
        },
        |f: FinishedDemo| finish(common, args, f),
    )
}

fn finish(common: CommonArgs, args: &DemoArgs, f: FinishedDemo) -> anyhow::Result<Status> {
    std::fs::create_dir_all(&args.out).with_context(|| args.out.display().to_string())?;
    let (picture, plot) =
        (args.out.join("composite_demo.png"), args.out.join("composite_demo.svg"));
    let mut png = LayeredImage::new(args.size, args.size);
    png.add_rgba(&f.colors)?;
    write_png(&picture, &png, PngDepth::Eight)?;
    let frame_ms = f.lines.iter().map(|l| l.total_ms).fold(0.0, f64::max);
    let title = format!(
        "{} in {} parts over {}, {}x{}: {frame_ms:.2} ms",
        args.data,
        f.lines.len(),
        f.transport,
        args.size,
        args.size
    );
    std::fs::write(&plot, timeline::svg(&title, &f.lines))
        .with_context(|| plot.display().to_string())?;
    let shown = DemoReport {
        transport: f.transport,
        data: args.data.clone(),
        size_px: args.size,
        frame_ms,
        light: f.light,
        unusable: f.unusable,
        picture,
        plot,
        ranks: f.lines,
    };
    common.result(&shown, || {
        format!(
            "{title}\nlight: {}\n{}{}\nimage: {}\nplot:  {}",
            shown.light,
            match shown.unusable {
                0 => String::new(),
                n => format!(
                    "left out: {n} primitives with invalid corners (NaN, infinite, too \
                     large)\n"
                ),
            },
            timeline::table(&shown.ranks),
            shown.picture.display(),
            shown.plot.display()
        )
    })?;
    Ok(Status::Success)
}

/// Most bytes of a rank's record: some hundred thousand spans.
const MOST_LINE_BYTES: usize = 1 << 24;

fn frames(
    comm: &mut RankComm,
    args: &DemoArgs,
    prepared: &PreparedDemo,
) -> anyhow::Result<FinishedDemo> {
    let (timeout, transport) = (args.ranks.timeout(), comm.transport());
    let comm = comm.comm();
    let rank = comm.rank();
    let part = prepared.partition.part(&prepared.scene, rank, &BuildOptions::default())?;
    let triangles = part.primitives();
    let options = FrameOptions {
        timeout,
        secondary_rays: SecondaryRayPolicy::Auto { frames: 100 },
        ..FrameOptions::default()
    };
    let mut renderer = DataParallel::new(comm, part, options)?;
    let (mut colors, mut report) = (Vec::new(), RankReport::default());
    for _ in 0..args.frames {
        comm.barrier(timeout)?;
        let done = renderer.frame(comm, &prepared.camera, &prepared.options)?;
        colors = done.frame.map(|f| f.color).unwrap_or(colors);
        report = done.report;
    }
    // Lengths first, because ranks have different numbers of spans.
    let mine = serde_json::to_vec(&RankRecord::new(rank, triangles, &report))?;
    let lengths = comm.all_gather(&(mine.len() as u64).to_le_bytes(), 8, timeout)?;
    let length =
        |bytes: &Vec<u8>| bytes.as_slice().try_into().map_or(0, u64::from_le_bytes) as usize;
    let longest = lengths.iter().map(length).max().unwrap_or(0);
    anyhow::ensure!(longest <= MOST_LINE_BYTES, "a rank announces {longest} bytes about its frame");
    let all = comm.all_gather(&mine, longest, timeout)?;
    let lines = all.iter().map(|bytes| serde_json::from_slice(bytes)).collect::<Result<_, _>>()?;
    Ok(FinishedDemo {
        transport,
        light: report.secondary_rays,
        unusable: prepared.scene.world.report().skipped,
        colors,
        lines,
    })
}
