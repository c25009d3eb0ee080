//! Runs unmodified OpenGL programs on an X server without a screen, one frame at a time. Mesa's
//! llvmpipe or `gluray run` renders them.

mod data;
mod display;
mod mesa;
mod programs;
mod session;

pub use data::{Format, write};
pub use display::Display;
pub use mesa::{Mesa, MesaFrames};
pub use programs::{Drawing, Program, find};
pub use session::{Backend, Cost, Session, Tools};
