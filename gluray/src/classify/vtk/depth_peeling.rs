//! Replaces VTK's dual depth peeling (Bavoil and Myers 2008), which draws translucent surfaces six
//! times or more, by one draw.
//!
//! The driver draws the first pass, which finds the range of depths. The texture of this pass is
//! also the depth of the opaque surfaces. In the pass that would peel the first layers nothing is
//! drawn. Instead all surfaces are traced, blended by depth, and put where VTK gathers the nearest
//! layers. VTK then queries how many pixels that pass changed farther back, gets zero, and stops.
//! So all of VTK's later steps are right without changes.
//!
//! Draws are taken out of the second pass only when every draw of the first pass was a known
//! surface. With text, lines or volumes among them, the driver draws everything.

use super::signature::TranslucencyPass;
use crate::capture::draw::{Draw, TexturedDraw};
use crate::classify::rules::{self, Classification, TraceFilter};
use crate::driver::gl;
use crate::enums::*;
use crate::host::config::{Mode, Settings};
use crate::state::snapshot::Snapshot;
use crate::trace::DepthLimits;

/// The progress of VTK's peeling.
#[derive(Default)]
pub(crate) struct DepthPeeling {
    /// The number of the driver's draws at the last clear.
    at_clear: u64,
    /// The number of known draws of the first pass so far.
    depths: u64,
    /// The first pass had no other draws.
    whole: bool,
    /// The draws that were taken out of the second pass.
    taken: Vec<TexturedDraw>,
    /// The depths up to which they count.
    limit: Option<DepthLimits>,
    /// The framebuffer of the second pass.
    framebuffer: u32,
}

impl DepthPeeling {
    /// A buffer is cleared. The driver drew `passed` draws until now.
    pub(crate) fn cleared(&mut self, passed: u64) {
        if self.depths > 0 {
            // One draw copies the depths of the opaque surfaces before the translucent ones come.
            self.whole = passed == self.at_clear + 1 + self.depths;
            self.depths = 0;
        }
        self.at_clear = passed;
    }

    pub(crate) fn has_draws(&self) -> bool {
        !self.taken.is_empty()
    }

    /// Whether a draw of a pass of peeling is to be taken; the reason when the driver draws it. The
    /// driver drew `passed` draws until now.
    pub(super) fn check_pass(
        &mut self,
        pass: TranslucencyPass,
        s: &Snapshot,
        settings: &Settings,
        passed: u64,
    ) -> Result<(), &'static str> {
        const PEELED: &str = "translucent surfaces that VTK peels";
        let traced =
            settings.enabled && matches!(settings.mode, Mode::Match | Mode::Phong | Mode::Rich);
        match pass {
            TranslucencyPass::No | TranslucencyPass::Weighted => Ok(()),
            TranslucencyPass::Depths => {
                if self.depths == 0 {
                    self.whole = false;
                }
                self.depths += 1;
                Err("depths of translucent surfaces that VTK peels")
            }
            TranslucencyPass::Layers => {
                let first = self.taken.is_empty();
                let untouched = passed == self.at_clear;
                let same = first || self.framebuffer == s.framebuffer;
                if !(traced && self.whole && untouched && same && s.framebuffer != 0) {
                    return Err(PEELED);
                }
                if first {
                    self.framebuffer = s.framebuffer;
                    self.limit = limit(s.program);
                }
                if self.limit.is_some() { Ok(()) } else { Err(PEELED) }
            }
        }
    }

    /// Takes a draw out of the pass.
    pub(super) fn take(&mut self, draw: Draw) {
        self.taken.push((draw, None));
    }

    /// The draws that were taken out of the pass, and the depths up to which they count.
    pub(crate) fn take_draws(&mut self) -> (Vec<TexturedDraw>, Option<DepthLimits>) {
        self.whole = false;
        (std::mem::take(&mut self.taken), self.limit.take())
    }

    /// The buffers in which VTK gathers layers, and the draw buffers as they are now. `None` when
    /// VTK does not peel as it did.
    pub(crate) fn gather_buffers(&self, s: &Snapshot) -> Option<(Vec<u32>, Vec<u32>)> {
        let buffers = [0, 1, 2, 3].map(|i| gl::word(DRAW_BUFFER0 + i));
        let found = match buffers {
            // What is farthest back: gathered there from layer to layer, blended over.
            [back, 0, ..] => Some((vec![back], vec![back])),
            // Nothing was gathered yet, and what is nearest is the second of three.
            [a, front, c, 0] => Some((vec![front], vec![a, front, c])),
            _ => None,
        };
        found.filter(|_| s.framebuffer == self.framebuffer)
    }
}

/// Whether a peeled surface can be traced. Apart from what peeling itself sets, its state must be
/// that of any traced surface.
pub(super) fn check_surface(state: &mut Snapshot, filter: TraceFilter) -> Result<(), &'static str> {
    (state.more_draw_buffers, state.blend, state.depth_test) = (false, false, true);
    (state.depth_mask, state.depth_func) = (true, LEQUAL);
    match rules::classify(state, filter) {
        Classification::Trace => Ok(()),
        Classification::Pass(why) | Classification::TraceIfOpaque(why) => Err(why),
        Classification::TraceInOrder => Err("a peeled surface whose order matters"),
    }
}

/// The depths up to which surfaces count: the second component of the texture of the first pass.
fn limit(program: u32) -> Option<DepthLimits> {
    let at = gl::uniform_location(program, "lastDepthPeel");
    if at < 0 {
        return None;
    }
    let unit = gl::uniform_i::<1>(program, at)[0].max(0).cast_unsigned();
    let active = gl::word(ACTIVE_TEXTURE);
    gl::active_texture(TEXTURE0 + unit);
    let size = |what| gl::tex_level_i::<1>(TEXTURE_2D, 0, what)[0].max(0) as usize;
    let (width, height) = (size(TEXTURE_WIDTH), size(TEXTURE_HEIGHT));
    let fits = width * height > 0 && width * height <= 1 << 26;
    let depth = fits.then(|| {
        // VTK needs OpenGL 3.2, which knows profiles.
        let core = gl::int(CONTEXT_PROFILE_MASK) & 1 != 0;
        // The program may want its own pixels packed in any way.
        let read = |plainly: &gl::RawPixelTransfer| gl::tex_image_rgba(plainly, TEXTURE_2D, 0);
        let texels = gl::with_raw_pixel_reads(core, read);
        texels.into_iter().map(|t| t[1]).collect::<Vec<f32>>()
    });
    let depth = depth.filter(|d| d.len() == width * height);
    gl::active_texture(active);
    Some(DepthLimits { width, height, depth: depth?, exact: false })
}
