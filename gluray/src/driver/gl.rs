//! The driver's functions that we call, with slices in place of pointers.
//!
//! Like all of OpenGL, they act on the context that is current on the thread.

use super::driver;
use crate::enums::*;
use core::ffi::{c_char, c_void};
use std::sync::atomic::{AtomicPtr, AtomicU32, Ordering::Relaxed};

driver! {
    pub(crate) fn begin = "glBegin"(mode: u32);
    pub(crate) fn end = "glEnd"();
    pub(crate) fn color4f = "glColor4f"(r: f32, g: f32, b: f32, a: f32);
    pub(crate) fn normal3f = "glNormal3f"(x: f32, y: f32, z: f32);
    pub(crate) fn tex_coord4f = "glTexCoord4f"(s: f32, t: f32, r: f32, q: f32);
    pub(crate) fn vertex4f = "glVertex4f"(x: f32, y: f32, z: f32, w: f32);
    pub(crate) fn eval_coord1f = "glEvalCoord1f"(u: f32);
    pub(crate) fn eval_coord2f = "glEvalCoord2f"(u: f32, v: f32);
    pub(crate) fn eval_point1 = "glEvalPoint1"(i: i32);
    pub(crate) fn eval_point2 = "glEvalPoint2"(i: i32, j: i32);
    pub(crate) fn eval_mesh2 = "glEvalMesh2"(mode: u32, i1: i32, i2: i32, j1: i32, j2: i32);
    fn get_map_f = "glGetMapfv"(target: u32, what: u32, out: *mut f32);
    fn get_map_i = "glGetMapiv"(target: u32, what: u32, out: *mut i32);
    pub(crate) fn rectf = "glRectf"(x: f32, y: f32, x2: f32, y2: f32);
    pub(crate) fn enable = "glEnable"(cap: u32);
    pub(crate) fn disable = "glDisable"(cap: u32);
    fn is_enabled_raw = "glIsEnabled"(cap: u32) -> u8;
    pub(crate) fn get_error = "glGetError"() -> u32;
    fn get_floatv = "glGetFloatv"(what: u32, out: *mut f32);
    fn get_doublev = "glGetDoublev"(what: u32, out: *mut f64);
    fn get_integerv = "glGetIntegerv"(what: u32, out: *mut i32);
    fn get_pointerv = "glGetPointerv"(what: u32, out: *mut *mut c_void);
    fn get_string = "glGetString"(what: u32) -> *const c_char;
    fn get_light = "glGetLightfv"(light: u32, what: u32, out: *mut f32);
    fn get_material = "glGetMaterialfv"(face: u32, what: u32, out: *mut f32);
    fn get_tex_env_i = "glGetTexEnviv"(target: u32, what: u32, out: *mut i32);
    fn get_tex_env_f = "glGetTexEnvfv"(target: u32, what: u32, out: *mut f32);
    fn get_tex_gen_i = "glGetTexGeniv"(coord: u32, what: u32, out: *mut i32);
    fn get_tex_gen_f = "glGetTexGenfv"(coord: u32, what: u32, out: *mut f32);
    fn get_clip_plane = "glGetClipPlane"(plane: u32, out: *mut f64);
    fn get_tex_level_i = "glGetTexLevelParameteriv"(target: u32, level: i32, what: u32, out: *mut i32);
    fn get_tex_parameter_i = "glGetTexParameteriv"(target: u32, what: u32, out: *mut i32);
    fn get_tex_parameter_f = "glGetTexParameterfv"(target: u32, what: u32, out: *mut f32);
    fn get_attachment_i = "glGetFramebufferAttachmentParameteriv"(target: u32, attachment: u32, what: u32, out: *mut i32);
    fn get_tex_image = "glGetTexImage"(target: u32, level: i32, format: u32, kind: u32, out: *mut c_void);
    fn read_pixels = "glReadPixels"(x: i32, y: i32, w: i32, h: i32, format: u32, kind: u32, out: *mut c_void);
    fn materialfv_raw = "glMaterialfv"(face: u32, what: u32, values: *const f32);
    pub(crate) fn new_list = "glNewList"(list: u32, mode: u32);
    pub(crate) fn end_list = "glEndList"();
    pub(crate) fn call_list = "glCallList"(list: u32);
    pub(crate) fn delete_lists = "glDeleteLists"(list: u32, range: i32);
    pub(crate) fn push_attrib = "glPushAttrib"(mask: u32);
    pub(crate) fn pop_attrib = "glPopAttrib"();
    pub(crate) fn viewport = "glViewport"(x: i32, y: i32, w: i32, h: i32);
    pub(crate) fn polygon_offset = "glPolygonOffset"(factor: f32, units: f32);
    pub(crate) fn depth_func = "glDepthFunc"(func: u32);
    pub(crate) fn depth_mask = "glDepthMask"(on: u8);
    pub(crate) fn depth_range = "glDepthRange"(near: f64, far: f64);
    pub(crate) fn polygon_mode = "glPolygonMode"(face: u32, mode: u32);
    pub(crate) fn color_mask = "glColorMask"(r: u8, g: u8, b: u8, a: u8);
    pub(crate) fn blend_func = "glBlendFunc"(src: u32, dst: u32);
    pub(crate) fn blend_equation = "glBlendEquation"(equation: u32);
    pub(crate) fn blend_func_separate = "glBlendFuncSeparate"(src: u32, dst: u32, src_alpha: u32, dst_alpha: u32);
    pub(crate) fn blend_equation_separate = "glBlendEquationSeparate"(color: u32, alpha: u32);
    pub(crate) fn active_texture = "glActiveTexture"(unit: u32);
    pub(crate) fn bind_texture = "glBindTexture"(target: u32, name: u32);
    pub(crate) fn tex_parameteri = "glTexParameteri"(target: u32, what: u32, value: i32);
    pub(crate) fn pixel_storei = "glPixelStorei"(what: u32, value: i32);
    fn sample_maski = "glSampleMaski"(word: u32, mask: u32);
    fn get_multisample = "glGetMultisamplefv"(what: u32, index: u32, out: *mut f32);
    fn get_integeri = "glGetIntegeri_v"(what: u32, index: u32, out: *mut i32);
    fn pixel_transferf = "glPixelTransferf"(what: u32, value: f32);
    pub(crate) fn bind_sampler = "glBindSampler"(unit: u32, name: u32);
    fn draw_buffers_raw = "glDrawBuffers"(n: i32, buffers: *const u32);
    fn gen_textures = "glGenTextures"(n: i32, out: *mut u32);
    fn tex_image_2d = "glTexImage2D"(target: u32, level: i32, inner: i32, w: i32, h: i32, border: i32, format: u32, kind: u32, data: *const c_void);
    fn tex_sub_image_2d = "glTexSubImage2D"(target: u32, level: i32, x: i32, y: i32, w: i32, h: i32, format: u32, kind: u32, data: *const c_void);
    pub(crate) fn create_shader = "glCreateShader"(kind: u32) -> u32;
    fn shader_source_raw = "glShaderSource"(shader: u32, n: i32, text: *const *const c_char, lengths: *const i32);
    pub(crate) fn compile_shader = "glCompileShader"(shader: u32);
    pub(crate) fn create_program = "glCreateProgram"() -> u32;
    pub(crate) fn attach_shader = "glAttachShader"(program: u32, shader: u32);
    pub(crate) fn link_program = "glLinkProgram"(program: u32);
    pub(crate) fn use_program = "glUseProgram"(program: u32);
    pub(crate) fn delete_shader = "glDeleteShader"(shader: u32);
    pub(crate) fn delete_program = "glDeleteProgram"(program: u32);
    fn get_shader_info_log = "glGetShaderInfoLog"(shader: u32, room: i32, length: *mut i32, out: *mut c_char);
    fn get_programiv = "glGetProgramiv"(program: u32, what: u32, out: *mut i32);
    fn get_shaderiv = "glGetShaderiv"(shader: u32, what: u32, out: *mut i32);
    fn get_shader_source_raw = "glGetShaderSource"(shader: u32, room: i32, length: *mut i32, out: *mut c_char);
    fn get_attached_raw = "glGetAttachedShaders"(program: u32, room: i32, count: *mut i32, out: *mut u32);
    fn get_uniform_location_raw = "glGetUniformLocation"(program: u32, name: *const c_char) -> i32;
    fn get_attrib_location_raw = "glGetAttribLocation"(program: u32, name: *const c_char) -> i32;
    fn get_uniformfv = "glGetUniformfv"(program: u32, at: i32, out: *mut f32);
    fn get_uniformiv = "glGetUniformiv"(program: u32, at: i32, out: *mut i32);
    pub(crate) fn uniform1i = "glUniform1i"(at: i32, v: i32);
    pub(crate) fn uniform4f = "glUniform4f"(at: i32, x: f32, y: f32, z: f32, w: f32);
    fn get_vertex_attrib_i = "glGetVertexAttribiv"(at: u32, what: u32, out: *mut i32);
    fn get_vertex_attrib_pointer = "glGetVertexAttribPointerv"(at: u32, what: u32, out: *mut *mut c_void);
    pub(crate) fn bind_buffer = "glBindBuffer"(target: u32, name: u32);
    fn get_buffer_sub_data = "glGetBufferSubData"(target: u32, at: isize, bytes: isize, out: *mut c_void);
    fn get_buffer_parameter_i = "glGetBufferParameteriv"(target: u32, what: u32, out: *mut i32);
    fn gen_vertex_arrays = "glGenVertexArrays"(n: i32, out: *mut u32);
    pub(crate) fn bind_vertex_array = "glBindVertexArray"(name: u32);
    pub(crate) fn draw_arrays = "glDrawArrays"(mode: u32, first: i32, count: i32);
}

