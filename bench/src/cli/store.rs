//! `bench store`: writes meshes to files that are larger than memory, and volumes
//! ([`super::store_volume`]).

use super::store_job::StoreJob;
use super::{StoreArgs, memory_budget, store_cells, store_isosurface, store_volume};
use crate::stored_data::{mixing_layer_pieces, wavelet_surfaces};
use datasets::cli::{Cancel, CommonArgs, CureExt as _, UsageError};
use datasets::isosurface::Options;
use datasets::read::obj_pieces::ObjPieces;
use datasets::read::ply_pieces::PlyPieces;
use datasets::read::stl_pieces::StlPieces;
use datasets::read::volume_planes::VolumePlanes;
use datasets::read::vtk_xml::{PieceFiles, piece_files};
use rt_core::bvh::StoredMeshReport;
use serde_json::json;
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

pub(super) fn store(common: CommonArgs, args: &StoreArgs) -> anyhow::Result<()> {
    if store_volume::is_meant(&args.out) {
        return store_volume::store(common, args);
    }
    let cancel = Cancel::on_ctrl_c()?;
    let start = Instant::now();
    let memory = memory_budget::bytes(args.memory);
    let report = match (&args.file, args.wavelet, args.mixing_layer) {
        (Some(file), None, None) => store_file(common, args, file, memory, &cancel)?,
        (None, Some(millions), None) => store_wavelet(common, args, millions, memory, &cancel)?,
        (None, None, Some(points)) => store_mixing_layer(common, args, points, memory, &cancel)?,
        _ => {
            let text = "give a file, or --wavelet MILLIONS, or --mixing-layer POINTS";
            return Err(UsageError(text.into()).into());
        }
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

/// Extensions of files that name others, which are stored one by one.
const LISTS: [&str; 5] = ["pvtp", "pvtu", "vtm", "vtpd", "vtpc"];

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
    let is_mesh = ["stl", "ply", "obj", "pvtp"].into_iter().any(named);
    let of_volumes = [("--array", args.array.is_some()), ("--isovalue", args.isovalue.is_some())];
    if let Some((option, _)) = of_volumes.into_iter().find(|(_, given)| is_mesh && *given) {
        let file = file.display();
        return Err(UsageError(format!("{option} belongs to volumes, and {file} is a mesh")).into());
    }
    let mut job = StoreJob::new(common, args, memory, cancel);
    // A flat image has no isosurface; it is stored as the surface that it is.
    let planes = VolumePlanes::open(file)?.filter(|p| p.layout().dims.min_element() >= 2);
    if let Some(planes) = planes {
        store_isosurface::of_planes(&mut job, args, file, planes)?;
    } else if named("stl")
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
        let (bar, origin) = (common.progress(pieces.faces(), "storing"), pieces.origin()?);
        while let Some(piece) = pieces.next() {
            job.add_file(file, &piece?, Some(origin))?;
            bar.set_position(pieces.faces_read());
        }
    } else if named("obj") && args.color_by.is_none() {
        let mut pieces = ObjPieces::open(file, PIECE)?;
        let (bar, contents) = (common.progress(pieces.faces(), "storing"), pieces.contents());
        if job.keeps_attributes() && contents.materials {
            job.warn_once("materials are not stored, but colours of vertices are".into());
        }
        if job.keeps_attributes() && contents.texcoords {
            job.warn_once("texture coordinates are not stored".into());
        }
        if job.keeps_attributes() && contents.colors_of_some {
            job.warn_once("colours are not stored: some vertices have none".into());
        }
        if contents.points_and_lines > 0 {
            let count = contents.points_and_lines;
            job.warn_once(format!("{count} points and lines left out: only faces are read"));
        }
        while let Some(piece) = pieces.next() {
            job.add(&piece?)?;
            bar.set_position(pieces.faces_read());
        }
        if job.keeps_attributes() && pieces.normals_left_out() > 0 {
            let count = pieces.normals_left_out();
            job.warn_once(format!(
                "normals of {count} vertices are not stored: others near them have none"
            ));
        }
        if pieces.fanned() > 0 {
            let count = pieces.fanned();
            job.warn_once(format!(
                "{count} faces cross themselves or are too large, and were divided as a fan"
            ));
        }
    } else if LISTS.into_iter().any(named)
        && let Some(PieceFiles { files, .. }) = piece_files(file)?
    {
        let is_divided = named("pvtu");
        store_cells::of_files(&mut job, common, args, &files, is_divided, memory)?;
    } else if !store_cells::of_file(&mut job, common, args, file, memory)? {
        let opened = datasets::read::open(file)?;
        match store_isosurface::field_of(args, &opened)? {
            Some(field) => store_isosurface::of_field(&mut job, args, file, &field)?,
            None => job.add_file(file, &opened, None)?,
        }
    }
    job.finish(file)
}

/// See [`mixing_layer_pieces`].
fn store_mixing_layer(
    common: CommonArgs,
    args: &StoreArgs,
    points: u32,
    memory: usize,
    cancel: &Cancel,
) -> anyhow::Result<StoredMeshReport> {
    let mut job = StoreJob::new(common, args, memory, cancel);
    let options = Options { normals: !args.no_attributes, ..Options::default() };
    let bar = common.progress(u64::from(points), "storing");
    let mut progress = |done, all| {
        bar.set_length(u64::from(all));
        bar.set_position(u64::from(done));
        Ok(cancel.check()?)
    };
    mixing_layer_pieces(points, options, &mut progress, |mesh| job.add(&mesh))?;
    job.finish(&args.out)
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
