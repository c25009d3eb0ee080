//! Display lists: our own streams of immediate mode, with the driver's lists for everything else between them.
//!
//! While a list is compiled, attribute and vertex calls go into our stream and all other calls into a list of the driver's. Where they
//! alternate, the driver's list is closed and another begun; calling the list plays both in order, through the same methods that the
//! program calls. So state is what it is at the time of the call, nested lists work, and the driver gets a primitive only when it is to draw it.

pub(crate) mod names;

use crate::capture::evaluators::Kind;
use crate::interpose::context::{Context, Sink};
use crate::interpose::driver::gl;
use crate::interpose::symbols::{self, class};
use crate::state::current_attributes::Current;
use crate::state::enums::*;
use std::collections::HashMap;
use std::sync::Arc;

/// A step of a list.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Op {
    Begin(u32),
    /// The beginning of a draw of arrays, which is an error between Begin and End: then nothing of it is drawn.
    BeginArrays(u32),
    End,
    Vertex([f32; 4]),
    Normal([f32; 3]),
    Color([f32; 4]),
    Tex([f32; 4]),
    /// Index into the list's materials.
    Material(u32),
    /// A list of the driver's, whether it draws things whose order matters, and whether it sets maps of evaluators and nothing else.
    Driver {
        list: u32,
        draws: bool,
        only_maps: bool,
        /// It may change textures.
        textures: bool,
    },
    Call(u32),
    /// Names relative to the list base at the time of the call.
    CallFromBase(u32),
    Rect([f32; 4]),
    /// `glEvalCoord` of a curve, whose second parameter is nothing, or of a surface.
    EvalCoord(Kind, [f32; 2]),
    EvalPoint(Kind, [i32; 2]),
    /// A filled mesh.
    EvalMesh([i32; 4]),
}

/// A finished list.
#[derive(Debug, Default)]
pub(crate) struct List {
    ops: Vec<Op>,
    materials: Vec<(u32, u32, [f32; 4])>,
    /// The driver's lists beside the one of the same name.
    pieces: Vec<u32>,
}

/// The lists of a share group.
#[derive(Debug, Default)]
pub(crate) struct Lists {
    lists: HashMap<u32, Arc<List>>,
    next_piece: u32,
    /// The greatest name that the program has used or was given.
    greatest: u32,
}

/// Names of our pieces begin here: no program counts its lists so far.
const FIRST_PIECE: u32 = 0x4000_0000;

/// A list while it is compiled.
pub(crate) struct Recording {
    name: u32,
    execute: bool,
    list: List,
    piece: u32,
    used: bool,
    draws: bool,
    /// Something besides maps is in the driver's piece.
    more: bool,
    /// A call that may change a texture is in it.
    textures: bool,
    /// Between a Begin and its End.
    open: bool,
    /// The mode of the latest Begin.
    mode: u32,
}

impl Recording {
    /// Between a Begin and its End.
    pub(crate) fn is_open(&self) -> bool {
        self.open
    }

    /// A call goes into the driver's piece.
    pub(crate) fn note_driver_call(&mut self, class: u8, flushes: bool, draws: bool) {
        (self.used, self.more) = (true, true);
        self.draws |= flushes || draws;
        self.textures |= class & class::TEXTURE != 0;
    }

    /// A fault of ours has ended the tracing: the rest of the list is the driver's, to its end.
    pub(crate) fn give_up(&mut self) {
        self.note_driver_call(class::ALL, true, true);
        self.open = false;
    }

    /// A call that sets a map of an evaluator goes into the driver's piece.
    pub(crate) fn note_map(&mut self) {
        self.used = true;
    }

    /// The driver's piece ends, and is a step of the list when anything is in it.
    fn end_piece(&mut self) {
        gl::end_list();
        if self.used {
            let (list, draws, only_maps, textures) = (self.piece, self.draws, !self.more, self.textures);
            self.list.ops.push(Op::Driver { list, draws, only_maps, textures });
        }
        (self.used, self.draws, self.more, self.textures) = (false, false, false, false);
    }
}

const DEEPEST: u32 = 64;

