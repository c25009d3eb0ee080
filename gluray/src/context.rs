//! The books of contexts: which is current where, and what each knows.
//!
//! A context is owned by the thread it is current on (in [`CURRENT`]) or, while it is current nowhere, by the register. So no call needs a
//! lock, and a context that is destroyed in flight lives on until its thread leaves it, as OpenGL says.

use crate::arrays::Arrays;
use crate::buffers::Writes;
use crate::cache::Cache;
use crate::config::Config;
use crate::decide::{self, Verdict};
use crate::enums::*;
use crate::evaluators::Evaluators;
use crate::frame::Frame;
use crate::packs::Packs;
use crate::present::Presenter;
use crate::probe::Probes;
use crate::programs::Programs;
use crate::real::gl;
use crate::recorder::Recorder;
use crate::report::Counters;
use crate::state::current::Current;
use crate::state::lists::{Lists, Recording};
use crate::state::properties::Properties;
use crate::state::snapshot::{Abilities, Snapshot};
use crate::studio::Studio;
use crate::symbols::{self, class};
use std::cell::RefCell;
use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::sync::{Arc, Mutex, OnceLock};

thread_local! {
    /// The context of this thread.
    pub(crate) static CURRENT: RefCell<Option<Box<Context>>> = const { RefCell::new(None) };
}

/// Where the calls of immediate mode go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sink {
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
    doomed: bool,
    pub(crate) can: Abilities,
    pub(crate) config: Arc<Config>,
    pub(crate) sink: Sink,
    /// Classes of state to ask the driver about again.
    pub(crate) dirty: u8,
    pub(crate) state: Arc<Snapshot>,
    pub(crate) verdict: Verdict,
    pub(crate) current: Current,
    /// A colour that colour material did not take over (see `Current::unfollowed`).
    pub(crate) unfollowed: Option<[f32; 4]>,
    /// What of `current` the driver does not know yet.
    pub(crate) stale: u8,
    /// Of its materials, these.
    pub(crate) stale_properties: Properties,
    /// What `glMaterial` set since the last draw.
    pub(crate) set_since_draw: Properties,
    pub(crate) recorder: Recorder,
    pub(crate) evaluators: Evaluators,
    /// The arrays that `glArrayElement` takes the vertices of the open primitive from.
    pub(crate) element_arrays: Option<Arrays>,
    pub(crate) lists: Arc<Mutex<Lists>>,
    pub(crate) writes: Arc<Mutex<Writes>>,
    pub(crate) recording: Option<Recording>,
    pub(crate) depth_of_lists: u32,
    pub(crate) cache: Cache,
    pub(crate) packed: Packs,
    pub(crate) frame: Frame,
    pub(crate) presenter: Presenter,
    pub(crate) studio: Studio,
    pub(crate) probes: Probes,
    pub(crate) programs: Programs,
    pub(crate) counters: Counters,
    /// Errors that came up behind the program's back or were kept for it.
    pub(crate) errors: Vec<u32>,
    /// Counts what may have changed textures.
    pub(crate) texture_version: u64,
    watched: u32,
}

struct Register {
    idle: HashMap<usize, Box<Context>>,
    shared: HashMap<usize, Shared>,
}

/// What the contexts of a share group have in common.
#[derive(Clone, Default)]
struct Shared {
    lists: Arc<Mutex<Lists>>,
    writes: Arc<Mutex<Writes>>,
}

static REGISTER: OnceLock<Mutex<Register>> = OnceLock::new();
/// Threads that have a context.
static THREADS: AtomicUsize = AtomicUsize::new(0);
/// Contexts that were ever current, and the process that counted them.
static BORN: AtomicU64 = AtomicU64::new(0);

fn register() -> std::sync::MutexGuard<'static, Register> {
    let new = || Mutex::new(Register { idle: HashMap::new(), shared: HashMap::new() });
    REGISTER.get_or_init(new).lock().unwrap_or_else(|e| e.into_inner())
}

/// A context was created; `share` is one whose lists it shares.
pub(crate) fn created(handle: usize, share: usize) {
    if handle == 0 {
        return;
    }
    let mut r = register();
    let shared = r.shared.get(&share).filter(|_| share != 0).cloned().unwrap_or_default();
    r.shared.insert(handle, shared);
    // The address of a context that was destroyed may come again.
    r.idle.remove(&handle);
}

/// A context was destroyed; when it is current it lives until it is left.
pub(crate) fn destroyed(handle: usize) {
    let here = symbols::with_context(|c| {
        let mine = c.handle == handle;
        c.doomed |= mine;
        mine
    });
    if here != Some(true) {
        let gone = register().idle.remove(&handle);
        drop(gone);
    }
    register().shared.remove(&handle);
}

