//! Stored meshes as the file of `bench render`.

use super::RenderArgs;
use crate::image::subject::{LoadOptions, VolumeChoice};
use datasets::cli::UsageError;
use rt_core::bvh::StoredMesh;
use serde_json::{Value, json};
use std::io::Read as _;
use std::sync::Arc;

/// The file as a stored mesh, when it is one.
pub(super) fn open(
    args: &RenderArgs,
    options: &LoadOptions,
) -> anyhow::Result<Option<Arc<StoredMesh>>> {
    let mut start = [0; 8];
    // Folders and files that cannot be read are the readers' to report.
    let read = std::fs::File::open(&args.file).and_then(|mut file| file.read_exact(&mut start));
    if read.is_err() || !StoredMesh::recognizes(&start) {
        return Ok(None);
    }
    let without_effect = [
        ("--color-by", options.color_by.is_some()),
        ("--isovalue", options.isovalue.is_some()),
        ("--volume", options.volume != VolumeChoice::No),
        ("--range", args.range.is_some()),
    ];
    if let Some((option, _)) = without_effect.iter().find(|(_, given)| *given) {
        let file = args.file.display();
        return Err(UsageError(format!(
            "{option} has no effect on {file}, which holds triangles alone; leave it out"
        ))
        .into());
    }
    let memory = usize::try_from(args.memory).unwrap_or(usize::MAX).saturating_mul(1 << 20);
    Ok(Some(Arc::new(datasets::stored_mesh::open(&args.file, memory)?)))
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
