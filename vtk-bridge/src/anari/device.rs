//! The device: makes objects, counts references to them and answers queries. A mistake of the
//! program causes a message and has no other effect.

mod frames;

use super::array::{Array, Storage, byte_size};
use super::data_type::DataType;
use super::frame::{self, Accumulated, FrameState};
use super::handle::Handle;
use super::memory::{AppMemory, OwnMemory};
use super::object::{Object, Value};
use super::scene::Diagnostics;
use super::scene::world::{CompiledWorld, WorldCache};
use super::schema;
use super::status::{Code, Listener, Message, Severity, Status, lock};
use std::any::Any;
use std::collections::HashMap;
use std::ffi::c_void;
use std::sync::{Arc, Mutex, Weak};

/// A parameter's value as the program passed it.
pub enum Raw {
    /// A value, as bytes.
    Bytes(Vec<u8>),
    /// A string.
    Text(String),
    /// An object.
    Handle(Handle),
    /// A pointer, which is never dereferenced.
    Pointer(usize),
}

/// The value of a property.
#[derive(Debug, Clone, PartialEq)]
pub enum Property {
    /// INT32.
    I32(i32),
    /// UINT64.
    U64(u64),
    /// FLOAT32 or a vector or box of them.
    Floats(Vec<f32>),
    /// STRING.
    Text(String),
}

/// What a device needs from the program apart from messages.
pub trait Hooks: Send + Sync {
    /// Calls the program's function of type `ANARIFrameCompletionCallback` at `function` for
    /// `frame`.
    fn frame_completed(&self, function: usize, user: usize, frame: Handle);
}

struct Entry {
    object: Arc<Object>,
    /// References that the program holds.
    public: u64,
}

/// A device. Its functions may be called from any thread.
pub struct Device {
    objects: Mutex<HashMap<Handle, Entry>>,
    status: Arc<Status>,
    hooks: Arc<dyn Hooks>,
    jobs: Mutex<Vec<Weak<frame::Job>>>,
    sums: Mutex<HashMap<Handle, Arc<Mutex<Accumulated>>>>,
}

impl Device {
    /// Makes a device that reports problems to `listener`.
    pub fn new(listener: Box<dyn Listener>, hooks: Arc<dyn Hooks>) -> Device {
        Device {
            objects: Mutex::default(),
            status: Arc::new(Status::new(listener)),
            hooks,
            jobs: Mutex::default(),
            sums: Mutex::default(),
        }
    }

    /// Sends later messages to `listener`.
    pub fn set_listener(&self, listener: Box<dyn Listener>) {
        self.status.set_listener(listener);
    }

    // ---- Messages -------------------------------------------------------------------------------
    fn tell(
        &self,
        source: Handle,
        source_type: DataType,
        severity: Severity,
        text: impl Into<String>,
    ) {
        let code = if severity <= Severity::Warning { Code::InvalidArgument } else { Code::Ok };
        self.status.tell(&Message { source, source_type, severity, code, text: text.into() });
    }

    fn about(&self, object: &Object, severity: Severity, text: impl std::fmt::Display) {
        let text = format!("{}: {text}", object.title());
        let (source, source_type) = (object.handle, object.kind);
        let code = if severity <= Severity::Warning { Code::InvalidArgument } else { Code::Ok };
        self.status.tell_once(&Message { source, source_type, severity, code, text });
    }

    /// Reports a message about the device itself.
    pub fn report(&self, severity: Severity, text: &str) {
        self.tell(Handle::NULL, DataType::DEVICE, severity, text);
    }

    // ---- Objects --------------------------------------------------------------------------------
    fn find(&self, handle: Handle, what: &str) -> Option<Arc<Object>> {
        let found = lock(&self.objects).get(&handle).map(|e| e.object.clone());
        if found.is_none() {
            let text = if handle == Handle::NULL {
                format!("{what}: the object is null")
            } else {
                format!(
                    "{what}: {:#x} is no object of this device; it was released, or belongs to \
                     another device",
                    handle.0
                )
            };
            self.tell(handle, DataType::OBJECT, Severity::Error, text);
        }
        found
    }

    fn keep(&self, object: Object) -> Handle {
        let handle = object.handle;
        lock(&self.objects).insert(handle, Entry { object: Arc::new(object), public: 1 });
        handle
    }

