//! Where the points of a NumPy array lie, which the array does not say.

use crate::read::error::{At, Fault};
use crate::read::{OpenOptions, ReadError, raw};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// The file `NAME.npy.toml`, beside the array.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Description {
    spacing: Option<[f64; 3]>,
    origin: Option<[f64; 3]>,
}

/// Spacing and origin as options or the description give them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Placement {
    pub(super) spacing: Option<[f64; 3]>,
    pub(super) origin: Option<[f64; 3]>,
    description: PathBuf,
}

impl Placement {
    /// Options count more than the description.
    pub(super) fn find(path: &Path, options: &OpenOptions) -> Result<Placement, ReadError> {
        let mut name = path.as_os_str().to_owned();
        name.push(".toml");
        let description = PathBuf::from(name);
        let read =
            if description.is_file() { parse(&description)? } else { Description::default() };
        Ok(Placement {
            spacing: options.spacing.or(read.spacing),
            origin: options.origin.or(read.origin),
            description,
        })
    }

    /// What to do when there is no spacing.
    pub(super) fn cure(&self) -> String {
        let name = self.description.file_name().unwrap_or_default().to_string_lossy();
        format!(
            "give --spacing DX,DY,DZ, write a file {name} beside it with the line `spacing = [dx, dy, dz]`, or save it by \
             numpy.savez with arrays x, y and z of coordinates"
        )
    }
}

fn parse(path: &Path) -> Result<Description, ReadError> {
    let bytes = crate::read::error::read_bytes(path)?;
    let text = String::from_utf8_lossy(&bytes);
    toml::from_str(&text).map_err(|e| {
        let line = raw::line_of(&text, e.span());
        let cure = "it may have the lines `spacing = [dx, dy, dz]` and `origin = [x, y, z]`";
        Fault::new(At::Line(line), e.message().to_string(), cure)
            .in_file(path, "description of a NumPy array")
    })
}
