//! `composite demo` of a data set: generates it, cuts it into parts, and renders it on all ranks.
use super::demo_args::DemoArgs;
use super::rank_records::RankRecord;
use super::ranks::RankComm;
use super::timeline;
use crate::comm::Communicator;
use crate::render::demo::{Demo, DemoError, PreparedDemo};
use crate::render::{
    DataParallel, FrameOptions, PieceDemo, PiecesOfRank, RankReport, SecondaryRayPolicy,
};
use anyhow::Context as _;
use datasets::cli::{CommonArgs, Status, UsageError};
use datasets::image_io::{LayeredImage, PngDepth, write_png};
use rt_core::bvh::BuildOptions;
use rt_core::camera::Camera;
use rt_core::render::RenderOptions;
use serde::Serialize;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
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
        data: args.data().to_owned(),
        size: args.data_size.clone(),
        view: args.view.clone(),
        size_px: [args.size; 2],
        global_light: !args.headlight,
        color_by_rank: !args.grey,
        cut_by_view: args.cut_by_view,
        ..Demo::default()
    };
    let pieces = PieceDemo::open(Path::new(args.data())).map_err(|e| UsageError(e.to_string()))?;
    if let Some(mut pieces) = pieces {
        pieces.array = args.array.clone();
        return args.ranks.run(
            common,
            arguments,
            |comm| frames_of_pieces(comm, common, args, &wanted, &pieces),
            |f: FinishedDemo| finish(common, args, f),
        );
    }
    if args.array.is_some() {
        let file = args.data();
        return Err(UsageError(format!(
            "--array: {file} names no pieces; leave it out, or give a .pvtu, .pvti or .vtm file"
        ))
        .into());
    }
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
                            DemoError::Frame(e) => anyhow::Error::new(e),
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
    let [picture, plot] = args.output_files()?;
    let mut png = LayeredImage::new(args.size, args.size);
    png.add_rgba(&f.colors)?;
    write_png(&picture, &png, PngDepth::Eight)?;
    let frame_ms = f.lines.iter().map(|l| l.total_ms).fold(0.0, f64::max);
    let title = format!(
        "{} in {} parts over {}, {}x{}: {frame_ms:.2} ms",
        args.data(),
        f.lines.len(),
        f.transport,
        args.size,
        args.size
    );
    std::fs::write(&plot, timeline::svg(&title, &f.lines))
        .with_context(|| plot.display().to_string())?;
    let shown = DemoReport {
        transport: f.transport,
        data: args.data().to_owned(),
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
    let (options, transport) = (frame_options(args), comm.transport());
    let comm = comm.comm();
    let part = prepared.partition.part(&prepared.scene, comm.rank(), &BuildOptions::default())?;
    let unusable = prepared.scene.world.report().skipped;
    let renderer = DataParallel::new(comm, part, options)?;
    let view = View { camera: &prepared.camera, options: &prepared.options, files: 0, unusable };
    render(comm, args, transport, renderer, &view)
}

/// The frames of pieces that the ranks read by themselves.
fn frames_of_pieces(
    comm: &mut RankComm,
    common: CommonArgs,
    args: &DemoArgs,
    wanted: &Demo,
    pieces: &PieceDemo,
) -> anyhow::Result<FinishedDemo> {
    let (options, transport) = (frame_options(args), comm.transport());
    let comm = comm.comm();
    let PiecesOfRank { renderer, camera, options, files, warnings } =
        pieces.prepare(comm, wanted, options).map_err(|e| match e {
            DemoError::OptionOfPieces { .. } => UsageError(e.to_string()).into(),
            e => anyhow::Error::new(e),
        })?;
    for warning in warnings {
        common.note(0, format_args!("warning: rank {}: {warning}", comm.rank()));
    }
    let unusable = renderer.part().scene.world.report().skipped;
    render(
        comm,
        args,
        transport,
        renderer,
        &View { camera: &camera, options: &options, files, unusable },
    )
}

fn frame_options(args: &DemoArgs) -> FrameOptions {
    FrameOptions {
        timeout: args.ranks.timeout(),
        secondary_rays: SecondaryRayPolicy::Auto { frames: 100 },
        ..FrameOptions::default()
    }
}

/// What is rendered, and from what.
struct View<'a> {
    camera: &'a Camera,
    options: &'a RenderOptions,
    files: usize,
    unusable: usize,
}

fn render(
    comm: &mut dyn Communicator,
    args: &DemoArgs,
    transport: String,
    mut renderer: DataParallel,
    view: &View<'_>,
) -> anyhow::Result<FinishedDemo> {
    let (rank, timeout) = (comm.rank(), args.ranks.timeout());
    let (mut colors, mut report) = (Vec::new(), RankReport::default());
    for _ in 0..args.frames {
        comm.barrier(timeout)?;
        let done = renderer.frame(comm, view.camera, view.options)?;
        colors = done.frame.map(|f| f.color).unwrap_or(colors);
        report = done.report;
    }
    // Lengths first, because ranks have different numbers of spans.
    let mine = serde_json::to_vec(&RankRecord::new(rank, view.files, renderer.part(), &report))?;
    let lengths = comm.all_gather(&(mine.len() as u64).to_le_bytes(), 8, timeout)?;
    let length =
        |bytes: &Vec<u8>| bytes.as_slice().try_into().map_or(0, u64::from_le_bytes) as usize;
    let longest = lengths.iter().map(length).max().unwrap_or(0);
    anyhow::ensure!(longest <= MOST_LINE_BYTES, "a rank announces {longest} bytes about its frame");
    let all = comm.all_gather(&mine, longest, timeout)?;
    let lines = all.iter().map(|bytes| serde_json::from_slice(bytes)).collect::<Result<_, _>>()?;
    let unusable = view.unusable;
    Ok(FinishedDemo { transport, light: report.secondary_rays, unusable, colors, lines })
}
