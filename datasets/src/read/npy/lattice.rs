//! Makes a data set from NumPy arrays: finds the lattice that they lie on, and sorts them to its
//! points and cells.

use super::array::StoredArray;
use super::description::Placement;
use crate::model::{
    Attributes, DataArray, Dataset, ImageData, Points, RectilinearGrid, StructuredGrid, Values,
};
use crate::read::error::{At, BROKEN, Fault};
use glam::DVec3;

/// Names of the coordinates, case-insensitive.
const COORDINATES: [&[&str]; 3] = [&["x", "x_m"], &["y", "y_m"], &["z", "z_m"]];
/// Names of the arrays that place a uniform lattice.
const PLACEMENT: [&str; 2] = ["spacing", "origin"];

/// Where the points are.
enum Geometry {
    Uniform { origin: DVec3, spacing: DVec3 },
    Rectilinear([Vec<f64>; 3]),
    Curvilinear(Vec<[f64; 3]>),
}

/// The arrays as one data set. Those with another shape than the lattice are named in `warnings`.
pub(super) fn dataset(
    arrays: Vec<StoredArray>,
    placement: &Placement,
    warnings: &mut Vec<String>,
) -> Result<Dataset, Fault> {
    let mut coordinates: [Option<StoredArray>; 3] = [None, None, None];
    let mut placing: [Option<StoredArray>; 2] = [None, None];
    let mut values = Vec::new();
    for array in arrays {
        let is = |name: &&str| name.eq_ignore_ascii_case(&array.name);
        if let Some(axis) = COORDINATES.iter().position(|names| names.iter().any(is)) {
            if let Some(other) = &coordinates[axis] {
                let what = format!("`{}` and `{}` are both coordinates", other.name, array.name);
                return Err(Fault::new(At::Field("the archive".into()), what, "save one of them"));
            }
            coordinates[axis] = Some(array);
        } else if let Some(which) = PLACEMENT.iter().position(is) {
            placing[which] = Some(array);
        } else {
            values.push(array);
        }
    }
    let placed = [
        three(placing[0].as_ref(), placement.spacing, 1.0)?,
        three(placing[1].as_ref(), placement.origin, 0.0)?,
    ];
    let (dims, axes, geometry) = geometry(coordinates, placed, &values, placement)?;
    let attributes = sorted(values, dims, axes, warnings)?;
    let extent = [0, dims[0] - 1, 0, dims[1] - 1, 0, dims[2] - 1].map(|n| n as i32);
    let data = match geometry {
        Geometry::Uniform { origin, spacing } => {
            let image = ImageData::new(dims.map(|d| d as u32), origin, spacing);
            Dataset::ImageData(ImageData { attributes, ..image })
        }
        Geometry::Rectilinear(coordinates) => {
            Dataset::RectilinearGrid(RectilinearGrid { extent, coordinates, attributes })
        }
        Geometry::Curvilinear(points) => {
            let points = Points::F64(points);
            Dataset::StructuredGrid(StructuredGrid { extent, points, attributes })
        }
    };
    data.check()?;
    Ok(data)
}

/// Three numbers of an array or an option; axes without one get `default`.
fn three(
    array: Option<&StoredArray>,
    option: Option<[f64; 3]>,
    default: f64,
) -> Result<Option<[f64; 3]>, Fault> {
    if option.is_some() {
        return Ok(option);
    }
    let Some(a) = array else { return Ok(None) };
    let found = a.values.len();
    if !(1..=3).contains(&found) || a.shape.len() > 1 {
        let what = format!("it has the shape {:?}", a.shape);
        let cure = "it needs one number for each axis";
        return Err(Fault::new(At::Field(format!("array `{}`", a.name)), what, cure));
    }
    // One number without an axis is that of all axes.
    let of = |i: usize| match a.shape.len() {
        0 => a.values.get_f64(0),
        _ if i < found => a.values.get_f64(i),
        _ => default,
    };
    Ok(Some([0, 1, 2].map(of)))
}