    /// Makes an object. An unknown subtype causes a message and gives an object that accepts
    /// parameters and draws nothing.
    pub fn new_object(&self, kind: DataType, subtype: &str) -> Handle {
        let known = schema::find(kind, subtype).is_some();
        if !known {
            let have: Vec<_> = schema::subtypes(kind).collect();
            let text = format!(
                "there is no {} `{subtype}`; this device has {have:?}",
                kind.name().to_lowercase()
            );
            self.tell(Handle::NULL, kind, Severity::Error, text);
        }
        let state: Box<dyn Any + Send> = match kind {
            DataType::FRAME => Box::<FrameState>::default(),
            DataType::WORLD => Box::<WorldCache>::default(),
            _ => Box::new(()),
        };
        // Programs written for other devices use other names for renderers. All of them get the
        // default renderer.
        self.keep(Object::new(kind, subtype, known, state))
    }

    /// Whether an array of these elements can be made. If not, the reason is reported.
    pub fn check_array(&self, kind: DataType, element: DataType, dims: [u64; 3]) -> Option<usize> {
        let text = match (element.size(), byte_size(element, dims)) {
            (None, _) => format!("elements of type {element} have no size"),
            (_, None) => {
                format!("{dims:?} elements of type {element} are more than fit into memory")
            }
            (_, Some(0)) => {
                format!("{dims:?} elements: an array must have at least one in each dimension")
            }
            (_, bytes) => return bytes,
        };
        self.tell(
            Handle::NULL,
            kind,
            Severity::Error,
            format!("{}: {text}", kind.name().to_lowercase()),
        );
        None
    }

    /// Makes an array in the program's memory, or in the device's own memory if the program passes
    /// none.
    pub(crate) fn new_array(
        &self,
        kind: DataType,
        element: DataType,
        dims: [u64; 3],
        app: Option<AppMemory>,
    ) -> Handle {
        self.keep(self.array_object(kind, element, dims, app))
    }

    fn array_object(
        &self,
        kind: DataType,
        element: DataType,
        dims: [u64; 3],
        app: Option<AppMemory>,
    ) -> Object {
        let storage = match app {
            Some(memory) => Storage::App(memory),
            None => Storage::Own(OwnMemory::zeroed(byte_size(element, dims).unwrap_or(0))),
        };
        let array = Array::new(storage, element, dims);
        let object = Object::new(kind, "", true, Box::new(array));
        self.resolve(&object);
        object
    }

    /// Looks up the objects that an array of handles names.
    fn resolve(&self, array: &Object) {
        let handles =
            array.with_array(|a| if a.element.is_object() { a.handles() } else { Vec::new() });
        let Some(handles) = handles.filter(|h| !h.is_empty()) else { return };
        let objects = {
            let table = lock(&self.objects);
            handles
                .iter()
                .map(|h| table.get(&Handle(*h)).map(|e| e.object.clone()))
                .collect::<Vec<_>>()
        };
        let unknown = handles.iter().zip(&objects).filter(|(h, o)| **h != 0 && o.is_none()).count();
        if unknown > 0 {
            let text = format!(
                "{unknown} of its {} elements are no objects of this device; they are left out",
                handles.len()
            );
            self.about(array, Severity::Error, text);
        }
        // The old objects are dropped after the lock is released.
        let _old = array.with_array(|a| a.set_objects(objects));
    }

    /// Adds a reference of the program.
    pub fn retain(&self, handle: Handle) {
        if self.find(handle, "anariRetain").is_some()
            && let Some(entry) = lock(&self.objects).get_mut(&handle)
        {
            entry.public += 1;
        }
    }

    /// Removes a reference of the program. Without references, the program can no longer use the
    /// object. Objects that other objects refer to stay alive, with a copy of memory that the
    /// program may now free.
    pub fn release(&self, handle: Handle) {
        let Some(object) = self.find(handle, "anariRelease") else { return };
        let gone = {
            let mut table = lock(&self.objects);
            match table.get_mut(&handle) {
                Some(entry) if entry.public > 1 => {
                    entry.public -= 1;
                    None
                }
                Some(_) => table.remove(&handle),
                None => None,
            }
        };
        if gone.is_none() {
            return;
        }
        drop(gone);
        lock(&self.sums).remove(&handle);
        if object.kind == DataType::FRAME {
            // Nobody can request the image any more.
            if let Some(job) = frame::current_job(&object) {
                job.cancel();
                job.wait_until_over();
            }
        }
        if Arc::strong_count(&object) > 1 {
            object.with_array(Array::privatize);
        }
    }

    // ---- Parameters -----------------------------------------------------------------------------
    /// Sets a parameter; it takes effect with the next commit.
    pub fn set_parameter(&self, handle: Handle, name: &str, given: DataType, raw: Raw) {
        let Some(object) = self.find(handle, "anariSetParameter") else { return };
        let value = match raw {
            Raw::Bytes(bytes) => Value::Bytes(given, bytes),
            Raw::Text(text) => Value::Text(text),
            Raw::Pointer(p) => Value::Pointer(given, p),
            Raw::Handle(Handle::NULL) => return object.unset(name),
            Raw::Handle(h) => {
                let what = format!("{}: parameter `{name}`", object.title());
                let Some(other) = self.find(h, &what) else { return };
                if !given.accepts(other.kind) {
                    self.about(
                        &object,
                        Severity::Error,
                        format!(
                            "`{name}` is given as {given}, but it is a {}: it is not set",
                            other.kind
                        ),
                    );
                    return;
                }
                Value::Object(other)
            }
        };
        if !self.knows(&object, name) {
            return;
        }
        object.set(name, value);
    }

