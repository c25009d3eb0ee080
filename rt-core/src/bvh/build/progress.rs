//! How far a build has come, and whether it goes on.

use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Most primitives that a thread treats between two looks at whether the build goes on. A fragment
/// of the builder is at most as large.
pub(crate) const PRIMITIVES_BETWEEN_CHECKS: usize = 1 << 16;

/// The build was stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Stopped;

/// Someone who watches builds.
pub(crate) trait Watch: Sync {
    /// Shows how far the build is, unless the watcher is still occupied, and stops it if told so.
    fn show(&self, progress: &Progress<'_>);
}

/// Lets one thread at a time call a closure. The others do not wait for it.
pub(crate) struct OneAtATime<F>(Mutex<F>);

impl<F: FnMut(f64) -> ControlFlow<()> + Send> OneAtATime<F> {
    pub(crate) fn new(watch: F) -> Self {
        OneAtATime(Mutex::new(watch))
    }
}

impl<F: FnMut(f64) -> ControlFlow<()> + Send> Watch for OneAtATime<F> {
    fn show(&self, progress: &Progress<'_>) {
        let Ok(mut watch) = self.0.try_lock() else { return };
        // All under the lock: what is shown grows, and nothing is shown after a stop.
        if !progress.is_stopped() && watch(progress.part_done()).is_break() {
            progress.stopped.store(true, Ordering::Relaxed);
        }
    }
}

/// Counts what is done, tells the watching caller, and remembers whether it stopped the build.
pub(crate) struct Progress<'w> {
    watch: Option<&'w dyn Watch>,
    /// Primitives to build, and those in finished fragments.
    total: u64,
    done: AtomicU64,
    stopped: AtomicBool,
}

/// Nobody watches, and nothing stops the build.
pub(crate) static UNWATCHED: Progress<'static> =
    Progress { watch: None, total: 1, done: AtomicU64::new(0), stopped: AtomicBool::new(false) };

impl<'w> Progress<'w> {
    pub(crate) fn watched_by(watch: &'w dyn Watch, total: usize) -> Self {
        let (watch, total) = (Some(watch), total.max(1) as u64);
        Progress { watch, total, done: AtomicU64::new(0), stopped: AtomicBool::new(false) }
    }

    /// Tells the caller how far the build is. While it is being told on another thread, this one
    /// goes on: the caller is never asked by two at once, and nobody waits.
    pub(crate) fn check(&self) -> Result<(), Stopped> {
        let Some(watch) = self.watch else { return Ok(()) };
        watch.show(self);
        if self.is_stopped() { Err(Stopped) } else { Ok(()) }
    }

    fn part_done(&self) -> f64 {
        self.done.load(Ordering::Relaxed).min(self.total) as f64 / self.total as f64
    }

    /// `primitives` more are done.
    pub(crate) fn advance(&self, primitives: usize) -> Result<(), Stopped> {
        if self.watch.is_some() {
            self.done.fetch_add(primitives as u64, Ordering::Relaxed);
        }
        self.check()
    }

    /// Whether to go on with element `i` of a long loop; asks the caller from time to time.
    #[inline]
    pub(crate) fn goes_on_at(&self, i: u32) -> bool {
        if (i as usize).is_multiple_of(PRIMITIVES_BETWEEN_CHECKS) {
            return self.check().is_ok();
        }
        !self.is_stopped()
    }

    #[inline]
    pub(crate) fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    /// Everything is done; the last time that the caller is asked.
    pub(crate) fn finish(&self) -> Result<(), Stopped> {
        self.advance(self.total as usize)
    }
}