/// Whether capability `cap` is on.
pub(crate) fn is_enabled(cap: u32) -> bool {
    is_enabled_raw(cap) != 0
}

// More values than any query returns, except for those of lists without a standard limit, which are
// never queried.
const ROOM: usize = 32;

/// True when the answer may be longer than [`ROOM`]: formats of compressed textures, program
/// binaries and shader binaries.
fn is_of_a_list(what: u32) -> bool {
    matches!(what, COMPRESSED_TEXTURE_FORMATS | PROGRAM_BINARY_FORMATS | SHADER_BINARY_FORMATS)
}

/// `N` floats of state (at most 16).
pub(crate) fn floats<const N: usize>(what: u32) -> [f32; N] {
    let mut out = [0.0; ROOM];
    if !is_of_a_list(what) {
        get_floatv(what, out.as_mut_ptr());
    }
    std::array::from_fn(|i| out[i])
}

/// `N` doubles of state.
pub(crate) fn doubles<const N: usize>(what: u32) -> [f64; N] {
    let mut out = [0.0; ROOM];
    if !is_of_a_list(what) {
        get_doublev(what, out.as_mut_ptr());
    }
    std::array::from_fn(|i| out[i])
}

/// `N` integers of state.
pub(crate) fn ints<const N: usize>(what: u32) -> [i32; N] {
    let mut out = [0; ROOM];
    if !is_of_a_list(what) {
        get_integerv(what, out.as_mut_ptr());
    }
    std::array::from_fn(|i| out[i])
}

