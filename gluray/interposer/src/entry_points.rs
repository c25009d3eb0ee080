//! One trampoline per entry point, the table of their targets, and how programs and GLVND find
//! them: `dlsym`, `__glx_Main` and `__egl_Main`.
//!
//! A trampoline has no prototype: it jumps through [`TABLE`] and leaves all registers as the
//! program set them. [`gluray::interposer`] says what the targets are, and which calls are
//! reported before they run.
//!
//! This is a room for unsafe code: programs that we do not know call everything here.
#![allow(
    unsafe_code,
    reason = "a room: exported OpenGL symbols are called by programs we do not know"
)]

use core::ffi::{c_char, c_int, c_void};
use gluray::interposer::{self, COUNT, EntryPoints, Imports};
use std::sync::atomic::AtomicPtr;

/// The target of each trampoline: first `lazy`, then gluray's hook or the driver's function.
static TABLE: [AtomicPtr<()>; COUNT] = [const { AtomicPtr::new(lazy as *mut ()) }; COUNT];

static ENTRY_POINTS: EntryPoints =
    EntryPoints { targets: &TABLE, trampolines: &TRAMPOLINES, leaving };

// ---- Trampolines --------------------------------------------------------------------------------
/// The trampoline of one entry point: `direct` jumps through the table, `watched` too unless calls
/// are to be reported, `always` reports each call.
macro_rules! trampoline {
    (direct $index:literal $name:ident) => {
        trampoline! {
            $name: ["mov r11d, {index}", "jmp qword ptr [rip + {table} + 8*{index}]"],
            index = const $index, table = sym TABLE
        }
    };
    (watched $index:literal $name:ident) => {
        trampoline! {
            $name: [
                "cmp dword ptr [rip + {armed}], 0",
                "jne 2f",
                "inc qword ptr [rip + {calls}]",
                "mov r11d, {index}",
                "jmp qword ptr [rip + {table} + 8*{index}]",
                "2:",
                "mov r11d, {index}",
                "jmp {slow}"
            ],
            index = const $index, table = sym TABLE, armed = sym ARMED, calls = sym CALLS,
            slow = sym slow
        }
    };
    (always $index:literal $name:ident) => {
        trampoline! {
            $name: ["mov r11d, {index}", "jmp {slow}"], index = const $index, slow = sym slow
        }
    };
    ($name:ident: [$($line:literal),*], $($operands:tt)*) => {
        #[unsafe(naked)]
        #[unsafe(no_mangle)]
        pub(super) unsafe extern "C" fn $name() {
            core::arch::naked_asm!($($line,)* $($operands)*)
        }
    };
}

macro_rules! trampolines {
    ($($kind:ident $index:literal $name:ident;)*) => {
        #[allow(non_snake_case, reason = "the names of OpenGL")]
        mod trampolines {
            use super::{TABLE, slow};
            use gluray::interposer::{ARMED, CALLS};

            $(trampoline! { $kind $index $name })*
        }

        static TRAMPOLINES: [unsafe extern "C" fn(); COUNT] = [$(trampolines::$name),*];
    };
}
gluray::entry_points! { trampolines }

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

extern "C" fn resolve(index: usize) -> *const () {
    interposer::resolve(&ENTRY_POINTS, index)
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

/// The target of former hooks after a fault: see [`interposer::left`].
#[unsafe(naked)]
unsafe extern "C" fn leaving() {
    with_arguments_kept!(
        ["mov edi, r11d", "call {left}", "mov r10, rax"],
        ["jmp r10"],
        left = sym interposer::left
    )
}

/// Reports entry r11, then jumps to its target, with all argument registers unchanged.
#[unsafe(naked)]
unsafe extern "C" fn slow() {
    with_arguments_kept!(
        ["mov edi, r11d", "call {report}"],
        ["lea r10, [rip + {table}]", "jmp qword ptr [r10 + 8*r11]"],
        report = sym interposer::on_watched_call, table = sym TABLE
    )
}

// ---- Look-ups -----------------------------------------------------------------------------------
/// Our address for a name that a program looks up itself, or null for libc's answer.
unsafe extern "C" fn ours(handle: *mut c_void, name: *const c_char) -> *const () {
    // SAFETY: the program's own arguments of dlsym.
    unsafe { interposer::looked_up(&ENTRY_POINTS, handle, name) }
}

/// Programs see this only under LD_PRELOAD. It jumps to libc's function, so that libc sees the
/// program's return address, on which RTLD_NEXT depends.
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn dlsym() {
    core::arch::naked_asm!(
        "push rdi",
        "push rsi",
        "sub rsp, 8",
        "call {ours}",
        "add rsp, 8",
        "pop rsi",
        "pop rdi",
        "test rax, rax",
        "jne 2f",
        "jmp qword ptr [rip + {real}]",
        "2:",
        "ret",
        ours = sym ours, real = sym interposer::REAL_DLSYM
    )
}

/// GLVND's entry into a GLX vendor library: the driver's, with our addresses.
#[unsafe(no_mangle)]
unsafe extern "C" fn __glx_Main(
    version: u32,
    exports: *const c_void,
    vendor: *mut c_void,
    imports: *mut Imports,
) -> c_int {
    // SAFETY: GLVND's own arguments.
    unsafe { interposer::glx_main(&ENTRY_POINTS, version, exports, vendor, imports) }
}

/// GLVND's entry into an EGL vendor library.
#[unsafe(no_mangle)]
unsafe extern "C" fn __egl_Main(
    version: u32,
    exports: *const c_void,
    vendor: *mut c_void,
    imports: *mut Imports,
) -> c_int {
    // SAFETY: GLVND's own arguments.
    unsafe { interposer::egl_main(&ENTRY_POINTS, version, exports, vendor, imports) }
}
