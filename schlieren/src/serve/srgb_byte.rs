//! Turns light into bytes of pixels.

use rt_core::colormap::linear_to_srgb;

/// Linear light as the page's pixels have it. The cast turns NaN into 0.
pub(super) fn srgb_byte(v: f32) -> u8 {
    (255.0 * linear_to_srgb(v.clamp(0.0, 1.0))).round() as u8
}
