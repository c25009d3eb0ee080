//! Random changes of messages.

/// SplitMix64 (Steele, Lea and Flood, OOPSLA 2014).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) % n as u64) as usize
    }
}

/// Changes a message at random; its length stays below twice what it was and a little.
pub(crate) fn mutate(random: &mut Random, message: &mut Vec<u8>) {
    let length = message.len();
    match random.below(6) {
        0 if length > 0 => message[random.below(length)] ^= 1 << random.below(8),
        1 if length >= 4 => {
            // A number: the smallest, the largest, or a neighbour.
            let at = random.below(length / 4) * 4;
            let word = u32::from_le_bytes(message[at..at + 4].try_into().expect("four bytes"));
            let words = [0, 1, u32::MAX, i32::MAX as u32, word.wrapping_add(1), word ^ 0xff00];
            message[at..at + 4].copy_from_slice(&words[random.below(6)].to_le_bytes());
        }
        2 => message.truncate(random.below(length + 1)),
        3 => {
            let more = 1 + random.below(16);
            message.extend((0..more).map(|_| random.below(256) as u8));
        }
        4 if length > 0 => {
            // A part again at another place.
            let (from, to) = (random.below(length), random.below(length));
            let part = message[from..length.min(from + 24)].to_vec();
            let end = length.min(to + part.len());
            message[to..end].copy_from_slice(&part[..end - to]);
        }
        _ => message.iter_mut().for_each(|byte| *byte = random.below(256) as u8),
    }
}
