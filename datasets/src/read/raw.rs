//! Raw volumes: numbers without a header, described by a TOML file in the same directory or by the
//! file name.
//!
//! `bonsai.raw` is described by `bonsai.toml` (or `bonsai.raw.toml`):
//! ```toml
//! file = "bonsai.raw"      # optional; the default has the same name
//! dims = [256, 256, 256]   # points per axis, x fastest
//! type = "u8"              # i8 u8 i16 u16 i32 u32 i64 u64 f32 f64
//! endian = "little"        # or "big"; the default is little
//! spacing = [1.0, 1.0, 1.0]
//! origin = [0.0, 0.0, 0.0]
//! components = 1
//! skip_bytes = 0
//! name = "density"
//! ```
//! Without a description, names like `bonsai_256x256x256_uint8.raw` (Open SciVis Datasets) are
//! parsed.

use super::error::{At, BROKEN, Fault, io_error, read_bytes};
use super::volume::{Packing, ValuesPlace, Volume};
use super::{Content, LoadedFile, OpenOptions, ReadError};
use crate::model::{Endian, ScalarType};
use glam::{DMat3, DVec3};
use serde::Deserialize;
use std::io::{Seek, SeekFrom};
use std::path::{Path, PathBuf};

pub(crate) const FORMAT: &str = "raw volume";

/// The description of a raw volume.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawDescription {
    /// The file with the numbers, relative to the description.
    pub file: Option<PathBuf>,
    /// Points per axis, x fastest.
    pub dims: [u64; 3],
    /// `u8`, `f32` and so on; `uint8`, `float32` and so on are accepted too.
    #[serde(rename = "type")]
    pub scalar_type: String,
    /// `little` or `big`.
    #[serde(default)]
    pub endian: ByteOrder,
    /// Distance between points.
    #[serde(default = "one")]
    pub spacing: [f64; 3],
    /// Position of the first point.
    #[serde(default)]
    pub origin: [f64; 3],
    /// Values per point.
    #[serde(default = "one_component")]
    pub components: u64,
    /// Bytes before the first value.
    #[serde(default)]
    pub skip_bytes: u64,
    /// Name of the array.
    pub name: Option<String>,
}

/// Byte order, as spelled in TOML.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ByteOrder {
    /// Least significant byte first.
    #[default]
    Little,
    /// Most significant byte first.
    Big,
}

fn one() -> [f64; 3] {
    [1.0; 3]
}
fn one_component() -> u64 {
    1
}

/// As [`read`], with a spacing and an origin that count more than the description's.
pub(super) fn read_with(path: &Path, options: &OpenOptions) -> Result<LoadedFile, ReadError> {
    let mut file = read(path)?;
    options.place(&mut file).map_err(|f| f.in_file(path, FORMAT))?;
    Ok(file)
}

/// Reads a raw volume; `path` is the file with the numbers or its description.
pub fn read(path: &Path) -> Result<LoadedFile, ReadError> {
    let (file, description) = described(path)?;
    read_values(&file, &description)
}

/// Where the values are; `path` is as for [`read`].
pub(super) fn place_of_values(path: &Path) -> Result<ValuesPlace, ReadError> {
    let (file, description) = described(path)?;
    let volume = description.volume(&file).map_err(|f| f.in_file(&file, FORMAT))?;
    let skip = Some(description.skip_bytes);
    Ok(ValuesPlace { volume, packing: Packing::Raw, file, skip, format: FORMAT })
}

/// The file with the numbers and its description.
fn described(path: &Path) -> Result<(PathBuf, RawDescription), ReadError> {
    let is_description = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    let description_path =
        if is_description { Some(path.to_path_buf()) } else { sibling_description(path) };
    let Some(description_path) = description_path else {
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let Some(description) = from_file_name(&name) else {
            let toml = path.with_extension("toml");
            let cure = format!(
                "write {} beside it with the lines `dims = [nx, ny, nz]` and `type = \"u8\"`",
                toml.display()
            );
            let fault = Fault::new(
                At::Field("the description".into()),
                "there is none, and the name does not tell the size",
                cure,
            );
            return Err(fault.in_file(path, FORMAT));
        };
        return Ok((path.to_path_buf(), description));
    };
    let text = String::from_utf8_lossy(&read_bytes(&description_path)?).into_owned();
    let description = parse_description(&text).map_err(|f| f.in_file(&description_path, FORMAT))?;
    let file = match &description.file {
        Some(f) => super::error::sibling_path(&description_path, &f.to_string_lossy()),
        None if is_description => path.with_extension("raw"),
        None => path.to_path_buf(),
    };
    Ok((file, description))
}

