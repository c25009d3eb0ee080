//! Loads a [`Field`] from the files of a flow solver: gives the arrays their meaning, computes the
//! index and resamples it to a lattice.
//!
//! ```text
//! file ── arrays by name and unit ── n − 1 at the points of the file (f64) ── uniform lattice ── eps = n/n0 − 1 (f32)
//!         [medium]                   [crate::index]                           [datasets::resample]
//! ```
//! The index is computed before resampling, at the points of the solver. A common background is
//! subtracted in f64 before values are rounded, so a plume with differences of 1e-9 in n keeps its
//! digits.
//!
//! [`load_cells`] makes [`crate::gas_on_cells::GasOnCells`] of the same values instead, without a
//! lattice.

mod contents;
mod evaluate;
mod lattice;
mod media;
mod medium;
mod nodes;
mod on_cells;
mod planes;
mod plausible;
mod reference;
mod series;

pub use contents::{Array, Contents, Guess, Meaning, contents, contents_of_dataset};
pub use media::{load_media, media_from_dataset};
pub use medium::{Medium, Quantity, Source};
pub use on_cells::{cells_from_dataset, load_cells};
pub use reference::Reference;
pub use series::{Step, series};

use crate::field::{Field, FieldError};
use crate::index::IndexError;
use crate::index::conditions::Model;
use datasets::model::{Dataset, ModelError};
use datasets::read::{OpenOptions, ReadError};
use datasets::resample::{self, Mark, Reconstruction, ResampleError, Resolution};
use glam::DVec3;
use std::path::{Path, PathBuf};

/// Why no field can be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InputError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The contents of the file cannot be used.
    #[error("{}: it cannot be converted to a field", path.display())]
    InFile {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: Box<InputError>,
    },
    /// An array is missing or invalid.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The mesh cannot be resampled to a lattice.
    #[error(transparent)]
    Resample(#[from] ResampleError),
    /// The index cannot be computed.
    #[error(transparent)]
    Index(#[from] IndexError),
    /// The lattice cannot be a field.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// An array has several numbers where one is meant.
    #[error(
        "`{name}` has {components} numbers for each point, as a vector has, and one is needed; name \
         another array, one component as `{name}:x`, or their magnitude as `{name}:magnitude`"
    )]
    Vector {
        /// The array.
        name: String,
        /// Its numbers for each point or cell.
        components: usize,
    },
    /// An option is invalid.
    #[error("{what}; {cure}")]
    Option {
        /// The option and its value.
        what: String,
        /// How to correct it.
        cure: &'static str,
    },
}

/// How a node without gas affects light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// No data: the image shows where.
    Blank,
    /// A solid body, which blocks light.
    Solid,
    /// Gas, with values continued from the gas around it. This is right where a mesh ends in
    /// undisturbed flow.
    Gas,
}

/// What the places outside the mesh are.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outside {
    /// Behind a wall a solid body, and behind an open border gas. [`Report::outside`] says which
    /// walls were found.
    #[default]
    Auto,
    /// No data everywhere.
    Blank,
    /// A solid body everywhere.
    Solid,
    /// Gas everywhere.
    Gas,
}

impl Outside {
    /// What is behind an open border, and what behind a wall.
    fn roles(self) -> [Role; 2] {
        match self {
            Outside::Auto => [Role::Gas, Role::Solid],
            Outside::Blank => [Role::Blank; 2],
            Outside::Solid => [Role::Solid; 2],
            Outside::Gas => [Role::Gas; 2],
        }
    }
}

impl From<Role> for Outside {
    fn from(role: Role) -> Outside {
        match role {
            Role::Blank => Outside::Blank,
            Role::Solid => Outside::Solid,
            Role::Gas => Outside::Gas,
        }
    }
}

/// What was decided about the places outside the mesh.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct OutsideReport {
    /// Part of the lattice's nodes, or of the box of cells, that is outside the mesh, in per cent.
    pub percent: f64,
    /// Part of the lattice's nodes that are in bodies, in per cent; `None` on the cells of a mesh.
    pub bodies_percent: Option<f64>,
    /// What the walls were found by, in words; empty when none was found or nothing was asked for.
    pub walls_by: Vec<String>,
    /// Part of the border, beside the sides of its box, of which nothing tells whether it is a
    /// wall, in per cent of its area. It is taken as open.
    pub undecided_percent: f64,
}