impl Context {
    pub(crate) fn new_list(&mut self, name: u32, mode: u32) -> bool {
        if crate::interpose::panic_guard::happened() {
            // The driver's from now on.
            self.lists.lock().unwrap_or_else(|e| e.into_inner()).lists.remove(&name);
            return false;
        }
        if self.sink == Sink::Trace {
            self.unswallow("glNewList between Begin and End");
        }
        let wrong = name == 0 || self.recording.is_some() || self.sink == Sink::Pass;
        if wrong || !(mode == COMPILE || mode == COMPILE_AND_EXECUTE) || self.can.core {
            return false;
        }
        self.sync();
        gl::new_list(name, COMPILE);
        {
            let mut lists = self.lists.lock().unwrap_or_else(|e| e.into_inner());
            lists.greatest = lists.greatest.max(name);
            lists.next_piece = lists.next_piece.max(name.saturating_sub(FIRST_PIECE));
        }
        let execute = mode == COMPILE_AND_EXECUTE;
        self.recording = Some(Recording {
            name,
            execute,
            list: List::default(),
            piece: name,
            used: false,
            draws: false,
            more: false,
            textures: false,
            open: false,
            mode: 0,
        });
        self.sink = Sink::List;
        symbols::attend();
        true
    }

    pub(crate) fn end_list(&mut self) -> bool {
        if self.sink == Sink::Trace {
            self.unswallow("glEndList between Begin and End");
        }
        if self.recording.as_ref().is_some_and(|r| r.execute && r.open) {
            // What is compiled is also executed, and there a primitive is open.
            self.errors.push(INVALID_OPERATION);
            return true;
        }
        let Some(mut r) = self.recording.take() else { return false };
        r.end_piece();
        self.sink = Sink::Outside;
        let old = {
            let mut lists = self.lists.lock().unwrap_or_else(|e| e.into_inner());
            lists.lists.insert(r.name, Arc::new(r.list))
        };
        delete_pieces(old);
        if r.execute {
            self.call_list(r.name);
        }
        true
    }

    /// Puts a step of ours into the list; calls that went to the driver before it end their piece.
    pub(crate) fn list_op(&mut self, op: Op) -> bool {
        if self.recording.as_ref().is_some_and(|r| r.used) {
            self.close_piece();
            self.open_piece();
        }
        let Some(r) = &mut self.recording else { return false };
        r.list.ops.push(op);
        true
    }

    /// The driver's piece of the list that is compiled ends here.
    fn close_piece(&mut self) {
        if let Some(r) = &mut self.recording {
            r.end_piece();
        }
    }

    fn open_piece(&mut self) {
        let Some(r) = &mut self.recording else { return };
        let mut lists = self.lists.lock().unwrap_or_else(|e| e.into_inner());
        lists.next_piece += 1;
        r.piece = FIRST_PIECE + lists.next_piece;
        r.list.pieces.push(r.piece);
        gl::new_list(r.piece, COMPILE);
    }

    pub(crate) fn list_begin(&mut self, mode: u32) -> bool {
        if let Some(r) = &mut self.recording {
            (r.open, r.mode) = (true, mode);
        }
        self.element_arrays = None;
        self.list_op(Op::Begin(mode))
    }

    /// `glPrimitiveRestartNV`: an End, and a Begin of the same mode.
    pub(crate) fn primitive_restart(&mut self) -> bool {
        let mode = match self.sink {
            Sink::Trace => self.recorder.mode(),
            Sink::List => match &self.recording {
                Some(r) if r.open => r.mode,
                _ => return false,
            },
            Sink::Pass | Sink::Outside => return false,
        };
        self.end() && self.begin(mode)
    }

    /// Vertices of arrays follow.
    pub(crate) fn list_begin_arrays(&mut self, mode: u32) -> bool {
        self.list_op(Op::BeginArrays(mode))
    }

    pub(crate) fn list_end(&mut self) -> bool {
        if let Some(r) = &mut self.recording {
            r.open = false;
        }
        self.list_op(Op::End)
    }

    pub(crate) fn list_vertex(&mut self, v: [f32; 4]) -> bool {
        self.list_op(Op::Vertex(v))
    }