/// One integer of state.
pub(crate) fn int(what: u32) -> i32 {
    ints::<1>(what)[0]
}

/// One integer of state as a GL enum or name.
pub(crate) fn word(what: u32) -> u32 {
    int(what).cast_unsigned()
}

/// An address that is kept as state.
pub(crate) fn pointer(what: u32) -> usize {
    let mut out = core::ptr::null_mut();
    get_pointerv(what, &raw mut out);
    out as usize
}

/// A string of the driver; empty without a context.
pub(crate) fn string(what: u32) -> String {
    let p = get_string(what);
    if p.is_null() {
        return String::new();
    }
    // SAFETY: the driver's own string, which lives as long as the driver.
    unsafe { core::ffi::CStr::from_ptr(p) }.to_string_lossy().into_owned()
}

macro_rules! queries {
    ($($name:ident($($a:ident: $t:ty),*) -> $v:ty = $raw:ident;)*) => { $(
        /// Values of one query.
        pub(crate) fn $name<const N: usize>($($a: $t),*) -> [$v; N] {
            let mut out = [<$v>::default(); ROOM];
            $raw($($a,)* out.as_mut_ptr());
            std::array::from_fn(|i| out[i])
        }
    )* };
}
queries! {
    light(light: u32, what: u32) -> f32 = get_light;
    material(face: u32, what: u32) -> f32 = get_material;
    tex_env_i(target: u32, what: u32) -> i32 = get_tex_env_i;
    tex_env_f(target: u32, what: u32) -> f32 = get_tex_env_f;
    tex_gen_i(coord: u32, what: u32) -> i32 = get_tex_gen_i;
    tex_gen_f(coord: u32, what: u32) -> f32 = get_tex_gen_f;
    clip_plane(plane: u32) -> f64 = get_clip_plane;
    tex_level_i(target: u32, level: i32, what: u32) -> i32 = get_tex_level_i;
    attachment_i(target: u32, attachment: u32, what: u32) -> i32 = get_attachment_i;
    tex_parameter_i(target: u32, what: u32) -> i32 = get_tex_parameter_i;
    tex_parameter_f(target: u32, what: u32) -> f32 = get_tex_parameter_f;
    program_i(program: u32, what: u32) -> i32 = get_programiv;
    shader_i(shader: u32, what: u32) -> i32 = get_shaderiv;
    vertex_attrib_i(at: u32, what: u32) -> i32 = get_vertex_attrib_i;
    buffer_i(target: u32, what: u32) -> i32 = get_buffer_parameter_i;
    uniform_f(program: u32, at: i32) -> f32 = get_uniformfv;
    uniform_i(program: u32, at: i32) -> i32 = get_uniformiv;
}

