//! A fault of ours must never become a fault of the program: it is logged, and from then on the driver draws everything.

use crate::context::Context;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, OnceLock};

static HAPPENED: AtomicBool = AtomicBool::new(false);
/// Calls of [`guard`] that are running.
static GUARDED: AtomicUsize = AtomicUsize::new(0);
static MESSAGES: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// True once there was one.
pub(crate) fn happened() -> bool {
    HAPPENED.load(Relaxed)
}

/// What happened, for the report.
pub(crate) fn messages() -> Vec<String> {
    MESSAGES.lock().map_or_else(|e| e.into_inner().clone(), |m| m.clone())
}

/// Panics when `GLURAY_INJECT_FAULT` names this place: so that tests see what programs get when something of ours breaks.
pub(crate) fn injected(place: &str) {
    static PLACE: OnceLock<Option<String>> = OnceLock::new();
    let named = PLACE.get_or_init(|| crate::folders::variable("GLURAY_INJECT_FAULT"));
    assert!(named.as_deref().is_none_or(|n| n != place), "a fault in {place}, as GLURAY_INJECT_FAULT asks");
}

/// Keeps Rust's panic message from the program's stderr.
pub(crate) fn silence() {
    let before = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        let ours = GUARDED.load(Relaxed) > 0;
        let text = info.to_string();
        if ours {
            MESSAGES.lock().unwrap_or_else(|e| e.into_inner()).push(text);
        } else {
            before(info);
        }
    }));
}

/// Runs `f`. When it panics: `None`, and gluray retires.
pub(crate) fn guard<R>(f: impl FnOnce() -> R) -> Option<R> {
    GUARDED.fetch_add(1, Relaxed);
    let outcome = catch_unwind(AssertUnwindSafe(f));
    GUARDED.fetch_sub(1, Relaxed);
    match outcome {
        Ok(r) => Some(r),
        Err(_) => {
            if !HAPPENED.swap(true, Relaxed) {
                crate::symbols::retire();
                // What the driver was not told yet. A second fault in here is none of the program's business either.
                catch_unwind(AssertUnwindSafe(|| crate::symbols::with_context(Context::give_up))).ok();
            }
            None
        }
    }
}
