//! Finds the driver's functions and calls them.
//!
//! Under `LD_PRELOAD` the driver is `libGL.so.1` (`libEGL.so.1`), opened by name: `RTLD_NEXT` finds
//! nothing when the program itself opened it with `dlopen`. When the library is a GLVND vendor
//! library, the driver is the vendor behind it.
//!
//! This is a room for unsafe code.
#![allow(unsafe_code, reason = "a room: calls into a C library that is found at run time")]

pub(crate) mod feedback;
pub(crate) mod gl;

use crate::calls::{COUNT, NAMES, index_of};
use core::ffi::{CStr, c_char, c_int, c_void};
use std::ffi::CString;
use std::sync::atomic::{AtomicPtr, AtomicUsize, Ordering::Relaxed};

#[cfg(all(target_arch = "x86_64", target_os = "linux"))]
unsafe extern "C" {
    fn dlvsym(handle: *mut c_void, name: *const c_char, version: *const c_char) -> *mut c_void;
}

#[cfg(all(target_arch = "x86_64", target_os = "linux"))]
static DLSYM: AtomicUsize = AtomicUsize::new(0);
static LIB_GL: AtomicPtr<c_void> = AtomicPtr::new(core::ptr::null_mut());
static LIB_EGL: AtomicPtr<c_void> = AtomicPtr::new(core::ptr::null_mut());
/// The vendor's `getProcAddress` for GLX and EGL.
static VENDOR: [AtomicUsize; 2] = [AtomicUsize::new(0), AtomicUsize::new(0)];
static FOUND: [AtomicPtr<()>; COUNT] = [const { AtomicPtr::new(core::ptr::null_mut()) }; COUNT];

/// Called when the driver lacks a function. It does nothing and returns zero.
pub(crate) extern "C" fn no_context() -> usize {
    0
}

/// libc's own `dlsym`: there is none of ours.
#[cfg(not(all(target_arch = "x86_64", target_os = "linux")))]
pub(crate) fn dlsym_address() -> *const () {
    libc::dlsym as *const ()
}

/// libc's own `dlsym`.
#[cfg(all(target_arch = "x86_64", target_os = "linux"))]
pub(crate) fn dlsym_address() -> *const () {
    let mut p = DLSYM.load(Relaxed);
    if p == 0 {
        for version in [c"GLIBC_2.34", c"GLIBC_2.2.5"] {
            // SAFETY: both arguments are C strings.
            p = unsafe { dlvsym(libc::RTLD_NEXT, c"dlsym".as_ptr(), version.as_ptr()) } as usize;
            if p != 0 {
                break;
            }
        }
        DLSYM.store(p, Relaxed);
    }
    p as *const ()
}

/// Calls libc's `dlsym`.
///
/// # Safety
/// `handle` must be one that `dlsym` takes.
pub(crate) unsafe fn call_dlsym(handle: *mut c_void, name: &CStr) -> *const () {
    let p = dlsym_address();
    if p.is_null() {
        return p;
    }
    // SAFETY: the signature of dlsym.
    let f: unsafe extern "C" fn(*mut c_void, *const c_char) -> *const () =
        unsafe { core::mem::transmute(p) };
    // SAFETY: as the caller promises.
    unsafe { f(handle, name.as_ptr()) }
}

/// True when GLVND loaded us as a vendor library.
pub(crate) fn is_vendor() -> bool {
    VENDOR.iter().any(|v| v.load(Relaxed) != 0)
}

/// Stores the vendor's `getProcAddress`.
pub(crate) fn set_vendor(address: *const (), egl: bool) {
    VENDOR[usize::from(egl)].store(address as usize, Relaxed);
}

/// Asks the vendor for an address.
pub(crate) fn vendor_address(name: &CStr, egl: bool) -> *const () {
    let p = VENDOR[usize::from(egl)].load(Relaxed);
    if p == 0 {
        return core::ptr::null();
    }
    // SAFETY: GLVND's getProcAddress takes a C string.
    let f: unsafe extern "C" fn(*const c_char) -> *const () = unsafe { core::mem::transmute(p) };
    // SAFETY: a C string.
    unsafe { f(name.as_ptr()) }
}

fn open(library: &CStr) -> *mut c_void {
    // SAFETY: a C string.
    unsafe { libc::dlopen(library.as_ptr(), libc::RTLD_LAZY | libc::RTLD_LOCAL) }
}

