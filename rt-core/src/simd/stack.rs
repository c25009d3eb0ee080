//! A fixed-size stack that starts uninitialised: clearing five kilobytes for every ray would cost more than a short traversal.

use std::mem::MaybeUninit;

/// At most `N` entries. Pushing onto a full stack panics: callers bound the depth when they build.
pub(crate) struct Stack<T: Copy, const N: usize> {
    len: usize,
    data: [MaybeUninit<T>; N],
}

impl<T: Copy, const N: usize> Stack<T, N> {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Stack { len: 0, data: [const { MaybeUninit::uninit() }; N] }
    }

    #[inline(always)]
    pub(crate) fn push(&mut self, value: T) {
        self.data[self.len].write(value);
        self.len += 1;
    }

    #[inline(always)]
    pub(crate) fn pop(&mut self) -> Option<T> {
        if self.len == 0 {
            return None;
        }
        self.len -= 1;
        // SAFETY: entries below the former `len` have been written by `push`, and `len < N` holds after the decrement.
        Some(unsafe { self.data.get_unchecked(self.len).assume_init() })
    }

    #[inline(always)]
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Orders the entries from `base` up so that the smallest is on top. Insertion sort: there are at most eight, mostly two or three.
    #[inline(always)]
    pub(crate) fn sort_descending_from(&mut self, base: usize)
    where
        T: PartialOrd,
    {
        // SAFETY: every entry below `len` is initialised.
        let top = unsafe { std::slice::from_raw_parts_mut(self.data.as_mut_ptr().cast::<T>(), self.len) };
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