/// What two-dimensional data becomes in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Depth {
    /// The same flow over this span, in units of the file; half of it lies on either side of the
    /// plane.
    Span(f64),
    /// The flow revolved about the x axis; y is the radius.
    Revolve,
}

/// Options for converting a data set to a field.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Meaning of the arrays.
    pub medium: Medium,
    /// What a file does not say itself. Only [`load`] and [`load_cells`] read files.
    pub file: OpenOptions,
    /// Vacuum wavelength, nm.
    pub wavelength_nm: f64,
    /// The formula for air given by temperature and pressure.
    pub model: Model,
    /// Metres per unit of length of the file.
    pub length_unit_m: f64,
    /// Resolution of the lattice. With [`Resolution::Auto`], uniform data keeps its own lattice.
    pub resolution: Resolution,
    /// The part of the data to use: lower and upper corner in units of the file.
    pub bounds: Option<[DVec3; 2]>,
    /// What two-dimensional data becomes in space. Required for two-dimensional data, and only
    /// allowed for it.
    pub depth: Option<Depth>,
    /// See [`resample::Options`].
    pub samples_per_axis: usize,
    /// How values between the points of a mesh are computed when it is resampled.
    pub reconstruction: Reconstruction,
    /// Standard deviation of the shock smoothing in nodes: 0 for none, 1 to 1.4 for shocks that are
    /// one cell wide.
    pub smoothing_nodes: f64,
    /// Whether jumps from one node to the next become averages over cells
    /// ([`resample::average_jumps`]), before any smoothing.
    pub average_jumps: bool,
    /// What nodes outside all cells are.
    pub outside: Outside,
    /// Role of nodes in hidden cells (iblank 0, `vtkGhostType`).
    pub hidden: Role,
    /// The reference medium around the field, n0.
    pub reference: Reference,
}

impl Options {
    /// Defaults for a medium: 532 nm, metres, the file's own lattice, no smoothing, hidden cells
    /// solid, bodies and gas outside as the walls say, and the reference at the border.
    pub fn new(medium: Medium) -> Self {
        Options {
            medium,
            file: OpenOptions::default(),
            wavelength_nm: 532.0,
            model: Model::Auto,
            length_unit_m: 1.0,
            resolution: Resolution::Auto,
            bounds: None,
            depth: None,
            samples_per_axis: 1,
            reconstruction: Reconstruction::default(),
            smoothing_nodes: 0.0,
            average_jumps: false,
            outside: Outside::Auto,
            hidden: Role::Solid,
            reference: Reference::Border,
        }
    }
}

/// How a field was made.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// The formula: `ciddor`, `gladstone-dale`, `plasma`, `given` or `multifield`.
    pub formula: &'static str,
    /// n0 − 1 of the reference.
    pub reference_n_minus_1: f64,
    /// Smallest and largest n − 1 at the points of the file.
    pub n_minus_1_range: [f64; 2],
    /// Smallest and largest density used, kg/m³, if the formula uses density.
    pub density_range_kg_m3: Option<[f64; 2]>,
    /// Report of the resampling; `None` for data that is already uniform. Its differences are in n
    /// − 1.
    pub resampling: Option<resample::Report>,
    /// The cells, when light is traced through them ([`load_cells`]). Differences are in n − 1.
    pub cells: Option<resample::CellReport>,
    /// What is outside the mesh; `None` when nothing is.
    pub outside: Option<OutsideReport>,
    /// Jumps that became averages over cells; `None` unless asked for.
    pub jumps: Option<resample::JumpReport>,
    /// Root mean square change of n − 1 by the smoothing.
    pub smoothing_rms: f64,
    /// Warnings for the user, one sentence each.
    pub warnings: Vec<String>,
}

