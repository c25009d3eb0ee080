//! Reading and writing of the words of tables. Whatever is read may be wrong.
use rt_core::glam::{DVec3, UVec3};

/// Writes a table.
#[derive(Default)]
pub(super) struct Writer(pub(super) Vec<u32>);

impl Writer {
    pub(super) fn u32(&mut self, value: u32) {
        self.0.push(value);
    }

    pub(super) fn u64(&mut self, value: u64) {
        self.0.extend([value as u32, (value >> 32) as u32]);
    }

    pub(super) fn f64s(&mut self, values: &[f64]) {
        values.iter().for_each(|v| self.u64(v.to_bits()));
    }

    pub(super) fn uvec3(&mut self, value: UVec3) {
        self.0.extend(value.to_array());
    }

    pub(super) fn text(&mut self, text: &str) {
        self.u32(text.len() as u32);
        for chunk in text.as_bytes().chunks(4) {
            let mut word = [0; 4];
            word[..chunk.len()].copy_from_slice(chunk);
            self.u32(u32::from_le_bytes(word));
        }
    }
}

/// Reads a table; `None` where it ends too early or holds what cannot be.
pub(super) struct Reader<'a>(pub(super) &'a [u32]);

impl Reader<'_> {
    pub(super) fn u32(&mut self) -> Option<u32> {
        let (&word, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(word)
    }

    pub(super) fn u64(&mut self) -> Option<u64> {
        Some(u64::from(self.u32()?) | u64::from(self.u32()?) << 32)
    }

    pub(super) fn dvec3(&mut self) -> Option<DVec3> {
        let mut next = || Some(f64::from_bits(self.u64()?));
        Some(DVec3::new(next()?, next()?, next()?))
    }

    pub(super) fn uvec3(&mut self) -> Option<UVec3> {
        Some(UVec3::new(self.u32()?, self.u32()?, self.u32()?))
    }

    /// A text of at most `most` bytes.
    pub(super) fn text(&mut self, most: usize) -> Option<String> {
        let bytes = self.u32()? as usize;
        if bytes > most {
            return None;
        }
        let (words, rest) = self.0.split_at_checked(bytes.div_ceil(4))?;
        self.0 = rest;
        let mut text: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).collect();
        text.truncate(bytes);
        String::from_utf8(text).ok()
    }

    /// A number of items that need at least `words` words each, of which there are enough left.
    pub(super) fn count(&mut self, words: usize) -> Option<usize> {
        let count = self.u32()? as usize;
        (count.checked_mul(words)? <= self.0.len()).then_some(count)
    }

    pub(super) fn is_at_end(&self) -> bool {
        self.0.is_empty()
    }
}
