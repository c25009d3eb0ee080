//! `bench store`: writes meshes to files that are larger than memory.

use super::StoreArgs;
use super::mesh_file::with_one_origin;
use crate::image::subject::{LoadOptions, PartColoring, Subject};
use anyhow::Context as _;
use datasets::cli::{Cancel, CommonArgs, CureExt as _, UsageError};
use datasets::generate::nested_wavelet::{POINTS, isovalues_for};
use datasets::generate::wavelet::Wavelet;
use datasets::isosurface::{self, Options};
use datasets::stored_mesh::{self, StoredMeshFile};
use rt_core::bvh::{Geometry, StoredMeshError, StoredMeshReport, StoredMeshWriter};
use rt_core::glam::DVec3;
use rt_core::mesh::{MeshSlices, TriMesh};
use serde_json::json;
use std::time::Instant;

pub(super) const EXAMPLES: &str = "\
Examples:
  bench store surface.vtp -o surface.rtmesh
  bench store surface.vtp -o surface.rtmesh --color-by pressure --normal-tolerance 0.1
  bench store --wavelet 256 -o wavelet.rtmesh --memory 4096
  bench render wavelet.rtmesh -o wavelet.png --memory 900";

pub(super) fn store(common: CommonArgs, args: &StoreArgs) -> anyhow::Result<()> {
    let cancel = Cancel::on_ctrl_c()?;
    let start = Instant::now();
    let memory = usize::try_from(args.memory).unwrap_or(usize::MAX).saturating_mul(1 << 20);
    let report = match (&args.file, args.wavelet) {
        (Some(file), None) => store_file(common, args, file, memory, &cancel)?,
        (None, Some(millions)) => store_wavelet(common, args, millions, memory, &cancel)?,
        _ => return Err(UsageError("give a file, or --wavelet MILLIONS".into()).into()),
    };
    let seconds = start.elapsed().as_secs_f64();
    let shown = args.out.display();
    if report.skipped > 0 {
        common.warn(format_args!(
            "{shown}: {} of {} triangles are left out: a corner does not exist or is not finite",
            report.skipped, report.triangles
        ));
    }
    let object = json!({
        "output": args.out,
        "triangles": report.triangles,
        "skipped": report.skipped,
        "pages": report.pages,
        "bytes": report.bytes,
        "attribute_bytes": report.attribute_bytes,
        "seconds": seconds,
    });
    common.result(&object, || {
        format!(
            "{shown}: {} triangles in {} pages, {:.1} bytes a triangle, {seconds:.1} s; draw it \
             with `bench render {shown} -o IMAGE.png`",
            report.triangles,
            report.pages,
            report.bytes as f64 / report.triangles.max(1) as f64
        )
    })
}

/// The triangles of a file, mesh by mesh.
fn store_file(
    common: CommonArgs,
    args: &StoreArgs,
    file: &std::path::Path,
    memory: usize,
    cancel: &Cancel,
) -> anyhow::Result<StoredMeshReport> {
    let shown = file.display();
    let opened = datasets::read::open(file)?;
    let options = LoadOptions {
        isovalue: args.isovalue,
        color_by: args.color_by.clone(),
        ..LoadOptions::default()
    };
    let subject = Subject::from_file(&opened, &options)
        .with_context(|| format!("{shown}: no triangles to store"))?;
    drop(opened);
    for warning in &subject.warnings {
        common.warn(format_args!("{shown}: {warning}"));
    }
    let all = subject.parts.len();
    let with_materials = subject
        .parts
        .iter()
        .any(|p| matches!(p.coloring, PartColoring::FileMaterial(_) | PartColoring::Glass(_)));
    if with_materials && !args.no_attributes {
        common.warn(format_args!("{shown}: materials are not stored, but colours of vertices are"));
    }
    let meshes: Vec<_> = subject
        .parts
        .into_iter()
        .filter_map(|part| match part.geometry {
            Geometry::Mesh(mesh) => Some(mesh),
            Geometry::Shape(_) | Geometry::Slices(_) => None,
        })
        .collect();
    let Some(first) = meshes.first() else {
        let text = format!("{shown} has no triangles; `bench render {shown}` shows what it has");
        return Err(UsageError(text).into());
    };
    if meshes.len() < all {
        let left_out = all - meshes.len();
        common.warn(format_args!("{shown}: {left_out} parts that are not triangles are left out"));
    }
    if meshes.iter().any(|mesh| mesh.texcoords.is_some()) && !args.no_attributes {
        common.warn(format_args!("{shown}: texture coordinates are not stored"));
    }
    let origin = first.origin;
    let (meshes, moved) = with_one_origin(meshes);
    if moved > 0 {
        common.note(0, format_args!("{shown}: {moved} meshes moved to the origin of the first"));
    }
    let mut writer = stored_mesh::create(&args.out, origin)?;
    writer.set_memory(memory);
    writer.set_normal_tolerance(args.normal_tolerance);
    let bar = common.progress(meshes.len() as u64, "storing");
    for (number, mesh) in meshes.into_iter().enumerate() {
        cancel.check()?;
        add(&mut writer, args, &mesh)?;
        bar.set_position(number as u64 + 1);
    }
    Ok(stored_mesh::finish(writer)?)
}

/// Nested isosurfaces of the wavelet, one after the other: the dissertation's scaling series
/// (section 4.3), which goes to 256 million triangles.
fn store_wavelet(
    common: CommonArgs,
    args: &StoreArgs,
    millions: u32,
    memory: usize,
    cancel: &Cancel,
) -> anyhow::Result<StoredMeshReport> {
    let grid = Wavelet::with_points(POINTS).grid()?;
    let isovalues = isovalues_for(&grid, millions as usize * 1_000_000)?;
    let mut writer = stored_mesh::create(&args.out, DVec3::ZERO)?;
    writer.set_memory(memory);
    writer.set_normal_tolerance(args.normal_tolerance);
    let options = Options { normals: !args.no_attributes, ..Options::default() };
    let bar = common.progress(isovalues.len() as u64, "storing");
    for (number, isovalue) in isovalues.iter().enumerate() {
        cancel.check()?;
        let surface = isosurface::extract(&grid, &[*isovalue], options)
            .cure("give --wavelet fewer millions")?;
        add(&mut writer, args, &surface.mesh)?;
        bar.set_position(number as u64 + 1);
    }
    Ok(stored_mesh::finish(writer)?)
}

/// Adds a mesh, with its attributes unless the user wants none.
fn add(
    writer: &mut StoredMeshWriter<StoredMeshFile>,
    args: &StoreArgs,
    mesh: &TriMesh,
) -> Result<(), StoredMeshError> {
    if args.no_attributes { writer.add(&MeshSlices::of_mesh(mesh)) } else { writer.add_mesh(mesh) }
}
