//! The entry points as their trampolines see them, and the list of them. The trampolines are in the
//! package `gluray-interposer`, so that the program `gluray` and gluray's tests do not carry
//! OpenGL's symbols.
//!
//! They jump through a table of targets. Calls that may change state are reported before they run
//! while that is asked for (`watched_calls`).
//!
//! Each function to which the program may come first is given the [`EntryPoints`].

use std::sync::OnceLock;
use std::sync::atomic::AtomicPtr;

include!(concat!(env!("OUT_DIR"), "/entry_points.rs"));

/// The number of entry points. `gluray::entry_points` lists them.
pub const COUNT: usize = crate::calls::COUNT;

/// Whether the library has entry points for this processor and system.
pub const HAS_ENTRY_POINTS: bool = cfg!(all(target_arch = "x86_64", target_os = "linux"));

/// The entry points of the library that runs in the program.
#[derive(Debug)]
pub struct EntryPoints {
    /// The target of each trampoline. First a function that asks `resolve` and jumps there.
    pub targets: &'static [AtomicPtr<()>; COUNT],
    /// The trampolines, which programs get as addresses.
    pub trampolines: &'static [unsafe extern "C" fn(); COUNT],
    /// The target of former hooks after a fault: asks `left` and jumps there.
    pub leaving: unsafe extern "C" fn(),
}

static REGISTERED: OnceLock<&'static EntryPoints> = OnceLock::new();

/// Makes the entry points known. A process has one library, and so only one set of them.
pub(super) fn register(entry_points: &'static EntryPoints) {
    REGISTERED.get_or_init(|| entry_points);
}

/// The entry points, once a program has called one or looked one up; in our own programs none.
pub(super) fn registered() -> Option<&'static EntryPoints> {
    REGISTERED.get().copied()
}
