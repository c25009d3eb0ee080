//! `datasets info`.

use super::description::{Array, Info, Part, Stored};
use super::open_args::OpenArgs;
use super::stored_file;
use clap::Args;
use datasets::cli::CommonArgs;
use datasets::model::{DataArray, Dataset};
use datasets::read::{self, Content, SceneModel};
use std::path::PathBuf;

/// Options of `datasets info`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  datasets info wavelet.vtp
  datasets info case --time 0.002
  datasets info --json jet.vti | jq '.parts[].arrays[].name'")]
pub(super) struct InfoArgs {
    /// A file of any format that can be read, or the folder of an OpenFOAM case or
    /// AMReX plotfile, or what `bench store` wrote
    file: PathBuf,
    #[command(flatten)]
    open: OpenArgs,
}

/// Prints what a file holds.
pub(super) fn info(common: CommonArgs, args: &InfoArgs) -> anyhow::Result<()> {
    if let Some(info) = stored_file::describe(&args.file)? {
        return print(common, info);
    }
    let file = read::open_with(&args.file, &args.open.options())?;
    let mut info = Info::new(&args.file, file.format, "scene");
    info.times = file.time_steps.iter().map(|t| t.time).collect();
    info.warnings = file.warnings.clone();
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
    print(common, info)
}

fn print(common: CommonArgs, mut info: Info) -> anyhow::Result<()> {
    let mut points = info.parts.iter().map(|p| p.points);
    info.points = points.try_fold(0, |sum: u64, n| Some(sum.saturating_add(n?)));
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
    let points = Some(points);
    parts.push(Part { name: name.into(), kind: data.kind(), points, cells, arrays });
}

fn describe(array: &DataArray, of: &'static str) -> Array {
    Array {
        name: array.name.clone(),
        of,
        scalar_type: array.values.kind().name(),
        components: array.components,
        tuples: Some(array.tuples() as u64),
        range: array.range(),
    }
}

fn add_meshes(scene: &SceneModel, parts: &mut Vec<Part>) {
    for m in &scene.meshes {
        let points = Some(m.mesh.positions.len() as u64);
        let cells = m.mesh.num_triangles() as u64;
        parts.push(Part { name: m.name.clone(), kind: "mesh", points, cells, arrays: vec![] });
    }
}

fn text(info: &Info) -> String {
    let count = |points: Option<u64>, cells: u64| match points {
        Some(points) => format!("{points} points, {cells} cells"),
        None => format!("{cells} cells"),
    };
    let mut lines = vec![
        format!("{}: {}, {}", info.file, info.format, info.kind),
        format!("  {}", count(info.points, info.cells)),
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
            lines.push(format!("  {name}: {kind}, {}", count(part.points, part.cells)));
        }
        for a in &part.arrays {
            let range = match a.range {
                Some((lo, hi)) => format!("{lo} to {hi}"),
                None if a.tuples.is_none() => "of unknown range".into(),
                None => "no finite value".into(),
            };
            let times =
                if a.components == 1 { String::new() } else { format!(" x {}", a.components) };
            lines.push(format!(
                "    {} array `{}`: {}{times}, {range}",
                a.of, a.name, a.scalar_type
            ));
        }
    }
    if let Some(Stored { pages, bytes }) = info.stored {
        lines.push(format!("  {bytes} bytes in {pages} pages, read when rays need them"));
    }
    lines.extend(info.warnings.iter().map(|w| format!("  warning: {w}")));
    lines.join("\n")
}