/// Before the current context changes: what is pending is drawn.
pub(crate) fn leave() {
    symbols::with_context(|c| {
        c.flush("context switch");
        c.sync();
        c.counters.publish(true);
    });
}

/// The change was refused: all stays as it was.
pub(crate) fn stay() {
    symbols::with_context(|c| c.dirty = class::ALL);
}

/// `handle` is current on this thread now (0: none).
pub(crate) fn enter(handle: usize) {
    // Some programs leave their context in exit handlers, when the thread's storage is gone already.
    let Ok(before) = CURRENT.try_with(|slot| slot.try_borrow_mut().ok().and_then(|mut s| s.take())) else {
        return;
    };
    symbols::set_hot(None);
    if let Some(old) = before {
        THREADS.fetch_sub(1, Relaxed);
        if !old.doomed {
            register().idle.insert(old.handle, old);
        }
    }
    if handle == 0 || crate::fault::happened() {
        return;
    }
    let mut context = {
        let mut r = register();
        let shared = r.shared.entry(handle).or_default().clone();
        r.idle.remove(&handle).unwrap_or_else(|| Box::new(Context::new(handle, shared)))
    };
    context.wake();
    let threads = THREADS.fetch_add(1, Relaxed) + 1;
    let placed = CURRENT.try_with(|slot| {
        let Ok(mut slot) = slot.try_borrow_mut() else { return };
        *slot = Some(context);
        // With a second thread the short way would lead to the wrong context.
        symbols::set_hot(slot.as_deref_mut().filter(|_| threads == 1));
    });
    if placed.is_ok() {
        symbols::attend();
    }
}

/// A watched call is about to run.
pub(crate) fn watched(index: usize, class: u8, flushes: bool, draws: bool) {
    symbols::with_context(|c| c.watched_call(index, class, flushes, draws));
}

fn indices_of(names: &[&str]) -> Vec<usize> {
    names.iter().filter_map(|n| symbols::index_of(n.as_bytes())).collect()
}

/// Calls that end a frame for the one who looks at the screen.
fn swaps() -> &'static [usize] {
    static SWAPS: OnceLock<Vec<usize>> = OnceLock::new();
    SWAPS.get_or_init(|| {
        let damage = ["eglSwapBuffersWithDamageKHR", "eglSwapBuffersWithDamageEXT"];
        indices_of(&[&["glXSwapBuffers", "eglSwapBuffers", "glXSwapBuffersMscOML"][..], &damage].concat())
    })
}

/// Calls by which a program looks at what it drew.
fn reads() -> &'static [usize] {
    static READS: OnceLock<Vec<usize>> = OnceLock::new();
    READS.get_or_init(|| indices_of(&["glReadPixels", "glReadnPixels", "glReadnPixelsARB", "glGetTexImage"]))
}

/// Calls that show something only when the front buffer is drawn to.
fn front_only() -> &'static [usize] {
    static FRONT_ONLY: OnceLock<Vec<usize>> = OnceLock::new();
    FRONT_ONLY.get_or_init(|| indices_of(&["glFlush", "glFinish"]))
}

impl Drop for Context {
    /// Also when a thread or the program ends with its context current.
    fn drop(&mut self) {
        symbols::set_hot(None);
        crate::fault::guard(|| self.counters.publish(true));
    }
}

impl Context {
    fn new(handle: usize, Shared { lists, writes }: Shared) -> Context {
        if BORN.fetch_add(1, Relaxed) == 0 {
            crate::fault::silence();
        }
        Context {
            handle,
            doomed: false,
            can: Abilities::default(),
            config: crate::config::current(),
            sink: Sink::Outside,
            dirty: class::ALL,
            state: Arc::default(),
            verdict: Verdict::Pass("nothing drawn yet"),
            current: Current::default(),
            unfollowed: None,
            stale: 0,
            stale_properties: Properties::default(),
            set_since_draw: Properties::default(),
            recorder: Recorder::default(),
            evaluators: Evaluators::default(),
            element_arrays: None,
            lists,
            writes,
            recording: None,
            depth_of_lists: 0,
            cache: Cache::default(),
            packed: Packs::default(),
            frame: Frame::default(),
            presenter: Presenter::default(),
            studio: Studio::default(),
            probes: Probes::default(),
            programs: Programs::default(),
            counters: Counters::default(),
            errors: Vec::new(),
            texture_version: 1,
            watched: 0,
        }
    }

    /// Current again: the driver may have been told anything meanwhile.
    fn wake(&mut self) {
        self.dirty = class::ALL;
        self.texture_version += 1;
        self.stale = 0;
        (self.stale_properties, self.set_since_draw) = (Properties::default(), Properties::default());
        if self.can.version == 0 {
            self.keep_errors();
            self.can = Abilities::query();
            // As large as the window until the program says otherwise.
            self.frame.begins_with(gl::ints(SCISSOR_BOX));
            self.drop_errors();
            self.counters.set_driver(&gl::string(RENDERER), &gl::string(VERSION));
        }
    }

