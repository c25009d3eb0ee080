//! Hooks of the calls that are taken apart. Each passes its arguments to the current context. The
//! method returns whether it has handled the call; if not, the driver gets the call unchanged.
//!
//! The build script reads this file: a line that begins with `fn gl…(` or `fn egl…(` is a hook.

use super::lookup::replaced;
use super::{current_context, with_context};
use crate::calls::at;
use crate::capture::display_lists::names::width;
use crate::capture::evaluators::MapKind;
use crate::capture::immediate_mode::FastPathResult;
use crate::capture::vertex_arrays::Instances;
use crate::driver::{Int, found};
use crate::enums::{COLOR_INDEXES, SHININESS};
use crate::faults::caught;
use crate::interpose::client_memory::{self, ActiveCall, DrawArguments};
use crate::interpose::context;
use core::ffi::{c_char, c_void};

/// Calls the driver's function of the same name.
macro_rules! driver {
    ($name:ident($($a:expr),*): ($($t:ty),*) $(-> $r:ty)?) => {{
        // SAFETY: OpenGL's signature of this name, with the program's own arguments.
        unsafe {
            let f: unsafe extern "C" fn($($t),*) $(-> $r)? = core::mem::transmute(super::forward_plainly(at::$name));
            f($($a),*)
        }
    }};
}

