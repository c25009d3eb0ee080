//! The owner of each context, and the path from a hook to the context that is current on its
//! thread.
//!
//! A context is owned by the slot of the thread on which it is current ([`install`], [`take`]) or
//! by the holder of its box. Nothing else in the library has its address, so this file alone
//! contains the argument that there are never two `&mut Context`:
//!
//! 1. *One thread.* The address stands in the thread's own [`SLOT`], and, for the one thread that
//!    got hold of [`OWNER`], in [`HOT`] as well: a thread-local look-up in a shared library costs
//!    as much as the rest of a vertex. [`OWNER`] says whose it is. It goes from 0 to `me` by a
//!    compare-and-exchange of that thread, and from `me` and `me | 1` to anything else by stores of
//!    that thread alone. So a thread that reads its own name in [`OWNER`] reads what it wrote
//!    itself, nobody else has written [`OWNER`] or [`HOT`] since, and [`HOT`] is the address that
//!    it put there. A thread that reads anything else leaves [`HOT`] alone. What two threads do at
//!    the same time therefore does not matter: each transition is one atomic step, and a thread
//!    that comes second finds another's name and keeps to its slot.
//! 2. *One at a time.* While a reference is lent, the thread is busy: `OWNER` is `me | 1` where
//!    this thread has it, and `ThreadSlot::busy` elsewhere. Both ways look, and lend nothing then
//!    (a driver that we call may call us: its debug callback is the program's). [`fast_call`] needs
//!    no mark of its own: what it runs calls nothing but us.
//! 3. *Names of threads.* `me` is the address of the thread's control block, which no two threads
//!    that live have in common (System V ABI for x86-64, `fs:0`). A thread that ends gives its name
//!    up with its slot, in the slot's destructor, before another can be made in its place. A child
//!    of a fork has one thread; names of threads that only its parent has are given up there,
//!    because their memory is handed out again ([`after_fork`]).

use crate::capture::immediate_mode::FastPathResult;
use crate::interpose::context::Context;
use core::cell::Cell;
use core::ptr::null_mut;
use std::sync::Once;
use std::sync::atomic::{AtomicPtr, AtomicUsize, Ordering::Relaxed};

/// The thread whose context is in [`HOT`]; with 1 added while that is lent; 0 for none.
static OWNER: AtomicUsize = AtomicUsize::new(0);
/// Read and written only by the thread that [`OWNER`] names.
static HOT: AtomicPtr<Context> = AtomicPtr::new(null_mut());

/// The context of a thread, which it owns.
struct ThreadSlot {
    context: Cell<*mut Context>,
    busy: Cell<bool>,
}

thread_local! {
    static SLOT: ThreadSlot = const { ThreadSlot { context: Cell::new(null_mut()), busy: Cell::new(false) } };
}

impl Drop for ThreadSlot {
    /// A thread, or the program, ends with its context current.
    fn drop(&mut self) {
        release();
        let context = self.context.replace(null_mut());
        if !context.is_null() {
            crate::watched_calls::thread_leaves();
            // SAFETY: of `Box::into_raw` in `install`; the slot owned it, and nobody can ask the
            // slot any more.
            drop(unsafe { Box::from_raw(context) });
        }
    }
}

/// The name of this thread; a multiple of 8.
#[cfg(all(target_arch = "x86_64", target_os = "linux"))]
#[inline(always)]
fn me() -> usize {
    let out: usize;
    // SAFETY: the ABI of x86-64 has the address of the thread's control block there, which the C
    // library sets up before any code of ours runs.
    unsafe {
        core::arch::asm!("mov {}, \
                          fs:[0]", out(reg) out, options(pure, nomem, nostack, preserves_flags));
    }
    out
}

/// The same where gluray has no entry points.
#[cfg(not(all(target_arch = "x86_64", target_os = "linux")))]
fn me() -> usize {
    thread_local! { static NAME: u64 = const { 0 }; }
    NAME.with(|name| core::ptr::from_ref(name) as usize)
}

/// This thread's name and address are no longer in the statics.
fn release() {
    let me = me();
    if OWNER.load(Relaxed) & !1 == me {
        HOT.store(null_mut(), Relaxed);
        OWNER.store(0, Relaxed);
    }
}

/// In a child that was forked: nobody but this thread is there.
extern "C" fn after_fork() {
    if OWNER.load(Relaxed) & !1 != me() {
        HOT.store(null_mut(), Relaxed);
        OWNER.store(0, Relaxed);
    }
}

