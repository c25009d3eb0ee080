//! The arrays of an `.npz` file: a ZIP archive with an `.npy` file for each.

use super::array::StoredArray;
use crate::read::ReadError;
use crate::read::error::{At, BROKEN, Fault, FaultKind, io_error};
use std::path::Path;
use zip::result::ZipError;

pub(super) const FORMAT: &str = "NumPy archive";

/// Deflate gains at most 1:1032 (zlib's technical notes).
const MAX_RATIO: u64 = 1040;

/// All arrays of numbers, in the order of the archive. Others are named in `warnings`.
pub(super) fn arrays(
    path: &Path,
    warnings: &mut Vec<String>,
) -> Result<Vec<StoredArray>, ReadError> {
    let file = std::fs::File::open(path).map_err(|e| io_error(path, e))?;
    let length = file.metadata().map_err(|e| io_error(path, e))?.len();
    let broken = |e: ZipError, member: &str| {
        let at = At::Field(member.to_string());
        match e {
            ZipError::UnsupportedArchive(what) => {
                Fault::unsupported(at, what, "save it with numpy.savez or numpy.savez_compressed")
            }
            e => Fault::new(at, e.to_string(), BROKEN),
        }
        .in_file(path, FORMAT)
    };
    let mut archive = zip::ZipArchive::new(std::io::BufReader::new(file))
        .map_err(|e| broken(e, "the list of files in the archive"))?;
    let mut arrays: Vec<StoredArray> = Vec::new();
    for i in 0..archive.len() {
        let mut member = archive.by_index(i).map_err(|e| broken(e, &format!("file {i}")))?;
        let full_name = match member.name() {
            Ok(name) => name.into_owned(),
            Err(e) => return Err(broken(e, &format!("the name of file {i}"))),
        };
        let Some(name) = full_name.strip_suffix(".npy") else {
            warnings.push(format!("`{full_name}` left out: it is no .npy file"));
            continue;
        };
        if arrays.iter().any(|a| a.name == name) {
            let what = "the archive has it twice";
            let fault = Fault::new(At::Field(format!("array `{name}`")), what, BROKEN);
            return Err(fault.in_file(path, FORMAT));
        }
        // The sizes that the archive declares are believed as far as its length allows.
        let packed = member.compressed_size().min(length);
        let available = member.size().min(packed.saturating_mul(MAX_RATIO));
        match StoredArray::read(name.to_string(), &mut member, available) {
            Ok(array) => arrays.push(array),
            Err(f) if f.kind == FaultKind::Unsupported => {
                warnings.push(format!("array `{name}` left out: {} ({})", f.what, f.at));
            }
            Err(f) => {
                let at = At::Field(format!("array `{name}`"));
                let what = format!("{}: {}", f.at, f.what);
                return Err(Fault::new(at, what, f.cure).in_file(path, FORMAT));
            }
        }
    }
    Ok(arrays)
}