/// Points per axis, the number of axes that the arrays have, and where the points are.
fn geometry(
    coordinates: [Option<StoredArray>; 3],
    [spacing, origin]: [Option<[f64; 3]>; 2],
    values: &[StoredArray],
    placement: &Placement,
) -> Result<([usize; 3], usize, Geometry), Fault> {
    let axes = coordinates.iter().take_while(|c| c.is_some()).count();
    let given: Vec<StoredArray> = coordinates.into_iter().flatten().collect();
    if given.len() > axes {
        let what = format!("there is `{}`, but not the axes before it", given[axes].name);
        let cure = "save x, then y, then z";
        return Err(Fault::new(At::Field("the coordinates".into()), what, cure));
    }
    if let Some(first) = given.first() {
        if placement.spacing.is_some() || placement.origin.is_some() {
            let what = format!("spacing and origin are given, but `{}` has them too", first.name);
            let cure = "leave out the one or the other";
            return Err(Fault::new(At::Field("the coordinates".into()), what, cure));
        }
        return if first.shape.len() <= 1 { rectilinear(given) } else { curvilinear(given) };
    }
    // Without coordinates, the array with most axes shows the lattice; a fourth axis is that of
    // components.
    let most = values.iter().map(|a| a.shape.len()).filter(|n| *n <= 4).max().unwrap_or(0);
    let Some(model) = values
        .iter()
        .find(|a| most > 0 && a.shape.len() == most.min(3))
        .or_else(|| values.iter().find(|a| most == 4 && a.shape.len() == 4))
    else {
        let shapes: Vec<String> =
            values.iter().map(|a| format!("`{}` {:?}", a.name, a.shape)).collect();
        let what = format!("no array of one to four axes among {}", shapes.join(", "));
        return Err(Fault::new(At::Field("the arrays".into()), what, "save one as (nx, ny, nz)"));
    };
    let axes = model.shape.len().min(3);
    let mut dims = [1; 3];
    dims[..axes].copy_from_slice(&model.shape[..axes]);
    check_dims(dims)?;
    let Some(spacing) = spacing else {
        let what = format!("`{}` has the shape {:?}, but no coordinates", model.name, model.shape);
        return Err(Fault::option(At::Field("the lattice".into()), what, placement.cure()));
    };
    let origin = origin.unwrap_or([0.0; 3]);
    for (name, v, ok) in [
        ("spacing", spacing, spacing.iter().all(|s| s.is_finite() && *s > 0.0)),
        ("origin", origin, origin.iter().all(|o| o.is_finite())),
    ] {
        if !ok {
            let cure = "give finite numbers, and a spacing above 0";
            return Err(Fault::new(At::Field(format!("`{name}`")), format!("it is {v:?}"), cure));
        }
    }
    let (origin, spacing) = (DVec3::from_array(origin), DVec3::from_array(spacing));
    Ok((dims, axes, Geometry::Uniform { origin, spacing }))
}

fn check_dims(dims: [usize; 3]) -> Result<(), Fault> {
    let points = dims.iter().try_fold(1usize, |n, &d| n.checked_mul(d));
    if points.is_none() || dims.iter().any(|&d| !(1..=i32::MAX as usize).contains(&d)) {
        let what = format!("{dims:?} points");
        let cure = "every axis needs from 1 to 2^31-1 points";
        return Err(Fault::new(At::Field("the size of the lattice".into()), what, cure));
    }
    Ok(())
}

