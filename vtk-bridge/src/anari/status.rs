//! Messages to the program: what failed or was ignored, and how to fix it.

use super::data_type::DataType;
use super::handle::Handle;
use std::collections::HashSet;
use std::sync::Mutex;

/// Severity, with ANARI's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The device cannot go on.
    Fatal = 1,
    /// The request was not carried out.
    Error = 2,
    /// The request was carried out differently or only in part.
    Warning = 3,
    /// The request works, but is slower than necessary.
    Performance = 4,
    /// Information.
    Info = 5,
    /// Information for debugging.
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
    /// The call is not valid now, or not on this object.
    InvalidOperation = 3,
}

/// A message for the program.
#[derive(Debug, Clone, PartialEq)]
pub struct Message {
    /// The object concerned; the null handle for none or the device.
    pub source: Handle,
    /// Kind of the object.
    pub source_type: DataType,
    /// Severity.
    pub severity: Severity,
    /// ANARI's code.
    pub code: Code,
    /// What happened, and the cure.
    pub text: String,
}

/// Receives the messages.
pub trait Listener: Send + Sync {
    /// Takes a message; may be called from any thread.
    fn message(&self, message: &Message);
}

/// Sends messages. A message that could repeat with every frame is sent once.
pub struct Status {
    listener: Mutex<Box<dyn Listener>>,
    told: Mutex<HashSet<String>>,
}

impl Status {
    /// Makes a sender to `listener`.
    pub fn new(listener: Box<dyn Listener>) -> Status {
        Status { listener: Mutex::new(listener), told: Mutex::default() }
    }

    /// Sends later messages to `listener`.
    pub fn set_listener(&self, listener: Box<dyn Listener>) {
        *lock(&self.listener) = listener;
    }

    /// Sends a message.
    pub fn tell(&self, message: &Message) {
        lock(&self.listener).message(message);
    }

    /// Sends a message unless the same text about the same object was already sent.
    pub fn tell_once(&self, message: &Message) {
        let key = format!("{:?} {}", message.source, message.text);
        if lock(&self.told).insert(key) {
            self.tell(message);
        }
    }
}

/// Takes a lock even if it is poisoned. This is safe because the data behind the device's locks is
/// never left half changed.
pub(crate) fn lock<T: ?Sized>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}
