//! Data in files that may be larger than memory: a volume of bytes, as an implicit isosurface and
//! as a medium, and a mesh in pages. `bench run --thesis stored-files` takes the dissertation's
//! own sizes.

use super::Context;
use crate::clock::Clock;
use crate::image::framing::Framing;
use crate::record::{Record, Row};
use crate::runner::{Schedule, Variant, interleave};
use crate::stored_data::{mixing_layer_grid, store_mixing_layer, wavelet_surfaces};
use anyhow::Context as _;
use datasets::cache::MeshCache;
use datasets::catalogue;
use datasets::generate::mixing_layer::{self, MixingLayer};
use datasets::view::View;
use datasets::{colormaps, stored_mesh, stored_volume};
use rt_core::bvh::{BuildOptions, Geometry, Instance, PageUse, World};
use rt_core::camera::Camera;
use rt_core::effects::Effects;
use rt_core::glam::{DAffine3, DVec3};
use rt_core::render::{RenderOptions, RenderOutput, render};
use rt_core::scene::{Scene, SceneBuilder};
use rt_core::shapes::{IsosurfaceNormals, Shape};
use rt_core::stored_volume::StoredIsosurface;
use rt_core::transfer_function::TransferFunction;
use rt_core::volume::{Volume, VolumeOptions};
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Bytes of pages and bricks in memory.
const BUDGET: usize = 6 << 30;
/// Points along x of the largest layer that is drawn in memory too.
const LARGEST_IN_MEMORY: u32 = 512;
/// Bytes for triangles that wait to be stored.
const STORING: usize = 4 << 30;

/// How large the data are.
struct Sizes {
    /// Points of the mixing layer along x.
    layer: u32,
    /// Million triangles of the wavelet.
    wavelet: u32,
    pixels: u32,
}

impl Sizes {
    fn of(context: &Context<'_>) -> Sizes {
        match (context.quick, context.thesis) {
            (true, _) => Sizes { layer: 128, wavelet: 1, pixels: 256 },
            (false, false) => Sizes { layer: 512, wavelet: 16, pixels: 1024 },
            (false, true) => Sizes { layer: 2048, wavelet: 256, pixels: 1024 },
        }
    }

    /// Bytes of both files, and a tenth more.
    fn bytes(&self) -> u64 {
        let layer = u64::from(self.layer).pow(3) * 15 / 16 * 11 / 10;
        (layer + u64::from(self.wavelet) * 20_000_000) * 11 / 10
    }
}

pub(super) fn run(context: &mut Context<'_>, record: &mut Record) -> anyhow::Result<()> {
    record.column("data", "", "what the file has");
    record.column("elements", "", "points of the volume, or triangles of the mesh");
    record.column("file", "MB", "size of the file");
    record.column("bytes_per_element", "B", "the file's bytes by its elements");
    record.column("prepare", "s", "making the data and storing them; none when kept from before");
    record.column("open", "ms", "opening the file: its header and its table are read");
    record.column("tree", "ms", "tree over the pages or bricks");
    record.column("view", "", "view of the data set");
    record.column("first_frame", "s", "the first frame of the view, which reads what it meets");
    record.column(
        "reads",
        "",
        "pages or bricks read since the file was opened; parts made, of a medium",
    );
    record.column("in_memory", "MB", "the most that they took");
    record.column("covered", "", "pixels that show a surface, or some of a medium");
    record.column("time", "ms", "median over the rounds, wall time of a frame");
    record.column("time_low", "ms", "fastest round");
    record.column("time_high", "ms", "slowest round");
    record.column("rate", "1/s", "frames a second by the median");
    let sizes = Sizes::of(context);
    let (pixels, budget) = (sizes.pixels, BUDGET >> 20);
    record.notes.push(format!(
        "Frames of {pixels} x {pixels} pixels through the renderer: a primary ray a pixel, \
         headlight, all threads, the views in turns; media a quarter as wide and high. At most \
         {budget} MB of pages or bricks are in memory. The files were written just before, or read \
         before, so the system may have parts of them in memory: the first frame is not that of a \
         cold disk."
    ));
    if context.thesis {
        record.notes.push("The sizes of the dissertation (--thesis).".into());
    }
    let folder = Folder::new(context, &sizes)?;
    measure_layer(context, record, &folder, &sizes)?;
    measure_wavelet(context, record, &folder, &sizes)
}