/// The domain of an evaluator's map: two numbers of a curve, four of a surface.
pub(crate) fn map_domain(target: u32) -> [f32; 4] {
    let mut out = [0.0; ROOM];
    get_map_f(target, MAP_DOMAIN, out.as_mut_ptr());
    [out[0], out[1], out[2], out[3]]
}

/// The orders of an evaluator's map: one number of a curve, two of a surface.
fn map_orders(target: u32) -> [i32; 2] {
    let mut out = [0; ROOM];
    get_map_i(target, MAP_ORDER, out.as_mut_ptr());
    [out[0], out[1]]
}

/// The orders of an evaluator's map in both parameters, and its control points with `size` values
/// each. A curve's second order is 1.
pub(crate) fn map_points(target: u32, size: usize, surface: bool) -> ([usize; 2], Vec<f32>) {
    // No map has more values per point.
    const MOST: usize = 4;
    let [u, v] = map_orders(target).map(|n| n.max(1) as usize);
    let orders = [u, if surface { v } else { 1 }];
    let points = orders[0] * orders[1];
    let mut out = vec![0.0; points * MOST];
    get_map_f(target, MAP_POINTS, out.as_mut_ptr());
    out.truncate(points * size);
    (orders, out)
}

/// The component type of the colour buffer that `attachment` names in the current framebuffer
/// object; 0 when it is unknown.
pub(crate) fn component_type(attachment: u32) -> u32 {
    attachment_i::<1>(DRAW_FRAMEBUFFER, attachment, ATTACHMENT_COMPONENT_TYPE)[0].cast_unsigned()
}

/// `glMaterialfv`.
pub(crate) fn materialfv(face: u32, what: u32, values: &[f32; 4]) {
    materialfv_raw(face, what, values.as_ptr());
}

/// Address or offset of a generic attribute's array.
pub(crate) fn vertex_attrib_address(at: u32) -> usize {
    let mut out = core::ptr::null_mut();
    get_vertex_attrib_pointer(at, VERTEX_ATTRIB_ARRAY_POINTER, &raw mut out);
    out as usize
}