/// Hooks whose method returns whether it has handled the call.
macro_rules! hooks {
    ($($(#[$m:meta])* fn $name:ident($($a:ident: $t:ty),*) => |$c:ident| $body:expr;)*) => { $(
        $(#[$m])*
        pub(in crate::interpose::symbols) unsafe extern "C" fn $name($($a: $t),*) {
            if !current_context::with(at::$name, |$c| $body) {
                driver!($name($($a),*): ($($t),*));
            }
        }
    )* };
}

/// The same for the most frequent calls: first the fast path, then the slow one.
macro_rules! hot_hooks {
    ($($(#[$m:meta])* fn $name:ident($($a:ident: $t:ty),*) => |$c:ident| $step:expr, $body:expr;)*) => { $(
        $(#[$m])*
        pub(in crate::interpose::symbols) unsafe extern "C" fn $name($($a: $t),*) {
            #[cold]
            #[inline(never)]
            unsafe extern "C" fn slow($($a: $t),*) {
                if !current_context::with(at::$name, |$c| $body) {
                    driver!($name($($a),*): ($($t),*));
                }
            }
            match current_context::fast_call(at::$name, |$c| $step) {
                FastPathResult::Done => (),
                FastPathResult::Driver => match found(at::$name) {
                    // SAFETY: OpenGL's signature of this name, with the program's own arguments.
                    Some(known) => unsafe {
                        let f: unsafe extern "C" fn($($t),*) = core::mem::transmute(known);
                        f($($a),*)
                    },
                    // SAFETY: the program's own arguments.
                    None => unsafe { slow($($a),*) },
                },
                // SAFETY: the program's own arguments.
                FastPathResult::Slow => unsafe { slow($($a),*) },
            }
        }
    )* };
}

type Address = *const c_void;

/// The values that `glMaterial` reads for a parameter.
///
/// # Safety
/// The program has called `glMaterial` with these.
unsafe fn material_values(what: u32, address: Address, integers: bool) -> [f32; 4] {
    let count = match what {
        SHININESS => 1,
        COLOR_INDEXES => 3,
        _ => 4,
    };
    let mut out = [0.0; 4];
    for (i, v) in out.iter_mut().enumerate().take(count) {
        let at = address as usize + 4 * i;
        // SAFETY: one of the values that the call names.
        *v = match (integers, unsafe { client_memory::ints::<1>(at) }) {
            (false, [bits]) => f32::from_bits(bits.cast_unsigned()),
            (true, [n]) if count == 4 => ((2.0 * f64::from(n) + 1.0) / f64::from(u32::MAX)) as f32,
            (true, [n]) => n as f32,
        };
    }
    out
}

hot_hooks! {
    fn glBegin(mode: u32) => |c| c.begin_fast(mode), c.begin(mode);
    fn glEnd() => |c| c.end_fast(), c.end();
}

/// The same for calls without a fast path.
macro_rules! long_hooks {
    ($($(#[$m:meta])* fn $name:ident($($a:ident: $t:ty),*) => |$c:ident| $body:expr;)*) => { $(
        $(#[$m])*
        pub(in crate::interpose::symbols) unsafe extern "C" fn $name($($a: $t),*) {
            if !current_context::with(at::$name, |$c| $body) {
                driver!($name($($a),*): ($($t),*));
            }
        }
    )* };
}

long_hooks! {
    fn glMaterialfv(face: u32, what: u32, v: Address) => |c| {
        // SAFETY: the program's own arguments.
        let values = unsafe { material_values(what, v, false) };
        c.material(face, what, values)
    };
    fn glMaterialiv(face: u32, what: u32, v: Address) => |c| {
        // SAFETY: the program's own arguments.
        let values = unsafe { material_values(what, v, true) };
        c.material(face, what, values)
    };
    fn glMaterialf(face: u32, what: u32, v: f32) => |c| c.material(face, what, [v, 0.0, 0.0, 0.0]);
    fn glMateriali(face: u32, what: u32, v: Int) => |c| c.material(face, what, [v as f32, 0.0, 0.0, 0.0]);
}

hooks! {
    fn glRectf(x: f32, y: f32, x2: f32, y2: f32) => |c| c.rect([x, y, x2, y2]);
    fn glRectd(x: f64, y: f64, x2: f64, y2: f64) => |c| c.rect([x, y, x2, y2].map(|v| v as f32));
    fn glRecti(x: Int, y: Int, x2: Int, y2: Int) => |c| c.rect([x, y, x2, y2].map(|v| v as f32));
    fn glRects(x: i16, y: i16, x2: i16, y2: i16) => |c| c.rect([x, y, x2, y2].map(f32::from));
    fn glArrayElement(i: Int) => |c| {
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(DrawArguments::Element(i)) };
        c.array_element(&call)
    };
    fn glArrayElementEXT(i: Int) => |c| {
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(DrawArguments::Element(i)) };
        c.array_element(&call)
    };
    fn glMap1f(target: u32, u1: f32, u2: f32, stride: Int, order: Int, points: Address) => |c| c.invalidate_maps();
    fn glMap1d(target: u32, u1: f64, u2: f64, stride: Int, order: Int, points: Address) => |c| c.invalidate_maps();
    fn glMap2f(target: u32, u1: f32, u2: f32, ustride: Int, uorder: Int, v1: f32, v2: f32, vstride: Int, vorder: Int, points: Address) => |c| c.invalidate_maps();
    fn glMap2d(target: u32, u1: f64, u2: f64, ustride: Int, uorder: Int, v1: f64, v2: f64, vstride: Int, vorder: Int, points: Address) => |c| c.invalidate_maps();
    fn glMapGrid1f(n: Int, u1: f32, u2: f32) => |c| c.invalidate_maps();
    fn glMapGrid1d(n: Int, u1: f64, u2: f64) => |c| c.invalidate_maps();
    fn glMapGrid2f(un: Int, u1: f32, u2: f32, vn: Int, v1: f32, v2: f32) => |c| c.invalidate_maps();
    fn glMapGrid2d(un: Int, u1: f64, u2: f64, vn: Int, v1: f64, v2: f64) => |c| c.invalidate_maps();
    fn glEvalCoord1f(u: f32) => |c| c.eval_coord(MapKind::Curve, [u, 0.0]);
    fn glEvalCoord1d(u: f64) => |c| c.eval_coord(MapKind::Curve, [u as f32, 0.0]);
    fn glEvalCoord1fv(v: Address) => |c| {
        // SAFETY: the call names so many numbers there.
        let at = unsafe { client_memory::floats::<1>(v as usize) };
        c.eval_coord(MapKind::Curve, [at[0], 0.0])
    };
    fn glEvalCoord1dv(v: Address) => |c| {
        // SAFETY: the call names so many numbers there.
        let at = unsafe { client_memory::doubles::<1>(v as usize) };
        c.eval_coord(MapKind::Curve, [at[0] as f32, 0.0])
    };
    fn glEvalCoord2f(u: f32, v: f32) => |c| c.eval_coord(MapKind::Surface, [u, v]);
    fn glEvalCoord2d(u: f64, v: f64) => |c| c.eval_coord(MapKind::Surface, [u as f32, v as f32]);
    fn glEvalCoord2fv(v: Address) => |c| {
        // SAFETY: the call names so many numbers there.
        let at = unsafe { client_memory::floats::<2>(v as usize) };
        c.eval_coord(MapKind::Surface, at)
    };
    fn glEvalCoord2dv(v: Address) => |c| {
        // SAFETY: the call names so many numbers there.
        let at = unsafe { client_memory::doubles::<2>(v as usize) };
        c.eval_coord(MapKind::Surface, at.map(|x| x as f32))
    };
    fn glEvalPoint1(i: Int) => |c| c.eval_point(MapKind::Curve, [i, 0]);
    fn glEvalPoint2(i: Int, j: Int) => |c| c.eval_point(MapKind::Surface, [i, j]);
    fn glEvalMesh1(mode: u32, i1: Int, i2: Int) => |c| c.eval_mesh_1(mode);
    fn glEvalMesh2(mode: u32, i1: Int, i2: Int, j1: Int, j2: Int) => |c| c.eval_mesh_2(mode, [i1, i2, j1, j2]);
    fn glPrimitiveRestartNV() => |c| c.primitive_restart();
    fn glDrawArrays(mode: u32, first: Int, count: Int) => |c| {
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(DrawArguments::Arrays { first, count }) };
        c.draw(mode, &call)
    };
    fn glDrawArraysEXT(mode: u32, first: Int, count: Int) => |c| {
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(DrawArguments::Arrays { first, count }) };
        c.draw(mode, &call)
    };
    fn glDrawElements(mode: u32, count: Int, kind: u32, at: Address) => |c| {
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(DrawArguments::Elements { count, kind, at: at as usize, base: 0 }) };
        c.draw(mode, &call)
    };
    fn glDrawRangeElements(mode: u32, start: u32, end: u32, count: Int, kind: u32, at: Address) => |c| {
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(DrawArguments::Elements { count, kind, at: at as usize, base: 0 }) };
        c.draw(mode, &call)
    };
    fn glDrawRangeElementsEXT(mode: u32, start: u32, end: u32, count: Int, kind: u32, at: Address) => |c| {
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(DrawArguments::Elements { count, kind, at: at as usize, base: 0 }) };
        c.draw(mode, &call)
    };
    fn glDrawElementsBaseVertex(mode: u32, count: Int, kind: u32, at: Address, base: Int) => |c| {
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(DrawArguments::Elements { count, kind, at: at as usize, base }) };
        c.draw(mode, &call)
    };
    fn glDrawRangeElementsBaseVertex(mode: u32, start: u32, end: u32, count: Int, kind: u32, at: Address, base: Int) => |c| {
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(DrawArguments::Elements { count, kind, at: at as usize, base }) };
        c.draw(mode, &call)
    };
    fn glDrawArraysInstanced(mode: u32, first: Int, count: Int, n: Int) => |c| {
        let named = DrawArguments::Arrays { first, count };
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(named) };
        c.draw_instances(mode, &call, Instances::of(n, 0))
    };
    fn glDrawArraysInstancedARB(mode: u32, first: Int, count: Int, n: Int) => |c| {
        let named = DrawArguments::Arrays { first, count };
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(named) };
        c.draw_instances(mode, &call, Instances::of(n, 0))
    };
    fn glDrawArraysInstancedEXT(mode: u32, first: Int, count: Int, n: Int) => |c| {
        let named = DrawArguments::Arrays { first, count };
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(named) };
        c.draw_instances(mode, &call, Instances::of(n, 0))
    };
    fn glDrawArraysInstancedBaseInstance(
        mode: u32, first: Int, count: Int, n: Int, base: u32
    ) => |c| {
        let named = DrawArguments::Arrays { first, count };
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(named) };
        c.draw_instances(mode, &call, Instances::of(n, base))
    };
    fn glDrawElementsInstanced(mode: u32, count: Int, kind: u32, at: Address, n: Int) => |c| {
        let named = DrawArguments::Elements { count, kind, at: at as usize, base: 0 };
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(named) };
        c.draw_instances(mode, &call, Instances::of(n, 0))
    };
    fn glDrawElementsInstancedARB(mode: u32, count: Int, kind: u32, at: Address, n: Int) => |c| {
        let named = DrawArguments::Elements { count, kind, at: at as usize, base: 0 };
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(named) };
        c.draw_instances(mode, &call, Instances::of(n, 0))
    };
    fn glDrawElementsInstancedEXT(mode: u32, count: Int, kind: u32, at: Address, n: Int) => |c| {
        let named = DrawArguments::Elements { count, kind, at: at as usize, base: 0 };
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(named) };
        c.draw_instances(mode, &call, Instances::of(n, 0))
    };
    fn glDrawElementsInstancedBaseVertex(
        mode: u32, count: Int, kind: u32, at: Address, n: Int, base: Int
    ) => |c| {
        let named = DrawArguments::Elements { count, kind, at: at as usize, base };
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(named) };
        c.draw_instances(mode, &call, Instances::of(n, 0))
    };
    fn glDrawElementsInstancedBaseInstance(
        mode: u32, count: Int, kind: u32, at: Address, n: Int, instance: u32
    ) => |c| {
        let named = DrawArguments::Elements { count, kind, at: at as usize, base: 0 };
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(named) };
        c.draw_instances(mode, &call, Instances::of(n, instance))
    };
    fn glDrawElementsInstancedBaseVertexBaseInstance(
        mode: u32, count: Int, kind: u32, at: Address, n: Int, base: Int, instance: u32
    ) => |c| {
        let named = DrawArguments::Elements { count, kind, at: at as usize, base };
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(named) };
        c.draw_instances(mode, &call, Instances::of(n, instance))
    };
    fn glMultiDrawArrays(mode: u32, first: Address, count: Address, n: Int) => |c| {
        let (firsts, counts) = (first as usize, count as usize);
        let named = DrawArguments::SeveralArrays { firsts, counts, draws: n };
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(named) };
        c.draw(mode, &call)
    };
    fn glMultiDrawArraysEXT(mode: u32, first: Address, count: Address, n: Int) => |c| {
        let (firsts, counts) = (first as usize, count as usize);
        let named = DrawArguments::SeveralArrays { firsts, counts, draws: n };
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(named) };
        c.draw(mode, &call)
    };
    fn glMultiDrawElements(mode: u32, count: Address, kind: u32, at: Address, n: Int) => |c| {
        let (counts, at, bases) = (count as usize, at as usize, 0);
        let named = DrawArguments::SeveralElements { counts, kind, at, bases, draws: n };
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(named) };
        c.draw(mode, &call)
    };
    fn glMultiDrawElementsEXT(mode: u32, count: Address, kind: u32, at: Address, n: Int) => |c| {
        let (counts, at, bases) = (count as usize, at as usize, 0);
        let named = DrawArguments::SeveralElements { counts, kind, at, bases, draws: n };
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(named) };
        c.draw(mode, &call)
    };
    fn glMultiDrawElementsBaseVertex(
        mode: u32, count: Address, kind: u32, at: Address, n: Int, base: Address
    ) => |c| {
        let (counts, at, bases) = (count as usize, at as usize, base as usize);
        let named = DrawArguments::SeveralElements { counts, kind, at, bases, draws: n };
        // SAFETY: the program's own call, which waits for us.
        let call = unsafe { ActiveCall::new(named) };
        c.draw(mode, &call)
    };
    fn glBufferData(target: u32, size: isize, data: Address, usage: u32) => |c| c.buffer_written(target);
    fn glBufferDataARB(target: u32, size: isize, data: Address, usage: u32) => |c| c.buffer_written(target);
    fn glBufferSubData(target: u32, at: isize, size: isize, data: Address) => |c| c.buffer_written(target);
    fn glBufferSubDataARB(target: u32, at: isize, size: isize, data: Address) => |c| c.buffer_written(target);
    fn glDeleteBuffers(n: Int, names: Address) => |c| {
        // SAFETY: the call has so many names there.
        let names = unsafe { client_memory::view(names as usize, 4 * usize::try_from(n).unwrap_or(0)) };
        c.buffers_deleted(names)
    };
    fn glDeleteBuffersARB(n: Int, names: Address) => |c| {
        // SAFETY: the call has so many names there.
        let names = unsafe { client_memory::view(names as usize, 4 * usize::try_from(n).unwrap_or(0)) };
        c.buffers_deleted(names)
    };
    fn glClear(mask: u32) => |c| c.clear(mask);
    fn glLinkProgram(program: u32) => |c| c.link_program(program);
}

