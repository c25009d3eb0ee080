//! The OpenGL library that programs see: one trampoline per entry point, a table of their targets,
//! and the hooks.
//!
//! A trampoline has no prototype: it jumps through [`TABLE`] and leaves all registers as the
//! program set them. Calls that may change state are *watched*. While [`ARMED`] is set, they are
//! reported before they run (`slow`), which costs some ten nanoseconds. As soon as no report is
//! needed, they cost one comparison. So the driver can keep all state: it is asked at a draw, and
//! again only after a watched call.
//!
//! This is a room for unsafe code: programs that we do not know call everything here.
#![allow(
    unsafe_code,
    reason = "a room: exported OpenGL symbols are called by programs we do not know"
)]
#![allow(non_snake_case, reason = "the names of OpenGL")]

mod current_context;
mod hooks;
mod lookup;

pub(crate) use current_context::{install, take, with_context};

use crate::capture::ImmediateModeTarget;
use crate::interpose::calls::{COUNT, NAMES, at, index_of};
use crate::interpose::driver;
use std::ffi::CStr;
use std::sync::atomic::{AtomicPtr, AtomicU32, AtomicU64, Ordering::Relaxed};

#[derive(Clone, Copy)]
struct Target(*const ());
// SAFETY: addresses of functions.
unsafe impl Sync for Target {}

include!(concat!(env!("OUT_DIR"), "/trampolines.rs"));

/// The target of each trampoline: first `lazy`, then our hook or the driver's function.
static TABLE: [AtomicPtr<()>; COUNT] = [const { AtomicPtr::new(lazy as *mut ()) }; COUNT];
/// Zero while watched calls need not be reported: exactly one thread has a context, and no report
/// was requested. Bit 0 is set by a request. The bits above it count the threads that have a
/// context, less one. Both are in one word, so that neither can change unseen while the other is
/// read.
static ARMED: AtomicU32 = AtomicU32::new(0_u32.wrapping_sub(2));
/// Watched calls that went straight to the driver.
static CALLS: AtomicU64 = AtomicU64::new(0);

/// Requests a report of the next watched call.
#[inline]
pub(crate) fn arm() {
    if ARMED.load(Relaxed) & 1 == 0 {
        ARMED.fetch_or(1, Relaxed);
    }
}

/// Ends the reports of watched calls, unless another thread has a context, too.
pub(crate) fn disarm() {
    // This fails when a second thread has got a context since the caller checked.
    ARMED.compare_exchange(1, 0, Relaxed, Relaxed).ok();
}

/// True when only one thread has a context.
pub(crate) fn is_alone() -> bool {
    ARMED.load(Relaxed) & !1 == 0
}

/// A thread gets a context. Until as many threads have left, all watched calls are reported when it
/// is not the only one.
pub(crate) fn thread_enters() {
    ARMED.fetch_add(2, Relaxed);
}

/// A thread has no context any longer.
pub(crate) fn thread_leaves() {
    ARMED.fetch_sub(2, Relaxed);
}

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

/// After a fault, every entry point becomes the driver's, thread by thread: see [`leaving`].
pub(crate) fn retire() {
    for (i, slot) in TABLE.iter().enumerate() {
        if HOOKS[i].is_some() && !stays_hooked(i) {
            slot.store(leaving as *mut (), Relaxed);
        }
    }
}

/// The trampoline of an entry point.
fn trampoline(name: &CStr) -> Option<*const ()> {
    index_of(name.to_bytes()).map(|i| TRAMPOLINES[i] as *const ())
}

/// Registers the last update of the report for a normal exit of the program.
pub(crate) fn at_exit() {
    extern "C" fn at_exit() {
        crate::interpose::panic_guard::guard(crate::host::report::write_final_report);
    }
    // SAFETY: a function of ours, and the library is never unloaded (`-z nodelete`).
    unsafe { libc::atexit(at_exit) };
}

extern "C" fn resolve(index: usize) -> *const () {
    crate::interpose::panic_guard::in_program();
    // This also applies to entry points that are called for the first time after a fault.
    let hook =
        HOOKS[index].filter(|_| !crate::interpose::panic_guard::happened() || stays_hooked(index));
    let target = crate::interpose::panic_guard::caught(|| match hook {
        Some(hook) => hook.0,
        None => {
            crate::interpose::panic_guard::inject_at(index);
            driver::forward(index)
        }
    });
    let target = target.unwrap_or_else(|| forward_plainly(index));
    TABLE[index].store(target.cast_mut(), Relaxed);
    target
}

