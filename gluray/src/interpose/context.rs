//! The books of contexts: which is current where, and what each knows.
//!
//! A context is owned by the thread it is current on (see `symbols/current_context.rs`) or, while
//! it is current nowhere, by the register. So no call needs a lock, and a context that is destroyed
//! in flight lives on until its thread leaves it, as OpenGL says.
//!
//! It goes into the register before the driver lets go of it, and out of it after the driver has
//! taken it: in between another thread may make it current, and must find it.

use crate::capture::attribute_cache::AttributeCache;
use crate::capture::buffer_writes::BufferWrites;
use crate::capture::display_lists::{DisplayLists, ListRecording};
use crate::capture::evaluators::Evaluators;
use crate::capture::geometry_cache::GeometryCache;
use crate::capture::vertex_arrays::VertexArrays;
use crate::capture::vertex_recorder::VertexRecorder;
use crate::classify::affine_probe::AffineProbes;
use crate::classify::rules::{self, Classification};
use crate::classify::vtk::VtkPrograms;
use crate::host::config::Config;
use crate::host::report::Counters;
use crate::interpose::calls::{self, class};
use crate::interpose::driver::gl;
use crate::interpose::share_group::{ShareGroup, TextureWrites};
use crate::interpose::symbols;
use crate::present::frame::Frame;
use crate::present::framebuffer_pass::Presenter;
use crate::state::current_attributes::CurrentAttributes;
use crate::state::enums::*;
use crate::state::material_properties::MaterialProperties;
use crate::state::snapshot::{DriverCapabilities, Snapshot};
use crate::trace::path_tracing::PathTracer;
use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex, OnceLock};

/// Where the calls of immediate mode go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ImmediateModeTarget {
    /// Not between Begin and End.
    Outside,
    /// Between Begin and End of a traced primitive.
    Trace,
    /// Between Begin and End of a primitive that the driver draws.
    Pass,
    /// Into a display list.
    List,
}

