//! When buffer objects were written: geometry in buffers is read once, and again only after
//! somebody wrote to them.

use crate::capture::ImmediateModeTarget;
use crate::interpose::calls::class;
use crate::interpose::client_memory::ArraySource;
use crate::interpose::context::Context;
use crate::interpose::driver::gl;
use crate::state::enums::*;
use std::collections::HashMap;

/// The writes to the buffers of a share group, counted.
#[derive(Debug, Default)]
pub(crate) struct BufferWrites {
    count: u64,
    /// The last one to each buffer that was named.
    named: HashMap<u32, u64>,
    /// The last one to a buffer that was not.
    unnamed: u64,
}

impl BufferWrites {
    /// A buffer was written, and nobody said which.
    pub(crate) fn any(&mut self) {
        self.count += 1;
        self.unnamed = self.count;
        self.named.clear();
    }

    fn to(&mut self, buffer: u32) {
        /// Names of buffers come again; a program that counts them upwards must not fill our
        /// memory.
        const MOST: usize = 1 << 16;
        if self.named.len() >= MOST {
            return self.any();
        }
        self.count += 1;
        self.named.insert(buffer, self.count);
    }

    /// When the buffers of arrays and indices were written last.
    pub(crate) fn last(&self, arrays: &[Option<ArraySource>; 7], indices: u32) -> [u64; 8] {
        let of = |buffer: u32| self.named.get(&buffer).copied().unwrap_or(self.unnamed);
        let array = |i: usize| arrays[i].map_or(0, |s| of(s.buffer));
        [array(0), array(1), array(2), array(3), array(4), array(5), array(6), of(indices)]
    }
}

impl Context {
    /// The buffer bound to `target` is about to be written. The driver does it.
    pub(crate) fn buffer_written(&mut self, target: u32) -> bool {
        self.watched_call(0, 0, false, false);
        let binding = match target {
            _ if self.capture.immediate_target == ImmediateModeTarget::Pass => 0,
            ARRAY_BUFFER => ARRAY_BUFFER_BINDING,
            ELEMENT_ARRAY_BUFFER => ELEMENT_ARRAY_BUFFER_BINDING,
            // The name of the target is that of its binding; OpenGL 3.1.
            TEXTURE_BUFFER if self.capabilities.version >= 31 => TEXTURE_BUFFER,
            _ => 0,
        };
        match if binding == 0 { 0 } else { gl::word(binding) } {
            0 => self.shared.writes().any(),
            buffer => self.shared.writes().to(buffer),
        }
        self.state.dirty |= class::BUFFER;
        false
    }

    /// Names of buffers, four bytes each, that may come again for others.
    pub(crate) fn buffers_deleted(&mut self, names: &[u8]) -> bool {
        self.watched_call(0, class::ARRAYS, false, false);
        let mut writes = self.shared.writes();
        for b in names.chunks_exact(4) {
            writes.to(u32::from_ne_bytes([b[0], b[1], b[2], b[3]]));
        }
        drop(writes);
        self.state.dirty |= class::BUFFER;
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interpose::client_memory::ArrayLayout;

    #[test]
    fn a_write_is_seen_by_the_draws_that_read_the_buffer_and_by_no_others() {
        let source = |buffer: u32| {
            ArraySource::in_buffer(ArrayLayout {
                size: 3,
                kind: FLOAT,
                stride: 0,
                address: 0,
                buffer,
                normalized: false,
            })
        };
        let arrays = [source(5), source(6), None, None, None, None, None];
        let mut w = BufferWrites::default();
        let before = w.last(&arrays, 7);
        w.to(8);
        assert_eq!(w.last(&arrays, 7), before);
        w.to(7);
        let after = w.last(&arrays, 7);
        assert_ne!(after, before);
        w.any();
        assert!(w.last(&arrays, 7).iter().zip(after).all(|(a, b)| *a == 0 || *a > b));
    }
}
