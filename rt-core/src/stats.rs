//! Work counters inside the traversal loops, per thread. Compiled only with the feature `stats`.

/// The counted events.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Counter {
    /// Nodes whose eight boxes were tested.
    Nodes,
    /// Leaves entered.
    Leaves,
    /// Primitive tests (one per SIMD operation: up to four triangles of a leaf for a single ray,
    /// sixteen rays for a packet).
    Primitives,
    /// Box tests of one child against one group of a packet.
    GroupBoxes,
    /// Rays that left their packet and were traced alone.
    Fallbacks,
}

/// Number of counters.
pub const KINDS: usize = 5;

#[cfg(feature = "stats")]
thread_local! {
    static COUNTERS: [std::cell::Cell<u64>; KINDS] =
        const { [const { std::cell::Cell::new(0) }; KINDS] };
}

/// Adds to a counter of this thread.
#[inline(always)]
pub(crate) fn count(what: Counter, n: u64) {
    #[cfg(feature = "stats")]
    COUNTERS.with(|c| c[what as usize].set(c[what as usize].get() + n));
    #[cfg(not(feature = "stats"))]
    let _ = (what, n);
}

/// Takes this thread's counters and sets them to zero, in the order of [`Counter`]. All zero
/// without the feature `stats`.
pub fn take() -> [u64; KINDS] {
    #[cfg(feature = "stats")]
    return COUNTERS.with(|c| std::array::from_fn(|i| c[i].take()));
    #[cfg(not(feature = "stats"))]
    [0; KINDS]
}
