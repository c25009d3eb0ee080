//! NRRD volumes ("nearly raw raster data"), header and data in one file or two; raw, gzip and text
//! encodings.
//!
//! Source: the definition of the format at teem.sourceforge.net/nrrd/format.html.

use super::error::{At, BROKEN, Cursor, Fault, read_bytes, sibling_path};
use super::value_files;
use super::volume::{Packing, ValuesPlace, Volume, start_of_file};
use super::{Content, LoadedFile, OpenOptions, ReadError};
use crate::model::{Endian, ScalarType};
use glam::{DMat3, DVec3};
use std::collections::BTreeMap;
use std::path::Path;

pub(crate) const FORMAT: &str = "NRRD";

/// Reads a `.nrrd` file, or a `.nhdr` header with the data file that it names.
pub fn read(path: &Path) -> Result<LoadedFile, ReadError> {
    read_with(path, &OpenOptions::default())
}

/// As [`read`], with the spacing and origin of a file that has none.
pub(super) fn read_with(path: &Path, options: &OpenOptions) -> Result<LoadedFile, ReadError> {
    let fault = |f: Fault| f.in_file(path, FORMAT);
    let bytes = read_bytes(path)?;
    let (header, _) = Header::parse(&bytes).map_err(fault)?;
    let has_place =
        ["spacings", "space directions", "space origin"].iter().any(|k| header.get(&[k]).is_some());
    if has_place {
        options.refuse_lattice().map_err(fault)?;
    }
    let mut file = read_from_bytes(path, &bytes)?;
    options.place(&mut file).map_err(fault)?;
    Ok(file)
}

/// Reads the content of a file; a detached data file is resolved relative to `path`.
pub fn read_from_bytes(path: &Path, bytes: &[u8]) -> Result<LoadedFile, ReadError> {
    let fault = |f: Fault| f.in_file(path, FORMAT);
    let mut warnings = Vec::new();
    let (header, body) = Header::parse(bytes).map_err(fault)?;
    let volume = header.volume(path, &mut warnings).map_err(fault)?;
    let packing = header.packing().map_err(fault)?;
    let data_file = header.get(&["data file", "datafile"]);
    let names = value_files::names(data_file.unwrap_or_default(), body).map_err(fault)?;
    if let Some(names) = names {
        let size = volume.clone().part(names.len());
        let mut file = value_files::read(path, &names, volume, packing, FORMAT, |data| {
            header.skip(data, &size, packing)
        })?;
        file.warnings.splice(0..0, warnings);
        return Ok(file);
    }
    let data = match data_file {
        None => header
            .skip(body, &volume, packing)
            .and_then(|d| volume.clone().read(d, packing, &mut warnings))
            .map_err(fault)?,
        Some(name) => {
            let file = sibling_path(path, name);
            let bytes = read_bytes(&file)?;
            let read = header
                .skip(&bytes, &volume, packing)
                .and_then(|d| volume.clone().read(d, packing, &mut warnings));
            read.map_err(|f| f.in_file(&file, FORMAT))?
        }
    };
    Ok(LoadedFile {
        format: FORMAT,
        content: Content::Data(data),
        warnings,
        time_steps: Vec::new(),
    })
}

/// Where the values are; `None` where lines must be skipped to find them, or they are in several
/// files.
pub(super) fn place_of_values(path: &Path) -> Result<Option<ValuesPlace>, ReadError> {
    let fault = |f: Fault| f.in_file(path, FORMAT);
    let start = start_of_file(path)?;
    let (header, body) = Header::parse(&start).map_err(fault)?;
    let volume = header.volume(path, &mut Vec::new()).map_err(fault)?;
    let packing = header.packing().map_err(fault)?;
    let data_file = header.get(&["data file", "datafile"]);
    if value_files::names(data_file.unwrap_or_default(), body).map_err(fault)?.is_some() {
        return Ok(None);
    }
    let (file, before) = match data_file {
        None => (path.to_path_buf(), (start.len() - body.len()) as u64),
        Some(name) => (sibling_path(path, name), 0),
    };
    if header.number(&["line skip", "lineskip"]).map_err(fault)? > 0 {
        return Ok(None);
    }
    let skip = match header.number(&["byte skip", "byteskip"]).map_err(fault)? {
        -1 if packing == Packing::Raw => None,
        bytes => Some(before.saturating_add(bytes.max(0) as u64)),
    };
    Ok(Some(ValuesPlace { volume, packing, file, skip, format: FORMAT }))
}

struct Header {
    fields: BTreeMap<String, String>,
}