/// A new texture. Where programs may choose names themselves, as many do, we use a name that
/// programs do not choose: a generated name could be a program's next one.
pub(crate) fn gen_texture(core: bool) -> u32 {
    static NAMES: AtomicU32 = AtomicU32::new(0x6c75_7261);
    if !core {
        return NAMES.fetch_add(1, Relaxed);
    }
    let mut out = 0;
    gen_textures(1, &raw mut out);
    out
}

/// A new vertex array object; 0 where there are none.
pub(crate) fn gen_vertex_array() -> u32 {
    let mut out = 0;
    gen_vertex_arrays(1, &raw mut out);
    out
}

/// Sets the size of the bound 2-D texture. The texels are undefined.
pub(crate) fn tex_image(inner: i32, w: i32, h: i32, format: u32, kind: u32) {
    tex_image_2d(TEXTURE_2D, 0, inner, w, h, 0, format, kind, core::ptr::null());
}

/// Fills the corner of the bound 2-D texture. Panics when `data` is too short for `w` x `h` texels,
/// or of an unknown kind.
pub(crate) fn tex_sub_image(w: i32, h: i32, format: u32, kind: u32, data: &[u8]) {
    let bytes = match (format, kind) {
        (RGBA, UNSIGNED_BYTE) | (RED, FLOAT) => 4,
        (RGBA, FLOAT) => 16,
        _ => panic!("texels of format {format:#x} and type {kind:#x}"),
    };
    let (w, h) = (w.max(0), h.max(0));
    assert!(data.len() as i64 >= i64::from(w) * i64::from(h) * bytes, "too few texels");
    // The rows of `data` follow one another and lie in our memory, whatever the program has set.
    const UNPACK: [(u32, i32); 4] = [
        (UNPACK_ALIGNMENT, 1),
        (UNPACK_ROW_LENGTH, 0),
        (UNPACK_SKIP_ROWS, 0),
        (UNPACK_SKIP_PIXELS, 0),
    ];
    let before = UNPACK.map(|(what, _)| int(what));
    UNPACK
        .into_iter()
        .zip(before)
        .filter(|(u, b)| u.1 != *b)
        .for_each(|(u, _)| pixel_storei(u.0, u.1));
    let buffer = word(PIXEL_UNPACK_BUFFER_BINDING);
    if buffer != 0 {
        bind_buffer(PIXEL_UNPACK_BUFFER, 0);
    }
    tex_sub_image_2d(TEXTURE_2D, 0, 0, 0, w, h, format, kind, data.as_ptr().cast());
    if buffer != 0 {
        bind_buffer(PIXEL_UNPACK_BUFFER, buffer);
    }
    UNPACK
        .into_iter()
        .zip(before)
        .filter(|(u, b)| u.1 != *b)
        .for_each(|(u, b)| pixel_storei(u.0, b));
}

/// Proof that texels are read without conversion. Only [`with_raw_pixel_reads`] makes it, for the
/// time of its call.
pub(crate) struct RawPixelTransfer(());

/// The number of texels of a level of the bound 1-D or 2-D texture that the driver will write.
/// `None` for other targets and from 2^26 texels on.
fn texels_of(target: u32, level: i32) -> Option<usize> {
    if !matches!(target, TEXTURE_1D | TEXTURE_2D) {
        return None;
    }
    let size = |what| usize::try_from(tex_level_i::<1>(target, level, what)[0]).ok();
    let texels = size(TEXTURE_WIDTH)?.checked_mul(size(TEXTURE_HEIGHT)?)?;
    // The border of texels, which levels of old programs may have, is counted in both.
    (texels <= 1 << 26).then_some(texels)
}

/// A level of the bound texture as RGBA floats. Empty when it cannot be read.
pub(crate) fn tex_image_rgba(_: &RawPixelTransfer, target: u32, level: i32) -> Vec<[f32; 4]> {
    let Some(texels) = texels_of(target, level) else { return Vec::new() };
    let mut out = vec![[0.0_f32; 4]; texels];
    get_tex_image(target, level, RGBA, FLOAT, out.as_mut_ptr().cast());
    out
}

