//! `composite demo`: a data set rendered in parts ([`demo_data`]), or frames made without a renderer composited; with a plot of what
//! each rank did when.
use super::ranks::{RankArgs, RankComm};
use super::{demo_data, gantt};
use crate::compositor::{Compositor, Options};
use crate::frame::Frame;
use crate::pixel::DepthPixel;
use crate::report::Report;
use crate::scenes::{Drawn, Scene};
use anyhow::Context as _;
use datasets::cli::{CommonArgs, CureExt as _, Status, UsageError};
use datasets::image_io::{Picture, PngDepth, write_png};
use serde::Serialize;
use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Duration;

/// Arguments of `composite demo`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    composite demo -n 8\n  \
    composite demo -n 5 --data mixing-layer --view RMI --headlight\n  \
    composite demo -n 4 --mpi --data part.vtp --grey\n  \
    composite demo -n 8 --scene discs\n  \
    composite demo -n 8 --mpi --size 2048 --out frames")]
pub(super) struct DemoArgs {
    #[command(flatten)]
    pub(super) ranks: RankArgs,
    /// The data set: one of the catalogue of `datasets`, or a file with surfaces (VTK, OBJ, glTF, PLY, STL)
    #[arg(long, default_value = "wavelet", value_name = "NAME")]
    pub(super) data: String,
    /// Its size; the smallest if not given
    #[arg(long, value_name = "SIZE")]
    pub(super) data_size: Option<String>,
    /// One of its views; the first if not given
    #[arg(long, value_name = "VIEW")]
    pub(super) view: Option<String>,
    /// A headlight in place of a lamp with shadows and ambient occlusion
    #[arg(long)]
    pub(super) headlight: bool,
    /// One grey for all parts in place of a colour for each rank
    #[arg(long)]
    pub(super) grey: bool,
    /// Parts of the same work for this view in place of the same number of triangles
    #[arg(long)]
    pub(super) cut_by_view: bool,
    /// Width and height of the image, in pixels
    #[arg(long, default_value_t = 1024, value_name = "PIXELS")]
    pub(super) size: u32,
    /// In place of a data set: frames made without a renderer
    #[arg(long, value_name = "discs|dense|frag", conflicts_with_all = ["data", "data_size", "view", "headlight", "grey", "cut_by_view"])]
    scene: Option<Scene>,
    /// Frames; the last is shown
    #[arg(long, default_value_t = 5, value_name = "N")]
    pub(super) frames: u64,
    /// Folder for picture and plot
    #[arg(long, default_value = ".", value_name = "FOLDER")]
    pub(super) out: PathBuf,
}

/// What one rank did in the frame that is shown, in seconds, and bytes.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Line {
    pub(super) rank: usize,
    pub(super) render_secs: f64,
    pub(super) compress_secs: f64,
    pub(super) blend_secs: f64,
    pub(super) send_secs: f64,
    pub(super) collect_secs: f64,
    pub(super) total_secs: f64,
    pub(super) bytes_sent: u64,
}

impl Line {
    const BYTES: usize = 7 * 8;

    fn new(rank: usize, render_secs: f64, report: &Report) -> Self {
        Self {
            rank,
            render_secs,
            compress_secs: report.compress_secs,
            blend_secs: report.blend_secs,
            send_secs: report.exchange_secs,
            collect_secs: report.collect_secs,
            total_secs: render_secs + report.total_secs,
            bytes_sent: report.bytes_sent,
        }
    }

    fn to_bytes(self) -> Vec<u8> {
        let numbers = [
            self.render_secs,
            self.compress_secs,
            self.blend_secs,
            self.send_secs,
            self.collect_secs,
            self.total_secs,
        ];
        let mut bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        bytes.extend_from_slice(&self.bytes_sent.to_le_bytes());
        bytes
    }

    fn from_bytes(rank: usize, bytes: &[u8]) -> Option<Self> {
        let words: Vec<[u8; 8]> = bytes.chunks_exact(8).filter_map(|word| word.try_into().ok()).collect();
        let number = |i: usize| words.get(i).map(|word| f64::from_le_bytes(*word));
        Some(Self {
            rank,
            render_secs: number(0)?,
            compress_secs: number(1)?,
            blend_secs: number(2)?,
            send_secs: number(3)?,
            collect_secs: number(4)?,
            total_secs: number(5)?,
            bytes_sent: words.get(6).map(|word| u64::from_le_bytes(*word))?,
        })
    }
}

