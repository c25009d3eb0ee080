//! Keeps faults of this library from becoming faults of the program. A fault is logged, and from
//! then on the driver draws everything.
//!
//! Everything that the program can call runs under [`caught`], which costs nothing without a fault.
//! After a fault, each thread draws what its context has held back (`Context::stop_tracing`), at
//! once or at its next call.

use crate::calls;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, OnceLock};

static HAPPENED: AtomicBool = AtomicBool::new(false);
/// The library runs inside a program, so all panics of its own standard library are ours.
static IN_PROGRAM: AtomicBool = AtomicBool::new(false);
/// The number of running calls of [`guard`], in our own programs.
static GUARDED: AtomicUsize = AtomicUsize::new(0);
static MESSAGES: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// True after a fault.
#[inline]
pub(crate) fn happened() -> bool {
    HAPPENED.load(Relaxed)
}

/// The messages of faults, for the report.
pub(crate) fn messages() -> Vec<String> {
    MESSAGES.lock().map_or_else(|e| e.into_inner().clone(), |m| m.clone())
}

// ---- Faults that tests ask for ------------------------------------------------------------------
fn asked_for() -> Option<&'static str> {
    static PLACE: OnceLock<Option<String>> = OnceLock::new();
    let variable = || std::env::var("GLURAY_INJECT_FAULT").ok().filter(|v| !v.is_empty());
    PLACE.get_or_init(variable).as_deref()
}

/// Panics when `GLURAY_INJECT_FAULT` names this place. Tests check what the program gets when
/// something of ours breaks.
pub(crate) fn injected(place: &str) {
    assert!(!is_asked_for(place), "a fault in {place}, as GLURAY_INJECT_FAULT asks");
}

/// True when `GLURAY_INJECT_FAULT` names this place.
pub(crate) fn is_asked_for(place: &str) -> bool {
    asked_for() == Some(place)
}

/// The entry point that is to fail, and the number of its calls that succeed before.
static ENTRY: AtomicUsize = AtomicUsize::new(usize::MAX);
static CALLS_BEFORE: AtomicU32 = AtomicU32::new(0);

/// `GLURAY_INJECT_FAULT=glEnd` fails in the first call of `glEnd` that we handle, `glEnd:3` in the
/// third.
fn plan_injection() {
    let Some(text) = asked_for() else { return };
    let (name, call) = text.split_once(':').unwrap_or((text, "1"));
    if let (Some(index), Ok(call)) = (calls::index_of(name.as_bytes()), call.parse::<u32>()) {
        CALLS_BEFORE.store(call.saturating_sub(1), Relaxed);
        ENTRY.store(index, Relaxed);
    }
}

/// Panics when a test wants this entry point to fail.
#[inline(always)]
pub(crate) fn inject_at(index: usize) {
    if index == ENTRY.load(Relaxed) {
        inject_now(index);
    }
}

#[cold]
#[inline(never)]
fn inject_now(index: usize) {
    if CALLS_BEFORE.fetch_update(Relaxed, Relaxed, |n| n.checked_sub(1)).is_err() {
        ENTRY.store(usize::MAX, Relaxed);
        panic!("a fault in {:?}, as GLURAY_INJECT_FAULT asks", calls::NAMES[index]);
    }
}

// ---- Catching -----------------------------------------------------------------------------------
/// What ends the tracing.
pub(crate) struct Handlers {
    /// Called after the first fault.
    pub(crate) first: fn(),
    /// Called after each fault, on its thread: the context draws what it has held back, unless it
    /// has done so.
    pub(crate) each: fn(),
}

static HANDLERS: OnceLock<Handlers> = OnceLock::new();

/// Sets what ends the tracing, once. Without it a fault ends nothing: there is no tracing.
pub(crate) fn when_one_happens(handlers: Handlers) {
    HANDLERS.get_or_init(|| handlers);
}

/// The program calls the library for the first time.
pub(crate) fn in_program() {
    IN_PROGRAM.store(true, Relaxed);
    silence();
    plan_injection();
}

/// Keeps Rust's panic message from stderr.
pub(crate) fn silence() {
    let before = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        // The library has its own standard library, so no panic of the program arrives here.
        if IN_PROGRAM.load(Relaxed) || GUARDED.load(Relaxed) > 0 {
            let (mut messages, text) =
                (MESSAGES.lock().unwrap_or_else(|e| e.into_inner()), info.to_string());
            // A retry may fail again.
            if !messages.contains(&text) {
                messages.push(text);
            }
        } else {
            before(info);
        }
    }));
}

/// Runs `f`, a part of a call of the program. When it panics, returns `None` and ends the tracing.
#[inline(always)]
pub(crate) fn caught<R>(f: impl FnOnce() -> R) -> Option<R> {
    match catch_unwind(AssertUnwindSafe(f)) {
        Ok(r) => Some(r),
        Err(payload) => {
            // The payload may be anything, and its destructor may panic.
            std::mem::forget(payload);
            end();
            None
        }
    }
}

/// The same for work that is not part of a call of the program.
pub(crate) fn guard<R>(f: impl FnOnce() -> R) -> Option<R> {
    GUARDED.fetch_add(1, Relaxed);
    let out = caught(f);
    GUARDED.fetch_sub(1, Relaxed);
    out
}

/// Runs `f` after a fault. Returns `None` when it panics as well.
pub(crate) fn attempt<R>(f: impl FnOnce() -> R) -> Option<R> {
    catch_unwind(AssertUnwindSafe(f)).map_err(std::mem::forget).ok()
}

#[cold]
#[inline(never)]
fn end() {
    if !HAPPENED.swap(true, Relaxed)
        && let Some(handlers) = HANDLERS.get()
    {
        attempt(handlers.first);
    }
    hand_over_to_driver();
}

/// After a fault, the context of this thread draws what it has held back, unless it has done so.
pub(crate) fn hand_over_to_driver() {
    if happened()
        && let Some(handlers) = HANDLERS.get()
    {
        attempt(handlers.each);
    }
}
