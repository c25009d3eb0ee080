//! The library object, which makes devices.

use super::callback::{Callback, Own, StatusCallback};
use super::device::DeviceObject;
use super::frontend::has_initialized_devices;
use super::introspection::Introspection;
use super::text::text;
use crate::anari::status::{Code, Listener, Message, Severity};
use crate::anari::{data_type::DataType, handle::Handle};
use crate::capi::guarded;
use std::ffi::{c_char, c_void};
use std::sync::Arc;

/// The layout of `anari::LibraryImpl`: its function table, then the members that the loader reads
/// (`libraryHandle()` is not virtual).
#[repr(C)]
struct LibraryObject {
    table: *const *const c_void,
    module: *mut c_void,
    callback: Option<StatusCallback>,
    user: *const c_void,
}

type This = *mut LibraryObject;

#[repr(C)]
struct Table {
    offset_to_top: isize,
    type_information: *const c_void,
    destroy: unsafe extern "C" fn(This),
    delete: unsafe extern "C" fn(This),
    new_device: unsafe extern "C" fn(This, *const c_char) -> *mut c_void,
    new_initialized_device: unsafe extern "C" fn(This, *const c_char, *const c_void) -> *mut c_void,
    device_extensions: unsafe extern "C" fn(This, *const c_char) -> *const *const c_char,
    device_subtypes: unsafe extern "C" fn(This) -> *const *const c_char,
    load_module: unsafe extern "C" fn(This, *const c_char),
    unload_module: unsafe extern "C" fn(This, *const c_char),
}

// SAFETY: functions and a null, never changed.
unsafe impl Sync for Table {}

static TABLE: Table = Table {
    offset_to_top: 0,
    type_information: std::ptr::null(),
    destroy,
    delete,
    new_device,
    new_initialized_device,
    device_extensions,
    device_subtypes,
    load_module,
    unload_module,
};

/// The function table of SDKs before `newInitializedDevice` was inserted.
#[repr(C)]
struct OldTable {
    offset_to_top: isize,
    type_information: *const c_void,
    destroy: unsafe extern "C" fn(This),
    delete: unsafe extern "C" fn(This),
    new_device: unsafe extern "C" fn(This, *const c_char) -> *mut c_void,
    device_extensions: unsafe extern "C" fn(This, *const c_char) -> *const *const c_char,
    device_subtypes: unsafe extern "C" fn(This) -> *const *const c_char,
    load_module: unsafe extern "C" fn(This, *const c_char),
    unload_module: unsafe extern "C" fn(This, *const c_char),
}

// SAFETY: functions and a null, never changed.
unsafe impl Sync for OldTable {}

static OLD_TABLE: OldTable = OldTable {
    offset_to_top: 0,
    type_information: std::ptr::null(),
    destroy,
    delete,
    new_device,
    device_extensions,
    device_subtypes,
    load_module,
    unload_module,
};

/// Creates the library object from the loader's arguments: the loaded module, and a status callback
/// for devices without one of their own.
///
/// # Safety
/// `callback` is null or an `ANARIStatusCallback` that may be called with `user` as long as the
/// library or one of its devices exists.
pub unsafe fn new_library(
    module: *mut c_void,
    callback: *const c_void,
    user: *const c_void,
) -> *mut c_void {
    // SAFETY: a null pointer is `None`; any other is a function of this type, as the caller
    // promised.
    let callback =
        unsafe { std::mem::transmute::<*const c_void, Option<StatusCallback>>(callback) };
    let table = if has_initialized_devices() {
        (&raw const TABLE.destroy).cast()
    } else {
        (&raw const OLD_TABLE.destroy).cast()
    };
    Box::into_raw(Box::new(LibraryObject { table, module, callback, user })).cast()
}

/// The entry point that `anariLoadLibrary("rtv", ...)` calls.
///
/// # Safety
/// As for [`new_library`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn anari_library_rtv_new_library(
    module: *mut c_void,
    callback: *const c_void,
    user: *const c_void,
) -> *mut c_void {
    // SAFETY: the loader passes its own arguments, which ANARI defines as `new_library` requires.
    guarded(std::ptr::null_mut(), || unsafe { new_library(module, callback, user) })
}

unsafe extern "C" fn destroy(_this: This) {
    // In-place destruction has nothing to do: the members are plain numbers.
}

unsafe extern "C" fn delete(this: This) {
    // SAFETY: `this` came from `Box::into_raw` in `new_library`, and C++ deletes an object once.
    guarded((), || drop(unsafe { Box::from_raw(this) }));
}

unsafe extern "C" fn new_device(this: This, subtype: *const c_char) -> *mut c_void {
    // SAFETY: the same arguments.
    guarded(std::ptr::null_mut(), || unsafe { make_device(this, subtype) })
}

/// # Safety
/// As ANARI requires of `anariNewDevice`: one of our library objects, and a null-terminated string
/// or null.
unsafe fn make_device(this: This, subtype: *const c_char) -> *mut c_void {
    // SAFETY: the loader calls with the object that it got from us, which nobody changes.
    let library = unsafe { &*this };
    // SAFETY: ANARI passes a string that ends with 0, or null.
    let subtype = unsafe { text(subtype) };
    if !matches!(subtype.as_str(), "" | "default") {
        let own = Own::default();
        // SAFETY: `new_library`'s caller promised this of its arguments.
        let callback = unsafe { Callback::new(library.callback, library.user, own) };
        callback.message(&Message {
            source: Handle::NULL,
            source_type: DataType::LIBRARY,
            severity: Severity::Error,
            code: Code::InvalidArgument,
            text: format!("there is no device `{subtype}`; this library has [\"default\"]"),
        });
        return std::ptr::null_mut();
    }
    let own = Own::default();
    // SAFETY: as above.
    let callback = unsafe { Callback::new(library.callback, library.user, Arc::clone(&own)) };
    DeviceObject::create(library.callback, library.user, own, callback)
}

unsafe extern "C" fn new_initialized_device(
    this: This,
    subtype: *const c_char,
    _values: *const c_void,
) -> *mut c_void {
    // The device has no parameters that must be known before it is created.
    // SAFETY: the same arguments.
    unsafe { new_device(this, subtype) }
}

unsafe extern "C" fn device_extensions(
    _this: This,
    _subtype: *const c_char,
) -> *const *const c_char {
    guarded(std::ptr::null(), || Introspection::get().extensions())
}

unsafe extern "C" fn device_subtypes(_this: This) -> *const *const c_char {
    guarded(std::ptr::null(), || Introspection::get().subtypes(DataType::DEVICE))
}

unsafe extern "C" fn load_module(_this: This, _name: *const c_char) {}

unsafe extern "C" fn unload_module(_this: This, _name: *const c_char) {}
