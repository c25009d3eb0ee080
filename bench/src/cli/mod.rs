//! The command line: converts arguments to calls of the library.

mod list;
mod memory_budget;
mod mesh_file;
mod peers;
mod quote;
mod render;
mod report;
mod run;
mod store;
mod store_cells;
mod store_isosurface;
mod store_job;
mod store_volume;
mod stored_file;

use clap::{Args, Parser, Subcommand};
use datasets::cli::{CommonArgs, CompletionsArgs, ManArgs, run_main};
use rt_core::bvh::{BuildQuality, Robustness, Storage};
use rt_core::effects::Effects;
use rt_core::environment::Background;
use std::path::PathBuf;
use std::process::ExitCode;

/// Measures every table and figure of the dissertation, and error against time.
///
/// Without a command, the quick form of every experiment runs (within six minutes on two cores,
/// after the build) and the path of the report is printed.
#[derive(Debug, Parser)]
#[command(name = "bench", version)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    common: CommonArgs,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Lists the experiments
    List,
    /// Runs experiments, writes their records and the report
    Run(RunArgs),
    /// Rebuilds the report from existing records
    Report(ReportArgs),
    /// Updates the tables and plots of the book from the records in bench/runs
    Quote,
    /// Renders a file: meshes, isosurfaces of image data, lines as tubes, points as spheres
    Render(RenderArgs),
    /// Writes a mesh, with its normals, its colours and the values of an array, or a volume to a
    /// file that `bench render` draws without reading all of it
    #[command(after_help = store::EXAMPLES)]
    Store(StoreArgs),
    /// Renders one of the report's images of generated data
    #[command(name = "picture")]
    Image(ImageArgs),
    /// Lists the installed baselines and how to install the others; `bench run peers` measures them
    Peers,
    /// Prints a completion script for a shell
    Completions(CompletionsArgs),
    /// Writes the manual pages of the program and its subcommands into a folder
    #[command(hide = true)]
    Man(ManArgs),
}

/// Options of `bench run`.
#[derive(Debug, Args)]
struct RunArgs {
    /// Experiments, as `bench list` names them. With --json, one object per line, in this order
    #[arg(required = true, value_name = "ID")]
    ids: Vec<String>,
    /// Smaller data and fewer rounds: each experiment within a minute
    #[arg(long)]
    quick: bool,
    /// The dissertation's own sizes: fig3.6, table4.1, fig4.7, fig4.9, stored-files, memory-limit.
    /// Each takes up to an hour, stored-files up to 25 GB on disk, asked for
    /// first; its files are kept in the cache (RTSV_CACHE) for the next run
    #[arg(long, conflicts_with = "quick")]
    thesis: bool,
    /// Continues the last run of these experiments into the same folder, if it ended early: parts
    /// that it measured are kept. Rejected if the commit, the sizes or the machine are others. For
    /// fig3.6, table4.1, fig4.7, fig4.9, stored-files, memory-limit
    #[arg(long)]
    resume: bool,
    /// Also keep the records in bench/runs/DATE-MACHINE/. Rejected if the tree has uncommitted
    /// changes, the load of the machine is above 0.75 per core, or this is not a release build
    #[arg(long)]
    record: bool,
    /// Like --record, but despite objections, which records and reports then state
    #[arg(long)]
    record_despite_doubts: bool,
    /// With `peers`: measures on the triangles of this file, in any format that `bench render`
    /// reads, instead of the built-in meshes. Meshes of the file stay apart
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,
    /// Folder for the records and the report [default: bench-report in the build folder]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Options of `bench store`.
#[derive(Debug, Args)]
struct StoreArgs {
    /// A mesh, or image data for an isosurface, in any format that `bench render` reads
    #[arg(required_unless_present_any = ["wavelet", "mixing_layer"])]
    file: Option<PathBuf>,
    /// Instead of a file: nested isosurfaces of VTK's wavelet, with so many million triangles
    #[arg(
        long,
        value_name = "MILLIONS",
        conflicts_with = "file",
        value_parser = clap::value_parser!(u32).range(1..=100_000)
    )]
    wavelet: Option<u32>,
    /// Instead of a file: a Richtmyer-Meshkov-like mixing layer of POINTS x POINTS x 0.9375 POINTS
    /// (2048 for that of the dissertation), as a volume of bytes or the interface as a mesh
    #[arg(
        long,
        value_name = "POINTS",
        conflicts_with_all = ["file", "wavelet"],
        value_parser = clap::value_parser!(u32).range(16..=8192)
    )]
    mixing_layer: Option<u32>,
    /// The file to write: a mesh (.rtmesh), or image data as a volume (.rtvolume), of which
    /// `bench render` draws any isosurface without triangles
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
    /// The array of image data [default: what the file marks, else the first]
    #[arg(long, value_name = "ARRAY", requires = "file")]
    array: Option<String>,
    /// Isovalue for image data [default: the middle of the range]
    #[arg(long, value_name = "VALUE", allow_hyphen_values = true, requires = "file")]
    isovalue: Option<f32>,
    /// The array to colour the mesh by, as for `bench render`: its values are stored
    #[arg(long, value_name = "ARRAY", requires = "file")]
    color_by: Option<String>,
    /// Angle by which normals may be off, in degrees; 0 stores them as given
    #[arg(
        long,
        value_name = "DEGREES",
        default_value_t = 0.0,
        conflicts_with = "no_attributes",
        value_parser = angle
    )]
    normal_tolerance: f64,
    /// Stores triangles alone, without normals, colours and scalars
    #[arg(long, conflicts_with = "color_by")]
    no_attributes: bool,
    /// Megabytes that small pieces of a mesh may take before they are written. More make faster
    /// files [default: 1024, or half of what is free where that is less]
    #[arg(long, value_name = "MB", value_parser = clap::value_parser!(u64).range(1..))]
    memory: Option<u64>,
}

