//! Everything between a program and its OpenGL driver: the entry points that programs call, the
//! context that is current on a thread, the driver, the program's memory, and the guard that keeps
//! our panics from the program. `pipeline` has the calls between the steps of a frame.

pub(crate) mod calls;
pub(crate) mod client_memory;
pub(crate) mod context;
pub(crate) mod driver;
pub(crate) mod flush_reason;
pub mod glvnd;
pub(crate) mod kept_errors;
pub(crate) mod panic_guard;
mod pipeline;
pub(crate) mod share_group;
pub(crate) mod symbols;
