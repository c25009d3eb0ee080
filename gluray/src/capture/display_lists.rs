//! Display lists: our own streams of immediate mode, alternating with lists of the driver's for all
//! other calls.
//!
//! While a list is compiled, attribute and vertex calls go into our stream and all other calls into
//! a list of the driver's. Where they alternate, the driver's list is closed and another one begun.
//! A call of the list executes both in order, through the same methods that the program calls. So
//! the state is that at the time of the call, nested lists work, and the driver gets a primitive
//! only when it must draw it. In frames that are the driver's, it draws lists of its own (`whole`).

pub(crate) mod names;
mod recording;
mod whole;

pub(crate) use recording::ListRecording;

use crate::capture::ImmediateModeTarget;
use crate::capture::evaluators::MapKind;
use crate::driver::gl;
use crate::enums::*;
use crate::interpose::context::Context;
use crate::state::current_attributes::CurrentAttributes;
use crate::watched_calls;
use std::collections::HashMap;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};
use whole::WholeList;

/// A step of a list.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum ListOp {
    Begin(u32),
    /// The beginning of a draw of arrays. Between Begin and End it is an error, and nothing of the
    /// draw is drawn.
    BeginArrays(u32),
    End,
    Vertex([f32; 4]),
    Normal([f32; 3]),
    Color([f32; 4]),
    Tex([f32; 4]),
    /// An index into the list's materials.
    Material(u32),
    /// A list of the driver's, with two flags: it draws things whose order matters, and it only
    /// sets maps of evaluators.
    Driver {
        list: u32,
        draws: bool,
        only_maps: bool,
        /// It may change textures.
        textures: bool,
    },
    Call(u32),
    /// A name relative to the list base at the time of the call.
    CallFromBase(u32),
    Rect([f32; 4]),
    /// `glEvalCoord` of a curve, whose second parameter is unused, or of a surface.
    EvalCoord(MapKind, [f32; 2]),
    EvalPoint(MapKind, [i32; 2]),
    /// A filled mesh.
    EvalMesh([i32; 4]),
}

/// A finished list.
#[derive(Debug, Default)]
pub(crate) struct DisplayList {
    ops: Vec<ListOp>,
    materials: Vec<(u32, u32, [f32; 4])>,
    /// The driver's lists other than the one of the same name.
    segments: Vec<u32>,
    /// The list as the driver alone would have it, once it was drawn so. `None` inside for lists
    /// that cannot be.
    whole: OnceLock<Option<WholeList>>,
    /// It was executed in a frame of the driver's. What is called once is not worth compiling.
    executed: AtomicBool,
}

/// The lists of a share group.
#[derive(Debug, Default)]
pub(crate) struct DisplayLists {
    lists: HashMap<u32, Arc<DisplayList>>,
    next_segment: u32,
    /// The greatest name that the program has used or was given.
    greatest: u32,
}

/// The names of our segments begin here. No program counts its lists so far.
const FIRST_SEGMENT: u32 = 0x4000_0000;

const DEEPEST: u32 = 64;

impl Context {
    /// True when lists are the driver's from now on, and ours are only executed.
    fn leaves_lists_to_driver(&self) -> bool {
        self.bypassed || crate::faults::happened()
    }

    pub(crate) fn new_list(&mut self, name: u32, mode: u32) -> bool {
        if self.leaves_lists_to_driver() {
            // The name now belongs to the driver.
            let mut lists = self.shared.lists();
            lists.lists.remove(&name);
            lists.greatest = lists.greatest.max(name);
            return false;
        }
        if self.capture.immediate_target == ImmediateModeTarget::Trace {
            self.replay_to_driver("glNewList between Begin and End");
        }
        let wrong = name == 0
            || self.capture.recording.is_some()
            || self.capture.immediate_target == ImmediateModeTarget::Pass;
        if wrong || !(mode == COMPILE || mode == COMPILE_AND_EXECUTE) || self.capabilities.core {
            return false;
        }
        self.attributes.sync();
        gl::new_list(name, COMPILE);
        {
            let mut lists = self.shared.lists();
            lists.greatest = lists.greatest.max(name);
            lists.next_segment = lists.next_segment.max(name.saturating_sub(FIRST_SEGMENT));
        }
        let execute = mode == COMPILE_AND_EXECUTE;
        let lists = self.shared.lists_of_group();
        self.capture.recording = Some(ListRecording::new(name, execute, lists));
        self.capture.immediate_target = ImmediateModeTarget::List;
        watched_calls::arm();
        true
    }

