//! How programs and GLVND find the trampolines: `dlsym`, `glXGetProcAddress`, `__glx_Main`, `__egl_Main`.

use super::{index_of, trampoline};
use crate::fault::caught;
use crate::real;
use core::ffi::{CStr, c_char, c_int, c_void};
use std::sync::atomic::{AtomicPtr, Ordering::Relaxed};

/// libc's `dlsym`, for the jump below.
static REAL_DLSYM: AtomicPtr<()> = AtomicPtr::new(core::ptr::null_mut());

/// Our address for what a program looks up itself, or null for libc's answer.
unsafe extern "C" fn ours(handle: *mut c_void, name: *const c_char) -> *const () {
    // SAFETY: the program's own arguments of dlsym.
    caught(|| unsafe { looked_up(handle, name) }).unwrap_or(core::ptr::null())
}

/// # Safety
/// The arguments must be such as dlsym takes.
unsafe fn looked_up(handle: *mut c_void, name: *const c_char) -> *const () {
    REAL_DLSYM.store(real::dlsym_address().cast_mut(), Relaxed);
    if name.is_null() || real::is_vendor() {
        return core::ptr::null();
    }
    // SAFETY: dlsym takes a C string.
    let name = unsafe { CStr::from_ptr(name) };
    let bytes = name.to_bytes();
    if !(bytes.starts_with(b"gl") || bytes.starts_with(b"egl")) || index_of(bytes).is_none() {
        return core::ptr::null();
    }
    // Not earlier: other names are looked up by allocators before anything can be allocated.
    crate::fault::injected("dlsym");
    // What the program's library lacks stays lacking.
    // SAFETY: the program's own arguments.
    let there = unsafe { real::call_dlsym(handle, name) };
    if there.is_null() { there } else { trampoline(name).unwrap_or(core::ptr::null()) }
}

/// Seen by programs only under LD_PRELOAD. It jumps on, so that libc sees the program's return address (RTLD_NEXT depends on it).
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn dlsym() {
    core::arch::naked_asm!(
        "push rdi", "push rsi", "sub rsp, 8", "call {ours}", "add rsp, 8", "pop rsi", "pop rdi",
        "test rax, rax", "jne 2f", "jmp qword ptr [rip + {real}]", "2:", "ret",
        ours = sym ours, real = sym REAL_DLSYM
    )
}

/// The driver's answer, replaced by our trampoline where there is one: a null answer stays null (feature detection).
pub(super) fn replaced(name: *const c_char, driver: *const ()) -> *const () {
    if driver.is_null() || name.is_null() {
        return driver;
    }
    // SAFETY: the program's C string.
    let name = unsafe { CStr::from_ptr(name) };
    trampoline(name).unwrap_or(driver)
}

// ---- GLVND ----------------------------------------------------------------------------------------------------------

type Imports = [*const (); 10];
type VendorMain = unsafe extern "C" fn(u32, *const c_void, *mut c_void, *mut Imports) -> c_int;

unsafe extern "C" fn glx_address(name: *const c_char) -> *const () {
    // SAFETY: GLVND's own string.
    let text = unsafe { CStr::from_ptr(name) };
    let driver = real::vendor_address(text, false);
    let ours = || {
        crate::fault::injected("address");
        if text.to_bytes().starts_with(b"glXGetProcAddress") { driver } else { replaced(name, driver) }
    };
    caught(ours).unwrap_or(driver)
}

unsafe extern "C" fn egl_address(name: *const c_char) -> *const () {
    // SAFETY: GLVND's own string.
    let text = unsafe { CStr::from_ptr(name) };
    let driver = real::vendor_address(text, true);
    let ours = || {
        crate::fault::injected("address");
        if text.to_bytes() == b"eglGetProcAddress" { driver } else { replaced(name, driver) }
    };
    caught(ours).unwrap_or(driver)
}

/// GLVND's entry into a GLX vendor library: the driver's, with our addresses.
#[unsafe(no_mangle)]
unsafe extern "C" fn __glx_Main(
    version: u32,
    exports: *const c_void,
    vendor: *mut c_void,
    imports: *mut Imports,
) -> c_int {
    let find = || {
        crate::fault::in_program();
        crate::fault::injected("__glx_Main");
        real::put_glvnd_first();
    };
    // After a fault the vendor that there would be without us is found all the same.
    caught(find);
    let main = caught(|| real::vendor_main(false)).unwrap_or(core::ptr::null());
    if main.is_null() {
        return 0;
    }
    // SAFETY: `__glx_Main` of the driver, with the arguments GLVND gives to it.
    unsafe {
        let main: VendorMain = core::mem::transmute(main);
        if main(version, exports, vendor, imports) == 0 {
            return 0;
        }
        real::set_vendor((*imports)[1], false);
        (*imports)[1] = glx_address as *const ();
        // No patching of entry points behind our back.
        (5..9).for_each(|i| (*imports)[i] = core::ptr::null());
    }
    1
}

/// GLVND's entry into an EGL vendor library.
#[unsafe(no_mangle)]
unsafe extern "C" fn __egl_Main(
    version: u32,
    exports: *const c_void,
    vendor: *mut c_void,
    imports: *mut Imports,
) -> c_int {
    let find = || {
        crate::fault::in_program();
        crate::fault::injected("__egl_Main");
        real::put_glvnd_first();
    };
    // After a fault the vendor that there would be without us is found all the same.
    caught(find);
    let main = caught(|| real::vendor_main(true)).unwrap_or(core::ptr::null());
    if main.is_null() {
        return 0;
    }
    // SAFETY: `__egl_Main` of the driver, with the arguments GLVND gives to it.
    unsafe {
        let main: VendorMain = core::mem::transmute(main);
        if main(version, exports, vendor, imports) == 0 {
            return 0;
        }
        real::set_vendor((*imports)[3], true);
        (*imports)[3] = egl_address as *const ();
    }
    1
}
