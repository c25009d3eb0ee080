//! Buffers that are reused, frame after frame.

use std::collections::BTreeMap;

/// Most buffers kept; a rank of direct send has one message for each other rank in flight, twice.
const MOST: usize = 512;

/// How much larger than what is asked for a buffer may be.
const MOST_WASTE: usize = 4;

/// Rounds to eight capacities per power of two. Frames are similar but not equal, and a buffer of
/// the last one should fit the next.
fn rounded(capacity: usize) -> usize {
    let step = (capacity.max(64).next_power_of_two() / 16).max(1);
    capacity.max(64).checked_next_multiple_of(step).unwrap_or(capacity)
}

/// Empty buffers by capacity.
#[derive(Debug, Default)]
pub struct BufferPool {
    free: BTreeMap<usize, Vec<Vec<u8>>>,
    count: usize,
}

impl BufferPool {
    /// The smallest free buffer that holds `capacity` bytes, or a new one.
    pub fn take(&mut self, capacity: usize) -> Vec<u8> {
        self.fitting(capacity).unwrap_or_else(|| Vec::with_capacity(rounded(capacity)))
    }

    /// The smallest free buffer that holds `capacity` bytes and is not much larger.
    pub fn fitting(&mut self, capacity: usize) -> Option<Vec<u8>> {
        let capacity = rounded(capacity);
        let (&size, buffers) =
            self.free.range_mut(capacity..=capacity.saturating_mul(MOST_WASTE)).next()?;
        let buffer = buffers.pop()?;
        if buffers.is_empty() {
            self.free.remove(&size);
        }
        self.count -= 1;
        Some(buffer)
    }

    /// Keeps a buffer, emptied. If there are too many, drops the smallest, which is the cheapest to
    /// allocate again.
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
    fn a_long_buffer_is_kept_for_long_messages_and_serves_one_that_is_a_little_longer() {
        let mut pool = BufferPool::default();
        let long = pool.take(1_000_000);
        let at = long.as_ptr();
        pool.put(long);
        let (short, longer) = (pool.take(100), pool.take(1_040_000));
        assert_ne!(short.as_ptr(), at);
        assert_eq!(longer.as_ptr(), at);
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
