//! `glArrayElement`: a vertex of the arrays between Begin and End.

use crate::capture::ImmediateModeTarget;
use crate::capture::vertex_arrays::VertexArrays;
use crate::interpose::client_memory::{ActiveCall, ArraySource, Elements};
use crate::interpose::context::Context;

impl Context {
    /// The values of element `i` become current. They also make a vertex of the primitive that is
    /// recorded or compiled.
    pub(crate) fn array_element(&mut self, call: &ActiveCall<'_>) -> bool {
        match self.capture.immediate_target {
            ImmediateModeTarget::Trace => {}
            ImmediateModeTarget::List
                if self.capture.recording.as_ref().is_some_and(|r| r.is_open()) => {}
            ImmediateModeTarget::List => {
                self.capture.list_driver_call(false, true);
                return false;
            }
            ImmediateModeTarget::Pass => return false,
            // Only the current values change.
            ImmediateModeTarget::Outside => {
                self.state.mark_current(&self.capabilities);
                return false;
            }
        }
        let why = match self.take_element(call) {
            Ok(taken) => return taken,
            Err(why) => why,
        };
        match self.capture.immediate_target {
            ImmediateModeTarget::Trace => self.replay_to_driver(why),
            _ => self.capture.list_driver_call(false, true),
        }
        false
    }

    fn take_element(&mut self, call: &ActiveCall<'_>) -> Result<bool, &'static str> {
        let element = Elements::of(call, None)?;
        // Nothing about arrays can change before End.
        let arrays = match self.capture.element_arrays {
            Some(arrays) => arrays,
            None => {
                *self.capture.element_arrays.insert(VertexArrays::query(self.capabilities.version)?)
            }
        };
        let [normal, color, tex] = [arrays.normal, arrays.color, arrays.tex];
        let position = value(arrays.position, &element)?;
        let [normal, color, tex] =
            [of(normal, &element)?, of(color, &element)?, of(tex, &element)?];
        if let Some([x, y, z, _]) = normal {
            self.normal([x, y, z]);
        }
        if let Some(c) = color {
            self.color(c);
        }
        if let Some(t) = tex {
            self.tex_coord(t);
        }
        Ok(self.vertex(position))
    }
}

fn of(source: Option<ArraySource>, i: &Elements<'_>) -> Result<Option<[f32; 4]>, &'static str> {
    source.map(|s| value(s, i)).transpose()
}

fn value(source: ArraySource, i: &Elements<'_>) -> Result<[f32; 4], &'static str> {
    Ok(source.read(i)?.at(0, [0.0, 0.0, 0.0, 1.0]))
}
