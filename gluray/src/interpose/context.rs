//! The books of contexts: which is current where, and what each knows.
//!
//! A context is owned by the thread it is current on (see `symbols/current_context.rs`) or, while
//! it is current nowhere, by the register. So no call needs a lock, and a context that is destroyed
//! in flight lives on until its thread leaves it, as OpenGL says.
//!
//! It goes into the register before the driver lets go of it, and out of it after the driver has
//! taken it: in between another thread may make it current, and must find it.

use crate::capture::buffer_writes::BufferWrites;
use crate::capture::{Capture, ImmediateModeTarget};
use crate::classify::Classifier;
use crate::classify::rules::{self, Classification};
use crate::host::config::Config;
use crate::host::report::Counters;
use crate::interpose::calls::{self, class};
use crate::interpose::driver::gl;
use crate::interpose::share_group::{ShareGroup, SharedObjects, TextureWrites};
use crate::interpose::symbols;
use crate::present::Presentation;
use crate::state::StateCache;
use crate::state::current_attributes::{AttributeState, CurrentAttributes};
use crate::state::enums::*;
use crate::state::material_properties::MaterialProperties;
use crate::state::snapshot::DriverCapabilities;
use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex, OnceLock};

/// One OpenGL context: its state, and one struct for each step of a frame.
pub(crate) struct Context {
    handle: usize,
    destroyed_while_current: bool,
    /// Watched calls since the last draw.
    watched_calls: u32,
    /// Errors that came up behind the program's back or were kept for it.
    pub(crate) errors: Vec<u32>,
    /// A fault of ours has ended the tracing, and the driver knows what it was not told before.
    pub(crate) tracing_stopped: bool,
    pub(crate) capabilities: DriverCapabilities,
    pub(crate) config: Arc<Config>,
    pub(crate) state: StateCache,
    pub(crate) attributes: AttributeState,
    pub(crate) capture: Capture,
    pub(crate) shared: SharedObjects,
    pub(crate) classifier: Classifier,
    pub(crate) presentation: Presentation,
    pub(crate) counters: Counters,
}

struct ContextRegistry {
    idle: HashMap<usize, Box<Context>>,
    shared: HashMap<usize, ShareGroup>,
    /// Contexts whose creation we saw.
    seen: HashSet<usize>,
}

static CONTEXT_REGISTRY: OnceLock<Mutex<ContextRegistry>> = OnceLock::new();

fn registry() -> std::sync::MutexGuard<'static, ContextRegistry> {
    let new = || {
        Mutex::new(ContextRegistry {
            idle: HashMap::new(),
            shared: HashMap::new(),
            seen: HashSet::new(),
        })
    };
    CONTEXT_REGISTRY.get_or_init(new).lock().unwrap_or_else(|e| e.into_inner())
}

/// A context was created; `share` is one whose lists it shares.
pub(crate) fn created(handle: usize, share: usize) {
    if handle == 0 {
        return;
    }
    let mut r = registry();
    let shared =
        if share == 0 { ShareGroup::default() } else { r.shared.entry(share).or_default().clone() };
    r.shared.insert(handle, shared);
    r.seen.insert(handle);
    // The address of a context that was destroyed may come again.
    let gone = r.idle.remove(&handle);
    drop(r);
    drop(gone);
}

/// A context was destroyed; when it is current it lives until it is left.
pub(crate) fn destroyed(handle: usize) {
    let here = symbols::with_context(|c| {
        let mine = c.handle == handle;
        c.destroyed_while_current |= mine;
        mine
    });
    // Programs destroy their contexts before they end, whatever way they do.
    crate::host::report::write_final_report();
    let mut r = registry();
    let gone = if here == Some(true) { None } else { r.idle.remove(&handle) };
    r.shared.remove(&handle);
    r.seen.remove(&handle);
    drop(r);
    drop(gone);
}

/// What was current before another context is made current.
pub(crate) enum PreviousContext {
    /// None.
    Nothing,
    /// This one, which is in the register; and the textures of its group, when it has written any.
    Idle(usize, Option<TextureWrites>),
    /// One that is destroyed, and current nowhere else.
    Doomed(Box<Context>),
}

/// Before the current context changes: what is pending is drawn, and the context is there for other
/// threads.
pub(crate) fn release_current() -> PreviousContext {
    crate::interpose::panic_guard::hand_over_to_driver();
    let wrote = symbols::with_context(|c| {
        c.flush("context switch");
        c.sync();
        c.counters.publish(false);
        c.publish_textures()
    });
    let Some(old) = symbols::take() else { return PreviousContext::Nothing };
    symbols::thread_leaves();
    if old.destroyed_while_current {
        return PreviousContext::Doomed(old);
    }
    let left = PreviousContext::Idle(
        old.handle,
        (wrote == Some(true)).then(|| old.shared.texture_writes.clone()),
    );
    let before = registry().idle.insert(old.handle, old);
    drop(before);
    left
}