    pub(crate) fn end_list(&mut self) -> bool {
        if self.capture.immediate_target == ImmediateModeTarget::Trace {
            self.replay_to_driver("glEndList between Begin and End");
        }
        if self.capture.recording.as_ref().is_some_and(|r| r.execute && r.open) {
            // The list is also executed while it is compiled, and there a primitive is open.
            self.errors.push(INVALID_OPERATION);
            return true;
        }
        let Some(mut r) = self.capture.recording.take() else { return false };
        r.end_segment();
        self.capture.immediate_target = ImmediateModeTarget::Outside;
        let old = {
            let mut lists = self.shared.lists();
            lists.lists.insert(r.name, Arc::new(r.list))
        };
        delete_segments(old);
        if r.execute {
            self.call_list(r.name);
        }
        true
    }

    /// `glPrimitiveRestartNV`: an End, and a Begin of the same mode.
    pub(crate) fn primitive_restart(&mut self) -> bool {
        let mode = match self.capture.immediate_target {
            ImmediateModeTarget::Trace => self.capture.recorder.mode(),
            ImmediateModeTarget::List => match &self.capture.recording {
                Some(r) if r.open => r.mode,
                _ => return false,
            },
            ImmediateModeTarget::Pass | ImmediateModeTarget::Outside => return false,
        };
        self.end() && self.begin(mode)
    }

    pub(crate) fn call_list(&mut self, name: u32) -> bool {
        if self.capture.recording.is_some() {
            return self.capture.list_op(ListOp::Call(name));
        }
        if self.leaves_lists_to_driver() {
            return self.execute_in_driver(name);
        }
        let known = self.shared.lists().lists.get(&name).cloned();
        let Some(list) = known else {
            // Unknown, or compiled by calls that we did not see (fonts of glXUseXFont).
            self.call_driver(name, true, true);
            return true;
        };
        if self.capture.depth_of_lists >= DEEPEST {
            return true;
        }
        // Quads in lists are split along the other diagonal than other quads, so they are batches
        // of their own.
        if self.capture.depth_of_lists == 0
            && self.capture.recorder.quads
            && self.capture.immediate_target == ImmediateModeTarget::Outside
        {
            self.end_batch();
        }
        self.capture.depth_of_lists += 1;
        if !self.call_whole(&list) {
            self.execute(&list);
        }
        if self.capture.depth_of_lists == 1
            && self.capture.recorder.quads
            && self.capture.immediate_target == ImmediateModeTarget::Outside
        {
            self.end_batch();
        }
        self.capture.depth_of_lists -= 1;
        true
    }

    /// Sends one of our lists to the driver, after a fault.
    fn execute_in_driver(&mut self, name: u32) -> bool {
        let known = self.shared.lists().lists.get(&name).cloned();
        let Some(list) = known.filter(|_| self.capture.depth_of_lists < DEEPEST) else {
            return false;
        };
        self.capture.depth_of_lists += 1;
        for op in &list.ops {
            match *op {
                ListOp::Call(name) => self.execute_in_driver_or_call(name),
                ListOp::CallFromBase(name) => {
                    self.execute_in_driver_or_call(gl::word(LIST_BASE).wrapping_add(name))
                }
                _ => list.send(op),
            }
        }
        self.capture.depth_of_lists -= 1;
        true
    }

    fn execute_in_driver_or_call(&mut self, name: u32) {
        if !self.execute_in_driver(name) {
            gl::call_list(name);
        }
    }

    fn call_driver(&mut self, list: u32, draws: bool, textures: bool) {
        if draws {
            self.counters
                .count_driver_draws("text, lines by arrays, or curves of a display list", 1);
        }
        self.before_driver_list(draws, textures);
        gl::call_list(list);
    }

