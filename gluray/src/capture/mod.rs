//! Draw calls become meshes with attributes: immediate mode, vertex arrays, display lists and
//! evaluators, and the caches that recognise geometry and attributes of earlier frames.

mod array_element;
pub(crate) mod attribute_cache;
pub(crate) mod buffer_writes;
pub(crate) mod display_lists;
pub(crate) mod draw;
pub(crate) mod evaluators;
pub(crate) mod geometry_cache;
pub(crate) mod immediate_mode;
pub(crate) mod primitives;
pub(crate) mod vertex_arrays;
pub(crate) mod vertex_recorder;