/// The change was refused: all stays as it was.
pub(crate) fn restore_current(left: PreviousContext) {
    let context = match left {
        PreviousContext::Nothing => None,
        // It is current here still, so no other thread can have taken it.
        PreviousContext::Idle(handle, _) => registry().idle.remove(&handle),
        PreviousContext::Doomed(context) => Some(context),
    };
    if let Some(mut context) = context {
        context.state.dirty = class::ALL;
        install_current(context);
    }
}

/// `handle` is current on this thread now (0: none), and what was `left` is not.
pub(crate) fn make_current(handle: usize, left: PreviousContext) {
    if let PreviousContext::Idle(_, Some(textures)) = &left {
        // Changing contexts flushes, so others see now what it wrote.
        textures.change();
    }
    drop(left);
    if let Some(old) = symbols::take() {
        // A fault kept it from being left in order.
        symbols::thread_leaves();
        if !old.destroyed_while_current {
            let before = registry().idle.insert(old.handle, old);
            drop(before);
        }
    }
    if handle == 0 {
        return;
    }
    let mut context = {
        let mut r = registry();
        let shared = r.shared.entry(handle).or_default().clone();
        let seen = r.seen.contains(&handle);
        r.idle.remove(&handle).unwrap_or_else(|| Box::new(Context::new(handle, shared, seen)))
    };
    // After a fault the books are kept all the same: lists that we compiled are ours to play.
    if !crate::interpose::panic_guard::happened() {
        context.on_made_current();
    }
    install_current(context);
}

fn install_current(context: Box<Context>) {
    // Before it is there, so that its thread is told of all calls from the first on.
    symbols::thread_enters();
    match symbols::install(context) {
        Ok(()) => symbols::arm(),
        // Some programs change contexts in exit handlers, when the thread's storage is gone
        // already.
        Err(context) => {
            symbols::thread_leaves();
            let before = registry().idle.insert(context.handle, context);
            drop(before);
        }
    }
}

/// A watched call is about to run.
pub(crate) fn on_watched_call(index: usize) {
    let (class, flushes) = (calls::class_of(index), calls::flushes(index));
    let draws = calls::is_other_draw(index);
    symbols::with_context(|c| c.watched_call(index, class, flushes, draws));
}

impl Drop for Context {
    /// Also when a thread or the program ends with its context current.
    fn drop(&mut self) {
        crate::interpose::panic_guard::guard(|| self.counters.publish(true));
    }
}

impl Context {
    fn new(handle: usize, group: ShareGroup, seen_created: bool) -> Context {
        Context {
            handle,
            destroyed_while_current: false,
            watched_calls: 0,
            errors: Vec::new(),
            tracing_stopped: false,
            capabilities: DriverCapabilities::default(),
            config: crate::host::config::current(),
            state: StateCache::default(),
            attributes: AttributeState::default(),
            capture: Capture::default(),
            shared: SharedObjects::new(group, seen_created),
            classifier: Classifier::default(),
            presentation: Presentation::default(),
            counters: Counters::default(),
        }
    }

    /// One that no driver knows.
    #[cfg(test)]
    pub(crate) fn for_tests(handle: usize) -> Context {
        Context::new(handle, ShareGroup::default(), true)
    }

    /// As the driver calls it.
    #[cfg(test)]
    pub(crate) fn handle(&self) -> usize {
        self.handle
    }

    #[cfg(test)]
    pub(crate) fn rename(&mut self, handle: usize) {
        self.handle = handle;
    }

    /// Current again: the driver may have been told anything meanwhile.
    fn on_made_current(&mut self) {
        self.state.dirty = class::ALL;
        self.invalidate_shared_textures();
        self.attributes.stale = 0;
        (self.attributes.stale_properties, self.attributes.set_since_draw) =
            (MaterialProperties::default(), MaterialProperties::default());
        if self.capabilities.version == 0 {
            self.keep_errors();
            self.capabilities = DriverCapabilities::query();
            // As large as the window until the program says otherwise.
            self.presentation.frame.set_initial_height(gl::ints(SCISSOR_BOX));
            self.drop_errors();
            self.counters.set_driver(&gl::string(RENDERER), &gl::string(VERSION));
        }
    }

    // ---- Errors: ours must not be seen, the program's must not be lost --------------------------
    /// Takes the driver's pending errors into our keeping.
    pub(crate) fn keep_errors(&mut self) {
        for _ in 0..8 {
            match gl::get_error() {
                0 => return,
                e if self.errors.contains(&e) => {}
                e => self.errors.push(e),
            }
        }
    }

    /// Forgets errors that our own calls made.
    pub(crate) fn drop_errors(&mut self) {
        for _ in 0..8 {
            if gl::get_error() == 0 {
                return;
            }
        }
    }

    /// An error kept for the program; the driver is asked when there is none.
    pub(crate) fn take_error(&mut self) -> Option<u32> {
        if self.capture.immediate_target == ImmediateModeTarget::Trace {
            self.replay_to_driver("glGetError between Begin and End");
        }
        if self.errors.is_empty() { None } else { Some(self.errors.remove(0)) }
    }

