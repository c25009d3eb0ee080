//! Messages of 32-bit words, little-endian, preceded by a checksum that also covers the length.
use crate::codec::checksum;

/// The message for `words`.
pub(in crate::render) fn encode_message(words: &[u32], mut buffer: Vec<u8>) -> Vec<u8> {
    buffer.clear();
    buffer.reserve(8 + 4 * words.len());
    buffer.extend_from_slice(&[0; 8]);
    for word in words {
        buffer.extend_from_slice(&word.to_le_bytes());
    }
    let sum = checksum(&buffer[8..]);
    buffer[..8].copy_from_slice(&sum.to_le_bytes());
    buffer
}

/// The words of a message; `None` when it is damaged.
pub(in crate::render) fn decode_message(message: &[u8]) -> Option<Vec<u32>> {
    let (head, body) = message.split_first_chunk::<8>()?;
    if !body.len().is_multiple_of(4) || checksum(body) != u64::from_le_bytes(*head) {
        return None;
    }
    Some(body.chunks_exact(4).map(|c| u32::from_le_bytes([c[0], c[1], c[2], c[3]])).collect())
}

/// Bytes of a message of `words` words.
pub(in crate::render) fn message_bytes(words: usize) -> usize {
    8 + 4 * words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_survive_and_damage_is_noticed() {
        let words = [1, u32::MAX, 0, 0x8000_0001];
        let message = encode_message(&words, Vec::new());
        assert_eq!(message.len(), message_bytes(4));
        assert_eq!(decode_message(&message).as_deref(), Some(&words[..]));
        for i in 0..message.len() {
            let mut damaged = message.clone();
            damaged[i] ^= 4;
            assert_eq!(decode_message(&damaged), None, "byte {i}");
            assert_eq!(decode_message(&message[..i]), None, "cut at {i}");
        }
    }
}