impl RawDescription {
    /// Everything but the numbers, which are in `file`.
    fn volume(&self, file: &Path) -> Result<Volume, Fault> {
        let Some(kind) = scalar_type(&self.scalar_type) else {
            let what = format!("`{}`", self.scalar_type);
            let cure = "use one of i8 u8 i16 u16 i32 u32 i64 u64 f32 f64";
            return Err(Fault::new(At::Field("`type` of the description".into()), what, cure));
        };
        let stem = || file.file_stem().map(|s| s.to_string_lossy().into_owned());
        Ok(Volume {
            name: self.name.clone().or_else(stem).unwrap_or_else(|| "values".into()),
            dims: self.dims,
            components: self.components,
            kind,
            endian: if self.endian == ByteOrder::Big { Endian::Big } else { Endian::Little },
            origin: DVec3::from_array(self.origin),
            spacing: DVec3::from_array(self.spacing),
            direction: DMat3::IDENTITY,
        })
    }
}

/// Parses a description in TOML.
pub(crate) fn parse_description(text: &str) -> Result<RawDescription, Fault> {
    toml::from_str(text).map_err(|e| {
        Fault::new(
            At::Line(line_of(text, e.span())),
            e.message().to_string(),
            "see the documentation of `read::raw` for the fields",
        )
    })
}

/// The line in which a span of bytes begins, from 1; 0 without a span.
pub(crate) fn line_of(text: &str, span: Option<std::ops::Range<usize>>) -> u64 {
    let before = |s: std::ops::Range<usize>| text.as_bytes().get(..s.start).unwrap_or_default();
    span.map_or(0, |s| before(s).iter().filter(|b| **b == b'\n').count() as u64 + 1)
}

fn sibling_description(path: &Path) -> Option<PathBuf> {
    let mut long = path.as_os_str().to_owned();
    long.push(".toml");
    [path.with_extension("toml"), PathBuf::from(long)].into_iter().find(|p| p.is_file())
}

/// Parses size and type from a name such as `head_512x512x106_uint16.raw`.
pub fn from_file_name(name: &str) -> Option<RawDescription> {
    let stem = name.rsplit_once('.').map_or(name, |(s, _)| s);
    let words: Vec<&str> = stem.split('_').collect();
    let dims = words.iter().find_map(|w| {
        let d: Option<Vec<u64>> = w.split('x').map(|n| n.parse().ok()).collect();
        d?.try_into().ok()
    })?;
    let ty = words.iter().rev().find(|w| scalar_type(w).is_some())?;
    Some(RawDescription {
        file: None,
        dims,
        scalar_type: ty.to_string(),
        endian: ByteOrder::Little,
        spacing: one(),
        origin: [0.0; 3],
        components: 1,
        skip_bytes: 0,
        name: words.first().map(|w| w.to_string()),
    })
}

fn read_values(path: &Path, d: &RawDescription) -> Result<LoadedFile, ReadError> {
    let fault = |f: Fault| f.in_file(path, FORMAT);
    let volume = d.volume(path).map_err(fault)?;
    let mut file = std::fs::File::open(path).map_err(|e| io_error(path, e))?;
    let length = file.metadata().map_err(|e| io_error(path, e))?.len();
    let Some(available) = length.checked_sub(d.skip_bytes) else {
        let what = format!("skip_bytes is {}, the file has {length} bytes", d.skip_bytes);
        return Err(fault(Fault::new(
            At::Field("`skip_bytes` of the description".into()),
            what,
            BROKEN,
        )));
    };
    file.seek(SeekFrom::Start(d.skip_bytes)).map_err(|e| io_error(path, e))?;
    let size = volume.kind.size() as u64;
    let want = volume.count().map_err(fault)?.saturating_mul(size);
    let mut warnings = Vec::new();
    if want < available {
        warnings.push(format!(
            "{} bytes after the last value ignored: check the dimensions and the type",
            available - want
        ));
    }
    let data = volume.read_stream(file, available).map_err(fault)?;
    Ok(LoadedFile {
        format: FORMAT,
        content: Content::Data(data),
        warnings,
        time_steps: Vec::new(),
    })
}

fn scalar_type(name: &str) -> Option<ScalarType> {
    Some(match name.to_ascii_lowercase().as_str() {
        "i8" | "int8" => ScalarType::I8,
        "u8" | "uint8" | "uchar" | "byte" => ScalarType::U8,
        "i16" | "int16" | "short" => ScalarType::I16,
        "u16" | "uint16" | "ushort" => ScalarType::U16,
        "i32" | "int32" | "int" => ScalarType::I32,
        "u32" | "uint32" | "uint" => ScalarType::U32,
        "i64" | "int64" => ScalarType::I64,
        "u64" | "uint64" => ScalarType::U64,
        "f32" | "float32" | "float" => ScalarType::F32,
        "f64" | "float64" | "double" => ScalarType::F64,
        _ => return None,
    })
}
