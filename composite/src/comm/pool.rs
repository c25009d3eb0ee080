//! Buffers that are used again, frame after frame.

use std::collections::BTreeMap;

/// Most buffers kept; a rank of direct send has one message for each other rank in flight, twice.
const MOST: usize = 512;

/// Empty buffers by capacity.
#[derive(Debug, Default)]
pub struct BufferPool {
    free: BTreeMap<usize, Vec<Vec<u8>>>,
    count: usize,
}

impl BufferPool {
    /// The smallest free buffer that holds `capacity` bytes, or a new one.
    pub fn take(&mut self, capacity: usize) -> Vec<u8> {
        let Some((&size, buffers)) = self.free.range_mut(capacity.max(1)..).next() else {
            return Vec::with_capacity(capacity);
        };
        let buffer = buffers.pop();
        if buffers.is_empty() {
            self.free.remove(&size);
        }
        self.count -= usize::from(buffer.is_some());
        buffer.unwrap_or_else(|| Vec::with_capacity(capacity))
    }

    /// Keeps a buffer, emptied. Of too many the smallest goes: it is the cheapest to make again.
    pub fn put(&mut self, mut buffer: Vec<u8>) {
        if buffer.capacity() == 0 {
            return;
        }
        buffer.clear();
        self.free.entry(buffer.capacity()).or_default().push(buffer);
        self.count += 1;
        if self.count > MOST
            && let Some(mut smallest) = self.free.first_entry()
        {
            smallest.get_mut().pop();
            self.count -= 1;
            if smallest.get().is_empty() {
                smallest.remove();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_buffer_that_fits_is_used_again_and_comes_back_empty() {
        let mut pool = BufferPool::default();
        for capacity in [4000, 100, 1000] {
            let mut buffer = Vec::with_capacity(capacity);
            buffer.push(1);
            pool.put(buffer);
        }
        let buffer = pool.take(500);
        assert!(buffer.is_empty() && (1000..4000).contains(&buffer.capacity()));
        assert!(pool.take(5000).capacity() >= 5000);
    }

    #[test]
    fn buffers_that_nobody_takes_again_do_not_pile_up() {
        let mut pool = BufferPool::default();
        for _ in 0..10_000 {
            pool.put(vec![0; 8]);
        }
        assert_eq!((pool.count, pool.free[&8].len()), (MOST, MOST));
    }
}