    fn execute(&mut self, list: &DisplayList) {
        let mut left_out = false;
        let mut done = 0;
        // After a draw of arrays the current values are undefined. Mesa leaves them as they were.
        let mut before_arrays: Option<CurrentAttributes> = None;
        for (i, op) in list.ops.iter().enumerate() {
            if i < done {
                continue;
            }
            if left_out {
                left_out = *op != ListOp::End;
                continue;
            }
            match *op {
                ListOp::BeginArrays(_)
                    if self.capture.immediate_target != ImmediateModeTarget::Outside =>
                {
                    self.errors.push(INVALID_OPERATION);
                    left_out = true;
                }
                ListOp::Begin(mode) | ListOp::BeginArrays(mode) => {
                    let swallowed = self.begin(mode);
                    // Not earlier: Begin queries the current values.
                    before_arrays =
                        matches!(op, ListOp::BeginArrays(_)).then_some(self.attributes.current);
                    if !swallowed {
                        match self.execute_quads(mode, list, &list.ops[i + 1..]) {
                            Some(n) => {
                                done = i + 1 + n;
                                self.restore_current_attributes(before_arrays.take());
                            }
                            None => gl::begin(mode),
                        }
                    }
                }
                ListOp::End => {
                    if !self.end() {
                        gl::end();
                    }
                    self.restore_current_attributes(before_arrays.take());
                }
                ListOp::Vertex(v) => {
                    if !self.vertex(v) {
                        gl::vertex4f(v[0], v[1], v[2], v[3]);
                    }
                }
                ListOp::Normal(v) => {
                    if !self.normal(v) {
                        gl::normal3f(v[0], v[1], v[2]);
                    }
                }
                ListOp::Color(v) => {
                    if !self.color(v) {
                        gl::color4f(v[0], v[1], v[2], v[3]);
                    }
                }
                ListOp::Tex(v) => {
                    if !self.tex_coord(v) {
                        gl::tex_coord4f(v[0], v[1], v[2], v[3]);
                    }
                }
                ListOp::Material(at) => {
                    let (face, what, v) = list.materials[at as usize];
                    if !self.material(face, what, v) {
                        gl::materialfv(face, what, &v);
                    }
                }
                ListOp::Driver { list, only_maps: true, .. } => {
                    self.invalidate_maps();
                    gl::call_list(list);
                }
                ListOp::Driver { list, draws, textures, .. } => {
                    self.call_driver(list, draws, textures)
                }
                ListOp::Call(name) => {
                    self.call_list(name);
                }
                ListOp::CallFromBase(name) => {
                    let base = if self.capture.immediate_target == ImmediateModeTarget::Pass {
                        self.state.snapshot.list_base
                    } else {
                        gl::word(LIST_BASE)
                    };
                    self.call_list(base.wrapping_add(name));
                }
                ListOp::Rect(v) => {
                    if !self.rect(v) {
                        gl::rectf(v[0], v[1], v[2], v[3]);
                    }
                }
                ListOp::EvalCoord(kind, at) => {
                    if !self.eval_coord(kind, at) {
                        evaluate_in_driver(op);
                    }
                }
                ListOp::EvalPoint(kind, places) => {
                    if !self.eval_point(kind, places) {
                        evaluate_in_driver(op);
                    }
                }
                ListOp::EvalMesh(range) => {
                    if !self.eval_mesh_2(FILL, range) {
                        evaluate_in_driver(op);
                    }
                }
            }
        }
    }

    /// Restores the current values from before a draw of arrays.
    fn restore_current_attributes(&mut self, before: Option<CurrentAttributes>) {
        let Some(b) = before else { return };
        if b.normal != self.attributes.current.normal && !self.normal(b.normal) {
            gl::normal3f(b.normal[0], b.normal[1], b.normal[2]);
        }
        if b.color != self.attributes.current.color && !self.color(b.color) {
            gl::color4f(b.color[0], b.color[1], b.color[2], b.color[3]);
        }
        if b.tex != self.attributes.current.tex && !self.tex_coord(b.tex) {
            gl::tex_coord4f(b.tex[0], b.tex[1], b.tex[2], b.tex[3]);
        }
    }

    /// Sends the quads of a list to the driver as the triangles that it makes of quads in lists. In
    /// immediate mode it splits quads along the other diagonal. Returns the number of steps, or
    /// `None` when a quad is not just two filled triangles, or when other calls than vertices and
    /// attributes come.
    fn execute_quads(&mut self, mode: u32, list: &DisplayList, ops: &[ListOp]) -> Option<usize> {
        let filled = self.state.snapshot.polygon_mode == [FILL; 2];
        if mode != QUADS
            || !filled
            || self.capture.immediate_target != ImmediateModeTarget::Pass
            || self.state.snapshot.program != 0
        {
            return None;
        }
        let plain = |op: &ListOp| {
            matches!(
                op,
                ListOp::Vertex(_)
                    | ListOp::Normal(_)
                    | ListOp::Color(_)
                    | ListOp::Tex(_)
                    | ListOp::Material(_)
            )
        };
        let n = ops.iter().position(|op| !plain(op)).filter(|n| ops[*n] == ListOp::End)?;
        gl::begin(TRIANGLES);
        let mut corners = Vec::with_capacity(4);
        let mut sent = self.attributes.current;
        for op in &ops[..n] {
            match *op {
                ListOp::Normal(v) => self.attributes.current.normal = v,
                ListOp::Color(v) => self.attributes.current.color = v,
                ListOp::Tex(v) => self.attributes.current.tex = v,
                ListOp::Material(at) => {
                    let (face, what, v) = list.materials[at as usize];
                    self.material(face, what, v);
                }
                ListOp::Vertex(v) => corners.push((v, self.attributes.current)),
                _ => {}
            }
            if let [a, b, c, d] = corners[..] {
                for (v, current) in [a, b, d, b, c, d] {
                    current.send_changes(&sent);
                    sent = current;
                    gl::vertex4f(v[0], v[1], v[2], v[3]);
                }
                corners.clear();
            }
        }
        self.attributes.current.send_changes(&sent);
        gl::end();
        self.end();
        Some(n + 1)
    }

