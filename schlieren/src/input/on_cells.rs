//! Loads the gas of a file on the cells of its mesh, without a lattice.

use super::lattice::SamplePoints;
use super::{
    Depth, InputError, MOST_N_MINUS_1, Options, Outside, OutsideReport, Reference, Report, Role,
    evaluate, plausible, reference, with_data,
};
use crate::field::LENGTHS_M;
use crate::gas_on_cells::GasOnCells;
use datasets::model::Dataset;
use datasets::resample::{CellField, Resolution, Samples, Walls};
use std::path::Path;

/// Reads a file as gas on the cells of its mesh. See [`cells_from_dataset`].
///
/// # Errors
/// As [`cells_from_dataset`], and if the file cannot be read.
pub fn load_cells(path: &Path, options: &Options) -> Result<(GasOnCells, Report), InputError> {
    let (mut loaded, warnings) =
        with_data(path, &options.file, |data| cells_from_dataset(data, options))?;
    loaded.1.warnings.splice(0..0, warnings);
    Ok(loaded)
}

/// Converts a data set to gas on the cells of its mesh.
///
/// # Errors
/// If an array is missing or the index cannot be computed, as for [`super::from_dataset`], if the
/// mesh has no cells, or if the options are those of a lattice: a resolution, bounds, several
/// samples, smoothing, or a revolution.
pub fn cells_from_dataset(
    data: &Dataset,
    options: &Options,
) -> Result<(GasOnCells, Report), InputError> {
    super::check_length_unit(options)?;
    refuse_lattice_options(options)?;
    let mut report = Report::default();
    let points = SamplePoints::on_cells(data, options)?;
    report.warnings.extend(points.turn_warning(options));
    report.warnings.extend(points.hidden_warning(options));
    let columns = options.medium.columns(data, &points)?;
    let mut index = evaluate::evaluate(&columns, options, &mut report)?;
    drop(columns);
    let background = reference::background(&mut index, options)?;
    let SamplePoints::Mesh { mesh, per_point, .. } = points else {
        unreachable!("points on cells are those of a mesh")
    };
    let samples = if per_point { Samples::Points(&index) } else { Samples::Cells(&index) };
    // Before the mesh is in metres: surfaces of the file are found by their places.
    let walls = match options.outside {
        Outside::Auto => Walls::find(&mesh, data, false),
        _ => Walls::default(),
    };
    // With the neighbours of its cells, which scaling forgets.
    let mesh = match options.length_unit_m {
        1.0 => *mesh,
        unit => mesh.scaled(unit),
    };
    let (low, high) = mesh.bounds();
    for length_m in [mesh.typical_cell(), (high - low).max_element()] {
        if !LENGTHS_M.contains(&length_m) {
            return Err(InputError::Option {
                what: format!("the mesh has cells or sides of {length_m:e} m"),
                cure: "they must be from 1e-12 to 1e12 m: check the unit of length \
                       (length_unit_m in a scene, --length-unit)",
            });
        }
    }
    if walls.baffles() > 0 {
        report.warnings.push(format!(
            "{} faces between cells are walls without thickness, which stop light: the file has \
             their points twice, with a velocity of zero on both sides; where none is, light passes \
             with another choice than auto for what is outside the mesh (flow.outside)",
            walls.baffles()
        ));
    }
    plausible::warn_size(high - low, &mut report);
    let cells = CellField::with_walls(mesh, samples, options.reconstruction, &walls)?;
    report.warnings.extend(cells.report().warnings());
    report.cells = Some(*cells.report());
    let largest = cells.largest() + background;
    if largest > MOST_N_MINUS_1 {
        return Err(super::impossible_index(largest));
    }
    let of_all = || cells.median().unwrap_or(0.0);
    let d0 = match options.reference {
        Reference::Given { n_minus_1 } => reference::given(n_minus_1)? - background,
        Reference::Median => of_all(),
        Reference::Border => cells.border_median().unwrap_or_else(|| {
            report.warnings.push(
                "no face of the mesh with gas lies in a side of its box: the reference is the \
                 median of all gas"
                    .into(),
            );
            of_all()
        }),
    };
    report.reference_n_minus_1 = background + d0;
    report_outside(&cells, &walls, options, &mut report);
    let n0 = 1.0 + background + d0;
    let [open, behind_wall] = options.outside.roles().map(Role::node);
    let gas = GasOnCells::new(cells, d0, n0, open, options.hidden.node());
    Ok((gas.with_walls(behind_wall), report))
}

fn report_outside(cells: &CellField, walls: &Walls, options: &Options, report: &mut Report) {
    let percent = 100.0 * (1.0 - cells.report().filled);
    // Rounding of the corners, and curved faces.
    if percent < 0.05 {
        return;
    }
    let mut found = OutsideReport { percent, ..OutsideReport::default() };
    found.set_walls(walls);
    report.warnings.extend(found.warning(options.outside, "mesh's box"));
    report.outside = Some(found);
}

/// Refuses what only a lattice has.
fn refuse_lattice_options(options: &Options) -> Result<(), InputError> {
    let given = [
        (options.resolution != Resolution::Auto, "a resolution", "omit it, or trace on a lattice"),
        (options.bounds.is_some(), "bounds", "cut the mesh, or trace on a lattice"),
        (
            options.depth == Some(Depth::Revolve),
            "a revolution",
            "trace revolved flows on a lattice, without on_cells",
        ),
        (options.samples_per_axis != 1, "several samples a node", "omit them"),
        (options.smoothing_nodes != 0.0, "smoothing over nodes", "omit it"),
        (options.average_jumps, "jumps from node to node", "omit average_jumps"),
    ];
    match given.into_iter().find(|g| g.0) {
        None => Ok(()),
        Some((_, what, cure)) => Err(InputError::Option {
            what: format!("light is traced through the cells themselves, which have no {what}"),
            cure,
        }),
    }
}
