//! The threads that trace rays. The pool belongs to this library alone. The first frame creates it,
//! so a program that draws nothing gets no threads.

use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};

static PROCESS: AtomicU32 = AtomicU32::new(0);
/// The pool, with the requested number of threads.
static POOL: Mutex<Option<(u32, Arc<rayon::ThreadPool>)>> = Mutex::new(None);

/// True in a child process that was forked after the pool was created. Such a child has none of the
/// pool's threads, so the driver draws there.
pub(crate) fn forked() -> bool {
    let made = PROCESS.load(Relaxed);
    made != 0 && made != std::process::id()
}

/// The pool with the number of threads that the settings give. Without a setting, rayon chooses, or
/// asynchronous tracing takes all cores but one.
fn pool() -> Option<Arc<rayon::ThreadPool>> {
    let settings = &crate::host::config::current().settings;
    // The program keeps one core. All others render.
    let threads = match settings.threads {
        0 if settings.asynchronous => {
            std::thread::available_parallelism().map_or(1, |n| (n.get() as u32 - 1).max(1))
        }
        n => n,
    };
    let mut slot = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    if slot.as_ref().is_none_or(|(n, _)| *n != threads) {
        PROCESS.store(std::process::id(), Relaxed);
        let builder = rayon::ThreadPoolBuilder::new().num_threads(threads as usize);
        let made = builder.thread_name(|i| format!("gluray {i}")).build().ok()?;
        *slot = Some((threads, Arc::new(made)));
    }
    slot.as_ref().map(|(_, pool)| pool.clone())
}

/// Runs `f` on the pool, or on the calling thread when there is no pool.
pub(crate) fn on_pool<R: Send>(f: impl FnOnce() -> R + Send) -> R {
    // A forked child must not touch the pool. Its lock and its threads belong to the parent.
    match if forked() { None } else { pool() } {
        Some(pool) => pool.install(f),
        None => f(),
    }
}

/// Starts `f` on the pool and returns at once. Without a pool, `f` runs on the calling thread.
pub(crate) fn spawn(f: impl FnOnce() + Send + 'static) {
    match if forked() { None } else { pool() } {
        Some(pool) => pool.spawn(move || {
            crate::faults::guard(f);
        }),
        None => f(),
    }
}

/// Runs `f` at some later time, in parallel with the frames.
pub(crate) fn in_background(f: impl FnOnce() + Send + 'static) {
    if forked() {
        return;
    }
    // A separate low-priority thread would be better still. A single builder thread keeps the pool
    // free.
    let spawned = std::thread::Builder::new().name("gluray build".to_owned()).spawn(move || {
        crate::faults::guard(f);
    });
    drop(spawned);
}