/// `context` is current on this thread, which had none. Given back when the thread is ending, and
/// has no place for it.
pub(crate) fn install(context: Box<Context>) -> Result<(), Box<Context>> {
    static FORKS: Once = Once::new();
    FORKS.call_once(|| {
        // SAFETY: the handler is a function of ours that touches two atomics; the library is never
        // unloaded (`-z nodelete`).
        unsafe { libc::pthread_atfork(None, None, Some(after_fork)) };
    });
    if SLOT.try_with(|slot| !slot.context.get().is_null()) != Ok(false) {
        return Err(context);
    }
    let context = Box::into_raw(context);
    // It was there a line above, and only this thread can end it.
    SLOT.with(|slot| slot.context.set(context));
    if OWNER.compare_exchange(0, me(), Relaxed, Relaxed).is_ok() {
        HOT.store(context, Relaxed);
    }
    Ok(())
}

/// Takes the context from this thread; `None` without one, and while it is lent.
pub(crate) fn take() -> Option<Box<Context>> {
    let taken = SLOT.try_with(|slot| {
        if slot.busy.get() || OWNER.load(Relaxed) == me() | 1 {
            return null_mut();
        }
        release();
        slot.context.replace(null_mut())
    });
    let context = taken.unwrap_or(null_mut());
    // SAFETY: of `Box::into_raw` in `install`; neither the slot nor the statics have it any more,
    // and it is not lent.
    (!context.is_null()).then(|| unsafe { Box::from_raw(context) })
}

/// The fast path of a call, with the current context. Returns [`FastPathResult::Slow`] when the
/// context must be looked up, and after a fault.
///
/// `f` must not be passed to anything that is not inlined: see [`FastPathResult`]. It must not call
/// anything that may call us.
#[inline(always)]
pub(super) fn fast_call(
    index: usize,
    f: impl FnOnce(&mut Context) -> FastPathResult,
) -> FastPathResult {
    if OWNER.load(Relaxed) != me() {
        return FastPathResult::Slow;
    }
    let hot = HOT.load(Relaxed);
    let call = || {
        if cfg!(debug_assertions) {
            // Only in test builds: here a load would be measurable.
            crate::faults::inject_at(index);
        }
        // SAFETY: this thread owns it and it is not lent, for that is what `OWNER` says (1 and 2
        // above).
        f(unsafe { &mut *hot })
    };
    crate::faults::caught(call).unwrap_or(FastPathResult::Slow)
}

/// The slow path of a call: runs `f` with the current context. `f` returns whether it has handled
/// the call. Without a context, after a fault, and while the context is bypassed the result is
/// false, and the driver is to be called.
#[inline(always)]
pub(super) fn with(index: usize, f: impl FnOnce(&mut Context) -> bool) -> bool {
    if crate::faults::happened() {
        super::leave_at(index);
        return false;
    }
    let call = || {
        crate::faults::inject_at(index);
        with_context(|c| !c.bypassed && f(c))
    };
    match crate::faults::caught(call) {
        Some(handled) => handled.unwrap_or(false),
        None => {
            super::leave_at(index);
            false
        }
    }
}

/// The same for calls that we handle after a fault, too. It is tried once more.
#[inline(always)]
pub(super) fn with_even_after_fault(index: usize, f: impl Fn(&mut Context) -> bool) -> bool {
    let call = || {
        crate::faults::inject_at(index);
        with_context(&f)
    };
    crate::faults::hand_over_to_driver();
    crate::faults::caught(call).or_else(|| crate::faults::caught(call)).flatten().unwrap_or(false)
}

/// A context is not lent any longer when this goes.
struct LentCurrent(usize);

impl Drop for LentCurrent {
    fn drop(&mut self) {
        OWNER.store(self.0, Relaxed);
    }
}

struct LentSlot<'a>(&'a ThreadSlot);

impl Drop for LentSlot<'_> {
    fn drop(&mut self) {
        self.0.busy.set(false);
    }
}