/// An angle in degrees, from 0 to 90.
fn angle(text: &str) -> Result<f64, String> {
    let degrees: f64 = text.parse().map_err(|e| format!("{e}"))?;
    if !(0.0..=90.0).contains(&degrees) {
        return Err("give degrees from 0 to 90".into());
    }
    Ok(degrees)
}

/// Options of `bench report`.
#[derive(Debug, Args)]
struct ReportArgs {
    /// Folder with records [default: bench-report in the build folder]
    dir: Option<PathBuf>,
    /// The page [default: index.html in the folder]
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Options of `bench render`.
#[derive(Debug, Args)]
struct RenderArgs {
    /// VTK (.vtp .vtu .vti .vtr .vts, parallel, .pvd, legacy), PLOT3D, NRRD, MetaImage, NumPy, OBJ,
    /// glTF, PLY, STL, the folder of an OpenFOAM case, or what `bench store` wrote
    file: PathBuf,
    /// The image as PNG
    #[arg(long, short, value_name = "PNG", required_unless_present = "exr")]
    out: Option<PathBuf>,
    /// The image as OpenEXR: colour, depth, distance, normal, ids, rays per pixel
    #[arg(long, value_name = "EXR")]
    exr: Option<PathBuf>,
    /// Megabytes for the parts of a stored mesh or volume that are in memory at a time [default:
    /// 1024, or half of what is free where that is less]
    #[arg(long, value_name = "MB")]
    memory: Option<u64>,
    /// Pixels per row and rows
    #[arg(long, default_value = "960x540", value_name = "WxH", value_parser = render::size)]
    size: [u32; 2],
    /// Samples per pixel
    #[arg(long, default_value_t = 4, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65536))]
    samples: u32,
    /// Separated by commas: shadows, soft-shadows, ao, reflections, glossy-reflections, refraction,
    /// transparency, depth-of-field, volumes (image data as a glowing medium), path-tracing
    #[arg(long, default_value = "none", value_name = "LIST", value_parser = crate::image::style::parse_effects)]
    effects: Effects,
    /// A camera as TOML or JSON: eye, target, up, vertical_fov_degrees, parallel_height [default:
    /// fits the data]
    #[arg(long, value_name = "FILE")]
    camera: Option<PathBuf>,
    /// Array to colour by; `velocity` is a vector's length, `velocity:x` a component [default: what
    /// the file marks]
    #[arg(long, value_name = "ARRAY")]
    color_by: Option<String>,
    /// Colour map: viridis, cool-warm, grey
    #[arg(long, default_value = "viridis", value_name = "MAP", value_parser = render::colors)]
    colors: String,
    /// Scalars at the ends of the colour map [default: range of the data]
    #[arg(long, value_name = "LOW,HIGH", value_parser = render::range, allow_hyphen_values = true)]
    range: Option<[f32; 2]>,
    /// Isovalue [default: of image data, the middle of the range; with a volume and for cells of
    /// other kinds, no isosurface]
    #[arg(long, value_name = "VALUE", allow_hyphen_values = true)]
    isovalue: Option<f32>,
    /// Renders this array as a volume; `--effects volumes` alone takes the array marked in the file
    #[arg(long, value_name = "ARRAY")]
    volume: Option<String>,
    /// Opacity of a volume as SCALAR:OPACITY,..., for a path of a tenth of its diagonal, linear in
    /// between [default: a ramp from 0 to 0.5 over the range of the colours]
    #[arg(long, value_name = "POINTS", value_parser = render::opacity, allow_hyphen_values = true)]
    opacity: Option<render::Opacity>,
    /// gradient, white, black, transparent
    #[arg(long, default_value = "gradient", value_name = "NAME", value_parser = render::background)]
    background: Background,
    /// fast, watertight
    #[arg(long, default_value = "watertight", value_name = "NAME", value_parser = render::robustness)]
    robustness: Robustness,
    /// Quality of the acceleration structure: fast, balanced, best
    #[arg(long, default_value = "balanced", value_name = "NAME", value_parser = render::quality)]
    quality: BuildQuality,
    /// How the acceleration structure holds triangles: plain, compact (a quarter of the memory,
    /// slower rays)
    #[arg(long, default_value = "plain", value_name = "NAME", value_parser = render::storage)]
    storage: Storage,
}

/// Options of `bench picture`.
#[derive(Debug, Args)]
struct ImageArgs {
    /// wavelet, mixing-layer-outside, mixing-layer-inside, plasma, impact, star, glass
    name: String,
    /// The image as PNG
    #[arg(long, short, value_name = "PNG", required_unless_present = "exr")]
    out: Option<PathBuf>,
    /// The image as OpenEXR
    #[arg(long, value_name = "EXR")]
    exr: Option<PathBuf>,
    /// Pixels per row and rows
    #[arg(long, default_value = "960x540", value_name = "WxH", value_parser = render::size)]
    size: [u32; 2],
    /// Samples per pixel
    #[arg(long, default_value_t = 16, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65536))]
    samples: u32,
}

/// Runs the program. Exit codes: 0 done, 1 failed, 2 usage error, 130 interrupted.
pub fn main() -> ExitCode {
    run_main(|| execute(Cli::try_parse()?))
}

fn execute(cli: Cli) -> anyhow::Result<()> {
    let common = cli.common;
    match cli.command {
        None => run::everything_quick(common),
        Some(Command::List) => list::list(common),
        Some(Command::Run(args)) => run::run(common, &args),
        Some(Command::Report(args)) => report::report(common, &args),
        Some(Command::Quote) => quote::quote(common),
        Some(Command::Render(args)) => render::render(common, &args),
        Some(Command::Store(args)) => store::store(common, &args),
        Some(Command::Image(args)) => render::gallery_image(common, &args),
        Some(Command::Peers) => peers::peers(common),
        Some(Command::Completions(args)) => args.print::<Cli>(),
        Some(Command::Man(args)) => args.write::<Cli>(),
    }
}

/// Default directory of records and reports: the build folder that contains this program.
fn default_dir() -> PathBuf {
    let beside = std::env::current_exe().ok().and_then(|exe| {
        let build = exe.parent()?.parent()?;
        build.join("CACHEDIR.TAG").exists().then(|| build.to_path_buf())
    });
    beside.unwrap_or_else(|| PathBuf::from("target")).join("bench-report")
}
