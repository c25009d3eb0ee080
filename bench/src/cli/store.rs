//! `bench store`: writes meshes to files that are larger than memory.

use super::StoreArgs;
use super::mesh_file::with_origin;
use crate::image::subject::{LoadOptions, PartColoring, Subject};
use anyhow::Context as _;
use datasets::cli::{Cancel, CommonArgs, CureExt as _, UsageError};
use datasets::generate::nested_wavelet::{POINTS, isovalues_for};
use datasets::generate::wavelet::Wavelet;
use datasets::isosurface::{self, Options};
use datasets::read::LoadedFile;
use datasets::read::ply_pieces::PlyPieces;
use datasets::read::stl_pieces::StlPieces;
use datasets::read::vtk_xml::{PieceFiles, piece_files};
use datasets::stored_mesh::{self, StoredMeshFile};
use rt_core::bvh::{Geometry, StoredMeshError, StoredMeshReport, StoredMeshWriter};
use rt_core::glam::DVec3;
use rt_core::mesh::{MeshSlices, TriMesh};
use serde_json::json;
use std::path::Path;
use std::sync::Arc;
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

/// Triangles of a file that is read in pieces.
const PIECE: usize = 1 << 20;

/// The triangles of a file: in pieces where its format allows it, else mesh by mesh.
fn store_file(
    common: CommonArgs,
    args: &StoreArgs,
    file: &Path,
    memory: usize,
    cancel: &Cancel,
) -> anyhow::Result<StoredMeshReport> {
    let named =
        |extension: &str| file.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension));
    if named("stl")
        && args.color_by.is_none()
        && let Some(pieces) = StlPieces::open(file, PIECE)?
    {
        return store_stl(common, args, pieces, memory, cancel);
    }
    if named("ply")
        && let Some(pieces) = PlyPieces::open(file, PIECE)?
    {
        let bar = common.progress(pieces.faces(), "storing");
        let mut stored = None;
        for piece in pieces {
            let meshes = triangles_of(common, args, file, &piece?, origin_of(&stored))?;
            let faces: usize = meshes.iter().map(|mesh| mesh.num_triangles()).sum();
            add_all(common, args, meshes, &mut stored, memory, cancel)?;
            bar.inc(faces as u64);
        }
        return finish(file, stored);
    }
    // The surface of a volume's pieces would have the faces between them.
    if named("pvtp")
        && let Some(PieceFiles { files, .. }) = piece_files(file)?
    {
        let mut stored = None;
        for (number, piece) in files.iter().enumerate() {
            common.note(1, format_args!("piece {} of {}", number + 1, files.len()));
            let opened = datasets::read::open(piece)?;
            let meshes = triangles_of(common, args, piece, &opened, origin_of(&stored))?;
            add_all(common, args, meshes, &mut stored, memory, cancel)?;
        }
        return finish(file, stored);
    }
    let meshes = triangles_of(common, args, file, &datasets::read::open(file)?, None)?;
    let mut stored = None;
    add_all(common, args, meshes, &mut stored, memory, cancel)?;
    finish(file, stored)
}

/// A file that is being written, and the origin of its positions.
type Stored = (StoredMeshWriter<StoredMeshFile>, DVec3);

/// The origin of the pieces before, which the next one shares.
fn origin_of(stored: &Option<Stored>) -> Option<DVec3> {
    stored.as_ref().map(|(_, origin)| *origin)
}

fn finish(file: &Path, stored: Option<Stored>) -> anyhow::Result<StoredMeshReport> {
    let Some((writer, _)) = stored else {
        let shown = file.display();
        let text = format!("{shown} has no triangles; `bench render {shown}` shows what it has");
        return Err(UsageError(text).into());
    };
    Ok(stored_mesh::finish(writer)?)
}

fn store_stl(
    common: CommonArgs,
    args: &StoreArgs,
    pieces: StlPieces,
    memory: usize,
    cancel: &Cancel,
) -> anyhow::Result<StoredMeshReport> {
    let mut writer = stored_mesh::create(&args.out, DVec3::ZERO)?;
    writer.set_memory(memory);
    let bar = common.progress(pieces.triangles(), "storing");
    for piece in pieces {
        cancel.check()?;
        let piece = piece?;
        writer.add(&MeshSlices::of_mesh(&piece))?;
        bar.inc(piece.num_triangles() as u64);
    }
    Ok(stored_mesh::finish(writer)?)
}

/// The meshes of a file, or of a piece of it.
fn triangles_of(
    common: CommonArgs,
    args: &StoreArgs,
    file: &Path,
    opened: &LoadedFile,
    origin: Option<DVec3>,
) -> anyhow::Result<Vec<Arc<TriMesh>>> {
    let shown = file.display();
    let options = LoadOptions {
        isovalue: args.isovalue,
        color_by: args.color_by.clone(),
        origin,
        ..LoadOptions::default()
    };
    let subject = Subject::from_file(opened, &options)
        .with_context(|| format!("{shown}: no triangles to store"))?;
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
    if meshes.len() < all {
        let left_out = all - meshes.len();
        common.warn(format_args!("{shown}: {left_out} parts that are not triangles are left out"));
    }
    if meshes.iter().any(|mesh| mesh.texcoords.is_some()) && !args.no_attributes {
        common.warn(format_args!("{shown}: texture coordinates are not stored"));
    }
    Ok(meshes)
}

/// Adds meshes to the file, which the first of them starts.
fn add_all(
    common: CommonArgs,
    args: &StoreArgs,
    meshes: Vec<Arc<TriMesh>>,
    stored: &mut Option<Stored>,
    memory: usize,
    cancel: &Cancel,
) -> anyhow::Result<()> {
    let Some(first) = meshes.first() else { return Ok(()) };
    let (writer, origin) = match stored {
        Some(stored) => stored,
        None => {
            let mut writer = stored_mesh::create(&args.out, first.origin)?;
            writer.set_memory(memory);
            writer.set_normal_tolerance(args.normal_tolerance);
            stored.insert((writer, first.origin))
        }
    };
    let (meshes, moved) = with_origin(meshes, *origin);
    if moved > 0 {
        common.note(0, format_args!("{moved} meshes moved to the origin of the first"));
    }
    for mesh in meshes {
        cancel.check()?;
        add(writer, args, &mesh)?;
    }
    Ok(())
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