/// The same for lists, which we keep handling after a fault.
macro_rules! book_hooks {
    ($(fn $name:ident($($a:ident: $t:ty),*) => |$c:ident| $body:expr;)*) => { $(
        pub(in crate::interpose::symbols) unsafe extern "C" fn $name($($a: $t),*) {
            if !current_context::with_even_after_fault(at::$name, |$c| $body) {
                driver!($name($($a),*): ($($t),*));
            }
        }
    )* };
}

book_hooks! {
    fn glNewList(list: u32, mode: u32) => |c| c.new_list(list, mode);
    fn glEndList() => |c| c.end_list();
    fn glCallList(list: u32) => |c| c.call_list(list);
    fn glCallLists(n: Int, kind: u32, names: Address) => |c| {
        let bytes = usize::try_from(n).unwrap_or(0) * width(kind).unwrap_or(0);
        // SAFETY: the call has so many names of that type there.
        let names = unsafe { client_memory::view(names as usize, bytes) };
        n >= 0 && c.call_lists(kind, names)
    };
    fn glDeleteLists(first: u32, n: Int) => |c| c.delete_lists(first, n);
}

/// The same for calls after which other contexts see this context's writes to textures. They are
/// reported before they run, like others, and again afterwards.
macro_rules! publishing_hooks {
    ($(fn $name:ident();)*) => { $(
        pub(in crate::interpose::symbols) unsafe extern "C" fn $name() {
            current_context::with(at::$name, |c| {
                c.watched_call(at::$name, 0, true, false);
                false
            });
            driver!($name(): ());
            caught(|| with_context(context::Context::publish_textures));
        }
    )* };
}

