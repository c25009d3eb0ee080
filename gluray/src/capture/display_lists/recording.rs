//! A display list while it is compiled.

use super::{DisplayList, ListOp};
use crate::interpose::calls::class;
use crate::interpose::driver::gl;

/// A list while it is compiled.
pub(crate) struct ListRecording {
    pub(super) name: u32,
    pub(super) execute: bool,
    pub(super) list: DisplayList,
    pub(super) segment: u32,
    pub(super) used: bool,
    pub(super) draws: bool,
    /// Something besides maps is in the driver's piece.
    pub(super) more: bool,
    /// A call that may change a texture is in it.
    pub(super) textures: bool,
    /// Between a Begin and its End.
    pub(super) open: bool,
    /// The mode of the latest Begin.
    pub(super) mode: u32,
}

impl ListRecording {
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
    pub(crate) fn stop_tracing(&mut self) {
        self.note_driver_call(class::ALL, true, true);
        self.open = false;
    }

    /// A call that sets a map of an evaluator goes into the driver's piece.
    pub(crate) fn note_map(&mut self) {
        self.used = true;
    }

    /// The driver's piece ends, and is a step of the list when anything is in it.
    pub(super) fn end_segment(&mut self) {
        gl::end_list();
        if self.used {
            let (list, draws, only_maps, textures) =
                (self.segment, self.draws, !self.more, self.textures);
            self.list.ops.push(ListOp::Driver { list, draws, only_maps, textures });
        }
        (self.used, self.draws, self.more, self.textures) = (false, false, false, false);
    }
}
