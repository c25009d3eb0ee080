//! Files that `bench store` wrote as the file of `bench render`.

use super::{RenderArgs, memory_budget};
use crate::image::subject::{LoadOptions, Subject, VolumeChoice};
use anyhow::Context as _;
use datasets::cli::UsageError;
use rt_core::bvh::{PageUse, Robustness, Storage, StoredMesh};
use rt_core::stored_volume::StoredVolume;
use serde_json::{Value, json};
use std::io::Read as _;
use std::path::Path;
use std::sync::Arc;

/// An open file.
pub(super) enum StoredFile {
    Mesh(Arc<StoredMesh>),
    Volume {
        volume: Arc<StoredVolume>,
        /// Bytes for the parts of the medium, if it is drawn as one.
        medium: Option<usize>,
    },
}

/// Opens the file, when `bench store` wrote it.
pub(super) fn open(args: &RenderArgs, options: &LoadOptions) -> anyhow::Result<Option<StoredFile>> {
    let mut start = [0; 8];
    // Folders and files that cannot be read are the readers' to report.
    let read = std::fs::File::open(&args.file).and_then(|mut file| file.read_exact(&mut start));
    let memory = memory_budget::bytes(args.memory);
    if read.is_ok() && StoredMesh::recognizes(&start) {
        return open_mesh(args, options, memory).map(|mesh| Some(StoredFile::Mesh(mesh)));
    }
    if read.is_ok() && StoredVolume::recognizes(&start) {
        return open_volume(args, options, memory).map(Some);
    }
    if args.memory.is_some() {
        let file = args.file.display();
        return Err(UsageError(format!(
            "--memory belongs to a stored mesh or volume, and {file} is none; leave it out, or \
             make one with `bench store {file} -o FILE.rtmesh` or, of image data, `-o \
             FILE.rtvolume`"
        ))
        .into());
    }
    Ok(None)
}

/// Refuses the first option that is given and would change nothing.
fn refuse_without_effect(
    file: &Path,
    options: &[(&str, bool)],
    reason: &str,
) -> Result<(), UsageError> {
    let Some((option, _)) = options.iter().find(|(_, given)| *given) else { return Ok(()) };
    Err(UsageError(format!("{option} has no effect on {}: {reason}; leave it out", file.display())))
}

fn open_mesh(
    args: &RenderArgs,
    options: &LoadOptions,
    memory: usize,
) -> anyhow::Result<Arc<StoredMesh>> {
    let without_effect = [
        ("--isovalue", options.isovalue.is_some()),
        ("--volume", options.volume != VolumeChoice::No),
        ("--storage", args.storage != Storage::Plain),
        ("--robustness", args.robustness != Robustness::Watertight),
    ];
    let reason = "a stored mesh has triangles alone, compact and watertight";
    refuse_without_effect(&args.file, &without_effect, reason)?;
    let file = args.file.display();
    if options.color_by.is_some() {
        return Err(UsageError(format!(
            "--color-by has no effect on {file}: the array is chosen when a mesh is stored; leave \
             it out, or give it to `bench store`"
        ))
        .into());
    }
    let mesh = datasets::stored_mesh::open(&args.file, memory)?;
    if args.range.is_some() && mesh.attributes().scalars.is_none() {
        return Err(UsageError(format!(
            "--range has no effect on {file}, which has no scalars; leave it out, or store the \
             mesh with `bench store --color-by ARRAY`"
        ))
        .into());
    }
    Ok(Arc::new(mesh))
}

fn open_volume(
    args: &RenderArgs,
    options: &LoadOptions,
    memory: usize,
) -> anyhow::Result<StoredFile> {
    let is_medium = options.volume != VolumeChoice::No;
    let without_effect = [
        ("--volume", args.volume.is_some()),
        ("--color-by", options.color_by.is_some()),
        ("--storage", args.storage != Storage::Plain),
        ("--robustness", args.robustness != Robustness::Watertight),
    ];
    let reason = "a stored volume has one array without a name, and no triangles; `--effects \
                  volumes` draws it as a medium";
    refuse_without_effect(&args.file, &without_effect, reason)?;
    let reason = "a stored volume is drawn as an isosurface of one colour without `--effects \
                  volumes`";
    refuse_without_effect(&args.file, &[("--range", args.range.is_some() && !is_medium)], reason)?;
    // A part of a medium is made of a brick and the points around it, in single precision: up to
    // six times the bytes that are read.
    let medium = is_medium.then_some(memory / 4 * 3);
    let volume = datasets::stored_volume::open(&args.file, memory - medium.unwrap_or(0))?;
    Ok(StoredFile::Volume { volume: Arc::new(volume), medium })
}

impl StoredFile {
    /// What is drawn.
    pub(super) fn subject(
        &self,
        args: &RenderArgs,
        options: &LoadOptions,
    ) -> anyhow::Result<Subject> {
        match self {
            StoredFile::Mesh(mesh) => Ok(Subject::from_stored_mesh(mesh)),
            StoredFile::Volume { volume, medium } => {
                Subject::from_stored_volume(volume, options.isovalue, *medium)
                    .with_context(|| format!("{}: cannot be drawn so", args.file.display()))
            }
        }
    }

    /// Name of the format.
    pub(super) fn format(&self) -> &'static str {
        match self {
            StoredFile::Mesh(_) => "stored mesh",
            StoredFile::Volume { .. } => "stored volume",
        }
    }

    /// Triangles of a mesh.
    pub(super) fn triangles(&self) -> u64 {
        match self {
            StoredFile::Mesh(mesh) => mesh.report().triangles,
            StoredFile::Volume { .. } => 0,
        }
    }

    /// What was read of it, for the result in JSON.
    pub(super) fn page_use(&self) -> Value {
        let object = |pages: PageUse, number: u64, bytes: u64| {
            json!({
                "pages": number,
                "bytes": bytes,
                "page_reads": pages.reads,
                "peak_bytes": pages.peak,
            })
        };
        match self {
            StoredFile::Mesh(mesh) => {
                let report = mesh.report();
                object(mesh.page_use(), report.pages, report.bytes)
            }
            StoredFile::Volume { volume, .. } => {
                let report = volume.report();
                object(volume.page_use(), report.bricks, report.bytes)
            }
        }
    }
}
