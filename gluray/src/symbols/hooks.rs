//! Hooks of the calls that are taken apart. Each hands its arguments to the current context, whose method says whether that
//! was all; if not, the driver gets the call as it came.
//!
//! The build script reads this file: a line that begins with `fn gl…(` or `fn egl…(` is a hook.

use super::entry::{known, replaced};
use super::{hot, with_context};
use crate::client_memory;
use crate::context;
use crate::evaluators::Kind;
use crate::fault::guard;
use crate::immediate::Step;
use crate::real::{Int, forward};
use core::ffi::{c_char, c_void};

/// What is called when the driver lacks a function: nothing happens, zero comes back.
pub(crate) extern "C" fn no_context() -> usize {
    0
}

/// Calls the driver's function of the same name.
macro_rules! driver {
    ($name:ident($($a:expr),*): ($($t:ty),*) $(-> $r:ty)?) => {{
        static INDEX: std::sync::OnceLock<usize> = std::sync::OnceLock::new();
        let index = *INDEX.get_or_init(|| known(stringify!($name)));
        // SAFETY: OpenGL's signature of this name, with the program's own arguments.
        unsafe {
            let f: unsafe extern "C" fn($($t),*) $(-> $r)? = core::mem::transmute(forward(index));
            f($($a),*)
        }
    }};
}

