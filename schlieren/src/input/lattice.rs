//! Finds the points of a data set's values, and converts the values to a uniform lattice.

use super::{Depth, InputError, Options};
use datasets::model::{Attributes, ColorBy, Dataset, extent_dims};
use datasets::resample::{
    self, Lattice, Mark, Mesh, Plane, Report, Resolution, Samples, Walls, centre_values,
    corner_values, in_bodies, resample as resample_mesh, revolve, revolved_bounds,
};
use glam::{DMat3, DQuat, DVec3};

/// The points at which the index is computed.
pub(super) enum SamplePoints {
    /// The points of a uniform lattice, which is used unchanged, or its cells.
    Uniform {
        /// The points.
        lattice: Lattice,
        per_point: bool,
        /// Axes that run backwards in the file.
        backwards: [bool; 3],
    },
    /// Points or cells of a mesh, which has to be resampled.
    Mesh { mesh: Box<Mesh>, per_point: bool, own: Option<Lattice> },
}

/// Values at the nodes of a lattice.
pub(super) struct LatticeValues {
    pub(super) lattice: Lattice,
    pub(super) values: Vec<f32>,
    /// See [`resample::ResampledField::truncation`]; empty for the nodes of a uniform lattice.
    pub(super) truncation: Vec<f32>,
    pub(super) marks: Vec<Mark>,
    pub(super) report: Option<Report>,
    /// Whether the nodes are the centres of the file's cells, so that half a cell is left out at
    /// each side.
    pub(super) at_centres: bool,
}

/// Number of nodes along the span of a two-dimensional flow: enough for the border of any
/// interpolant.
const SPAN_NODES: usize = 8;

impl SamplePoints {
    pub(super) fn find(data: &Dataset, options: &Options) -> Result<SamplePoints, InputError> {
        data.check().map_err(InputError::Model)?;
        let mut associations = Vec::new();
        for name in options.medium.arrays() {
            associations.push(ColorBy::find(data, name)?.per_point);
        }
        // If there are arrays of points and of cells, all are evaluated at the points.
        let per_point = associations.iter().any(|p| *p);
        let mixed = per_point && associations.iter().any(|p| !p);
        let own = uniform(data);
        let ghosts = data.leaves().iter().filter_map(|d| d.attributes()).any(|a| {
            a.cell_array("vtkGhostType").is_some() || a.point_array("vtkGhostType").is_some()
        });
        if let Some((lattice, backwards)) = own
            && !mixed
            && !ghosts
            && options.resolution == Resolution::Auto
            && options.bounds.is_none()
            && options.depth.is_none()
            && options.samples_per_axis == 1
        {
            return Ok(SamplePoints::Uniform { lattice, per_point, backwards });
        }
        let mesh = Box::new(mesh_of(data, options)?);
        Ok(SamplePoints::Mesh { mesh, per_point, own: own.map(|o| o.0) })
    }

    /// The points or cells of the mesh that the data are, uniform ones too.
    pub(super) fn on_cells(data: &Dataset, options: &Options) -> Result<SamplePoints, InputError> {
        data.check().map_err(InputError::Model)?;
        let mut per_point = false;
        for name in options.medium.arrays() {
            per_point |= ColorBy::find(data, name)?.per_point;
        }
        Ok(SamplePoints::Mesh { mesh: Box::new(mesh_of(data, options)?), per_point, own: None })
    }

    /// What was done to a plane that slants to the axes, in words.
    pub(super) fn turn_warning(&self, options: &Options) -> Option<String> {
        let SamplePoints::Mesh { mesh, .. } = self else { return None };
        let turn = mesh.turn()?;
        let (axis, angle) = DQuat::from_mat3(&turn).to_axis_angle();
        let across = mesh.axis_of_depth().map_or("", |a| ["x", "y", "z"][a]);
        let plane = match options.depth {
            Some(Depth::Revolve) => "not in the plane of x and y, the radius",
            _ => "in a plane that slants to the axes",
        };
        Some(format!(
            "the flow is {plane}: it is turned by {:.3} degrees about ({:.3}, {:.3}, {:.3}) \
             at the origin, so that it lies across {across}; views, bounds \
             and bodies are those of the turned flow",
            angle.to_degrees(),
            axis.x,
            axis.y,
            axis.z
        ))
    }

