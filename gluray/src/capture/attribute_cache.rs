//! Caches attribute arrays by content. Arrays in the program's memory come again in each frame,
//! rarely with other contents.
//!
//! Reading an array costs half as much as copying it, and the copy's new memory costs as much
//! again. So arrays are hashed in place.

use crate::capture::draw::PackedArray;
use crate::capture::geometry_cache::hash;
use std::collections::HashMap;
use std::sync::Arc;

/// Arrays by content.
#[derive(Default)]
pub(crate) struct AttributeCache {
    known: HashMap<u128, (Arc<PackedArray>, u64)>,
    frame: u64,
}

/// The size in bytes from which hashing is worthwhile.
const WORTH_HASHING: usize = 4096;

/// True when the same content has the same memory. Shorter arrays are copied for each draw.
pub(crate) fn is_shared(packed: &PackedArray) -> bool {
    packed.bytes.len() >= WORTH_HASHING
}

impl AttributeCache {
    /// `bytes` as an array of such components. `copy` packs the same bytes tightly.
    pub(crate) fn get(
        &mut self,
        bytes: &[u8],
        layout: (usize, u32, usize, bool),
        copy: impl FnOnce() -> PackedArray,
    ) -> Arc<PackedArray> {
        if bytes.len() < WORTH_HASHING {
            return Arc::new(copy());
        }
        let (stride, kind, size, normalized) = layout;
        let tail = [stride as u64, u64::from(kind), size as u64, u64::from(normalized)];
        let key = hash(&[bytes, bytemuck::cast_slice(&tail)]);
        let now = self.frame;
        let (pack, used) = self.known.entry(key).or_insert_with(|| (Arc::new(copy()), now));
        *used = now;
        pack.clone()
    }

    /// Ends a frame and drops what no draw used.
    pub(crate) fn frame_done(&mut self) {
        const KEPT_FRAMES: u64 = 3;
        self.frame += 1;
        let now = self.frame;
        self.known.retain(|_, (_, used)| now - *used <= KEPT_FRAMES);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::enums::BYTE;

    #[test]
    fn the_same_bytes_are_copied_once_and_other_bytes_again() {
        let mut packs = AttributeCache::default();
        let mut bytes = vec![1_u8; 6000];
        let layout = (3, BYTE, 3, true);
        let mut copies = 0;
        let mut get = |packs: &mut AttributeCache, bytes: &[u8]| {
            packs.get(bytes, layout, || {
                copies += 1;
                PackedArray { bytes: bytes.to_vec(), kind: BYTE, size: 3, normalized: true }
            })
        };
        let first = get(&mut packs, &bytes);
        for _ in 0..10 {
            assert!(Arc::ptr_eq(&first, &get(&mut packs, &bytes)));
            packs.frame_done();
        }
        bytes[5999] = 2;
        assert!(!Arc::ptr_eq(&first, &get(&mut packs, &bytes)));
        (0..5).for_each(|_| packs.frame_done());
        assert!(packs.known.is_empty());
        assert_eq!(copies, 2);
    }
}
