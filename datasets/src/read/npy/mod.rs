//! NumPy arrays (`.npy`) and archives of them (`.npz`): values on a lattice, the first index along
//! x.
//!
//! An archive may hold the lattice: coordinates along the axes as one-dimensional arrays `x`, `y`
//! and `z` (or for each point, as `numpy.meshgrid(..., indexing='ij')` makes them), or `spacing`
//! and `origin`. Otherwise spacing and origin come from [`OpenOptions`] or from
//! a file `NAME.npy.toml` beside it:
//! ```toml
//! spacing = [0.001, 0.001, 0.001]
//! origin = [0.0, 0.0, 0.0]        # optional
//! ```
//! Arrays with one index more than the lattice are vectors, components last. Arrays that are one
//! shorter than the lattice along each axis belong to its cells.

mod archive;
mod array;
mod description;
mod header;
mod lattice;

use super::error::io_error;
use super::{Content, LoadedFile, OpenOptions, ReadError};
use array::StoredArray;
use description::Placement;
use std::path::Path;

pub(crate) const FORMAT: &str = "NumPy array";
pub(super) use header::MAGIC;

/// Reads an array, or all arrays of an archive, as one data set.
///
/// # Errors
/// If no spacing or coordinates are known, or no array lies on the lattice.
pub fn read(path: &Path, options: &OpenOptions) -> Result<LoadedFile, ReadError> {
    let mut start = [0; 2];
    let mut file = std::fs::File::open(path).map_err(|e| io_error(path, e))?;
    let _ = std::io::Read::read(&mut file, &mut start).map_err(|e| io_error(path, e))?;
    let mut warnings = Vec::new();
    let is_archive = start == *b"PK";
    let format = if is_archive { archive::FORMAT } else { FORMAT };
    let placement = Placement::find(path, options)?;
    let arrays = if is_archive {
        archive::arrays(path, &mut warnings)?
    } else {
        vec![single(path, &mut warnings)?]
    };
    let data = options
        .refuse_time()
        .and_then(|()| lattice::dataset(arrays, &placement, &mut warnings))
        .map_err(|f| f.in_file(path, format))?;
    Ok(LoadedFile { format, content: Content::Data(data), warnings, time_steps: Vec::new() })
}

/// The array of an `.npy` file, called as the file.
fn single(path: &Path, warnings: &mut Vec<String>) -> Result<StoredArray, ReadError> {
    let file = std::fs::File::open(path).map_err(|e| io_error(path, e))?;
    let length = file.metadata().map_err(|e| io_error(path, e))?.len();
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut source = std::io::BufReader::new(file);
    let array =
        StoredArray::read(name, &mut source, length).map_err(|f| f.in_file(path, FORMAT))?;
    let rest = std::io::copy(&mut source, &mut std::io::sink()).map_err(|e| io_error(path, e))?;
    if rest > 0 {
        warnings.push(format!("{rest} bytes after the last value ignored"));
    }
    Ok(array)
}
