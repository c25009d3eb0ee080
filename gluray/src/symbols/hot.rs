//! The way from a hook to the context that is current on its thread.
//!
//! While one thread alone has a context, a pointer to it stands in a static: a thread-local look-up in a shared library costs as
//! much as the rest of a vertex.

use crate::context::{CURRENT, Context};
use crate::immediate::Step;
use std::sync::atomic::{AtomicPtr, Ordering::Relaxed};

static HOT: AtomicPtr<Context> = AtomicPtr::new(core::ptr::null_mut());

/// Says which context all calls belong to, or `None` when that has to be looked up thread by thread. The context must stay where it
/// is until the next call of this function: it is boxed in its thread's [`CURRENT`], which calls this whenever that changes.
pub(crate) fn set_hot(context: Option<&mut Context>) {
    HOT.store(context.map_or(core::ptr::null_mut(), core::ptr::from_mut), Relaxed);
}

/// The short way of a call, with the current context; [`Step::Slow`] when the context has to be looked up.
///
/// `f` must not be handed on to anything that is not inlined: see [`Step`].
#[inline(always)]
pub(super) fn step(f: impl FnOnce(&mut Context) -> Step) -> Step {
    let hot = HOT.load(Relaxed);
    if hot.is_null() {
        return Step::Slow;
    }
    // SAFETY: see `set_hot`; one thread alone has a context, and the vertex calls that come here do not call out.
    f(unsafe { &mut *hot })
}

/// The long way: calls `f` with the current context; false when there is none that we follow.
#[inline(always)]
pub(super) fn with(f: impl FnOnce(&mut Context) -> bool) -> bool {
    let hot = HOT.load(Relaxed);
    if hot.is_null() {
        return with_context(f).unwrap_or(false);
    }
    // SAFETY: as in `step`.
    f(unsafe { &mut *hot })
}

/// As `with`, for calls that are not counted in nanoseconds. `None` without a context, and when we are called by the driver
/// that we called.
pub(crate) fn with_context<R>(f: impl FnOnce(&mut Context) -> R) -> Option<R> {
    CURRENT.try_with(|slot| slot.try_borrow_mut().ok()?.as_deref_mut().map(f)).ok().flatten()
}