/// The same as bytes, in reused memory.
pub(crate) fn tex_image_bytes(
    _: &RawPixelTransfer,
    target: u32,
    level: i32,
    mut memory: Vec<[u8; 4]>,
) -> Vec<[u8; 4]> {
    memory.resize(texels_of(target, level).unwrap_or(0), [0; 4]);
    if !memory.is_empty() {
        get_tex_image(target, level, RGBA, UNSIGNED_BYTE, memory.as_mut_ptr().cast());
    }
    memory
}

/// The position of sample `i` of the framebuffer's pixels, from the lower left corner of the pixel.
pub(crate) fn sample_place(i: u32) -> [f32; 2] {
    let mut out = [0.5; ROOM];
    get_multisample(SAMPLE_POSITION, i, out.as_mut_ptr());
    [out[0], out[1]]
}

/// Restricts writes to sample `i` of each pixel. Returns the previous mask.
pub(crate) fn only_sample(i: u32) -> u32 {
    let mut before = [-1; ROOM];
    get_integeri(SAMPLE_MASK_VALUE, 0, before.as_mut_ptr());
    enable(SAMPLE_MASK);
    sample_maski(0, 1 << i);
    before[0].cast_unsigned()
}

/// Restores writes to all samples. Draws with the program's own masks are not traced, so no mask is
/// switched on again.
pub(crate) fn all_samples(mask: u32) {
    disable(SAMPLE_MASK);
    sample_maski(0, mask);
}

/// The colour maps, then scale and bias of red, green, blue and alpha.
const TRANSFER: [(u32, f32); 9] = [
    (MAP_COLOR, 0.0),
    (RED_SCALE, 1.0),
    (RED_BIAS, 0.0),
    (GREEN_SCALE, 1.0),
    (GREEN_BIAS, 0.0),
    (BLUE_SCALE, 1.0),
    (BLUE_BIAS, 0.0),
    (ALPHA_SCALE, 1.0),
    (ALPHA_BIAS, 0.0),
];

/// Pixels are transferred without the program's scales and biases until attributes are popped.
pub(crate) fn reset_pixel_transfer() {
    TRANSFER.into_iter().for_each(|(what, plain)| pixel_transferf(what, plain));
}

/// Runs `f` while texels are read without conversion: in consecutive rows, into memory and not into
/// a buffer, without the program's scales and biases, for which `core` contexts must not be asked.
pub(crate) fn with_raw_pixel_reads<R>(core: bool, f: impl FnOnce(&RawPixelTransfer) -> R) -> R {
    // Volumes have more parameters and are not read.
    const PACK: [(u32, i32); 5] = [
        (PACK_SWAP_BYTES, 0),
        (PACK_ROW_LENGTH, 0),
        (PACK_SKIP_ROWS, 0),
        (PACK_SKIP_PIXELS, 0),
        (PACK_ALIGNMENT, 4),
    ];
    let pack = PACK.map(|(what, plain)| (what, plain, int(what)));
    let fixed = TRANSFER.iter().filter(|_| !core);
    let mut transfer: Vec<_> = fixed.map(|(what, v)| (*what, *v, floats::<1>(*what)[0])).collect();
    // OpenGL ES has none either and answers 0 for all.
    let any = transfer.iter().any(|t| t.2 != 0.0);
    transfer.retain(|_| any);
    let buffer = word(PIXEL_PACK_BUFFER_BINDING);
    pack.iter().filter(|p| p.1 != p.2).for_each(|p| pixel_storei(p.0, p.1));
    transfer.iter().filter(|p| p.1 != p.2).for_each(|p| pixel_transferf(p.0, p.1));
    if buffer != 0 {
        bind_buffer(PIXEL_PACK_BUFFER, 0);
    }
    let out = f(&RawPixelTransfer(()));
    if buffer != 0 {
        bind_buffer(PIXEL_PACK_BUFFER, buffer);
    }
    transfer.iter().filter(|p| p.1 != p.2).for_each(|p| pixel_transferf(p.0, p.2));
    pack.iter().filter(|p| p.1 != p.2).for_each(|p| pixel_storei(p.0, p.2));
    out
}

