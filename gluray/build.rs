//! Writes the tables of the OpenGL, GLX and EGL entry points of `src/interpose/symbols/names.txt`,
//! the macro from which `gluray-interposer` makes one trampoline for each, and the hooks of the
//! calls that come per vertex. Nothing of OpenGL is needed on the machine that builds.

use std::fmt::Write as _;
use std::path::Path;

/// What a call may change; see `calls::class`.
fn class(name: &str) -> u32 {
    const PURE: u32 = 0;
    if writes_buffers(name) {
        // Shaders that write buffers write images of textures as well.
        let shaders = name.starts_with("glDispatchCompute") || name.starts_with("glMemoryBarrier");
        return BUFFER | if shaders { TEXTURE } else { 0 };
    }
    if name.starts_with("glXBindTexImage") || name.starts_with("eglBindTexImage") {
        return TEXTURE;
    }
    let starts = |list: &[&str]| list.iter().any(|p| name.starts_with(p));
    let any = |list: &[&str]| list.contains(&name);
    if name.starts_with("glX") || name.starts_with("egl") {
        return PURE;
    }
    // What cannot write buffers, for calls that are not in any list.
    const OTHERWISE: u32 = 0xff & !BUFFER;
    if any(&["glPopAttrib", "glPopClientAttrib"]) {
        return OTHERWISE;
    }
    if starts(&[
        "glGet",
        "glIs",
        "glGen",
        "glAreTextures",
        "glFence",
        "glObjectLabel",
        "glPushAttrib",
    ]) || starts(&[
        "glHint",
        "glPixelStore",
        "glDebug",
        "glPushDebug",
        "glPopDebug",
        "glRasterPos",
        "glWindowPos",
    ]) || starts(&[
        "glInitNames",
        "glPushName",
        "glPopName",
        "glLoadName",
        "glSelectBuffer",
        "glFeedbackBuffer",
    ]) || starts(&["glClearColor", "glClearDepth", "glClearStencil", "glBitmap", "glLineWidth"])
        || starts(&[
            "glPointSize",
            "glPixelZoom",
            "glPixelTransfer",
            "glPixelMap",
            "glFlush",
            "glFinish",
        ])
    {
        return PURE;
    }
    if any(&["glMatrixMode", "glOrtho", "glFrustum"])
        || starts(&[
            "glLoadMatrix",
            "glMultMatrix",
            "glLoadIdentity",
            "glPushMatrix",
            "glPopMatrix",
            "glRotate",
        ])
        || starts(&["glTranslate", "glScale", "glLoadTranspose", "glMultTranspose"])
            && !name.starts_with("glScissor")
    {
        return 1;
    }
    if starts(&["glLight", "glColorMaterial"]) {
        return 2;
    }
    // Binding changes no texture; what is bound is asked for with the rest.
    if starts(&[
        "glBindTexture",
        "glActiveTexture",
        "glClientActiveTexture",
        "glTexEnv",
        "glTexGen",
    ]) {
        return 2;
    }
    if starts(&[
        "glTexParameter",
        "glTexEnv",
        "glTexGen",
        "glTexImage",
        "glTexSubImage",
        "glCopyTex",
        "glBindTexture",
    ]) || starts(&[
        "glActiveTexture",
        "glDeleteTextures",
        "glCompressedTex",
        "glTexStorage",
        "glGenerateMipmap",
    ]) || starts(&[
        "glTexBuffer",
        "glBindSampler",
        "glSamplerParameter",
        "glPrioritizeTextures",
        "glClientActiveTexture",
    ]) {
        return TEXTURE;
    }
    if starts(&["glUniform", "glProgramUniform", "glBindAttribLocation", "glBindFragDataLocation"])
    {
        return 64;
    }
    if starts(&[
        "glVertexPointer",
        "glNormalPointer",
        "glColorPointer",
        "glTexCoordPointer",
        "glVertexAttrib",
    ]) || starts(&[
        "glBindBuffer",
        "glEnableVertexAttrib",
        "glDisableVertexAttrib",
        "glEnableClientState",
    ]) || starts(&[
        "glDisableClientState",
        "glBindVertexArray",
        "glInterleavedArrays",
        "glEdgeFlagPointer",
    ]) || starts(&[
        "glIndexPointer",
        "glFogCoordPointer",
        "glSecondaryColorPointer",
        "glDeleteVertexArrays",
    ]) || starts(&["glBindVertexBuffer", "glLockArrays", "glUnlockArrays"])
    {
        return 128;
    }
    if leaves_textures(name) { OTHERWISE & !TEXTURE } else { OTHERWISE }
}

