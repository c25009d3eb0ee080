//! Handles: numbers of objects in a table, never addresses. A handle that was freed, was never made
//! or is of another kind is found in the table or not, and nothing is read through it.
//!
//! Objects belong to the thread that made them, as communicators do. What a thread has not freed
//! when it ends is leaked: freeing a communicator waits for the other ranks.

use super::status::Failure;
use super::types::*;
use std::any::Any;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::mem::ManuallyDrop;
use std::rc::Rc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread::ThreadId;

/// The first handle. Small numbers and addresses of memory are none.
const FIRST: usize = 0x5254_5350;
/// Distance of handles, the usual alignment of memory.
const STEP: usize = 16;

/// An object with handles.
pub(crate) trait Handled: 'static {
    /// Its name in errors.
    const NAME: &'static str;
}

struct Slot {
    name: &'static str,
    state: RefCell<State>,
}

struct State {
    /// A call is at work in it, or has panicked there.
    entered: bool,
    value: Box<dyn Any>,
}

type Table = BTreeMap<usize, Rc<Slot>>;

thread_local! {
    static TABLE: RefCell<ManuallyDrop<Table>> = RefCell::default();
}

/// The threads of all handles that live.
static THREADS: Mutex<BTreeMap<usize, ThreadId>> = Mutex::new(BTreeMap::new());
static NEXT: AtomicUsize = AtomicUsize::new(FIRST);

/// A handle of a new object.
pub(crate) fn add<T: Handled>(value: T) -> usize {
    let handle = NEXT.fetch_add(STEP, Ordering::Relaxed);
    let state = RefCell::new(State { entered: false, value: Box::new(value) });
    let slot = Rc::new(Slot { name: T::NAME, state });
    TABLE.with_borrow_mut(|table| table.insert(handle, slot));
    let mut threads = THREADS.lock().unwrap_or_else(PoisonError::into_inner);
    threads.insert(handle, std::thread::current().id());
    handle
}

/// Calls `f` with the object.
pub(crate) fn with<T: Handled, R>(
    handle: usize,
    f: impl FnOnce(&mut T) -> Result<R, Failure>,
) -> Result<R, Failure> {
    let slot = slot_of(handle, T::NAME)?;
    let mut state = slot.state.try_borrow_mut().map_err(|_| busy(T::NAME))?;
    let State { entered, value } = &mut *state;
    let value = value.downcast_mut::<T>().ok_or_else(|| other_kind(slot.name, T::NAME))?;
    if *entered {
        return Err(Failure::new(
            RTSV_COMPOSITE_PANIC,
            format!("a call with this {} has failed by a fault of the library: free it", T::NAME),
        ));
    }
    *entered = true;
    let result = f(value);
    *entered = false;
    result
}

/// Takes the object out of the table; its handle is of no more use.
pub(crate) fn remove<T: Handled>(handle: usize) -> Result<T, Failure> {
    let slot = slot_of(handle, T::NAME)?;
    if slot.state.try_borrow().is_err() {
        return Err(busy(T::NAME));
    }
    TABLE.with_borrow_mut(|table| table.remove(&handle));
    THREADS.lock().unwrap_or_else(PoisonError::into_inner).remove(&handle);
    let slot = Rc::into_inner(slot).ok_or_else(|| busy(T::NAME))?;
    let value = slot.state.into_inner().value.downcast();
    value.map(|value| *value).map_err(|_| other_kind(slot.name, T::NAME))
}

fn busy(name: &str) -> Failure {
    Failure::new(RTSV_COMPOSITE_BUSY, format!("a call with this {name} has not returned"))
}

fn other_kind(found: &str, wanted: &str) -> Failure {
    Failure::new(
        RTSV_COMPOSITE_HANDLE,
        format!("the handle is that of a {found}, not of a {wanted}"),
    )
}

fn slot_of(handle: usize, wanted: &str) -> Result<Rc<Slot>, Failure> {
    if handle == 0 {
        return Err(Failure::new(RTSV_COMPOSITE_POINTER, format!("the {wanted} is null")));
    }
    if let Some(slot) = TABLE.with_borrow(|table| table.get(&handle).cloned()) {
        return if slot.name == wanted { Ok(slot) } else { Err(other_kind(slot.name, wanted)) };
    }
    let threads = THREADS.lock().unwrap_or_else(PoisonError::into_inner);
    Err(match threads.get(&handle) {
        Some(_) => Failure::new(
            RTSV_COMPOSITE_THREAD,
            format!("this {wanted} was made by another thread: use and free it there"),
        ),
        None => Failure::new(
            RTSV_COMPOSITE_HANDLE,
            format!("there is no such {wanted}: it was freed, or never made"),
        ),
    })
}
