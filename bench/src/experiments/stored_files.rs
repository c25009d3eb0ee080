//! Data in files that may be larger than memory: an implicit isosurface of a volume of bytes, and a
//! mesh in pages. `bench run --thesis stored-files` takes the dissertation's own sizes.

use super::Context;
use crate::clock::Clock;
use crate::image::framing::Framing;
use crate::record::{Record, Row};
use crate::runner::{Schedule, Variant, interleave};
use crate::stored_data::{store_mixing_layer, wavelet_surfaces};
use anyhow::Context as _;
use datasets::cache::MeshCache;
use datasets::catalogue;
use datasets::generate::mixing_layer::{self, MixingLayer};
use datasets::view::View;
use datasets::{stored_mesh, stored_volume};
use rt_core::bvh::{BuildOptions, Geometry, Instance, PageUse, World};
use rt_core::camera::Camera;
use rt_core::glam::{DAffine3, DVec3};
use rt_core::render::{RenderOptions, render};
use rt_core::scene::Scene;
use rt_core::shapes::{IsosurfaceNormals, Shape};
use rt_core::stored_volume::StoredIsosurface;
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Bytes of pages and bricks in memory.
const BUDGET: usize = 6 << 30;
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
    record.column("reads", "", "pages or bricks read since the file was opened");
    record.column("in_memory", "MB", "the most that they took");
    record.column("covered", "", "pixels that show a surface");
    record.column("time", "ms", "median over the rounds, wall time of a frame");
    record.column("time_low", "ms", "fastest round");
    record.column("time_high", "ms", "slowest round");
    record.column("rate", "1/s", "frames a second by the median");
    let sizes = Sizes::of(context);
    let (pixels, budget) = (sizes.pixels, BUDGET >> 20);
    record.notes.push(format!(
        "Frames of {pixels} x {pixels} pixels through the renderer: a primary ray a pixel, \
         headlight, all threads, the views in turns. At most {budget} MB of pages or bricks are in \
         memory. The files were written just before, or read before, so the system may have parts \
         of them in memory: the first frame is not that of a cold disk."
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
    let name = format!("mixing layer, {points} points along x, bytes, isosurface of equal parts");
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
    let volume = Arc::new(data);
    let isovalue = (255.0 * mixing_layer::ISO) as f32;
    let normals = IsosurfaceNormals::Smooth;
    let surface = StoredIsosurface::new(volume.clone(), &[isovalue], normals)?;
    let report = volume.report();
    let row = Row::new()
        .with("data", name.as_str())
        .with("elements", report.points)
        .with("file", report.bytes as f64 / 1e6)
        .with("bytes_per_element", report.bytes as f64 / report.points as f64)
        .with("open", open_secs * 1e3);
    let row = prepare_secs.map_or(row.clone(), |secs| row.with("prepare", secs));
    let views = MixingLayer::views();
    frames(context, record, sizes, Arc::new(surface), &views, &row, &|| volume.page_use())
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
    frames(context, record, sizes, mesh.clone(), &views, &row, &|| mesh.page_use())
}

/// Frames of all views in turns, after a first one of each.
fn frames(
    context: &mut Context<'_>,
    record: &mut Record,
    sizes: &Sizes,
    shape: Arc<dyn Shape>,
    views: &[View],
    row: &Row,
    used: &dyn Fn() -> PageUse,
) -> anyhow::Result<()> {
    let start = Instant::now();
    let placed = Instance { geometry: 0, world_from_object: DAffine3::IDENTITY };
    let geometry = vec![Geometry::Shape(shape)];
    let scene = Scene::new(World::build(geometry, vec![placed], &BuildOptions::default())?);
    let tree_secs = start.elapsed().as_secs_f64();
    let options = RenderOptions::new(sizes.pixels, sizes.pixels);
    let mut cameras: Vec<(&str, Camera)> = vec![];
    let mut rows = vec![];
    for view in views {
        context.report_step(format!("first frame of {}", view.name))?;
        let camera = Framing::At(view.clone()).of(&scene.world, [sizes.pixels; 2])?;
        let start = Instant::now();
        let output = render(&scene, &camera, &options)?;
        let first_secs = start.elapsed().as_secs_f64();
        let pages = used();
        let covered = output.frame.color.iter().filter(|c| c[3] > 0.0).count();
        rows.push(
            row.clone()
                .with("tree", tree_secs * 1e3)
                .with("view", view.name.as_str())
                .with("first_frame", first_secs)
                .with("reads", pages.reads)
                .with("in_memory", pages.peak as f64 / 1e6)
                .with("covered", covered),
        );
        cameras.push((view.name.as_str(), camera));
    }
    context.report_step("frames in turns")?;
    let failed: RefCell<Option<anyhow::Error>> = RefCell::new(None);
    let mut variants: Vec<Variant<'_>> = cameras
        .iter()
        .map(|(name, camera)| {
            let (scene, options, failed) = (&scene, &options, &failed);
            Variant::new(*name, move || match render(scene, camera, options) {
                Ok(output) => output.frame.color.iter().filter(|c| c[3] > 0.0).count() as u64,
                Err(e) => {
                    failed.borrow_mut().get_or_insert(e.into());
                    0
                }
            })
        })
        .collect();
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
