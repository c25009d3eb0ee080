//! A display list while it is compiled.

use super::{DisplayList, DisplayLists, FIRST_SEGMENT, ListOp};
use crate::calls::class;
use crate::capture::Capture;
use crate::capture::evaluators::MapKind;
use crate::driver::gl;
use crate::enums::COMPILE;
use std::sync::{Arc, Mutex};

/// A list while it is compiled.
pub(crate) struct ListRecording {
    pub(super) name: u32,
    pub(super) execute: bool,
    pub(super) list: DisplayList,
    /// The lists of the share group, which number the driver's segments.
    lists: Arc<Mutex<DisplayLists>>,
    /// The driver's list that is being compiled.
    segment: u32,
    /// Something is in the driver's segment.
    used: bool,
    /// Something in it draws.
    draws: bool,
    /// Something besides maps is in it.
    more: bool,
    /// A call that may change a texture is in it.
    textures: bool,
    /// Between a Begin and its End.
    pub(super) open: bool,
    /// The mode of the latest Begin.
    pub(super) mode: u32,
}

impl ListRecording {
    /// A new list, whose first segment is the driver's list of the same name.
    pub(super) fn new(name: u32, execute: bool, lists: Arc<Mutex<DisplayLists>>) -> ListRecording {
        ListRecording {
            name,
            execute,
            list: DisplayList::default(),
            lists,
            segment: name,
            used: false,
            draws: false,
            more: false,
            textures: false,
            open: false,
            mode: 0,
        }
    }

    /// Between a Begin and its End.
    pub(crate) fn is_open(&self) -> bool {
        self.open
    }

    /// A call goes into the driver's segment.
    pub(crate) fn note_driver_call(&mut self, classes: u8, flushes: bool, draws: bool) {
        (self.used, self.more) = (true, true);
        self.draws |= flushes || draws;
        self.textures |= classes & class::TEXTURE != 0;
    }

    /// A fault of ours has ended the tracing: the rest of the list is the driver's, to its end.
    pub(crate) fn stop_tracing(&mut self) {
        self.note_driver_call(class::ALL, true, true);
        self.open = false;
    }

    /// A call that sets a map of an evaluator goes into the driver's segment.
    pub(crate) fn note_map(&mut self) {
        self.used = true;
    }

    /// True while attributes belong to the driver's segment: state was changed there and no
    /// primitive has come since. Mesa's material depends on the order of `glColorMaterial` and
    /// colours in one list, and splitting the list would change that order.
    fn attributes_are_the_drivers(&self) -> bool {
        self.used && self.more && !self.open
    }

    /// Adds a step of ours. Calls that went to the driver before it end their segment.
    fn push(&mut self, op: ListOp) {
        if self.used {
            self.end_segment();
            self.begin_segment();
        }
        self.list.ops.push(op);
    }

    /// The driver's segment ends, and is a step of the list when anything is in it.
    pub(super) fn end_segment(&mut self) {
        gl::end_list();
        if self.used {
            let (list, draws, only_maps, textures) =
                (self.segment, self.draws, !self.more, self.textures);
            self.list.ops.push(ListOp::Driver { list, draws, only_maps, textures });
        }
        (self.used, self.draws, self.more, self.textures) = (false, false, false, false);
    }

    /// The driver compiles another segment.
    pub(super) fn begin_segment(&mut self) {
        let mut lists = self.lists.lock().unwrap_or_else(|e| e.into_inner());
        lists.next_segment += 1;
        self.segment = FIRST_SEGMENT + lists.next_segment;
        self.list.segments.push(self.segment);
        gl::new_list(self.segment, COMPILE);
    }
}

/// Steps of the list that is compiled. They are false without one.
impl Capture {
    pub(crate) fn list_op(&mut self, op: ListOp) -> bool {
        let Some(r) = &mut self.recording else { return false };
        r.push(op);
        true
    }

    /// The same for an attribute; false when the driver compiles it.
    fn list_attribute(&mut self, op: ListOp) -> bool {
        let Some(r) = self.recording.as_mut().filter(|r| !r.attributes_are_the_drivers()) else {
            return false;
        };
        r.push(op);
        true
    }

    pub(crate) fn list_begin(&mut self, mode: u32) -> bool {
        if let Some(r) = &mut self.recording {
            (r.open, r.mode) = (true, mode);
        }
        self.element_arrays = None;
        self.list_op(ListOp::Begin(mode))
    }

    /// Vertices of arrays follow.
    pub(crate) fn list_begin_arrays(&mut self, mode: u32) -> bool {
        self.list_op(ListOp::BeginArrays(mode))
    }

    pub(crate) fn list_end(&mut self) -> bool {
        if let Some(r) = &mut self.recording {
            r.open = false;
        }
        self.list_op(ListOp::End)
    }

    pub(crate) fn list_vertex(&mut self, v: [f32; 4]) -> bool {
        self.list_op(ListOp::Vertex(v))
    }

    pub(crate) fn list_normal(&mut self, v: [f32; 3]) -> bool {
        self.list_attribute(ListOp::Normal(v))
    }

    pub(crate) fn list_color(&mut self, v: [f32; 4]) -> bool {
        self.list_attribute(ListOp::Color(v))
    }

    pub(crate) fn list_tex(&mut self, v: [f32; 4]) -> bool {
        self.list_attribute(ListOp::Tex(v))
    }

    pub(crate) fn list_material(&mut self, face: u32, what: u32, v: [f32; 4]) -> bool {
        let Some(r) = self.recording.as_mut().filter(|r| !r.attributes_are_the_drivers()) else {
            return false;
        };
        let at = r.list.materials.len() as u32;
        r.list.materials.push((face, what, v));
        self.list_op(ListOp::Material(at))
    }

    /// A rectangle, which is a primitive of its own.
    pub(crate) fn list_rect(&mut self, v: [f32; 4]) -> bool {
        self.list_op(ListOp::Rect(v))
    }

    pub(crate) fn list_eval_coord(&mut self, kind: MapKind, at: [f32; 2]) -> bool {
        self.list_op(ListOp::EvalCoord(kind, at))
    }

    pub(crate) fn list_eval_point(&mut self, kind: MapKind, places: [i32; 2]) -> bool {
        self.list_op(ListOp::EvalPoint(kind, places))
    }

    /// A filled mesh.
    pub(crate) fn list_eval_mesh(&mut self, range: [i32; 4]) -> bool {
        self.list_op(ListOp::EvalMesh(range))
    }

    /// A call that is not taken apart goes into the driver's segment of the list that is compiled.
    pub(crate) fn list_driver_call(&mut self, flushes: bool, draws: bool) {
        if let Some(r) = &mut self.recording {
            r.note_driver_call(0, flushes, draws);
        }
    }
}
