//! Lists as the driver would have them without us, for frames that are the driver's.
//!
//! Our stream and the driver's segments of a list are compiled once more, in their order, into
//! lists of the driver's. Calls of other lists stay calls, because those may change. A list with
//! parts of a primitive that others begin or end is not compiled: where it is called decides what
//! it does.

use super::{DisplayList, FIRST_SEGMENT, ListOp, evaluate_in_driver};
use crate::calls::class;
use crate::capture::ImmediateModeTarget;
use crate::capture::primitives::triangles_of;
use crate::driver::gl;
use crate::enums::COMPILE;
use crate::interpose::context::Context;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

/// A list, compiled by the driver.
#[derive(Debug, Default)]
pub(super) struct WholeList {
    parts: Vec<Part>,
    /// The driver's names for them.
    pub(super) names: Vec<u32>,
    draws: u32,
    triangles: u32,
    /// It may change textures.
    textures: bool,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Part {
    /// A list of the driver's.
    Compiled(u32),
    Call(u32),
    /// A name relative to the list base at the time of the call.
    CallFromBase(u32),
}

/// True when every primitive of the list begins and ends in it, without calls in between.
fn is_closed(ops: &[ListOp]) -> bool {
    let mut open = false;
    for op in ops {
        match op {
            ListOp::Begin(_) | ListOp::BeginArrays(_) if !open => open = true,
            ListOp::End if open => open = false,
            ListOp::Begin(_) | ListOp::BeginArrays(_) | ListOp::End => return false,
            ListOp::Call(_) | ListOp::CallFromBase(_) | ListOp::Driver { .. } if open => {
                return false;
            }
            _ => {}
        }
    }
    !open
}

impl DisplayList {
    /// Compiles the list. `next_name` gives the driver's names. Not to be called between Begin and
    /// End, and while the driver compiles another list.
    fn compile(&self, mut next_name: impl FnMut() -> u32) -> Option<WholeList> {
        if !is_closed(&self.ops) {
            return None;
        }
        let mut out = WholeList::default();
        let (mut compiling, mut mode, mut vertices) = (false, 0, 0);
        for op in &self.ops {
            let call = match *op {
                ListOp::Call(name) => Some(Part::Call(name)),
                ListOp::CallFromBase(name) => Some(Part::CallFromBase(name)),
                _ => None,
            };
            if let Some(call) = call {
                if std::mem::take(&mut compiling) {
                    gl::end_list();
                }
                out.parts.push(call);
                continue;
            }
            if !compiling {
                let name = next_name();
                out.names.push(name);
                out.parts.push(Part::Compiled(name));
                gl::new_list(name, COMPILE);
                compiling = true;
            }
            match *op {
                ListOp::Begin(m) | ListOp::BeginArrays(m) => (mode, vertices) = (m, 0),
                ListOp::Vertex(_) => vertices += 1,
                ListOp::End => {
                    out.draws += 1;
                    out.triangles += triangles_of(mode, vertices);
                }
                ListOp::Driver { textures, .. } => out.textures |= textures,
                _ => {}
            }
            self.send(op);
        }
        if compiling {
            gl::end_list();
        }
        Some(out)
    }

    /// Sends a step that is no call of another list to the driver.
    pub(super) fn send(&self, op: &ListOp) {
        match *op {
            ListOp::Begin(mode) | ListOp::BeginArrays(mode) => gl::begin(mode),
            ListOp::End => gl::end(),
            ListOp::Vertex(v) => gl::vertex4f(v[0], v[1], v[2], v[3]),
            ListOp::Normal(v) => gl::normal3f(v[0], v[1], v[2]),
            ListOp::Color(v) => gl::color4f(v[0], v[1], v[2], v[3]),
            ListOp::Tex(v) => gl::tex_coord4f(v[0], v[1], v[2], v[3]),
            ListOp::Material(at) => {
                let (face, what, v) = self.materials[at as usize];
                gl::materialfv(face, what, &v);
            }
            ListOp::Driver { list, .. } => gl::call_list(list),
            ListOp::Rect(v) => gl::rectf(v[0], v[1], v[2], v[3]),
            ListOp::EvalCoord(..) | ListOp::EvalPoint(..) | ListOp::EvalMesh(_) => {
                evaluate_in_driver(op);
            }
            ListOp::Call(_) | ListOp::CallFromBase(_) => {}
        }
    }
}

impl Context {
    /// Draws a list by the driver, in a frame of the driver's. False when it must be executed step
    /// by step.
    pub(super) fn call_whole(&mut self, list: &Arc<DisplayList>) -> bool {
        let outside = self.capture.immediate_target == ImmediateModeTarget::Outside;
        if !self.routing.is_drivers || !outside || !list.executed.swap(true, Relaxed) {
            return false;
        }
        self.attributes.sync();
        let lists = self.shared.lists_of_group();
        let next_name = || {
            let mut lists = lists.lock().unwrap_or_else(|e| e.into_inner());
            lists.next_segment += 1;
            FIRST_SEGMENT + lists.next_segment
        };
        let Some(whole) = list.whole.get_or_init(|| list.compile(next_name)) else { return false };
        for part in &whole.parts {
            match *part {
                Part::Compiled(name) => gl::call_list(name),
                Part::Call(name) => {
                    self.call_list(name);
                }
                Part::CallFromBase(name) => {
                    let base = gl::word(crate::enums::LIST_BASE);
                    self.call_list(base.wrapping_add(name));
                }
            }
        }
        self.routing.pass_list(whole.draws, whole.triangles);
        self.state.dirty = class::ALL;
        if whole.textures {
            self.shared.invalidate_textures();
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::enums::QUADS;

    #[test]
    fn only_lists_whose_primitives_are_whole_are_closed() {
        let (begin, end, vertex) = (ListOp::Begin(QUADS), ListOp::End, ListOp::Vertex([0.0; 4]));
        assert!(is_closed(&[]) && is_closed(&[ListOp::Call(3), begin, vertex, end]));
        for open in [
            &[begin, vertex][..],
            &[vertex, end],
            &[begin, begin, end],
            &[begin, ListOp::Call(3), end],
            &[end, begin],
        ] {
            assert!(!is_closed(open), "{open:?}");
        }
    }
}