    pub(crate) fn call_lists(&mut self, kind: u32, names: &[u8]) -> bool {
        let Some(names) = names::decode(kind, names) else { return false };
        if self.bypassed && self.shared.lists().lists.is_empty() {
            return false;
        }
        if self.leaves_lists_to_driver() {
            let base = gl::word(LIST_BASE);
            names.into_iter().for_each(|n| self.execute_in_driver_or_call(base.wrapping_add(n)));
            return true;
        }
        if self.capture.recording.is_some() {
            for name in names {
                self.capture.list_op(ListOp::CallFromBase(name));
            }
            return true;
        }
        // Between Begin and End of a primitive that the driver draws, it answers no queries.
        let base = if self.capture.immediate_target == ImmediateModeTarget::Pass {
            self.state.snapshot.list_base
        } else {
            gl::word(LIST_BASE)
        };
        let ours = {
            let lists = self.shared.lists();
            names.iter().any(|n| lists.lists.contains_key(&base.wrapping_add(*n)))
        };
        if !ours {
            // A line of text in a font of glXUseXFont is one call for the driver.
            self.before_driver_list(true, true);
            return false;
        }
        for name in names {
            self.call_list(base.wrapping_add(name));
        }
        true
    }

    /// `glGenLists`. The driver would give the names after the greatest that is in use, which is
    /// that of a segment of ours. Programs that count their lists (Survex's aven) end there. So
    /// they get the names after the greatest of their own, as Mesa gives them, and an empty list of
    /// the driver's for each. `None` leaves the call to the driver.
    pub(crate) fn gen_lists(&mut self, n: i32) -> Option<u32> {
        if self.capture.immediate_target == ImmediateModeTarget::Trace {
            self.replay_to_driver("glGenLists between Begin and End");
        }
        if self.capture.immediate_target == ImmediateModeTarget::Pass
            || self.capabilities.core
            || crate::faults::happened()
        {
            return None;
        }
        let first = self.shared.lists().reserve_names(n)?;
        // While a list is compiled, its segment ends first.
        if let Some(r) = &mut self.capture.recording {
            r.end_segment();
        }
        for name in first..first + n.cast_unsigned() {
            gl::new_list(name, COMPILE);
            gl::end_list();
        }
        if let Some(r) = &mut self.capture.recording {
            r.begin_segment();
        }
        Some(first)
    }

    /// The driver has given these names while nothing was done. Those given later are greater.
    pub(crate) fn note_names(&mut self, first: u32, n: i32) {
        if self.bypassed && first != 0 {
            let last = first.saturating_add(n.max(1).cast_unsigned() - 1);
            let mut lists = self.shared.lists();
            lists.greatest = lists.greatest.max(last.min(FIRST_SEGMENT - 1));
        }
    }

    /// Removes our part. The driver then deletes its own.
    pub(crate) fn delete_lists(&mut self, first: u32, n: i32) -> bool {
        if self.capture.immediate_target == ImmediateModeTarget::Trace {
            self.replay_to_driver("glDeleteLists between Begin and End");
        }
        let range = first..first.saturating_add(n.max(0).cast_unsigned());
        let gone: Vec<_> = {
            let mut lists = self.shared.lists();
            // Takes the shorter loop, whether the program names few lists or many that do not
            // exist.
            match lists.lists.len() < range.len() {
                true => lists
                    .lists
                    .extract_if(|name, _| range.contains(name))
                    .map(|(_, list)| list)
                    .collect(),
                false => range.filter_map(|name| lists.lists.remove(&name)).collect(),
            }
        };
        gone.into_iter().for_each(|list| delete_segments(Some(list)));
        false
    }
}

/// Sends a step of evaluators to the driver.
fn evaluate_in_driver(op: &ListOp) {
    match *op {
        ListOp::EvalCoord(MapKind::Curve, [u, _]) => gl::eval_coord1f(u),
        ListOp::EvalCoord(MapKind::Surface, [u, v]) => gl::eval_coord2f(u, v),
        ListOp::EvalPoint(MapKind::Curve, [i, _]) => gl::eval_point1(i),
        ListOp::EvalPoint(MapKind::Surface, [i, j]) => gl::eval_point2(i, j),
        ListOp::EvalMesh([i1, i2, j1, j2]) => gl::eval_mesh2(FILL, i1, i2, j1, j2),
        _ => {}
    }
}

fn delete_segments(list: Option<Arc<DisplayList>>) {
    for list in list.iter() {
        let whole = list.whole.get().into_iter().flatten().flat_map(|w| &w.names);
        list.segments.iter().chain(whole).for_each(|name| gl::delete_lists(*name, 1));
    }
}
