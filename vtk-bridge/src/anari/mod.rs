//! An ANARI device: rt-core for programs that draw through the Khronos group's
//! [ANARI](https://www.khronos.org/anari) (ParaView 6.1 and later, VTK with RenderingAnari, pynari,
//! Blender).
//!
//! ANARI's loader opens `libanari_library_rtv.so` and calls C++ virtual functions of the objects it
//! returns. [`abi`] defines these function tables, and `memory` holds the elements of arrays where
//! the program has them; behind these two, a [`device::Device`] is ordinary Rust without unsafe
//! code. A frame passes through these modules:
//!
//! 1. [`device`]: the program makes [`object`]s and sets parameters, which [`schema`] checks.
//!    Commits make them effective.
//! 2. [`scene`]: when a frame is rendered, the committed objects are converted to a scene of
//!    rt-core. Expensive results are cached between frames.
//! 3. [`frame`]: a thread builds the acceleration structures that are new, renders, and converts
//!    the channels to the requested format.

pub mod abi;
pub mod array;
pub mod data_type;
pub mod device;
pub mod frame;
pub mod handle;
mod memory;
pub mod object;
pub mod scene;
pub mod schema;
pub mod status;
