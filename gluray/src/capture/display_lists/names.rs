//! The names of lists: those that `glGenLists` gives, and those that `glCallLists` gets in any of
//! OpenGL's types.

use super::{DisplayLists, FIRST_SEGMENT};
use crate::enums::*;

/// The most names in one request. No program needs more.
const MOST_NAMES: i32 = 1 << 20;

impl DisplayLists {
    /// The first of `n` names after the greatest of the program's own, which are in use from now
    /// on. `None` when the program asks for too many or too few.
    pub(super) fn reserve_names(&mut self, n: i32) -> Option<u32> {
        if !(1..=MOST_NAMES).contains(&n) {
            return None;
        }
        let last =
            self.greatest.checked_add(n.cast_unsigned()).filter(|last| *last < FIRST_SEGMENT)?;
        Some(std::mem::replace(&mut self.greatest, last) + 1)
    }
}

/// The number of bytes of a name of `glCallLists`; `None` for a type that OpenGL refuses.
pub(crate) fn width(kind: u32) -> Option<usize> {
    match kind {
        BYTE | UNSIGNED_BYTE => Some(1),
        SHORT | UNSIGNED_SHORT | TWO_BYTES => Some(2),
        INT | UNSIGNED_INT | FLOAT | FOUR_BYTES => Some(4),
        THREE_BYTES => Some(3),
        _ => None,
    }
}

/// The names of `glCallLists`; `None` for a type that OpenGL refuses.
pub(super) fn decode(kind: u32, bytes: &[u8]) -> Option<Vec<u32>> {
    let width = width(kind)?;
    let name = |b: &[u8]| match (kind, b) {
        (BYTE, &[a]) => i32::from(a.cast_signed()).cast_unsigned(),
        (SHORT, &[a, b]) => i32::from(i16::from_ne_bytes([a, b])).cast_unsigned(),
        (UNSIGNED_SHORT, &[a, b]) => u32::from(u16::from_ne_bytes([a, b])),
        (FLOAT, &[a, b, c, d]) => (f32::from_ne_bytes([a, b, c, d]) as i32).cast_unsigned(),
        (INT | UNSIGNED_INT, &[a, b, c, d]) => u32::from_ne_bytes([a, b, c, d]),
        // The types `GL_2_BYTES` to `GL_4_BYTES` have the high byte first.
        (_, b) => b.iter().fold(0, |h, x| h << 8 | u32::from(*x)),
    };
    Some(bytes.chunks_exact(width).map(name).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_lists_are_read_in_every_type() {
        let bytes = [1, 2, 3, 4];
        assert_eq!(decode(UNSIGNED_BYTE, &bytes), Some(vec![1, 2, 3, 4]));
        assert_eq!(decode(TWO_BYTES, &bytes), Some(vec![0x0102, 0x0304]));
        assert_eq!(decode(FOUR_BYTES, &bytes), Some(vec![0x0102_0304]));
        assert_eq!(decode(0x1234, &bytes), None);
        assert_eq!(decode(BYTE, &[255]), Some(vec![u32::MAX]));
    }
}
