//! The second half of the function table: queries, frames and extensions.

use super::{DeviceObject, Name, Object, This, guard, handle};
use crate::anari::abi::introspection::Introspection;
use crate::anari::abi::text::text;
use crate::anari::data_type::DataType;
use crate::anari::device::Property;
use crate::anari::status::Severity;
use crate::capi::guarded;
use std::ffi::{c_char, c_int, c_void};

// ---- Queries ------------------------------------------------------------------------------------
/// Writes a property to the program's memory if the type matches and there is enough room.
///
/// # Safety
/// `mem` is writable for `size` bytes.
unsafe fn write(property: &Property, wanted: DataType, mem: *mut c_void, size: u64) -> bool {
    let (fits, bytes) = match property {
        Property::I32(v) => {
            (matches!(wanted, DataType::INT32 | DataType::UINT32), v.to_ne_bytes().to_vec())
        }
        Property::U64(v) => (wanted == DataType::UINT64, v.to_ne_bytes().to_vec()),
        Property::Floats(v) => {
            let fits =
                matches!(wanted.0, 1068..=1071 | 2008..=2011) && wanted.size() == Some(4 * v.len());
            (fits, v.iter().flat_map(|f| f.to_ne_bytes()).collect())
        }
        Property::Text(t) => {
            // Truncated to the available room, always with a terminator.
            let room = usize::try_from(size).unwrap_or(usize::MAX).saturating_sub(1);
            let mut bytes = t.as_bytes()[..t.len().min(room)].to_vec();
            bytes.push(0);
            (wanted == DataType::STRING && size > 0, bytes)
        }
    };
    if !fits || mem.is_null() || (bytes.len() as u64) > size {
        return false;
    }
    // SAFETY: the caller promised `size` bytes, and there are no more than that; both are bytes and
    // do not overlap.
    unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), mem.cast::<u8>(), bytes.len()) };
    true
}

pub(super) unsafe extern "C" fn get_property(
    this: This,
    o: Object,
    name: Name,
    t: u32,
    mem: *mut c_void,
    size: u64,
    mask: u32,
) -> c_int {
    let get = |d: &DeviceObject| {
        // SAFETY: a string that ends with 0, or null.
        let name = unsafe { text(name) };
        let of_device = o == this.cast();
        if of_device
            && name == "extension"
            && DataType(t) == DataType::STRING_LIST
            && size >= 8
            && !mem.is_null()
        {
            // SAFETY: there is room for a pointer; it may be unaligned.
            unsafe {
                mem.cast::<*const *const c_char>()
                    .write_unaligned(Introspection::get().extensions())
            };
            return 1;
        }
        let property = if of_device {
            d.device.device_property(&name)
        } else {
            d.device.property(handle(o), &name, mask & 1 == 1)
        };
        // SAFETY: ANARI's contract: `mem` has `size` bytes.
        property.is_some_and(|p| unsafe { write(&p, DataType(t), mem, size) }).into()
    };
    // SAFETY: called through the table of a device of ours.
    unsafe { guard(this, 0, get) }
}

pub(super) unsafe extern "C" fn object_subtypes(_this: This, kind: u32) -> *const *const c_char {
    guarded(std::ptr::null(), || Introspection::get().subtypes(DataType(kind)))
}

pub(super) unsafe extern "C" fn object_info(
    _this: This,
    kind: u32,
    subtype: Name,
    info: Name,
    wanted: u32,
) -> *const c_void {
    guarded(std::ptr::null(), || {
        // SAFETY: strings that end with 0, or null.
        let (subtype, info) = unsafe { (text(subtype), text(info)) };
        Introspection::get().object_info(DataType(kind), &subtype, &info, DataType(wanted))
    })
}

pub(super) unsafe extern "C" fn parameter_info(
    _this: This,
    kind: u32,
    subtype: Name,
    parameter: Name,
    _parameter_type: u32,
    info: Name,
    wanted: u32,
) -> *const c_void {
    guarded(std::ptr::null(), || {
        // SAFETY: strings that end with 0, or null.
        let (subtype, parameter, info) = unsafe { (text(subtype), text(parameter), text(info)) };
        let all = Introspection::get();
        all.parameter_info(DataType(kind), &subtype, &parameter, &info, DataType(wanted))
    })
}

// ---- Frames -------------------------------------------------------------------------------------
pub(super) unsafe extern "C" fn map_frame(
    this: This,
    o: Object,
    channel: Name,
    width: *mut u32,
    height: *mut u32,
    kind: *mut u32,
) -> *const c_void {
    let map = |d: &DeviceObject| {
        // SAFETY: a string that ends with 0, or null.
        let channel = unsafe { text(channel) };
        let mapped = d.device.map_frame(handle(o), &channel);
        let (address, [w, h], t) = mapped.unwrap_or((std::ptr::null(), [0; 2], DataType::UNKNOWN));
        for (place, value) in [(width, w), (height, h), (kind, t.0)] {
            if !place.is_null() {
                // SAFETY: ANARI's contract: each may be written to.
                unsafe { place.write(value) };
            }
        }
        address
    };
    // SAFETY: called through the table of a device of ours.
    unsafe { guard(this, std::ptr::null(), map) }
}

pub(super) unsafe extern "C" fn unmap_frame(this: This, o: Object, channel: Name) {
    // SAFETY: called through the table of a device of ours, with a string that ends with 0.
    unsafe { guard(this, (), |d| d.device.unmap_frame(handle(o), &text(channel))) }
}

pub(super) unsafe extern "C" fn render_frame(this: This, o: Object) {
    // SAFETY: called through the table of a device of ours.
    unsafe { guard(this, (), |d| d.device.render_frame(handle(o))) }
}

pub(super) unsafe extern "C" fn frame_ready(this: This, o: Object, mask: u32) -> c_int {
    // SAFETY: called through the table of a device of ours.
    unsafe { guard(this, 1, |d| d.device.frame_ready(handle(o), mask & 1 == 1).into()) }
}

pub(super) unsafe extern "C" fn discard_frame(this: This, o: Object) {
    // SAFETY: called through the table of a device of ours.
    unsafe { guard(this, (), |d| d.device.discard_frame(handle(o))) }
}

// ---- Remaining entries --------------------------------------------------------------------------
pub(super) unsafe extern "C" fn new_extension_object(
    this: This,
    kind: Name,
    subtype: Name,
) -> Object {
    let refuse = |d: &DeviceObject| {
        // SAFETY: strings that end with 0, or null.
        let (kind, subtype) = unsafe { (text(kind), text(subtype)) };
        d.device.report(
            Severity::Error,
            &format!("there are no objects of kind `{kind}` (`{subtype}`) on this device"),
        );
        std::ptr::null_mut()
    };
    // SAFETY: called through the table of a device of ours.
    unsafe { guard(this, std::ptr::null_mut(), refuse) }
}

pub(super) unsafe extern "C" fn proc_address(_this: This, _name: Name) -> *const c_void {
    std::ptr::null()
}

pub(super) unsafe extern "C" fn destroy(_this: This) {
    // Devices are destroyed by `release`; the loader never deletes them.
}
