//! The device object: one function per entry of `anari::DeviceImpl`'s table. Each function only
//! translates its arguments and results.

mod answers;

use super::callback::{Callback, Callbacks, Own, StatusCallback};
use super::text::text;
use crate::anari::data_type::DataType;
use crate::anari::device::{Device, Raw};
use crate::anari::handle::Handle;
use crate::anari::memory::{AppMemory, Deleter};
use crate::anari::status::{Severity, lock};
use std::ffi::{c_char, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use answers::{
    destroy, discard_frame, frame_ready, get_property, map_frame, new_extension_object,
    object_info, object_subtypes, parameter_info, proc_address, render_frame, unmap_frame,
};

/// The layout of `anari::DeviceImpl`: its function table, its two members, then our own.
#[repr(C)]
pub(super) struct DeviceObject {
    table: *const *const c_void,
    default_callback: Option<StatusCallback>,
    default_user: *const c_void,
    references: AtomicU64,
    own: Own,
    /// Status callback and its user pointer, as set; they take effect on commit.
    staged: Mutex<(usize, usize)>,
    device: Device,
}

type This = *mut DeviceObject;
type Name = *const c_char;
type Object = *mut c_void;
type Function = *const c_void;

impl DeviceObject {
    pub(super) fn create(
        default_callback: Option<StatusCallback>,
        default_user: *const c_void,
        own: Own,
        listener: Callback,
    ) -> *mut c_void {
        let device = Device::new(Box::new(listener), Arc::new(Callbacks(Arc::clone(&own))));
        let staged =
            Mutex::new((default_callback.map_or(0, |f| f as usize), default_user as usize));
        let this = Box::into_raw(Box::new(DeviceObject {
            table: TABLE.functions.as_ptr(),
            default_callback,
            default_user,
            references: AtomicU64::new(1),
            own: Arc::clone(&own),
            staged,
            device,
        }));
        own.store(this as usize, Ordering::Release);
        this.cast()
    }
}

/// Runs `f`. A panic is reported as a message and returns `default`.
///
/// # Safety
/// `this` is one of our device objects and has not been released.
unsafe fn guard<T>(this: This, default: T, f: impl FnOnce(&DeviceObject) -> T) -> T {
    // SAFETY: the caller promised it; all of its fields that change have locks.
    let object = unsafe { &*this };
    match catch_unwind(AssertUnwindSafe(|| f(object))) {
        Ok(value) => value,
        Err(_) => {
            object
                .device
                .report(Severity::Error, "internal error: the device panicked; please report it");
            default
        }
    }
}

fn handle(o: Object) -> Handle {
    Handle(o as u64)
}

fn object(h: Handle) -> Object {
    h.0 as Object
}

// ---- Object creation ----------------------------------------------------------------------------
/// # Safety
/// As ANARI asks of `anariNewArray`: `app` is null or `dims` elements that stay readable until the
/// array is released.
unsafe fn new_array(
    this: This,
    app: *const c_void,
    deleter: Option<Deleter>,
    user: *const c_void,
    element: u32,
    kind: DataType,
    dims: [u64; 3],
) -> Object {
    let make = |d: &DeviceObject| {
        let element = DataType(element);
        let Some(bytes) = d.device.check_array(kind, element, dims) else {
            return std::ptr::null_mut();
        };
        // SAFETY: the caller promised this memory; `bytes` is the size of `dims` elements.
        let memory = (!app.is_null())
            .then(|| unsafe { AppMemory::new(app, bytes, deleter.map(|f| (f, user))) });
        object(d.device.new_array(kind, element, dims, memory))
    };
    // SAFETY: called through the table of a device of ours.
    unsafe { guard(this, std::ptr::null_mut(), make) }
}

unsafe extern "C" fn new_array_1d(
    this: This,
    app: *const c_void,
    del: Option<Deleter>,
    user: *const c_void,
    t: u32,
    n: u64,
) -> Object {
    // SAFETY: ANARI's contract, passed on.
    unsafe { new_array(this, app, del, user, t, DataType::ARRAY1D, [n, 1, 1]) }
}

unsafe extern "C" fn new_array_2d(
    this: This,
    app: *const c_void,
    del: Option<Deleter>,
    user: *const c_void,
    t: u32,
    n: u64,
    m: u64,
) -> Object {
    // SAFETY: ANARI's contract, passed on.
    unsafe { new_array(this, app, del, user, t, DataType::ARRAY2D, [n, m, 1]) }
}

unsafe extern "C" fn new_array_3d(
    this: This,
    app: *const c_void,
    del: Option<Deleter>,
    user: *const c_void,
    t: u32,
    n: u64,
    m: u64,
    k: u64,
) -> Object {
    // SAFETY: ANARI's contract, passed on.
    unsafe { new_array(this, app, del, user, t, DataType::ARRAY3D, [n, m, k]) }
}

macro_rules! constructors {
    ($($name:ident: $kind:ident;)*) => {
        $(unsafe extern "C" fn $name(this: This, subtype: Name) -> Object {
            // SAFETY: ANARI passes a device of ours, and a string that ends with 0 or null.
            unsafe {
                guard(this, std::ptr::null_mut(), |d| {
                    object(d.device.new_object(DataType::$kind, &text(subtype)))
                })
            }
        })*
    };
}

macro_rules! plain_constructors {
    ($($name:ident: $kind:ident;)*) => {
        $(unsafe extern "C" fn $name(this: This) -> Object {
            // SAFETY: ANARI passes a device of ours.
            unsafe { guard(this, std::ptr::null_mut(), |d| object(d.device.new_object(DataType::$kind, ""))) }
        })*
    };
}

constructors! {
    new_geometry: GEOMETRY;
    new_material: MATERIAL;
    new_sampler: SAMPLER;
    new_spatial_field: SPATIAL_FIELD;
    new_volume: VOLUME;
    new_light: LIGHT;
    new_instance: INSTANCE;
    new_camera: CAMERA;
    new_renderer: RENDERER;
}

plain_constructors! {
    new_surface: SURFACE;
    new_group: GROUP;
    new_world: WORLD;
    new_frame: FRAME;
}

// ---- Parameters ---------------------------------------------------------------------------------
/// Reads the value at `mem`; `None` for types without a value.
///
/// # Safety
/// `mem` is what ANARI requires for the type: a string, a pointer value, or the address of a value.
unsafe fn raw(given: DataType, mem: *const c_void) -> Option<Raw> {
    if given == DataType::VOID_POINTER {
        return Some(Raw::Pointer(mem as usize));
    }
    if given.is_object() && mem.is_null() {
        return Some(Raw::Handle(Handle::NULL));
    }
    if mem.is_null() {
        return None;
    }
    if given == DataType::STRING {
        // SAFETY: strings are passed by their address.
        return Some(Raw::Text(unsafe { text(mem.cast()) }));
    }
    let size = given.size()?;
    // SAFETY: all other types are passed by the address of a value of that size; bytes have no
    // alignment.
    let bytes = unsafe { std::slice::from_raw_parts(mem.cast::<u8>(), size) }.to_vec();
    let word = || bytes.first_chunk::<8>().map_or(0, |b| u64::from_ne_bytes(*b));
    Some(match given.0 {
        200..=203 => Raw::Pointer(word() as usize),
        _ if given.is_object() => Raw::Handle(Handle(word())),
        _ => Raw::Bytes(bytes),
    })
}

unsafe extern "C" fn set_parameter(
    this: This,
    o: Object,
    name: Name,
    given: u32,
    mem: *const c_void,
) {
    let set = |d: &DeviceObject| {
        // SAFETY: ANARI's contract for the arguments.
        let (name, value) = unsafe { (text(name), raw(DataType(given), mem)) };
        let Some(value) = value else {
            d.device.report(
                Severity::Error,
                &format!(
                    "parameter `{name}` of type {} has no value: it is not set",
                    DataType(given)
                ),
            );
            return;
        };
        if o != this.cast() {
            return d.device.set_parameter(handle(o), &name, DataType(given), value);
        }
        match (name.as_str(), value) {
            ("statusCallback", Raw::Pointer(p)) => lock(&d.staged).0 = p,
            ("statusCallbackUserData", Raw::Pointer(p)) => lock(&d.staged).1 = p,
            ("name", _) => {}
            _ => d.device.report(
                Severity::Warning,
                &format!(
                    "the device has no parameter `{name}` of type {}: it changes nothing",
                    DataType(given)
                ),
            ),
        }
    };
    // SAFETY: called through the table of a device of ours.
    unsafe { guard(this, (), set) }
}

unsafe extern "C" fn unset_parameter(this: This, o: Object, name: Name) {
    let unset = |d: &DeviceObject| {
        // SAFETY: a string that ends with 0, or null.
        let name = unsafe { text(name) };
        if o != this.cast() {
            return d.device.unset_parameter(handle(o), Some(&name));
        }
        let mut staged = lock(&d.staged);
        match name.as_str() {
            "statusCallback" => staged.0 = d.default_callback.map_or(0, |f| f as usize),
            "statusCallbackUserData" => staged.1 = d.default_user as usize,
            _ => {}
        }
    };
    // SAFETY: called through the table of a device of ours.
    unsafe { guard(this, (), unset) }
}

unsafe extern "C" fn unset_all_parameters(this: This, o: Object) {
    let unset = |d: &DeviceObject| {
        if o == this.cast() {
            *lock(&d.staged) =
                (d.default_callback.map_or(0, |f| f as usize), d.default_user as usize);
        } else {
            d.device.unset_parameter(handle(o), None);
        }
    };
    // SAFETY: called through the table of a device of ours.
    unsafe { guard(this, (), unset) }
}

/// # Safety
/// `name` is a string that ends with 0; `stride` is null or may be written to.
unsafe fn map_parameter(
    this: This,
    o: Object,
    name: Name,
    t: u32,
    kind: DataType,
    dims: [u64; 3],
    stride: *mut u64,
) -> Object {
    let map = |d: &DeviceObject| {
        // SAFETY: the caller promised it.
        let name = unsafe { text(name) };
        let mapped = d.device.map_parameter_array(handle(o), &name, kind, DataType(t), dims);
        let (address, step) = mapped.unwrap_or((std::ptr::null_mut(), 0));
        if !stride.is_null() {
            // SAFETY: not null, and the caller promised that it may be written to.
            unsafe { stride.write(step) };
        }
        address
    };
    // SAFETY: called through the table of a device of ours.
    unsafe { guard(this, std::ptr::null_mut(), map) }
}

unsafe extern "C" fn map_parameter_1d(
    this: This,
    o: Object,
    name: Name,
    t: u32,
    n: u64,
    stride: *mut u64,
) -> Object {
    // SAFETY: ANARI's contract, passed on.
    unsafe { map_parameter(this, o, name, t, DataType::ARRAY1D, [n, 1, 1], stride) }
}

unsafe extern "C" fn map_parameter_2d(
    this: This,
    o: Object,
    name: Name,
    t: u32,
    n: u64,
    m: u64,
    stride: *mut u64,
) -> Object {
    // SAFETY: ANARI's contract, passed on.
    unsafe { map_parameter(this, o, name, t, DataType::ARRAY2D, [n, m, 1], stride) }
}

unsafe extern "C" fn map_parameter_3d(
    this: This,
    o: Object,
    name: Name,
    t: u32,
    n: u64,
    m: u64,
    k: u64,
    stride: *mut u64,
) -> Object {
    // SAFETY: ANARI's contract, passed on.
    unsafe { map_parameter(this, o, name, t, DataType::ARRAY3D, [n, m, k], stride) }
}

unsafe extern "C" fn unmap_parameter(this: This, o: Object, name: Name) {
    // SAFETY: called through the table of a device of ours, with a string that ends with 0.
    unsafe { guard(this, (), |d| d.device.unmap_parameter_array(handle(o), &text(name))) }
}

unsafe extern "C" fn commit(this: This, o: Object) {
    let commit = |d: &DeviceObject| {
        if o != this.cast() {
            return d.device.commit(handle(o));
        }
        let (function, user) = *lock(&d.staged);
        // SAFETY: zero is `None`; else the program gave it as a parameter of type STATUS_CALLBACK.
        let function = unsafe { std::mem::transmute::<usize, Option<StatusCallback>>(function) };
        // SAFETY: the program keeps it valid while the device has it as a parameter.
        let callback =
            unsafe { Callback::new(function, user as *const c_void, Arc::clone(&d.own)) };
        d.device.set_listener(Box::new(callback));
    };
    // SAFETY: called through the table of a device of ours.
    unsafe { guard(this, (), commit) }
}

// ---- Lifetime -----------------------------------------------------------------------------------
unsafe extern "C" fn release(this: This, o: Object) {
    if o != this.cast() {
        // SAFETY: called through the table of a device of ours.
        return unsafe { guard(this, (), |d| d.device.release(handle(o))) };
    }
    // SAFETY: called with a device of ours that has a reference left.
    let last = unsafe { &*this }.references.fetch_sub(1, Ordering::AcqRel) == 1;
    if last {
        // SAFETY: made by `Box::into_raw` in `create`; the program has no reference left.
        let own = unsafe { Box::from_raw(this) };
        // Dropping it waits for running frames; a panic there must not reach the program.
        let _ = catch_unwind(AssertUnwindSafe(|| drop(own)));
    }
}

unsafe extern "C" fn retain(this: This, o: Object) {
    let retain = |d: &DeviceObject| {
        if o == this.cast() {
            d.references.fetch_add(1, Ordering::AcqRel);
        } else {
            d.device.retain(handle(o));
        }
    };
    // SAFETY: called through the table of a device of ours.
    unsafe { guard(this, (), retain) }
}

unsafe extern "C" fn map_array(this: This, a: Object) -> Object {
    // SAFETY: called through the table of a device of ours.
    unsafe { guard(this, std::ptr::null_mut(), |d| d.device.map_array(handle(a))) }
}

unsafe extern "C" fn unmap_array(this: This, a: Object) {
    // SAFETY: called through the table of a device of ours.
    unsafe { guard(this, (), |d| d.device.unmap_array(handle(a))) }
}

#[repr(C)]
struct Table {
    offset_to_top: isize,
    type_information: *const c_void,
    functions: [Function; 41],
}

// SAFETY: functions and a null, never changed.
unsafe impl Sync for Table {}

static TABLE: Table = Table {
    offset_to_top: 0,
    type_information: std::ptr::null(),
    functions: [
        new_array_1d as Function,
        new_array_2d as Function,
        new_array_3d as Function,
        new_geometry as Function,
        new_material as Function,
        new_sampler as Function,
        new_surface as Function,
        new_spatial_field as Function,
        new_volume as Function,
        new_light as Function,
        new_group as Function,
        new_instance as Function,
        new_world as Function,
        new_camera as Function,
        new_renderer as Function,
        new_frame as Function,
        set_parameter as Function,
        unset_parameter as Function,
        unset_all_parameters as Function,
        map_parameter_1d as Function,
        map_parameter_2d as Function,
        map_parameter_3d as Function,
        unmap_parameter as Function,
        commit as Function,
        release as Function,
        retain as Function,
        map_array as Function,
        unmap_array as Function,
        get_property as Function,
        object_subtypes as Function,
        object_info as Function,
        parameter_info as Function,
        map_frame as Function,
        unmap_frame as Function,
        render_frame as Function,
        frame_ready as Function,
        discard_frame as Function,
        new_extension_object as Function,
        proc_address as Function,
        destroy as Function,
        destroy as Function,
    ],
};
