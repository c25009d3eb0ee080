//! Draws on pictures: labels, arrows, line integral convolution (LIC), scales and contact sheets.
//!
//! Pictures are for readers: numbers belong in EXR and NumPy files. Colours are linear, as those of
//! rendered images.

mod canvas;
mod font;
mod lic;
mod overlay;
mod scale;

pub use canvas::Canvas;
pub use lic::line_integral_convolution;
pub use overlay::{Overlay, OverlayError, Style, Vectors, draw_overlay};
pub use scale::{in_unit, round_below};
