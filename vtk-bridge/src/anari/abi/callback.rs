//! Calls the program's callback functions.

use crate::anari::device::Hooks;
use crate::anari::handle::Handle;
use crate::anari::status::{Listener, Message};
use std::ffi::{CString, c_char, c_int, c_void};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// ANARI's `ANARIStatusCallback`: user pointer, device, source, its type, severity, code, message.
pub(super) type StatusCallback = unsafe extern "C" fn(
    *const c_void,
    *mut c_void,
    *mut c_void,
    c_int,
    c_int,
    c_int,
    *const c_char,
);

/// ANARI's `ANARIFrameCompletionCallback`: user pointer, device, frame.
type CompletionCallback = unsafe extern "C" fn(*const c_void, *mut c_void, *mut c_void);

/// The device's own handle, set after the device is created.
pub(super) type Own = Arc<AtomicUsize>;

/// The program's status callback.
pub(super) struct Callback {
    function: Option<StatusCallback>,
    user: *const c_void,
    device: Own,
}

// SAFETY: the user pointer is only passed back; ANARI 1.0 ("Status callback") asks programs for
// callbacks that any thread may call.
unsafe impl Send for Callback {}
// SAFETY: as above.
unsafe impl Sync for Callback {}

impl Callback {
    /// # Safety
    /// `function` may be called with `user` until the device or library that it was given to is
    /// released.
    pub(super) unsafe fn new(
        function: Option<StatusCallback>,
        user: *const c_void,
        device: Own,
    ) -> Callback {
        Callback { function, user, device }
    }
}

impl Listener for Callback {
    fn message(&self, m: &Message) {
        let Some(function) = self.function else { return };
        let text = CString::new(m.text.replace('\0', " ")).unwrap_or_default();
        let device = self.device.load(Ordering::Acquire) as *mut c_void;
        let source = if m.source == Handle::NULL { device } else { m.source.0 as *mut c_void };
        let (kind, severity, code) =
            (m.source_type.0 as c_int, m.severity as c_int, m.code as c_int);
        // SAFETY: `new` promised that it may be called; the text lives until the call returns.
        unsafe { function(self.user, device, source, kind, severity, code, text.as_ptr()) };
    }
}

/// Calls the program's completion callbacks.
pub(super) struct Callbacks(pub(super) Own);

impl Hooks for Callbacks {
    fn frame_completed(&self, function: usize, user: usize, frame: Handle) {
        let device = self.0.load(Ordering::Acquire) as *mut c_void;
        // SAFETY: the number came from the program as a parameter of type
        // FRAME_COMPLETION_CALLBACK, which promises a function of this type; function pointers have
        // the size of `usize` on every platform with the Itanium ABI, and the caller has excluded
        // zero.
        let function = unsafe { std::mem::transmute::<usize, CompletionCallback>(function) };
        // SAFETY: as above; the program keeps function and user pointer valid while the frame has
        // them as parameters.
        unsafe { function(user as *const c_void, device, frame.0 as *mut c_void) };
    }
}
