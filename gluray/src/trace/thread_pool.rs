//! The threads that trace: a pool of our own, made when the first frame comes, so that a program
//! that draws nothing gets no threads.

use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};

static PROCESS: AtomicU32 = AtomicU32::new(0);
/// The pool with the number of threads that was asked for.
static POOL: Mutex<Option<(u32, Arc<rayon::ThreadPool>)>> = Mutex::new(None);

/// True in a child that was forked after the pool was made: it has none of the pool's threads, so
/// the driver draws there.
pub(crate) fn forked() -> bool {
    let made = PROCESS.load(Relaxed);
    made != 0 && made != std::process::id()
}

/// The pool with as many threads as are set now; all that there are when nothing is set.
fn pool() -> Option<Arc<rayon::ThreadPool>> {
    let settings = &crate::host::config::current().settings;
    // Beside the program, which has a core of its own, all the others render.
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

/// Runs `f` on the pool; here when there can be none.
pub(crate) fn on_pool<R: Send>(f: impl FnOnce() -> R + Send) -> R {
    // A child of a fork must not touch the pool: its lock and its threads are the parent's.
    match if forked() { None } else { pool() } {
        Some(pool) => pool.install(f),
        None => f(),
    }
}

/// Starts `f` on the pool and goes on; does it here when there is no pool.
pub(crate) fn spawn(f: impl FnOnce() + Send + 'static) {
    match if forked() { None } else { pool() } {
        Some(pool) => pool.spawn(move || {
            crate::interpose::panic_guard::guard(f);
        }),
        None => f(),
    }
}

/// Runs `f` some time, beside the frames.
pub(crate) fn in_background(f: impl FnOnce() + Send + 'static) {
    if forked() {
        return;
    }
    // A thread of its own with a low priority would be better still; one builder at a time keeps
    // the pool free.
    let spawned = std::thread::Builder::new().name("gluray build".to_owned()).spawn(move || {
        crate::interpose::panic_guard::guard(f);
    });
    drop(spawned);
}