    /// Whether the object has a parameter of that name. If not, this is reported once.
    fn knows(&self, object: &Object, name: &str) -> bool {
        let Some(schema) = schema::find(object.kind, &object.subtype) else { return object.known };
        if schema.parameter(name).is_some() {
            return true;
        }
        let near = schema.parameters().map(|p| p.name).find(|p| p.eq_ignore_ascii_case(name));
        let hint = near.map_or(String::new(), |n| format!("; did you mean `{n}`?"));
        self.about(
            object,
            Severity::Warning,
            format!("there is no parameter `{name}` on this device: it changes nothing{hint}"),
        );
        false
    }

    /// Unsets a parameter.
    pub fn unset_parameter(&self, handle: Handle, name: Option<&str>) {
        let Some(object) = self.find(handle, "anariUnsetParameter") else { return };
        match name {
            Some(name) => object.unset(name),
            None => object.unset_all(),
        }
    }

    /// Commits the parameters that were set.
    pub fn commit(&self, handle: Handle) {
        let Some(object) = self.find(handle, "anariCommitParameters") else { return };
        let schema = schema::find(object.kind, &object.subtype);
        object.commit(|name, value| {
            let Some(p) = schema.and_then(|s| s.parameter(name)) else { return false };
            match misfit(p, value) {
                Some(fault) => {
                    self.about(
                        &object,
                        Severity::Error,
                        format!("`{name}` {fault}: it is ignored"),
                    );
                    false
                }
                None => true,
            }
        });
        if object.kind == DataType::ARRAY1D {
            let region = object.numbers("region").map(|r| [r[0] as usize, r[1] as usize]);
            let changed = object.with_array(|a| {
                let all = a.dims[0];
                let valid = region.is_none_or(|[b, e]| b < e && e <= all);
                let region = region.filter(|_| valid);
                (valid, std::mem::replace(&mut a.region, region) != region)
            });
            if let Some((false, _)) = changed {
                self.about(
                    &object,
                    Severity::Error,
                    format!("`region` {region:?} is not a part of its elements: all are used"),
                );
            }
        }
    }

    // ---- Arrays ---------------------------------------------------------------------------------
    /// The address that the program writes to.
    pub fn map_array(&self, handle: Handle) -> *mut c_void {
        let Some(array) = self.find(handle, "anariMapArray") else { return std::ptr::null_mut() };
        let mapped = array.with_array(|a| (std::mem::replace(&mut a.mapped, true), a.address()));
        match mapped {
            Some((again, address)) => {
                if again {
                    self.about(&array, Severity::Warning, "it is mapped already; unmap it first");
                }
                address
            }
            None => {
                self.about(&array, Severity::Error, "anariMapArray: it is no array");
                std::ptr::null_mut()
            }
        }
    }

    /// Called after the program has written.
    pub fn unmap_array(&self, handle: Handle) {
        let Some(array) = self.find(handle, "anariUnmapArray") else { return };
        self.written(&array);
    }

    fn written(&self, array: &Object) {
        match array.with_array(|a| std::mem::replace(&mut a.mapped, false)) {
            Some(true) => {}
            Some(false) => {
                self.about(array, Severity::Warning, "it is unmapped without having been mapped")
            }
            None => return self.about(array, Severity::Error, "anariUnmapArray: it is no array"),
        }
        self.resolve(array);
        array.touch();
    }

    /// Makes an array, sets it as a parameter, and returns its memory and the stride of its
    /// elements in bytes.
    pub fn map_parameter_array(
        &self,
        handle: Handle,
        name: &str,
        kind: DataType,
        element: DataType,
        dims: [u64; 3],
    ) -> Option<(*mut c_void, u64)> {
        let object = self.find(handle, "anariMapParameterArray")?;
        self.check_array(kind, element, dims)?;
        if !self.knows(&object, name) {
            return None;
        }
        let array = self.array_object(kind, element, dims, None);
        let address = array.with_array(|a| {
            a.mapped = true;
            a.address()
        })?;
        object.set(name, Value::Object(Arc::new(array)));
        Some((address, element.size()? as u64))
    }

