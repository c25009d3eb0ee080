//! What is behind the OpenGL library that programs see: the targets of its entry points, which are
//! hooks of ours or the driver's functions. The entry points themselves are in the package
//! `gluray-interposer`, which uses [`interface`].
//!
//! This is a room for unsafe code: programs that we do not know call everything here.
#![allow(unsafe_code, reason = "a room: hooks are called by programs we do not know")]
#![allow(non_snake_case, reason = "the names of OpenGL")]

mod current_context;
mod entry_points;
mod hooks;
mod lookup;

pub(crate) use current_context::{install, take, with_context};

use crate::calls::{COUNT, NAMES, at, index_of, is_hooked};
use crate::capture::ImmediateModeTarget;
use crate::driver;
use crate::faults;
use crate::watched_calls::{disarm, is_alone};
use entry_points::EntryPoints;
use std::ffi::CStr;
use std::sync::Once;
use std::sync::atomic::Ordering::Relaxed;

/// What the package `gluray-interposer` is written against: what its trampolines read and call, and
/// what its functions call by which programs and GLVND look them up.
pub mod interface {
    pub use super::entry_points::{COUNT, EntryPoints, HAS_ENTRY_POINTS};
    pub use super::lookup::{Imports, REAL_DLSYM, egl_main, glx_main, looked_up};
    pub use super::{left, on_watched_call, resolve};
    pub use crate::watched_calls::{ARMED, CALLS};
}

#[derive(Clone, Copy)]
struct Target(*const ());
// SAFETY: addresses of functions.
unsafe impl Sync for Target {}

include!(concat!(env!("OUT_DIR"), "/hooks.rs"));

/// Entry points that we keep after a fault: contexts, addresses, errors that we kept, and lists,
/// because only we can execute those that we compiled.
fn stays_hooked(index: usize) -> bool {
    const KEPT: [usize; 7] = [
        at::glCallList,
        at::glCallLists,
        at::glNewList,
        at::glEndList,
        at::glDeleteLists,
        at::glGenLists,
        at::glGetError,
    ];
    let name = NAMES[index].to_bytes();
    name.starts_with(b"glX") || name.starts_with(b"egl") || KEPT.contains(&index)
}

/// After a fault, every entry point becomes the driver's, thread by thread: see [`left`].
fn retire() {
    let Some(entry_points) = entry_points::registered() else { return };
    for (i, slot) in entry_points.targets.iter().enumerate() {
        if is_hooked(i) && !stays_hooked(i) {
            slot.store(entry_points.leaving as *mut (), Relaxed);
        }
    }
}

/// The trampoline of an entry point.
fn trampoline(name: &CStr) -> Option<*const ()> {
    let trampolines = entry_points::registered()?.trampolines;
    index_of(name.to_bytes()).map(|i| trampolines[i] as *const ())
}

/// The program calls the library for the first time.
#[cold]
fn in_program() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        faults::in_program();
        at_exit();
    });
}

/// Registers the last update of the report for a normal exit of the program.
fn at_exit() {
    extern "C" fn at_exit() {
        faults::guard(crate::host::report::write_final_report);
    }
    // SAFETY: a function of ours, and the library is never unloaded (`-z nodelete`).
    unsafe { libc::atexit(at_exit) };
}

/// The program may call us from now on, by these entry points. What a fault ends is theirs.
fn register(entry_points: &'static EntryPoints) {
    entry_points::register(entry_points);
    faults::when_one_happens(faults::Handlers {
        first: retire,
        each: || {
            with_context(|context| context.stop_tracing());
        },
    });
}