/// A field and how it was made.
#[derive(Debug, Clone)]
pub struct LoadedField {
    /// The field.
    pub field: Field,
    /// How the field was made.
    pub report: Report,
}

/// Largest n − 1 that is taken for a medium's. Far above it, rays turn in every step, and marches
/// do not end.
const MOST_N_MINUS_1: f64 = 100.0;

/// Reads a file as a field. For a time series this reads the first time; see [`series`] for the
/// others.
///
/// A large volume of one array (NRRD, MetaImage, raw: more than 2^27 nodes) of which fewer nodes
/// are wanted is read plane by plane, as averages.
pub fn load(path: &Path, options: &Options) -> Result<LoadedField, InputError> {
    if let Some((data, warnings)) = planes::averaged(path, options)? {
        // Averages are the lattice that was wanted.
        let options = Options { resolution: Resolution::Auto, ..options.clone() };
        let mut loaded = from_dataset(&data, &options)
            .map_err(|e| InputError::InFile { path: path.to_path_buf(), source: Box::new(e) })?;
        loaded.report.warnings.splice(0..0, warnings);
        return Ok(loaded);
    }
    let (mut loaded, warnings) =
        with_data(path, &options.file, |data| from_dataset(data, options))?;
    loaded.report.warnings.splice(0..0, warnings);
    Ok(loaded)
}

/// Reads the data of a file into memory, to make several fields of it with [`from_dataset`]; of a
/// collection, the first time. `file` has what the file does not say itself. Also returns the
/// reader's warnings.
pub fn dataset(path: &Path, file: &OpenOptions) -> Result<(Dataset, Vec<String>), InputError> {
    with_data(path, file, |data| Ok(data.clone()))
}

/// Reads a file and converts its data with `make`. Also returns the reader's warnings. Errors name
/// the file.
fn with_data<T>(
    path: &Path,
    file: &OpenOptions,
    make: impl FnOnce(&Dataset) -> Result<T, InputError>,
) -> Result<(T, Vec<String>), InputError> {
    let in_file =
        |e: InputError| InputError::InFile { path: path.to_path_buf(), source: Box::new(e) };
    let opened = datasets::read::open_with(path, file)?;
    let data = opened.dataset().map_err(|e| in_file(e.into()))?;
    Ok((make(data).map_err(in_file)?, opened.warnings))
}

