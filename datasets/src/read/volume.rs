//! Code shared by the simple volume formats (NRRD, MetaImage, raw).

use super::ReadError;
use super::error::{At, BROKEN, Cursor, Fault, TRUNCATED, io_error};
use crate::model::{DataArray, Dataset, Endian, ImageData, ScalarType, Values};
use glam::{DMat3, DVec3};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Everything about a volume but its numbers.
#[derive(Debug, Clone)]
pub(crate) struct Volume {
    pub(crate) name: String,
    pub(crate) dims: [u64; 3],
    pub(crate) components: u64,
    pub(crate) kind: ScalarType,
    pub(crate) endian: Endian,
    pub(crate) origin: DVec3,
    pub(crate) spacing: DVec3,
    pub(crate) direction: DMat3,
}

/// How the numbers are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Packing {
    Raw,
    /// With a gzip or zlib wrapper.
    Deflate,
    Text,
}

/// Most bytes of a file that may be a header.
const HEADER_BYTES: u64 = 1 << 20;

/// Where the values of a volume are.
pub(super) struct ValuesPlace {
    pub(super) volume: Volume,
    pub(super) packing: Packing,
    /// The file with the values.
    pub(super) file: PathBuf,
    /// Bytes before them; `None` where they are at the end of the file.
    pub(super) skip: Option<u64>,
    pub(super) format: &'static str,
}

/// The first bytes of a file: its header, and perhaps values.
pub(super) fn start_of_file(path: &Path) -> Result<Vec<u8>, ReadError> {
    let mut start = Vec::new();
    let file = File::open(path).map_err(|e| io_error(path, e))?;
    file.take(HEADER_BYTES).read_to_end(&mut start).map_err(|e| io_error(path, e))?;
    Ok(start)
}

impl Volume {
    /// Number of values; a fault when it does not fit in 64 bits or an axis is too long for an
    /// extent.
    pub(crate) fn count(&self) -> Result<u64, Fault> {
        let n = self.dims.iter().try_fold(self.components.max(1), |n, &d| n.checked_mul(d));
        match n {
            Some(n) if self.dims.iter().all(|&d| (1..=i32::MAX as u64).contains(&d)) => Ok(n),
            _ => {
                let what = format!("{:?} points of {} components", self.dims, self.components);
                Err(Fault::new(
                    At::Field("the size of the volume".into()),
                    what,
                    "every axis needs from 1 to 2^31-1 points",
                ))
            }
        }
    }

    /// What one of so many files with equal parts of the values has.
    pub(super) fn part(self, files: usize) -> Volume {
        let count = self.count().unwrap_or(0) / (files as u64).max(1);
        Volume { dims: [count, 1, 1], components: 1, ..self }
    }

    /// The volume with the numbers in `data`.
    pub(crate) fn read(
        self,
        data: &[u8],
        packing: Packing,
        warnings: &mut Vec<String>,
    ) -> Result<Dataset, Fault> {
        let values = self.values(data, packing, self.count()?, warnings)?;
        self.with_values(values)
    }

    /// So many numbers from `data`.
    pub(super) fn values(
        &self,
        data: &[u8],
        packing: Packing,
        count: u64,
        warnings: &mut Vec<String>,
    ) -> Result<Values, Fault> {
        let size = self.kind.size();
        match packing {
            Packing::Text => Cursor::new(data).numbers(self.kind, count, "values"),
            Packing::Raw => {
                let mut cursor = Cursor::new(data);
                let bytes = cursor.take(count, size, "values")?;
                if cursor.remaining() > 0 {
                    warnings
                        .push(format!("{} bytes after the last value ignored", cursor.remaining()));
                }
                Ok(Values::from_bytes(self.kind, bytes, self.endian))
            }
            Packing::Deflate => {
                let bytes = inflate(data, count.saturating_mul(size as u64))?;
                Ok(Values::from_bytes(self.kind, &bytes, self.endian))
            }
        }
    }

    /// The volume with the numbers read from `source` piece by piece, so that the file is never in
    /// memory as a whole. `available` is how many bytes there are.
    pub(crate) fn read_stream(
        self,
        mut source: impl Read,
        available: u64,
    ) -> Result<Dataset, Fault> {
        let count = self.count()?;
        let size = self.kind.size();
        crate::read::error::fits(
            count,
            size,
            usize::try_from(available).unwrap_or(usize::MAX),
            At::Byte(0),
            "values",
        )?;
        let mut values = Values::empty(self.kind);
        let mut buffer = vec![0u8; (1 << 20).min(count as usize * size)];
        let mut left = count as usize * size;
        while left > 0 {
            let n = left.min(buffer.len());
            let read = source.read_exact(&mut buffer[..n]);
            read.map_err(|e| Fault::new(At::Field("the values".into()), e.to_string(), TRUNCATED))?;
            values.append(&Values::from_bytes(self.kind, &buffer[..n], self.endian));
            left -= n;
        }
        self.with_values(values)
    }

    pub(super) fn with_values(self, values: Values) -> Result<Dataset, Fault> {
        let dims = self.dims.map(|d| d as u32);
        let mut image = ImageData::new(dims, self.origin, self.spacing);
        image.direction = self.direction;
        image.attributes.point_scalars = Some(self.name.clone());
        image.attributes.point.push(DataArray::new(
            self.name,
            self.components.max(1) as usize,
            values,
        ));
        let data = Dataset::ImageData(image);
        data.check()?;
        Ok(data)
    }
}

/// A fault where `compressed` bytes of gzip or zlib data cannot give `want` bytes.
pub(super) fn check_inflation(want: u64, compressed: u64) -> Result<(), Fault> {
    // Deflate gains at most 1:1032 (zlib's technical notes).
    if want <= compressed.saturating_mul(1040) {
        return Ok(());
    }
    let what = format!("{want} bytes cannot come from {compressed} compressed ones");
    Err(Fault::new(At::Field("the compressed values".into()), what, BROKEN))
}

/// Unpacks gzip or zlib data that should give `want` bytes; more are not unpacked.
fn inflate(data: &[u8], want: u64) -> Result<Vec<u8>, Fault> {
    let at = || At::Field("the compressed values".into());
    check_inflation(want, data.len() as u64)?;
    let mut out = Vec::new();
    let result = if data.starts_with(&[0x1f, 0x8b]) {
        flate2::read::MultiGzDecoder::new(data).take(want).read_to_end(&mut out)
    } else {
        flate2::read::ZlibDecoder::new(data).take(want).read_to_end(&mut out)
    };
    match result {
        Ok(_) if out.len() as u64 == want => Ok(out),
        Ok(_) => Err(Fault::new(
            at(),
            format!("they unpack to {} bytes instead of {want}", out.len()),
            TRUNCATED,
        )),
        Err(e) => Err(Fault::new(at(), format!("they cannot be unpacked: {e}"), TRUNCATED)),
    }
}
