//! The threads that trace: a pool of our own, made when the first frame comes, so that a program that draws nothing gets no threads.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

static PROCESS: AtomicU32 = AtomicU32::new(0);
static POOL: OnceLock<Option<rayon::ThreadPool>> = OnceLock::new();

/// True in a child that was forked after the pool was made: it has none of the pool's threads, so the driver draws there.
pub(crate) fn forked() -> bool {
    let made = PROCESS.load(Relaxed);
    made != 0 && made != std::process::id()
}

fn pool() -> Option<&'static rayon::ThreadPool> {
    POOL.get_or_init(|| {
        PROCESS.store(std::process::id(), Relaxed);
        rayon::ThreadPoolBuilder::new().thread_name(|i| format!("gluray {i}")).build().ok()
    })
    .as_ref()
}

/// Runs `f` on the pool; here when there can be none.
pub(crate) fn on_pool<R: Send>(f: impl FnOnce() -> R + Send) -> R {
    match pool() {
        Some(pool) if !forked() => pool.install(f),
        _ => f(),
    }
}

/// Runs `f` some time, beside the frames.
pub(crate) fn in_background(f: impl FnOnce() + Send + 'static) {
    if forked() {
        return;
    }
    // A thread of its own with a low priority would be better still; one builder at a time keeps the pool free.
    let spawned = std::thread::Builder::new().name("gluray build".to_owned()).spawn(move || {
        crate::fault::guard(f);
    });
    drop(spawned);
}