    /// Names a choice for hidden cells where there is none.
    pub(super) fn hidden_warning(&self, options: &Options) -> Option<String> {
        let is_any_hidden = match self {
            SamplePoints::Uniform { .. } => false,
            SamplePoints::Mesh { mesh, .. } => mesh.num_hidden() > 0,
        };
        let is_chosen = options.hidden != super::Role::Solid;
        (is_chosen && !is_any_hidden).then(|| {
            "flow.hidden has no effect: the file hides no cell (vtkGhostType, iblank 0); places \
             without cells are as flow.outside says"
                .into()
        })
    }

    /// The values of an array, in the order of the points.
    pub(super) fn values(&self, data: &Dataset, color: &ColorBy) -> Vec<f64> {
        let of = |a: &Attributes, i: usize| {
            // Blocks may lack the array, or have it for cells instead of points or the reverse.
            let array = if color.per_point {
                a.point_array(&color.name)
            } else {
                a.cell_array(&color.name)
            };
            array.map_or(f64::NAN, |array| match color.component {
                Some(c) if c < array.components => array.get(i, c),
                Some(_) => f64::NAN,
                None => array.magnitude(i),
            })
        };
        match self {
            SamplePoints::Mesh { mesh, per_point, .. } => match (per_point, color.per_point) {
                (_, true) => mesh.gather_points(data, of),
                (false, false) => mesh.gather_cells(data, of),
                (true, false) => mesh.cells_to_points(&mesh.gather_cells(data, of)),
            },
            SamplePoints::Uniform { lattice, per_point, backwards } => {
                let leaves = data.leaves();
                let Some(a) = leaves.first().and_then(|l| l.attributes()) else {
                    return Vec::new();
                };
                let d = if *per_point { lattice.dims } else { cells_of(lattice) };
                let source = |i: usize| {
                    let mut at = [i % d[0], i / d[0] % d[1], i / d[0] / d[1]];
                    for axis in 0..3 {
                        if backwards[axis] {
                            at[axis] = d[axis] - 1 - at[axis];
                        }
                    }
                    at[0] + d[0] * (at[1] + d[1] * at[2])
                };
                (0..d.iter().product()).map(|i| of(a, source(i))).collect()
            }
        }
    }

    /// Which nodes outside the mesh are in bodies; `None` when that makes no difference.
    pub(super) fn bodies(
        &self,
        data: &Dataset,
        on: &LatticeValues,
        options: &Options,
        report: &mut super::Report,
    ) -> Option<Vec<bool>> {
        let SamplePoints::Mesh { mesh, .. } = self else { return None };
        if options.outside != super::Outside::Auto || !on.marks.contains(&Mark::Outside) {
            return None;
        }
        let revolved = options.depth == Some(Depth::Revolve);
        let walls = Walls::find(mesh, data, revolved);
        report.outside.get_or_insert_default().set_walls(&walls);
        Some(in_bodies(mesh, &walls, &on.lattice, &on.marks, revolved))
    }

