//! Writes a result. The extension of the file name decides the format.

use clap::Args;
use datasets::cli::{CommonArgs, UsageError};
use datasets::model::{Dataset, PolyData};
use datasets::write::{Encoding, VtkOptions, write_glb, write_obj, write_ply, write_vtk};
use rt_core::mesh::TriMesh;
use serde::Serialize;
use std::path::Path;

/// Extensions of the VTK files that can be written.
const VTK: [&str; 6] = ["vti", "vtp", "vtu", "vtr", "vts", "vtm"];
/// Extensions of the mesh files that can be written.
const MESHES: [&str; 3] = ["ply", "obj", "glb"];

/// How VTK files are written.
#[derive(Debug, Clone, Copy, Args)]
pub(super) struct EncodingArgs {
    /// VTK files as text, which is larger and cannot hold NaN
    #[arg(long, conflicts_with = "compress")]
    ascii: bool,
    /// VTK files compressed with zlib
    #[arg(long)]
    compress: bool,
}

/// Content of an output file.
#[expect(clippy::large_enum_variant, reason = "one value a run")]
pub(super) enum Content {
    /// Triangles.
    Mesh(TriMesh),
    /// Any data set.
    Data(Dataset),
}

/// Summary of what was written.
#[derive(Debug, Default, Serialize)]
pub(super) struct Output<'a> {
    /// Name in the catalogue.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) data: Option<&'a str>,
    /// Name of the size.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) size: Option<&'a str>,
    pub(super) file: String,
    pub(super) kind: &'static str,
    pub(super) points: u64,
    pub(super) cells: u64,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) warnings: Vec<String>,
}

/// Returns the file extension in lower case; an error names the supported ones.
pub(super) fn check_name(path: &Path) -> Result<String, UsageError> {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let mut known = VTK.iter().chain(&MESHES);
    if known.any(|k| *k == ending) {
        return Ok(ending);
    }
    let all: Vec<String> = VTK.iter().chain(&MESHES).map(|k| format!(".{k}")).collect();
    let name = path.display();
    Err(UsageError(format!(
        "{name}: no format that can be written; end the name in {}",
        all.join(", ")
    )))
}

/// Writes `content` in the format of the file extension. A data set of another kind becomes its
/// surface, which keeps the array `color_by`.
pub(super) fn write(
    path: &Path,
    content: Content,
    encoding: EncodingArgs,
    color_by: Option<&str>,
) -> anyhow::Result<Output<'static>> {
    let ending = check_name(path)?;
    let mut warnings = vec![];
    if MESHES.contains(&ending.as_str()) {
        if encoding.ascii || encoding.compress {
            return Err(UsageError("--ascii and --compress are for VTK files".into()).into());
        }
        let mesh = match content {
            Content::Mesh(mesh) => mesh,
            Content::Data(data) => surface(&data, color_by, &mut warnings)?,
        };
        match ending.as_str() {
            "ply" => write_ply(path, &mesh)?,
            "obj" => write_obj(path, &mesh)?,
            _ => write_glb(path, &mesh)?,
        }
        let (points, cells) = (mesh.positions.len() as u64, mesh.num_triangles() as u64);
        let file = path.display().to_string();
        return Ok(Output { file, kind: "mesh", points, cells, warnings, ..Output::default() });
    }
    let data = match content {
        Content::Mesh(mesh) => Dataset::PolyData(PolyData::from_trimesh(&mesh)),
        Content::Data(data @ Dataset::PolyData(_)) if color_by.is_none() => data,
        // Only this format is limited to surfaces; the writer rejects other mismatches.
        Content::Data(data) if ending == "vtp" => {
            let mesh = surface(&data, color_by, &mut warnings)?;
            Dataset::PolyData(PolyData::from_trimesh(&mesh))
        }
        Content::Data(data) => data,
    };
    let options = VtkOptions {
        encoding: if encoding.ascii { Encoding::Ascii } else { Encoding::Base64 },
        compress: encoding.compress,
    };
    write_vtk(path, &data, options)?;
    let (points, cells) = data.counts();
    let file = path.display().to_string();
    Ok(Output { file, kind: data.kind(), points, cells, warnings, ..Output::default() })
}

fn surface(
    data: &Dataset,
    color_by: Option<&str>,
    warnings: &mut Vec<String>,
) -> anyhow::Result<TriMesh> {
    let (mesh, report) = data.to_trimesh(color_by)?;
    warnings.extend(report.warnings());
    let arrays = |d: &&Dataset| d.attributes().map_or(0, |a| a.point.len() + a.cell.len());
    if color_by.is_none() && data.leaves().iter().map(arrays).sum::<usize>() > 0 {
        warnings.push("a surface keeps no array unless --color-by names one".into());
    }
    Ok(mesh)
}

/// Prints the summary: warnings to stderr, the rest to stdout.
pub(super) fn report(common: CommonArgs, output: &Output<'_>) -> anyhow::Result<()> {
    output.warnings.iter().for_each(|w| common.warn(w));
    common.result(output, || {
        format!(
            "{}: {}, {} points, {} cells",
            output.file, output.kind, output.points, output.cells
        )
    })
}
