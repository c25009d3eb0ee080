//! The native module of the Python package `schlieren`.
//!
//! The package's Python files check arguments, give arrays their names and units, and write the
//! scene as the JSON form of a scene file. This module makes data sets of the arrays, and renders.
//! No panic leaves it, and the interpreter is free meanwhile.
#![forbid(unsafe_code)]

mod data;
mod errors;
mod flow;
mod index;
mod output;
mod sheet;
mod work;

use pyo3::prelude::*;

/// What `schlieren`'s Python files import.
#[pymodule]
mod _schlieren {
    #[pymodule_export]
    use super::flow::{Flow, series};
    #[pymodule_export]
    use super::index::index;
    #[pymodule_export]
    use super::output::Output;
    #[pymodule_export]
    use super::sheet::SheetOutput;
    #[pymodule_export]
    use super::work::{count_stopped_calls, count_threads};
}
