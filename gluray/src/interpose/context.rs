//! Contexts: the state of one, and the register of those that are current nowhere.
//!
//! A context is owned by the thread on which it is current (see `symbols/current_context.rs`).
//! While it is current nowhere, the register owns it. So no call needs a lock. A context that is
//! destroyed while it is current lives until its thread leaves it, as OpenGL specifies.
//!
//! A context enters the register before the driver releases it, and leaves it after the driver has
//! taken it. In between, another thread may make it current and must find it.

use crate::calls::{self, class};
use crate::capture::{Capture, ImmediateModeTarget};
use crate::classify::Classifier;
use crate::classify::routing::Router;
use crate::host::config::Config;
use crate::host::report::Counters;
use crate::interpose::flush_reason::FlushReason;
use crate::interpose::kept_errors::KeptErrors;
use crate::interpose::share_group::{ShareGroup, SharedObjects, TextureWrites};
use crate::interpose::symbols;
use crate::present::Presentation;
use crate::state::StateCache;
use crate::state::current_attributes::AttributeState;
use crate::state::snapshot::DriverCapabilities;
use crate::watched_calls;
use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex, OnceLock};

/// One OpenGL context: its state, and one struct for each step of a frame.
pub(crate) struct Context {
    handle: usize,
    destroyed_while_current: bool,
    /// Watched calls since the last draw.
    pub(super) watched_calls: u32,
    pub(crate) errors: KeptErrors,
    /// A fault of ours has ended the tracing, and the driver knows everything that was held back.
    pub(crate) tracing_stopped: bool,
    /// Tracing has been off since the context was made: every call is the driver's, untouched.
    /// Ends when the panel switches the tracing on. Meanwhile immediate mode counts as passed
    /// ([`ImmediateModeTarget::Pass`]), which is its shortest way to the driver.
    pub(crate) bypassed: bool,
    pub(crate) capabilities: DriverCapabilities,
    pub(crate) config: Arc<Config>,
    pub(crate) state: StateCache,
    pub(crate) attributes: AttributeState,
    pub(crate) capture: Capture,
    pub(crate) shared: SharedObjects,
    pub(crate) classifier: Classifier,
    /// Whether the driver or rays draw this frame.
    pub(crate) routing: Router,
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

/// A context was created. It shares the lists of `share`.
pub(crate) fn created(handle: usize, share: usize) {
    if handle == 0 {
        return;
    }
    let mut r = registry();
    let shared =
        if share == 0 { ShareGroup::default() } else { r.shared.entry(share).or_default().clone() };
    r.shared.insert(handle, shared);
    r.seen.insert(handle);
    // The address of a destroyed context may be used again.
    let gone = r.idle.remove(&handle);
    drop(r);
    drop(gone);
}

/// A context was destroyed. When it is current, it lives until its thread leaves it.
pub(crate) fn destroyed(handle: usize) {
    let here = symbols::with_context(|c| {
        let mine = c.handle == handle;
        c.destroyed_while_current |= mine;
        mine
    });
    // Programs destroy their contexts before they end, however they end.
    crate::host::report::write_final_report();
    let mut r = registry();
    let gone = if here == Some(true) { None } else { r.idle.remove(&handle) };
    r.shared.remove(&handle);
    r.seen.remove(&handle);
    drop(r);
    drop(gone);
}

/// The context that was current before another one is made current.
pub(crate) enum PreviousContext {
    /// None.
    Nothing,
    /// This one, which is in the register, and the textures of its group when it has written any.
    Idle(usize, Option<TextureWrites>),
    /// A destroyed one, which is current nowhere else.
    Doomed(Box<Context>),
}

/// Called before the current context changes: pending draws are presented, and the context enters
/// the register for other threads.
pub(crate) fn release_current() -> PreviousContext {
    crate::faults::hand_over_to_driver();
    let wrote = symbols::with_context(|c| {
        c.flush(FlushReason::ContextSwitch);
        c.attributes.sync();
        c.counters.publish(false);
        c.publish_textures()
    });
    let Some(old) = symbols::take() else { return PreviousContext::Nothing };
    watched_calls::thread_leaves();
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

/// The driver refused the change: everything stays as it was.
pub(crate) fn restore_current(left: PreviousContext) {
    let context = match left {
        PreviousContext::Nothing => None,
        // It is still current here, so no other thread can have taken it.
        PreviousContext::Idle(handle, _) => registry().idle.remove(&handle),
        PreviousContext::Doomed(context) => Some(context),
    };
    if let Some(mut context) = context {
        context.state.dirty = class::ALL;
        install_current(context);
    }
}

/// `handle` is now current on this thread (0: none), and the context of `left` is not.
pub(crate) fn make_current(handle: usize, left: PreviousContext) {
    if let PreviousContext::Idle(_, Some(textures)) = &left {
        // A change of contexts flushes, so other contexts now see its writes.
        textures.change();
    }
    drop(left);
    if let Some(old) = symbols::take() {
        // A fault kept it from being released properly.
        watched_calls::thread_leaves();
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
    // The register is kept after a fault, too, because only we can execute the lists that we
    // compiled.
    if !crate::faults::happened() {
        context.on_made_current();
    }
    install_current(context);
}

fn install_current(context: Box<Context>) {
    // Called first, so that all calls of the thread are reported from the first one on.
    watched_calls::thread_enters();
    match symbols::install(context) {
        Ok(()) => watched_calls::arm(),
        // Some programs change contexts in exit handlers, when the thread's storage is already
        // gone.
        Err(context) => {
            watched_calls::thread_leaves();
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
    /// Also called when a thread or the program ends with its context current.
    fn drop(&mut self) {
        crate::faults::guard(|| self.counters.publish(true));
    }
}

impl Context {
    fn new(handle: usize, group: ShareGroup, seen_created: bool) -> Context {
        let config = crate::host::config::current();
        let bypassed = !config.settings.enabled;
        let routing = Router::new(&config.settings);
        let mut capture = Capture::default();
        if bypassed {
            capture.immediate_target = ImmediateModeTarget::Pass;
        }
        Context {
            handle,
            destroyed_while_current: false,
            watched_calls: 0,
            errors: KeptErrors::default(),
            tracing_stopped: false,
            bypassed,
            capabilities: DriverCapabilities::default(),
            config,
            state: StateCache::default(),
            attributes: AttributeState::default(),
            capture,
            shared: SharedObjects::new(group, seen_created),
            classifier: Classifier::default(),
            routing,
            presentation: Presentation::default(),
            counters: Counters::default(),
        }
    }

    /// A context that no driver knows.
    #[cfg(test)]
    pub(crate) fn for_tests(handle: usize) -> Context {
        Context::new(handle, ShareGroup::default(), true)
    }

    /// The driver's handle.
    #[cfg(test)]
    pub(crate) fn handle(&self) -> usize {
        self.handle
    }

    #[cfg(test)]
    pub(crate) fn rename(&mut self, handle: usize) {
        self.handle = handle;
    }
}
