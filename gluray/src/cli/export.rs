//! `gluray export`.

use crate::host::export::{ConvertReport, Scene, read_scene, scenes_folder, to_mesh, to_poly_data};
use anyhow::Context;
use clap::Args;
use datasets::cli::{CommonArgs, CureExt, UsageError};
use datasets::model::Dataset;
use datasets::write::{VtkOptions, write_glb, write_obj, write_ply, write_vtk};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Options of `gluray export`.
#[derive(Debug, Args)]
#[command(
    after_help = "A program writes its scene when the panel's `export the scene` is pressed, or to \
                  the file that GLURAY_DUMP names.

Examples:
  gluray export -o scene.glb                          the newest scene
  gluray export scene.gluray -o a.ply -o a.vtp
  gluray export scene.gluray --list
  gluray export scene.gluray --object 3f2a -o part.ply"
)]
pub(super) struct ExportArgs {
    /// The scene; without it the newest that the panel asked for
    scene: Option<PathBuf>,
    /// Where to write: .ply, .glb, .vtp or .obj; several times for several files
    #[arg(short, long = "output", value_name = "FILE")]
    output: Vec<PathBuf>,
    /// Only this object; several times for several
    #[arg(long = "object", value_name = "KEY")]
    objects: Vec<String>,
    /// List the objects and write nothing
    #[arg(long, conflicts_with = "output")]
    list: bool,
}

pub(super) fn export(common: CommonArgs, args: &ExportArgs) -> anyhow::Result<()> {
    if args.output.is_empty() && !args.list {
        return Err(UsageError("nothing to do: give -o FILE, or --list".into()).into());
    }
    const ENDINGS: [&str; 4] = ["ply", "glb", "vtp", "obj"];
    for file in &args.output {
        if !ending(file).is_some_and(|e| ENDINGS.contains(&e.as_str())) {
            return Err(UsageError(format!(
                "{}: no known ending; give {}",
                file.display(),
                ENDINGS.map(|e| format!(".{e}")).join(", ")
            ))
            .into());
        }
    }
    let path = match &args.scene {
        Some(path) => path.clone(),
        None => newest().context("no scene is named, and no program has written one").cure(
            "press `export the scene` on the panel, or run the program with \
             GLURAY_DUMP=scene.gluray",
        )?,
    };
    let scene = read_scene(&path)?;
    if let Some(key) = args.objects.iter().find(|k| !scene.objects.iter().any(|o| o.key == **k)) {
        return Err(UsageError(format!(
            "{}: there is no object `{key}`; --list shows them",
            path.display()
        ))
        .into());
    }
    if args.list {
        return list(common, &scene);
    }
    for file in &args.output {
        let report = write(common, file, &scene, &args.objects)
            .with_context(|| format!("from {}", path.display()))?;
        report.warnings().iter().for_each(|w| common.warn(w));
        let written = json!({ "file": file, "scene": path, "program": scene.program, "frame": scene.frame, "left_out_triangles": report.nowhere });
        common.result(&written, || format!("{}", file.display()))?;
    }
    Ok(())
}

fn ending(file: &Path) -> Option<String> {
    file.extension().map(|e| e.to_string_lossy().to_ascii_lowercase())
}

fn write(
    common: CommonArgs,
    file: &Path,
    scene: &Scene,
    objects: &[String],
) -> anyhow::Result<ConvertReport> {
    let report = match ending(file).as_deref() {
        Some("vtp") => {
            let (poly, report) = to_poly_data(scene, objects);
            write_vtk(file, &Dataset::PolyData(poly), VtkOptions::default())?;
            report
        }
        Some(other) => {
            let (mut mesh, report) = to_mesh(scene, objects);
            match other {
                "ply" => write_ply(file, &mesh)?,
                "obj" => {
                    mesh.colors = None;
                    common.warn(format_args!(
                        "{}: OBJ cannot hold colours; PLY, GLB and VTP can",
                        file.display()
                    ));
                    write_obj(file, &mesh)?;
                }
                _ => write_glb(file, &mesh)?,
            }
            report
        }
        None => ConvertReport::default(),
    };
    Ok(report)
}

fn list(common: CommonArgs, scene: &Scene) -> anyhow::Result<()> {
    for o in &scene.objects {
        let value = json!({ "key": o.key, "name": o.name, "vertices": o.positions.len(), "triangles": o.indices.len(), "color": o.color });
        common.result(&value, || {
            format!("{:<20} {:>10} triangles  {}", o.key, o.indices.len(), o.name)
        })?;
    }
    Ok(())
}

fn newest() -> Option<PathBuf> {
    let folder = scenes_folder(crate::host::folders::variable)?;
    let files = std::fs::read_dir(folder).ok()?.filter_map(Result::ok).map(|e| e.path());
    files
        .filter(|p| ending(p).as_deref() == Some("gluray"))
        .max_by_key(|p| p.metadata().and_then(|m| m.modified()).ok())
}
