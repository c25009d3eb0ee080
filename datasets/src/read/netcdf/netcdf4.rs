//! NetCDF-4: dimensions are dimension scales of HDF5, which variables refer to.

use super::{AttributeValue, Container, Dimension, Header, Variable};
use crate::model::Values;
use crate::read::error::{At, BROKEN, Fault};
use crate::read::hdf5::{Data, Hdf5File, Object};

/// Whether an HDF5 file has dimension scales, or says that it is NetCDF.
pub(crate) fn is_netcdf4(file: &Hdf5File) -> Result<bool, Fault> {
    let root = file.root()?;
    if root.attribute("_NCProperties")?.is_some() {
        return Ok(true);
    }
    for (_, child) in root.children(&mut Vec::new())? {
        if is_scale(&child)? {
            return Ok(true);
        }
    }
    Ok(false)
}

fn is_scale(object: &Object<'_>) -> Result<bool, Fault> {
    Ok(object.is_dataset() && object.text("CLASS")?.as_deref() == Some("DIMENSION_SCALE"))
}

pub(super) struct Netcdf4File {
    file: Hdf5File,
    header: Header,
    /// The address of each variable.
    addresses: Vec<u64>,
}

/// Attributes that only keep the file together.
const INNER: [&str; 8] = [
    "CLASS",
    "NAME",
    "REFERENCE_LIST",
    "DIMENSION_LIST",
    "_Netcdf4Dimid",
    "_Netcdf4Coordinates",
    "_NCProperties",
    "DIMENSION_LABELS",
];

impl Netcdf4File {
    pub(super) fn new(file: Hdf5File) -> Result<Self, Fault> {
        let mut header = Header::default();
        let mut addresses = Vec::new();
        let mut scales: Vec<u64> = Vec::new();
        let mut groups = Vec::new();
        let root = file.root()?;
        let mut objects = Vec::new();
        for (name, object) in root.children(&mut header.warnings)? {
            if !object.is_dataset() {
                groups.push(format!("`{name}`"));
                continue;
            }
            if is_scale(&object)? {
                let length = object.shape()?.first().copied().unwrap_or(0);
                let is_unlimited = object.can_grow()?;
                header.dimensions.push(Dimension { name: name.clone(), length, is_unlimited });
                scales.push(object.address);
            }
            objects.push((name, object));
        }
        if !groups.is_empty() {
            header.warnings.push(format!("groups left out: {}", groups.join(", ")));
        }
        for (name, object) in objects {
            // A dimension without a variable is a dataset that says so.
            let text = object.text("NAME")?.unwrap_or_default();
            if text.starts_with("This is a netCDF dimension but not a netCDF variable") {
                continue;
            }
            let shape = object.shape()?;
            let mut axes = Vec::new();
            match object.attribute("DIMENSION_LIST")? {
                Some(Data::References(lists)) => {
                    for list in &lists {
                        let scale = list.first().and_then(|r| scales.iter().position(|s| s == r));
                        let Some(axis) = scale else {
                            let at = At::Field(format!("variable `{name}`"));
                            let what = "its dimensions are not in the root group";
                            return Err(Fault::new(at, what, BROKEN));
                        };
                        axes.push(axis);
                    }
                }
                _ => {
                    let own = scales.iter().position(|&s| s == object.address);
                    axes.extend(own.filter(|_| shape.len() == 1));
                }
            }
            if axes.len() != shape.len() {
                header.warnings.push(format!(
                    "variable `{name}` left out: it has {} axes and {} dimensions",
                    shape.len(),
                    axes.len()
                ));
                continue;
            }
            let mut attributes = Vec::new();
            for a in object.attributes()? {
                if INNER.contains(&a.name.as_str()) {
                    continue;
                }
                match a.data {
                    Data::Texts(t) => attributes.push((a.name, AttributeValue::Text(t.join(" ")))),
                    Data::Numbers(v) => attributes.push((a.name, AttributeValue::Numbers(v))),
                    _ => {}
                }
            }
            let is_number = object.is_number()?;
            // A variable that was written less often than the others is shorter.
            for (&axis, &length) in axes.iter().zip(&shape) {
                let d = &mut header.dimensions[axis];
                d.length = if d.is_unlimited { d.length.max(length) } else { d.length };
            }
            header.variables.push(Variable { name, axes, attributes, is_number });
            addresses.push(object.address);
        }
        Ok(Netcdf4File { file, header, addresses })
    }
}

impl Container for Netcdf4File {
    fn header(&self) -> &Header {
        &self.header
    }

    fn values(&self, variable: usize, start: &[u64], count: &[u64]) -> Result<Values, Fault> {
        let name = self.header.variables[variable].name.clone();
        self.file.at(self.addresses[variable], format!("/{name}"))?.values_in(start, count)
    }

    fn characters(&self, variable: usize) -> Result<Vec<u8>, Fault> {
        let name = &self.header.variables[variable].name;
        match self.file.at(self.addresses[variable], format!("/{name}"))?.read()? {
            // One text a character; that of a zero is empty.
            Data::Texts(t) => {
                Ok(t.iter().map(|t| t.as_bytes().first().copied().unwrap_or(0)).collect())
            }
            _ => Err(Fault::field(format!("variable `{name}`"), "it does not hold texts")),
        }
    }
}
