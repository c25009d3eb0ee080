//! `bench store`: writes meshes to files that are larger than memory, and volumes
//! ([`super::store_volume`]).

use super::mesh_file::with_origin;
use super::{StoreArgs, store_volume};
use crate::image::subject::{LoadOptions, PartColoring, Subject};
use crate::stored_data::wavelet_surfaces;
use anyhow::Context as _;
use datasets::cli::{Cancel, CommonArgs, CureExt as _, UsageError};
use datasets::read::ply_pieces::PlyPieces;
use datasets::read::stl_pieces::StlPieces;
use datasets::read::vtk_xml::{PieceFiles, piece_files};
use datasets::read::{Content, LoadedFile};
use datasets::{PagedFile, stored_mesh};
use rt_core::bvh::{Geometry, StoredMeshReport, StoredMeshWriter};
use rt_core::glam::DVec3;
use rt_core::mesh::{MeshSlices, TriMesh};
use serde_json::json;
use std::collections::HashSet;
use std::path::Path;
use std::time::Instant;

pub(super) const EXAMPLES: &str = "\
Examples:
  bench store surface.vtp -o surface.rtmesh
  bench store surface.vtp -o surface.rtmesh --color-by pressure --normal-tolerance 0.1
  bench store --wavelet 256 -o wavelet.rtmesh --memory 4096
  bench render wavelet.rtmesh -o wavelet.png --memory 900
  bench store ct.nrrd -o ct.rtvolume
  bench render ct.rtvolume --isovalue 300 -o bone.png --memory 900
  bench store --mixing-layer 2048 -o layer.rtvolume";

/// Megabytes for small pieces, unless the user gives others.
const DEFAULT_MEMORY: u64 = 1024;

pub(super) fn store(common: CommonArgs, args: &StoreArgs) -> anyhow::Result<()> {
    if store_volume::is_meant(&args.out) {
        return store_volume::store(common, args);
    }
    let of_volumes =
        [("--array", args.array.is_some()), ("--mixing-layer", args.mixing_layer.is_some())];
    if let Some((option, _)) = of_volumes.iter().find(|(_, given)| *given) {
        let shown = args.out.display();
        return Err(UsageError(format!(
            "{option} belongs to volumes, and {shown} is a mesh: leave it out, or write to \
             FILE.rtvolume"
        ))
        .into());
    }
    let cancel = Cancel::on_ctrl_c()?;
    let start = Instant::now();
    let memory = args.memory.unwrap_or(DEFAULT_MEMORY);
    let memory = usize::try_from(memory).unwrap_or(usize::MAX).saturating_mul(1 << 20);
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

/// Triangles, or faces, of a file that is read in pieces.
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
    let mut job = StoreJob::new(common, args, memory, cancel);
    if named("stl")
        && args.color_by.is_none()
        && let Some(pieces) = StlPieces::open(file, PIECE)?
    {
        let bar = common.progress(pieces.triangles(), "storing");
        for piece in pieces {
            let mesh = piece?;
            job.add(&mesh)?;
            bar.inc(mesh.num_triangles() as u64);
        }
    } else if named("ply")
        && let Some(mut pieces) = PlyPieces::open(file, PIECE)?
    {
        let (bar, origin) = (common.progress(pieces.faces(), "storing"), pieces.origin());
        while let Some(piece) = pieces.next() {
            job.add_file(file, &piece?, Some(origin))?;
            bar.set_position(pieces.faces_read());
        }
    } else if named("pvtp")
        && let Some(PieceFiles { files, .. }) = piece_files(file)?
    {
        // Not of `.pvtu`: the surface of a volume's pieces would have the faces between them.
        let bar = common.progress(files.len() as u64, "storing");
        for piece in &files {
            let opened = datasets::read::open(piece)?;
            // A process without a part of the surface writes a piece without points, and often
            // without the arrays of the others.
            if !is_empty(&opened) {
                job.add_file(piece, &opened, job.origin())?;
            }
            bar.inc(1);
        }
    } else {
        job.add_file(file, &datasets::read::open(file)?, None)?;
    }
    job.finish(file)
}

/// Whether a file has no points.
fn is_empty(opened: &LoadedFile) -> bool {
    match &opened.content {
        Content::Data(data) => data.leaves().iter().all(|leaf| leaf.counts().0 == 0),
        Content::Scene(_) => false,
    }
}

