//! `datasets convert`.

use super::open_args::OpenArgs;
use super::output::{self, EncodingArgs};
use anyhow::Context as _;
use clap::Args;
use datasets::cli::{CommonArgs, CureExt as _, UsageError};
use datasets::isosurface::{self, Options};
use datasets::model::{Block, Dataset, PolyData};
use datasets::read::{self, Content};
use std::path::PathBuf;

/// Options of `datasets convert`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  datasets convert mesh.stl mesh.ply
  datasets convert flow.vtk flow.vti --compress
  datasets convert case flow.vtu --time 0.002
  datasets convert rho.npy rho.vti --spacing 0.1,0.1,0.1
  datasets convert mesh.vtu surface.vtp --color-by pressure
  datasets convert wedge.vti shock.obj --isovalue 1.5")]
pub(super) struct ConvertArgs {
    /// A file of any format that can be read, or the folder of an OpenFOAM case
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// The new file: .vti .vtp .vtu .vtr .vts .vtm, .ply, .obj or .glb. Other kinds of data are
    /// converted to their surface
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// The array that surfaces keep; `velocity` is a vector's length, `velocity:x` a component
    #[arg(long, value_name = "ARRAY")]
    color_by: Option<String>,
    /// Extracts an isosurface with normals at this value (image data only)
    #[arg(long, value_name = "VALUE", allow_hyphen_values = true)]
    isovalue: Option<f64>,
    /// The array of the isosurface [default: what the file marks, else the first]
    #[arg(long, value_name = "ARRAY", requires = "isovalue")]
    array: Option<String>,
    #[command(flatten)]
    encoding: EncodingArgs,
    #[command(flatten)]
    open: OpenArgs,
}

/// Reads one file and writes the other.
pub(super) fn convert(common: CommonArgs, args: &ConvertArgs) -> anyhow::Result<()> {
    output::check_name(&args.output)?;
    let file = read::open_with(&args.input, &args.open.options())?;
    file.warnings.iter().for_each(|w| common.warn(w));
    if file.time_steps.len() > 1 && !args.open.has_time() {
        let times = file.time_steps.len();
        common.warn(format!("only one of {times} times is converted; --time chooses another"));
    }
    let content = match (file.content, args.isovalue) {
        (Content::Data(data), None) => output::Content::Data(data),
        (Content::Data(data), Some(value)) => isosurface_of(common, &data, args, value)?,
        (Content::Scene(_), Some(_)) => {
            return Err(
                UsageError("--isovalue is for image data; the file holds meshes".into()).into()
            );
        }
        (Content::Scene(mut scene), None) => {
            if !scene.materials.is_empty() {
                common.warn(format!("{} materials are left out", scene.materials.len()));
            }
            if scene.meshes.len() == 1 {
                output::Content::Mesh(scene.meshes.remove(0).mesh)
            } else {
                let block = |m: read::SceneMesh| Block {
                    name: m.name,
                    data: Dataset::PolyData(PolyData::from_trimesh(&m.mesh)),
                };
                output::Content::Data(Dataset::MultiBlock(
                    scene.meshes.into_iter().map(block).collect(),
                ))
            }
        }
    };
    let written = output::write(&args.output, content, args.encoding, args.color_by.as_deref())?;
    output::report(common, &written)
}

fn isosurface_of(
    common: CommonArgs,
    data: &Dataset,
    args: &ConvertArgs,
    value: f64,
) -> anyhow::Result<output::Content> {
    let attributes =
        data.attributes().context("a collection has no isosurface; convert its blocks")?;
    let marked = attributes.point_scalars.clone().or_else(|| attributes.cell_scalars.clone());
    let first = || attributes.point.iter().chain(&attributes.cell).next().map(|a| a.name.clone());
    let array = args.array.clone().or(marked).or_else(first).context("the file has no array")?;
    let grid = data.to_grid(&array)?;
    let surfaces = isosurface::extract(&grid, &[value], Options { normals: true, scalars: false })?;
    if surfaces.skipped_cells > 0 {
        common
            .warn(format!("{} cells with a missing value are left empty", surfaces.skipped_cells));
    }
    if surfaces.mesh.indices.is_empty() {
        return Err(anyhow::anyhow!("no cell of `{array}` contains the value {value}"))
            .cure("choose an --isovalue inside the range that `datasets info` prints");
    }
    Ok(output::Content::Mesh(surfaces.mesh))
}
