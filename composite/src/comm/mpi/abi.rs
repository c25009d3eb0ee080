//! Differences between MPI implementations below the level of C source: handles, sizes and magic
//! numbers.
//!
//! The standard fixes names and arguments, not the binary interface. Handles of Open MPI and SMPI
//! are pointers, those of MPICH are `int`s. A `usize` argument carries both: on x86-64 and aarch64
//! the callee reads the register's lower half where it expects an `int`. The numbers are from the
//! installed headers (`mpi.h`, `smpi.h`) of the versions named in [`Abi::of_version`].
use super::MpiError;

/// A binary interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Abi {
    /// Open MPI 4 and 5 (`libmpi.so.40`).
    OpenMpi,
    /// MPICH 3 and 4 (`libmpich.so.12`), and the members of its ABI compatibility initiative.
    Mpich,
    /// SimGrid's simulated MPI.
    Smpi,
}

/// Constants of one ABI that are not symbols.
#[derive(Clone, Copy, Debug)]
pub(super) struct Constants {
    /// Bytes of a request in an array of requests.
    pub(super) request_bytes: usize,
    /// `MPI_STATUS_IGNORE` (and `MPI_STATUSES_IGNORE`).
    pub(super) status_ignore: usize,
    /// `MPI_ANY_SOURCE`.
    pub(super) any_source: i32,
    /// Offset of `MPI_SOURCE` in a status, in bytes.
    pub(super) status_source: usize,
    /// `MPI_IN_PLACE`.
    pub(super) in_place: usize,
    /// `MPI_COMM_TYPE_SHARED`.
    pub(super) type_shared: i32,
}

impl Abi {
    /// Name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::OpenMpi => "Open MPI",
            Self::Mpich => "MPICH",
            Self::Smpi => "SMPI",
        }
    }

    /// The ABI of the library with the version text `version` (`MPI_Get_library_version`). Unknown
    /// libraries are refused: calls with handles of the wrong kind would not fail but misbehave.
    ///
    /// # Errors
    /// [`MpiError::UnknownAbi`] with the library's name.
    pub fn of_version(version: &str) -> Result<Self, MpiError> {
        let starts = |prefixes: &[&str]| prefixes.iter().any(|prefix| version.starts_with(prefix));
        if starts(&["Open MPI v4.", "Open MPI v5."]) {
            Ok(Self::OpenMpi)
        } else if starts(&[
            "MPICH Version:\t3.",
            "MPICH Version:\t4.",
            "MPICH Version: 3.",
            "MPICH Version: 4.",
        ]) {
            Ok(Self::Mpich)
        } else if starts(&["Intel(R) MPI Library", "MVAPICH2 Version", "MVAPICH Version"]) {
            // Same ABI by the MPICH ABI compatibility initiative (https://www.mpich.org/abi).
            Ok(Self::Mpich)
        } else if starts(&["SMPI Version 3."]) {
            Ok(Self::Smpi)
        } else {
            Err(MpiError::UnknownAbi {
                version: version.lines().next().unwrap_or_default().to_string(),
            })
        }
    }

    /// Bytes of an `MPI_Comm`.
    pub(super) fn handle_bytes(self) -> usize {
        match self {
            Self::OpenMpi | Self::Smpi => 8,
            Self::Mpich => 4,
        }
    }

    pub(super) fn constants(self) -> Constants {
        match self {
            Self::OpenMpi => Constants {
                request_bytes: 8,
                status_ignore: 0,
                any_source: -1,
                status_source: 0,
                in_place: 1,
                type_shared: 0,
            },
            Self::Mpich => Constants {
                request_bytes: 4,
                status_ignore: 1,
                any_source: -2,
                status_source: 8,
                in_place: usize::MAX,
                type_shared: 1,
            },
            Self::Smpi => Constants {
                request_bytes: 8,
                status_ignore: 0,
                any_source: -555,
                status_source: 0,
                in_place: -222_isize as usize,
                type_shared: 1,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn libraries_are_distinguished_by_their_version_strings() {
        let open = "Open MPI v4.1.4, package: Debian OpenMPI, ident: 4.1.4, repo rev: v4.1.4, May \
                    26, 2022";
        assert_eq!(Abi::of_version(open).ok(), Some(Abi::OpenMpi));
        assert_eq!(
            Abi::of_version("MPICH Version:\t4.0.2\nMPICH Release date:").ok(),
            Some(Abi::Mpich)
        );
        assert_eq!(
            Abi::of_version("SMPI Version 3.32. Copyright The SimGrid Team").ok(),
            Some(Abi::Smpi)
        );
    }

    #[test]
    fn an_unknown_library_is_refused_by_its_name() {
        for version in ["HP-MPI 2.3", "Open MPI v1.10.7", "MPICH Version:\t1.4"] {
            let text = Abi::of_version(version).unwrap_err().to_string();
            assert!(text.contains(version) && text.contains("Open MPI 4"), "{text}");
        }
    }
}