/// Coordinates along the axes.
fn rectilinear(given: Vec<StoredArray>) -> Result<([usize; 3], usize, Geometry), Fault> {
    let axes = given.len();
    let mut coordinates = [vec![0.0], vec![0.0], vec![0.0]];
    for (axis, array) in given.into_iter().enumerate() {
        let at = || At::Field(format!("array `{}`", array.name));
        if array.shape.len() > 1 {
            let what =
                format!("it has the shape {:?}, the other coordinates one axis", array.shape);
            return Err(Fault::new(at(), what, "save all with one axis, or all as numpy.meshgrid"));
        }
        let x: Vec<f64> = (0..array.values.len()).map(|i| array.values.get_f64(i)).collect();
        let wrong = x.windows(3).position(|w| (w[1] - w[0]) * (w[2] - w[1]) <= 0.0);
        let pair = x.len() == 2 && x[0] == x[1];
        if let Some(i) = wrong.map(|i| i + 1).or(pair.then_some(1)) {
            let what = format!("value {i} is {}, after {}", x[i], x[i - 1]);
            return Err(Fault::new(at(), what, "coordinates must grow, or all fall"));
        }
        if let Some(i) = x.iter().position(|v| !v.is_finite()) {
            return Err(Fault::new(at(), format!("value {i} is {}", x[i]), "give finite numbers"));
        }
        coordinates[axis] = x;
    }
    let dims = [0, 1, 2].map(|a| coordinates[a].len());
    check_dims(dims)?;
    Ok((dims, axes, Geometry::Rectilinear(coordinates)))
}

/// Coordinates of each point, as `numpy.meshgrid(x, y, z, indexing='ij')` makes them.
fn curvilinear(given: Vec<StoredArray>) -> Result<([usize; 3], usize, Geometry), Fault> {
    let shape = given[0].shape.clone();
    if let Some(other) = given.iter().find(|a| a.shape != shape) {
        let what = format!("it has the shape {:?}, `{}` {shape:?}", other.shape, given[0].name);
        return Err(Fault::new(At::Field(format!("array `{}`", other.name)), what, BROKEN));
    }
    if shape.len() > 3 || given.len() < shape.len() {
        let what = format!("{} coordinates with {} axes", given.len(), shape.len());
        let cure = "save a coordinate for each axis, at most three";
        return Err(Fault::new(At::Field("the coordinates".into()), what, cure));
    }
    let axes = shape.len();
    let mut dims = [1; 3];
    dims[..axes].copy_from_slice(&shape);
    check_dims(dims)?;
    let columns: Vec<DataArray> = given.into_iter().map(|a| a.over(dims, 1)).collect();
    let value = |axis: usize, i: usize| columns.get(axis).map_or(0.0, |c| c.get(i, 0));
    let points = (0..columns[0].tuples()).map(|i| [0, 1, 2].map(|axis| value(axis, i))).collect();
    Ok((dims, axes, Geometry::Curvilinear(points)))
}

/// Gives the arrays to the points or cells, by their shapes. Single numbers become field data.
fn sorted(
    values: Vec<StoredArray>,
    dims: [usize; 3],
    axes: usize,
    warnings: &mut Vec<String>,
) -> Result<Attributes, Fault> {
    let mut attributes = Attributes::default();
    let of_cells = dims.map(|d| if d == 1 { 1 } else { d - 1 });
    let mut others = Vec::new();
    for array in values {
        let fits = |dims: [usize; 3]| {
            let rest = array.shape.strip_prefix(&dims[..axes])?;
            match rest {
                [] => Some(1),
                [n] if *n > 0 => Some(*n),
                _ => None,
            }
        };
        if array.shape.is_empty() {
            attributes.field.push(DataArray::new(array.name, 1, array.values));
        } else if let Some(components) = fits(dims) {
            attributes.point.push(array.over(dims, components));
        } else if let Some(components) = fits(of_cells) {
            attributes.cell.push(array.over(of_cells, components));
        } else {
            others.push(format!("`{}` {:?}", array.name, array.shape));
        }
    }
    let lattice = &dims[..axes];
    if attributes.point.is_empty() && attributes.cell.is_empty() && !others.is_empty() {
        let what = format!("no array has its shape, {lattice:?}: {}", others.join(", "));
        let cure =
            "the first index is that of x: transpose the arrays, as a.T does for (nz, ny, nx)";
        return Err(Fault::new(At::Field("the lattice".into()), what, cure));
    }
    if !others.is_empty() {
        let names = others.join(", ");
        warnings.push(format!("arrays left out because the lattice is {lattice:?}: {names}"));
    }
    attributes.point_scalars = match attributes.point.as_slice() {
        [only] if only.components == 1 && !matches!(only.values, Values::U8(_)) => {
            Some(only.name.clone())
        }
        _ => None,
    };
    Ok(attributes)
}
