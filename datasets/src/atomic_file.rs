//! Writes files atomically: a file appears complete or not at all.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// A file under a temporary name in the directory of its path, until it is complete. Neither a
/// crash nor a second process can leave or read an incomplete file. Removed when it is dropped
/// before.
pub(crate) struct PartialFile {
    pub(crate) writer: BufWriter<File>,
    /// The name that it gets.
    pub(crate) path: PathBuf,
    temporary: PathBuf,
    complete: bool,
}

impl PartialFile {
    pub(crate) fn create(path: &Path) -> io::Result<PartialFile> {
        let name = path
            .file_name()
            .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "not a file name"))?;
        // The process id distinguishes two processes that write the same file; the last one to
        // finish wins.
        let mut temporary_name = name.to_os_string();
        temporary_name.push(format!(".{}.partial", std::process::id()));
        let temporary = path.with_file_name(temporary_name);
        let writer = BufWriter::with_capacity(1 << 20, File::create(&temporary)?);
        Ok(PartialFile { writer, path: path.to_path_buf(), temporary, complete: false })
    }

    /// Writes what is buffered and gives the file its name.
    pub(crate) fn complete(&mut self) -> io::Result<()> {
        self.writer.flush()?;
        std::fs::rename(&self.temporary, &self.path)?;
        self.complete = true;
        Ok(())
    }
}

impl Drop for PartialFile {
    fn drop(&mut self) {
        if !self.complete {
            // The first error is reported; a failure to remove the leftover does not change it.
            let _ = std::fs::remove_file(&self.temporary);
        }
    }
}

/// Writes a file under a temporary name and renames it. `write` receives a buffered writer.
pub(crate) fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let mut file = PartialFile::create(path)?;
    write(&mut file.writer)?;
    file.complete()
}
