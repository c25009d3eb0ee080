//! The driver's functions for transform feedback and for queries of programs, with slices in place
//! of pointers.

use super::driver;
use crate::enums::{ACTIVE_ATTRIBUTES, ACTIVE_UNIFORMS, INTERLEAVED_ATTRIBS, STREAM_READ};
use core::ffi::{CStr, c_char, c_void};
use std::ffi::CString;
use std::sync::atomic::AtomicPtr;

driver! {
    fn transform_feedback_varyings = "glTransformFeedbackVaryings"(program: u32, n: i32, names: *const *const c_char, mode: u32);
    pub(crate) fn begin_transform_feedback = "glBeginTransformFeedback"(mode: u32);
    pub(crate) fn end_transform_feedback = "glEndTransformFeedback"();
    pub(crate) fn bind_buffer_base = "glBindBufferBase"(target: u32, index: u32, name: u32);
    fn draw_elements_raw = "glDrawElements"(mode: u32, n: i32, kind: u32, at: *const c_void);
    fn gen_buffers = "glGenBuffers"(n: i32, out: *mut u32);
    fn delete_buffers = "glDeleteBuffers"(n: i32, names: *const u32);
    fn buffer_data_raw = "glBufferData"(target: u32, bytes: isize, data: *const c_void, usage: u32);
    fn get_integer_indexed = "glGetIntegeri_v"(what: u32, index: u32, out: *mut i32);
    fn get_active_uniform = "glGetActiveUniform"(program: u32, i: u32, room: i32, length: *mut i32, size: *mut i32, kind: *mut u32, name: *mut c_char);
    fn get_active_attrib = "glGetActiveAttrib"(program: u32, i: u32, room: i32, length: *mut i32, size: *mut i32, kind: *mut u32, name: *mut c_char);
}

/// Sets the output of the vertex shader that later links capture.
pub(crate) fn feedback_varying(program: u32, name: &str) {
    let Ok(name) = CString::new(name) else { return };
    let names = [name.as_ptr()];
    transform_feedback_varyings(program, 1, names.as_ptr(), INTERLEAVED_ATTRIBS);
}

/// Later links capture nothing.
pub(crate) fn no_feedback_varyings(program: u32) {
    transform_feedback_varyings(program, 0, core::ptr::null(), INTERLEAVED_ATTRIBS);
}

/// Draws with the bound element buffer.
pub(crate) fn draw_elements(mode: u32, n: i32, kind: u32, at: usize) {
    draw_elements_raw(mode, n, kind, at as *const c_void);
}

/// Two new buffers.
pub(crate) fn gen_two_buffers() -> [u32; 2] {
    let mut out = [0; 2];
    gen_buffers(2, out.as_mut_ptr());
    out
}

/// Deletes two buffers.
pub(crate) fn delete_two_buffers(names: [u32; 2]) {
    delete_buffers(2, names.as_ptr());
}

/// Sets the contents of the bound buffer.
pub(crate) fn buffer_data(target: u32, bytes: &[u8]) {
    buffer_data_raw(target, bytes.len() as isize, bytes.as_ptr().cast(), STREAM_READ);
}

/// A name of indexed state.
pub(crate) fn indexed_word(what: u32, index: u32) -> u32 {
    let mut out = [0_i32; 4];
    get_integer_indexed(what, index, out.as_mut_ptr());
    out[0].cast_unsigned()
}

const ROOM: usize = 256;
type Getter = fn(u32, u32, i32, *mut i32, *mut i32, *mut u32, *mut c_char);

fn named(get: Getter, program: u32, count: u32) -> Vec<(String, u32)> {
    (0..count)
        .map(|i| {
            let (mut length, mut size, mut kind) = (0, 0, 0);
            let mut name = [0 as c_char; ROOM];
            get(
                program,
                i,
                ROOM as i32 - 1,
                &raw mut length,
                &raw mut size,
                &raw mut kind,
                name.as_mut_ptr(),
            );
            // SAFETY: the array is longer than what may be written, and was zero.
            let text = unsafe { CStr::from_ptr(name.as_ptr()) };
            (text.to_string_lossy().into_owned(), kind)
        })
        .collect()
}

/// The uniforms of a program with their types.
pub(crate) fn active_uniforms(program: u32) -> Vec<(String, u32)> {
    let n = super::gl::program_i::<1>(program, ACTIVE_UNIFORMS)[0].max(0);
    named(get_active_uniform, program, n.cast_unsigned())
}

/// The names of a program's attributes.
pub(crate) fn active_attributes(program: u32) -> Vec<String> {
    let n = super::gl::program_i::<1>(program, ACTIVE_ATTRIBUTES)[0].max(0);
    named(get_active_attrib, program, n.cast_unsigned()).into_iter().map(|(name, _)| name).collect()
}
