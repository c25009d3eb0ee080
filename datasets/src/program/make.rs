//! `datasets make`.

use super::output::{self, Content, Output};
use clap::Args;
use datasets::catalogue::{self, CatalogueError, Data, flows};
use datasets::cli::{Cancel, CommonArgs, UsageError};
use datasets::generate::flow::Fields;
use datasets::generate::polylines::Polylines;
use datasets::isosurface::Options;
use datasets::model::{Attributes, Cells, DataArray, Dataset, Points, PolyData, Values};
use std::path::PathBuf;

/// Options of `datasets make`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  datasets make wavelet --size 1M -o wavelet.vtp
  datasets make combustion-jet --size small -o jet.vti --compress
  datasets make torus -o torus.vtp")]
pub(super) struct MakeArgs {
    /// The data set, as `datasets list` names it
    name: String,
    /// One of its sizes [default: the smallest]
    #[arg(long, value_name = "SIZE")]
    size: Option<String>,
    /// The file: .vti for flows, .vtp for lines; .vtp, .ply, .obj or .glb for meshes
    /// [default: NAME-SIZE with .vti or .vtp]
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Adds normals to isosurfaces
    #[arg(long)]
    normals: bool,
    /// Adds the isovalue of every vertex as a scalar to isosurfaces
    #[arg(long)]
    scalars: bool,
    /// Only the first field (flows only)
    #[arg(long)]
    first_field: bool,
    #[command(flatten)]
    encoding: output::EncodingArgs,
}

/// Generates a data set and writes it.
pub(super) fn make(common: CommonArgs, args: &MakeArgs) -> anyhow::Result<()> {
    let cancel = Cancel::on_ctrl_c()?;
    let (content, size, extension) = match catalogue::find(&args.name) {
        Ok(entry) => {
            let smallest = entry.sizes.first().map_or("", |s| s.name);
            let size = entry.size(args.size.as_deref().unwrap_or(smallest)).map_err(usage)?;
            if args.first_field {
                return Err(UsageError(format!(
                    "--first-field is for flows; {} is none",
                    entry.name
                ))
                .into());
            }
            let bar = common.progress(1, entry.name);
            let options = Options { normals: args.normals, scalars: args.scalars };
            let generated = entry.generate(size.name, options, &mut |done, total| {
                bar.set_length(total as u64);
                bar.set_position(done as u64);
                !cancel.is_set()
            });
            cancel.check()?;
            let content = match generated? {
                Data::Mesh(mesh) => Content::Mesh(mesh),
                Data::Lines(lines) => Content::Data(poly_data_of_lines(lines)),
            };
            (content, size.name, "vtp")
        }
        Err(_) => {
            let entry = flows::find(&args.name).map_err(|_| unknown_name(&args.name))?;
            if args.normals || args.scalars {
                let fault = format!(
                    "--normals and --scalars are for isosurfaces; {} is a flow",
                    entry.name
                );
                return Err(UsageError(fault).into());
            }
            let wanted = args.size.as_deref().unwrap_or(flows::SIZES[0].0);
            entry.dims(wanted).map_err(usage)?;
            let size = flows::SIZES.iter().map(|s| s.0).find(|s| s.eq_ignore_ascii_case(wanted));
            let fields = if args.first_field { Fields::Density } else { Fields::All };
            let flow = entry.generate(wanted, fields)?;
            cancel.check()?;
            (Content::Data(flow.into_dataset()), size.unwrap_or(flows::SIZES[0].0), "vti")
        }
    };
    let default = || PathBuf::from(format!("{}-{}.{extension}", args.name, size.to_lowercase()));
    let path = args.out.clone().unwrap_or_else(default);
    let written = output::write(&path, content, args.encoding, None)?;
    output::report(common, &Output { data: Some(&args.name), size: Some(size), ..written })
}

/// A wrong name or size is a usage error.
fn usage(e: CatalogueError) -> anyhow::Error {
    UsageError(e.to_string()).into()
}

fn unknown_name(name: &str) -> UsageError {
    let meshes = catalogue::entries().iter().map(|e| e.name);
    let known: Vec<&str> = meshes.chain(flows::entries().iter().map(|e| e.name)).collect();
    UsageError(format!("no data set is called `{name}`; there are: {}", known.join(", ")))
}

/// Polylines with the point arrays `radius` and `scalars`.
fn poly_data_of_lines(lines: Polylines) -> Dataset {
    let mut cells = Cells::new();
    lines.offsets.windows(2).for_each(|w| cells.push(w[0]..w[1]));
    let attributes = Attributes {
        point: vec![
            DataArray::new("scalars", 1, Values::F32(lines.scalars)),
            DataArray::new("radius", 1, Values::F32(lines.radii)),
        ],
        point_scalars: Some("scalars".into()),
        ..Default::default()
    };
    let points = Points::F32(lines.points.iter().map(|p| p.to_array()).collect());
    Dataset::PolyData(PolyData { points, lines: cells, attributes, ..Default::default() })
}
