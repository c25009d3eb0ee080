//! Sorts the attributes in the header of an OpenEXR file by name. The `exr` crate keeps those that
//! the format does not define in a hash map, so that two files of the same image differed.
//!
//! A header is a list of attributes (name, type, number of bytes, value) and ends with a zero byte
//! (openexr.com, "OpenEXR File Layout"). Nothing refers to the place of an attribute, and the
//! header keeps its length, so all offsets in the file stay right.

/// Magic number and version: the header of the first part begins behind them.
const BEFORE_THE_HEADER: usize = 8;

/// Sorts the attributes of the first part. Leaves the bytes as they are if they are no header.
pub(super) fn sort_attributes(file: &mut [u8]) {
    let Some(header) = file.get(BEFORE_THE_HEADER..) else { return };
    let Some(mut attributes) = attributes(header) else { return };
    attributes.sort();
    let sorted = attributes.concat();
    file[BEFORE_THE_HEADER..][..sorted.len()].copy_from_slice(&sorted);
}

/// The attributes at the beginning of a header, each with its name in front.
fn attributes(header: &[u8]) -> Option<Vec<Vec<u8>>> {
    let mut found = Vec::new();
    let mut rest = header;
    while *rest.first()? != 0 {
        let text = |from: usize| Some(from + rest.get(from..)?.iter().position(|b| *b == 0)? + 1);
        let value = text(text(0)?)?;
        let (size, _) = rest.get(value..)?.split_first_chunk()?;
        let end = value.checked_add(4)?.checked_add(u32::from_le_bytes(*size) as usize)?;
        let (attribute, behind) = rest.split_at_checked(end)?;
        found.push(attribute.to_vec());
        rest = behind;
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn attribute(name: &str, value: &[u8]) -> Vec<u8> {
        let size = (value.len() as u32).to_le_bytes();
        [name.as_bytes(), b"\0string\0", &size, value].concat()
    }

    #[test]
    fn attributes_are_sorted_and_nothing_behind_them_moves() {
        let file = |order: [usize; 3]| {
            let all = [attribute("a", b"xyz"), attribute("b", b""), attribute("b.c", b"\0\0")];
            let attributes = order.map(|k| all[k].clone()).concat();
            [&b"v/1\x01\x02\0\0\0"[..], &attributes, b"\0pixels"].concat()
        };
        for order in [[0, 1, 2], [2, 1, 0], [1, 2, 0]] {
            let mut bytes = file(order);
            sort_attributes(&mut bytes);
            assert_eq!(bytes, file([0, 1, 2]));
        }
    }

    proptest! {
        #[test]
        fn any_bytes_keep_their_number(mut bytes in prop::collection::vec(0..4_u8, 0..200)) {
            let before = bytes.len();
            sort_attributes(&mut bytes);
            prop_assert_eq!(bytes.len(), before);
        }
    }
}
