//! `datasets info`.

use super::open_args::OpenArgs;
use clap::Args;
use datasets::cli::CommonArgs;
use datasets::model::{DataArray, Dataset};
use datasets::read::{self, Content, SceneModel};
use serde::Serialize;
use std::path::PathBuf;

/// Options of `datasets info`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  datasets info wavelet.vtp
  datasets info case --time 0.002
  datasets info --json jet.vti | jq '.parts[].arrays[].name'")]
pub(super) struct InfoArgs {
    /// A file of any format that can be read, or the folder of an OpenFOAM case or
    /// AMReX plotfile
    file: PathBuf,
    #[command(flatten)]
    open: OpenArgs,
}

#[derive(Serialize)]
struct Info {
    file: String,
    format: &'static str,
    kind: &'static str,
    points: u64,
    cells: u64,
    materials: usize,
    textures: usize,
    /// Blocks of a collection, meshes of a scene, or the one data set.
    parts: Vec<Part>,
    /// Times of a series or case; the other fields describe the one that was read.
    times: Vec<f64>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct Part {
    name: String,
    kind: &'static str,
    points: u64,
    cells: u64,
    arrays: Vec<Array>,
}

#[derive(Serialize)]
struct Array {
    name: String,
    /// `point`, `cell` or `field`.
    of: &'static str,
    #[serde(rename = "type")]
    scalar_type: &'static str,
    components: usize,
    tuples: usize,
    /// Smallest and largest finite value; for a vector, those of its magnitude.
    range: Option<(f64, f64)>,
}

/// Prints what a file holds.
pub(super) fn info(common: CommonArgs, args: &InfoArgs) -> anyhow::Result<()> {
    let file = read::open_with(&args.file, &args.open.options())?;
    let mut info = Info {
        file: args.file.display().to_string(),
        format: file.format,
        kind: "scene",
        points: 0,
        cells: 0,
        materials: 0,
        textures: 0,
        parts: vec![],
        times: file.time_steps.iter().map(|t| t.time).collect(),
        warnings: file.warnings.clone(),
    };
    match &file.content {
        Content::Data(data) => {
            info.kind = data.kind();
            add_parts(data, "", &mut info.parts);
        }
        Content::Scene(scene) => {
            (info.materials, info.textures) = (scene.materials.len(), scene.textures.len());
            add_meshes(scene, &mut info.parts);
        }
    }
    info.points = info.parts.iter().fold(0, |sum, p| sum.saturating_add(p.points));
    info.cells = info.parts.iter().fold(0, |sum, p| sum.saturating_add(p.cells));
    common.result(&info, || text(&info))
}

fn add_parts(data: &Dataset, name: &str, parts: &mut Vec<Part>) {
    if let Dataset::MultiBlock(blocks) = data {
        blocks.iter().for_each(|b| add_parts(&b.data, &b.name, parts));
        return;
    }
    let (points, cells) = data.counts();
    let mut arrays = vec![];
    if let Some(a) = data.attributes() {
        for (of, list) in [("point", &a.point), ("cell", &a.cell), ("field", &a.field)] {
            arrays.extend(list.iter().map(|array| describe(array, of)));
        }
    }
    parts.push(Part { name: name.into(), kind: data.kind(), points, cells, arrays });
}

fn describe(array: &DataArray, of: &'static str) -> Array {
    Array {
        name: array.name.clone(),
        of,
        scalar_type: array.values.kind().name(),
        components: array.components,
        tuples: array.tuples(),
        range: array.range(),
    }
}

fn add_meshes(scene: &SceneModel, parts: &mut Vec<Part>) {
    for m in &scene.meshes {
        let (points, cells) = (m.mesh.positions.len() as u64, m.mesh.num_triangles() as u64);
        parts.push(Part { name: m.name.clone(), kind: "mesh", points, cells, arrays: vec![] });
    }
}

fn text(info: &Info) -> String {
    let mut lines = vec![
        format!("{}: {}, {}", info.file, info.format, info.kind),
        format!("  {} points, {} cells", info.points, info.cells),
    ];
    if info.materials > 0 {
        lines.push(format!("  {} materials, {} textures", info.materials, info.textures));
    }
    if let [first, .., last] = info.times.as_slice() {
        lines.push(format!("  {} times from {first} to {last}", info.times.len()));
    }
    for part in &info.parts {
        if info.parts.len() > 1 || !part.name.is_empty() {
            let (name, kind) = (&part.name, part.kind);
            lines.push(format!("  {name}: {kind}, {} points, {} cells", part.points, part.cells));
        }
        for a in &part.arrays {
            let range = a
                .range
                .map_or_else(|| "no finite value".into(), |(lo, hi)| format!("{lo} to {hi}"));
            let times =
                if a.components == 1 { String::new() } else { format!(" x {}", a.components) };
            lines.push(format!(
                "    {} array `{}`: {}{times}, {range}",
                a.of, a.name, a.scalar_type
            ));
        }
    }
    lines.extend(info.warnings.iter().map(|w| format!("  warning: {w}")));
    lines.join("\n")
}
