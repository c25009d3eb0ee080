//! Writes files atomically: a file appears complete or not at all.

use std::io::{self, Write};
use std::path::Path;

/// Writes a file under a temporary name in the directory of `path` and renames it. Neither a crash
/// nor a second process can then leave or read an incomplete file. `write` receives a buffered
/// writer.
pub(crate) fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let name = path
        .file_name()
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "not a file name"))?;
    // The process id distinguishes two processes that write the same file; the last one to finish
    // wins.
    let mut temporary_name = name.to_os_string();
    temporary_name.push(format!(".{}.partial", std::process::id()));
    let temporary = path.with_file_name(temporary_name);
    let result = (|| {
        let mut file = io::BufWriter::with_capacity(1 << 20, std::fs::File::create(&temporary)?);
        write(&mut file)?;
        file.into_inner().map_err(io::IntoInnerError::into_error)?;
        std::fs::rename(&temporary, path)
    })();
    if result.is_err() {
        // Report the first error; a failure to remove the leftover file does not change it.
        let _ = std::fs::remove_file(&temporary);
    }
    result
}