publishing_hooks! {
    fn glFlush();
    fn glFinish();
}

pub(in crate::interpose::symbols) unsafe extern "C" fn glGetError() -> u32 {
    let take = || {
        crate::faults::inject_at(at::glGetError);
        with_context(context::Context::take_error)
    };
    let kept = caught(take).flatten().flatten();
    kept.unwrap_or_else(|| driver!(glGetError(): () -> u32))
}

pub(in crate::interpose::symbols) unsafe extern "C" fn glGenLists(n: Int) -> u32 {
    let give = || {
        crate::faults::inject_at(at::glGenLists);
        with_context(|c| c.gen_lists(n))
    };
    let given = caught(give).flatten().flatten();
    given.unwrap_or_else(|| {
        let first = driver!(glGenLists(n): (Int) -> u32);
        caught(|| with_context(|c| c.note_names(first, n)));
        first
    })
}

// ---- Addresses ----------------------------------------------------------------------------------
macro_rules! get_proc_address {
    ($($name:ident)*) => { $(
        pub(in crate::interpose::symbols) unsafe extern "C" fn $name(name: *const c_char) -> *const () {
            let address = driver!($name(name): (*const c_char) -> *const ());
            let ours = || {
                crate::faults::inject_at(at::$name);
                replaced(name, address)
            };
            caught(ours).unwrap_or(address)
        }
    )* };
}
get_proc_address! { glXGetProcAddress glXGetProcAddressARB eglGetProcAddress }