    /// Converts values at the points to values on a lattice.
    pub(super) fn to_lattice(
        &self,
        values: Vec<f64>,
        options: &Options,
    ) -> Result<LatticeValues, InputError> {
        match self {
            SamplePoints::Uniform { lattice: points, per_point, .. } => {
                // Where a cell has no value, the centres of cells are nodes: the border of a body
                // at the cell's faces is then midway between nodes, and in its place.
                let (lattice, values) = match (per_point, values.iter().all(|v| v.is_finite())) {
                    (true, _) => (*points, values),
                    (false, true) => (*points, corner_values(cells_of(points), &values)),
                    (false, false) => {
                        (cell_centres(points), centre_values(cells_of(points), &values))
                    }
                };
                let values: Vec<f32> = values.into_iter().map(|v| v as f32).collect();
                let mark = |v: &f32| if v.is_finite() { Mark::Inside } else { Mark::NotFinite };
                let marks = values.iter().map(mark).collect();
                let truncation = vec![];
                let at_centres = !per_point && lattice.dims != points.dims;
                Ok(LatticeValues { lattice, values, truncation, marks, report: None, at_centres })
            }
            SamplePoints::Mesh { mesh, per_point, own } => {
                let lattice = target(mesh, own.as_ref(), options)?;
                let samples =
                    if *per_point { Samples::Points(&values) } else { Samples::Cells(&values) };
                let how = resample::Options {
                    samples_per_axis: options.samples_per_axis,
                    reconstruction: options.reconstruction,
                };
                let r = match options.depth {
                    Some(Depth::Revolve) => revolve(mesh, samples, &lattice, &how)?,
                    _ => resample_mesh(mesh, samples, &lattice, &how)?,
                };
                Ok(LatticeValues {
                    lattice,
                    values: r.values,
                    truncation: r.truncation,
                    marks: r.marks,
                    report: Some(r.report),
                    at_centres: own.is_some_and(|own| lattice == cell_centres(&own)),
                })
            }
        }
    }
}

/// The mesh of the data, with depth.
fn mesh_of(data: &Dataset, options: &Options) -> Result<Mesh, InputError> {
    Ok(match options.depth {
        Some(Depth::Span(span)) => Mesh::with_plane(data, Plane::Extrude { span })?,
        Some(Depth::Revolve) => Mesh::with_plane(data, Plane::Meridian { thickness: sheet(data) })?,
        None => Mesh::new(data)?,
    })
}

/// The lattice to resample to.
fn target(mesh: &Mesh, own: Option<&Lattice>, options: &Options) -> Result<Lattice, InputError> {
    let (low, high) = match options.depth {
        Some(Depth::Revolve) => revolved_bounds(mesh)?,
        _ => mesh.bounds(),
    };
    if options.resolution == Resolution::Auto
        && options.bounds.is_none()
        && options.depth.is_none()
        && let Some(own) = own
    {
        // As where cells have no value: the border of a hidden cell is midway between nodes.
        let is_thick = own.dims.iter().all(|n| *n > 2);
        return Ok(if mesh.num_hidden() > 0 && is_thick { cell_centres(own) } else { *own });
    }
    let (whole_low, whole_high) = (low, high);
    let (low, high) = match options.bounds {
        Some([a, b]) => (a.max(low), b.min(high)),
        None => (low, high),
    };
    let size = high - low;
    if size.is_nan() || size.min_element() <= 0.0 {
        return Err(InputError::Option {
            what: format!("no part of the mesh ({whole_low} to {whole_high}) is within the bounds"),
            cure: "give the lower and the upper corner in the file's unit of length",
        });
    }
    let across = match options.depth {
        Some(Depth::Span(_)) => mesh.axis_of_depth(),
        _ => None,
    };
    let typical = mesh.typical_cell();
    let (Some(a), Resolution::Auto | Resolution::Longest(_)) = (across, options.resolution) else {
        return Ok(Lattice::fit(low, high, typical, options.resolution)?);
    };
    // A repeated flow needs no resolution along its span, which may be the longest of all.
    let mut flat = high;
    flat[a] = low[a] + size.min_element();
    let mut lattice = Lattice::fit(low, flat, typical, options.resolution)?;
    lattice.dims[a] = SPAN_NODES;
    lattice.spacing[a] = size[a] / (SPAN_NODES - 1) as f64;
    Ok(lattice)
}