impl Header {
    /// Parses the fields, and returns what follows the empty line that ends them.
    fn parse(bytes: &[u8]) -> Result<(Header, &[u8]), Fault> {
        let mut cursor = Cursor::new(bytes);
        let magic = cursor.line().unwrap_or_default();
        if !magic.starts_with("NRRD000") {
            return Err(Fault::new(
                At::Line(1),
                "the first line is not NRRD000x",
                "this is another kind of file",
            ));
        }
        let mut fields = BTreeMap::new();
        let mut number = 1;
        while let Some(line) = cursor.line() {
            number += 1;
            if line.trim().is_empty() {
                break;
            }
            if line.starts_with('#') || line.contains(":=") {
                continue; // comments and key/value pairs that mean nothing to the format
            }
            let Some((name, value)) = line.split_once(':') else {
                let shown: String = line.chars().take(40).collect();
                return Err(Fault::new(
                    At::Line(number),
                    format!("`{shown}` is not `field: value`"),
                    BROKEN,
                ));
            };
            let (name, value) = (name.trim().to_ascii_lowercase(), value.trim().to_string());
            // The names of the files follow, instead of an empty line.
            let last = value.starts_with("LIST") && matches!(&*name, "data file" | "datafile");
            fields.insert(name, value);
            if last {
                break;
            }
        }
        Ok((Header { fields }, &bytes[cursor.pos..]))
    }

    fn get(&self, names: &[&str]) -> Option<&str> {
        names.iter().find_map(|n| self.fields.get(*n)).map(String::as_str)
    }

    fn need(&self, name: &str) -> Result<&str, Fault> {
        self.get(&[name]).ok_or_else(|| Fault::field(format!("field `{name}`"), "it is missing"))
    }

    /// A whole number; 0 where the field is missing.
    fn number(&self, names: &[&str]) -> Result<i64, Fault> {
        let Some(text) = self.get(names) else { return Ok(0) };
        text.parse().map_err(|_| {
            Fault::field(format!("field `{}`", names[0]), format!("`{text}` is not a number"))
        })
    }

    fn packing(&self) -> Result<Packing, Fault> {
        match self.need("encoding")?.to_ascii_lowercase().as_str() {
            "raw" => Ok(Packing::Raw),
            "gzip" | "gz" => Ok(Packing::Deflate),
            "ascii" | "text" | "txt" => Ok(Packing::Text),
            other => {
                let cure =
                    "write it again as raw or gzip, for example with `unu save -f nrrd -e gzip`";
                Err(Fault::unsupported(
                    At::Field("field `encoding`".into()),
                    format!("`{other}`"),
                    cure,
                ))
            }
        }
    }

