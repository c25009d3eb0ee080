//! How programs and GLVND find the trampolines: what is behind `dlsym`, `glXGetProcAddress`,
//! `__glx_Main` and `__egl_Main`.

use super::entry_points::EntryPoints;
use super::{in_program, register, trampoline};
use crate::calls::index_of;
use crate::driver;
use crate::faults::caught;
use crate::interpose::glvnd;
use core::ffi::{CStr, c_char, c_int, c_void};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicPtr, AtomicUsize, Ordering::Relaxed};

/// libc's `dlsym`, from the first look-up on.
pub static REAL_DLSYM: AtomicPtr<()> = AtomicPtr::new(core::ptr::null_mut());

/// Our address for a name that a program looks up itself, or null for libc's answer.
///
/// # Safety
/// The arguments must be such as dlsym takes.
pub unsafe fn looked_up(
    entry_points: &'static EntryPoints,
    handle: *mut c_void,
    name: *const c_char,
) -> *const () {
    // SAFETY: the program's own arguments of dlsym.
    caught(|| unsafe { address_of_ours(entry_points, handle, name) }).unwrap_or(core::ptr::null())
}

/// # Safety
/// The arguments must be such as dlsym takes.
unsafe fn address_of_ours(
    entry_points: &'static EntryPoints,
    handle: *mut c_void,
    name: *const c_char,
) -> *const () {
    REAL_DLSYM.store(driver::dlsym_address().cast_mut(), Relaxed);
    if name.is_null() || driver::is_vendor() {
        return core::ptr::null();
    }
    // SAFETY: dlsym takes a C string.
    let name = unsafe { CStr::from_ptr(name) };
    let bytes = name.to_bytes();
    if !(bytes.starts_with(b"gl") || bytes.starts_with(b"egl")) || index_of(bytes).is_none() {
        return core::ptr::null();
    }
    // Not earlier: allocators look up other names before anything can be allocated.
    register(entry_points);
    crate::faults::injected("dlsym");
    // A name that the program's library lacks is not found here either.
    // SAFETY: the program's own arguments.
    let there = unsafe { driver::call_dlsym(handle, name) };
    if there.is_null() { there } else { trampoline(name).unwrap_or(core::ptr::null()) }
}

/// The driver's answer, replaced by our trampoline if there is one. A null answer stays null, for
/// feature detection.
pub(super) fn replaced(name: *const c_char, driver: *const ()) -> *const () {
    if driver.is_null() || name.is_null() {
        return driver;
    }
    // SAFETY: the program's C string.
    let name = unsafe { CStr::from_ptr(name) };
    trampoline(name).unwrap_or(driver)
}

// ---- GLVND --------------------------------------------------------------------------------------
/// The part that GLX and EGL have in common of the table of functions that a vendor library fills.
pub type Imports = [*const (); 10];
type VendorMain = unsafe extern "C" fn(u32, *const c_void, *mut c_void, *mut Imports) -> c_int;

/// `__glx_Main` or `__egl_Main` of the vendors that GLVND would have taken without us, in its
/// order. GLX has only one.
fn vendor_mains(egl: bool) -> Vec<*const ()> {
    let get = crate::host::folders::variable;
    let (libraries, main, most): (Vec<String>, _, _) = match egl {
        true => {
            let vendors = glvnd::egl_vendors(get);
            let libraries = vendors.iter().map(|v| glvnd::egl_library(&v.name)).collect();
            (libraries, c"__egl_Main", usize::MAX)
        }
        false => {
            let vendors = glvnd::glx_vendors(get);
            (vendors.iter().map(|v| format!("libGLX_{}.so.0", v.name)).collect(), c"__glx_Main", 1)
        }
    };
    driver::mains_of(libraries, main).take(most).collect()
}

unsafe extern "C" fn glx_address(name: *const c_char) -> *const () {
    // SAFETY: GLVND's own string.
    let text = unsafe { CStr::from_ptr(name) };
    let driver = driver::vendor_address(text, false);
    let ours = || {
        crate::faults::injected("address");
        if text.to_bytes().starts_with(b"glXGetProcAddress") {
            driver
        } else {
            replaced(name, driver)
        }
    };
    caught(ours).unwrap_or(driver)
}