/// The class of calls that write buffers.
const BUFFER: u32 = 32;
/// The class of calls that may change textures: we are always told of them, because images are not
/// read again as long as there was none.
const TEXTURE: u32 = 8;

/// Calls that change much, but no texel and no parameter of a texture. What is drawn into a texture
/// counts when the framebuffer is bound or given up.
fn leaves_textures(name: &str) -> bool {
    const BEGINNINGS: &[&str] = &[
        "glEnable",
        "glDisable",
        "glViewport",
        "glScissor",
        "glDepth",
        "glBlend",
        "glStencil",
        "glLineStipple",
        "glColorMask",
        "glClipPlane",
        "glClipControl",
        "glClampColor",
        "glCullFace",
        "glFrontFace",
        "glPolygon",
        "glShadeModel",
        "glAlphaFunc",
        "glFog",
        "glLogicOp",
        "glSampleCoverage",
        "glSampleMask",
        "glProvokingVertex",
        "glPrimitiveRestart",
        "glReadBuffer",
        "glReadPixels",
        "glReadnPixels",
        "glListBase",
        "glUseProgram",
        "glCreateShader",
        "glCreateProgram",
        "glShaderSource",
        "glCompileShader",
        "glAttachShader",
        "glDetachShader",
        "glLinkProgram",
        "glValidateProgram",
        "glDeleteShader",
        "glDeleteProgram",
        "glBeginQuery",
        "glEndQuery",
    ];
    // What comes with each vertex is called most of all.
    const OF_VERTICES: &[&str] = &[
        "glVertex",
        "glColor3",
        "glColor4",
        "glColorP",
        "glNormal",
        "glTexCoord",
        "glMultiTexCoord",
        "glSecondaryColor",
        "glFogCoord",
        "glIndex",
        "glEdgeFlag",
        "glMaterial",
        "glTangent",
        "glBinormal",
        "glWeight",
        "glVariant",
        "glRect",
        "glLight",
        "glLine",
        "glPointSize",
        "glPointParameter",
        "glPatchParameter",
        "glProgramEnvParameter",
        "glProgramLocalParameter",
        "glProgramParameter",
        "glProgramNamedParameter",
        "glPassThrough",
        "glQueryCounter",
        "glUseProgramObject",
        "glInsertEventMarker",
        "glStringMarker",
    ];
    // Draws of the driver's, too.
    is_other_draw(name) || BEGINNINGS.iter().chain(OF_VERTICES).any(|b| name.starts_with(b))
}

/// Calls that write buffers: we are always told of them, because geometry in buffers is not read
/// again as long as nobody writes.
fn writes_buffers(name: &str) -> bool {
    const WRITES: &[&str] = &[
        "glBufferData",
        "glBufferSubData",
        "glBufferStorage",
        "glBufferPage",
        "glBufferAttach",
        "glMapBuffer",
        "glUnmap",
        "glFlushMapped",
        "glCopyBuffer",
        "glCopyNamedBuffer",
        "glNamedBuffer",
        "glClearBufferData",
        "glClearBufferSubData",
        "glClearNamedBufferData",
        "glClearNamedBufferSubData",
        "glDeleteBuffers",
        "glMapNamed",
        "glMapObjectBuffer",
        "glUpdateObjectBuffer",
        "glEndTransformFeedback",
        "glDispatchCompute",
        "glInvalidateBuffer",
        "glMemoryBarrier",
        "glMulticastBuffer",
        "glMulticastCopyBuffer",
    ];
    WRITES.iter().any(|w| name.starts_with(w))
}

