//! The meshlets that a thread has expanded last.

use super::expand::Expanded;
use super::nodes::NodeStarts;
use crate::bvh::layout::wide::{ChildRef, Unit};
use crate::simd::prefetch;
use fearless_simd::Simd;
use std::cell::{Cell, RefCell};
use std::sync::atomic::{AtomicU64, Ordering};

/// Expanded meshlets per thread, as a power of two: 0.2 MiB. (With 256, rays of ambient occlusion
/// took 1.04 times as long: most of what they expand is not met again, and the rest is in the
/// second-level cache.)
const SLOTS_LOG2: u32 = 5;

/// A key that no tree of this process has had.
pub(crate) fn new_key() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// What a thread keeps from one meshlet to the next.
pub(crate) struct MeshletCache {
    pub(crate) last: LastMeshlets,
    pub(crate) search: SearchRoom,
}

/// Expanded meshlets. Each has one place where it can be.
pub(crate) struct LastMeshlets {
    /// Key of the tree and first unit of what each place holds.
    held: [(u64, u32); 1 << SLOTS_LOG2],
    expanded: Vec<Expanded>,
}

/// Room for the search of a meshlet by a ray.
pub(crate) struct SearchRoom {
    pub(crate) starts: NodeStarts,
    /// Nodes to visit: the distance in the high half, as in the ordinary tree.
    pub(crate) stack: [u64; 16],
}

impl MeshletCache {
    fn new() -> Box<RefCell<MeshletCache>> {
        let expanded = (0..1 << SLOTS_LOG2).map(|_| Expanded::EMPTY).collect();
        let search = SearchRoom { starts: NodeStarts::new(), stack: [0; 16] };
        let last = LastMeshlets { held: [(0, 0); 1 << SLOTS_LOG2], expanded };
        Box::new(RefCell::new(MeshletCache { last, search }))
    }
}

impl LastMeshlets {
    /// The meshlet `leaf` of the tree with this key, expanded, and the words that it starts.
    #[inline(always)]
    pub(crate) fn meshlet<'u, S: Simd>(
        &mut self,
        simd: S,
        key: u64,
        units: &'u [Unit],
        leaf: ChildRef,
    ) -> (&mut Expanded, &'u [u32]) {
        let unit = leaf.unit();
        let words: &[u32] = bytemuck::cast_slice(&units[unit..]);
        // Neighbours in the array are neighbours in space: a multiplication spreads all. Pages of a
        // stored mesh have the same units, so the key decides too (the numbers are odd, from
        // Fibonacci hashing and from MurmurHash3).
        let mixed =
            (unit as u32).wrapping_mul(0x9e37_79b9) ^ (key as u32).wrapping_mul(0x85eb_ca6b);
        let place = mixed >> (32 - SLOTS_LOG2);
        let (held, expanded) = (&mut self.held[place as usize], &mut self.expanded[place as usize]);
        if *held != (key, unit as u32) {
            // Should a panic leave it half done, the place must not count as filled.
            *held = (0, 0);
            // Traversals request the first four lines. Leaves are read after the nodes.
            prefetch::<8, _>(units, unit + 8);
            expanded.load(simd, words);
            *held = (key, unit as u32);
        }
        (expanded, words)
    }
}

thread_local! {
    static CACHE: Cell<Option<Box<RefCell<MeshletCache>>>> = const { Cell::new(None) };
}

/// Calls `work` with the thread's meshlets, which rays that are under way at once share. A query
/// inside `work`, from a caller's function, starts without any.
#[inline]
pub(crate) fn with_cache<R>(work: impl FnOnce(&RefCell<MeshletCache>) -> R) -> R {
    let cache = CACHE.take().unwrap_or_else(MeshletCache::new);
    let result = work(&cache);
    CACHE.set(Some(cache));
    result
}
