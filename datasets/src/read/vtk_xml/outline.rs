//! The tags of a VTK XML file without the numbers between them, for files that are larger than
//! memory.

use crate::read::error::{At, BROKEN, Fault};
use std::io::{self, BufRead};

/// Longest text of tags that is kept. Files of one data set have a few kilobytes.
const MOST_TEXT: usize = 1 << 24;

/// What [`outline`] finds.
pub(super) struct Outline {
    /// The XML. The text of each array is its place in the file: `START LENGTH`, in bytes.
    pub(super) head: String,
    /// The byte after the underscore that appended data begins with; `None` without such data.
    pub(super) appended: Option<u64>,
}

/// What follows in the file.
enum Next {
    Text,
    Tag,
}

/// Reads the tags of a file, up to its appended data.
pub(super) fn outline(mut file: impl BufRead) -> io::Result<Result<Outline, Fault>> {
    let (mut head, mut at, mut next) = (Vec::new(), 0u64, Next::Text);
    // Whether the last tag opened an array whose values follow.
    let mut in_array = false;
    loop {
        let start = at;
        let kept = head.len();
        match next {
            Next::Text => {
                let found = take_until(&mut file, b'<', &mut at, &mut head, !in_array)?;
                if in_array {
                    let end = at - u64::from(found);
                    head.extend_from_slice(format!("{start} {}<", end - start).as_bytes());
                }
                if !found {
                    break;
                }
                next = Next::Tag;
            }
            Next::Tag => {
                loop {
                    let found = take_until(&mut file, b'>', &mut at, &mut head, true)?;
                    if !found || tag_is_complete(&head[kept..]) {
                        break;
                    }
                }
                let tag = &head[kept..];
                let name = tag.split(|b| b.is_ascii_whitespace() || *b == b'>').next();
                let closed = tag.ends_with(b"/>");
                in_array = !closed && matches!(name, Some(b"DataArray" | b"Array"));
                if name == Some(b"AppendedData") && !closed {
                    let found = take_until(&mut file, b'_', &mut at, &mut head, false)?;
                    head.extend_from_slice(b"</AppendedData></VTKFile>");
                    return Ok(text(head, found.then_some(at)));
                }
                next = Next::Text;
            }
        }
        if head.len() > MOST_TEXT {
            let what = format!("its tags are longer than {MOST_TEXT} bytes");
            return Ok(Err(Fault::new(At::Byte(at), what, BROKEN)));
        }
        if at == start {
            break;
        }
    }
    Ok(text(head, None))
}

fn text(head: Vec<u8>, appended: Option<u64>) -> Result<Outline, Fault> {
    match String::from_utf8(head) {
        Ok(head) => Ok(Outline { head, appended }),
        Err(_) => Err(Fault::field("the XML", "its tags are not UTF-8 text")),
    }
}

/// Whether a `>` ends the tag, rather than standing in a value or a comment.
fn tag_is_complete(tag: &[u8]) -> bool {
    if tag.starts_with(b"!--") {
        return tag.len() >= 6 && tag.ends_with(b"-->");
    }
    let mut quote = None;
    for &byte in tag {
        match quote {
            None if byte == b'"' || byte == b'\'' => quote = Some(byte),
            Some(open) if byte == open => quote = None,
            _ => {}
        }
    }
    quote.is_none()
}

/// Reads up to and including `end`, and appends that to `out` if it is wanted. Returns whether
/// `end` was found. Stops early when `out` is too long.
fn take_until(
    file: &mut impl BufRead,
    end: u8,
    at: &mut u64,
    out: &mut Vec<u8>,
    wanted: bool,
) -> io::Result<bool> {
    loop {
        let buffer = file.fill_buf()?;
        if buffer.is_empty() || out.len() > MOST_TEXT {
            return Ok(false);
        }
        let found = buffer.iter().position(|&b| b == end);
        let used = found.map_or(buffer.len(), |i| i + 1);
        if wanted {
            out.extend_from_slice(&buffer[..used]);
        }
        file.consume(used);
        *at += used as u64;
        if found.is_some() {
            return Ok(true);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_become_places_and_tags_stay() {
        let file = br#"<VTKFile a="x>y"><!-- a > b < c --><DataArray Name="p"> QUJD </DataArray>
<Array/><DataArray format="appended" offset="7"/>text<AppendedData encoding="raw"> _<<>>"#;
        // A buffer of three bytes: no tag lies in one.
        let reader = std::io::BufReader::with_capacity(3, &file[..]);
        let found = outline(reader).unwrap().unwrap();
        let place = file.windows(6).position(|w| w == b" QUJD ").unwrap();
        let expected = format!(
            r#"<VTKFile a="x>y"><!-- a > b < c --><DataArray Name="p">{place} 6</DataArray>
<Array/><DataArray format="appended" offset="7"/>text<AppendedData encoding="raw"></AppendedData></VTKFile>"#
        );
        assert_eq!(found.head, expected);
        let after = file.iter().position(|&b| b == b'_').unwrap() as u64 + 1;
        assert_eq!(found.appended, Some(after));
    }

    #[test]
    fn files_that_end_anywhere_have_an_outline_or_a_fault() {
        let file = br#"<VTKFile><!-- c --><DataArray Name="p">1 2</DataArray></VTKFile>"#;
        for end in 0..file.len() {
            let found = outline(&file[..end]).unwrap().unwrap();
            assert_eq!(found.appended, None);
        }
    }
}