/// A range of the buffer bound to `target`.
pub(crate) fn buffer_bytes(target: u32, at: usize, bytes: usize) -> Vec<u8> {
    let mut out = vec![0_u8; bytes];
    if bytes > 0 {
        get_buffer_sub_data(target, at as isize, bytes as isize, out.as_mut_ptr().cast());
    }
    out
}

/// The depths of the framebuffer from its lower left corner, row by row.
pub(crate) fn depths(core: bool, w: i32, h: i32) -> Vec<f32> {
    let mut out = vec![1.0_f32; w.max(0) as usize * h.max(0) as usize];
    with_raw_pixel_reads(core, |_| {
        read_pixels(0, 0, w.max(0), h.max(0), DEPTH_COMPONENT, FLOAT, out.as_mut_ptr().cast())
    });
    out
}

/// Sets the draw buffers.
pub(crate) fn draw_buffers(buffers: &[u32]) {
    draw_buffers_raw(buffers.len() as i32, buffers.as_ptr());
}

/// Sets the source of our own shader.
pub(crate) fn shader_source(shader: u32, text: &str) {
    let (p, n) = (text.as_ptr().cast::<c_char>(), text.len() as i32);
    shader_source_raw(shader, 1, &raw const p, &raw const n);
}

/// The first thousand bytes of a shader's log.
pub(crate) fn shader_log(shader: u32) -> String {
    const MOST: usize = 1000;
    let mut out = [0_u8; MOST];
    let mut n = 0;
    get_shader_info_log(shader, MOST as i32, &raw mut n, out.as_mut_ptr().cast());
    String::from_utf8_lossy(&out[..n.clamp(0, MOST as i32 - 1) as usize]).into_owned()
}

/// True when the driver supports 2-D textures of this kind. This changes only the state of proxy
/// textures.
pub(crate) fn has_texture_format(inner: i32, format: u32, kind: u32) -> bool {
    tex_image_2d(PROXY_TEXTURE_2D, 0, inner, 16, 16, 0, format, kind, core::ptr::null());
    tex_level_i::<1>(PROXY_TEXTURE_2D, 0, TEXTURE_WIDTH)[0] == 16
}

/// The source of a shader of the program.
pub(crate) fn source_of(shader: u32) -> String {
    let room = shader_i::<1>(shader, SHADER_SOURCE_LENGTH)[0].max(0);
    let mut out = vec![0_u8; room as usize + 1];
    let mut n = 0;
    get_shader_source_raw(shader, room, &raw mut n, out.as_mut_ptr().cast());
    out.truncate(n.max(0) as usize);
    String::from_utf8_lossy(&out).into_owned()
}

/// Shaders attached to a program (at most 16).
pub(crate) fn attached(program: u32) -> Vec<u32> {
    let (mut out, mut n) = ([0; 16], 0);
    get_attached_raw(program, 16, &raw mut n, out.as_mut_ptr());
    out[..n.clamp(0, 16) as usize].to_vec()
}

fn with_c_string<R>(name: &str, f: impl FnOnce(*const c_char) -> R) -> Option<R> {
    let text = std::ffi::CString::new(name).ok()?;
    Some(f(text.as_ptr()))
}

/// Location of a uniform, -1 for none.
pub(crate) fn uniform_location(program: u32, name: &str) -> i32 {
    with_c_string(name, |p| get_uniform_location_raw(program, p)).unwrap_or(-1)
}

