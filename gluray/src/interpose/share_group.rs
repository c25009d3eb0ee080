//! The objects that the contexts of a share group have in common, and when one context sees
//! another's writes to a texture.
//!
//! Texture images are read again when the group's count of writes has changed. A context counts
//! before the driver makes a write. That is enough for the context itself, but not for the others.
//! One of them may read between the count and the write, or while the write is still in the
//! writer's queue. OpenGL guarantees that another context sees a write after the writer has
//! finished or flushed, or the reader has waited for a fence, and the reader has bound the texture
//! again (OpenGL 4.6, section 5.3). At these points the writer, or the reader that waited, counts
//! once more, so images that were read before have another number.
//!
//! Draws into a texture are not reported one by one. While a framebuffer object is bound, the same
//! points count its writes.

use crate::calls::{self, class};
use crate::capture::buffer_writes::BufferWrites;
use crate::capture::display_lists::DisplayLists;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};

/// The objects of a share group.
#[derive(Clone, Default)]
pub(crate) struct ShareGroup {
    pub(crate) lists: Arc<Mutex<DisplayLists>>,
    pub(crate) writes: Arc<Mutex<BufferWrites>>,
    pub(crate) texture_writes: TextureWrites,
}

/// Counts the calls that may have changed a texture of the group.
#[derive(Clone, Default)]
pub(crate) struct TextureWrites(Arc<AtomicU64>);

impl TextureWrites {
    pub(crate) fn change(&self) {
        self.0.fetch_add(1, Ordering::Release);
    }

    fn now(&self) -> u64 {
        self.0.load(Ordering::Acquire)
    }

    /// True when other contexts use the same textures. Each context and the register hold one
    /// reference.
    fn are_shared(&self) -> bool {
        Arc::strong_count(&self.0) > 2
    }
}

/// True when a texture has texels from elsewhere: another API, another process, or a group that
/// shares the image alone. Their writes are not reported.
static FOREIGN_TEXELS: AtomicBool = AtomicBool::new(false);

/// The objects that a context shares with others.
pub(crate) struct SharedObjects {
    lists: Arc<Mutex<DisplayLists>>,
    writes: Arc<Mutex<BufferWrites>>,
    texture_writes: TextureWrites,
    /// This context may have written a texture since it last let others see what it wrote.
    wrote_textures: bool,
    /// The creation of this context was seen, so it is known which contexts share with it.
    seen_created: bool,
}

impl SharedObjects {
    pub(crate) fn new(group: ShareGroup, seen_created: bool) -> SharedObjects {
        let ShareGroup { lists, writes, texture_writes } = group;
        SharedObjects { lists, writes, texture_writes, wrote_textures: false, seen_created }
    }

    /// The display lists of the group.
    pub(crate) fn lists(&self) -> MutexGuard<'_, DisplayLists> {
        self.lists.lock().unwrap_or_else(|e| e.into_inner())
    }

    /// The same for a recording, which outlives the call.
    pub(crate) fn lists_of_group(&self) -> Arc<Mutex<DisplayLists>> {
        self.lists.clone()
    }

    /// The writes to the buffers of the group.
    pub(crate) fn writes(&self) -> MutexGuard<'_, BufferWrites> {
        self.writes.lock().unwrap_or_else(|e| e.into_inner())
    }

    /// The counter of writes to textures, for the time after this context has been left.
    pub(crate) fn texture_writes(&self) -> TextureWrites {
        self.texture_writes.clone()
    }

    /// A call may have changed these classes of state.
    pub(crate) fn mark(&mut self, classes: u8) {
        if classes & class::BUFFER != 0 {
            self.writes().any();
        }
        if classes & class::TEXTURE != 0 {
            self.invalidate_textures();
        }
    }

    /// Textures of the group may be others from now on.
    pub(crate) fn invalidate_textures(&mut self) {
        self.texture_writes.change();
        self.wrote_textures = true;
    }

    /// The textures of the group are unchanged while this number is the same.
    pub(crate) fn texture_version(&self) -> u64 {
        self.texture_writes.now()
    }

    /// Observes a call by which other contexts' writes, or texels from elsewhere, may become
    /// visible.
    pub(crate) fn observe_call(&self, index: usize, classes: u8) {
        if classes & class::TEXTURE != 0 && calls::imports_texels(index) {
            FOREIGN_TEXELS.store(true, Ordering::Relaxed);
        }
        if FOREIGN_TEXELS.load(Ordering::Relaxed)
            || self.texture_writes.are_shared() && calls::waits_for_others(index)
        {
            self.texture_writes.change();
        }
    }

    /// Other contexts can see what this one has written from now on. True when it has written
    /// anything; `draws_into_texture` says whether its framebuffer may be a texture.
    pub(crate) fn publish_textures(&mut self, draws_into_texture: impl FnOnce() -> bool) -> bool {
        if !self.texture_writes.are_shared() {
            return false;
        }
        let wrote = self.wrote_textures || draws_into_texture();
        if wrote {
            self.texture_writes.change();
        }
        self.wrote_textures = false;
        wrote
    }

    /// The context is current again. Contexts that we do not know may have written meanwhile.
    pub(crate) fn on_made_current(&self) {
        if !self.seen_created || FOREIGN_TEXELS.load(Ordering::Relaxed) {
            self.texture_writes.change();
        }
    }
}
