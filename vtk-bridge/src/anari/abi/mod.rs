//! The binary interface of ANARI's loader, laid out by hand.
//!
//! The loader (`libanari.so`, 0.9 to 0.17) finds the function `anari_library_rtv_new_library`, and
//! treats what it returns as a C++ object with virtual functions, as it does with what the
//! library's `newDevice` returns (`anari::LibraryImpl` and `anari::DeviceImpl` in the SDK's
//! headers). So the interface is two tables of functions in the order of the Itanium C++ ABI:
//! offset to top, type information (never looked at, so null), then the functions, with two entries
//! for the destructor (in place, and with the memory given back). All handles but the library's and
//! the device's are opaque numbers: see [`Handle`](super::object::Handle).
//!
//! Panics do not cross: every function catches them and reports an error.
#![allow(
    unsafe_code,
    reason = "called through C++ tables with pointers of programs that we do not know"
)]

mod callback;
mod device;
mod frontend;
mod introspection;
mod library;
pub(crate) mod memory;
mod text;

pub use library::{anari_library_rtv_new_library, new_library};