/// Where the files are: in the cache, to be kept, or only as long as they are measured.
struct Folder {
    path: PathBuf,
    is_kept: bool,
    _temporary: Option<tempfile::TempDir>,
}

impl Folder {
    fn new(context: &Context<'_>, sizes: &Sizes) -> anyhow::Result<Folder> {
        if !context.thesis {
            let temporary = tempfile::tempdir()?;
            let path = temporary.path().to_path_buf();
            return Ok(Folder { path, is_kept: false, _temporary: Some(temporary) });
        }
        let cache = MeshCache::from_environment()
            .context("no folder for large files: set RTSV_CACHE to one")?;
        let path = cache.directory().join("stored-files");
        std::fs::create_dir_all(&path).with_context(|| path.display().to_string())?;
        let free = rustix::fs::statvfs(&path).with_context(|| path.display().to_string())?;
        let free = free.f_bavail.saturating_mul(free.f_frsize);
        let folder = Folder { path, is_kept: true, _temporary: None };
        let there = folder.layer(sizes).exists() && folder.wavelet(sizes).exists();
        let needed = sizes.bytes();
        anyhow::ensure!(
            there || free >= needed,
            "{}: {} MB are free, and the files take {} MB: make room, or set RTSV_CACHE to a \
             folder of another disk",
            folder.path.display(),
            free >> 20,
            needed >> 20
        );
        Ok(folder)
    }

    fn layer(&self, sizes: &Sizes) -> PathBuf {
        self.path.join(format!("mixing-layer-{}.rtvolume", sizes.layer))
    }

    fn wavelet(&self, sizes: &Sizes) -> PathBuf {
        self.path.join(format!("wavelet-{}M.rtmesh", sizes.wavelet))
    }
}

/// A file that was opened, after it was made where there was none.
struct Opened<T> {
    data: T,
    prepare_secs: Option<f64>,
    open_secs: f64,
}

/// Opens a file that may be there from an earlier run; makes it where it is not, or is of no use.
fn open_or_make<T, E: std::error::Error + Send + Sync + 'static>(
    path: &Path,
    is_kept: bool,
    open: impl Fn(&Path) -> Result<T, E>,
    make: impl FnOnce(&Path) -> anyhow::Result<()>,
) -> anyhow::Result<Opened<T>> {
    let mut prepare_secs = None;
    if !(is_kept && path.exists() && open(path).is_ok()) {
        let start = Instant::now();
        make(path)?;
        prepare_secs = Some(start.elapsed().as_secs_f64());
    }
    let start = Instant::now();
    let data = open(path)?;
    Ok(Opened { data, prepare_secs, open_secs: start.elapsed().as_secs_f64() })
}

