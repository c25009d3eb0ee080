//! VTKHDF (`.vtkhdf`, `.hdf`), versions 1 and 2: image data, unstructured grids and poly data, in
//! partitions and with times, and collections of them.
//!
//! Source: "VTKHDF file format" (Kitware, VTK documentation), and what VTK 9.7 writes.

mod arrays;
mod cells;

use super::hdf5::{Hdf5File, Object};
use super::{Content, LoadedFile, OpenOptions, ReadError, TimeStep, time_axis};
use crate::model::{Block, Dataset, ImageData};
use crate::read::error::{At, BROKEN, Fault};
use arrays::{Section, section};
use glam::{DMat3, DVec3};
use std::path::Path;

pub(crate) const FORMAT: &str = "VTKHDF";
/// The group that holds everything.
pub(crate) const ROOT: &str = "VTKHDF";

/// Where one time begins in the arrays of a data set.
pub(super) struct Step<'f> {
    /// The group `Steps`, and the number of the time in it.
    group: Option<(Object<'f>, u64)>,
}

impl Step<'_> {
    /// A number of an array of the group `Steps`: that of this time and a column.
    fn offset(&self, name: &str, column: u64) -> Result<Option<u64>, Fault> {
        let Some((group, step)) = &self.group else { return Ok(None) };
        let Some(array) = group.find(name)? else { return Ok(None) };
        let shape = array.shape()?;
        let values = match shape.len() {
            1 if column == 0 => array.values_in(&[*step], &[1])?,
            2 => array.values_in(&[*step, column], &[1, 1])?,
            _ => return Err(Fault::field(format!("`{}`", array.path), format!("{shape:?}"))),
        };
        Ok(Some(unsigned(values.get_f64(0), &array.path)?))
    }
}

fn unsigned(value: f64, path: &str) -> Result<u64, Fault> {
    if (0.0..9e15).contains(&value) && value.fract() == 0.0 {
        return Ok(value as u64);
    }
    Err(Fault::field(format!("`{path}`"), format!("{value} is no count")))
}

/// Reads a VTKHDF file, or one of its times.
pub(crate) fn read(path: &Path, options: &OpenOptions) -> Result<LoadedFile, ReadError> {
    let file = Hdf5File::open(path, FORMAT)?;
    from_file(path, &file, options.time).map_err(|f| f.in_file(path, FORMAT))
}

fn from_file(path: &Path, file: &Hdf5File, time: Option<f64>) -> Result<LoadedFile, Fault> {
    let mut warnings = Vec::new();
    let root = file.root()?.get(ROOT)?;
    match root.numbers("Version")?.as_deref() {
        Some([major, ..]) if *major == 1.0 || *major == 2.0 => {}
        other => {
            let at = At::Field("`/VTKHDF`, attribute `Version`".into());
            let cure = "versions 1 and 2 are read: write it with VTK 9.2 to 9.7";
            return Err(Fault::unsupported(at, format!("{other:?}"), cure));
        }
    }
    let kind = kind(&root)?;
    let mut steps = Vec::new();
    let data = if kind == "PartitionedDataSetCollection" || kind == "MultiBlockDataSet" {
        let mut blocks = Vec::new();
        for (name, object) in root.children(&mut warnings)? {
            if object.attribute("Type")?.is_some() {
                let index = object.numbers("Index")?.and_then(|i| i.first().copied());
                blocks.push((index.unwrap_or(0.0), name, object));
            }
        }
        blocks.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut out = Vec::new();
        for (_, name, object) in blocks {
            let data = data_set(path, &object, time, &mut steps, &mut warnings)?;
            out.push(Block { name, data });
        }
        Dataset::MultiBlock(out)
    } else {
        data_set(path, &root, time, &mut steps, &mut warnings)?
    };
    if time.is_some() && steps.is_empty() {
        OpenOptions { time, ..Default::default() }.refuse_time()?;
    }
    let mut once: Vec<String> = Vec::new();
    for w in warnings {
        if !once.contains(&w) {
            once.push(w);
        }
    }
    data.check()?;
    let content = Content::Data(data);
    Ok(LoadedFile { format: FORMAT, content, warnings: once, time_steps: steps })
}

