//! Volumes plane by plane, for those that are larger than memory: NRRD, MetaImage and raw files.

use super::error::{At, Fault, TRUNCATED, io_error};
use super::volume::{Packing, ValuesPlace, Volume, check_inflation};
use super::{ReadError, mhd, nrrd, raw};
use crate::model::{Endian, ScalarType, Values};
use glam::{DMat3, DVec3, UVec3};
use rt_core::stored_volume::{ValueType, VolumeLayout};
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// The planes of a volume, those of low z first. Each has the values of its points, x fastest,
/// little-endian, as [`rt_core::stored_volume::StoredVolumeWriter`] takes them: integers of 8 and
/// 16 bits as they are, all others in single precision.
pub struct VolumePlanes {
    place: ValuesPlace,
    layout: VolumeLayout,
    source: Box<dyn Read + Send>,
    /// Planes read.
    read: u64,
    warnings: Vec<String>,
}

impl VolumePlanes {
    /// Opens a file. `None` for other formats, and for what must be read as a whole: values as
    /// text, several at a point, or axes that are rotated or go backwards.
    ///
    /// # Errors
    /// When the file cannot be read, its header is wrong, or it is too short.
    pub fn open(path: &Path) -> Result<Option<VolumePlanes>, ReadError> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        let place = match extension.as_deref() {
            Some("nrrd" | "nhdr") => nrrd::place_of_values(path)?,
            Some("mhd" | "mha") => mhd::place_of_values(path)?,
            Some("raw" | "toml") => Some(raw::place_of_values(path)?),
            _ => None,
        };
        match place {
            Some(place) if is_plain(&place) => Ok(Some(VolumePlanes::of(place)?)),
            _ => Ok(None),
        }
    }

    fn of(place: ValuesPlace) -> Result<VolumePlanes, ReadError> {
        let path = place.file.as_path();
        let (io, fault) = (|e| io_error(path, e), |f: Fault| f.in_file(path, place.format));
        let bytes = place.volume.count().map_err(fault)?;
        let bytes = bytes.saturating_mul(place.volume.kind.size() as u64);
        let mut file = File::open(path).map_err(io)?;
        let length = file.metadata().map_err(io)?.len();
        let mut warnings = Vec::new();
        let skip = place.skip.unwrap_or_else(|| length.saturating_sub(bytes));
        if place.packing == Packing::Raw {
            let there = length.saturating_sub(skip);
            if there < bytes {
                let what = format!("{there} bytes of values, {bytes} are declared");
                return Err(fault(Fault::new(At::Byte(skip), what, TRUNCATED)));
            }
            if there > bytes {
                warnings.push(format!(
                    "{} bytes after the last value ignored: check the dimensions and the type",
                    there - bytes
                ));
            }
        }
        if place.packing == Packing::Deflate {
            check_inflation(bytes, length.saturating_sub(skip)).map_err(fault)?;
        }
        file.seek(SeekFrom::Start(skip)).map_err(io)?;
        let mut file = BufReader::with_capacity(1 << 20, file);
        let source: Box<dyn Read + Send> = match place.packing {
            Packing::Deflate if file.fill_buf().map_err(io)?.starts_with(&[0x1f, 0x8b]) => {
                Box::new(flate2::bufread::MultiGzDecoder::new(file))
            }
            Packing::Deflate => Box::new(flate2::bufread::ZlibDecoder::new(file)),
            Packing::Raw | Packing::Text => Box::new(file),
        };
        let Volume { dims, origin, spacing, kind, .. } = place.volume;
        let values = match kind {
            ScalarType::U8 => ValueType::U8,
            ScalarType::I8 => ValueType::I8,
            ScalarType::U16 => ValueType::U16,
            ScalarType::I16 => ValueType::I16,
            _ => ValueType::F32,
        };
        // `count` limits each axis.
        let dims = UVec3::from_array(dims.map(|n| n as u32));
        let layout = VolumeLayout { dims, origin, spacing, values };
        Ok(VolumePlanes { place, layout, source, read: 0, warnings })
    }

    /// The lattice, and how the values of planes are stored.
    pub fn layout(&self) -> VolumeLayout {
        self.layout
    }

    /// Name of the array.
    pub fn name(&self) -> &str {
        &self.place.volume.name
    }

    /// Accepts the name of an array if it is that of the file.
    ///
    /// # Errors
    /// For another name.
    pub fn must_be_named(&self, array: Option<&str>) -> Result<(), ReadError> {
        match array {
            Some(array) if array != self.name() => {
                let what = format!("there is no array `{array}`");
                let cure = format!("the file has `{}` alone", self.name());
                let fault = Fault::option(At::Field("the array".into()), what, cure);
                Err(fault.in_file(&self.place.file, self.place.format))
            }
            _ => Ok(()),
        }
    }

    /// What was found odd in the file.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The values of the next plane as numbers, x fastest; `None` after the last.
    ///
    /// # Errors
    /// When the file cannot be read. After an error there is nothing more.
    pub fn next_numbers(&mut self) -> Option<Result<Vec<f32>, ReadError>> {
        self.next_values(|kind, bytes, endian| Values::from_bytes(kind, &bytes, endian).to_f32())
    }

    /// What `decode` makes of the bytes of the next plane.
    fn next_values<T>(
        &mut self,
        decode: impl FnOnce(ScalarType, Vec<u8>, Endian) -> T,
    ) -> Option<Result<T, ReadError>> {
        if self.read >= u64::from(self.layout.dims.z) {
            return None;
        }
        let Volume { kind, endian, .. } = self.place.volume;
        let points = self.layout.dims.x as usize * self.layout.dims.y as usize;
        let mut bytes = vec![0; points * kind.size()];
        if let Err(e) = self.source.read_exact(&mut bytes) {
            // Also what a decoder says of damaged data.
            let (at, planes) = (self.read, self.layout.dims.z);
            let at = At::Field(format!("plane {at} of {planes} (counted from 0)"));
            let fault = Fault::new(at, e.to_string(), TRUNCATED);
            self.read = u64::MAX;
            return Some(Err(fault.in_file(&self.place.file, self.place.format)));
        }
        self.read += 1;
        Some(Ok(decode(kind, bytes, endian)))
    }
}

/// Whether the values can be taken as they come.
fn is_plain(place: &ValuesPlace) -> bool {
    let volume = &place.volume;
    place.packing != Packing::Text
        && volume.components == 1
        && volume.direction == DMat3::IDENTITY
        && volume.spacing.cmpgt(DVec3::ZERO).all()
}

impl Iterator for VolumePlanes {
    type Item = Result<Vec<u8>, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.next_values(|kind, bytes, endian| match kind {
            ScalarType::U8 | ScalarType::I8 => bytes,
            ScalarType::U16 | ScalarType::I16 => {
                Values::from_bytes(kind, &bytes, endian).to_le_bytes()
            }
            _ => {
                let values = Values::from_bytes(kind, &bytes, endian).to_f32();
                values.iter().flat_map(|x| x.to_le_bytes()).collect()
            }
        })
    }
}
