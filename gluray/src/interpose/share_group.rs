//! What the contexts of a share group have in common, and when one of them sees what another has
//! done to a texture.
//!
//! Images of textures are read again when the group's count of writes is another. A context counts
//! before the driver makes a write. That is enough for itself, but not for the others: one of them
//! may read between the count and the write, or before the write has got out of the writer's queue.
//! OpenGL promises a write to another context after the writer has finished (or flushed, or the
//! reader has waited for a fence) and the reader has bound the texture again (OpenGL 4.6, section
//! 5.3), so at these points the writer (or the reader that waited) counts once more: what was read
//! before has another number then.
//!
//! What is drawn into a texture is not told of draw by draw. While a framebuffer object is bound
//! those same points count it.

use crate::capture::ImmediateModeTarget;
use crate::capture::buffer_writes::BufferWrites;
use crate::capture::display_lists::DisplayLists;
use crate::interpose::calls::{self, class};
use crate::interpose::context::Context;
use crate::interpose::driver::gl;
use crate::state::enums::*;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// What the contexts of a share group have in common.
#[derive(Clone, Default)]
pub(crate) struct ShareGroup {
    pub(crate) lists: Arc<Mutex<DisplayLists>>,
    pub(crate) writes: Arc<Mutex<BufferWrites>>,
    pub(crate) texture_writes: TextureWrites,
}

/// The objects that a context shares with others.
pub(crate) struct SharedObjects {
    pub(crate) lists: Arc<Mutex<DisplayLists>>,
    pub(crate) writes: Arc<Mutex<BufferWrites>>,
    pub(crate) texture_writes: TextureWrites,
    /// This context may have written a texture since it last let others see what it wrote.
    pub(crate) wrote_textures: bool,
    /// The creation of this context was seen, so it is known which contexts share with it.
    pub(crate) seen_created: bool,
}

impl SharedObjects {
    pub(crate) fn new(group: ShareGroup, seen_created: bool) -> SharedObjects {
        let ShareGroup { lists, writes, texture_writes } = group;
        SharedObjects { lists, writes, texture_writes, wrote_textures: false, seen_created }
    }
}

/// Counts what may have changed a texture of the group.
#[derive(Clone, Default)]
pub(crate) struct TextureWrites(Arc<AtomicU64>);

impl TextureWrites {
    pub(crate) fn change(&self) {
        self.0.fetch_add(1, Ordering::Release);
    }

    fn now(&self) -> u64 {
        self.0.load(Ordering::Acquire)
    }

    /// Other contexts have the same textures: each has its count here and in the register.
    fn are_shared(&self) -> bool {
        Arc::strong_count(&self.0) > 2
    }
}

/// Some texture has its texels from elsewhere (another API, another process, a group that shares
/// the image alone): nobody tells of writes.
static FOREIGN_TEXELS: AtomicBool = AtomicBool::new(false);

impl Context {
    /// Textures of the share group may be others from now on.
    pub(crate) fn invalidate_textures(&mut self) {
        self.shared.texture_writes.change();
        self.shared.wrote_textures = true;
    }

    /// While it is the same, so are the textures of the share group.
    pub(crate) fn texture_version(&self) -> u64 {
        self.shared.texture_writes.now()
    }

    /// A call that other contexts, or what comes from elsewhere, may have to do with.
    pub(crate) fn observe_other_contexts(&mut self, index: usize, classes: u8) {
        if classes & class::TEXTURE != 0 && calls::imports_texels(index) {
            FOREIGN_TEXELS.store(true, Ordering::Relaxed);
        }
        if FOREIGN_TEXELS.load(Ordering::Relaxed)
            || self.shared.texture_writes.are_shared() && calls::waits_for_others(index)
        {
            self.shared.texture_writes.change();
        }
    }

    /// What this context has written, others can see from now on. True when it has written
    /// anything.
    pub(crate) fn publish_textures(&mut self) -> bool {
        if self.capture.immediate_target == ImmediateModeTarget::Pass
            || !self.shared.texture_writes.are_shared()
        {
            return false;
        }
        let drawing = || self.capabilities.version >= 30 && gl::word(FRAMEBUFFER_BINDING) != 0;
        let wrote = self.shared.wrote_textures || drawing();
        if wrote {
            self.shared.texture_writes.change();
        }
        self.shared.wrote_textures = false;
        wrote
    }

    /// Current again, and others may have written meanwhile whom we do not know.
    pub(crate) fn invalidate_shared_textures(&mut self) {
        if !self.shared.seen_created || FOREIGN_TEXELS.load(Ordering::Relaxed) {
            self.shared.texture_writes.change();
        }
    }
}
