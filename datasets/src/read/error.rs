//! Errors of the readers. Each names the file, the position and the cure.

use std::fmt;
use std::path::{Path, PathBuf};

/// A position in a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum At {
    /// Offset from the start of the file, in bytes.
    Byte(u64),
    /// Line of a text, from 1.
    Line(u64),
    /// The name of a field, array or element.
    Field(String),
}

impl fmt::Display for At {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            At::Byte(n) => write!(f, "at byte {n}"),
            At::Line(n) => write!(f, "in line {n}"),
            At::Field(name) => write!(f, "in {name}"),
        }
    }
}

/// Reason why a file cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The operating system refused access.
    #[error("{}: cannot be read; {cure}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's message.
        source: std::io::Error,
        /// What to do.
        cure: String,
    },
    /// The content breaks the rules of its format.
    #[error("{}: not a valid {format} file: {at}: {what}; {cure}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Name of the format.
        format: &'static str,
        /// The position.
        at: At,
        /// What is wrong, with the value found.
        what: String,
        /// What to do.
        cure: String,
    },
    /// The content may be valid, but this program does not read it.
    #[error("{}: {format} file that uses something not read here: {at}: {what}; \
             {cure}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// Name of the format.
        format: &'static str,
        /// The position.
        at: At,
        /// The unsupported feature.
        what: String,
        /// What to do.
        cure: String,
    },
    /// An option is missing or means nothing to the file, which itself may be sound.
    #[error("{}: {at}: {what}; {cure}", path.display())]
    Option {
        /// The file.
        path: PathBuf,
        /// The option, or what needs one.
        at: At,
        /// What is wrong, with the value found.
        what: String,
        /// What to do.
        cure: String,
    },
    /// Neither the file extension nor the content identifies the format.
    #[error("{}: unknown kind of file ({what}); files read here: {known}", path.display())]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// What was examined.
        what: String,
        /// The supported formats.
        known: &'static str,
    },
}

impl ReadError {
    /// The file that the error is about.
    pub fn path(&self) -> &Path {
        match self {
            ReadError::Io { path, .. }
            | ReadError::Malformed { path, .. }
            | ReadError::Unsupported { path, .. }
            | ReadError::Option { path, .. }
            | ReadError::UnknownFormat { path, .. } => path,
        }
    }
}

/// A fault in a file whose name is not known yet; [`Fault::in_file`] adds it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Fault {
    pub(crate) at: At,
    pub(crate) what: String,
    pub(crate) cure: String,
    pub(crate) kind: FaultKind,
}

/// Which error a fault becomes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FaultKind {
    Malformed,
    Unsupported,
    Option,
}

/// The cure for a file that is shorter than it declares.
pub(crate) const TRUNCATED: &str = "the file is probably truncated: copy or write it again";
/// The cure for a file that contradicts itself.
pub(crate) const BROKEN: &str =
    "the file contradicts itself: write it again with the program that made it";

impl Fault {
    pub(crate) fn new(at: At, what: impl Into<String>, cure: impl Into<String>) -> Self {
        Fault { at, what: what.into(), cure: cure.into(), kind: FaultKind::Malformed }
    }
    pub(crate) fn field(field: impl Into<String>, what: impl Into<String>) -> Self {
        Fault::new(At::Field(field.into()), what, BROKEN)
    }
    pub(crate) fn unsupported(at: At, what: impl Into<String>, cure: impl Into<String>) -> Self {
        Fault { at, what: what.into(), cure: cure.into(), kind: FaultKind::Unsupported }
    }
    pub(crate) fn option(at: At, what: impl Into<String>, cure: impl Into<String>) -> Self {
        Fault { at, what: what.into(), cure: cure.into(), kind: FaultKind::Option }
    }
    pub(crate) fn in_file(self, path: &Path, format: &'static str) -> ReadError {
        let Fault { at, what, cure, kind } = self;
        let path = path.to_path_buf();
        match kind {
            FaultKind::Malformed => ReadError::Malformed { path, format, at, what, cure },
            FaultKind::Unsupported => ReadError::Unsupported { path, format, at, what, cure },
            FaultKind::Option => ReadError::Option { path, at, what, cure },
        }
    }
}

impl From<crate::model::ModelError> for Fault {
    fn from(e: crate::model::ModelError) -> Self {
        match e {
            crate::model::ModelError::Inconsistent { field, expected, found } => {
                Fault::field(field, format!("expected {expected}, found {found}"))
            }
            other => Fault::field("the data set", other.to_string()),
        }
    }
}

/// Converts a declared number of items to a length. It is rejected if `available` bytes cannot hold
/// that many items of at least `each` bytes. Every size that a file declares is checked here before
/// memory is allocated for it.
pub(crate) fn fits(
    count: u64,
    each: usize,
    available: usize,
    at: At,
    what: &str,
) -> Result<usize, Fault> {
    match count.checked_mul(each.max(1) as u64) {
        Some(bytes) if bytes <= available as u64 => Ok(count as usize),
        _ => {
            let each = if each > 1 { format!(" of {each} bytes") } else { String::new() };
            Err(Fault::new(
                at,
                format!("{count} {what}{each} declared, but only {available} bytes follow"),
                TRUNCATED,
            ))
        }
    }
}

/// The content of a file.
pub(crate) fn read_bytes(path: &Path) -> Result<Vec<u8>, ReadError> {
    let bytes = std::fs::read(path).map_err(|source| io_error(path, source))?;
    refuse_pointer(path, &bytes)?;
    Ok(bytes)
}

