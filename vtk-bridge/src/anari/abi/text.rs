//! Reads strings from the program and makes lists of strings for it.

use std::ffi::{CStr, c_char};

/// Copies a C string; empty for null. Invalid UTF-8 is replaced.
///
/// # Safety
/// `s` is null or points to a null-terminated string.
pub(super) unsafe fn text(s: *const c_char) -> String {
    if s.is_null() {
        return String::new();
    }
    // SAFETY: the caller promised a string that ends with 0.
    unsafe { CStr::from_ptr(s) }.to_string_lossy().into_owned()
}

/// A null-terminated list of pointers that programs may read at any time.
pub(super) struct StaticList(pub(super) Vec<*const c_char>);

// SAFETY: the pointers refer to strings that are never changed or freed.
unsafe impl Send for StaticList {}
// SAFETY: as above.
unsafe impl Sync for StaticList {}

/// Makes a string that is never freed. Called only for the strings of the schema, once each.
pub(super) fn forever(s: &str) -> *const c_char {
    let bytes: Vec<u8> = s.bytes().filter(|b| *b != 0).collect();
    std::ffi::CString::new(bytes).unwrap_or_default().into_raw()
}

impl StaticList {
    pub(super) fn new<'a>(strings: impl IntoIterator<Item = &'a str>) -> StaticList {
        let mut list: Vec<_> = strings.into_iter().map(forever).collect();
        list.push(std::ptr::null());
        StaticList(list)
    }
}