#[derive(Debug, Serialize)]
struct Shown {
    transport: String,
    scene: &'static str,
    size_px: u32,
    frame_ms: f64,
    picture: PathBuf,
    plot: PathBuf,
    ranks: Vec<Line>,
}

/// The frame that is shown, on rank 0.
type Finished = (String, f64, Vec<[u8; 4]>, Vec<Line>);

pub(super) fn demo(common: CommonArgs, args: &DemoArgs, arguments: &[OsString]) -> anyhow::Result<Status> {
    if args.size == 0 || args.size > 32_768 || args.frames == 0 {
        return Err(UsageError("give a size of 1 to 32768 pixels and at least one frame".to_string()).into());
    }
    // Before anything is rendered: a folder that cannot be made is found out now.
    if !args.ranks.is_rank() {
        std::fs::create_dir_all(&args.out)
            .with_context(|| format!("cannot make the folder {}", args.out.display()))
            .cure("name another in --out")?;
    }
    let Some(scene) = args.scene else {
        return demo_data::demo(common, args, arguments);
    };
    args.ranks.run(
        common,
        arguments,
        |comm| frames(comm, args, scene),
        |(transport, frame_secs, colors, lines): Finished| {
            std::fs::create_dir_all(&args.out).with_context(|| args.out.display().to_string())?;
            let (picture, plot) = (args.out.join("composite_demo.png"), args.out.join("composite_demo.svg"));
            write_picture(&picture, args.size, &colors)?;
            let title = format!(
                "{} ranks over {transport}, {}x{} {}: {:.2} ms",
                lines.len(),
                args.size,
                args.size,
                scene,
                1e3 * frame_secs
            );
            std::fs::write(&plot, gantt::svg(&title, &lines)).with_context(|| plot.display().to_string())?;
            let shown = Shown {
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
                    "{title}\n{}\npicture: {}\nplot:    {}",
                    gantt::table(&shown.ranks),
                    shown.picture.display(),
                    shown.plot.display()
                )
            })?;
            Ok(Status::Success)
        },
    )
}

/// The colours are taken as linear light; what nobody drew stays transparent.
fn write_picture(path: &std::path::Path, size: u32, colors: &[[u8; 4]]) -> anyhow::Result<()> {
    let linear: Vec<[f32; 4]> = colors.iter().map(|c| c.map(|channel| f32::from(channel) / 255.0)).collect();
    let mut picture = Picture::new(size, size);
    picture.add_rgba(&linear)?;
    write_png(path, &picture, PngDepth::Eight)?;
    Ok(())
}

fn frames(comm: &mut RankComm, args: &DemoArgs, scene: Scene) -> anyhow::Result<Finished> {
    let timeout: Duration = args.ranks.timeout();
    let transport = comm.transport();
    let comm = comm.comm();
    let (rank, ranks) = (comm.rank(), comm.size());
    let mut compositor =
        Compositor::<DepthPixel<[u8; 4]>>::new(Options { depth: false, timeout, ..Options::default() });
    let mut drawn = Drawn::new(args.size, args.size);
    let mut colors = Vec::new();
    let mut line = Line::new(rank, 0.0, &Report::default());
    let mut frame_secs = 0.0;
    for moment in 0..args.frames {
        comm.barrier(timeout)?;
        let begin = comm.now();
        scene.draw(moment, rank, ranks, &mut drawn);
        let render_secs = comm.now() - begin;
        let frame = Frame::with_depth(args.size, args.size, &drawn.colors, &drawn.depths)?;
        let done = compositor.composite(comm, &frame.bounded(drawn.bounds)?)?;
        frame_secs = comm.now() - begin;
        line = Line::new(rank, render_secs, &done.report);
        if let Some(image) = done.image {
            colors = image.colors().to_vec();
            compositor.recycle(image);
        }
    }
    let all = comm.all_gather(&line.to_bytes(), Line::BYTES, timeout)?;
    let lines = all.iter().enumerate().filter_map(|(rank, bytes)| Line::from_bytes(rank, bytes)).collect();
    Ok((transport, frame_secs, colors, lines))
}
