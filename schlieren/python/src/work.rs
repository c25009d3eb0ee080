//! The threads of this package.

use pyo3::prelude::*;
use rt_core_python_work::{Length, Stop, Workers};

static WORKERS: Workers = Workers::new("schlieren");

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

/// Runs `work` without the interpreter, while Ctrl-C is looked for ([`Workers::run`]).
pub(crate) fn run<R: Send>(
    py: Python<'_>,
    threads: usize,
    work: impl FnOnce(&Stop) -> R + Send,
) -> PyResult<R> {
    run_for(py, Length::Long, threads, work)
}

/// The same for work that may be short ([`Workers::run`]).
pub(crate) fn run_for<R: Send>(
    py: Python<'_>,
    length: Length,
    threads: usize,
    work: impl FnOnce(&Stop) -> R + Send,
) -> PyResult<R> {
    WORKERS.run(py, threads, length, work)
}