/// The driver's function, or one that does nothing when the search for it fails.
fn forward_plainly(index: usize) -> *const () {
    crate::interpose::panic_guard::caught(|| driver::forward(index))
        .unwrap_or(driver::no_context as *const ())
}

extern "C" fn on_state_call(index: usize) {
    if crate::interpose::panic_guard::happened() {
        crate::interpose::panic_guard::hand_over_to_driver();
        return;
    }
    crate::interpose::panic_guard::caught(|| {
        crate::interpose::panic_guard::inject_at(index);
        crate::interpose::context::on_watched_call(index);
    });
}

/// A call of entry `index`, which was ours before a fault: the thread's context draws what it has
/// held back, then the driver's function is called.
extern "C" fn left(index: usize) -> *const () {
    leave_at(index);
    forward_plainly(index)
}

/// The same without the call.
fn leave_at(index: usize) {
    crate::interpose::panic_guard::hand_over_to_driver();
    let over = crate::interpose::panic_guard::caught(|| {
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
    if over == Some(true) && TABLE[index].load(Relaxed) == leaving as *mut () {
        TABLE[index].store(forward_plainly(index).cast_mut(), Relaxed);
        disarm();
    }
}

/// A naked function that runs the first instructions with all argument registers saved, restores
/// these, and ends with the others: the registers of integers, the number of vector registers in
/// `al` (variadic calls), those of vectors, and `r11`, the index of the entry.
macro_rules! with_arguments_kept {
    ([$($call:literal),*], [$($jump:literal),*], $($operands:tt)*) => {
        core::arch::naked_asm!(
            "push rbp",
            "mov rbp, rsp",
            "push rdi",
            "push rsi",
            "push rdx",
            "push rcx",
            "push r8",
            "push r9",
            "push rax",
            "push r11",
            "sub rsp, 128",
            "movdqu [rsp], xmm0",
            "movdqu [rsp+16], xmm1",
            "movdqu [rsp+32], xmm2",
            "movdqu [rsp+48], xmm3",
            "movdqu [rsp+64], xmm4",
            "movdqu [rsp+80], xmm5",
            "movdqu [rsp+96], xmm6",
            "movdqu [rsp+112], xmm7",
            $($call,)*
            "movdqu xmm0, [rsp]",
            "movdqu xmm1, [rsp+16]",
            "movdqu xmm2, [rsp+32]",
            "movdqu xmm3, [rsp+48]",
            "movdqu xmm4, [rsp+64]",
            "movdqu xmm5, [rsp+80]",
            "movdqu xmm6, [rsp+96]",
            "movdqu xmm7, [rsp+112]",
            "add rsp, 128",
            "pop r11",
            "pop rax",
            "pop r9",
            "pop r8",
            "pop rcx",
            "pop rdx",
            "pop rsi",
            "pop rdi",
            "pop rbp",
            $($jump,)*
            $($operands)*
        )
    };
}

/// Finds the target of entry r11 and jumps to it, with all argument registers unchanged.
#[unsafe(naked)]
unsafe extern "C" fn lazy() {
    with_arguments_kept!(
        ["mov edi, r11d", "call {resolve}", "mov r10, rax"],
        ["jmp r10"],
        resolve = sym resolve
    )
}

/// The target of former hooks after a fault: see [`left`].
#[unsafe(naked)]
unsafe extern "C" fn leaving() {
    with_arguments_kept!(
        ["mov edi, r11d", "call {left}", "mov r10, rax"],
        ["jmp r10"],
        left = sym left
    )
}

/// Reports entry r11, then jumps to its target, with all argument registers unchanged.
#[unsafe(naked)]
unsafe extern "C" fn slow() {
    with_arguments_kept!(
        ["mov edi, r11d", "call {on_state_call}"],
        ["lea r10, [rip + {table}]", "jmp qword ptr [r10 + 8*r11]"],
        on_state_call = sym on_state_call, table = sym TABLE
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interpose::calls::{class, class_of};

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
            assert!(
                class_of(i) & always == 0 || HOOKS[i].is_some(),
                "{name:?} costs ten nanoseconds"
            );
        }
        assert!(seen > 100, "{seen}");
    }

    #[test]
    fn the_table_of_injected_faults_has_every_hook() {
        let hooks: Vec<&str> = (0..COUNT)
            .filter(|i| HOOKS[*i].is_some())
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
            assert!(class_of(i) & class::TEXTURE != 0 || HOOKS[i].is_some(), "{name:?}");
        }
    }
}