fn measure_layer(
    context: &mut Context<'_>,
    record: &mut Record,
    folder: &Folder,
    sizes: &Sizes,
) -> anyhow::Result<()> {
    let points = sizes.layer;
    let name = format!("mixing layer, {points} points along x, bytes");
    let Opened { data, prepare_secs, open_secs } = open_or_make(
        &folder.layer(sizes),
        folder.is_kept,
        |path| stored_volume::open(path, BUDGET),
        |path| {
            store_mixing_layer(path, points, &mut |done, all| {
                let share = 0.4 * f64::from(done) / f64::from(all);
                context.report_share(format!("storing plane {done} of {all}"), share)
            })?;
            Ok(())
        },
    )?;
    let file = Arc::new(data);
    let isovalue = (255.0 * mixing_layer::ISO) as f32;
    let normals = IsosurfaceNormals::Smooth;
    let surface = StoredIsosurface::new(file.clone(), &[isovalue], normals)?;
    let report = file.report();
    let row = Row::new()
        .with("elements", report.points)
        .with("file", report.bytes as f64 / 1e6)
        .with("bytes_per_element", report.bytes as f64 / report.points as f64)
        .with("open", open_secs * 1e3);
    let row = row.with("data", format!("{name}, isosurface of equal parts"));
    let prepared = prepare_secs.map_or(row.clone(), |secs| row.clone().with("prepare", secs));
    let views = MixingLayer::views();
    let surface = Pictured::shape(Arc::new(surface))?;
    let cameras = surface.cameras(&views, sizes)?;
    let used = || file.page_use();
    let timed = Timed { pictured: &surface, row: prepared, used: Some(&used) };
    frames(context, record, sizes, &[timed], &cameras)?;

    let row = row.with("data", format!("{name}, medium"));
    let medium = Arc::new(medium_of(|transfer, options| {
        Ok(Volume::stored(file.clone(), BUDGET, transfer, options)?)
    })?);
    let in_file = Pictured::medium(medium.clone())?;
    let cameras = in_file.cameras(&views, sizes)?;
    let used = || medium.page_use().unwrap_or_else(|| file.page_use());
    let mut timed = vec![Timed { pictured: &in_file, row, used: Some(&used) }];
    let in_memory = match sizes.layer <= LARGEST_IN_MEMORY {
        true => {
            context.report_step("the same in memory")?;
            let grid = Arc::new(mixing_layer_grid(points)?);
            let medium = medium_of(|transfer, options| Ok(Volume::new(grid, transfer, options)?))?;
            Some(Pictured::medium(Arc::new(medium))?)
        }
        false => None,
    };
    if let Some(pictured) = &in_memory {
        let row = Row::new()
            .with("data", format!("{name}, medium in memory in single precision"))
            .with("elements", report.points);
        timed.push(Timed { pictured, row, used: None });
    }
    frames(context, record, sizes, &timed, &cameras)
}

/// A veil around the interface between the halves of the layer.
fn medium_of(
    make: impl FnOnce(TransferFunction, VolumeOptions) -> anyhow::Result<Volume>,
) -> anyhow::Result<Volume> {
    let range = [0.0, 255.0];
    let colors = colormaps::by_name("viridis", range).context("a colour map that exists")?;
    let opacity = [[100.0, 0.0], [127.5, 0.9], [155.0, 0.0]];
    make(TransferFunction::from_opacity(colors, &opacity, 0.1)?, VolumeOptions::default())
}

fn measure_wavelet(
    context: &mut Context<'_>,
    record: &mut Record,
    folder: &Folder,
    sizes: &Sizes,
) -> anyhow::Result<()> {
    let millions = sizes.wavelet;
    let Opened { data, prepare_secs, open_secs } = open_or_make(
        &folder.wavelet(sizes),
        folder.is_kept,
        |path| stored_mesh::open(path, BUDGET),
        |path| {
            let mut writer = stored_mesh::create(path, DVec3::ZERO)?;
            writer.set_memory(STORING);
            for surface in wavelet_surfaces(millions, false)? {
                let surface = surface?;
                let share = 0.4 + 0.5 * surface.share;
                context.report_share(format!("storing {}", surface.label), share)?;
                writer.add_mesh(&surface.mesh)?;
            }
            stored_mesh::finish(writer)?;
            Ok(())
        },
    )?;
    let mesh = Arc::new(data);
    let report = mesh.report();
    let row = Row::new()
        .with("data", format!("wavelet, {millions} million triangles, without normals"))
        .with("elements", report.triangles)
        .with("file", report.bytes as f64 / 1e6)
        .with("bytes_per_element", report.bytes as f64 / report.triangles as f64)
        .with("open", open_secs * 1e3);
    let row = prepare_secs.map_or(row.clone(), |secs| row.with("prepare", secs));
    let views = catalogue::find("wavelet")?.views();
    let pictured = Pictured::shape(mesh.clone())?;
    let cameras = pictured.cameras(&views, sizes)?;
    let used = || mesh.page_use();
    let timed = Timed { pictured: &pictured, row, used: Some(&used) };
    frames(context, record, sizes, &[timed], &cameras)
}

/// A scene, and how long its tree took.
struct Pictured {
    scene: Scene,
    effects: Effects,
    tree_secs: Option<f64>,
}

