//! What stands between a program and its OpenGL driver: the hooks that programs come to, the
//! context that is current on a thread, and the program's memory. `pipeline` has the calls between
//! the steps of a frame.

pub(crate) mod client_memory;
pub(crate) mod context;
pub(crate) mod flush_reason;
pub mod glvnd;
pub(crate) mod kept_errors;
mod pipeline;
pub(crate) mod share_group;
pub(crate) mod symbols;