/// Thickness of a plane before it is revolved: far below the spacing of any lattice and far above
/// rounding.
fn sheet(data: &Dataset) -> f64 {
    let range = |p: &mut dyn Iterator<Item = f64>| {
        let (low, high) =
            p.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        high - low
    };
    let longest = data.leaves().into_iter().map(|leaf| match leaf {
        Dataset::ImageData(d) => {
            let [nx, ny, nz] = d.dims().map(|n| n.saturating_sub(1));
            (d.point(nx, ny, nz) - d.point(0, 0, 0)).abs().max_element()
        }
        Dataset::RectilinearGrid(d) => {
            d.coordinates.iter().map(|c| range(&mut c.iter().copied())).fold(0.0, f64::max)
        }
        Dataset::StructuredGrid(d) => range(&mut (0..d.points.len()).map(|i| d.points.get(i).x)),
        Dataset::UnstructuredGrid(d) => range(&mut (0..d.points.len()).map(|i| d.points.get(i).x)),
        Dataset::PolyData(d) => range(&mut (0..d.points.len()).map(|i| d.points.get(i).x)),
        Dataset::MultiBlock(_) => 1.0,
    });
    let longest = longest.filter(|x| x.is_finite()).fold(0.0, f64::max);
    if longest > 0.0 { 1e-6 * longest } else { 1.0 }
}

/// Number of cells along each axis.
fn cells_of(points: &Lattice) -> [usize; 3] {
    points.dims.map(|d| d.saturating_sub(1))
}

fn cell_centres(points: &Lattice) -> Lattice {
    Lattice {
        dims: cells_of(points),
        origin: points.origin + 0.5 * points.spacing,
        spacing: points.spacing,
    }
}

/// The lattice of uniform three-dimensional data with axes parallel to those of space, and which
/// axes run backwards.
fn uniform(data: &Dataset) -> Option<(Lattice, [bool; 3])> {
    let (dims, first, step) = match data {
        Dataset::ImageData(d) => {
            let m = d.direction;
            let axes = DMat3::from_diagonal(DVec3::new(m.x_axis.x, m.y_axis.y, m.z_axis.z));
            if axes != m {
                return None;
            }
            (d.dims(), d.point(0, 0, 0), axes * d.spacing)
        }
        Dataset::RectilinearGrid(d) => {
            let steps = [0, 1, 2].map(|a| even_step(&d.coordinates[a]));
            let [Some(x), Some(y), Some(z)] = steps else { return None };
            let first = DVec3::new(d.coordinates[0][0], d.coordinates[1][0], d.coordinates[2][0]);
            (extent_dims(d.extent), first, DVec3::new(x, y, z))
        }
        Dataset::MultiBlock(blocks) if blocks.len() == 1 => return uniform(&blocks[0].data),
        _ => return None,
    };
    if dims.iter().any(|&d| d < 2)
        || !(step.abs().min_element() > 0.0 && step.is_finite() && first.is_finite())
    {
        return None;
    }
    let backwards = step.to_array().map(|s| s < 0.0);
    let last = first + step * DVec3::from_array(dims.map(|d| (d - 1) as f64));
    Some((Lattice { dims, origin: first.min(last), spacing: step.abs() }, backwards))
}

/// The step of uniformly spaced coordinates. `None` if they differ from equal steps by more than
/// four f32 roundings of the largest one; f32 is the precision of most files.
fn even_step(x: &[f64]) -> Option<f64> {
    let (&first, &last) = (x.first()?, x.last()?);
    if x.len() < 2 {
        return None;
    }
    let step = (last - first) / (x.len() - 1) as f64;
    let allowed = 4.0 * f64::from(f32::EPSILON) * first.abs().max(last.abs());
    let even = x.iter().enumerate().all(|(i, v)| {
        let error = (first + step * i as f64 - v).abs();
        error <= allowed && error < 0.01 * step.abs()
    });
    even.then_some(step)
}