/// Hooks whose method says whether the driver is still to be called.
macro_rules! hooks {
    ($($(#[$m:meta])* fn $name:ident($($a:ident: $t:ty),*) => |$c:ident| $body:expr;)*) => { $(
        $(#[$m])*
        pub(in crate::symbols) unsafe extern "C" fn $name($($a: $t),*) {
            let handled = guard(|| with_context(|$c| $body)).flatten().unwrap_or(false);
            if !handled {
                driver!($name($($a),*): ($($t),*));
            }
        }
    )* };
}

/// The same for calls that come by the million: first the short way, then the long one. Their methods guard what is slow.
macro_rules! hot_hooks {
    ($($(#[$m:meta])* fn $name:ident($($a:ident: $t:ty),*) => |$c:ident| $step:expr, $body:expr;)*) => { $(
        $(#[$m])*
        pub(in crate::symbols) unsafe extern "C" fn $name($($a: $t),*) {
            #[cold]
            #[inline(never)]
            unsafe extern "C" fn slowly($($a: $t),*) {
                if !hot::with(|$c| $body) {
                    driver!($name($($a),*): ($($t),*));
                }
            }
            if hot::step(|$c| $step) != Step::Done {
                // SAFETY: the program's own arguments.
                unsafe { slowly($($a),*) }
            }
        }
    )* };
}

type Address = *const c_void;

/// Values that `glMaterial` reads for a parameter.
fn material_values(what: u32, address: Address, integers: bool) -> [f32; 4] {
    let count = match what {
        0x1601 => 1,
        0x1603 => 3,
        _ => 4,
    };
    let mut out = [0.0; 4];
    for (i, v) in out.iter_mut().enumerate().take(count) {
        let at = address as usize + 4 * i;
        *v = match integers {
            false => client_memory::floats::<1>(at)[0],
            true if count == 4 => {
                ((2.0 * f64::from(client_memory::ints::<1>(at)[0]) + 1.0) / f64::from(u32::MAX)) as f32
            }
            true => client_memory::ints::<1>(at)[0] as f32,
        };
    }
    out
}

hot_hooks! {
    fn glBegin(mode: u32) => |c| c.begin_step(mode), c.begin(mode);
    fn glEnd() => |c| c.end_step(), c.end();
}

/// The same for calls that have no short way.
macro_rules! long_hooks {
    ($($(#[$m:meta])* fn $name:ident($($a:ident: $t:ty),*) => |$c:ident| $body:expr;)*) => { $(
        $(#[$m])*
        pub(in crate::symbols) unsafe extern "C" fn $name($($a: $t),*) {
            if !hot::with(|$c| $body) {
                driver!($name($($a),*): ($($t),*));
            }
        }
    )* };
}

long_hooks! {
    fn glMaterialfv(face: u32, what: u32, v: Address) => |c| c.material(face, what, material_values(what, v, false));
    fn glMaterialiv(face: u32, what: u32, v: Address) => |c| c.material(face, what, material_values(what, v, true));
    fn glMaterialf(face: u32, what: u32, v: f32) => |c| c.material(face, what, [v, 0.0, 0.0, 0.0]);
    fn glMateriali(face: u32, what: u32, v: Int) => |c| c.material(face, what, [v as f32, 0.0, 0.0, 0.0]);
}

hooks! {
    fn glRectf(x: f32, y: f32, x2: f32, y2: f32) => |c| c.rect([x, y, x2, y2]);
    fn glRectd(x: f64, y: f64, x2: f64, y2: f64) => |c| c.rect([x, y, x2, y2].map(|v| v as f32));
    fn glRecti(x: Int, y: Int, x2: Int, y2: Int) => |c| c.rect([x, y, x2, y2].map(|v| v as f32));
    fn glRects(x: i16, y: i16, x2: i16, y2: i16) => |c| c.rect([x, y, x2, y2].map(f32::from));
    fn glArrayElement(i: Int) => |c| c.array_element(i);
    fn glArrayElementEXT(i: Int) => |c| c.array_element(i);
    fn glMap1f(target: u32, u1: f32, u2: f32, stride: Int, order: Int, points: Address) => |c| c.maps_change();
    fn glMap1d(target: u32, u1: f64, u2: f64, stride: Int, order: Int, points: Address) => |c| c.maps_change();
    fn glMap2f(target: u32, u1: f32, u2: f32, ustride: Int, uorder: Int, v1: f32, v2: f32, vstride: Int, vorder: Int, points: Address) => |c| c.maps_change();
    fn glMap2d(target: u32, u1: f64, u2: f64, ustride: Int, uorder: Int, v1: f64, v2: f64, vstride: Int, vorder: Int, points: Address) => |c| c.maps_change();
    fn glMapGrid1f(n: Int, u1: f32, u2: f32) => |c| c.maps_change();
    fn glMapGrid1d(n: Int, u1: f64, u2: f64) => |c| c.maps_change();
    fn glMapGrid2f(un: Int, u1: f32, u2: f32, vn: Int, v1: f32, v2: f32) => |c| c.maps_change();
    fn glMapGrid2d(un: Int, u1: f64, u2: f64, vn: Int, v1: f64, v2: f64) => |c| c.maps_change();
    fn glEvalCoord1f(u: f32) => |c| c.eval_coord(Kind::Curve, [u, 0.0]);
    fn glEvalCoord1d(u: f64) => |c| c.eval_coord(Kind::Curve, [u as f32, 0.0]);
    fn glEvalCoord1fv(v: Address) => |c| c.eval_coord(Kind::Curve, [client_memory::floats::<1>(v as usize)[0], 0.0]);
    fn glEvalCoord1dv(v: Address) => |c| c.eval_coord(Kind::Curve, [client_memory::doubles::<1>(v as usize)[0] as f32, 0.0]);
    fn glEvalCoord2f(u: f32, v: f32) => |c| c.eval_coord(Kind::Surface, [u, v]);
    fn glEvalCoord2d(u: f64, v: f64) => |c| c.eval_coord(Kind::Surface, [u as f32, v as f32]);
    fn glEvalCoord2fv(v: Address) => |c| c.eval_coord(Kind::Surface, client_memory::floats(v as usize));
    fn glEvalCoord2dv(v: Address) => |c| c.eval_coord(Kind::Surface, client_memory::doubles(v as usize).map(|x| x as f32));
    fn glEvalPoint1(i: Int) => |c| c.eval_point(Kind::Curve, [i, 0]);
    fn glEvalPoint2(i: Int, j: Int) => |c| c.eval_point(Kind::Surface, [i, j]);
    fn glEvalMesh1(mode: u32, i1: Int, i2: Int) => |c| c.eval_mesh_1(mode);
    fn glEvalMesh2(mode: u32, i1: Int, i2: Int, j1: Int, j2: Int) => |c| c.eval_mesh_2(mode, [i1, i2, j1, j2]);
    fn glNewList(list: u32, mode: u32) => |c| c.new_list(list, mode);
    fn glPrimitiveRestartNV() => |c| c.primitive_restart();
    fn glEndList() => |c| c.end_list();
    fn glCallList(list: u32) => |c| c.call_list(list);
    fn glCallLists(n: Int, kind: u32, names: Address) => |c| c.call_lists(n, kind, names as usize);
    fn glDeleteLists(first: u32, n: Int) => |c| c.delete_lists(first, n);
    fn glDrawArrays(mode: u32, first: Int, count: Int) => |c| c.draw_arrays(mode, first, count);
    fn glDrawArraysEXT(mode: u32, first: Int, count: Int) => |c| c.draw_arrays(mode, first, count);
    fn glDrawElements(mode: u32, count: Int, kind: u32, at: Address) => |c| c.draw_elements(mode, count, kind, at as usize, 0);
    fn glDrawRangeElements(mode: u32, start: u32, end: u32, count: Int, kind: u32, at: Address) => |c| c.draw_elements(mode, count, kind, at as usize, 0);
    fn glDrawRangeElementsEXT(mode: u32, start: u32, end: u32, count: Int, kind: u32, at: Address) => |c| c.draw_elements(mode, count, kind, at as usize, 0);
    fn glDrawElementsBaseVertex(mode: u32, count: Int, kind: u32, at: Address, base: Int) => |c| c.draw_elements(mode, count, kind, at as usize, base);
    fn glDrawRangeElementsBaseVertex(mode: u32, start: u32, end: u32, count: Int, kind: u32, at: Address, base: Int) => |c| c.draw_elements(mode, count, kind, at as usize, base);
    fn glBufferData(target: u32, size: isize, data: Address, usage: u32) => |c| c.buffer_written(target);
    fn glBufferDataARB(target: u32, size: isize, data: Address, usage: u32) => |c| c.buffer_written(target);
    fn glBufferSubData(target: u32, at: isize, size: isize, data: Address) => |c| c.buffer_written(target);
    fn glBufferSubDataARB(target: u32, at: isize, size: isize, data: Address) => |c| c.buffer_written(target);
    fn glDeleteBuffers(n: Int, names: Address) => |c| c.buffers_deleted(n, names as usize);
    fn glDeleteBuffersARB(n: Int, names: Address) => |c| c.buffers_deleted(n, names as usize);
    fn glClear(mask: u32) => |c| c.clear(mask);
    fn glLinkProgram(program: u32) => |c| c.link_program(program);
}

pub(in crate::symbols) unsafe extern "C" fn glGetError() -> u32 {
    context_error()
}

pub(in crate::symbols) unsafe extern "C" fn glGenLists(n: Int) -> u32 {
    let given = guard(|| with_context(|c| c.gen_lists(n))).flatten().flatten();
    given.unwrap_or_else(|| driver!(glGenLists(n): (Int) -> u32))
}

fn context_error() -> u32 {
    let kept = guard(|| with_context(context::Context::take_error)).flatten().flatten();
    kept.unwrap_or_else(|| driver!(glGetError(): () -> u32))
}

// ---- Addresses ------------------------------------------------------------------------------------------------------

macro_rules! get_proc_address {
    ($($name:ident)*) => { $(
        pub(in crate::symbols) unsafe extern "C" fn $name(name: *const c_char) -> *const () {
            replaced(name, driver!($name(name): (*const c_char) -> *const ()))
        }
    )* };
}
get_proc_address! { glXGetProcAddress glXGetProcAddressARB eglGetProcAddress }

// ---- Contexts -------------------------------------------------------------------------------------------------------

type Handle = *mut c_void;

/// Brackets a change of the current context: what is pending is drawn with the old one, then the books follow.
fn making_current(context: Handle, real: impl FnOnce() -> u32) -> u32 {
    guard(context::leave);
    let done = real();
    if done != 0 {
        guard(|| context::enter(context as usize));
    } else {
        guard(context::stay);
    }
    done
}

pub(in crate::symbols) unsafe extern "C" fn glXMakeCurrent(
    display: Handle,
    drawable: usize,
    context: Handle,
) -> u32 {
    making_current(
        context,
        || driver!(glXMakeCurrent(display, drawable, context): (Handle, usize, Handle) -> u32),
    )
}

pub(in crate::symbols) unsafe extern "C" fn glXMakeContextCurrent(
    display: Handle,
    draw: usize,
    read: usize,
    context: Handle,
) -> u32 {
    making_current(
        context,
        || driver!(glXMakeContextCurrent(display, draw, read, context): (Handle, usize, usize, Handle) -> u32),
    )
}

pub(in crate::symbols) unsafe extern "C" fn glXMakeCurrentReadSGI(
    display: Handle,
    draw: usize,
    read: usize,
    context: Handle,
) -> u32 {
    making_current(
        context,
        || driver!(glXMakeCurrentReadSGI(display, draw, read, context): (Handle, usize, usize, Handle) -> u32),
    )
}

pub(in crate::symbols) unsafe extern "C" fn eglMakeCurrent(
    display: Handle,
    draw: Handle,
    read: Handle,
    context: Handle,
) -> u32 {
    making_current(
        context,
        || driver!(eglMakeCurrent(display, draw, read, context): (Handle, Handle, Handle, Handle) -> u32),
    )
}

fn created(context: Handle, share: Handle) -> Handle {
    guard(|| context::created(context as usize, share as usize));
    context
}

pub(in crate::symbols) unsafe extern "C" fn glXCreateContext(
    display: Handle,
    visual: Handle,
    share: Handle,
    direct: Int,
) -> Handle {
    created(
        driver!(glXCreateContext(display, visual, share, direct): (Handle, Handle, Handle, Int) -> Handle),
        share,
    )
}

pub(in crate::symbols) unsafe extern "C" fn glXCreateNewContext(
    display: Handle,
    config: Handle,
    kind: Int,
    share: Handle,
    direct: Int,
) -> Handle {
    created(
        driver!(glXCreateNewContext(display, config, kind, share, direct): (Handle, Handle, Int, Handle, Int) -> Handle),
        share,
    )
}

pub(in crate::symbols) unsafe extern "C" fn glXCreateContextAttribsARB(
    display: Handle,
    config: Handle,
    share: Handle,
    direct: Int,
    attributes: Address,
) -> Handle {
    created(
        driver!(glXCreateContextAttribsARB(display, config, share, direct, attributes): (Handle, Handle, Handle, Int, Address) -> Handle),
        share,
    )
}

pub(in crate::symbols) unsafe extern "C" fn eglCreateContext(
    display: Handle,
    config: Handle,
    share: Handle,
    attributes: Address,
) -> Handle {
    created(
        driver!(eglCreateContext(display, config, share, attributes): (Handle, Handle, Handle, Address) -> Handle),
        share,
    )
}

pub(in crate::symbols) unsafe extern "C" fn glXDestroyContext(display: Handle, context: Handle) {
    guard(|| context::destroyed(context as usize));
    driver!(glXDestroyContext(display, context): (Handle, Handle));
}

pub(in crate::symbols) unsafe extern "C" fn eglDestroyContext(display: Handle, context: Handle) -> u32 {
    guard(|| context::destroyed(context as usize));
    driver!(eglDestroyContext(display, context): (Handle, Handle) -> u32)
}
