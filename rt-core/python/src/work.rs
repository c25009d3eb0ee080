//! The threads of this package.

use pyo3::prelude::*;
use rt_core_python_work::Workers;
pub(crate) use rt_core_python_work::{Length, Stop};

static WORKERS: Workers = Workers::new("rt_core");

/// The threads that `threads=None` stands for.
#[pyfunction]
pub(crate) fn count_threads() -> usize {
    rt_core_python_work::count_threads()
}

/// Calls that Ctrl-C stopped before their end.
#[pyfunction]
pub(crate) fn count_stopped_calls() -> usize {
    WORKERS.count_stopped()
}

/// Runs `work` without the interpreter ([`Workers::run`]).
pub(crate) fn run<R: Send>(
    py: Python<'_>,
    threads: usize,
    length: Length,
    work: impl FnOnce(&Stop) -> R + Send,
) -> PyResult<R> {
    WORKERS.run(py, threads, length, work)
}
