//! Stored meshes as the file of `bench render`.

use super::RenderArgs;
use crate::image::subject::{LoadOptions, VolumeChoice};
use datasets::cli::UsageError;
use rt_core::bvh::{Robustness, Storage, StoredMesh};
use serde_json::{Value, json};
use std::io::Read as _;
use std::sync::Arc;

/// Megabytes for pages, unless the user gives others.
const DEFAULT_MEMORY: u64 = 1024;

/// The file as a stored mesh, when it is one.
pub(super) fn open(
    args: &RenderArgs,
    options: &LoadOptions,
) -> anyhow::Result<Option<Arc<StoredMesh>>> {
    let mut start = [0; 8];
    // Folders and files that cannot be read are the readers' to report.
    let read = std::fs::File::open(&args.file).and_then(|mut file| file.read_exact(&mut start));
    let file = args.file.display();
    if read.is_err() || !StoredMesh::recognizes(&start) {
        if args.memory.is_some() {
            return Err(UsageError(format!(
                "--memory belongs to a stored mesh, and {file} is none; leave it out, or make one \
                 with `bench store {file} -o FILE.rtmesh`"
            ))
            .into());
        }
        return Ok(None);
    }
    let without_effect = [
        ("--isovalue", options.isovalue.is_some()),
        ("--volume", options.volume != VolumeChoice::No),
        ("--storage", args.storage != Storage::Plain),
        ("--robustness", args.robustness != Robustness::Watertight),
    ];
    if let Some((option, _)) = without_effect.iter().find(|(_, given)| *given) {
        return Err(UsageError(format!(
            "{option} has no effect on {file}: a stored mesh has triangles alone, compact and \
             watertight; leave it out"
        ))
        .into());
    }
    if options.color_by.is_some() {
        return Err(UsageError(format!(
            "--color-by has no effect on {file}: the array is chosen when a mesh is stored; leave \
             it out, or give it to `bench store`"
        ))
        .into());
    }
    let memory = args.memory.unwrap_or(DEFAULT_MEMORY);
    let memory = usize::try_from(memory).unwrap_or(usize::MAX).saturating_mul(1 << 20);
    let mesh = datasets::stored_mesh::open(&args.file, memory)?;
    if args.range.is_some() && mesh.attributes().scalars.is_none() {
        return Err(UsageError(format!(
            "--range has no effect on {file}, which has no scalars; leave it out, or store the \
             mesh with `bench store --color-by ARRAY`"
        ))
        .into());
    }
    Ok(Some(Arc::new(mesh)))
}

/// What was read of it, for the result in JSON.
pub(super) fn page_use(mesh: &StoredMesh) -> Value {
    let (report, pages) = (mesh.report(), mesh.page_use());
    json!({
        "pages": report.pages,
        "bytes": report.bytes,
        "page_reads": pages.reads,
        "peak_bytes": pages.peak,
    })
}