/// Puts GLVND's functions before Mesa's in the scope where libraries that are opened later look for
/// OpenGL's. When the first context is created, Mesa puts its own there (those of libglapi). Calls
/// of plugins, and of libraries that a script opens (libGLU), would then bypass GLVND and this
/// library. Our own functions cannot take their place, because GLVND must see `glXMakeCurrent`.
pub(crate) fn put_glvnd_first() {
    let open = |library: &CStr, how| {
        // SAFETY: a C string.
        !unsafe { libc::dlopen(library.as_ptr(), libc::RTLD_LAZY | libc::RTLD_GLOBAL | how) }
            .is_null()
    };
    // A library that is already loaded, else the one without GLX.
    let _ = [
        (c"libGL.so.1", libc::RTLD_NOLOAD),
        (c"libOpenGL.so.0", libc::RTLD_NOLOAD),
        (c"libOpenGL.so.0", 0),
    ]
    .into_iter()
    .any(|(library, how)| open(library, how));
}

/// The function `main` of each vendor library that can be opened and has it.
pub(crate) fn mains_of(libraries: Vec<String>, main: &CStr) -> impl Iterator<Item = *const ()> {
    libraries.into_iter().filter_map(move |library| {
        let handle = open(&CString::new(library).ok()?);
        if handle.is_null() {
            return None;
        }
        // SAFETY: a handle of dlopen.
        let address = unsafe { call_dlsym(handle, main) };
        (!address.is_null()).then_some(address)
    })
}

fn library(slot: &AtomicPtr<c_void>, name: &CStr) -> *mut c_void {
    let mut h = slot.load(Relaxed);
    if h.is_null() {
        h = open(name);
        slot.store(h, Relaxed);
    }
    h
}

fn find(name: &CStr) -> *const () {
    let egl = name.to_bytes().starts_with(b"egl");
    for which in [egl, !egl] {
        let p = vendor_address(name, which);
        if !p.is_null() {
            return p;
        }
    }
    if is_vendor() {
        return core::ptr::null();
    }
    let (handle, get) = match egl {
        true => (library(&LIB_EGL, c"libEGL.so.1"), c"eglGetProcAddress"),
        false => (library(&LIB_GL, c"libGL.so.1"), c"glXGetProcAddressARB"),
    };
    if handle.is_null() {
        return core::ptr::null();
    }
    // SAFETY: a handle of dlopen.
    let p = unsafe { call_dlsym(handle, name) };
    if !p.is_null() {
        return p;
    }
    // SAFETY: a handle of dlopen.
    let get = unsafe { call_dlsym(handle, get) };
    if get.is_null() {
        return get;
    }
    // SAFETY: both functions of this name take a C string.
    let get: unsafe extern "C" fn(*const c_char) -> *const () =
        unsafe { core::mem::transmute(get) };
    // SAFETY: a C string.
    unsafe { get(name.as_ptr()) }
}

/// The driver's function of entry `index`, if it has been looked up.
#[inline(always)]
pub(crate) fn found(index: usize) -> Option<*const ()> {
    let p = FOUND[index].load(Relaxed);
    (!p.is_null()).then_some(p.cast_const())
}

/// The driver's function of entry `index`, or one that does nothing.
pub(crate) fn forward(index: usize) -> *const () {
    let p = FOUND[index].load(Relaxed);
    if !p.is_null() {
        return p;
    }
    let found = find(NAMES[index]);
    let p = if found.is_null() { no_context as *const () } else { found };
    FOUND[index].store(p.cast_mut(), Relaxed);
    p
}

/// The driver's function `name`, looked up once.
#[inline]
fn cached(slot: &AtomicPtr<()>, name: &str) -> *const () {
    #[cfg(test)]
    if let Some(fake) = gl::tests::fake(name) {
        return fake;
    }
    let p = slot.load(Relaxed);
    if !p.is_null() {
        return p;
    }
    look_up(slot, name)
}

#[cold]
fn look_up(slot: &AtomicPtr<()>, name: &str) -> *const () {
    let index = index_of(name.as_bytes());
    let p = index.map_or(no_context as *const (), forward);
    slot.store(p.cast_mut(), Relaxed);
    p
}

/// The driver's functions with their signatures. Those that take pointers are private to this room.
macro_rules! driver {
    ($($vis:vis fn $name:ident = $gl:literal ($($a:ident: $t:ty),*) $(-> $r:ty)?;)*) => { $(
        #[doc = concat!("The driver's `", $gl, "`.")]
        #[inline]
        $vis fn $name($($a: $t),*) $(-> $r)? {
            static SLOT: AtomicPtr<()> = AtomicPtr::new(core::ptr::null_mut());
            let p = $crate::driver::cached(&SLOT, $gl);
            // SAFETY: the signature that OpenGL (GLX, EGL) gives this name; pointers come from
            // slices in `gl` or from the program.
            unsafe {
                let f: unsafe extern "C" fn($($t),*) $(-> $r)? = core::mem::transmute(p);
                f($($a),*)
            }
        }
    )* };
}
pub(crate) use driver;

/// For `c_int` in hooks.
pub(crate) type Int = c_int;