impl Pictured {
    fn shape(shape: Arc<dyn Shape>) -> anyhow::Result<Pictured> {
        let start = Instant::now();
        let placed = Instance { geometry: 0, world_from_object: DAffine3::IDENTITY };
        let geometry = vec![Geometry::Shape(shape)];
        let scene = Scene::new(World::build(geometry, vec![placed], &BuildOptions::default())?);
        let tree_secs = Some(start.elapsed().as_secs_f64());
        Ok(Pictured { scene, effects: Effects::NONE, tree_secs })
    }

    fn medium(volume: Arc<Volume>) -> anyhow::Result<Pictured> {
        let mut scene = SceneBuilder::new();
        scene.volume(volume);
        Ok(Pictured { scene: scene.build()?, effects: Effects::VOLUMES, tree_secs: None })
    }

    fn cameras(&self, views: &[View], sizes: &Sizes) -> anyhow::Result<Vec<(String, Camera)>> {
        let camera = |view: &View| {
            let camera = Framing::At(view.clone()).of_scene(&self.scene, [sizes.pixels; 2])?;
            Ok((view.name.clone(), camera))
        };
        views.iter().map(camera).collect()
    }
}

/// What is measured, with what its rows have in common.
struct Timed<'a> {
    pictured: &'a Pictured,
    row: Row,
    /// What of a file is in memory.
    used: Option<&'a dyn Fn() -> PageUse>,
}

/// Frames of all views of all of them in turns, after a first one of each.
fn frames(
    context: &mut Context<'_>,
    record: &mut Record,
    sizes: &Sizes,
    all: &[Timed<'_>],
    cameras: &[(String, Camera)],
) -> anyhow::Result<()> {
    let failed: RefCell<Option<anyhow::Error>> = RefCell::new(None);
    let (mut rows, mut variants) = (vec![], vec![]);
    for (timed, (name, camera)) in all.iter().flat_map(|t| cameras.iter().map(move |c| (t, c))) {
        context.report_step(format!("first frame of {name}"))?;
        let (scene, effects) = (&timed.pictured.scene, Some(timed.pictured.effects));
        // A ray through a medium goes through all of it: a sixteenth of them takes long enough.
        let is_medium = timed.pictured.effects.contains(Effects::VOLUMES);
        let pixels = if is_medium { sizes.pixels / 4 } else { sizes.pixels };
        let options = RenderOptions { effects, ..RenderOptions::new(pixels, pixels) };
        let covered =
            |output: &RenderOutput| output.frame.color.iter().filter(|c| c[3] > 0.0).count() as u64;
        let start = Instant::now();
        let output = render(scene, camera, &options)?;
        let first_secs = start.elapsed().as_secs_f64();
        let mut row = timed
            .row
            .clone()
            .with("view", name.as_str())
            .with("first_frame", first_secs)
            .with("covered", covered(&output));
        if let Some(secs) = timed.pictured.tree_secs {
            row = row.with("tree", secs * 1e3);
        }
        if let Some(pages) = timed.used.map(|used| used()) {
            row = row.with("reads", pages.reads).with("in_memory", pages.peak as f64 / 1e6);
        }
        rows.push(row);
        let failed = &failed;
        variants.push(Variant::new(name.clone(), move || match render(scene, camera, &options) {
            Ok(output) => covered(&output),
            Err(e) => {
                failed.borrow_mut().get_or_insert(e.into());
                0
            }
        }));
    }
    context.report_step("frames in turns")?;
    let timings = interleave(&context.schedule(Schedule::all_threads(), 4.0), &mut variants)?;
    drop(variants);
    if let Some(error) = failed.into_inner() {
        return Err(error);
    }
    for (timed, row) in timings.variants.iter().zip(rows) {
        let wall = timed.summary(Clock::Wall);
        record.rows.push(
            row.with("time", wall.median * 1e3)
                .with("time_low", wall.low * 1e3)
                .with("time_high", wall.high * 1e3)
                .with("rate", 1.0 / wall.median),
        );
    }
    Ok(())
}
