//! Between a program and its OpenGL driver: the entry points that programs call, the context that
//! is current on a thread, the driver behind us, the program's memory, and the guard that keeps our
//! panics from the program.

pub(crate) mod calls;
pub(crate) mod client_memory;
pub(crate) mod context;
pub(crate) mod driver;
pub mod glvnd;
pub(crate) mod panic_guard;
pub(crate) mod share_group;
pub(crate) mod symbols;
