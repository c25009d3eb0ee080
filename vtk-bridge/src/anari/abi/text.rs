//! Reads strings from the program and makes lists of strings for it.

use std::ffi::{CStr, c_char};

/// A copy of a C string; empty for null. What is not UTF-8 is replaced.
///
/// # Safety
/// `s` is null or points to a string that ends with 0.
pub(super) unsafe fn text(s: *const c_char) -> String {
    if s.is_null() {
        return String::new();
    }
    // SAFETY: the caller promised a string that ends with 0.
    unsafe { CStr::from_ptr(s) }.to_string_lossy().into_owned()
}

/// A list of pointers that ends with null, for programs to read at any time.
pub(super) struct StaticList(pub(super) Vec<*const c_char>);

// SAFETY: the pointers lead to strings that are never changed nor freed.
unsafe impl Send for StaticList {}
// SAFETY: as above.
unsafe impl Sync for StaticList {}

/// A string that is never freed. Called for the strings of the schema only, once each.
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
