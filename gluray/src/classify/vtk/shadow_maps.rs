//! Leaves surfaces to the driver while VTK draws shadows: it draws surfaces as usual, then depths
//! as lights see them, then all surfaces again over themselves, with shadows.
//!
//! Drawing surfaces again needs depths that are equal to the last bit, and those of rays and the
//! driver are not. So the driver draws surfaces while shadow maps are in use. The first frame shows
//! this too late, because surfaces were traced before the first map was drawn. In that frame the
//! driver's second draw is moved a little towards the viewer.

use super::VtkPrograms;
use super::signature::SHADOW_MAP;
use crate::driver::gl;
use crate::enums::*;
use crate::state::snapshot::Snapshot;

/// The number of frames for which a shadow map counts as in use.
const IN_USE_FRAMES: u64 = 3;
/// How much nearer surfaces are drawn over traced ones: factor and units of polygon offset. A whole
/// factor would show back faces in front of front faces at silhouettes.
const NEARER: (f32, f32) = (-1.0 / 64.0, -8.0);

/// The shadow maps of a context.
#[derive(Default)]
pub(super) struct ShadowMaps {
    /// The frame from which on none is in use.
    until: u64,
    /// The last frame in which a surface was traced.
    last_traced: Option<u64>,
    /// The program's polygon offset, while ours is set.
    kept: Option<(bool, [f32; 2])>,
}

impl VtkPrograms {
    /// Whether a surface can be traced although VTK may draw it again. `signature` is that of its
    /// program, as far as it is known.
    pub(super) fn is_drawn_once<T>(
        &mut self,
        signature: &Result<T, &'static str>,
    ) -> Result<(), &'static str> {
        let now = self.frame;
        let maps = &mut self.shadow_maps;
        match signature {
            Err(why) if *why == SHADOW_MAP => maps.until = now + IN_USE_FRAMES,
            Ok(_) if now < maps.until && maps.last_traced != Some(now) => {
                return Err("surfaces that VTK draws again with its shadow maps");
            }
            Ok(_) => maps.last_traced = Some(now),
            Err(_) => {}
        }
        Ok(())
    }

    /// The driver is about to draw something filled.
    pub(crate) fn begin_redraw(&mut self, s: &Snapshot) {
        let now = self.frame;
        let maps = &mut self.shadow_maps;
        let is_map = self.signatures.get(&s.program) == Some(&Err(SHADOW_MAP));
        let again = maps.last_traced == Some(now) && now < maps.until && s.program != 0 && !is_map;
        if !again || !s.depth_test || !s.depth_mask || s.depth_func != LEQUAL || maps.kept.is_some()
        {
            return;
        }
        let offset =
            [POLYGON_OFFSET_FACTOR, POLYGON_OFFSET_UNITS].map(|what| gl::floats::<1>(what)[0]);
        maps.kept = Some((gl::is_enabled(POLYGON_OFFSET_FILL), offset));
        gl::enable(POLYGON_OFFSET_FILL);
        gl::polygon_offset(offset[0] + NEARER.0, offset[1] + NEARER.1);
    }

    /// The driver has drawn, and the program goes on.
    pub(crate) fn finish_redraw(&mut self) {
        let Some((on, [factor, units])) = self.shadow_maps.kept.take() else {
            return;
        };
        gl::polygon_offset(factor, units);
        if !on {
            gl::disable(POLYGON_OFFSET_FILL);
        }
    }
}
