//! The books of contexts: which is current where, and what each knows.
//!
//! A context is owned by the thread it is current on (see `symbols/current_context.rs`) or, while
//! it is current nowhere, by the register. So no call needs a lock, and a context that is destroyed
//! in flight lives on until its thread leaves it, as OpenGL says.
//!
//! It goes into the register before the driver lets go of it, and out of it after the driver has
//! taken it: in between another thread may make it current, and must find it.

use crate::capture::Capture;
use crate::classify::Classifier;
use crate::host::config::Config;
use crate::host::report::Counters;
use crate::interpose::calls::{self, class};
use crate::interpose::flush_reason::FlushReason;
use crate::interpose::kept_errors::KeptErrors;
use crate::interpose::share_group::{ShareGroup, SharedObjects, TextureWrites};
use crate::interpose::symbols;
use crate::present::Presentation;
use crate::state::StateCache;
use crate::state::current_attributes::AttributeState;
use crate::state::snapshot::DriverCapabilities;
use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex, OnceLock};

/// One OpenGL context: its state, and one struct for each step of a frame.
pub(crate) struct Context {
    handle: usize,
    destroyed_while_current: bool,
    /// Watched calls since the last draw.
    pub(super) watched_calls: u32,
    pub(crate) errors: KeptErrors,
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
        c.flush(FlushReason::ContextSwitch);
        c.attributes.sync();
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
        (wrote == Some(true)).then(|| old.shared.texture_writes()),
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
            errors: KeptErrors::default(),
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
}
