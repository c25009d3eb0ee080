//! `datasets convert`.

use super::open_args::OpenArgs;
use super::output::{self, EncodingArgs};
use anyhow::Context as _;
use clap::Args;
use datasets::cli::{CommonArgs, CureExt as _, UsageError};
use datasets::contour::{ContourOf, contour};
use datasets::isosurface::{self, Options};
use datasets::model::{Attributes, Block, Dataset, PolyData};
use datasets::read::{self, Content};
use glam::DVec3;
use rt_core::mesh::TriMesh;
use std::path::PathBuf;

/// Options of `datasets convert`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  datasets convert mesh.stl mesh.ply
  datasets convert flow.vtk flow.vti --compress
  datasets convert case flow.vtu --time 0.002
  datasets convert rho.npy rho.vti --spacing 0.1,0.1,0.1
  datasets convert mesh.vtu surface.vtp --color-by pressure
  datasets convert wedge.vti shock.obj --isovalue 1.5
  datasets convert flow.vtu hot.vtp --isovalue 600 --array T --color-by p
  datasets convert flow.vtu slice.vtp --slice 0,0,0.1,0,0,1 --color-by p")]
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
    /// Extracts an isosurface at this value, of cells of any shape; of image data, with normals
    #[arg(long, value_name = "VALUE", allow_hyphen_values = true)]
    isovalue: Option<f64>,
    /// Extracts the section with the plane through a point with a normal
    #[arg(
        long,
        value_name = "X,Y,Z,NX,NY,NZ",
        value_parser = plane,
        allow_hyphen_values = true,
        conflicts_with = "isovalue"
    )]
    slice: Option<[f64; 6]>,
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
    let is_contour = args.isovalue.is_some() || args.slice.is_some();
    let content = match (file.content, args.isovalue) {
        (Content::Scene(_), _) if is_contour => {
            let text = "--isovalue and --slice are for cells; the file holds meshes";
            return Err(UsageError(text.into()).into());
        }
        (Content::Data(data), _) if args.slice.is_some() => slice_of(common, &data, args)?,
        (Content::Data(data), Some(value)) => isosurface_of(common, &data, args, value)?,
        (Content::Data(data), None) => output::Content::Data(data),
        (Content::Scene(mut scene), _) => {
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
    let first_of = |attributes: &Attributes| {
        let marked = attributes.point_scalars.clone().or_else(|| attributes.cell_scalars.clone());
        let mut all = attributes.point.iter().chain(&attributes.cell);
        marked.or_else(|| all.next().map(|a| a.name.clone()))
    };
    let mut leaves = data.leaves().into_iter().filter_map(|leaf| leaf.attributes());
    let array = args.array.clone().or_else(|| leaves.find_map(first_of));
    let array = array.context("the file has no array")?;
    let is_lattice = matches!(data, Dataset::ImageData(_) | Dataset::RectilinearGrid(_));
    let grid = if is_lattice { data.to_grid(&array).ok() } else { None };
    let Some(grid) = grid else {
        let of = ContourOf::Values { array: &array, isovalues: &[value] };
        let mesh = contour_of(common, data, args, &of)?;
        if mesh.indices.is_empty() {
            return Err(anyhow::anyhow!("no cell of `{array}` contains the value {value}"))
                .cure("choose an --isovalue inside the range that `datasets info` prints");
        }
        return Ok(output::Content::Mesh(mesh));
    };
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

fn slice_of(
    common: CommonArgs,
    data: &Dataset,
    args: &ConvertArgs,
) -> anyhow::Result<output::Content> {
    let [x, y, z, nx, ny, nz] = args.slice.unwrap_or_default();
    let (point, normal) = (DVec3::new(x, y, z), DVec3::new(nx, ny, nz));
    let mesh = contour_of(common, data, args, &ContourOf::Plane { point, normal })?;
    if mesh.indices.is_empty() {
        return Err(anyhow::anyhow!(
            "the plane through {point} with the normal {normal} meets no cell"
        ))
        .cure("choose a point inside the bounds that `datasets info` prints");
    }
    Ok(output::Content::Mesh(mesh))
}

fn contour_of(
    common: CommonArgs,
    data: &Dataset,
    args: &ConvertArgs,
    of: &ContourOf<'_>,
) -> anyhow::Result<TriMesh> {
    let made = contour(data, of, args.color_by.as_deref(), None)?;
    made.report.warnings().iter().for_each(|w| common.warn(w));
    // Without an array to keep, they would be the isovalue.
    let scalars = made.mesh.scalars.filter(|_| args.color_by.is_some());
    Ok(TriMesh { scalars, ..made.mesh })
}

fn plane(text: &str) -> Result<[f64; 6], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    let numbers = numbers.and_then(|n| <[f64; 6]>::try_from(n).ok());
    let numbers = numbers.filter(|n| n.iter().all(|v| v.is_finite()) && n[3..] != [0.0; 3]);
    numbers.ok_or_else(|| {
        "give a point and a normal that is not zero, such as 0,0,0.1,0,0,1".to_owned()
    })
}
