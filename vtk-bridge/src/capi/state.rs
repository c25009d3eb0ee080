//! What is behind a handle: a bridge with the process' options; and the guard against panics.

use super::{RtvBridge, RtvPicture};
use crate::bridge::Bridge;
use crate::input::View;
use crate::options::Options;
use crate::report;
use std::collections::BTreeMap;
use std::ffi::CString;
use std::os::raw::c_char;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// Behind an [`RtvBridge`].
pub(super) struct Handle {
    pub(super) bridge: Bridge,
    number: u64,
    poisoned: bool,
    /// The text that the last call gave away.
    answer: CString,
}

/// Options set by the program, over those of the environment.
static SET: Mutex<BTreeMap<String, String>> = Mutex::new(BTreeMap::new());

/// VTK's version, as told by [`set_host`]: major in the upper half; 0 when nobody has said.
static HOST: AtomicU64 = AtomicU64::new(0);

pub(super) fn set_host(major: u32, minor: u32) {
    HOST.store(u64::from(major) << 32 | u64::from(minor), Ordering::Relaxed);
}

/// Options that follow VTK's version. Shaders of versions after 9.2 draw edges on their surfaces alone.
fn of_host(host: u64) -> Option<(String, String)> {
    ((host >> 32, host & 0xffff_ffff) > (9, 2)).then(|| ("RTV_EDGES".to_owned(), "0".to_owned()))
}

/// The options in force, and what in them was not understood. The environment is read anew each time, because programs change it (a
/// script's `os.environ`).
pub(super) fn options() -> (Options, Vec<String>) {
    let environment = std::env::vars().filter(|(n, _)| n.starts_with("RTV_"));
    let set = SET.lock().map(|s| s.clone()).unwrap_or_default();
    Options::parse(of_host(HOST.load(Ordering::Relaxed)).into_iter().chain(environment).chain(set))
}

pub(super) fn set_option(name: &str, value: &str) -> bool {
    let Ok(mut set) = SET.lock() else { return false };
    if value.is_empty() {
        set.remove(name);
        return true;
    }
    let understood = Options::default().set(name, value).is_ok();
    if understood {
        set.insert(name.to_owned(), value.to_owned());
    }
    understood
}

impl Handle {
    pub(super) fn new() -> Handle {
        static NUMBER: AtomicU64 = AtomicU64::new(1);
        Handle {
            bridge: Bridge::new(),
            number: NUMBER.fetch_add(1, Ordering::Relaxed),
            poisoned: false,
            answer: CString::default(),
        }
    }

    /// `text` for the caller, until the next call.
    pub(super) fn answer(&mut self, text: String) -> *const c_char {
        self.answer = CString::new(text.replace('\0', " ")).unwrap_or_default();
        self.answer.as_ptr()
    }

    pub(super) fn begin(&mut self) -> i32 {
        let (options, faults) = options();
        self.bridge.begin(&options);
        for fault in faults {
            self.bridge.warn(fault);
        }
        i32::from(!options.off && !self.poisoned)
    }

    pub(super) fn render(&mut self, view: &View) -> Option<RtvPicture> {
        let error = match self.bridge.render(view) {
            Ok(p) => {
                let pointer = |v: &[f32]| if v.is_empty() { std::ptr::null() } else { v.as_ptr() };
                return Some(RtvPicture {
                    width: p.width,
                    height: p.height,
                    opaque: if p.opaque.is_empty() { std::ptr::null() } else { p.opaque.as_ptr().cast() },
                    blended: pointer(p.blended.as_flattened()),
                    depth: pointer(&p.depth),
                    first_depth: pointer(&p.first_depth),
                });
            }
            Err(e) => e,
        };
        self.bridge.warn(format!("this frame is not ray traced, OpenGL draws it: {error}"));
        None
    }

    pub(super) fn end(&mut self) {
        let warnings = self.bridge.take_warnings();
        let options = self.bridge.options();
        if !options.quiet {
            for w in warnings {
                to_user_once(&w);
            }
        }
        if let Some(path) = &options.report
            && let Err(e) = report::write(self.number, self.bridge.report(), path)
        {
            to_user_once(&format!("RTV_REPORT={path} cannot be written: {e}"));
        }
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        report::forget(self.number);
    }
}

/// A line for the user of the foreign program, each text once in the process. There is nobody else to tell: we are a guest.
fn to_user_once(text: &str) {
    static TOLD: Mutex<BTreeMap<String, ()>> = Mutex::new(BTreeMap::new());
    let first = TOLD.lock().map(|mut t| t.insert(text.to_owned(), ()).is_none()).unwrap_or(false);
    if first {
        use std::io::Write;
        let _ = writeln!(std::io::stderr().lock(), "vtk-bridge: {text}");
    }
}

/// Calls `work` with the handle; `otherwise` for null, and after a panic, which is told. After a panic the bridge leaves everything to
/// OpenGL, because what it keeps may be half done.
///
/// # Safety
/// `bridge` is null or came from `rtv_new`, and no other thread uses it.
pub(super) unsafe fn with<T>(bridge: *mut RtvBridge, otherwise: T, work: impl FnOnce(&mut Handle) -> T) -> T {
    // SAFETY: `rtv_new` made it from a `Handle`; the caller promises that it is alive and not in use.
    let Some(handle) = (unsafe { bridge.cast::<Handle>().as_mut() }) else { return otherwise };
    if handle.poisoned {
        return otherwise;
    }
    match catch_unwind(AssertUnwindSafe(|| work(handle))) {
        Ok(result) => result,
        Err(panic) => {
            handle.poisoned = true;
            let message = panic
                .downcast_ref::<&str>()
                .map(|s| (*s).to_owned())
                .or_else(|| panic.downcast_ref::<String>().cloned())
                .unwrap_or_default();
            to_user_once(&format!("internal error, OpenGL draws from now on; please report it: {message}"));
            otherwise
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_follow_the_version_of_vtk_unless_told_otherwise() {
        let of = |major: u64, minor: u64| {
            of_host(major << 32 | minor).map(|(name, value)| format!("{name}={value}"))
        };
        for (major, minor) in [(0, 0), (9, 0), (9, 1), (9, 2)] {
            assert_eq!(of(major, minor), None, "{major}.{minor}");
        }
        for (major, minor) in [(9, 3), (9, 7), (10, 0)] {
            assert_eq!(of(major, minor).as_deref(), Some("RTV_EDGES=0"), "{major}.{minor}");
        }
        let said = ("RTV_EDGES".to_owned(), "0.5".to_owned());
        assert_eq!(Options::parse(of_host(9 << 32 | 5).into_iter().chain([said])).0.edge_reach, 0.5);
    }
}
