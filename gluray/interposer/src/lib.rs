//! The shared library `libgluray.so`: the OpenGL, GLX and EGL entry points that programs call, and
//! the jumps from them to gluray's hooks and to the driver. Everything else is the library
//! `gluray`, which the program `gluray` uses without these symbols.
//!
//! The entry points are written in assembly, for x86-64 Linux. Elsewhere this library is empty, and
//! building it prints a warning.
#![deny(unsafe_code)]

#[cfg(all(target_arch = "x86_64", target_os = "linux"))]
mod entry_points;
