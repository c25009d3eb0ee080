//! The calls of OpenGL, GLX and EGL by number: their names, and what each may change, draw or read.
//!
//! The numbers count the names in the order of `symbols/names.txt`. The build script writes the
//! tables. [`at`] has the number of every call, so that calls are compared by number and not by
//! name.

use std::ffi::CStr;

include!(concat!(env!("OUT_DIR"), "/calls.rs"));

/// The classes of state that a call can change. The driver is asked again about those only.
#[allow(dead_code, reason = "some classes are only told apart by the build script")]
pub(crate) mod class {
    /// Matrices.
    pub(crate) const MATRIX: u8 = 1;
    /// Lights and the lighting model.
    pub(crate) const LIGHT: u8 = 2;
    /// Everything about rasters, enables, framebuffers.
    pub(crate) const RASTER: u8 = 4;
    /// Textures and their environment.
    pub(crate) const TEXTURE: u8 = 8;
    /// Current colour, normal, texture coordinate, material.
    pub(crate) const CURRENT: u8 = 16;
    /// Contents of buffers.
    pub(crate) const BUFFER: u8 = 32;
    /// Uniforms.
    pub(crate) const UNIFORM: u8 = 64;
    /// Vertex arrays and buffer bindings.
    pub(crate) const ARRAYS: u8 = 128;
    /// All of it.
    pub(crate) const ALL: u8 = 255;
    /// The classes that draws of filled primitives depend on.
    pub(crate) const DRAWS: u8 = MATRIX | LIGHT | RASTER | TEXTURE | CURRENT;
}

/// The number of a call.
pub(crate) fn index_of(name: &[u8]) -> Option<usize> {
    NAMES.binary_search_by(|n| n.to_bytes().cmp(name)).ok()
}

/// The name of a call, for reports.
pub(crate) fn name(index: usize) -> &'static str {
    NAMES[index].to_str().unwrap_or("a call")
}

/// The classes of state that a call may change.
pub(crate) fn class_of(index: usize) -> u8 {
    CLASSES[index]
}

/// True when pending draws must be in the framebuffer before the call.
pub(crate) fn flushes(index: usize) -> bool {
    FLUSHES[index]
}

/// True for draw calls that are not taken apart. The driver draws them.
pub(crate) fn is_other_draw(index: usize) -> bool {
    OTHER_DRAWS[index]
}

/// True when the program or the driver may read drawn pixels in the call.
pub(crate) fn reads_pixels(index: usize) -> bool {
    READS_PIXELS[index]
}

/// True for calls that come to a hook of ours.
pub(crate) fn is_hooked(index: usize) -> bool {
    HOOKED[index]
}

/// True for calls that end a frame on the screen.
pub(crate) fn swaps_buffers(index: usize) -> bool {
    const SWAPS: [usize; 5] = [
        at::glXSwapBuffers,
        at::glXSwapBuffersMscOML,
        at::eglSwapBuffers,
        at::eglSwapBuffersWithDamageEXT,
        at::eglSwapBuffersWithDamageKHR,
    ];
    SWAPS.contains(&index)
}

/// True for calls by which a program reads its own frame.
pub(crate) fn reads_frame(index: usize) -> bool {
    const READS: [usize; 4] =
        [at::glReadPixels, at::glReadnPixels, at::glReadnPixelsARB, at::glGetTexImage];
    READS.contains(&index)
}

/// True for calls that show something only when the front buffer is drawn to.
pub(crate) fn shows_front_buffer(index: usize) -> bool {
    [at::glFlush, at::glFinish].contains(&index)
}

/// True for calls that give a texture texels from elsewhere: from another API or process, or from
/// a group that shares the image alone.
pub(crate) fn imports_texels(index: usize) -> bool {
    const IMPORTS: [usize; 7] = [
        at::glEGLImageTargetTexture2DOES,
        at::glEGLImageTargetTexStorageEXT,
        at::glEGLImageTargetTextureStorageEXT,
        at::glTexStorageMem2DEXT,
        at::glTextureStorageMem2DEXT,
        at::glVDPAURegisterVideoSurfaceNV,
        at::glVDPAURegisterOutputSurfaceNV,
    ];
    IMPORTS.contains(&index)
}

/// True for calls after which a context sees what other contexts have written.
pub(crate) fn waits_for_others(index: usize) -> bool {
    const WAITS: [usize; 7] = [
        at::glWaitSync,
        at::glClientWaitSync,
        at::eglWaitSync,
        at::eglWaitSyncKHR,
        at::eglClientWaitSync,
        at::eglClientWaitSyncKHR,
        at::glWaitSemaphoreEXT,
    ];
    WAITS.contains(&index)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Toolkits that repaint parts of a window swap by the extension (GTK 4, Qt 6).
    #[test]
    fn every_swap_of_egl_ends_a_frame_and_flushes() {
        let swaps =
            ["eglSwapBuffers", "eglSwapBuffersWithDamageEXT", "eglSwapBuffersWithDamageKHR"];
        for name in swaps {
            let index = index_of(name.as_bytes()).unwrap_or_else(|| panic!("{name} is no entry"));
            assert!(swaps_buffers(index) && flushes(index), "{name}");
        }
    }

    #[test]
    fn calls_that_read_pixels_are_told_by_number() {
        let reading = [at::glReadPixels, at::glBlitFramebuffer, at::glEndQuery, at::glAccum];
        assert!(reading.into_iter().all(reads_pixels));
        assert!(![at::glXSwapBuffers, at::glFlush, at::glDrawBuffer].into_iter().any(reads_pixels));
        assert_eq!(index_of(b"glBegin"), Some(at::glBegin));
        assert_eq!(name(at::glBegin), "glBegin");
    }
}
