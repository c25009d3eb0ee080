//! Detects which of the two layouts of `anari::LibraryImpl` the loader in this process uses.
//!
//! A virtual function was inserted into the middle of the class between two releases of the SDK.
//! Both layouts are in use (pynari 1.2.6 ships the older one), and no argument tells them apart. A
//! loader with the new function also exports `anariNewInitializedDevice`, so this module looks for
//! that symbol.

use std::ffi::{CStr, c_char, c_int, c_void};

const MARK: &CStr = c"anariNewInitializedDevice";

/// What the search found of ANARI's loaders in this process.
#[derive(Default)]
struct Seen {
    any: bool,
    initialized_devices: bool,
}

/// Whether the loader calls `newInitializedDevice`. A loader that cannot be found (it may be linked
/// into the program) is assumed to be a current one.
pub(super) fn has_initialized_devices() -> bool {
    // SAFETY: looks a name up in the modules that are visible to all.
    let global = unsafe { !libc::dlsym(libc::RTLD_DEFAULT, MARK.as_ptr()).is_null() };
    if global {
        return true;
    }
    let mut seen = Seen::default();
    // SAFETY: `look` is called for each module before this returns, with the address of `seen`.
    unsafe { libc::dl_iterate_phdr(Some(look), (&raw mut seen).cast()) };
    seen.initialized_devices || !seen.any
}

unsafe extern "C" fn look(
    module: *mut libc::dl_phdr_info,
    _size: usize,
    seen: *mut c_void,
) -> c_int {
    // SAFETY: the C library gives a valid module; `seen` is what `has_initialized_devices` passed.
    let (name, seen) = unsafe { ((*module).dlpi_name, &mut *seen.cast::<Seen>()) };
    // SAFETY: names of modules end with 0.
    if !name.is_null() && is_loader(unsafe { CStr::from_ptr(name) }) {
        seen.any = true;
        seen.initialized_devices |= exports_mark(name);
    }
    0
}

fn is_loader(name: &CStr) -> bool {
    let name = name.to_string_lossy();
    name.rsplit('/').next().is_some_and(|file| file.starts_with("libanari.so"))
}

fn exports_mark(name: *const c_char) -> bool {
    // SAFETY: NOLOAD only returns another reference to a module that is already loaded; the
    // reference is released below.
    unsafe {
        let module = libc::dlopen(name, libc::RTLD_LAZY | libc::RTLD_NOLOAD);
        if module.is_null() {
            return false;
        }
        let found = !libc::dlsym(module, MARK.as_ptr()).is_null();
        libc::dlclose(module);
        found
    }
}