/// A file that is being written.
struct StoreJob<'a> {
    common: CommonArgs,
    args: &'a StoreArgs,
    memory: usize,
    cancel: &'a Cancel,
    /// Started by the first mesh, whose origin all positions are relative to.
    writer: Option<(StoredMeshWriter<PagedFile>, DVec3)>,
    /// What the user was told: pieces of a file are wanting in the same ways.
    warned: HashSet<String>,
    has_normals: bool,
}

impl<'a> StoreJob<'a> {
    fn new(common: CommonArgs, args: &'a StoreArgs, memory: usize, cancel: &'a Cancel) -> Self {
        let (writer, warned, has_normals) = (None, HashSet::new(), false);
        StoreJob { common, args, memory, cancel, writer, warned, has_normals }
    }

    fn origin(&self) -> Option<DVec3> {
        self.writer.as_ref().map(|(_, origin)| *origin)
    }

    fn warn_once(&mut self, text: String) {
        if !self.warned.contains(&text) {
            let file = self.args.file.as_ref().unwrap_or(&self.args.out);
            self.common.warn(format_args!("{}: {text}", file.display()));
            self.warned.insert(text);
        }
    }

    /// Adds the meshes of a file, or of a piece of it.
    fn add_file(
        &mut self,
        file: &Path,
        opened: &LoadedFile,
        origin: Option<DVec3>,
    ) -> anyhow::Result<()> {
        let options = LoadOptions {
            isovalue: self.args.isovalue,
            color_by: self.args.color_by.clone(),
            origin,
            ..LoadOptions::default()
        };
        let subject = Subject::from_file(opened, &options)
            .with_context(|| format!("{}: no triangles to store", file.display()))?;
        for warning in subject.warnings {
            self.warn_once(warning);
        }
        let all = subject.parts.len();
        let with_materials = subject
            .parts
            .iter()
            .any(|p| matches!(p.coloring, PartColoring::FileMaterial(_) | PartColoring::Glass(_)));
        if with_materials && !self.args.no_attributes {
            self.warn_once("materials are not stored, but colours of vertices are".into());
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
            self.warn_once(format!("{left_out} parts that are not triangles are left out"));
        }
        if meshes.iter().any(|mesh| mesh.texcoords.is_some()) && !self.args.no_attributes {
            self.warn_once("texture coordinates are not stored".into());
        }
        let Some(first) = meshes.first() else { return Ok(()) };
        let origin = self.origin().unwrap_or(first.origin);
        let (meshes, moved) = with_origin(meshes, origin);
        if moved > 0 {
            self.common.note(0, format_args!("{moved} meshes moved to the origin of the first"));
        }
        meshes.iter().try_for_each(|mesh| self.add(mesh))
    }

    /// Adds a mesh, with its attributes unless the user wants none.
    fn add(&mut self, mesh: &TriMesh) -> anyhow::Result<()> {
        self.cancel.check()?;
        let writer = match &mut self.writer {
            Some((writer, _)) => writer,
            None => {
                let mut writer = stored_mesh::create(&self.args.out, mesh.origin)?;
                writer.set_memory(self.memory);
                writer.set_normal_tolerance(self.args.normal_tolerance);
                &mut self.writer.insert((writer, mesh.origin)).0
            }
        };
        self.has_normals |= mesh.normals.is_some();
        if self.args.no_attributes {
            writer.add(&MeshSlices::of_mesh(mesh))?;
        } else {
            writer.add_mesh(mesh)?;
        }
        Ok(())
    }

    fn finish(mut self, file: &Path) -> anyhow::Result<StoredMeshReport> {
        if self.args.normal_tolerance > 0.0 && !self.has_normals {
            self.warn_once("--normal-tolerance has no effect: there are no normals".into());
        }
        let Some((writer, _)) = self.writer else {
            let shown = file.display();
            let text =
                format!("{shown} has no triangles; `bench render {shown}` shows what it has");
            return Err(UsageError(text).into());
        };
        Ok(stored_mesh::finish(writer)?)
    }
}

/// See [`wavelet_surfaces`].
fn store_wavelet(
    common: CommonArgs,
    args: &StoreArgs,
    millions: u32,
    memory: usize,
    cancel: &Cancel,
) -> anyhow::Result<StoredMeshReport> {
    /// Steps of the progress bar.
    const PARTS: u64 = 1000;
    let mut job = StoreJob::new(common, args, memory, cancel);
    let bar = common.progress(PARTS, "storing");
    for surface in
        wavelet_surfaces(millions, !args.no_attributes).cure("give --wavelet fewer millions")?
    {
        let surface = surface.cure("give --wavelet fewer millions")?;
        job.add(&surface.mesh)?;
        bar.set_position((surface.share * PARTS as f64) as u64);
    }
    job.finish(&args.out)
}
