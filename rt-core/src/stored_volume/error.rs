//! Errors of stored volumes.

/// Why a volume could not be stored, or a stored one not be opened.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StoredVolumeError {
    /// The bytes could not be read or written.
    #[error("{name}: {reason}")]
    Io {
        /// The file, or what else the bytes are in.
        name: String,
        /// What was tried, and why it failed.
        reason: String,
    },
    /// The bytes are something else.
    #[error(
        "{name}: this is not a stored volume (it does not start with RTSVVOLU), or one that was \
         never finished; `bench store VOLUME -o FILE.rtvolume` makes one"
    )]
    NotAStoredVolume {
        /// The file.
        name: String,
    },
    /// Another version of the format.
    #[error(
        "{name}: version {found} of the format; this program reads version {expected}: store the \
         volume again"
    )]
    Version {
        /// The file.
        name: String,
        /// Its version.
        found: u32,
        /// The version that can be read.
        expected: u32,
    },
    /// More or fewer bytes than the header says.
    #[error(
        "{name}: {found} bytes, but the header says {expected}: the file was cut, or is still \
         being copied; copy it or store the volume again"
    )]
    Length {
        /// The file.
        name: String,
        /// Bytes there.
        found: u64,
        /// Bytes that the header names.
        expected: u64,
    },
    /// The bytes of the header, of the table of bricks or of a brick are not those that were
    /// written.
    #[error("{name}: {part} at byte {offset} is damaged: {reason}; store the volume again")]
    Damaged {
        /// The file.
        name: String,
        /// The part of the file.
        part: String,
        /// Where the part starts.
        offset: u64,
        /// What is wrong.
        reason: String,
    },
    /// The lattice cannot be that of a volume.
    #[error("{field} of the volume is {found}; it must be {rule}")]
    Lattice {
        /// "dims", "origin" or "spacing".
        field: &'static str,
        /// The invalid value.
        found: String,
        /// What is allowed.
        rule: &'static str,
    },
    /// A plane has too few or too many bytes, or there are too few or too many planes.
    #[error("plane {plane} (counted from 0): {found} bytes; it must have {expected}")]
    Plane {
        /// Its number.
        plane: u32,
        /// Bytes given; 0 where it was not given at all.
        found: u64,
        /// Bytes that a plane has; 0 after the last.
        expected: u64,
    },
    /// The machine stores numbers with the highest byte first.
    #[error("stored volumes can be used on little-endian machines only")]
    BigEndian,
}
