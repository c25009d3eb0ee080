//! NetCDF: classic files (CDF-1, CDF-2, CDF-5) and NetCDF-4, which is HDF5. Exodus II files are
//! read as meshes ([`exodus`]). Otherwise, variables on the
//! lattice that their coordinate variables span become image data or a rectilinear grid.
//!
//! Source: "NetCDF Classic Format Specification" and "NetCDF-4 format" (Unidata), "CF Metadata
//! Conventions 1.11".

mod classic;
pub(crate) mod exodus;
mod lattice;
mod netcdf4;
mod units;

pub(crate) use netcdf4::is_netcdf4;

use super::error::{Fault, io_error};
use super::{Content, LoadedFile, OpenOptions, ReadError};
use crate::model::Values;
use std::path::Path;

pub(crate) const FORMAT: &str = "NetCDF";

/// The value of an attribute.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum AttributeValue {
    Text(String),
    Numbers(Values),
}

/// An axis that variables share.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Dimension {
    pub(super) name: String,
    pub(super) length: u64,
    pub(super) is_unlimited: bool,
}

/// An array, and what the file says about it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Variable {
    pub(super) name: String,
    /// Its axes, the last of which varies fastest, as indices into [`Header::dimensions`].
    pub(super) axes: Vec<usize>,
    pub(super) attributes: Vec<(String, AttributeValue)>,
    /// Whether its values are numbers.
    pub(super) is_number: bool,
}

impl Variable {
    pub(super) fn text(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find_map(|(n, v)| match v {
            AttributeValue::Text(t) if n == name => Some(t.as_str()),
            _ => None,
        })
    }
    pub(super) fn number(&self, name: &str) -> Option<f64> {
        self.attributes.iter().find_map(|(n, v)| match v {
            AttributeValue::Numbers(v) if n == name && !v.is_empty() => Some(v.get_f64(0)),
            _ => None,
        })
    }
}

/// Everything in a file but its values.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Header {
    pub(super) dimensions: Vec<Dimension>,
    pub(super) variables: Vec<Variable>,
    pub(super) warnings: Vec<String>,
}

/// A file of either form.
pub(super) trait Container {
    fn header(&self) -> &Header;
    /// The numbers of a box of a variable.
    fn values(&self, variable: usize, start: &[u64], count: &[u64]) -> Result<Values, Fault>;
    /// All characters of a variable of texts.
    fn characters(&self, variable: usize) -> Result<Vec<u8>, Fault>;
}

/// Reads a NetCDF file, or one of its times.
pub(crate) fn read(path: &Path, options: &OpenOptions) -> Result<LoadedFile, ReadError> {
    let file = std::fs::File::open(path).map_err(|e| io_error(path, e))?;
    let length = file.metadata().map_err(|e| io_error(path, e))?.len();
    let fault = |f: Fault| f.in_file(path, FORMAT);
    let container: Box<dyn Container> = match classic::ClassicFile::open(file, length) {
        Ok(Some(classic)) => Box::new(classic),
        Ok(None) => {
            let file = super::hdf5::Hdf5File::open(path, FORMAT)?;
            Box::new(netcdf4::Netcdf4File::new(file).map_err(fault)?)
        }
        Err(f) => return Err(fault(f)),
    };
    let mut warnings = container.header().warnings.clone();
    let is_exodus = exodus::is_exodus(container.header());
    let (read, format): (fn(_, &dyn Container, _, _) -> _, _) = match is_exodus {
        true => (exodus::dataset, exodus::FORMAT),
        false => (lattice::dataset, FORMAT),
    };
    let (data, time_steps) = read(path, &*container, options, &mut warnings)
        .map_err(|f: Fault| f.in_file(path, format))?;
    Ok(LoadedFile { format, content: Content::Data(data), warnings, time_steps })
}