    pub(crate) fn list_normal(&mut self, v: [f32; 3]) -> bool {
        self.list_op(Op::Normal(v))
    }

    pub(crate) fn list_color(&mut self, v: [f32; 4]) -> bool {
        self.list_op(Op::Color(v))
    }

    pub(crate) fn list_tex(&mut self, v: [f32; 4]) -> bool {
        self.list_op(Op::Tex(v))
    }

    pub(crate) fn list_material(&mut self, face: u32, what: u32, v: [f32; 4]) -> bool {
        let Some(r) = &mut self.recording else { return false };
        let at = r.list.materials.len() as u32;
        r.list.materials.push((face, what, v));
        self.list_op(Op::Material(at))
    }

    /// A rectangle, a primitive of its own.
    pub(crate) fn list_rect(&mut self, v: [f32; 4]) -> bool {
        self.list_op(Op::Rect(v))
    }

    pub(crate) fn call_list(&mut self, name: u32) -> bool {
        if self.recording.is_some() {
            return self.list_op(Op::Call(name));
        }
        if crate::interpose::panic_guard::happened() {
            return self.play_plainly(name);
        }
        let known = self.lists.lock().unwrap_or_else(|e| e.into_inner()).lists.get(&name).cloned();
        let Some(list) = known else {
            // Not compiled by calls that we saw (fonts of glXUseXFont), or not there.
            self.call_driver(name, true, true);
            return true;
        };
        if self.depth_of_lists >= DEEPEST {
            return true;
        }
        // Quads in lists are split in another way than others: they are batches of their own.
        if self.depth_of_lists == 0 && self.recorder.quads && self.sink == Sink::Outside {
            self.end_batch();
        }
        self.depth_of_lists += 1;
        self.play(&list);
        if self.depth_of_lists == 1 && self.recorder.quads && self.sink == Sink::Outside {
            self.end_batch();
        }
        self.depth_of_lists -= 1;
        true
    }

    /// After a fault of ours: a list of ours into the driver as it is.
    fn play_plainly(&mut self, name: u32) -> bool {
        let known = self.lists.lock().unwrap_or_else(|e| e.into_inner()).lists.get(&name).cloned();
        let Some(list) = known.filter(|_| self.depth_of_lists < DEEPEST) else { return false };
        self.depth_of_lists += 1;
        for op in &list.ops {
            match *op {
                Op::Begin(mode) | Op::BeginArrays(mode) => gl::begin(mode),
                Op::End => gl::end(),
                Op::Vertex(v) => gl::vertex4f(v[0], v[1], v[2], v[3]),
                Op::Normal(v) => gl::normal3f(v[0], v[1], v[2]),
                Op::Color(v) => gl::color4f(v[0], v[1], v[2], v[3]),
                Op::Tex(v) => gl::tex_coord4f(v[0], v[1], v[2], v[3]),
                Op::Material(at) => {
                    let (face, what, v) = list.materials[at as usize];
                    gl::materialfv(face, what, &v);
                }
                Op::Driver { list, .. } => gl::call_list(list),
                Op::Call(name) => self.play_plainly_or_call(name),
                Op::CallFromBase(name) => self.play_plainly_or_call(gl::word(LIST_BASE).wrapping_add(name)),
                Op::Rect(v) => gl::rectf(v[0], v[1], v[2], v[3]),
                Op::EvalCoord(..) | Op::EvalPoint(..) | Op::EvalMesh(_) => evaluate_plainly(op),
            }
        }
        self.depth_of_lists -= 1;
        true
    }

    fn play_plainly_or_call(&mut self, name: u32) {
        if !self.play_plainly(name) {
            gl::call_list(name);
        }
    }

    fn call_driver(&mut self, list: u32, draws: bool, textures: bool) {
        if draws {
            self.counters.pass("text, lines by arrays, or curves of a display list", 1);
        }
        self.before_driver(draws, textures);
        gl::call_list(list);
    }

    /// The driver is about to play lists of its own.
    fn before_driver(&mut self, draws: bool, textures: bool) {
        if self.sink == Sink::Trace {
            self.unswallow("a list between Begin and End");
        }
        self.end_batch();
        if draws && self.sink == Sink::Outside {
            self.refresh();
            if crate::classify::rules::commutes(&self.state) {
                self.frame.others_drew();
            } else {
                self.flush("a display list of the driver's");
            }
        }
        self.sync();
        self.dirty = class::ALL;
        if textures {
            self.textures_change();
        }
    }