/// Calls before which what was traced has to be in the framebuffer.
fn flushes(name: &str) -> bool {
    const NAMES: &[&str] = &[
        "glXSwapBuffers",
        "glXCopyContext",
        "glXWaitGL",
        "glXSwapBuffersMscOML",
        "eglCopyBuffers",
        "eglWaitGL",
        "eglWaitClient",
        "glReadPixels",
        "glReadnPixels",
        "glReadnPixelsARB",
        "glCopyPixels",
        "glCopyTexImage1D",
        "glCopyTexImage2D",
        "glCopyTexSubImage1D",
        "glCopyTexSubImage2D",
        "glCopyTexSubImage3D",
        "glBlitFramebuffer",
        "glBlitNamedFramebuffer",
        "glBlitFramebufferEXT",
        "glBindFramebuffer",
        "glBindFramebufferEXT",
        "glFramebufferTexture2D",
        "glFramebufferTexture2DEXT",
        "glFramebufferTexture",
        "glFramebufferRenderbuffer",
        "glFramebufferRenderbufferEXT",
        "glDeleteFramebuffers",
        "glDeleteFramebuffersEXT",
        "glAccum",
        "glDrawPixels",
        "glDrawBuffer",
        "glDrawBuffers",
        "glDrawBuffersARB",
        "glBeginQuery",
        "glEndQuery",
        "glBeginQueryARB",
        "glEndQueryARB",
        "glRenderMode",
        "glFlush",
        "glFinish",
        "glClearBufferfv",
        "glClearBufferiv",
        "glClearBufferuiv",
        "glClearBufferfi",
        "glGetTexImage",
        "glXBindTexImageEXT",
        "glBitmap",
        "glXMakeAssociatedContextCurrentAMD",
        "glCopyImageSubData",
        "glBeginConditionalRender",
        "glEndConditionalRender",
        "glDeleteTextures",
        "glDeleteRenderbuffers",
    ];
    NAMES.contains(&name) || name.starts_with("eglSwapBuffers") || is_other_draw(name)
}

/// Calls by which a program, or the driver for it, may look at what was drawn.
fn reads_pixels(name: &str) -> bool {
    ["Read", "Copy", "Blit", "GetTex", "Accum", "Query"].iter().any(|part| name.contains(part))
}

/// Draws that we do not take apart: the driver draws them over what was traced before.
fn is_other_draw(name: &str) -> bool {
    name.starts_with("glMultiDraw")
        || name.contains("Indirect") && name.starts_with("glDraw")
        || name.starts_with("glDrawTransformFeedback")
        || name.starts_with("glDrawTex")
        || (name.starts_with("glDraw") && name.contains("Instanced"))
        || name.starts_with("glDrawMesh")
}

struct Hot {
    name: String,
    c_type: &'static str,
    count: usize,
    pointer: bool,
    body: String,
}

/// The calls of immediate mode that set an attribute or give a vertex.
fn hot_calls() -> Vec<Hot> {
    let mut out = Vec::new();
    let plain = |e: &str| format!("({e}) as f32");
    let signed = |bits: u32| {
        let most = (1_u64 << bits) - 1;
        move |e: &str| format!("(2.0 * (({e}) as f32) + 1.0) * (1.0 / {most}_f32)")
    };
    let unsigned = |bits: u32| {
        let most = (1_u64 << bits) - 1;
        move |e: &str| format!("(({e}) as f32) / {most}_f32")
    };
    let mut add = |family: &str,
                   method: &str,
                   counts: &[usize],
                   letter: &str,
                   c_type: &'static str,
                   conv: &dyn Fn(&str) -> String,
                   fill: [&str; 4],
                   size: usize| {
        for &count in counts {
            for pointer in [false, true] {
                let name = format!("gl{family}{count}{letter}{}", if pointer { "v" } else { "" });
                let values: Vec<String> = (0..size)
                    .map(|i| match (i < count, pointer) {
                        (false, _) => fill[i].to_owned(),
                        (true, true) => conv(&format!("v[{i}]")),
                        (true, false) => conv(&format!("a{i}")),
                    })
                    .collect();
                let body = format!("c.{method}([{}])", values.join(", "));
                out.push(Hot { name, c_type, count, pointer, body });
            }
        }
    };
    let zero_one = ["0.0", "0.0", "0.0", "1.0"];
    for (letter, t) in [("d", "f64"), ("f", "f32"), ("i", "i32"), ("s", "i16")] {
        add("Vertex", "vertex", &[2, 3, 4], letter, t, &plain, zero_one, 4);
        add("TexCoord", "tex_coord", &[1, 2, 3, 4], letter, t, &plain, zero_one, 4);
    }
    for (letter, t) in [("d", "f64"), ("f", "f32")] {
        add("Normal", "normal", &[3], letter, t, &plain, zero_one, 3);
        add("Color", "color", &[3, 4], letter, t, &plain, zero_one, 4);
    }
    for (letter, t, bits) in [("b", "i8", 8), ("s", "i16", 16), ("i", "i32", 32)] {
        add("Normal", "normal", &[3], letter, t, &signed(bits), zero_one, 3);
        add("Color", "color", &[3, 4], letter, t, &signed(bits), zero_one, 4);
    }
    for (letter, t, bits) in [("ub", "u8", 8), ("us", "u16", 16), ("ui", "u32", 32)] {
        add("Color", "color", &[3, 4], letter, t, &unsigned(bits), zero_one, 4);
    }
    out
}