/// The target of entry `index`, which is called for the first time. From now on, its trampoline
/// finds it in the table.
pub fn resolve(entry_points: &'static EntryPoints, index: usize) -> *const () {
    register(entry_points);
    in_program();
    // This also applies to entry points that are called for the first time after a fault.
    let hook = HOOKS[index].filter(|_| !faults::happened() || stays_hooked(index));
    let target = faults::caught(|| match hook {
        Some(hook) => hook.0,
        None => {
            faults::inject_at(index);
            driver::forward(index)
        }
    });
    let target = target.unwrap_or_else(|| forward_plainly(index));
    entry_points.targets[index].store(target.cast_mut(), Relaxed);
    target
}

/// The driver's function, or one that does nothing when the search for it fails.
fn forward_plainly(index: usize) -> *const () {
    faults::caught(|| driver::forward(index)).unwrap_or(driver::no_context as *const ())
}

/// A watched call of entry `index` is about to run.
pub extern "C" fn on_watched_call(index: usize) {
    if faults::happened() {
        faults::hand_over_to_driver();
        return;
    }
    faults::caught(|| {
        faults::inject_at(index);
        crate::interpose::context::on_watched_call(index);
    });
}

/// A call of entry `index`, which was ours before a fault: the thread's context draws what it has
/// held back, then the driver's function, the result, is to be called.
pub extern "C" fn left(index: usize) -> *const () {
    leave_at(index);
    forward_plainly(index)
}

/// The same without the call.
fn leave_at(index: usize) {
    faults::hand_over_to_driver();
    let over = faults::caught(|| {
        let tracing_stopped = with_context(|c| {
            if index == at::glEnd && c.capture.immediate_target == ImmediateModeTarget::Pass {
                // The driver's primitive ends now. With the next call, the context draws what it
                // has held back.
                c.capture.immediate_target = ImmediateModeTarget::Outside;
            }
            c.tracing_stopped
        });
        tracing_stopped == Some(true) && is_alone()
    });
    let entry = entry_points::registered().map(|e| (&e.targets[index], e.leaving as *mut ()));
    if over == Some(true)
        && let Some((target, leaving)) = entry
        && target.load(Relaxed) == leaving
    {
        target.store(forward_plainly(index).cast_mut(), Relaxed);
        disarm();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calls::{class, class_of};

    #[test]
    fn calls_that_come_with_each_vertex_are_not_told_of_for_the_sake_of_textures() {
        let starts = |name: &[u8]| {
            let of_vertices: [&[u8]; 6] = [
                b"glSecondaryColor",
                b"glMultiTexCoord",
                b"glFogCoord",
                b"glVertexAttrib",
                b"glEdgeFlag",
                b"glVertexP",
            ];
            of_vertices.iter().any(|b| name.starts_with(b))
        };
        let always = class::TEXTURE | class::BUFFER;
        let mut seen = 0;
        for (i, name) in NAMES.iter().enumerate().filter(|(_, n)| starts(n.to_bytes())) {
            seen += 1;
            assert!(class_of(i) & always == 0 || is_hooked(i), "{name:?} costs ten nanoseconds");
        }
        assert!(seen > 100, "{seen}");
    }

    #[test]
    fn the_table_of_injected_faults_has_every_hook() {
        let hooks: Vec<&str> = (0..COUNT)
            .filter(|i| is_hooked(*i))
            .map(|i| NAMES[i].to_str().expect("ASCII"))
            .collect();
        let mut listed: Vec<&str> =
            include_str!("../../../tests/programs/hooks.txt").lines().collect();
        listed.sort_unstable();
        assert_eq!(listed, hooks, "tests/programs/hooks.txt is what tests/faults.rs walks through");
    }

    #[test]
    fn calls_that_write_texels_are_told_of_at_all_times() {
        for name in [
            c"glTexSubImage2D",
            c"glTextureSubImage2D",
            c"glCopyTexImage2D",
            c"glPopAttrib",
            c"glBindFramebuffer",
        ] {
            let i = index_of(name.to_bytes()).expect("a call of OpenGL's");
            assert!(class_of(i) & class::TEXTURE != 0 || is_hooked(i), "{name:?}");
        }
    }
}