    // ---- Watched calls --------------------------------------------------------------------------
    pub(crate) fn watched_call(&mut self, index: usize, class: u8, flushes: bool, draws: bool) {
        if self.capture.immediate_target == ImmediateModeTarget::Trace {
            self.replay_to_driver("another call between Begin and End");
        }
        self.finish_redraw();
        self.observe_other_contexts(index, class);
        if let Some(r) = &mut self.capture.recording {
            r.note_driver_call(class, flushes, draws);
        }
        if flushes {
            let invisible = calls::shows_front_buffer(index)
                && self.capabilities.double_buffered
                && !self.draws_to_front();
            if !invisible && self.capture.recording.is_none() {
                self.flush(symbols::NAMES[index].to_str().unwrap_or("a call"));
            }
            if draws && self.capture.recording.is_none() {
                self.counters.count_driver_draws("a draw call that is not followed", 1);
            }
            if calls::swaps_buffers(index) {
                self.frame_done();
            } else if calls::reads_frame(index) {
                if self.capabilities.version >= 21 && gl::word(PIXEL_PACK_BUFFER_BINDING) != 0 {
                    self.writes().any();
                }
                self.read_back();
            }
        }
        // A program that sets much state between draws pays for the first calls only.
        let watched_enough = self.watched_calls >= 12;
        if class & class::TEXTURE != 0 && self.state.snapshot.texture.is_some() {
            // What was drawn with a texture is drawn with what it is now.
            self.end_batch();
        }
        self.sync();
        self.mark(class);
        self.watched_calls += 1;
        if watched_enough && self.capture.recording.is_none() && symbols::is_alone() {
            // Of buffers and textures that are written we are told all the same.
            self.mark(class::ALL & !(class::BUFFER | class::TEXTURE));
            symbols::disarm();
        }
    }

    /// What was written to the buffers of the share group.
    pub(crate) fn writes(&self) -> std::sync::MutexGuard<'_, BufferWrites> {
        self.shared.writes.lock().unwrap_or_else(|e| e.into_inner())
    }

    fn mark(&mut self, class: u8) {
        self.state.dirty |= class;
        if class & class::BUFFER != 0 {
            self.writes().any();
        }
        if class & class::TEXTURE != 0 {
            self.invalidate_textures();
        }
    }

    fn draws_to_front(&self) -> bool {
        self.state.snapshot.draw_buffer != BACK
            && self.state.snapshot.draw_buffer != BACK_LEFT
            && self.state.snapshot.framebuffer == 0
    }

    /// Tells the driver the current attributes it does not know.
    pub(crate) fn sync(&mut self) {
        if self.attributes.stale != 0 {
            let bits = std::mem::take(&mut self.attributes.stale);
            self.attributes
                .current
                .send(bits, std::mem::take(&mut self.attributes.stale_properties));
        }
    }

    // ---- State ----------------------------------------------------------------------------------
    /// The state now. Ends the batch of immediate mode when it changed.
    pub(crate) fn refresh(&mut self) {
        const DRAWS: u8 =
            class::MATRIX | class::LIGHT | class::RASTER | class::TEXTURE | class::CURRENT;
        self.watched_calls = 0;
        symbols::arm();
        self.finish_redraw();
        if self.state.snapshot.texture.as_ref().is_some_and(|t| t.version != self.texture_version())
        {
            // Another context of the share group may have written it.
            self.state.dirty |= class::TEXTURE;
        }
        if self.state.dirty & DRAWS == 0 {
            return;
        }
        if self.state.dirty & class::RASTER != 0 {
            self.capture.evaluators.forget();
        }
        self.sync();
        self.keep_errors();
        let mut fresh = (*self.state.snapshot).clone();
        fresh.refresh(self.state.dirty, &self.capabilities);
        fresh.window_height = self.presentation.frame.window_height(&fresh);
        if let Some(t) = &mut fresh.texture {
            t.version = self.texture_version();
        }
        if self.state.dirty & class::CURRENT != 0 && !self.capabilities.core {
            let now = CurrentAttributes::query();
            self.attributes.untracked_color =
                now.untracked_color(fresh.color_material.filter(|_| fresh.lighting));
            if now != self.attributes.current {
                self.end_batch();
                self.attributes.current = now;
            }
        }
        self.drop_errors();
        self.state.dirty &= !DRAWS;
        if fresh != *self.state.snapshot {
            self.end_batch();
            self.state.snapshot = Arc::new(fresh);
        }
        self.classifier.classification = rules::classify(&self.state.snapshot, self.config.trace());
        if !matches!(self.classifier.classification, Classification::Pass(_)) && self.is_refused() {
            self.classifier.classification =
                Classification::Pass(crate::present::framebuffer_pass::REFUSED);
        }
        if let Some(t) = &self.state.snapshot.texture
            && !matches!(self.classifier.classification, Classification::Pass(_))
        {
            // Now, as it is bound now: when a batch of immediate mode ends another may be.
            self.capture.images.get(t.target, t.name, t.version);
        }
    }

    /// What becomes of filled primitives in the state now.
    pub(crate) fn classification(&mut self) -> Classification {
        self.refresh();
        self.attributes.set_since_draw = MaterialProperties::default();
        match self.classifier.classification {
            _ if crate::trace::thread_pool::forked() => Classification::Pass("a forked process"),
            v => v,
        }
    }
}