/// Hooks written by hand in `src/interpose/symbols/hooks.rs`.
fn hand_written() -> Vec<String> {
    let text = std::fs::read_to_string("src/interpose/symbols/hooks.rs")
        .expect("src/interpose/symbols/hooks.rs can be read");
    let named = |n: &&str| n.starts_with("gl") || n.starts_with("egl");
    let functions = text.lines().filter_map(|l| {
        let l = l.trim_start();
        let l =
            l.strip_prefix("pub(in crate::interpose::symbols) unsafe extern \"C\" ").unwrap_or(l);
        l.strip_prefix("fn ")?.split('(').next()
    });
    let addresses = text
        .lines()
        .filter_map(|l| l.strip_prefix("get_proc_address! {"))
        .flat_map(str::split_whitespace);
    functions.chain(addresses).filter(named).map(str::to_owned).collect()
}

/// The tables of `calls`.
fn table_of_calls(names: &[&str], hooked: impl Fn(&str) -> bool) -> String {
    let mut s = String::new();
    let n = names.len();
    writeln!(s, "/// The number of calls.\npub(crate) const COUNT: usize = {n};").unwrap();
    writeln!(s, "/// Their names, sorted.\npub(crate) static NAMES: [&CStr; COUNT] = [").unwrap();
    names.iter().for_each(|x| writeln!(s, "c\"{x}\",").unwrap());
    writeln!(s, "];\nstatic CLASSES: [u8; COUNT] = [").unwrap();
    names.iter().for_each(|x| write!(s, "{},", class(x)).unwrap());
    let mut table = |name: &str, holds: &dyn Fn(&str) -> bool| {
        writeln!(s, "];\nstatic {name}: [bool; COUNT] = [").unwrap();
        names.iter().for_each(|x| write!(s, "{},", holds(x)).unwrap());
    };
    table("FLUSHES", &flushes);
    table("OTHER_DRAWS", &is_other_draw);
    table("READS_PIXELS", &reads_pixels);
    table("HOOKED", &hooked);
    writeln!(
        s,
        "];\n/// The number of each call.\n#[allow(dead_code, non_upper_case_globals, reason = \
         \"a table of OpenGL's names\")]\npub(crate) mod at {{"
    )
    .unwrap();
    for (i, x) in names.iter().enumerate() {
        writeln!(s, "pub(crate) const {x}: usize = {i};").unwrap();
    }
    s + "}\n"
}