// ---- Contexts -----------------------------------------------------------------------------------
type Handle = *mut c_void;

/// Brackets a change of the current context: pending draws are presented with the old one, then the
/// register is updated.
fn making_current(index: usize, context: Handle, real: impl FnOnce() -> u32) -> u32 {
    let leave = || {
        crate::faults::inject_at(index);
        context::release_current()
    };
    // Tried again after a fault, because the register must know whose context is current.
    let left = caught(leave).or_else(|| caught(leave)).unwrap_or(context::PreviousContext::Nothing);
    let done = real();
    caught(|| match done {
        0 => context::restore_current(left),
        _ => context::make_current(context as usize, left),
    });
    done
}

pub(in crate::interpose::symbols) unsafe extern "C" fn glXMakeCurrent(
    display: Handle,
    drawable: usize,
    context: Handle,
) -> u32 {
    making_current(
        at::glXMakeCurrent,
        context,
        || driver!(glXMakeCurrent(display, drawable, context): (Handle, usize, Handle) -> u32),
    )
}

pub(in crate::interpose::symbols) unsafe extern "C" fn glXMakeContextCurrent(
    display: Handle,
    draw: usize,
    read: usize,
    context: Handle,
) -> u32 {
    making_current(
        at::glXMakeContextCurrent,
        context,
        || driver!(glXMakeContextCurrent(display, draw, read, context): (Handle, usize, usize, Handle) -> u32),
    )
}