    // ---- Errors: ours must not be seen, the program's must not be lost ------------------------------------------------

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
        if self.sink == Sink::Trace {
            self.unswallow("glGetError between Begin and End");
        }
        if self.errors.is_empty() { None } else { Some(self.errors.remove(0)) }
    }

    // ---- Watched calls ------------------------------------------------------------------------------------------------

    pub(crate) fn watched_call(&mut self, index: usize, class: u8, flushes: bool, draws: bool) {
        if self.sink == Sink::Trace {
            self.unswallow("another call between Begin and End");
        }
        self.drawn_over();
        if let Some(r) = &mut self.recording {
            r.note_driver_call(class, flushes, draws);
        }
        if flushes {
            let invisible =
                front_only().contains(&index) && self.can.double_buffered && !self.draws_to_front();
            if !invisible && self.recording.is_none() {
                self.flush(symbols::NAMES[index].to_str().unwrap_or("a call"));
            }
            if draws && self.recording.is_none() {
                self.counters.pass("a draw call that is not followed", 1);
            }
            if swaps().contains(&index) {
                self.frame_done();
            } else if reads().contains(&index) {
                if self.can.version >= 21 && gl::word(PIXEL_PACK_BUFFER_BINDING) != 0 {
                    self.writes().any();
                }
                self.read_back();
            }
        }
        // A program that sets much state between draws pays for the first calls only.
        let told_enough = self.watched >= 12;
        if class & class::TEXTURE != 0 && self.state.texture.is_some() {
            // What was drawn with a texture is drawn with what it is now.
            self.end_batch();
        }
        self.sync();
        self.mark(class);
        self.watched += 1;
        if told_enough && self.recording.is_none() && THREADS.load(Relaxed) == 1 {
            // Of buffers and textures that are written we are told all the same.
            self.mark(class::ALL & !(class::BUFFER | class::TEXTURE));
            symbols::relax();
        }
    }

    /// What was written to the buffers of the share group.
    pub(crate) fn writes(&self) -> std::sync::MutexGuard<'_, Writes> {
        self.writes.lock().unwrap_or_else(|e| e.into_inner())
    }

    fn mark(&mut self, class: u8) {
        self.dirty |= class;
        if class & class::BUFFER != 0 {
            self.writes().any();
        }
        // Another thread's context may share textures with this one.
        self.texture_version += u64::from(class & class::TEXTURE != 0 || THREADS.load(Relaxed) > 1);
    }

    fn draws_to_front(&self) -> bool {
        self.state.draw_buffer != BACK && self.state.draw_buffer != BACK_LEFT && self.state.framebuffer == 0
    }

    /// Tells the driver the current attributes it does not know.
    pub(crate) fn sync(&mut self) {
        if self.stale != 0 {
            let bits = std::mem::take(&mut self.stale);
            self.current.send(bits, std::mem::take(&mut self.stale_properties));
        }
    }

    // ---- State --------------------------------------------------------------------------------------------------------

    /// The state now. Ends the batch of immediate mode when it changed.
    pub(crate) fn refresh(&mut self) {
        const DRAWS: u8 = class::MATRIX | class::LIGHT | class::RASTER | class::TEXTURE | class::CURRENT;
        self.watched = 0;
        symbols::attend();
        self.drawn_over();
        if self.dirty & DRAWS == 0 {
            return;
        }
        if self.dirty & class::RASTER != 0 {
            self.evaluators.forget();
        }
        self.sync();
        self.keep_errors();
        let mut fresh = (*self.state).clone();
        fresh.refresh(self.dirty, &self.can);
        fresh.window_height = self.frame.window_height(&fresh);
        if let Some(t) = &mut fresh.texture {
            t.version = self.texture_version;
        }
        if self.dirty & class::CURRENT != 0 && !self.can.core {
            let now = Current::query();
            self.unfollowed = now.unfollowed(fresh.color_material.filter(|_| fresh.lighting));
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
        self.verdict = decide::filled(&self.state, self.config.trace());
        if let Some(t) = &self.state.texture
            && !matches!(self.verdict, Verdict::Pass(_))
        {
            // Now, as it is bound now: when a batch of immediate mode ends another may be.
            self.presenter.images.get(t.target, t.name, t.version);
        }
    }

    /// What becomes of filled primitives in the state now.
    pub(crate) fn verdict(&mut self) -> Verdict {
        self.refresh();
        self.set_since_draw = Properties::default();
        match self.verdict {
            _ if crate::worker::forked() => Verdict::Pass("a forked process"),
            v => v,
        }
    }
}
