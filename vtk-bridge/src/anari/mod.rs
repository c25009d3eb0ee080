//! An ANARI device: rt-core for programs that draw through the Khronos group's
//! [ANARI](https://www.khronos.org/anari) (ParaView 6.1 and later, VTK with RenderingAnari, pynari,
//! Blender).
//!
//! ANARI's loader opens `libanari_library_rtv.so` and calls C++ virtual functions of what it gets.
//! [`abi`] lays these tables out, and is the only place with unsafe code; behind it a
//! [`device::Device`] is ordinary Rust. The way of a frame:
//!
//! 1. [`device`]: the program makes [`object`]s and sets parameters, which [`schema`] checks;
//!    commits make them effective.
//! 2. [`scene`]: rendering a frame turns the committed objects into a scene of rt-core, with what
//!    is expensive kept from frame to frame.
//! 3. [`frame`]: a thread builds what is new of the acceleration structures, draws, and puts the
//!    channels into the form that was asked for.

pub mod abi;
pub mod array;
pub mod data_type;
pub mod device;
pub mod frame;
pub mod object;
pub mod scene;
pub mod schema;
pub mod status;
