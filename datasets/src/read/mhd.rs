//! MetaImage volumes: `.mha` (one file) and `.mhd` (header that names a raw file).
//!
//! Source: the MetaIO documentation at itk.org/Wiki/MetaIO/Documentation.

use super::error::{At, BROKEN, Cursor, Fault, read_bytes, sibling_path};
use super::value_files;
use super::volume::{Packing, ValuesPlace, Volume, start_of_file};
use super::{Content, LoadedFile, OpenOptions, ReadError};
use crate::model::{Endian, ScalarType};
use glam::{DMat3, DVec3};
use std::collections::BTreeMap;
use std::path::Path;

pub(crate) const FORMAT: &str = "MetaImage";

/// Reads a `.mha` file, or a `.mhd` header with its data file.
pub fn read(path: &Path) -> Result<LoadedFile, ReadError> {
    read_with(path, &OpenOptions::default())
}

/// As [`read`], with the spacing and origin of a file that has none.
pub(super) fn read_with(path: &Path, options: &OpenOptions) -> Result<LoadedFile, ReadError> {
    let fault = |f: Fault| f.in_file(path, FORMAT);
    let bytes = read_bytes(path)?;
    let (header, _) = Header::parse(&bytes).map_err(fault)?;
    let has_place = ["ElementSpacing", "ElementSize", "Offset", "Position", "Origin"]
        .iter()
        .any(|k| header.get(k).is_some());
    if has_place {
        options.refuse_lattice().map_err(fault)?;
    }
    let mut file = read_from_bytes(path, &bytes)?;
    options.place(&mut file).map_err(fault)?;
    Ok(file)
}

/// Reads the content of a file; the data file is resolved relative to `path`.
pub fn read_from_bytes(path: &Path, bytes: &[u8]) -> Result<LoadedFile, ReadError> {
    let fault = |f: Fault| f.in_file(path, FORMAT);
    let mut warnings = Vec::new();
    let (header, body) = Header::parse(bytes).map_err(fault)?;
    let volume = header.volume(path).map_err(fault)?;
    let (packing, name) = (header.packing(), header.need("ElementDataFile").map_err(fault)?);
    if let Some(names) = value_files::names(name, body).map_err(fault)? {
        let size = volume.clone().part(names.len());
        return value_files::read(path, &names, volume, packing, FORMAT, |d| header.skip(d, &size));
    }
    let read = |data: &[u8], warnings: &mut Vec<String>| {
        header.skip(data, &volume).and_then(|d| volume.clone().read(d, packing, warnings))
    };
    let data = if name.eq_ignore_ascii_case("LOCAL") {
        read(body, &mut warnings).map_err(fault)?
    } else {
        let file = sibling_path(path, name);
        read(&read_bytes(&file)?, &mut warnings).map_err(|f| f.in_file(&file, FORMAT))?
    };
    Ok(LoadedFile {
        format: FORMAT,
        content: Content::Data(data),
        warnings,
        time_steps: Vec::new(),
    })
}

/// Where the values are; `None` where they are in several files.
pub(super) fn place_of_values(path: &Path) -> Result<Option<ValuesPlace>, ReadError> {
    let fault = |f: Fault| f.in_file(path, FORMAT);
    let start = start_of_file(path)?;
    let (header, body) = Header::parse(&start).map_err(fault)?;
    let volume = header.volume(path).map_err(fault)?;
    let (packing, name) = (header.packing(), header.need("ElementDataFile").map_err(fault)?);
    if value_files::names(name, body).map_err(fault)?.is_some() {
        return Ok(None);
    }
    let (file, before) = if name.eq_ignore_ascii_case("LOCAL") {
        (path.to_path_buf(), (start.len() - body.len()) as u64)
    } else {
        (sibling_path(path, name), 0)
    };
    let skip = match header.bytes_to_skip().map_err(fault)? {
        -1 if packing == Packing::Raw => None,
        bytes => Some(before.saturating_add(bytes.max(0) as u64)),
    };
    Ok(Some(ValuesPlace { volume, packing, file, skip, format: FORMAT }))
}

struct Header {
    fields: BTreeMap<String, String>,
}

impl Header {
    /// Parses the fields; the data of a local file starts after the line ElementDataFile.
    fn parse(bytes: &[u8]) -> Result<(Header, &[u8]), Fault> {
        let mut cursor = Cursor::new(bytes);
        let mut fields = BTreeMap::new();
        let mut number = 0;
        while let Some(line) = cursor.line() {
            number += 1;
            if line.trim().is_empty() {
                continue;
            }
            let Some((name, value)) = line.split_once('=') else {
                let shown: String = line.chars().take(40).collect();
                return Err(Fault::new(
                    At::Line(number),
                    format!("`{shown}` is not `Field = value`"),
                    BROKEN,
                ));
            };
            let name = name.trim().to_ascii_lowercase();
            let last = name == "elementdatafile";
            fields.insert(name, value.trim().to_string());
            if last {
                break;
            }
        }
        Ok((Header { fields }, &bytes[cursor.pos..]))
    }

