//! Makes a data set from variables: finds the lattice of most of them, its coordinates, and the
//! time.

use super::units::to_si;
use super::{Container, Header, Variable};
use crate::model::{
    Attributes, DataArray, Dataset, ImageData, RectilinearGrid, Values, lattice_counts,
};
use crate::read::error::{At, BROKEN, Fault};
use crate::read::{OpenOptions, TimeStep, time_axis};
use glam::DVec3;
use std::path::Path;

/// Floats of variables that were never written (NC_FILL_FLOAT of netcdf.h).
const NEVER_WRITTEN: f64 = 9.969_209_968_386_869e36;
/// Largest deviation of a coordinate from a uniform lattice, in spacings. Coordinates in 32 bits
/// deviate by their rounding.
const UNIFORM: f64 = 1e-6;

/// The axes of the lattice, and how values are put into the order x, y, z.
struct Lattice {
    /// Dimensions along x, y, z; fewer for planes and lines.
    axes: Vec<usize>,
    dims: [usize; 3],
}

pub(super) fn dataset(
    path: &Path,
    file: &dyn Container,
    options: &OpenOptions,
    warnings: &mut Vec<String>,
) -> Result<(Dataset, Vec<TimeStep>), Fault> {
    let header = file.header();
    let time_axis = time_dimension(header);
    let (step, steps) = match time_axis {
        None => {
            OpenOptions { time: options.time, ..Default::default() }.refuse_time()?;
            (0, Vec::new())
        }
        Some(axis) => {
            let times = times(file, axis)?;
            if times.is_empty() {
                let at = At::Field(format!("dimension `{}`", header.dimensions[axis].name));
                return Err(Fault::new(at, "it has no time", "write at least one time"));
            }
            time_axis::choose(path, &times, options.time, warnings)?
        }
    };
    let lattice = lattice(header, time_axis)?;
    let mut attributes = Attributes::default();
    let mut left_out = Vec::new();
    let mut units = Vec::new();
    for (i, v) in header.variables.iter().enumerate() {
        if is_coordinate(header, v) || is_bounds(header, v) {
            continue;
        }
        let with_time = v.axes.first() == time_axis.as_ref() && time_axis.is_some();
        let space = &v.axes[usize::from(with_time)..];
        let is_there =
            space.len() == lattice.axes.len() && lattice.axes.iter().all(|a| space.contains(a));
        if !is_there || !v.is_number {
            left_out.push(format!("`{}`", v.name));
            continue;
        }
        let mut start = vec![0; v.axes.len()];
        let mut count: Vec<u64> = v.axes.iter().map(|&a| header.dimensions[a].length).collect();
        if with_time {
            (start[0], count[0]) = (step as u64, 1);
        }
        let values = file.values(i, &start, &count)?;
        let points = lattice.dims.iter().product::<usize>();
        if values.len() != points {
            let at = format!("variable `{}`", v.name);
            return Err(Fault::field(at, format!("{} values for {points} points", values.len())));
        }
        let values = reordered(values, space, &lattice);
        let values = unpacked(v, values, warnings)?;
        if let Some(unit) = v.text("units") {
            let unit = to_si(unit).map_or(unit, |si| si.unit);
            units.push(format!("{} {unit}", v.name));
        }
        attributes.point.push(DataArray::new(v.name.clone(), 1, values));
    }
    if attributes.point.is_empty() {
        let what = format!("no variable of numbers on its lattice among {}", left_out.join(", "));
        return Err(Fault::field("the variables", what));
    }
    if !left_out.is_empty() {
        let list = left_out.join(", ");
        warnings.push(format!("variables left out, which are not on the lattice: {list}"));
    }
    if !units.is_empty() {
        attributes.text.push(("units".into(), units));
    }
    if let [only] = &attributes.point[..] {
        attributes.point_scalars = Some(only.name.clone());
    }
    let data = placed(file, &lattice, attributes, options, warnings)?;
    data.check()?;
    Ok((data, steps))
}

/// A variable with the name of its only dimension.
fn is_coordinate(header: &Header, v: &Variable) -> bool {
    matches!(v.axes[..], [axis] if header.dimensions[axis].name == v.name)
}

