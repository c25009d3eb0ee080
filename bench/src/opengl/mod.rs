//! Unmodified OpenGL programs on an X server without a screen, drawn by Mesa's llvmpipe or through
//! `gluray run`, one frame at a time.

mod data;
mod display;
mod mesa;
mod programs;
mod session;

pub use data::{Format, write};
pub use display::Display;
pub use mesa::{Mesa, MesaFrames};
pub use programs::{Program, find};
pub use session::{Backend, Cost, Session, Tools};