/// What we know of one OpenGL context.
pub(crate) struct Context {
    handle: usize,
    destroyed_while_current: bool,
    pub(crate) capabilities: DriverCapabilities,
    pub(crate) config: Arc<Config>,
    pub(crate) immediate_target: ImmediateModeTarget,
    /// Classes of state to ask the driver about again.
    pub(crate) dirty: u8,
    pub(crate) state: Arc<Snapshot>,
    pub(crate) classification: Classification,
    pub(crate) current: CurrentAttributes,
    /// A colour that colour material did not take over (see `CurrentAttributes::untracked_color`).
    pub(crate) untracked_color: Option<[f32; 4]>,
    /// What of `current` the driver does not know yet.
    pub(crate) stale: u8,
    /// Of its materials, these.
    pub(crate) stale_properties: MaterialProperties,
    /// What `glMaterial` set since the last draw.
    pub(crate) set_since_draw: MaterialProperties,
    pub(crate) recorder: VertexRecorder,
    pub(crate) evaluators: Evaluators,
    /// The arrays that `glArrayElement` takes the vertices of the open primitive from.
    pub(crate) element_arrays: Option<VertexArrays>,
    pub(crate) lists: Arc<Mutex<DisplayLists>>,
    pub(crate) writes: Arc<Mutex<BufferWrites>>,
    pub(crate) recording: Option<ListRecording>,
    pub(crate) depth_of_lists: u32,
    pub(crate) geometry_cache: GeometryCache,
    pub(crate) attribute_cache: AttributeCache,
    pub(crate) frame: Frame,
    pub(crate) presenter: Presenter,
    pub(crate) path_tracer: PathTracer,
    pub(crate) probes: AffineProbes,
    pub(crate) programs: VtkPrograms,
    pub(crate) counters: Counters,
    /// Errors that came up behind the program's back or were kept for it.
    pub(crate) errors: Vec<u32>,
    pub(crate) texture_writes: TextureWrites,
    /// This context may have written a texture since it last let others see what it wrote.
    pub(crate) wrote_textures: bool,
    /// We saw it created, so we know with whom it shares.
    pub(crate) seen_created: bool,
    /// A fault of ours has ended the tracing, and the driver knows what it was not told before.
    pub(crate) tracing_stopped: bool,
    on_watched_call: u32,
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
        (wrote == Some(true)).then(|| old.texture_writes.clone()),
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
        context.dirty = class::ALL;
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
    fn new(handle: usize, shared: ShareGroup, seen_created: bool) -> Context {
        let ShareGroup { lists, writes, texture_writes } = shared;
        Context {
            handle,
            destroyed_while_current: false,
            capabilities: DriverCapabilities::default(),
            config: crate::host::config::current(),
            immediate_target: ImmediateModeTarget::Outside,
            dirty: class::ALL,
            state: Arc::default(),
            classification: Classification::Pass("nothing drawn yet"),
            current: CurrentAttributes::default(),
            untracked_color: None,
            stale: 0,
            stale_properties: MaterialProperties::default(),
            set_since_draw: MaterialProperties::default(),
            recorder: VertexRecorder::default(),
            evaluators: Evaluators::default(),
            element_arrays: None,
            lists,
            writes,
            recording: None,
            depth_of_lists: 0,
            geometry_cache: GeometryCache::default(),
            attribute_cache: AttributeCache::default(),
            frame: Frame::default(),
            presenter: Presenter::default(),
            path_tracer: PathTracer::default(),
            probes: AffineProbes::default(),
            programs: VtkPrograms::default(),
            counters: Counters::default(),
            errors: Vec::new(),
            texture_writes,
            wrote_textures: false,
            seen_created,
            tracing_stopped: false,
            on_watched_call: 0,
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
        self.dirty = class::ALL;
        self.invalidate_shared_textures();
        self.stale = 0;
        (self.stale_properties, self.set_since_draw) =
            (MaterialProperties::default(), MaterialProperties::default());
        if self.capabilities.version == 0 {
            self.keep_errors();
            self.capabilities = DriverCapabilities::query();
            // As large as the window until the program says otherwise.
            self.frame.set_initial_height(gl::ints(SCISSOR_BOX));
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
        if self.immediate_target == ImmediateModeTarget::Trace {
            self.replay_to_driver("glGetError between Begin and End");
        }
        if self.errors.is_empty() { None } else { Some(self.errors.remove(0)) }
    }

    // ---- Watched calls --------------------------------------------------------------------------
    pub(crate) fn watched_call(&mut self, index: usize, class: u8, flushes: bool, draws: bool) {
        if self.immediate_target == ImmediateModeTarget::Trace {
            self.replay_to_driver("another call between Begin and End");
        }
        self.finish_redraw();
        self.observe_other_contexts(index, class);
        if let Some(r) = &mut self.recording {
            r.note_driver_call(class, flushes, draws);
        }
        if flushes {
            let invisible = calls::shows_front_buffer(index)
                && self.capabilities.double_buffered
                && !self.draws_to_front();
            if !invisible && self.recording.is_none() {
                self.flush(symbols::NAMES[index].to_str().unwrap_or("a call"));
            }
            if draws && self.recording.is_none() {
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
        let watched_enough = self.on_watched_call >= 12;
        if class & class::TEXTURE != 0 && self.state.texture.is_some() {
            // What was drawn with a texture is drawn with what it is now.
            self.end_batch();
        }
        self.sync();
        self.mark(class);
        self.on_watched_call += 1;
        if watched_enough && self.recording.is_none() && symbols::is_alone() {
            // Of buffers and textures that are written we are told all the same.
            self.mark(class::ALL & !(class::BUFFER | class::TEXTURE));
            symbols::disarm();
        }
    }

    /// What was written to the buffers of the share group.
    pub(crate) fn writes(&self) -> std::sync::MutexGuard<'_, BufferWrites> {
        self.writes.lock().unwrap_or_else(|e| e.into_inner())
    }

    fn mark(&mut self, class: u8) {
        self.dirty |= class;
        if class & class::BUFFER != 0 {
            self.writes().any();
        }
        if class & class::TEXTURE != 0 {
            self.invalidate_textures();
        }
    }

    fn draws_to_front(&self) -> bool {
        self.state.draw_buffer != BACK
            && self.state.draw_buffer != BACK_LEFT
            && self.state.framebuffer == 0
    }

    /// Tells the driver the current attributes it does not know.
    pub(crate) fn sync(&mut self) {
        if self.stale != 0 {
            let bits = std::mem::take(&mut self.stale);
            self.current.send(bits, std::mem::take(&mut self.stale_properties));
        }
    }

    // ---- State ----------------------------------------------------------------------------------
    /// The state now. Ends the batch of immediate mode when it changed.
    pub(crate) fn refresh(&mut self) {
        const DRAWS: u8 =
            class::MATRIX | class::LIGHT | class::RASTER | class::TEXTURE | class::CURRENT;
        self.on_watched_call = 0;
        symbols::arm();
        self.finish_redraw();
        if self.state.texture.as_ref().is_some_and(|t| t.version != self.texture_version()) {
            // Another context of the share group may have written it.
            self.dirty |= class::TEXTURE;
        }
        if self.dirty & DRAWS == 0 {
            return;
        }
        if self.dirty & class::RASTER != 0 {
            self.evaluators.forget();
        }
        self.sync();
        self.keep_errors();
        let mut fresh = (*self.state).clone();
        fresh.refresh(self.dirty, &self.capabilities);
        fresh.window_height = self.frame.window_height(&fresh);
        if let Some(t) = &mut fresh.texture {
            t.version = self.texture_version();
        }
        if self.dirty & class::CURRENT != 0 && !self.capabilities.core {
            let now = CurrentAttributes::query();
            self.untracked_color =
                now.untracked_color(fresh.color_material.filter(|_| fresh.lighting));
            if now != self.current {
                self.end_batch();
                self.current = now;
            }
        }
        self.drop_errors();
        self.dirty &= !DRAWS;
        if fresh != *self.state {
            self.end_batch();
            self.state = Arc::new(fresh);
        }
        self.classification = rules::classify(&self.state, self.config.trace());
        if !matches!(self.classification, Classification::Pass(_)) && self.is_refused() {
            self.classification = Classification::Pass(crate::present::framebuffer_pass::REFUSED);
        }
        if let Some(t) = &self.state.texture
            && !matches!(self.classification, Classification::Pass(_))
        {
            // Now, as it is bound now: when a batch of immediate mode ends another may be.
            self.presenter.images.get(t.target, t.name, t.version);
        }
    }

    /// What becomes of filled primitives in the state now.
    pub(crate) fn classification(&mut self) -> Classification {
        self.refresh();
        self.set_since_draw = MaterialProperties::default();
        match self.classification {
            _ if crate::trace::thread_pool::forked() => Classification::Pass("a forked process"),
            v => v,
        }
    }
}