/// Whether another variable says that this one has the borders of its cells.
fn is_bounds(header: &Header, v: &Variable) -> bool {
    let names = |other: &Variable, key: &str| other.text(key) == Some(v.name.as_str());
    header.variables.iter().any(|o| names(o, "bounds") || names(o, "climatology"))
}

fn coordinate_of(header: &Header, axis: usize) -> Option<usize> {
    let name = &header.dimensions[axis].name;
    header.variables.iter().position(|v| v.name == *name && v.axes == [axis] && v.is_number)
}

/// The dimension of the time: by its coordinate, its name, or because it can grow.
fn time_dimension(header: &Header) -> Option<usize> {
    let is_used = |&axis: &usize| {
        header.variables.iter().any(|v| v.axes.len() > 1 && v.axes.first() == Some(&axis))
    };
    let says_so = |&axis: &usize| {
        coordinate_of(header, axis).is_some_and(|c| {
            let c = &header.variables[c];
            c.text("axis") == Some("T")
                || c.text("standard_name") == Some("time")
                || c.text("units").is_some_and(|u| u.contains(" since "))
        })
    };
    let named = |&axis: &usize| {
        header.dimensions[axis].name.eq_ignore_ascii_case("time")
            || header.dimensions[axis].name.eq_ignore_ascii_case("t")
    };
    let grows = |&axis: &usize| header.dimensions[axis].is_unlimited;
    let all = || (0..header.dimensions.len()).filter(is_used);
    all().find(says_so).or_else(|| all().find(named)).or_else(|| all().find(grows))
}

/// The times, or their numbers if there is no coordinate.
fn times(file: &dyn Container, axis: usize) -> Result<Vec<f64>, Fault> {
    let header = file.header();
    let length = header.dimensions[axis].length;
    match coordinate_of(header, axis) {
        Some(c) => {
            let v = file.values(c, &[0], &[length])?;
            Ok((0..v.len()).map(|i| v.get_f64(i)).collect())
        }
        // Every time takes room: a variable has it as its first axis.
        None if length <= time_axis::MOST as u64 => Ok((0..length).map(|i| i as f64).collect()),
        None => {
            let at = format!("dimension `{}`", header.dimensions[axis].name);
            Err(Fault::field(at, format!("{length} times")))
        }
    }
}

/// The lattice of the variable with most axes.
fn lattice(header: &Header, time: Option<usize>) -> Result<Lattice, Fault> {
    let space = |v: &Variable| -> Vec<usize> {
        let with_time = time.is_some() && v.axes.first() == time.as_ref();
        v.axes[usize::from(with_time)..].to_vec()
    };
    let all: Vec<(&Variable, Vec<usize>)> = header
        .variables
        .iter()
        .filter(|v| v.is_number && !is_coordinate(header, v) && !is_bounds(header, v))
        .map(|v| (v, space(v)))
        .filter(|(_, axes)| (1..=3).contains(&axes.len()))
        .collect();
    let most = all.iter().map(|(_, axes)| axes.len()).max();
    let Some((v, found)) = all.into_iter().find(|(_, axes)| Some(axes.len()) == most) else {
        let list: Vec<String> = header
            .variables
            .iter()
            .map(|v| format!("`{}` with {} axes", v.name, v.axes.len()))
            .collect();
        let what =
            format!("no variable of one to three axes besides the time: {}", list.join(", "));
        let cure = "write one with (time,) z, y, x and a coordinate variable for each";
        return Err(Fault::unsupported(At::Field("the variables".into()), what, cure));
    };
    let mut twice = found.clone();
    twice.sort_unstable();
    twice.dedup();
    if twice.len() != found.len() {
        let at = format!("variable `{}`", v.name);
        return Err(Fault::field(at, "it has the same dimension twice"));
    }
    // The last axis is x, unless the coordinates say otherwise.
    let mut axes: Vec<usize> = found.iter().rev().copied().collect();
    let named: Vec<Option<usize>> = found.iter().map(|&a| direction(header, a)).collect();
    let mut sorted: Vec<usize> = named.iter().flatten().copied().collect();
    sorted.sort_unstable();
    sorted.dedup();
    if sorted.len() == found.len() {
        axes = sorted
            .iter()
            .filter_map(|d| named.iter().position(|n| n == &Some(*d)))
            .map(|at| found[at])
            .collect();
    }
    let mut dims = [1usize; 3];
    for (d, &axis) in dims.iter_mut().zip(&axes) {
        let length = header.dimensions[axis].length;
        *d = usize::try_from(length)
            .ok()
            .filter(|&l| (1..=i32::MAX as usize).contains(&l))
            .ok_or_else(|| {
                let at = format!("dimension `{}`", header.dimensions[axis].name);
                Fault::field(at, format!("{length} points; a lattice has 1 to 2^31-1"))
            })?;
    }
    if lattice_counts(dims).is_none() {
        return Err(Fault::field("the lattice", format!("{dims:?} points")));
    }
    Ok(Lattice { axes, dims })
}