    fn play(&mut self, list: &List) {
        let mut left_out = false;
        let mut done = 0;
        // Arrays leave current values undefined, and Mesa as they were.
        let mut before_arrays: Option<Current> = None;
        for (i, op) in list.ops.iter().enumerate() {
            if i < done {
                continue;
            }
            if left_out {
                left_out = *op != Op::End;
                continue;
            }
            match *op {
                Op::BeginArrays(_) if self.sink != Sink::Outside => {
                    self.errors.push(INVALID_OPERATION);
                    left_out = true;
                }
                Op::Begin(mode) | Op::BeginArrays(mode) => {
                    let swallowed = self.begin(mode);
                    // Not earlier: Begin asks the driver what is current.
                    before_arrays = matches!(op, Op::BeginArrays(_)).then_some(self.current);
                    if !swallowed {
                        match self.play_quads(mode, list, &list.ops[i + 1..]) {
                            Some(n) => {
                                done = i + 1 + n;
                                self.go_back_to(before_arrays.take());
                            }
                            None => gl::begin(mode),
                        }
                    }
                }
                Op::End => {
                    if !self.end() {
                        gl::end();
                    }
                    self.go_back_to(before_arrays.take());
                }
                Op::Vertex(v) => {
                    if !self.vertex(v) {
                        gl::vertex4f(v[0], v[1], v[2], v[3]);
                    }
                }
                Op::Normal(v) => {
                    if !self.normal(v) {
                        gl::normal3f(v[0], v[1], v[2]);
                    }
                }
                Op::Color(v) => {
                    if !self.color(v) {
                        gl::color4f(v[0], v[1], v[2], v[3]);
                    }
                }
                Op::Tex(v) => {
                    if !self.tex_coord(v) {
                        gl::tex_coord4f(v[0], v[1], v[2], v[3]);
                    }
                }
                Op::Material(at) => {
                    let (face, what, v) = list.materials[at as usize];
                    if !self.material(face, what, v) {
                        gl::materialfv(face, what, &v);
                    }
                }
                Op::Driver { list, only_maps: true, .. } => {
                    self.maps_change();
                    gl::call_list(list);
                }
                Op::Driver { list, draws, textures, .. } => self.call_driver(list, draws, textures),
                Op::Call(name) => {
                    self.call_list(name);
                }
                Op::CallFromBase(name) => {
                    let base =
                        if self.sink == Sink::Pass { self.state.list_base } else { gl::word(LIST_BASE) };
                    self.call_list(base.wrapping_add(name));
                }
                Op::Rect(v) => {
                    if !self.rect(v) {
                        gl::rectf(v[0], v[1], v[2], v[3]);
                    }
                }
                Op::EvalCoord(kind, at) => {
                    if !self.eval_coord(kind, at) {
                        evaluate_plainly(op);
                    }
                }
                Op::EvalPoint(kind, places) => {
                    if !self.eval_point(kind, places) {
                        evaluate_plainly(op);
                    }
                }
                Op::EvalMesh(range) => {
                    if !self.eval_mesh_2(FILL, range) {
                        evaluate_plainly(op);
                    }
                }
            }
        }
    }

    /// Current values are what they were before arrays.
    fn go_back_to(&mut self, before: Option<Current>) {
        let Some(b) = before else { return };
        if b.normal != self.current.normal && !self.normal(b.normal) {
            gl::normal3f(b.normal[0], b.normal[1], b.normal[2]);
        }
        if b.color != self.current.color && !self.color(b.color) {
            gl::color4f(b.color[0], b.color[1], b.color[2], b.color[3]);
        }
        if b.tex != self.current.tex && !self.tex_coord(b.tex) {
            gl::tex_coord4f(b.tex[0], b.tex[1], b.tex[2], b.tex[3]);
        }
    }

