//! Buffers that are used again, frame after frame.

/// Most buffers kept; a rank of direct send has one message for each other rank in flight, twice.
const MOST: usize = 512;

/// Empty buffers in order of use.
#[derive(Debug, Default)]
pub struct BufferPool {
    free: Vec<Vec<u8>>,
}

impl BufferPool {
    /// The smallest free buffer that holds `capacity` bytes, or a new one.
    pub fn take(&mut self, capacity: usize) -> Vec<u8> {
        let fitting = self.free.iter().enumerate().filter(|(_, buffer)| buffer.capacity() >= capacity);
        match fitting.min_by_key(|(_, buffer)| buffer.capacity()).map(|(position, _)| position) {
            Some(position) => self.free.swap_remove(position),
            None => {
                // The frames ask for about the same sizes again and again: the largest misfit is replaced rather than kept beside it.
                if self.free.len() >= MOST / 2 {
                    self.free.pop();
                }
                Vec::with_capacity(capacity)
            }
        }
    }

    /// Keeps a buffer, emptied.
    pub fn put(&mut self, mut buffer: Vec<u8>) {
        if buffer.capacity() > 0 && self.free.len() < MOST {
            buffer.clear();
            self.free.push(buffer);
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
        assert!(pool.free.len() <= MOST);
    }
}