/// Converts a data set to a field.
///
/// ```
/// use datasets::model::{DataArray, Dataset, ImageData, Values};
/// use glam::DVec3;
/// use schlieren::input::{Medium, Options, from_dataset};
///
/// // A cube of air with a dense node in the middle.
/// let mut image = ImageData::new([5, 5, 5], DVec3::ZERO, DVec3::splat(0.01));
/// let mut rho = vec![1.2; 125];
/// rho[62] = 1.8;
/// image.attributes.point.push(DataArray::new("rho", 1, Values::F64(rho)));
/// let loaded = from_dataset(&Dataset::ImageData(image), &Options::new(Medium::density("rho")))?;
///
/// // n − 1 = K ρ with K = 0.227 cm³/g at 532 nm; eps is relative to the border.
/// assert!((loaded.report.reference_n_minus_1 - 2.724e-4).abs() < 1e-7);
/// assert_eq!(loaded.field.eps()[0], 0.0);
/// assert!((loaded.field.eps()[62] - 1.362e-4).abs() < 1e-7);
/// # Ok::<(), schlieren::input::InputError>(())
/// ```
pub fn from_dataset(data: &Dataset, options: &Options) -> Result<LoadedField, InputError> {
    check_length_unit(options)?;
    let mut report = Report::default();

    // n − 1 at the points of the file, less a common background.
    let points = lattice::SamplePoints::find(data, options)?;
    report.warnings.extend(points.turn_warning(options));
    report.warnings.extend(points.hidden_warning(options));
    let columns = options.medium.columns(data, &points)?;
    let mut index = evaluate::evaluate(&columns, options, &mut report)?;
    let background = reference::background(&mut index, options)?;

    // Resample to a uniform lattice.
    let mut on = points.to_lattice(index, options)?;
    if let Some(r) = &on.report {
        report.warnings.extend(r.warnings_with_cure(
            "take more nodes (flow.resample_nodes), or average over more samples for each node \
             (flow.resample_samples)",
        ));
    }
    report.resampling = on.report;
    if on.at_centres {
        report.warnings.push(
            "cells are hidden or have no value: the nodes of the lattice are the centres of the \
             cells, so that bodies end at the cells' faces, and half a cell at each side of the \
             flow is left out; flow.on_cells traces whole cells"
                .into(),
        );
    }
    if options.average_jumps {
        let found = resample::average_jumps(&mut on.values, on.lattice.dims)?;
        report.warnings.extend(jumps_warning(&found));
        report.jumps = Some(found);
    }
    if options.smoothing_nodes != 0.0 {
        let before = on.values.clone();
        resample::smooth(&mut on.values, on.lattice.dims, options.smoothing_nodes)?;
        report.smoothing_rms = rms_difference(&before, &on.values);
        if !on.truncation.is_empty() {
            resample::smooth(&mut on.truncation, on.lattice.dims, options.smoothing_nodes)?;
        }
    }

    // Hidden points may have any value.
    let inside = on.values.iter().zip(&on.marks).filter(|(_, m)| **m == Mark::Inside);
    let largest = inside.map(|(d, _)| f64::from(*d) + background).fold(0.0, f64::max);
    if largest > MOST_N_MINUS_1 {
        return Err(impossible_index(largest));
    }

    plausible::warn_size(on.lattice.size() * options.length_unit_m, &mut report);

    // eps = n/n0 − 1 = (d − d0)/n0, where d is n − 1 less the background.
    let d0 = options.reference.choose(&on, background, &mut report)?;
    let n0 = 1.0 + background + d0;
    report.reference_n_minus_1 = background + d0;
    let eps = on.values.iter().map(|&d| ((f64::from(d) - d0) / n0) as f32).collect();
    let bodies = points.bodies(data, &on, options, &mut report);
    let nodes = nodes::nodes_of(&on.marks, bodies.as_deref(), options, &mut report);
    let lattice::LatticeValues { lattice, mut truncation, .. } = on;
    truncation.iter_mut().for_each(|t| *t /= n0 as f32);
    let unit = options.length_unit_m;
    let spacing_m = (lattice.spacing * unit).to_array();
    let eps = reference::continued(eps, lattice.dims, &on.marks, nodes.as_deref());
    let mut field = Field::new(lattice.dims, spacing_m, lattice.origin * unit, eps, n0, nodes)?;
    if !truncation.is_empty() {
        field = field.with_truncation(truncation)?;
    }
    Ok(LoadedField { field, report })
}

fn check_length_unit(options: &Options) -> Result<(), InputError> {
    if options.length_unit_m > 0.0 && options.length_unit_m.is_finite() {
        return Ok(());
    }
    Err(InputError::Option {
        what: format!("length unit {} m", options.length_unit_m),
        cure: "give metres per unit of the file, such as 0.001 for mm",
    })
}

fn impossible_index(largest: f64) -> InputError {
    InputError::Option {
        what: format!("n - 1 is up to {largest:.3e}, and no medium has that"),
        cure: "check the units of the arrays",
    }
}

/// What the averages of jumps are worth. The numbers are those of the closed forms in
/// `tests/shocks_across_light.rs` and of the tests of `average_jumps`.
fn jumps_warning(found: &resample::JumpReport) -> Option<String> {
    let resample::JumpReport { jumps, left, .. } = *found;
    if jumps == 0 {
        return None;
    }
    let kept = match left {
        0 => String::new(),
        n => format!("; {n} have no plane through their neighbours and stay as they are"),
    };
    Some(format!(
        "{jumps} jumps from one node to the next became averages over cells: where a front is flat \
         over 19 nodes, it deflects light to within 6 %, and without this by up to 100 %{kept}"
    ))
}

fn rms_difference(a: &[f32], b: &[f32]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).filter(|s| s.is_finite());
    let (sum, n) = squares.fold((0.0, 0usize), |(s, n), x| (s + x, n + 1));
    (sum / n.max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests;