    /// Called after the program has written to the array of [`Device::map_parameter_array`].
    pub fn unmap_parameter_array(&self, handle: Handle, name: &str) {
        let Some(object) = self.find(handle, "anariUnmapParameterArray") else { return };
        match object.staged(name) {
            Some(Value::Object(array)) if array.kind.is_array() => self.written(&array),
            _ => self.about(
                &object,
                Severity::Error,
                format!("anariUnmapParameterArray: `{name}` is not set to an array"),
            ),
        }
    }

    // ---- Properties -----------------------------------------------------------------------------
    /// A property of the device.
    pub fn device_property(&self, name: &str) -> Option<Property> {
        let version = |i: usize| {
            env!("CARGO_PKG_VERSION").split('.').nth(i).and_then(|v| v.parse().ok()).unwrap_or(0)
        };
        Some(match name {
            "version" => Property::I32(version(0) * 10_000 + version(1) * 100 + version(2)),
            "version.major" => Property::I32(version(0)),
            "version.minor" => Property::I32(version(1)),
            "version.patch" => Property::I32(version(2)),
            "version.name" => Property::Text(format!("rtv {}", env!("CARGO_PKG_VERSION"))),
            "version.name.size" => {
                Property::U64(format!("rtv {}", env!("CARGO_PKG_VERSION")).len() as u64 + 1)
            }
            // The limit for one geometry: 32-bit indices, of which the last means "none".
            "geometryMaxIndex" => Property::U64(u64::from(u32::MAX - 2)),
            _ => return None,
        })
    }

    /// A property of an object. With `wait`, waits until its frame is done.
    pub fn property(&self, handle: Handle, name: &str, wait: bool) -> Option<Property> {
        let object = self.find(handle, "anariGetProperty")?;
        match (object.kind, name) {
            (DataType::WORLD | DataType::GROUP | DataType::INSTANCE, "bounds") => {
                let mut diagnostics = Diagnostics::default();
                let bounds = CompiledWorld::of(&object, &mut diagnostics).bounds;
                self.report_diagnostics(diagnostics);
                let [lo, hi] = bounds?;
                Some(Property::Floats(
                    [lo.to_array(), hi.to_array()].concat().into_iter().map(|v| v as f32).collect(),
                ))
            }
            (DataType::FRAME, "duration" | "numSamples" | "renderProgress") => {
                let done = frame::current_job(&object).is_some_and(|j| j.is_done());
                if name == "renderProgress" && !wait {
                    return Some(Property::Floats(vec![if done { 1.0 } else { 0.0 }]));
                }
                let picture = if wait || done { frame::finish(&object) } else { None }?;
                Some(match name {
                    "numSamples" => Property::I32(picture.samples as i32),
                    "renderProgress" => Property::Floats(vec![1.0]),
                    _ => Property::Floats(vec![picture.duration_secs]),
                })
            }
            _ => None,
        }
    }

    fn report_diagnostics(&self, diagnostics: Diagnostics) {
        diagnostics.0.iter().for_each(|m| self.status.tell_once(m));
    }

    /// The number of objects that the program has not released.
    pub fn num_objects(&self) -> usize {
        lock(&self.objects).len()
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // Later messages and callbacks would reach a program that has already released the device.
        for job in lock(&self.jobs).iter().filter_map(Weak::upgrade) {
            job.cancel();
            job.wait_until_over();
        }
        let left = self.num_objects();
        if left > 0 {
            self.report(
                Severity::Info,
                &format!("the device is released with {left} objects that were not"),
            );
        }
    }
}

/// Explains why a value is not valid for a parameter.
fn misfit(p: &schema::Parameter, value: &Value) -> Option<String> {
    let given = value.data_type();
    if !p.takes(given) {
        let types: Vec<_> = p.types.iter().map(ToString::to_string).collect();
        return Some(format!("is a {given}; it must be {}", types.join(" or ")));
    }
    match value {
        Value::Object(a) if given.is_array() && !p.elements.is_empty() => {
            let element = a.with_array(|a| a.element)?;
            let fits = p.elements.iter().any(|e| e.accepts(element));
            let types =
                || p.elements.iter().map(ToString::to_string).collect::<Vec<_>>().join(" or ");
            (!fits).then(|| format!("is an array of {element}; its elements must be {}", types()))
        }
        Value::Text(t) if !p.values.is_empty() && !p.values.contains(&t.as_str()) => {
            Some(format!("is \"{t}\"; it must be one of {:?}", p.values))
        }
        Value::Bytes(_, b) if !p.type_values.is_empty() => {
            let chosen = DataType(u32::from_ne_bytes([b[0], b[1], b[2], b[3]]));
            let fits = chosen == DataType::UNKNOWN || p.type_values.contains(&chosen);
            (!fits).then(|| format!("is {chosen}; it must be one of {:?}", p.type_values))
        }
        _ => None,
    }
}