pub(in crate::interpose::symbols) unsafe extern "C" fn glXMakeCurrentReadSGI(
    display: Handle,
    draw: usize,
    read: usize,
    context: Handle,
) -> u32 {
    making_current(
        at::glXMakeCurrentReadSGI,
        context,
        || driver!(glXMakeCurrentReadSGI(display, draw, read, context): (Handle, usize, usize, Handle) -> u32),
    )
}

pub(in crate::interpose::symbols) unsafe extern "C" fn eglMakeCurrent(
    display: Handle,
    draw: Handle,
    read: Handle,
    context: Handle,
) -> u32 {
    making_current(
        at::eglMakeCurrent,
        context,
        || driver!(eglMakeCurrent(display, draw, read, context): (Handle, Handle, Handle, Handle) -> u32),
    )
}

fn destroyed(index: usize, context: Handle) {
    caught(|| {
        crate::faults::inject_at(index);
        context::destroyed(context as usize);
    });
}

fn created(index: usize, context: Handle, share: Handle) -> Handle {
    caught(|| {
        crate::faults::inject_at(index);
        context::created(context as usize, share as usize);
    });
    context
}

pub(in crate::interpose::symbols) unsafe extern "C" fn glXCreateContext(
    display: Handle,
    visual: Handle,
    share: Handle,
    direct: Int,
) -> Handle {
    created(
        at::glXCreateContext,
        driver!(glXCreateContext(display, visual, share, direct): (Handle, Handle, Handle, Int) -> Handle),
        share,
    )
}

pub(in crate::interpose::symbols) unsafe extern "C" fn glXCreateNewContext(
    display: Handle,
    config: Handle,
    kind: Int,
    share: Handle,
    direct: Int,
) -> Handle {
    created(
        at::glXCreateNewContext,
        driver!(glXCreateNewContext(display, config, kind, share, direct): (Handle, Handle, Int, Handle, Int) -> Handle),
        share,
    )
}

pub(in crate::interpose::symbols) unsafe extern "C" fn glXCreateContextAttribsARB(
    display: Handle,
    config: Handle,
    share: Handle,
    direct: Int,
    attributes: Address,
) -> Handle {
    created(
        at::glXCreateContextAttribsARB,
        driver!(glXCreateContextAttribsARB(display, config, share, direct, attributes): (Handle, Handle, Handle, Int, Address) -> Handle),
        share,
    )
}

pub(in crate::interpose::symbols) unsafe extern "C" fn eglCreateContext(
    display: Handle,
    config: Handle,
    share: Handle,
    attributes: Address,
) -> Handle {
    created(
        at::eglCreateContext,
        driver!(eglCreateContext(display, config, share, attributes): (Handle, Handle, Handle, Address) -> Handle),
        share,
    )
}

pub(in crate::interpose::symbols) unsafe extern "C" fn glXDestroyContext(
    display: Handle,
    context: Handle,
) {
    destroyed(at::glXDestroyContext, context);
    driver!(glXDestroyContext(display, context): (Handle, Handle));
}

pub(in crate::interpose::symbols) unsafe extern "C" fn eglDestroyContext(
    display: Handle,
    context: Handle,
) -> u32 {
    destroyed(at::eglDestroyContext, context);
    driver!(eglDestroyContext(display, context): (Handle, Handle) -> u32)
}
