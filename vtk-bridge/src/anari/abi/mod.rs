//! The binary interface of ANARI's loader, defined by hand.
//!
//! The loader (`libanari.so`, 0.9 to 0.17) finds the function `anari_library_rtv_new_library`. It
//! treats the returned pointer as a C++ object with virtual functions, and likewise the result of
//! the library's `newDevice` (`anari::LibraryImpl` and `anari::DeviceImpl` in the SDK's headers).
//! The interface is therefore two tables of functions in the order of the Itanium C++ ABI: the
//! offset to top, the type information (null, because it is never read), then the functions. The
//! destructor has two entries: one destroys the object in place, the other also frees its memory.
//! All handles except those of the library and the device are opaque numbers: see
//! [`Handle`](super::handle::Handle).
//!
//! Panics never cross this interface: every function catches them and reports an error.
#![allow(
    unsafe_code,
    reason = "called through C++ tables with pointers of programs that we do not know"
)]

mod callback;
mod device;
mod frontend;
mod introspection;
mod library;
mod text;

pub use library::{anari_library_rtv_new_library, new_library};