/// 0, 1, 2 for an axis that says that it is x, y or z.
fn direction(header: &Header, axis: usize) -> Option<usize> {
    let marked = coordinate_of(header, axis).and_then(|c| header.variables[c].text("axis"));
    match marked {
        Some("X") => return Some(0),
        Some("Y") => return Some(1),
        Some("Z") => return Some(2),
        _ => {}
    }
    match header.dimensions[axis].name.to_ascii_lowercase().as_str() {
        "x" | "lon" | "longitude" => Some(0),
        "y" | "lat" | "latitude" => Some(1),
        "z" | "lev" | "level" | "height" | "depth" | "alt" | "altitude" => Some(2),
        _ => None,
    }
}

/// Values in the order of the lattice, x fastest. `space` are the axes of the variable.
fn reordered(values: Values, space: &[usize], lattice: &Lattice) -> Values {
    if space.iter().rev().eq(lattice.axes.iter()) {
        return values;
    }
    let length =
        |axis: usize| lattice.axes.iter().position(|&a| a == axis).map_or(1, |i| lattice.dims[i]);
    let mut stride = [0usize; 3];
    let mut step = 1;
    for &axis in space.iter().rev() {
        if let Some(i) = lattice.axes.iter().position(|&a| a == axis) {
            stride[i] = step;
        }
        step *= length(axis);
    }
    let [nx, ny, nz] = lattice.dims;
    let places = (0..nx * ny * nz)
        .map(|i| i % nx * stride[0] + i / nx % ny * stride[1] + i / (nx * ny) * stride[2]);
    values.gathered(places)
}

/// Applies fill value, scale and offset, and converts to SI. Missing values become NaN.
fn unpacked(v: &Variable, values: Values, warnings: &mut Vec<String>) -> Result<Values, Fault> {
    let is_float = matches!(values, Values::F32(_) | Values::F64(_));
    let mut missing: Vec<f64> =
        [v.number("_FillValue"), v.number("missing_value")].into_iter().flatten().collect();
    if v.number("_FillValue").is_none() && is_float {
        missing.push(NEVER_WRITTEN);
    }
    let is_missing = |x: f64| {
        missing
            .iter()
            .any(|&m| x == m || (is_float && (x - m).abs() <= 1e-6 * m.abs() && m.abs() > 1e30))
    };
    let (scale, offset) = (v.number("scale_factor"), v.number("add_offset"));
    let si = v.text("units").and_then(to_si);
    let count = (0..values.len()).filter(|&i| is_missing(values.get_f64(i))).count();
    for (name, value) in [("scale_factor", scale), ("add_offset", offset)] {
        if let Some(x) = value
            && !x.is_finite()
        {
            let at = At::Field(format!("variable `{}`, attribute `{name}`", v.name));
            return Err(Fault::new(at, format!("it is {x}"), BROKEN));
        }
    }
    if count > 0 {
        let n = values.len();
        warnings.push(format!(
            "variable `{}`: {count} of {n} values are missing (its fill value) and become NaN",
            v.name
        ));
    }
    if let Some(si) = si {
        let from = v.text("units").unwrap_or("");
        warnings.push(format!("variable `{}` is converted from {from} to {}", v.name, si.unit));
    }
    if count == 0 && scale.is_none() && offset.is_none() && si.is_none() {
        return Ok(values);
    }
    let (scale, offset) = (scale.unwrap_or(1.0), offset.unwrap_or(0.0));
    let (unit_scale, unit_offset) = si.map_or((1.0, 0.0), |s| (s.scale, s.offset));
    let value = |i: usize| match values.get_f64(i) {
        x if is_missing(x) => f64::NAN,
        x => (x * scale + offset) * unit_scale + unit_offset,
    };
    let all = 0..values.len();
    Ok(match values {
        Values::F32(_) => Values::F32(all.map(|i| value(i) as f32).collect()),
        _ => Values::F64(all.map(value).collect()),
    })
}