fn kind(group: &Object<'_>) -> Result<String, Fault> {
    let at = || At::Field(format!("`{}`, attribute `Type`", group.path));
    group.text("Type")?.ok_or_else(|| Fault::new(at(), "it is missing", BROKEN))
}

/// The data set of a group.
fn data_set(
    path: &Path,
    group: &Object<'_>,
    time: Option<f64>,
    steps: &mut Vec<TimeStep>,
    warnings: &mut Vec<String>,
) -> Result<Dataset, Fault> {
    let mut step = Step { group: None };
    if let Some(of_times) = group.find("Steps")? {
        let values = of_times.get("Values")?.values()?;
        let times: Vec<f64> = (0..values.len()).map(|i| values.get_f64(i)).collect();
        if !times.is_empty() {
            let (chosen, found) = time_axis::choose(path, &times, time, warnings)?;
            if steps.is_empty() {
                *steps = found;
            }
            step.group = Some((of_times, chosen as u64));
        }
    }
    match kind(group)?.as_str() {
        "ImageData" => image(group, &step, warnings),
        "UnstructuredGrid" => cells::unstructured(group, &step, warnings),
        "PolyData" => cells::poly_data(group, &step, warnings),
        other => {
            let at = At::Field(format!("`{}`, attribute `Type`", group.path));
            let cure = "write it as ImageData, UnstructuredGrid, PolyData or a collection of them";
            Err(Fault::unsupported(at, format!("`{other}`"), cure))
        }
    }
}

fn image(
    group: &Object<'_>,
    step: &Step<'_>,
    warnings: &mut Vec<String>,
) -> Result<Dataset, Fault> {
    fn numbers<const N: usize>(
        group: &Object<'_>,
        name: &str,
        default: Option<[f64; N]>,
    ) -> Result<[f64; N], Fault> {
        let found = group.numbers(name)?;
        match (found, default) {
            (None, Some(default)) => Ok(default),
            (found, _) => {
                let found = found.unwrap_or_default();
                <[f64; N]>::try_from(found.clone()).map_err(|_| {
                    let at = format!("`{}`, attribute `{name}`", group.path);
                    Fault::field(at, format!("{found:?} instead of {N} numbers"))
                })
            }
        }
    }
    let extent = numbers::<6>(group, "WholeExtent", None)?;
    if extent.iter().any(|e| e.abs() > f64::from(i32::MAX) || e.fract() != 0.0) {
        return Err(Fault::field("`/VTKHDF`, attribute `WholeExtent`", format!("{extent:?}")));
    }
    let extent = extent.map(|e| e as i32);
    let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let direction = numbers::<9>(group, "Direction", Some(identity))?;
    let dims = crate::model::extent_dims(extent).map(|d| d as u64);
    let of_cells = dims.map(|d| if d == 1 { 1 } else { d.saturating_sub(1) });
    let mut image = ImageData {
        extent,
        origin: DVec3::from_array(numbers(group, "Origin", Some([0.0; 3]))?),
        spacing: DVec3::from_array(numbers(group, "Spacing", Some([1.0; 3]))?),
        direction: DMat3::from_cols_array(&direction).transpose(),
        attributes: Default::default(),
    };
    for (what, dims) in [(Section::Points, dims), (Section::Cells, of_cells)] {
        arrays::on_lattice(group, what, dims, step, &mut image.attributes, warnings)?;
    }
    arrays::field_data(group, step, &mut image.attributes, warnings)?;
    Ok(Dataset::ImageData(image))
}

/// Arrays of the points and the cells of one partition.
fn attributes(
    group: &Object<'_>,
    step: &Step<'_>,
    points: std::ops::Range<u64>,
    cells: std::ops::Range<u64>,
    starts: [u64; 2],
    warnings: &mut Vec<String>,
) -> Result<crate::model::Attributes, Fault> {
    let mut out = crate::model::Attributes::default();
    section(group, Section::Points, points, starts[0], step, &mut out, warnings)?;
    section(group, Section::Cells, cells, starts[1], step, &mut out, warnings)?;
    arrays::field_data(group, step, &mut out, warnings)?;
    Ok(out)
}
