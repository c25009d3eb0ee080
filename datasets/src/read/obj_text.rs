//! The text of OBJ and MTL files in the form that the crate `tobj` takes.
//!
//! `tobj` 4.0.5 expects UTF-8, drops a first line behind a byte order mark, panics at a colour of
//! one number (`Ks 0`, which the format allows: green and blue are then as red), and refuses a
//! whole file for a material without a name or one value that is no number. So lines are brought
//! into order here first. Numbers of lines stay, for messages.

use std::borrow::Cow;

/// The name of a material without one.
const UNNAMED: &str = "unnamed";

/// A text as UTF-8: without a byte order mark, decoded from UTF-16 if it has one of those, and from
/// Latin-1 if it is not UTF-8 otherwise, as old modellers write names.
pub(super) fn decoded(bytes: &[u8]) -> Cow<'_, [u8]> {
    let utf_16 = |rest: &[u8], unit: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = rest.as_chunks::<2>().0.iter().map(|b| unit(*b)).collect();
        Cow::Owned(String::from_utf16_lossy(&units).into_bytes())
    };
    match bytes {
        [0xef, 0xbb, 0xbf, rest @ ..] => Cow::Borrowed(rest),
        [0xff, 0xfe, rest @ ..] => utf_16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => utf_16(rest, u16::from_be_bytes),
        _ if str::from_utf8(bytes).is_ok() => Cow::Borrowed(bytes),
        _ => Cow::Owned(bytes.iter().map(|&b| char::from(b)).collect::<String>().into_bytes()),
    }
}

/// The words of a line up to a comment.
fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace)
        .filter(|word| !word.is_empty())
        .take_while(|word| !word.starts_with(b"#"))
}

/// Lines with their ends.
fn lines(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split_inclusive(|&b| b == b'\n')
}

/// True for a line that continues in the next one.
pub(super) fn continues(line: &[u8]) -> bool {
    let line = line.strip_suffix(b"\n").unwrap_or(line);
    line.strip_suffix(b"\r").unwrap_or(line).ends_with(b"\\")
}

/// What the vertices of a text have.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Vertices {
    pub(super) count: u64,
    /// Of these, with a colour.
    pub(super) colored: u64,
}

/// The text of an OBJ file, decoded by [`decoded`], and what its vertices have.
///
/// Continued lines become one; a material without a name gets one. Where only some of the vertices
/// have colours, none has, and colours keep three components.
pub(super) fn prepared(text: Cow<'_, [u8]>) -> (Cow<'_, [u8]>, Vertices) {
    let text = joined(text);
    let mut vertices = Vertices::default();
    let mut in_order = true;
    for line in lines(&text) {
        match words(line).next() {
            Some(b"v") => {
                let numbers = words(line).count() - 1;
                vertices.count += 1;
                vertices.colored += u64::from(numbers >= 6);
                in_order &= matches!(numbers, 3 | 4 | 6) && !line.contains(&b'#');
            }
            Some(b"usemtl") => in_order &= words(line).count() > 1,
            _ => {}
        }
    }
    let has_colors = vertices.colored == vertices.count;
    if in_order && (has_colors || vertices.colored == 0) {
        return (text, vertices);
    }
    let mut out = Vec::with_capacity(text.len() + 16);
    for line in lines(&text) {
        let numbers = words(line).count().saturating_sub(1);
        match words(line).next() {
            Some(b"v") => {
                // A fourth number is a weight. Two numbers behind the position mean nothing.
                let kept = match numbers {
                    _ if has_colors => 6,
                    4 => 4,
                    _ => 3,
                };
                out.push(b'v');
                for word in words(line).skip(1).take(kept) {
                    out.push(b' ');
                    out.extend_from_slice(word);
                }
                out.push(b'\n');
            }
            Some(b"usemtl") if numbers == 0 => {
                out.extend_from_slice(format!("usemtl {UNNAMED}\n").as_bytes());
            }
            _ => out.extend_from_slice(line),
        }
    }
    (Cow::Owned(out), vertices)
}