unsafe extern "C" fn egl_address(name: *const c_char) -> *const () {
    // SAFETY: GLVND's own string.
    let text = unsafe { CStr::from_ptr(name) };
    let mut driver = driver::vendor_address(text, true);
    let ours = || {
        crate::faults::injected("address");
        if driver.is_null() && EGL_CHOSEN.load(Relaxed) == NOBODY {
            // GLVND asks before there is a display. Our trampoline then finds the function of the
            // driver that has it.
            let of_any = egl_drivers().iter().map(|d| of_driver(d, name)).find(|f| !f.is_null());
            driver = of_any.unwrap_or(driver);
        }
        if text.to_bytes() == b"eglGetProcAddress" { driver } else { replaced(name, driver) }
    };
    caught(ours).unwrap_or(driver)
}

/// GLVND's entry into a GLX vendor library: the driver's, with our addresses.
///
/// # Safety
/// The arguments must be those that GLVND gives to `__glx_Main`.
pub unsafe fn glx_main(
    entry_points: &'static EntryPoints,
    version: u32,
    exports: *const c_void,
    vendor: *mut c_void,
    imports: *mut Imports,
) -> c_int {
    let find = || {
        register(entry_points);
        in_program();
        crate::faults::injected("__glx_Main");
        driver::put_glvnd_first();
    };
    // After a fault, the vendor that GLVND would take without us is still found.
    caught(find);
    let mains = caught(|| vendor_mains(false)).unwrap_or_default();
    let Some(main) = mains.into_iter().next() else { return 0 };
    // SAFETY: `__glx_Main` of the driver, with the arguments GLVND gives to it.
    unsafe {
        let main: VendorMain = core::mem::transmute(main);
        if main(version, exports, vendor, imports) == 0 {
            return 0;
        }
        driver::set_vendor((*imports)[1], false);
        (*imports)[1] = glx_address as *const ();
        // This prevents GLVND from patching our entry points.
        (5..9).for_each(|i| (*imports)[i] = core::ptr::null());
    }
    1
}

/// GLVND's entry into an EGL vendor library.
///
/// # Safety
/// The arguments must be those that GLVND gives to `__egl_Main`.
pub unsafe fn egl_main(
    entry_points: &'static EntryPoints,
    version: u32,
    exports: *const c_void,
    vendor: *mut c_void,
    imports: *mut Imports,
) -> c_int {
    let find = || {
        register(entry_points);
        in_program();
        crate::faults::injected("__egl_Main");
        driver::put_glvnd_first();
    };
    // After a fault, the vendors that GLVND would take without us are still found.
    caught(find);
    let mut all = Vec::new();
    for main in caught(|| vendor_mains(true)).unwrap_or_default() {
        // GLVND gives a cleared table.
        let mut own: EglImports = [core::ptr::null(); 16];
        // SAFETY: `__egl_Main` of a driver, with the arguments GLVND gives to it and a table of its
        // own.
        unsafe {
            let main: VendorMain = core::mem::transmute(main);
            if main(version, exports, vendor, (&raw mut own).cast()) != 0 {
                all.push(Driver(own));
            }
        }
    }
    let Some(first) = all.first() else { return 0 };
    let table = imports.cast::<*const ()>();
    for (i, f) in first.0.iter().enumerate().filter(|(i, f)| *i < egl::PATCHES.end || !f.is_null())
    {
        // SAFETY: GLVND's table; what is beyond its first ten members a driver writes by its
        // version.
        unsafe { *table.add(i) = *f };
    }
    driver::set_vendor(first.0[egl::GET_PROC_ADDRESS], true);
    let several = all.len() > 1;
    if EGL_DRIVERS.set(all).is_err() {
        // A second GLVND in one process keeps the first one's drivers.
        return 0;
    }
    // SAFETY: GLVND's table.
    unsafe {
        (*imports)[egl::GET_PROC_ADDRESS] = egl_address as *const ();
        if several {
            (*imports)[egl::GET_DISPLAY] = egl_display as *const ();
            (*imports)[egl::SET_DISPATCH_INDEX] = egl_dispatch_index as *const ();
            (*imports)[egl::SUPPORTS_API] = egl_supports_api as *const ();
            (*imports)[egl::VENDOR_STRING] = egl_vendor_string as *const ();
            // The entry points may belong to another driver in the end.
            (egl::PATCHES).for_each(|i| (*imports)[i] = core::ptr::null());
        }
    }
    1
}

