//! Errors of starting MPI.

/// Why MPI could not be started.
#[derive(Debug, thiserror::Error, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum MpiError {
    /// The process was not started by a launcher.
    #[error(
        "this process was not started by an MPI launcher: start it with `mpirun -n RANKS ...`, \
         or name the library in COMPOSITE_MPI (openmpi, mpich or a path)"
    )]
    NotLaunched,
    /// No library could be loaded.
    #[error(
        "no MPI library for this launcher ({reason}): {tried}: install it (Debian: openmpi-bin or \
         mpich), \
         or name the library in COMPOSITE_MPI"
    )]
    NoLibrary {
        /// Why these libraries were tried.
        reason: String,
        /// The loader's error text for each.
        tried: String,
    },
    /// The library lacks a function.
    #[error("{library} has no function {symbol}: it is no MPI library, or an old one")]
    MissingSymbol {
        /// The library.
        library: String,
        /// The function.
        symbol: String,
    },
    /// The library's binary interface is unknown.
    #[error(
        "the MPI library calls itself `{version}`, whose binary interface is not known here: \
         use Open MPI 4 or 5, MPICH 3 or 4 (or a library with MPICH's ABI), or SimGrid's SMPI 3"
    )]
    UnknownAbi {
        /// First line of the library's version text.
        version: String,
    },
    /// A second communicator for all ranks of the job.
    #[error("MPI was started before in this process: keep the communicator that was made then")]
    StartedTwice,
    /// The surrounding program has not started MPI, or has ended it.
    #[error(
        "MPI is {state} in this process ({library}): call this between MPI_Init and MPI_Finalize \
         of the program whose communicator it is"
    )]
    NotRunning {
        /// "not started" or "ended".
        state: &'static str,
        /// The library that was asked.
        library: String,
    },
    /// The surrounding program's MPI does not allow calls from this thread.
    #[error(
        "MPI was started with the thread level {level}, which allows calls from the main thread \
         alone: call this there, or start MPI with MPI_THREAD_SERIALIZED"
    )]
    OtherThread {
        /// `MPI_THREAD_SINGLE` or `MPI_THREAD_FUNNELED`.
        level: &'static str,
    },
    /// The communicator cannot be used.
    #[error("the communicator is {what}: give one over the ranks that work together")]
    UnusableCommunicator {
        /// What it is.
        what: &'static str,
    },
    /// The program was compiled with the headers of another MPI.
    #[error(
        "an MPI_Comm of this program has {bytes} bytes, but one of the MPI that runs ({library}) \
         has {expected}: start the program with the launcher of the MPI that it was compiled with"
    )]
    OtherHeaders {
        /// Size of the program's handles.
        bytes: usize,
        /// Size of the library's handles.
        expected: usize,
        /// The library.
        library: String,
    },
    /// A call failed while starting.
    #[error("{call} failed while starting MPI: {reason}")]
    Call {
        /// The call.
        call: String,
        /// The error text of the library.
        reason: String,
    },
}
