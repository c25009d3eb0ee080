//! Objects: parameters that take effect when they are committed, and reference counts.
//!
//! A program knows an object by its [`Handle`], a number that is never a memory address and is
//! never reused. The device therefore detects and reports a handle that was released too often or
//! that belongs to another device. Parameters hold [`Arc`]s, so an object stays alive after its
//! release while other objects refer to it.

use super::data_type::DataType;
use super::handle::Handle;
use super::status::lock;
use std::any::Any;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// The value of a parameter.
#[derive(Clone)]
pub enum Value {
    /// Numbers, by their type and bytes.
    Bytes(DataType, Vec<u8>),
    /// A string.
    Text(String),
    /// Another object, with the type under which it was passed.
    Object(Arc<Object>),
    /// A pointer of the program, returned to it and never dereferenced.
    Pointer(DataType, usize),
}

impl Value {
    /// The type of the value. An object has its own type.
    pub fn data_type(&self) -> DataType {
        match self {
            Value::Bytes(t, _) | Value::Pointer(t, _) => *t,
            Value::Text(_) => DataType::STRING,
            Value::Object(o) => o.kind,
        }
    }

    /// A number that changes when the value changes, or when the data of an array that it names
    /// changes.
    pub(crate) fn fingerprint(&self, out: &mut Vec<u64>) {
        out.push(u64::from(self.data_type().0));
        match self {
            Value::Bytes(_, b) => out.extend(b.chunks(8).map(|c| {
                let mut wide = [0; 8];
                wide[..c.len()].copy_from_slice(c);
                u64::from_ne_bytes(wide)
            })),
            Value::Text(t) => out.extend(t.bytes().map(u64::from)),
            Value::Object(o) => out.extend([o.handle.0, o.version()]),
            Value::Pointer(_, p) => out.push(*p as u64),
        }
    }
}

/// Committed parameters by name.
pub type Parameters = BTreeMap<String, Value>;

/// An object of a device.
pub struct Object {
    /// The program's handle for it.
    pub handle: Handle,
    /// Kind of the object.
    pub kind: DataType,
    /// Subtype. Empty for kinds without subtypes; for unknown subtypes, the name that the program
    /// requested.
    pub subtype: String,
    /// False if the device does not have this subtype. The object then accepts parameters and draws
    /// nothing.
    pub known: bool,
    staged: Mutex<Parameters>,
    committed: Mutex<Arc<Parameters>>,
    version: AtomicU64,
    /// What only some kinds of objects have, by their own modules' types: an array's data, a
    /// frame's images, a world's cached results.
    state: Mutex<Box<dyn Any + Send>>,
}

impl Object {
    pub(crate) fn new(
        kind: DataType,
        subtype: &str,
        known: bool,
        state: Box<dyn Any + Send>,
    ) -> Object {
        Object {
            handle: Handle::fresh(),
            kind,
            subtype: subtype.to_owned(),
            known,
            staged: Mutex::default(),
            committed: Mutex::default(),
            version: AtomicU64::new(0),
            state: Mutex::new(state),
        }
    }

    /// Sets a parameter; it takes effect with the next commit.
    pub(crate) fn set(&self, name: &str, value: Value) {
        // The old value is dropped after the lock is released, because it may be the last reference
        // to an array whose deleter calls back.
        let _old = lock(&self.staged).insert(name.to_owned(), value);
    }

    pub(crate) fn unset(&self, name: &str) {
        let _old = lock(&self.staged).remove(name);
    }

    pub(crate) fn unset_all(&self) {
        let _old = std::mem::take(&mut *lock(&self.staged));
    }

    pub(crate) fn staged(&self, name: &str) -> Option<Value> {
        lock(&self.staged).get(name).cloned()
    }

    /// Commits the parameters, except those that `usable` rejects.
    pub(crate) fn commit(&self, mut usable: impl FnMut(&str, &Value) -> bool) {
        let staged = lock(&self.staged).clone();
        let fresh: Parameters =
            staged.into_iter().filter(|(name, value)| usable(name, value)).collect();
        let old = std::mem::replace(&mut *lock(&self.committed), Arc::new(fresh));
        self.touch();
        drop(old);
    }

    /// The committed parameters.
    pub fn parameters(&self) -> Arc<Parameters> {
        lock(&self.committed).clone()
    }

    /// The number of commits and of changes to array data.
    pub fn version(&self) -> u64 {
        self.version.load(Ordering::Acquire)
    }

    pub(crate) fn touch(&self) {
        self.version.fetch_add(1, Ordering::AcqRel);
    }

    /// Name of the object in a status message: "geometry `sphere`".
    pub fn title(&self) -> String {
        let kind = self.kind.name().to_lowercase();
        let name = match self.parameters().get("name") {
            Some(Value::Text(n)) => format!(" \"{n}\""),
            _ => String::new(),
        };
        if self.subtype.is_empty() {
            format!("{kind}{name}")
        } else {
            format!("{kind} `{}`{name}", self.subtype)
        }
    }

    // ---- Committed parameters by type -----------------------------------------------------------
    /// Numbers of a parameter with any numeric type.
    pub(crate) fn numbers(&self, name: &str) -> Option<Vec<f64>> {
        match self.parameters().get(name)? {
            Value::Bytes(t, b) => Some(t.numbers(b)),
            _ => None,
        }
    }

    pub(crate) fn f32(&self, name: &str, default: f32) -> f32 {
        self.numbers(name).and_then(|v| v.first().copied()).map_or(default, |v| v as f32)
    }

    pub(crate) fn u32(&self, name: &str, default: u32) -> u32 {
        self.numbers(name).and_then(|v| v.first().copied()).map_or(default, |v| v as u32)
    }

    pub(crate) fn bool(&self, name: &str, default: bool) -> bool {
        self.numbers(name).and_then(|v| v.first().copied()).map_or(default, |v| v != 0.0)
    }

    pub(crate) fn vector<const N: usize>(&self, name: &str, default: [f64; N]) -> [f64; N] {
        let given = self.numbers(name);
        std::array::from_fn(|i| {
            given.as_ref().and_then(|v| v.get(i)).copied().unwrap_or(default[i])
        })
    }

    pub(crate) fn text(&self, name: &str) -> Option<String> {
        match self.parameters().get(name)? {
            Value::Text(t) => Some(t.clone()),
            _ => None,
        }
    }

    pub(crate) fn object(&self, name: &str) -> Option<Arc<Object>> {
        match self.parameters().get(name)? {
            Value::Object(o) => Some(o.clone()),
            _ => None,
        }
    }

    /// Passes the object's state to `f` while nobody else has it; `None` if it has no `T`.
    pub(crate) fn with_state<T: 'static, R>(&self, f: impl FnOnce(&mut T) -> R) -> Option<R> {
        lock(&self.state).downcast_mut().map(f)
    }
}