    /// Quads of a list that the driver draws, as the triangles that it makes of quads in lists: it splits those of immediate mode along the
    /// other diagonal. Gives how many steps that were; `None` where a quad is more than two filled triangles, or more than vertices come.
    fn play_quads(&mut self, mode: u32, list: &List, ops: &[Op]) -> Option<usize> {
        let filled = self.state.polygon_mode == [FILL; 2];
        if mode != QUADS || !filled || self.sink != Sink::Pass || self.state.program != 0 {
            return None;
        }
        let plain = |op: &Op| {
            matches!(op, Op::Vertex(_) | Op::Normal(_) | Op::Color(_) | Op::Tex(_) | Op::Material(_))
        };
        let n = ops.iter().position(|op| !plain(op)).filter(|n| ops[*n] == Op::End)?;
        gl::begin(TRIANGLES);
        let mut corners = Vec::with_capacity(4);
        let mut sent = self.current;
        for op in &ops[..n] {
            match *op {
                Op::Normal(v) => self.current.normal = v,
                Op::Color(v) => self.current.color = v,
                Op::Tex(v) => self.current.tex = v,
                Op::Material(at) => {
                    let (face, what, v) = list.materials[at as usize];
                    self.material(face, what, v);
                }
                Op::Vertex(v) => corners.push((v, self.current)),
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
        self.current.send_changes(&sent);
        gl::end();
        self.end();
        Some(n + 1)
    }

    pub(crate) fn call_lists(&mut self, kind: u32, names: &[u8]) -> bool {
        let Some(names) = names::decode(kind, names) else { return false };
        if crate::interpose::panic_guard::happened() {
            let base = gl::word(LIST_BASE);
            names.into_iter().for_each(|n| self.play_plainly_or_call(base.wrapping_add(n)));
            return true;
        }
        if self.recording.is_some() {
            for name in names {
                self.list_op(Op::CallFromBase(name));
            }
            return true;
        }
        // Between Begin and End of a primitive that the driver draws it answers no questions.
        let base = if self.sink == Sink::Pass { self.state.list_base } else { gl::word(LIST_BASE) };
        let ours = {
            let lists = self.lists.lock().unwrap_or_else(|e| e.into_inner());
            names.iter().any(|n| lists.lists.contains_key(&base.wrapping_add(*n)))
        };
        if !ours {
            // A line of text in a font of glXUseXFont: one call for the driver.
            self.before_driver(true, true);
            return false;
        }
        for name in names {
            self.call_list(base.wrapping_add(name));
        }
        true
    }

    /// Forgets our part; the driver then deletes its own.
    pub(crate) fn delete_lists(&mut self, first: u32, n: i32) -> bool {
        if self.sink == Sink::Trace {
            self.unswallow("glDeleteLists between Begin and End");
        }
        let range = first..first.saturating_add(n.max(0).cast_unsigned());
        let gone: Vec<_> = {
            let mut lists = self.lists.lock().unwrap_or_else(|e| e.into_inner());
            // Few steps, whether the program names few lists or many that are not there.
            match lists.lists.len() < range.len() {
                true => {
                    lists.lists.extract_if(|name, _| range.contains(name)).map(|(_, list)| list).collect()
                }
                false => range.filter_map(|name| lists.lists.remove(&name)).collect(),
            }
        };
        gone.into_iter().for_each(|list| delete_pieces(Some(list)));
        false
    }
}

/// A step by evaluators, for the driver.
fn evaluate_plainly(op: &Op) {
    match *op {
        Op::EvalCoord(Kind::Curve, [u, _]) => gl::eval_coord1f(u),
        Op::EvalCoord(Kind::Surface, [u, v]) => gl::eval_coord2f(u, v),
        Op::EvalPoint(Kind::Curve, [i, _]) => gl::eval_point1(i),
        Op::EvalPoint(Kind::Surface, [i, j]) => gl::eval_point2(i, j),
        Op::EvalMesh([i1, i2, j1, j2]) => gl::eval_mesh2(FILL, i1, i2, j1, j2),
        _ => {}
    }
}

fn delete_pieces(list: Option<Arc<List>>) {
    for piece in list.iter().flat_map(|l| &l.pieces) {
        gl::delete_lists(*piece, 1);
    }
}
