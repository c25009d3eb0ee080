//! What was traced goes into the program's framebuffer: pending draws, when they must be visible,
//! and the pass that writes colours and depths.

pub(crate) mod effect_image;
pub(crate) mod frame;
pub(crate) mod frame_reuse;
pub(crate) mod framebuffer_pass;
mod multisample;
pub(crate) mod pipelined;
