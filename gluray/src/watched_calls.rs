//! Which calls are reported before they run.
//!
//! Calls that may change state are *watched*. While [`ARMED`] is set, they are reported, which
//! costs some ten nanoseconds. As soon as no report is needed, they cost one comparison. So the
//! driver can keep all state: it is asked at a draw, and again only after a watched call.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed};

/// Zero while watched calls need not be reported: exactly one thread has a context, and no report
/// was requested. Bit 0 is set by a request. The bits above it count the threads that have a
/// context, less one. Both are in one word, so that neither can change unseen while the other is
/// read.
pub static ARMED: AtomicU32 = AtomicU32::new(0_u32.wrapping_sub(2));

/// Watched calls that went straight to the driver.
pub static CALLS: AtomicU64 = AtomicU64::new(0);

/// Requests a report of the next watched call.
#[inline]
pub(crate) fn arm() {
    if ARMED.load(Relaxed) & 1 == 0 {
        ARMED.fetch_or(1, Relaxed);
    }
}

/// Ends the reports of watched calls, unless another thread has a context, too.
pub(crate) fn disarm() {
    // This fails when a second thread has got a context since the caller checked.
    ARMED.compare_exchange(1, 0, Relaxed, Relaxed).ok();
}

/// True when only one thread has a context.
pub(crate) fn is_alone() -> bool {
    ARMED.load(Relaxed) & !1 == 0
}

/// A thread gets a context. Until as many threads have left, all watched calls are reported when it
/// is not the only one.
pub(crate) fn thread_enters() {
    ARMED.fetch_add(2, Relaxed);
}

/// A thread has no context any longer.
pub(crate) fn thread_leaves() {
    ARMED.fetch_sub(2, Relaxed);
}
