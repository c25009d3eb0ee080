//! Data in files that may be larger than memory: a volume of bytes, as an implicit isosurface and
//! as a medium, and a mesh in pages. `bench run --thesis stored-files` takes the dissertation's
//! own sizes.

mod frames;
mod meshes;
mod volume;

use super::Context;
use crate::record::Record;
use anyhow::Context as _;
use datasets::cache::MeshCache;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Bytes of pages and bricks in memory.
const BUDGET: usize = 6 << 30;
/// How large the data are.
struct Sizes {
    /// Points of the mixing layer along x.
    layer: u32,
    /// Million triangles of the wavelet.
    wavelet: u32,
    /// Points of the plasma along y.
    plasma: u32,
    pixels: u32,
}

impl Sizes {
    fn of(context: &Context<'_>) -> Sizes {
        match (context.quick, context.thesis) {
            (true, _) => Sizes { layer: 128, wavelet: 1, plasma: 128, pixels: 256 },
            (false, false) => Sizes { layer: 512, wavelet: 16, plasma: 512, pixels: 1024 },
            (false, true) => Sizes { layer: 2048, wavelet: 256, plasma: 2048, pixels: 1024 },
        }
    }

    /// Bytes of all files, and a tenth more.
    fn bytes(&self) -> u64 {
        let layer = u64::from(self.layer).pow(3) * 15 / 16 * 11 / 10;
        let triangles = meshes::ALL.iter().map(|mesh| mesh.triangles(self)).sum::<u64>();
        (layer + triangles * 20) * 11 / 10
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
    record.column("budget", "MB", "bytes that pages may take, where that is a part of the file");
    record.column("differs", "", "pixels that differ from those of the frame with room for all");
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
    context.part(record, "volume", |context, record| {
        volume::measure(context, record, &folder, &sizes)
    })?;
    for mesh in meshes::ALL {
        context.part(record, &mesh.name(&sizes), |context, record| {
            meshes::measure(context, record, &folder, &sizes, mesh)
        })?;
    }
    Ok(())
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
        let there = folder.layer(sizes).exists()
            && meshes::ALL.iter().all(|mesh| folder.mesh(*mesh, sizes).exists());
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

    fn mesh(&self, mesh: meshes::Stored, sizes: &Sizes) -> PathBuf {
        self.path.join(mesh.file_name(sizes))
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
