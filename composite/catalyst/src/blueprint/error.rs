//! Why a mesh cannot be read.

use datasets::model::ModelError;

/// What is wrong with a mesh, and where in the tree that the simulation gave.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BlueprintError {
    /// A node is missing, or is no text or number where one belongs.
    #[error("{path}: {what} should be there")]
    Missing {
        /// Its path.
        path: String,
        /// What belongs there.
        what: String,
    },
    /// A value that Blueprint has, or may have, but that is not read here.
    #[error("{path}: `{value}` is not supported; {cure}")]
    Unsupported {
        /// Its path.
        path: String,
        /// The value.
        value: String,
        /// What to give instead.
        cure: String,
    },
    /// Arrays that do not fit each other.
    #[error("{path}: {reason}")]
    Inconsistent {
        /// The path.
        path: String,
        /// What does not fit.
        reason: String,
    },
    /// A topology that is not there.
    #[error("{path}: there is no topology `{name}`; there are: {names}")]
    NoTopology {
        /// Path of the domain.
        path: String,
        /// The name that was asked for.
        name: String,
        /// Those that exist.
        names: String,
    },
    /// Arrays whose length does not fit the cells or points.
    #[error("{path}: {source}")]
    Model {
        /// Path of the domain.
        path: String,
        /// What does not fit.
        source: ModelError,
    },
}

impl BlueprintError {
    pub(super) fn missing(path: &str, what: impl Into<String>) -> BlueprintError {
        BlueprintError::Missing { path: path.to_owned(), what: what.into() }
    }

    pub(super) fn unsupported(path: &str, value: &str, cure: &str) -> BlueprintError {
        let [path, value, cure] = [path, value, cure].map(str::to_owned);
        BlueprintError::Unsupported { path, value, cure }
    }

    pub(super) fn inconsistent(path: &str, reason: impl Into<String>) -> BlueprintError {
        BlueprintError::Inconsistent { path: path.to_owned(), reason: reason.into() }
    }
}
