//! A fixed-size stack that starts uninitialised. Clearing five kilobytes for every ray would cost
//! more than a short traversal.

use std::mem::MaybeUninit;

/// Memory of a [`Stack`].
pub(crate) struct StackMemory<T, const N: usize>([MaybeUninit<T>; N]);

impl<T, const N: usize> StackMemory<T, N> {
    #[inline(always)]
    pub(crate) const fn new() -> Self {
        StackMemory([const { MaybeUninit::uninit() }; N])
    }
}

/// A stack of at most `N` entries. Pushing onto a full stack panics: callers limit the depth when
/// they build a tree.
///
/// The length is outside the memory so that it stays in a register. Inside one struct it was in
/// memory, and every step of a traversal waited for the previous store (measured: 10 % of a single
/// ray's time).
pub(crate) struct Stack<'m, T: Copy, const N: usize> {
    len: usize,
    data: &'m mut [MaybeUninit<T>; N],
}

impl<'m, T: Copy, const N: usize> Stack<'m, T, N> {
    #[inline(always)]
    pub(crate) fn empty(memory: &'m mut StackMemory<T, N>) -> Self {
        Stack { len: 0, data: &mut memory.0 }
    }

    #[inline(always)]
    pub(crate) fn push(&mut self, value: T) {
        self.data[self.len].write(value);
        self.len += 1;
    }

    /// Pushes the first `n` of the values, at most eight, without a branch on their number.
    #[inline(always)]
    pub(crate) fn push_first(&mut self, values: [T; 8], n: usize) {
        let room: &mut [MaybeUninit<T>; 8] =
            self.data[self.len..].first_chunk_mut().expect("room for eight");
        *room = values.map(MaybeUninit::new);
        self.len += n.min(8);
    }

    #[inline(always)]
    pub(crate) fn pop(&mut self) -> Option<T> {
        if self.len == 0 {
            return None;
        }
        self.len -= 1;
        // SAFETY: entries below the former `len` have been written by `push`, and `len < N` holds
        // after the decrement.
        Some(unsafe { self.data.get_unchecked(self.len).assume_init() })
    }

    #[inline(always)]
    pub(crate) fn clear(&mut self) {
        self.len = 0;
    }

    #[inline(always)]
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Sorts the entries from `base` up so that the smallest is on top. Insertion sort: there are
    /// at most eight entries, mostly two or three.
    #[inline(always)]
    pub(crate) fn sort_descending_from(&mut self, base: usize)
    where
        T: PartialOrd,
    {
        // SAFETY: every entry below `len` is initialised.
        let top =
            unsafe { std::slice::from_raw_parts_mut(self.data.as_mut_ptr().cast::<T>(), self.len) };
        for i in base + 1..top.len() {
            let v = top[i];
            let mut j = i;
            while j > base && top[j - 1] < v {
                top[j] = top[j - 1];
                j -= 1;
            }
            top[j] = v;
        }
    }
}
