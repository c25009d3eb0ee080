//! The native module of the Python package `rt_core`.
//!
//! The package's Python files check arguments and make arrays; this module gets arrays that are
//! contiguous and of the right type, and checks what only a pass over all rays can tell. No panic
//! leaves it, and the interpreter is free while rays are traced.
#![deny(unsafe_code)]

mod exr_file;
mod lists;
mod methods;
mod normals;
mod parts;
mod queries;
mod rays;
mod stage;
mod work;
mod world;

use pyo3::prelude::*;

/// What `rt_core`'s Python files import.
#[pymodule]
mod _rt_core {
    #[pymodule_export]
    use super::exr_file::exr_bytes;
    #[pymodule_export]
    use super::stage::Stage;
    #[pymodule_export]
    use super::work::{count_stopped_calls, count_threads};
    #[pymodule_export]
    use super::world::World;
    #[pymodule_export]
    const NO_HIT: u32 = rt_core::ray::NO_HIT;
}