    fn get(&self, name: &str) -> Option<&str> {
        self.fields.get(&name.to_ascii_lowercase()).map(String::as_str)
    }
    fn need(&self, name: &str) -> Result<&str, Fault> {
        self.get(name).ok_or_else(|| Fault::field(format!("field `{name}`"), "it is missing"))
    }
    fn flag(&self, name: &str) -> bool {
        self.get(name).is_some_and(|v| v.eq_ignore_ascii_case("true"))
    }
    fn numbers<T: std::str::FromStr>(&self, name: &str) -> Result<Option<Vec<T>>, Fault> {
        let Some(text) = self.get(name) else { return Ok(None) };
        let list: Result<Vec<T>, _> = text.split_ascii_whitespace().map(str::parse).collect();
        let shown: String = text.chars().take(60).collect();
        list.map(Some).map_err(|_| {
            Fault::field(format!("field `{name}`"), format!("`{shown}` are not numbers"))
        })
    }

    fn packing(&self) -> Packing {
        let is_text = self.get("BinaryData").is_some() && !self.flag("BinaryData");
        match self.flag("CompressedData") {
            _ if is_text => Packing::Text,
            true => Packing::Deflate,
            false => Packing::Raw,
        }
    }

    fn bytes_to_skip(&self) -> Result<i64, Fault> {
        Ok(self.numbers::<i64>("HeaderSize")?.and_then(|v| v.first().copied()).unwrap_or(0))
    }

    /// Skips HeaderSize bytes; -1 means that the values are at the end of the file.
    fn skip<'a>(&self, data: &'a [u8], volume: &Volume) -> Result<&'a [u8], Fault> {
        let skip = self.bytes_to_skip()?;
        if skip == -1 {
            let size = volume.count()?.saturating_mul(volume.kind.size() as u64);
            let size = super::error::fits(size, 1, data.len(), At::Byte(0), "bytes of values")?;
            return Ok(&data[data.len() - size..]);
        }
        let mut cursor = Cursor::new(data);
        cursor.take(skip.max(0) as u64, 1, "bytes to skip")?;
        Ok(&data[cursor.pos..])
    }

    fn volume(&self, path: &Path) -> Result<Volume, Fault> {
        let sizes: Vec<u64> = self
            .numbers("DimSize")?
            .ok_or_else(|| Fault::field("field `DimSize`", "it is missing"))?;
        if !(1..=3).contains(&sizes.len()) {
            return Err(Fault::field(
                "field `DimSize`",
                format!("{} sizes; 1 to 3 are read", sizes.len()),
            ));
        }
        let axes = sizes.len();
        let mut dims = [1u64; 3];
        dims[..axes].copy_from_slice(&sizes);
        let three = |names: &[&str], default: DVec3| -> Result<DVec3, Fault> {
            for name in names {
                if let Some(v) = self.numbers::<f64>(name)? {
                    let mut out = default;
                    v.iter().take(3).enumerate().for_each(|(a, &x)| out[a] = x);
                    return Ok(out);
                }
            }
            Ok(default)
        };
        let mut direction = DMat3::IDENTITY;
        for name in ["TransformMatrix", "Rotation", "Orientation"] {
            if let Some(v) = self.numbers::<f64>(name)? {
                // Each run of numbers is the direction of one axis of the volume.
                for (i, x) in v.iter().enumerate().take(axes * axes) {
                    direction.col_mut(i / axes)[i % axes] = *x;
                }
                break;
            }
        }
        let big = ["BinaryDataByteOrderMSB", "ElementByteOrderMSB"].iter().any(|n| self.flag(n));
        let components = self
            .numbers::<u64>("ElementNumberOfChannels")?
            .and_then(|v| v.first().copied())
            .unwrap_or(1);
        let kind = element_type(self.need("ElementType")?)?;
        let name = path
            .file_stem()
            .map(|s| s.to_string_lossy().into_owned())
            .unwrap_or_else(|| "values".into());
        Ok(Volume {
            name,
            dims,
            components: components.max(1),
            kind,
            endian: if big { Endian::Big } else { Endian::Little },
            origin: three(&["Offset", "Position", "Origin"], DVec3::ZERO)?,
            spacing: three(&["ElementSpacing", "ElementSize"], DVec3::ONE)?,
            direction,
        })
    }
}

/// The scalar type with the given name.
fn element_type(name: &str) -> Result<ScalarType, Fault> {
    Ok(match name.trim_end_matches("_ARRAY") {
        "MET_CHAR" => ScalarType::I8,
        "MET_UCHAR" => ScalarType::U8,
        "MET_SHORT" => ScalarType::I16,
        "MET_USHORT" => ScalarType::U16,
        "MET_INT" | "MET_LONG" => ScalarType::I32,
        "MET_UINT" | "MET_ULONG" => ScalarType::U32,
        "MET_LONG_LONG" => ScalarType::I64,
        "MET_ULONG_LONG" => ScalarType::U64,
        "MET_FLOAT" => ScalarType::F32,
        "MET_DOUBLE" => ScalarType::F64,
        other => {
            let shown: String = other.chars().take(40).collect();
            let cure = "write it with one of MET_UCHAR, MET_SHORT, MET_INT, MET_FLOAT, MET_DOUBLE";
            return Err(Fault::unsupported(
                At::Field("field `ElementType`".into()),
                format!("`{shown}`"),
                cure,
            ));
        }
    })
}