/// Location of an attribute, -1 for none.
pub(crate) fn attrib_location(program: u32, name: &str) -> i32 {
    with_c_string(name, |p| get_attrib_location_raw(program, p)).unwrap_or(-1)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use std::cell::Cell;

    thread_local! {
        static IS_FAKED: Cell<bool> = const { Cell::new(false) };
        /// Bytes of memory behind the pointer that texels were to be written to.
        static ROOM_FOR_TEXELS: Cell<usize> = const { Cell::new(0) };
    }

    const SIZE: [i32; 2] = [16, 8];

    /// A driver that writes its complete answer, whatever size the caller expects.
    pub(in crate::driver) fn fake(name: &str) -> Option<*const ()> {
        if !IS_FAKED.get() {
            return None;
        }
        match name {
            "glGetTexLevelParameteriv" => Some(level as *const ()),
            "glGetTexImage" => Some(texels as *const ()),
            "glGetIntegerv" => Some(integers as *const ()),
            "glGetShaderiv" => Some(shader as *const ()),
            "glGetShaderSource" | "glGetShaderInfoLog" => Some(text as *const ()),
            "glGetAttachedShaders" => Some(shaders as *const ()),
            _ => None,
        }
    }

    extern "C" fn level(_: u32, _: i32, what: u32, out: *mut i32) {
        let at = [TEXTURE_WIDTH, TEXTURE_HEIGHT].iter().position(|w| *w == what);
        // SAFETY: whoever asks has room for one number.
        unsafe { out.write(at.map_or(0, |at| SIZE[at])) };
    }

    extern "C" fn texels(_: u32, _: i32, _: u32, kind: u32, out: *mut c_void) {
        // SAFETY: memory of a vector's is the allocator's.
        let room = unsafe { libc::malloc_usable_size(out) };
        ROOM_FOR_TEXELS.set(room);
        let bytes = (SIZE[0] * SIZE[1]) as usize * if kind == FLOAT { 16 } else { 4 };
        if room >= bytes {
            // SAFETY: there is room, as the allocator says.
            unsafe { out.cast::<u8>().write_bytes(1, bytes) };
        }
    }

    /// The longest answer of any query of state.
    extern "C" fn integers(_: u32, out: *mut i32) {
        (0..16).for_each(|i| {
            // SAFETY: callers have room for any answer but those of lists.
            unsafe { out.add(i).write(i as i32 + 7) };
        });
    }

    extern "C" fn shader(_: u32, _: u32, out: *mut i32) {
        // SAFETY: as of `level`.
        unsafe { out.write(5) };
    }

    /// Claims to have written more than the caller has room for.
    extern "C" fn text(_: u32, room: i32, length: *mut i32, out: *mut c_char) {
        (0..room.max(0) as usize).for_each(|i| {
            // SAFETY: as far as the caller says.
            unsafe { out.add(i).write(b'x' as c_char) };
        });
        // SAFETY: as of `level`.
        unsafe { length.write(1 << 20) };
    }

    extern "C" fn shaders(_: u32, room: i32, count: *mut i32, out: *mut u32) {
        (0..room.max(0) as usize).for_each(|i| {
            // SAFETY: as far as the caller says.
            unsafe { out.add(i).write(i as u32) };
        });
        // SAFETY: as of `level`.
        unsafe { count.write(1 << 20) };
    }

    #[test]
    fn a_driver_that_writes_more_than_its_caller_thinks_finds_room() {
        IS_FAKED.set(true);
        let n = (SIZE[0] * SIZE[1]) as usize;
        let raw = RawPixelTransfer(());
        let floats = tex_image_rgba(&raw, TEXTURE_2D, 0);
        assert!(floats.len() == n && ROOM_FOR_TEXELS.get() >= 16 * n, "{}", ROOM_FOR_TEXELS.get());
        // Memory that was used for a smaller texture.
        let bytes = tex_image_bytes(&raw, TEXTURE_2D, 0, vec![[0; 4]; 2]);
        assert!(ROOM_FOR_TEXELS.get() >= 4 * n, "{}", ROOM_FOR_TEXELS.get());
        assert_eq!(bytes, vec![[1; 4]; n]);
        // One number is queried, and sixteen are written.
        assert_eq!((int(VIEWPORT), ints::<4>(VIEWPORT)), (7, [7, 8, 9, 10]));
        // Wrong lengths.
        assert_eq!(source_of(1).len(), 6);
        assert_eq!(shader_log(1).len(), 999);
        assert_eq!(attached(1).len(), 16);
        IS_FAKED.set(false);
    }
}