    /// Skips lines, then bytes, as the header says. -1 bytes means that the values are at the end
    /// of the file.
    fn skip<'a>(
        &self,
        data: &'a [u8],
        volume: &Volume,
        packing: Packing,
    ) -> Result<&'a [u8], Fault> {
        let mut cursor = Cursor::new(data);
        for _ in 0..self.number(&["line skip", "lineskip"])?.max(0) {
            if cursor.line().is_none() {
                break;
            }
        }
        let bytes = self.number(&["byte skip", "byteskip"])?;
        if bytes == -1 && packing == Packing::Raw {
            let size = volume.count()?.saturating_mul(volume.kind.size() as u64);
            let size = super::error::fits(size, 1, data.len(), At::Byte(0), "bytes of values")?;
            return Ok(&data[data.len() - size..]);
        }
        cursor.take(bytes.max(0) as u64, 1, "bytes to skip")?;
        Ok(&data[cursor.pos..])
    }

    fn volume(&self, path: &Path, warnings: &mut Vec<String>) -> Result<Volume, Fault> {
        let words = |name: &str| self.get(&[name]).unwrap_or("").split_ascii_whitespace();
        let dimension: usize = self
            .need("dimension")?
            .parse()
            .map_err(|_| Fault::field("field `dimension`", "it is not a number"))?;
        let sizes: Result<Vec<u64>, _> =
            self.need("sizes")?.split_ascii_whitespace().map(str::parse).collect();
        let sizes = sizes.map_err(|_| {
            Fault::field("field `sizes`", "it holds something that is not a number")
        })?;
        if sizes.len() != dimension || !(1..=4).contains(&dimension) {
            let what = format!("{} sizes for {dimension} dimensions; 1 to 4 are read", sizes.len());
            return Err(Fault::field("field `sizes`", what));
        }
        // With four axes, or if the kind of the first says so, the first axis holds the components.
        const COMPONENT_KINDS: [&str; 16] = [
            "vector",
            "covariant-vector",
            "normal",
            "list",
            "point",
            "stub",
            "scalar",
            "complex",
            "2-vector",
            "3-vector",
            "4-vector",
            "3-color",
            "rgb-color",
            "rgba-color",
            "3d-symmetric-matrix",
            "3-gradient",
        ];
        let kinds: Vec<String> = words("kinds").map(str::to_ascii_lowercase).collect();
        let has_components =
            dimension == 4 || kinds.first().is_some_and(|k| COMPONENT_KINDS.contains(&k.as_str()));
        let first = usize::from(has_components);
        let mut dims = [1u64; 3];
        sizes[first..].iter().take(3).enumerate().for_each(|(a, &n)| dims[a] = n);

        let kind = scalar_type(self.need("type")?)?;
        let endian = match self.get(&["endian"]).map(str::to_ascii_lowercase).as_deref() {
            Some("little") => Endian::Little,
            Some("big") => Endian::Big,
            _ if kind.size() == 1 || self.packing()? == Packing::Text => Endian::Little,
            Some(other) => {
                return Err(Fault::field(
                    "field `endian`",
                    format!("`{other}` is neither little nor big"),
                ));
            }
            None => {
                return Err(Fault::field(
                    "field `endian`",
                    "it is missing, and the values have several bytes",
                ));
            }
        };

        let mut spacing = DVec3::ONE;
        let mut direction = DMat3::IDENTITY;
        if let Some(text) = self.get(&["space directions"]) {
            let axes = vectors(text).map_err(|w| Fault::field("field `space directions`", w))?;
            for (column, v) in axes.into_iter().skip(first).flatten().take(3).enumerate() {
                if v.length() > 0.0 {
                    spacing[column] = v.length();
                    *direction.col_mut(column) = v / v.length();
                }
            }
        } else if self.get(&["spacings"]).is_some() {
            for (a, w) in words("spacings").skip(first).take(3).enumerate() {
                match w.parse::<f64>() {
                    Ok(s) if s.is_finite() && s != 0.0 => spacing[a] = s,
                    Ok(_) => warnings.push(format!("spacing `{w}` along axis {a} taken as 1")),
                    Err(_) => {
                        return Err(Fault::field(
                            "field `spacings`",
                            format!("`{w}` is not a number"),
                        ));
                    }
                }
            }
        }
        let origin = match self.get(&["space origin"]) {
            Some(text) => vectors(text)
                .map_err(|w| Fault::field("field `space origin`", w))?
                .into_iter()
                .flatten()
                .next()
                .unwrap_or(DVec3::ZERO),
            None => DVec3::ZERO,
        };
        let stem = || {
            path.file_stem()
                .map(|s| s.to_string_lossy().into_owned())
                .unwrap_or_else(|| "values".into())
        };
        let name = self.get(&["content"]).map_or_else(stem, str::to_string);
        let components = if has_components { sizes[0] } else { 1 };
        Ok(Volume { name, dims, components, kind, endian, origin, spacing, direction })
    }
}

/// Parses `(x,y,z)` vectors and `none`; two-dimensional vectors get z = 0.
fn vectors(text: &str) -> Result<Vec<Option<DVec3>>, String> {
    let mut out = Vec::new();
    let mut rest = text.trim();
    while !rest.is_empty() {
        if let Some(r) = rest.strip_prefix("none") {
            out.push(None);
            rest = r.trim_start();
            continue;
        }
        let inner = rest.strip_prefix('(').and_then(|r| r.split_once(')'));
        let Some((inner, after)) = inner else {
            return Err(format!("`{rest}` is not a vector in parentheses"));
        };
        let mut v = DVec3::ZERO;
        for (a, w) in inner.split(',').enumerate().take(3) {
            v[a] = w.trim().parse().map_err(|_| format!("`{w}` is not a number"))?;
        }
        out.push(Some(v));
        rest = after.trim_start();
    }
    Ok(out)
}

fn scalar_type(name: &str) -> Result<ScalarType, Fault> {
    Ok(match name.to_ascii_lowercase().as_str() {
        "signed char" | "int8" | "int8_t" => ScalarType::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => ScalarType::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => {
            ScalarType::I16
        }
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => {
            ScalarType::U16
        }
        "int" | "signed int" | "int32" | "int32_t" => ScalarType::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => ScalarType::U32,
        "longlong" | "long long" | "long long int" | "signed long long" | "int64" | "int64_t" => {
            ScalarType::I64
        }
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => {
            ScalarType::U64
        }
        "float" => ScalarType::F32,
        "double" => ScalarType::F64,
        other => {
            let cure = "convert it with `unu convert -t float`";
            return Err(Fault::unsupported(
                At::Field("field `type`".into()),
                format!("`{other}`"),
                cure,
            ));
        }
    })
}
