//! Global heaps: where values of variable length lie.

use super::source::Source;
use crate::read::error::{At, BROKEN, Fault};

/// Objects of global heaps. The collection that was used last is kept: neighbours share it.
pub(super) struct GlobalHeap<'s> {
    source: &'s Source,
    collection: Option<(u64, Vec<u8>)>,
}

impl<'s> GlobalHeap<'s> {
    pub(super) fn new(source: &'s Source) -> Self {
        GlobalHeap { source, collection: None }
    }

    /// Object `index` of the collection at `address`.
    pub(super) fn object(&mut self, address: u64, index: u32) -> Result<Vec<u8>, Fault> {
        if self.collection.as_ref().is_none_or(|c| c.0 != address) {
            let head_size = 8 + self.source.length_size as u64;
            let head = self.source.bytes(address, head_size, "a global heap")?;
            let mut f = self.source.fields(&head, address);
            f.signature(b"GCOL")?;
            f.version(1, "a global heap")?;
            f.skip(3)?;
            let size = f.length()?;
            self.collection = Some((address, self.source.bytes(address, size, "a global heap")?));
        }
        let Some((_, bytes)) = &self.collection else { return Ok(Vec::new()) };
        let mut f = self.source.fields(bytes, address);
        f.skip(8 + self.source.length_size)?;
        while f.remaining() >= 8 + self.source.length_size {
            let found = f.u16()?;
            f.skip(6)?;
            let size = f.length()?;
            if found == 0 {
                break; // the free space, which is the last
            }
            let size = usize::try_from(size).unwrap_or(usize::MAX);
            let data = f.take(size)?;
            if u32::from(found) == index {
                self.source.allow(size as u64, "an object of a global heap")?;
                return Ok(data.to_vec());
            }
            f.skip((size.wrapping_neg() % 8).min(f.remaining()))?;
        }
        let what = format!("no object {index} in the global heap");
        Err(Fault::new(At::Byte(address), what, BROKEN))
    }
}
