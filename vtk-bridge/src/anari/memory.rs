//! Memory that both the program and the device access.
#![allow(unsafe_code, reason = "the elements of arrays lie where the program says")]

use std::cell::UnsafeCell;
use std::ffi::c_void;

/// ANARI's `ANARIMemoryDeleter`: user pointer, memory.
pub(crate) type Deleter = unsafe extern "C" fn(*const c_void, *const c_void);

/// Memory of the program: shared with the device, or transferred to it with a deleter.
pub(crate) struct AppMemory {
    start: *const c_void,
    bytes: usize,
    deleter: Option<(Deleter, *const c_void)>,
}

// SAFETY: the memory belongs to no thread; ANARI lets the device read it, and call the deleter,
// from any thread.
unsafe impl Send for AppMemory {}
// SAFETY: as above; the device only reads, and the program promises (ANARI 1.0, "Array objects")
// not to write while the array is not mapped.
unsafe impl Sync for AppMemory {}

impl AppMemory {
    /// Wraps `bytes` bytes from `start`.
    ///
    /// # Safety
    /// They stay readable until this value is dropped, and are written to only between the
    /// program's map and unmap of the array; `deleter` may be called once with its user pointer and
    /// `start`.
    pub(crate) unsafe fn new(
        start: *const c_void,
        bytes: usize,
        deleter: Option<(Deleter, *const c_void)>,
    ) -> AppMemory {
        AppMemory { start, bytes, deleter }
    }

    pub(crate) fn copy(&self) -> Vec<u8> {
        let mut out = vec![0; self.bytes];
        // SAFETY: `new` promised `bytes` readable bytes at `start`; `out` is as long, and new
        // memory overlaps nothing. Bytes have no alignment.
        unsafe {
            std::ptr::copy_nonoverlapping(self.start.cast::<u8>(), out.as_mut_ptr(), self.bytes)
        };
        out
    }

    pub(crate) fn address(&self) -> *mut c_void {
        self.start.cast_mut()
    }

    /// Whether ownership was transferred to the device, rather than shared.
    pub(crate) fn is_captured(&self) -> bool {
        self.deleter.is_some()
    }
}

impl Drop for AppMemory {
    fn drop(&mut self) {
        if let Some((deleter, user)) = self.deleter {
            // SAFETY: `new` promised that the deleter may be called once; a value is dropped once.
            unsafe { deleter(user, self.start) };
        }
    }
}

/// Memory of the device that the program writes to between map and unmap.
pub(crate) struct OwnMemory {
    words: Box<[UnsafeCell<u128>]>,
    bytes: usize,
}

// SAFETY: the program promises (ANARI 1.0, `anariMapArray`) to write only between map and unmap,
// and the device reads only outside of that (callers check `Array::mapped`).
unsafe impl Sync for OwnMemory {}

impl OwnMemory {
    /// Allocates `bytes` zeros, aligned for every ANARI type.
    pub(crate) fn zeroed(bytes: usize) -> OwnMemory {
        let words = (0..bytes.div_ceil(16)).map(|_| UnsafeCell::new(0)).collect();
        OwnMemory { words, bytes }
    }

    pub(crate) fn from_bytes(bytes: &[u8]) -> OwnMemory {
        let own = OwnMemory::zeroed(bytes.len());
        // SAFETY: `own` has room for `bytes.len()` bytes, was just made and is seen by nobody else.
        unsafe {
            std::ptr::copy_nonoverlapping(bytes.as_ptr(), own.address().cast::<u8>(), bytes.len())
        };
        own
    }

    pub(crate) fn copy(&self) -> Vec<u8> {
        let mut out = vec![0; self.bytes];
        // SAFETY: the words hold at least `bytes` bytes, all of them initialised; the program does
        // not write now (see `Sync`).
        unsafe {
            std::ptr::copy_nonoverlapping(self.address().cast::<u8>(), out.as_mut_ptr(), self.bytes)
        };
        out
    }

    /// Where the program may write. The address stays the same for the life of this value and is
    /// never null, even without bytes.
    pub(crate) fn address(&self) -> *mut c_void {
        self.words.as_ptr().cast_mut().cast()
    }
}