/// Gives the values the coordinates of the lattice.
fn placed(
    file: &dyn Container,
    lattice: &Lattice,
    attributes: Attributes,
    options: &OpenOptions,
    warnings: &mut Vec<String>,
) -> Result<Dataset, Fault> {
    let header = file.header();
    let mut coordinates = [vec![0.0], vec![0.0], vec![0.0]];
    let mut without = Vec::new();
    for (x, &axis) in coordinates.iter_mut().zip(&lattice.axes) {
        let d = &header.dimensions[axis];
        let Some(c) = coordinate_of(header, axis) else {
            without.push(format!("`{}`", d.name));
            continue;
        };
        let v = &header.variables[c];
        let values = file.values(c, &[0], &[d.length])?;
        let mut scale =
            (v.number("scale_factor").unwrap_or(1.0), v.number("add_offset").unwrap_or(0.0));
        match v.text("units") {
            Some(unit) if unit.starts_with("degree") => warnings.push(format!(
                "coordinate `{}` is in {unit}: its numbers are taken as lengths",
                v.name
            )),
            Some(unit) => {
                if let Some(si) = to_si(unit).filter(|si| si.unit == "m") {
                    scale = (scale.0 * si.scale, scale.1 * si.scale);
                    warnings.push(format!("coordinate `{}` is converted from {unit} to m", v.name));
                }
            }
            None => {}
        }
        *x = (0..values.len()).map(|i| values.get_f64(i) * scale.0 + scale.1).collect();
        let at = || At::Field(format!("coordinate `{}`", v.name));
        if let Some(i) = x.iter().position(|v| !v.is_finite()) {
            return Err(Fault::new(at(), format!("value {i} is {}", x[i]), "write finite numbers"));
        }
        let grows = x.windows(2).all(|w| w[1] > w[0]);
        if !grows && !x.windows(2).all(|w| w[1] < w[0]) {
            let what = "its values neither all grow nor all fall";
            return Err(Fault::new(at(), what, "sort the variables along this dimension"));
        }
    }
    let dims = lattice.dims.map(|d| d as u32);
    if without.len() == lattice.axes.len()
        && let Some(spacing) = options.spacing
    {
        let origin = DVec3::from_array(options.origin.unwrap_or([0.0; 3]));
        let image = ImageData::new(dims, origin, DVec3::from_array(spacing));
        return Ok(Dataset::ImageData(ImageData { attributes, ..image }));
    }
    if !without.is_empty() {
        let what = format!("{} without a coordinate variable", without.join(", "));
        let cure = "write a variable with the name of each dimension, or give spacing (--spacing \
                    DX,DY,DZ) and origin if none has one";
        return Err(Fault::option(At::Field("the dimensions".into()), what, cure));
    }
    options.refuse_lattice()?;
    // Uniform coordinates make image data. An axis of one point has a spacing of 1.
    let spacing = coordinates.each_ref().map(|x| match x[..] {
        [first, .., last] => (last - first) / (x.len() - 1) as f64,
        _ => 1.0,
    });
    let is_uniform = (0..3).all(|a| {
        let x = &coordinates[a];
        let largest = x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let most = (UNIFORM * spacing[a]).max(f64::from(f32::EPSILON) * largest);
        spacing[a] > 0.0
            && x.iter().enumerate().all(|(i, v)| (v - (x[0] + spacing[a] * i as f64)).abs() <= most)
    });
    if is_uniform {
        let origin = DVec3::from_array(coordinates.each_ref().map(|x| x[0]));
        let image = ImageData::new(dims, origin, DVec3::from_array(spacing));
        return Ok(Dataset::ImageData(ImageData { attributes, ..image }));
    }
    let extent = [0, dims[0] as i32 - 1, 0, dims[1] as i32 - 1, 0, dims[2] as i32 - 1];
    Ok(Dataset::RectilinearGrid(RectilinearGrid { extent, coordinates, attributes }))
}