/// Refuses the note that Git LFS leaves in the place of a file that it has not fetched.
pub(crate) fn refuse_pointer(path: &Path, head: &[u8]) -> Result<(), ReadError> {
    if !head.starts_with(b"version https://git-lfs.github.com/spec/") {
        return Ok(());
    }
    Err(ReadError::Io {
        path: path.to_path_buf(),
        source: std::io::Error::other("only a pointer of Git LFS is there"),
        cure: "fetch the file with `git lfs pull`".into(),
    })
}

/// Adds the matching cure to an operating system error.
pub(crate) fn io_error(path: &Path, source: std::io::Error) -> ReadError {
    let cure = match source.kind() {
        std::io::ErrorKind::NotFound => "check the name and the directory",
        std::io::ErrorKind::PermissionDenied => "check that you may read it",
        std::io::ErrorKind::IsADirectory => "name a file, not a directory",
        _ => "check the disk and the name",
    };
    ReadError::Io { path: path.to_path_buf(), source, cure: cure.into() }
}

/// The fault of an array that could not be read from the disk.
pub(crate) fn io_fault(array: &str, source: std::io::Error) -> Fault {
    let cure = match source.kind() {
        std::io::ErrorKind::UnexpectedEof => TRUNCATED,
        _ => "check the disk",
    };
    Fault::new(At::Field(format!("array `{array}`")), format!("it cannot be read: {source}"), cure)
}

/// Resolves the name of another file relative to the file that contains it. Absolute names and
/// names that leave the directory are allowed: the formats allow them and the user opened the file.
pub(crate) fn sibling_path(path: &Path, name: &str) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).join(name.trim())
}

/// Bytes with a read position, for binary formats.
pub(crate) struct Cursor<'a> {
    pub(crate) data: &'a [u8],
    pub(crate) pos: usize,
}

impl<'a> Cursor<'a> {
    pub(crate) fn new(data: &'a [u8]) -> Self {
        Cursor { data, pos: 0 }
    }
    pub(crate) fn remaining(&self) -> usize {
        self.data.len() - self.pos
    }
    pub(crate) fn at(&self) -> At {
        At::Byte(self.pos as u64)
    }
    /// The next `count` items of `each` bytes.
    pub(crate) fn take(&mut self, count: u64, each: usize, what: &str) -> Result<&'a [u8], Fault> {
        let n = fits(count, each, self.remaining(), self.at(), what)? * each;
        let out = &self.data[self.pos..self.pos + n];
        self.pos += n;
        Ok(out)
    }
    /// The next line as text, without its line end; `None` at the end of the data.
    pub(crate) fn line(&mut self) -> Option<String> {
        if self.remaining() == 0 {
            return None;
        }
        let rest = &self.data[self.pos..];
        let end = rest.iter().position(|&b| b == b'\n');
        self.pos += end.map_or(rest.len(), |e| e + 1);
        let line = &rest[..end.unwrap_or(rest.len())];
        Some(String::from_utf8_lossy(line.strip_suffix(b"\r").unwrap_or(line)).into_owned())
    }
    /// The next word of text, `None` at the end.
    pub(crate) fn word(&mut self) -> Option<&'a [u8]> {
        let rest = &self.data[self.pos..];
        let start = rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let len = rest[start..]
            .iter()
            .position(|b| b.is_ascii_whitespace())
            .unwrap_or(rest.len() - start);
        self.pos += start + len;
        Some(&rest[start..start + len])
    }
    /// The next `count` words as numbers of type `kind`.
    pub(crate) fn numbers(
        &mut self,
        kind: crate::model::ScalarType,
        count: u64,
        what: &str,
    ) -> Result<crate::model::Values, Fault> {
        // Every number takes at least a digit and a separator, except for the last one.
        let count = fits(count, 2, self.remaining() + 1, self.at(), what)?;
        let mut missing = false;
        let words = (0..count).map_while(|_| {
            let w = self.word();
            missing |= w.is_none();
            w.map(|w| std::str::from_utf8(w).unwrap_or("\u{fffd}"))
        });
        let values = crate::model::Values::from_words(kind, words);
        match values {
            Err(w) => {
                let shown: String = w.chars().take(40).collect();
                let what = format!("`{shown}` is not a number of type {} ({what})", kind.name());
                Err(Fault::new(self.at(), what, BROKEN))
            }
            Ok(_) if missing => {
                Err(Fault::new(self.at(), format!("the file ends among {count} {what}"), TRUNCATED))
            }
            Ok(v) => Ok(v),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::error::Error;
    use std::path::Path;

    #[test]
    fn the_systems_reason_is_in_the_chain_once() {
        let error = super::read_bytes(Path::new("no/such/file")).unwrap_err();
        let cause = error.source().expect("the system's error");
        let chain = format!("{error}: {cause}");
        assert!(
            chain.starts_with("no/such/file: cannot be read; check the name and the directory: "),
            "{chain}"
        );
        assert_eq!(chain.matches(&cause.to_string()).count(), 1, "{chain}");
        assert!(cause.source().is_none(), "{cause}");

        let error = crate::write::write_file(Path::new("no/such/file"), |_| Ok(())).unwrap_err();
        let cause = error.source().expect("the system's error");
        assert!(!error.to_string().contains(&cause.to_string()), "{error}: {cause}");
    }
}
