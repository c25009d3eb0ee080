//! Data sets from Python's dictionaries of arrays.
//!
//! The Python files make sure that arrays are contiguous and in the order of VTK, x fastest. What
//! does not fit together is refused by [`Dataset::check`].

use crate::errors;
use datasets::model::{
    Attributes, Block, Cells, DataArray, Dataset, ImageData, Points, RectilinearGrid,
    StructuredGrid, UnstructuredGrid, Values,
};
use glam::{DMat3, DVec3};
use numpy::{Element, PyArray1, PyArrayMethods};
use pyo3::exceptions::{PyKeyError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Name, whether it is per point, numbers per tuple, and the numbers.
type Array<'py> = (String, bool, usize, Bound<'py, PyAny>);

fn item<'py>(data: &Bound<'py, PyDict>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    data.get_item(name)?.ok_or_else(|| PyKeyError::new_err(name.to_owned()))
}

/// A copy of a contiguous array.
fn copy<T: Element + Copy>(array: &Bound<'_, PyAny>) -> PyResult<Vec<T>> {
    let array = array.cast::<PyArray1<T>>().map_err(PyErr::from)?;
    Ok(array.readonly().as_slice()?.to_vec())
}

fn values(array: &Bound<'_, PyAny>) -> PyResult<Values> {
    macro_rules! one_of {
        ($($T:ty => $kind:ident),*) => {
            $(if array.is_instance_of::<PyArray1<$T>>() {
                return Ok(Values::$kind(copy::<$T>(array)?));
            })*
        };
    }
    one_of!(f32 => F32, f64 => F64, i8 => I8, u8 => U8, i16 => I16, u16 => U16, i32 => I32,
            u32 => U32, i64 => I64, u64 => U64);
    Err(PyTypeError::new_err("arrays of numbers in one dimension are needed"))
}

fn attributes(data: &Bound<'_, PyDict>) -> PyResult<Attributes> {
    let mut found = Attributes::default();
    for (name, per_point, components, array) in item(data, "arrays")?.extract::<Vec<Array<'_>>>()? {
        let array = DataArray::new(name, components, values(&array)?);
        if per_point { &mut found.point } else { &mut found.cell }.push(array);
    }
    Ok(found)
}

fn vector(data: &Bound<'_, PyDict>, name: &str) -> PyResult<DVec3> {
    Ok(DVec3::from(item(data, name)?.extract::<[f64; 3]>()?))
}

fn points(data: &Bound<'_, PyDict>) -> PyResult<Points> {
    let array = DataArray::new("points", 3, values(&item(data, "points")?)?);
    Points::from_array(array).map_err(|e| errors::of(&e))
}

/// Cells from the ends of each and the ids of their points.
fn cells(ends: &Bound<'_, PyAny>, ids: &Bound<'_, PyAny>) -> PyResult<Cells> {
    let ids = copy::<i64>(ids)?.into_iter().map(Cells::id).collect();
    Cells::from_ends(copy::<i64>(ends)?.into_iter(), ids).map_err(|bad| {
        PyValueError::new_err(format!(
            "cell {} ends at {}, and {} to {} are possible",
            bad.cell, bad.end, bad.allowed.0, bad.allowed.1
        ))
    })
}

fn unstructured(data: &Bound<'_, PyDict>) -> PyResult<UnstructuredGrid> {
    let mut grid = UnstructuredGrid {
        points: points(data)?,
        cells: cells(&item(data, "ends")?, &item(data, "ids")?)?,
        types: copy::<u8>(&item(data, "types")?)?,
        attributes: attributes(data)?,
        ..UnstructuredGrid::default()
    };
    if data.contains("face_ends")? {
        grid.polyhedron_faces = cells(&item(data, "face_ends")?, &item(data, "face_ids")?)?;
        let of_cells = copy::<i64>(&item(data, "faces_of_cells")?)?;
        let count = grid.polyhedron_faces.len();
        let index = |i: i64| usize::try_from(i).ok().filter(|i| *i <= count);
        for ends in of_cells.windows(2) {
            let (Some(first), Some(end)) = (index(ends[0]), index(ends[1])) else {
                return Err(PyValueError::new_err(format!(
                    "a polyhedron has the faces {} to {}, and there are {count}",
                    ends[0], ends[1]
                )));
            };
            grid.faces_of_cell.push(first..end.max(first));
        }
    }
    Ok(grid)
}

/// A data set from its dictionary.
pub(crate) fn dataset(data: &Bound<'_, PyDict>) -> PyResult<Dataset> {
    let kind: String = item(data, "kind")?.extract()?;
    let made = match kind.as_str() {
        "ImageData" => Dataset::ImageData(ImageData {
            extent: item(data, "extent")?.extract()?,
            origin: vector(data, "origin")?,
            spacing: vector(data, "spacing")?,
            direction: DMat3::from_cols_array(&item(data, "direction")?.extract::<[f64; 9]>()?)
                .transpose(),
            attributes: attributes(data)?,
        }),
        "RectilinearGrid" => {
            let [x, y, z] = item(data, "coordinates")?.extract::<[Bound<'_, PyAny>; 3]>()?;
            Dataset::RectilinearGrid(RectilinearGrid {
                extent: item(data, "extent")?.extract()?,
                coordinates: [copy(&x)?, copy(&y)?, copy(&z)?],
                attributes: attributes(data)?,
            })
        }
        "StructuredGrid" => Dataset::StructuredGrid(StructuredGrid {
            extent: item(data, "extent")?.extract()?,
            points: points(data)?,
            attributes: attributes(data)?,
        }),
        "UnstructuredGrid" => Dataset::UnstructuredGrid(unstructured(data)?),
        "MultiBlock" => {
            let blocks = item(data, "blocks")?.extract::<Vec<(String, Bound<'_, PyDict>)>>()?;
            let block = |(name, data): (String, Bound<'_, PyDict>)| -> PyResult<Block> {
                Ok(Block { name, data: dataset(&data)? })
            };
            Dataset::MultiBlock(blocks.into_iter().map(block).collect::<PyResult<_>>()?)
        }
        other => return Err(PyValueError::new_err(format!("there is no kind `{other}`"))),
    };
    made.check().map_err(|e| errors::of(&e))?;
    Ok(made)
}
