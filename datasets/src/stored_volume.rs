//! Files of stored volumes ([`rt_core::stored_volume::StoredVolume`]), which may be larger than
//! memory.
//!
//! ```
//! use datasets::read::volume_planes::VolumePlanes;
//! use datasets::stored_volume;
//!
//! # let folder = tempfile::tempdir()?;
//! # let folder = folder.path();
//! let raw = folder.join("ramp_4x3x2_uint8.raw");
//! std::fs::write(&raw, (0..24).collect::<Vec<u8>>())?;
//!
//! let path = folder.join("ramp.rtvolume");
//! let planes = VolumePlanes::open(&raw)?.expect("a file that can be read by planes");
//! let mut writer = stored_volume::create(&path, planes.layout())?;
//! for plane in planes {
//!     writer.add_plane(&plane?)?;
//! }
//! assert_eq!(stored_volume::finish(writer)?.points, 24);
//!
//! let budget = 64 << 20;
//! let volume = stored_volume::open(&path, budget)?;
//! assert_eq!(volume.range(), Some((0.0, 23.0)));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::paged_file::{OpenFile, PagedFile};
use rt_core::paging::PageSink as _;
use rt_core::stored_volume::{
    StoredVolume, StoredVolumeError, StoredVolumeReport, StoredVolumeWriter, VolumeLayout,
};
use std::io;
use std::path::Path;

/// Opens a file. Parts of it that are in memory take at most `budget` bytes: see
/// [`StoredVolume::open`].
///
/// # Errors
/// When the file cannot be read, is no stored volume, has another version, was cut, or is damaged.
pub fn open(path: &Path, budget: usize) -> Result<StoredVolume, StoredVolumeError> {
    let file = OpenFile::open(path).map_err(|e| error(path, "cannot open it", &e))?;
    StoredVolume::open(file, budget)
}

/// Starts a file. It has another name, which ends in `.partial`, until [`finish`], and is removed
/// when that never comes.
///
/// # Errors
/// When the file cannot be created, or no volume can have the layout.
pub fn create(
    path: &Path,
    layout: VolumeLayout,
) -> Result<StoredVolumeWriter<PagedFile>, StoredVolumeError> {
    let file = PagedFile::create(path).map_err(|e| error(path, "cannot create it", &e))?;
    StoredVolumeWriter::new(file, layout)
}

/// Completes a file and gives it its name.
///
/// # Errors
/// When planes are missing, or the file cannot be written or renamed.
pub fn finish(
    writer: StoredVolumeWriter<PagedFile>,
) -> Result<StoredVolumeReport, StoredVolumeError> {
    let (mut sink, report) = writer.finish()?;
    let completed = sink.complete();
    completed.map_err(|reason| StoredVolumeError::Io { name: sink.name(), reason })?;
    Ok(report)
}

fn error(path: &Path, action: &str, source: &io::Error) -> StoredVolumeError {
    let name = path.display().to_string();
    StoredVolumeError::Io { name, reason: format!("{action}: {source}") }
}