/// Calls `f` with the current context. `None` without a context, and when we are called by the
/// driver that we called.
#[inline]
pub(crate) fn with_context<R>(f: impl FnOnce(&mut Context) -> R) -> Option<R> {
    let me = me();
    let owner = OWNER.load(Relaxed);
    if owner == me {
        OWNER.store(me | 1, Relaxed);
        let _lent = LentCurrent(me);
        // SAFETY: this thread owns it; until `_lent` goes nobody else gets it (1 and 2 above).
        return Some(f(unsafe { &mut *HOT.load(Relaxed) }));
    }
    if owner == me | 1 {
        return None;
    }
    with_slot(f)
}

#[inline(never)]
fn with_slot<R>(f: impl FnOnce(&mut Context) -> R) -> Option<R> {
    let look_up = |slot: &ThreadSlot| {
        let context = slot.context.get();
        if context.is_null() || slot.busy.replace(true) {
            return None;
        }
        let _lent = LentSlot(slot);
        // SAFETY: the slot owns it, it is this thread's, and not in `HOT`; until `_lent` goes
        // nobody else gets it.
        Some(f(unsafe { &mut *context }))
    };
    SLOT.try_with(look_up).ok().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Barrier;

    fn put(handle: usize) {
        crate::watched_calls::thread_enters();
        assert!(install(Box::new(Context::for_tests(handle))).is_ok(), "the thread had none");
    }

    fn by_step() -> Option<usize> {
        let mut seen = None;
        fast_call(0, |c| {
            seen = Some(c.handle());
            FastPathResult::Done
        });
        seen
    }

    /// In one test, because all tests of a process share the statics.
    #[test]
    fn each_thread_gets_its_own_context_and_none_twice_at_a_time() {
        // A thread without a context does not get another's.
        put(1);
        assert_eq!((by_step(), with_context(|c| c.handle())), (Some(1), Some(1)));
        std::thread::spawn(|| assert_eq!((by_step(), with_context(|c| c.handle())), (None, None)))
            .join()
            .expect("no context of another thread");
        // A second thread neither takes the short way from the first nor gets into it.
        std::thread::spawn(|| {
            put(2);
            assert_eq!((by_step(), with_context(|c| c.handle())), (None, Some(2)));
            let inner =
                with_context(|_| (by_step(), with_context(|c| c.handle()), take().is_none()));
            assert_eq!(inner, Some((None, None, true)), "lent once");
        })
        .join()
        .expect("its own context");
        let inner = with_context(|_| (by_step(), with_context(|c| c.handle()), take().is_none()));
        assert_eq!(inner, Some((None, None, true)), "lent once");
        assert!(install(Box::new(Context::for_tests(9))).is_err(), "there is one");
        // A panic gives back what was lent.
        let panicked =
            std::panic::catch_unwind(|| with_context(|_| std::panic::resume_unwind(Box::new(()))));
        assert!(panicked.is_err() && by_step() == Some(1));
        assert_eq!(take().map(|c| c.handle()), Some(1));
        assert_eq!((by_step(), with_context(|c| c.handle())), (None, None));

        // Threads that make contexts current in turns: the short way goes from hand to hand, and
        // each call finds its own context or none.
        const THREADS: usize = 4;
        const TURNS: usize = 20_000;
        let together = Barrier::new(THREADS);
        let short: usize = std::thread::scope(|s| {
            let work = |thread: usize| {
                let together = &together;
                s.spawn(move || {
                    together.wait();
                    let mut short = 0;
                    let mut own = Box::new(Context::for_tests(thread));
                    for turn in 0..TURNS {
                        let handle = THREADS * turn + thread;
                        own.rename(handle);
                        assert!(install(own).is_ok());
                        for _ in 0..3 {
                            let seen = by_step();
                            assert!(seen.is_none_or(|h| h == handle), "{seen:?} is not {handle}");
                            short += usize::from(seen.is_some());
                            assert_eq!(with_context(|c| c.handle()), Some(handle));
                        }
                        own = take().expect("it is installed");
                        assert!(by_step().is_none());
                    }
                    short
                })
            };
            let threads: Vec<_> = (0..THREADS).map(work).collect();
            threads.into_iter().map(|t| t.join().expect("no thread gets another's context")).sum()
        });
        assert!(short > 0, "somebody took the short way");
        assert_eq!(OWNER.load(Relaxed), 0);

        // A thread that ends with its context current gives up the short way.
        std::thread::spawn(|| {
            put(5);
            assert_eq!(by_step(), Some(5));
        })
        .join()
        .expect("it ends");
        assert_eq!(OWNER.load(Relaxed), 0);
    }
}
