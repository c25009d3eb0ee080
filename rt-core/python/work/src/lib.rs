//! Runs work of a native module on a pool of threads while the interpreter does something else.
//! Ctrl-C stops the work, a panic becomes a `RuntimeError`, and a forked child gets threads of its
//! own.
#![forbid(unsafe_code)]

use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

/// Most threads that a call may ask for: each size of pool that was used stays.
const MOST_THREADS: usize = 1024;
/// Time between two looks for Ctrl-C.
const BETWEEN_SIGNALS: Duration = Duration::from_millis(30);

/// The pools of this process, by their number of threads.
struct Pools {
    process: u32,
    pools: Vec<(usize, Arc<ThreadPool>)>,
}

/// The pools of a package; a `static` of its native module.
pub struct Workers {
    /// Name of the package in messages and in the names of threads.
    package: &'static str,
    /// Locked only by who holds the interpreter. `os.fork` holds it too, so no child begins with
    /// the lock taken.
    pools: Mutex<Pools>,
    /// Calls whose work stopped early.
    stopped: AtomicUsize,
}

/// The threads that `threads=None` stands for.
pub fn count_threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Tells work whether to stop early.
#[derive(Default)]
pub struct Stop {
    asked: Arc<AtomicBool>,
    /// Whether the work has seen it before its end.
    seen: AtomicBool,
}

impl Stop {
    /// Whether the work is to stop, which it then does.
    pub fn is_asked(&self) -> bool {
        let asked = self.asked.load(Ordering::Relaxed);
        if asked {
            self.seen.store(true, Ordering::Relaxed);
        }
        asked
    }

    /// The same, for who looks at it by themselves and tells [`Stop::note`].
    pub fn flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.asked)
    }

    /// Says that the work has stopped early because of the flag.
    pub fn note(&self) {
        self.seen.store(true, Ordering::Relaxed);
    }
}

/// How long a call may take.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Length {
    /// Shorter than waking a thread: the calling thread does the work.
    Immediate,
    /// Short: Ctrl-C is looked for after it.
    Short,
    /// Longer: Ctrl-C is looked for meanwhile, on a thread of its own.
    Long,
}

impl Workers {
    /// No threads yet.
    pub const fn new(package: &'static str) -> Workers {
        let pools = Mutex::new(Pools { process: 0, pools: Vec::new() });
        Workers { package, pools, stopped: AtomicUsize::new(0) }
    }

    /// Calls of this process whose work saw Ctrl-C before its end. The packages' tests tell by it
    /// that a call did not go on to its end.
    pub fn count_stopped(&self) -> usize {
        self.stopped.load(Ordering::Relaxed)
    }

    /// A pool of `threads` threads; of as many as the machine has for 0.
    fn pool(&self, _py: Python<'_>, threads: usize) -> PyResult<Arc<ThreadPool>> {
        check_threads(threads)?;
        let threads = if threads == 0 { count_threads() } else { threads };
        let mut all = self.pools.lock().unwrap_or_else(PoisonError::into_inner);
        if all.process != std::process::id() {
            // After a fork the threads of the parent's pools do not exist here. To drop a pool
            // would wait for them.
            std::mem::forget(std::mem::take(&mut all.pools));
            all.process = std::process::id();
        }
        if let Some((_, pool)) = all.pools.iter().find(|(n, _)| *n == threads) {
            return Ok(Arc::clone(pool));
        }
        let package = self.package;
        let name = move |i| format!("{package}-{i}");
        let pool = ThreadPoolBuilder::new().num_threads(threads).thread_name(name).build();
        let pool = Arc::new(pool.map_err(|e| {
            PyRuntimeError::new_err(format!("threads is {threads}: {e}; ask for fewer"))
        })?);
        all.pools.push((threads, Arc::clone(&pool)));
        Ok(pool)
    }

    /// Runs `work` on `threads` threads (0: all) without the interpreter. Ctrl-C asks `work` to
    /// stop, and its result is then lost. A panic becomes a `RuntimeError`.
    ///
    /// # Errors
    /// What a signal handler raises, `RuntimeError` for a panic, and `ValueError` for too many
    /// threads.
    pub fn run<R: Send>(
        &self,
        py: Python<'_>,
        threads: usize,
        length: Length,
        work: impl FnOnce(&Stop) -> R + Send,
    ) -> PyResult<R> {
        let stop = Stop::default();
        let result = if length == Length::Immediate {
            check_threads(threads)?;
            Ok(py.detach(|| catch_unwind(AssertUnwindSafe(|| work(&stop)))))
        } else {
            let pool = self.pool(py, threads)?;
            let guarded = || catch_unwind(AssertUnwindSafe(|| pool.install(|| work(&stop))));
            match length {
                Length::Long => watched(py, &stop, guarded),
                Length::Short | Length::Immediate => Ok(py.detach(guarded)),
            }
        };
        if stop.seen.load(Ordering::Relaxed) {
            self.stopped.fetch_add(1, Ordering::Relaxed);
        }
        let result = result?;
        py.check_signals()?;
        result.map_err(|panic| {
            PyRuntimeError::new_err(format!(
                "a defect of {0}; please report it with this text, `{0}.__version__` and the call: \
                 {1}",
                self.package,
                text_of(&*panic)
            ))
        })
    }
}

fn check_threads(threads: usize) -> PyResult<()> {
    if threads <= MOST_THREADS {
        return Ok(());
    }
    Err(PyValueError::new_err(format!(
        "threads is {threads}; give 1 to {MOST_THREADS}, or None for all of this machine"
    )))
}

/// Runs `work` on another thread, while this one looks for Ctrl-C.
fn watched<R: Send>(py: Python<'_>, stop: &Stop, work: impl FnOnce() -> R + Send) -> PyResult<R> {
    let ended = (Mutex::new(false), Condvar::new());
    std::thread::scope(|scope| {
        let worker = scope.spawn(|| {
            let result = work();
            *ended.0.lock().unwrap_or_else(PoisonError::into_inner) = true;
            ended.1.notify_all();
            result
        });
        let mut interrupted = None;
        while !py.detach(|| wait(&ended)) {
            if interrupted.is_none()
                && let Err(error) = py.check_signals()
            {
                stop.asked.store(true, Ordering::Relaxed);
                interrupted = Some(error);
            }
        }
        let result = py.detach(|| worker.join());
        match (interrupted, result) {
            (Some(error), _) => Err(error),
            (None, Ok(result)) => Ok(result),
            (None, Err(panic)) => Err(PyRuntimeError::new_err(text_of(&*panic).to_owned())),
        }
    })
}

/// Waits until the work has ended, but not for long; whether it has.
fn wait((ended, changed): &(Mutex<bool>, Condvar)) -> bool {
    let guard = ended.lock().unwrap_or_else(PoisonError::into_inner);
    let waited = changed.wait_timeout_while(guard, BETWEEN_SIGNALS, |ended| !*ended);
    *waited.unwrap_or_else(PoisonError::into_inner).0
}

fn text_of(panic: &(dyn Any + Send)) -> &str {
    let owned = panic.downcast_ref::<String>().map(String::as_str);
    owned.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message")
}
