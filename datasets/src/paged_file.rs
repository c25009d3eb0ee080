//! Files of parts that are read at any place: stored meshes and stored volumes.

use crate::atomic_file::PartialFile;
use rt_core::paging::{PageSink, PageSource};
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// A file that is read at any place by several threads.
pub(crate) struct OpenFile {
    file: File,
    path: PathBuf,
}

impl OpenFile {
    pub(crate) fn open(path: &Path) -> io::Result<OpenFile> {
        Ok(OpenFile { file: File::open(path)?, path: path.to_path_buf() })
    }
}

impl PageSource for OpenFile {
    fn name(&self) -> String {
        self.path.display().to_string()
    }

    fn length(&self) -> Result<u64, String> {
        self.file.metadata().map(|m| m.len()).map_err(|e| format!("cannot look at it: {e}"))
    }

    fn read(&self, offset: u64, bytes: &mut [u8]) -> Result<(), String> {
        let length = bytes.len();
        read_at(&self.file, bytes, offset)
            .map_err(|e| format!("cannot read {length} bytes from byte {offset} on: {e}"))
    }
}

/// Reads all of `bytes` from `offset` on, without a position that threads would share.
#[cfg(unix)]
pub(crate) fn read_at(file: &File, bytes: &mut [u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, bytes, offset)
}

/// Reads all of `bytes` from `offset` on, without a position that threads would share.
#[cfg(windows)]
pub(crate) fn read_at(file: &File, mut bytes: &mut [u8], mut offset: u64) -> io::Result<()> {
    while !bytes.is_empty() {
        let read = std::os::windows::fs::FileExt::seek_read(file, bytes, offset)?;
        if read == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        bytes = &mut bytes[read..];
        offset += read as u64;
    }
    Ok(())
}

/// A file that gets its name when it is complete.
pub struct PagedFile {
    file: PartialFile,
    /// Bytes given so far.
    written: u64,
}

impl PagedFile {
    pub(crate) fn create(path: &Path) -> io::Result<PagedFile> {
        Ok(PagedFile { file: PartialFile::create(path)?, written: 0 })
    }

    /// Gives the file its name.
    pub(crate) fn complete(&mut self) -> Result<(), String> {
        self.file.complete().map_err(|e| self.unwritable(self.written, &e))
    }

    /// Why bytes from `offset` on could not be written.
    fn unwritable(&self, offset: u64, source: &io::Error) -> String {
        let cure = match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                "; make room, or write to another disk"
            }
            _ => "",
        };
        format!("cannot write it from byte {offset} on: {source}{cure}")
    }
}

impl PageSink for PagedFile {
    fn name(&self) -> String {
        self.file.path.display().to_string()
    }

    fn append(&mut self, bytes: &[u8]) -> Result<(), String> {
        let offset = self.written;
        self.file.writer.write_all(bytes).map_err(|e| self.unwritable(offset, &e))?;
        self.written += bytes.len() as u64;
        Ok(())
    }

    fn replace_start(&mut self, bytes: &[u8]) -> Result<(), String> {
        // What is still in the buffer is written first.
        let flushed = self.file.writer.flush();
        flushed.map_err(|e| self.unwritable(self.written, &e))?;
        let writer = &mut self.file.writer;
        let replaced = writer.seek(SeekFrom::Start(0)).and_then(|_| writer.write_all(bytes));
        replaced.map_err(|e| self.unwritable(0, &e))
    }
}