/// Members of GLVND's `__EGLapiImports`.
mod egl {
    pub(super) const GET_DISPLAY: usize = 0;
    pub(super) const SUPPORTS_API: usize = 1;
    pub(super) const VENDOR_STRING: usize = 2;
    pub(super) const GET_PROC_ADDRESS: usize = 3;
    pub(super) const SET_DISPATCH_INDEX: usize = 5;
    pub(super) const PATCHES: std::ops::Range<usize> = 6..10;
}

/// A driver's table of functions.
struct Driver(EglImports);
/// GLVND's table for EGL has eleven members today. Later versions add members at its end.
type EglImports = [*const (); 16];
// SAFETY: addresses of functions, which are never written again.
unsafe impl Send for Driver {}
// SAFETY: as above.
unsafe impl Sync for Driver {}

/// The drivers that GLVND would have asked for displays, in its order.
static EGL_DRIVERS: OnceLock<Vec<Driver>> = OnceLock::new();
/// The driver that has the program's displays, or [`NOBODY`].
static EGL_CHOSEN: AtomicUsize = AtomicUsize::new(NOBODY);
const NOBODY: usize = usize::MAX;

fn egl_drivers() -> &'static [Driver] {
    EGL_DRIVERS.get().map_or(&[], Vec::as_slice)
}

/// A driver's answer for a name.
fn of_driver(driver: &Driver, name: *const c_char) -> *const () {
    let get = driver.0[egl::GET_PROC_ADDRESS];
    if get.is_null() || name.is_null() {
        return core::ptr::null();
    }
    // SAFETY: the driver's `getProcAddress`, with GLVND's own string.
    unsafe {
        core::mem::transmute::<*const (), unsafe extern "C" fn(*const c_char) -> *const ()>(get)(
            name,
        )
    }
}

/// The function of the chosen driver, or of the first one.
fn egl_function(member: usize) -> *const () {
    let chosen = EGL_CHOSEN.load(Relaxed);
    let driver = egl_drivers().get(if chosen == NOBODY { 0 } else { chosen });
    driver.map_or(core::ptr::null(), |d| d.0[member])
}

/// Asks the drivers for a display, as GLVND would. The first that accepts one gets all displays,
/// because calls go to one driver.
unsafe extern "C" fn egl_display(
    platform: u32,
    native: *mut c_void,
    attributes: *const c_void,
) -> *mut c_void {
    type GetDisplay = unsafe extern "C" fn(u32, *mut c_void, *const c_void) -> *mut c_void;
    let chosen = EGL_CHOSEN.load(Relaxed);
    for (i, driver) in
        egl_drivers().iter().enumerate().filter(|(i, _)| chosen == NOBODY || chosen == *i)
    {
        let get = driver.0[egl::GET_DISPLAY];
        if get.is_null() {
            continue;
        }
        // SAFETY: the driver's `getPlatformDisplay`, with GLVND's own arguments.
        let display = unsafe {
            core::mem::transmute::<*const (), GetDisplay>(get)(platform, native, attributes)
        };
        if !display.is_null() {
            EGL_CHOSEN.store(i, Relaxed);
            driver::set_vendor(driver.0[egl::GET_PROC_ADDRESS], true);
            return display;
        }
    }
    core::ptr::null_mut()
}

unsafe extern "C" fn egl_supports_api(api: u32) -> u32 {
    let f = egl_function(egl::SUPPORTS_API);
    if f.is_null() {
        return 0;
    }
    // SAFETY: the driver's `getSupportsAPI`.
    unsafe { core::mem::transmute::<*const (), unsafe extern "C" fn(u32) -> u32>(f)(api) }
}

unsafe extern "C" fn egl_vendor_string(name: c_int) -> *const c_char {
    let f = egl_function(egl::VENDOR_STRING);
    if f.is_null() {
        return core::ptr::null();
    }
    // SAFETY: the driver's `getVendorString`.
    unsafe {
        core::mem::transmute::<*const (), unsafe extern "C" fn(c_int) -> *const c_char>(f)(name)
    }
}

/// Every driver keeps the number of a function, because the driver of the displays is not known
/// yet.
unsafe extern "C" fn egl_dispatch_index(name: *const c_char, index: c_int) {
    for driver in egl_drivers() {
        let f = driver.0[egl::SET_DISPATCH_INDEX];
        if !f.is_null() {
            // SAFETY: the driver's `setDispatchIndex`, with GLVND's own arguments.
            unsafe {
                core::mem::transmute::<*const (), unsafe extern "C" fn(*const c_char, c_int)>(f)(
                    name, index,
                );
            }
        }
    }
}
