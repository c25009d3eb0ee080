//! The pages in memory: those that rays have used last, within a budget.
//!
//! Each page has a lock, so that a page is read once although several threads wait for it. What
//! leaves is decided by a second chance: pages stand in a queue, and one that was used since it was
//! looked at last goes to the end. Threads keep the last few pages that they used besides, so that
//! most rays take no lock.

use std::any::Any;
use std::cell::Cell;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

/// Pages that each thread keeps, by the logarithm of their number.
const RECENT_LOG2: u32 = 4;

/// The key of the cache, the number of the page, and the page.
type RecentPage = Option<(u64, u32, Arc<dyn Any + Send + Sync>)>;

thread_local! {
    static RECENTLY_USED: [Cell<RecentPage>; 1 << RECENT_LOG2] =
        const { [const { Cell::new(None) }; 1 << RECENT_LOG2] };
}

/// Where a thread keeps a page. Numbers of neighbouring bricks of a volume differ by powers of two,
/// which the low bits of numbers would bring to one place (Fibonacci hashing: Knuth, The Art of
/// Computer Programming, volume 3, section 6.4).
fn recent_place(number: u32) -> usize {
    (number.wrapping_mul(0x9e37_79b9) >> (u32::BITS - RECENT_LOG2)) as usize
}

/// A part of a file in memory.
pub(crate) trait Paged: Send + Sync + 'static {
    /// Bytes that it takes.
    fn bytes(&self) -> usize;
}

/// A place for a page.
struct Slot<P> {
    page: Mutex<Option<Arc<P>>>,
    /// Whether it was used since it was looked at last.
    used: AtomicBool,
}

/// The pages of one file.
pub(crate) struct PageCache<P> {
    /// Different for any two caches of a process.
    key: u64,
    slots: Vec<Slot<P>>,
    /// The pages that are in memory.
    queue: Mutex<VecDeque<u32>>,
    budget: usize,
    bytes: AtomicUsize,
    peak: AtomicUsize,
    reads: AtomicU64,
}

/// What the pages of a file take.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct PageUse {
    /// Bytes of the pages in memory.
    pub bytes: usize,
    /// The most that they took since the file was opened.
    pub peak: usize,
    /// Pages that were read, those that were read again included.
    pub reads: u64,
}

/// The contents of a lock. What a panic left in it is whole: it is only ever replaced.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<P: Paged> PageCache<P> {
    pub(crate) fn new(pages: usize, budget: usize) -> PageCache<P> {
        static KEYS: AtomicU64 = AtomicU64::new(0);
        let slot = || Slot { page: Mutex::new(None), used: AtomicBool::new(false) };
        PageCache {
            key: KEYS.fetch_add(1, Ordering::Relaxed),
            slots: (0..pages).map(|_| slot()).collect(),
            queue: Mutex::new(VecDeque::new()),
            budget,
            bytes: AtomicUsize::new(0),
            peak: AtomicUsize::new(0),
            reads: AtomicU64::new(0),
        }
    }

    /// Different for any two caches of a process.
    pub(crate) fn key(&self) -> u64 {
        self.key
    }

    pub(crate) fn page_use(&self) -> PageUse {
        PageUse {
            bytes: self.bytes.load(Ordering::Relaxed),
            peak: self.peak.load(Ordering::Relaxed),
            reads: self.reads.load(Ordering::Relaxed),
        }
    }

    /// Calls `work` with page `number`, which `read` reads where it is not in memory. `None` when
    /// it cannot be read.
    pub(crate) fn with<R>(
        &self,
        number: u32,
        read: impl FnOnce() -> Option<P>,
        work: impl FnOnce(&P) -> R,
    ) -> Option<R> {
        // Taken out while it is at work, and put back: counting one more owner would be two atomic
        // operations for each visit of a brick. Should `work` come to the same page, it finds it
        // below, as other threads do.
        RECENTLY_USED.with(|pages| {
            let place = &pages[recent_place(number)];
            let recent = match place.take() {
                Some(recent) if (recent.0, recent.1) == (self.key, number) => recent,
                other => {
                    place.set(other);
                    (self.key, number, self.page(number, read)? as Arc<dyn Any + Send + Sync>)
                }
            };
            let result = recent.2.downcast_ref().map(work);
            place.set(Some(recent));
            result
        })
    }

    fn page(&self, number: u32, read: impl FnOnce() -> Option<P>) -> Option<Arc<P>> {
        let slot = self.slots.get(number as usize)?;
        slot.used.store(true, Ordering::Relaxed);
        let mut held = lock(&slot.page);
        if let Some(page) = &*held {
            return Some(page.clone());
        }
        let page = Arc::new(read()?);
        *held = Some(page.clone());
        self.reads.fetch_add(1, Ordering::Relaxed);
        let bytes = self.bytes.fetch_add(page.bytes(), Ordering::Relaxed) + page.bytes();
        // Before others leave: both are in memory now.
        self.peak.fetch_max(bytes, Ordering::Relaxed);
        let mut queue = lock(&self.queue);
        queue.push_back(number);
        self.make_room(&mut queue, bytes);
        Some(page)
    }

    /// Removes pages until the budget is kept, or each has been looked at twice. Never waits for
    /// the lock of a page: whoever holds it may wait for the queue.
    fn make_room(&self, queue: &mut VecDeque<u32>, mut bytes: usize) {
        for _ in 0..2 * queue.len() {
            if bytes <= self.budget {
                return;
            }
            let Some(number) = queue.pop_front() else { return };
            let slot = &self.slots[number as usize];
            let mut held = match slot.page.try_lock() {
                Ok(held) => held,
                Err(TryLockError::Poisoned(held)) => held.into_inner(),
                Err(TryLockError::WouldBlock) => {
                    queue.push_back(number);
                    continue;
                }
            };
            if slot.used.swap(false, Ordering::Relaxed) {
                queue.push_back(number);
                continue;
            }
            let freed = held.take().map_or(0, |page| page.bytes());
            bytes = self.bytes.fetch_sub(freed, Ordering::Relaxed) - freed;
        }
    }
}
