//! Base64 (RFC 4648) as VTK and glTF write it: several padded blocks may follow each other, with
//! white space between them. The crate `base64` decodes a single complete block without white
//! space, so it serves for writing only.

/// Values of the characters; 64 marks a character outside the alphabet.
const TABLE: [u8; 256] = {
    let mut table = [64u8; 256];
    let letters = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut i = 0;
    while i < 64 {
        table[letters[i] as usize] = i as u8;
        i += 1;
    }
    table
};

/// Decodes groups of four characters from a text, up to a requested length.
pub(crate) struct Decoder<'a> {
    text: &'a [u8],
    /// Position in the text, always between groups.
    pub(crate) pos: usize,
}

/// A byte that is not base64, and its position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct BadByte {
    pub(crate) pos: usize,
    pub(crate) byte: u8,
}

impl<'a> Decoder<'a> {
    pub(crate) fn new(text: &'a [u8]) -> Self {
        Decoder { text, pos: 0 }
    }

    /// Appends bytes to `out` until it holds `len` or the text ends. It may append up to two bytes
    /// more than requested, because groups are not split.
    pub(crate) fn fill(&mut self, out: &mut Vec<u8>, len: usize) -> Result<(), BadByte> {
        while out.len() < len {
            let mut quartet = [0u8; 4];
            let (mut n, mut padding) = (0, 0);
            while n < 4 {
                let Some(&byte) = self.text.get(self.pos) else {
                    // A group that the end of the text cuts off is not data.
                    return Ok(());
                };
                let value = TABLE[byte as usize];
                if value < 64 && padding == 0 {
                    quartet[n] = value;
                    n += 1;
                } else if byte == b'=' && n >= 2 {
                    padding += 1;
                    n += 1;
                } else if !byte.is_ascii_whitespace() {
                    return Err(BadByte { pos: self.pos, byte });
                }
                self.pos += 1;
            }
            let [a, b, c, d] = quartet;
            out.extend_from_slice(&[a << 2 | b >> 4, b << 4 | c >> 2, c << 6 | d][..3 - padding]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn padded_pieces_one_after_the_other_are_read_through() {
        // The test vectors of RFC 4648, then two blocks in a row with white space, as VTK writes
        // header and data.
        for (plain, coded) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(::base64::encode(plain), coded);
            let mut out = Vec::new();
            Decoder::new(coded.as_bytes()).fill(&mut out, usize::MAX).unwrap();
            assert_eq!(out, plain.as_bytes());
        }
        let mut out = Vec::new();
        Decoder::new(b" Zg==\n Zm9v\tYg== ").fill(&mut out, usize::MAX).unwrap();
        assert_eq!(out, b"ffoob");
        assert_eq!(
            Decoder::new(b"Zm9v?").fill(&mut out, usize::MAX),
            Err(BadByte { pos: 4, byte: b'?' })
        );
    }
}