/// The text with continued lines as one. Empty lines behind it make up for the others.
fn joined(text: Cow<'_, [u8]>) -> Cow<'_, [u8]> {
    if !lines(&text).any(continues) {
        return text;
    }
    let mut out = Vec::with_capacity(text.len());
    let mut missing = 0;
    for line in lines(&text) {
        if continues(line) {
            let end = line.iter().rposition(|&b| b == b'\\').unwrap_or(line.len());
            out.extend_from_slice(&line[..end]);
            out.push(b' ');
            missing += 1;
        } else {
            out.extend_from_slice(line);
            out.extend(std::iter::repeat_n(b'\n', std::mem::take(&mut missing)));
        }
    }
    Cow::Owned(out)
}

/// The text of an MTL file, decoded, with lines that mean nothing left out. `told` gets what each
/// of them was.
pub(super) fn prepared_materials(bytes: &[u8], mut told: impl FnMut(String)) -> Vec<u8> {
    let text = decoded(bytes);
    let mut out = Vec::with_capacity(text.len());
    for (at, line) in (1_u64..).zip(lines(&text)) {
        let finite = |word: &[u8]| number::<f64>(word).filter(|v| v.is_finite());
        let numbers = || words(line).skip(1).map(finite).collect::<Option<Vec<f64>>>();
        let kept = match words(line).next() {
            Some(b"newmtl") if words(line).count() == 1 => Some(format!("newmtl {UNNAMED}")),
            Some(key @ (b"Ka" | b"Kd" | b"Ks" | b"Ke")) => {
                let key = String::from_utf8_lossy(key);
                match numbers().as_deref() {
                    // One number stands for all three.
                    Some([r]) => Some(format!("{key} {r} {r} {r}")),
                    Some([r, g, b, ..]) => Some(format!("{key} {r} {g} {b}")),
                    _ => None,
                }
            }
            // `d -halo 0.5` has the number last.
            Some(key @ (b"Ns" | b"Ni" | b"d")) => words(line)
                .skip(1)
                .last()
                .and_then(finite)
                .map(|v| format!("{} {v}", String::from_utf8_lossy(key))),
            // Models of illumination are not used.
            Some(b"illum") => continue,
            Some(key) if is_map(key) && words(line).count() == 1 => None,
            _ => {
                out.extend_from_slice(line);
                continue;
            }
        };
        match kept {
            Some(text) => out.extend_from_slice(text.as_bytes()),
            None => told(format!("line {at}: `{}` left out", shown(line.trim_ascii()))),
        }
        out.push(b'\n');
    }
    out
}

/// True for statements that name an image.
fn is_map(key: &[u8]) -> bool {
    key.starts_with(b"map_") || key.eq_ignore_ascii_case(b"bump")
}

/// The first statement in an OBJ text that `tobj` cannot take: its line, and what is wrong.
pub(super) fn first_fault(text: &[u8]) -> Option<(u64, String)> {
    const KINDS: [(&[u8], usize); 3] = [(b"v", 3), (b"vt", 2), (b"vn", 3)];
    let kind = |line: &[u8]| KINDS.iter().position(|(key, _)| words(line).next() == Some(key));
    let mut all = [0_i64; 3];
    lines(text).filter_map(kind).for_each(|k| all[k] += 1);
    let mut so_far = [0_i64; 3];
    for (number, line) in (1..).zip(lines(text)) {
        let fault = if let Some(k) = kind(line) {
            so_far[k] += 1;
            fault_of_numbers(line, KINDS[k].1)
        } else if matches!(words(line).next(), Some(b"f" | b"l")) {
            fault_of_corners(line, all, so_far)
        } else {
            None
        };
        if let Some(what) = fault {
            return Some((number, what));
        }
    }
    None
}

/// The start of a word, for messages.
fn shown(word: &[u8]) -> String {
    String::from_utf8_lossy(word).chars().take(40).collect()
}

fn number<T: std::str::FromStr>(word: &[u8]) -> Option<T> {
    str::from_utf8(word).ok()?.parse().ok()
}

fn fault_of_numbers(line: &[u8], needed: usize) -> Option<String> {
    let is_number = |word: &&[u8]| number::<f64>(word).is_some();
    let found = words(line).skip(1).take_while(is_number).count();
    match words(line).nth(1 + found) {
        Some(word) => Some(format!("`{}` is not a number", shown(word))),
        None => (found < needed).then(|| format!("{found} numbers where {needed} are needed")),
    }
}

fn fault_of_corners(line: &[u8], all: [i64; 3], so_far: [i64; 3]) -> Option<String> {
    words(line).skip(1).find_map(|word| {
        let indices = word.split(|&b| b == b'/').zip(all.into_iter().zip(so_far));
        indices.filter(|(index, _)| !index.is_empty()).find_map(|(index, (all, so_far))| {
            match number::<i64>(index) {
                None => Some(format!("`{}` is no corner", shown(word))),
                Some(k) if (1..=all).contains(&k) || (-so_far..0).contains(&k) => None,
                Some(k) => Some(format!("`{}` names number {k} of {all}", shown(word))),
            }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn text(bytes: &[u8]) -> String {
        String::from_utf8(decoded(bytes).into_owned()).expect("UTF-8")
    }

    fn obj(bytes: &str) -> (String, Vertices) {
        let (text, vertices) = prepared(decoded(bytes.as_bytes()));
        (String::from_utf8(text.into_owned()).expect("UTF-8"), vertices)
    }

    fn mtl(bytes: &str) -> (String, Vec<String>) {
        let mut told = Vec::new();
        let out = prepared_materials(bytes.as_bytes(), |what| told.push(what));
        (String::from_utf8(out).expect("UTF-8"), told)
    }

    #[test]
    fn encodings_other_than_utf_8_are_decoded() {
        assert_eq!(text(b"v 0 0 0\n"), "v 0 0 0\n");
        assert_eq!(text(b"\xef\xbb\xbfv 0"), "v 0");
        assert_eq!(text(b"\xff\xfev\0 \x000\0"), "v 0");
        assert_eq!(text(b"\xfe\xff\0v\0 \x000"), "v 0");
        assert_eq!(text(b"usemtl Gr\xfcn"), "usemtl Grün", "Latin-1");
        assert_eq!(text("usemtl Grün".as_bytes()), "usemtl Grün");
    }

    #[test]
    fn lines_that_are_in_order_are_not_copied() {
        let in_order = "v 0 0 0\nv 1 0 0 1\n\nusemtl a\nf 1 2 3\n";
        assert!(matches!(prepared(decoded(in_order.as_bytes())), (Cow::Borrowed(_), _)));
    }

    #[test]
    fn continued_lines_become_one_and_later_ones_keep_their_numbers() {
        assert_eq!(obj("f 1 2 \\\n3 \\\r\n4\nv 0 0 0\n").0, "f 1 2  3  4\n\n\nv 0 0 0\n");
    }

    #[test]
    fn colours_of_some_vertices_are_none_and_comments_are_no_colours() {
        let (text, vertices) = obj("v 0 0 0\nv 1 0 0 1 0.5 0.2\nv 0 1 0 # last\nv 1 1 1 2\n");
        assert_eq!(text, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1 2\n");
        assert_eq!(vertices, Vertices { count: 4, colored: 1 });
        let (text, vertices) = obj("v 0 0 0 1 1 1 1\nv 1 0 0 1 0.5 0.2 0.1\n");
        assert_eq!(text, "v 0 0 0 1 1 1\nv 1 0 0 1 0.5 0.2\n", "without alpha");
        assert_eq!(vertices.colored, 2);
        assert_eq!(obj("v 0 0 0 1 1\n").0, "v 0 0 0\n");
    }

    #[test]
    fn materials_keep_what_the_format_allows_and_lose_single_lines_otherwise() {
        let (text, told) = mtl("newmtl\nKs 0\nKd 0.1 0.2 0.3 # red\nd -halo 0.5\nNs 10\nillum x\n");
        assert_eq!(text, "newmtl unnamed\nKs 0 0 0\nKd 0.1 0.2 0.3\nd 0.5\nNs 10\n");
        assert!(told.is_empty());
        let (text, told) = mtl("newmtl a\nKd red\nKa spectral a.rfl\nNs\nmap_Kd\nmap_Kd a.png\n");
        assert_eq!(text, "newmtl a\n\n\n\n\nmap_Kd a.png\n");
        assert_eq!(told.len(), 4, "{told:?}");
        assert_eq!(told[0], "line 2: `Kd red` left out");
        assert_eq!(obj("usemtl\nf 1 2 3\n").0, "usemtl unnamed\nf 1 2 3\n");
    }

    #[test]
    fn a_fault_is_found_with_its_line() {
        let fault = |text: &str| first_fault(text.as_bytes());
        let ok = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf 1/1/1 2//1 -1/\n";
        assert_eq!(fault(ok), None);
        assert_eq!(fault("v 0 0 0\nv 0,5 0 0\n"), Some((2, "`0,5` is not a number".into())));
        assert_eq!(fault("v 0 0\n"), Some((1, "2 numbers where 3 are needed".into())));
        let far = Some((2, "`7/1` names number 7 of 1".into()));
        assert_eq!(fault("v 0 0 0\nf 1 7/1\n"), far);
        assert_eq!(fault("v 0 0 0\nf 1 a\n"), Some((2, "`a` is no corner".into())));
        assert_eq!(fault("v 0 0 0\nf 0 1\n"), Some((2, "`0` names number 0 of 1".into())));
    }

    proptest! {
        #[test]
        fn no_text_of_materials_panics(
            words in prop::collection::vec(prop::sample::select(vec![
                "newmtl", "a", "Ka", "Kd", "Ks", "Ke", "Ns", "Ni", "d", "Tr", "illum", "map_Kd",
                "map_bump", "bump", "0", "1e400", "nan", "-halo", "spectral", "#", "\u{fc}", "\\",
                "\n", "\n", "\n", "\r\n", "\t",
            ]), 0..40),
            cut in any::<prop::sample::Index>(),
        ) {
            let text = words.join(" ");
            let bytes = &text.as_bytes()[..cut.index(text.len() + 1)];
            let prepared = prepared_materials(bytes, |_| ());
            tobj::load_mtl_buf(&mut prepared.as_slice()).ok();
        }
    }
}
