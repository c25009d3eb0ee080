//! Counts writes to buffer objects. Geometry in buffers is read once, and again only after a write.

use crate::calls::class;
use crate::capture::ImmediateModeTarget;
use crate::driver::gl;
use crate::enums::*;
use crate::interpose::client_memory::ArraySource;
use crate::interpose::context::Context;
use std::collections::HashMap;

/// The numbers of the writes to the buffers of a share group.
#[derive(Debug, Default)]
pub(crate) struct BufferWrites {
    count: u64,
    /// The last write to each buffer that was named.
    named: HashMap<u32, u64>,
    /// The last write to a buffer that was not named.
    unnamed: u64,
}

impl BufferWrites {
    /// An unknown buffer was written.
    pub(crate) fn any(&mut self) {
        self.count += 1;
        self.unnamed = self.count;
        self.named.clear();
    }

    fn to(&mut self, buffer: u32) {
        /// Buffer names are reused. A program with ever higher names must not fill our memory.
        const MOST: usize = 1 << 16;
        if self.named.len() >= MOST {
            return self.any();
        }
        self.count += 1;
        self.named.insert(buffer, self.count);
    }

    /// The numbers of the last writes to the buffers of arrays.
    pub(crate) fn last<const N: usize>(&self, arrays: &[Option<ArraySource>; N]) -> [u64; N] {
        arrays.map(|a| a.map_or(0, |s| self.last_to(s.buffer)))
    }

    /// The number of the last write to a buffer.
    pub(crate) fn last_to(&self, buffer: u32) -> u64 {
        self.named.get(&buffer).copied().unwrap_or(self.unnamed)
    }
}

impl Context {
    /// The driver is about to write the buffer bound to `target`.
    pub(crate) fn buffer_written(&mut self, target: u32) -> bool {
        self.watched_call(0, 0, false, false);
        let binding = match target {
            _ if self.capture.immediate_target == ImmediateModeTarget::Pass => 0,
            ARRAY_BUFFER => ARRAY_BUFFER_BINDING,
            ELEMENT_ARRAY_BUFFER => ELEMENT_ARRAY_BUFFER_BINDING,
            // The name of the target is also that of its binding (OpenGL 3.1).
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

    /// These buffers are deleted. Their names, of four bytes each, may be used again.
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
        let arrays = [source(5), source(6), None];
        let mut w = BufferWrites::default();
        let before = w.last(&arrays);
        w.to(8);
        assert_eq!(w.last(&arrays), before);
        w.to(6);
        let after = w.last(&arrays);
        assert_ne!(after, before);
        w.any();
        assert!(w.last(&arrays).iter().zip(after).all(|(a, b)| *a == 0 || *a > b));
        assert_eq!(w.last_to(9), w.last_to(6));
    }
}
