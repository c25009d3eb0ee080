//! VTK's own shadows: it draws surfaces as ever, then depths as lights see them, then all surfaces
//! again over themselves, with shadows.
//!
//! Drawing over needs depths that are equal to the last bit, which rays and the driver do not have.
//! So surfaces are the driver's where shadow maps are in use. The first frame tells that too late:
//! surfaces were traced before the first map was drawn. There the driver's second draw is moved a
//! little to the viewer.

use super::VtkPrograms;
use super::signature::SHADOW_MAP;
use crate::interpose::driver::gl;
use crate::state::enums::*;
use crate::state::snapshot::Snapshot;

/// Frames for which a shadow map is taken to be in use.
const IN_USE_FRAMES: u64 = 3;
/// How much nearer surfaces are drawn over traced ones: factor and units of polygon offset. A whole
/// factor would bring back faces before front faces at silhouettes.
const NEARER: (f32, f32) = (-1.0 / 64.0, -8.0);

/// Shadow maps of a context.
#[derive(Default)]
pub(super) struct ShadowMaps {
    /// The frame after which none is in use.
    until: u64,
    /// A surface was traced since.
    last_traced: Option<u64>,
    /// Polygon offset of the program's, while that of ours is set.
    kept: Option<(bool, [f32; 2])>,
}

impl VtkPrograms {
    /// Whether a surface can be traced that VTK may draw again; `signature` is what is known of its
    /// program.
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

    /// It has drawn, and the program goes on.
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
