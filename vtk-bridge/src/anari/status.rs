//! Messages to the program: what failed or was ignored, and how to fix it.

use super::data_type::DataType;
use super::object::Handle;
use std::collections::HashSet;
use std::sync::Mutex;

/// How bad it is, with ANARI's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The device cannot go on.
    Fatal = 1,
    /// What was asked for was not done.
    Error = 2,
    /// It was done differently from what was asked, or left out.
    Warning = 3,
    /// It works, but slower than it could.
    Performance = 4,
    /// Worth knowing.
    Info = 5,
    /// For people who look for faults.
    Debug = 6,
}

/// ANARI's status codes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Code {
    /// No error.
    Ok = 0,
    /// None of the others.
    Unknown = 1,
    /// An argument is wrong.
    InvalidArgument = 2,
    /// Not now, or not on this object.
    InvalidOperation = 3,
}

/// Something to tell the program.
#[derive(Debug, Clone, PartialEq)]
pub struct Message {
    /// Which object it is about; the null handle for none or the device.
    pub source: Handle,
    /// Kind of the object.
    pub source_type: DataType,
    /// How bad it is.
    pub severity: Severity,
    /// ANARI's code.
    pub code: Code,
    /// What happened, and the cure.
    pub text: String,
}

/// Who gets the messages.
pub trait Listener: Send + Sync {
    /// Takes a message; may be called from any thread.
    fn message(&self, message: &Message);
}

/// Messages on their way; those that could come with every frame are given once.
pub struct Status {
    listener: Mutex<Box<dyn Listener>>,
    told: Mutex<HashSet<String>>,
}

impl Status {
    /// Messages go to `listener`.
    pub fn new(listener: Box<dyn Listener>) -> Status {
        Status { listener: Mutex::new(listener), told: Mutex::default() }
    }

    /// From now on messages go to `listener`.
    pub fn set_listener(&self, listener: Box<dyn Listener>) {
        *lock(&self.listener) = listener;
    }

    /// Tells.
    pub fn tell(&self, message: &Message) {
        lock(&self.listener).message(message);
    }

    /// Tells unless the same text about the same object has been told before.
    pub fn tell_once(&self, message: &Message) {
        let key = format!("{:?} {}", message.source, message.text);
        if lock(&self.told).insert(key) {
            self.tell(message);
        }
    }
}

/// A lock whatever other threads did while they held it: the data behind the device's locks is
/// never left half changed.
pub(crate) fn lock<T: ?Sized>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}