/// The macro by which the package `gluray-interposer` writes one trampoline per entry point: its
/// kind, which says how the trampoline reaches its target, its number and its name.
fn list_of_entry_points(names: &[&str], hooked: impl Fn(&str) -> bool) -> String {
    let mut s = String::from(
        "/// Calls the macro that it is given with the kind, the number and the name of every entry\n\
         /// point.\n#[doc(hidden)]\n#[macro_export]\nmacro_rules! entry_points {\n\
         ($with:ident) => { $with! {\n",
    );
    for (i, x) in names.iter().enumerate() {
        let kind = match (hooked(x), flushes(x) || class(x) & (BUFFER | TEXTURE) != 0) {
            // Our own hooks look after themselves.
            (true, _) => "direct",
            // We are always told first.
            (_, true) => "always",
            // We are told first while `ARMED` is set.
            _ => "watched",
        };
        writeln!(s, "{kind} {i} {x};").unwrap();
    }
    s + "} };\n}\n"
}

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=src/interpose/symbols/names.txt");
    println!("cargo:rerun-if-changed=src/interpose/symbols/hooks.rs");
    let text = std::fs::read_to_string("src/interpose/symbols/names.txt")
        .expect("src/interpose/symbols/names.txt can be read");
    let names: Vec<&str> = text.split_whitespace().collect();
    assert!(
        names.windows(2).all(|w| w[0] < w[1]),
        "names.txt must be sorted, each name once: `LC_ALL=C sort -u`"
    );
    let hot = hot_calls();
    let by_hand = hand_written();
    let hooked = |n: &str| by_hand.iter().any(|h| h == n) || hot.iter().any(|h| h.name == n);
    for h in by_hand.iter().chain(hot.iter().map(|h| &h.name)) {
        assert!(names.contains(&h.as_str()), "hook {h} is not in names.txt");
    }
    let out = std::env::var("OUT_DIR").expect("cargo sets OUT_DIR");
    let write = |file: &str, text: String| {
        std::fs::write(Path::new(&out).join(file), text).expect("OUT_DIR can be written");
    };
    write("calls.rs", table_of_calls(&names, hooked));
    write("entry_points.rs", list_of_entry_points(&names, hooked));
    let mut s = String::new();
    writeln!(s, "static HOOKS: [Option<Target>; COUNT] = [").unwrap();
    for x in &names {
        match hooked(x) {
            true if by_hand.iter().any(|h| h == x) => {
                writeln!(s, "Some(Target(hooks::{x} as *const ())),").unwrap()
            }
            true => writeln!(s, "Some(Target(hot_hooks::{x} as *const ())),").unwrap(),
            false => write!(s, "None,").unwrap(),
        }
    }
    writeln!(
        s,
        "];\n#[allow(clippy::unnecessary_cast, reason = \"written by a program\")] mod \
                 hot_hooks {{ use super::current_context; use \
                 crate::capture::immediate_mode::FastPathResult; use \
                 crate::driver::found; use super::forward_plainly;"
    )
    .unwrap();
    for h in &hot {
        let (args, call, types) = if h.pointer {
            (format!("p: *const {}", h.c_type), "p".to_owned(), format!("*const {}", h.c_type))
        } else {
            let each =
                |f: &dyn Fn(usize) -> String| (0..h.count).map(f).collect::<Vec<_>>().join(", ");
            (
                each(&|i| format!("a{i}: {}", h.c_type)),
                each(&|i| format!("a{i}")),
                each(&|_| h.c_type.to_owned()),
            )
        };
        let index = names.binary_search(&h.name.as_str()).expect("checked above");
        let read = if h.pointer {
            format!(
                "\n// SAFETY: the program gives {} values, as OpenGL asks.\n let v = unsafe {{ \
                 *p.cast::<[{}; {}]>() }};",
                h.count, h.c_type, h.count
            )
        } else {
            String::new()
        };
        let (name, body) = (&h.name, &h.body);
        let step = body.replacen('(', "_fast(", 1);
        // SAFETY comments are those of the code that is written.
        writeln!(
            s,
            "#[cold] #[inline(never)] unsafe extern \"C\" fn {name}_slow({args}) {{ {read} if \
             !current_context::with({index}, |c| {body}) {{
                // SAFETY: the driver's function of this name and signature.
                let f: unsafe extern \"C\" fn({types}) = unsafe {{ \
                core::mem::transmute(forward_plainly({index})) }};
                // SAFETY: the program's own arguments.
                unsafe {{ f({call}) }} }} }}
            pub(in crate::interpose::symbols) unsafe extern \"C\" fn {name}({args}) {{ {read} \
            match current_context::fast_call({index}, |c| {step}) {{
                FastPathResult::Done => (),
                FastPathResult::Driver => match found({index}) {{
                    Some(known) => {{
                        // SAFETY: as above.
                        let f: unsafe extern \"C\" fn({types}) = unsafe {{ \
                        core::mem::transmute(known) }};
                        // SAFETY: as above.
                        unsafe {{ f({call}) }} }}
                    // SAFETY: as above.
                    None => unsafe {{ {name}_slow({call}) }} }},
                // SAFETY: as above.
                _ => unsafe {{ {name}_slow({call}) }} }} }}"
        )
        .unwrap();
    }
    writeln!(s, "}}").unwrap();
    write("hooks.rs", s);
}
