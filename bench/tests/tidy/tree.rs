//! The files of the workspace, and Rust source without its comments and strings.

use std::fs;
use std::path::{Path, PathBuf};

/// Members that lie in the folder of another.
const INNER_MEMBERS: &[&str] = &["gluray/interposer", "composite/capi", "composite/catalyst"];

/// A text file of the workspace.
#[derive(Debug, Clone)]
pub(crate) struct File {
    /// Path from the workspace root, with forward slashes.
    pub(crate) path: String,
    /// The whole text.
    pub(crate) text: String,
    /// For Rust: the text with comments and the contents of literals blanked; all lines keep their
    /// length.
    pub(crate) code: String,
}

impl File {
    pub(crate) fn new(path: &str, text: &str) -> File {
        let code = if path.ends_with(".rs") { blank(text) } else { String::new() };
        File { path: path.to_owned(), text: text.to_owned(), code }
    }

    pub(crate) fn is_rust(&self) -> bool {
        self.path.ends_with(".rs")
    }

    /// The folder of the member that has the file: the first one of the path, unless a member lies
    /// inside another.
    pub(crate) fn member(&self) -> &str {
        let inner = INNER_MEMBERS
            .iter()
            .find(|m| self.path.strip_prefix(**m).is_some_and(|rest| rest.starts_with('/')));
        inner.copied().unwrap_or_else(|| self.path.split('/').next().unwrap_or_default())
    }

    /// `path:line` of a byte offset in `text` or `code`.
    pub(crate) fn place(&self, offset: usize) -> String {
        format!("{}:{}", self.path, self.text[..offset].matches('\n').count() + 1)
    }
}

pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("bench lies in the workspace").to_owned()
}

/// Every text file that belongs to the project, sorted by path.
pub(crate) fn files() -> Vec<File> {
    let mut files = Vec::new();
    walk(&root(), "", &mut files);
    files.sort_by(|a, b| a.path.cmp(&b.path));
    assert!(
        files.iter().any(|f| f.path == "rt-core/src/lib.rs"),
        "the workspace was not found at {:?}",
        root()
    );
    files
}

fn walk(folder: &Path, prefix: &str, files: &mut Vec<File>) {
    for entry in fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
        let entry = entry.unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
        let name = entry.file_name().to_string_lossy().into_owned();
        let path = format!("{prefix}{name}");
        // Files that .gitignore excludes, and git's own folder (a file in a linked work tree).
        let ignored =
            [".git", "target", "shared", "xtask/target", "docs/book"].contains(&path.as_str());
        if ignored || name.ends_with(".tmp") {
            continue;
        }
        let kind = entry.file_type().unwrap_or_else(|e| panic!("{path}: {e}"));
        if kind.is_dir() {
            walk(&entry.path(), &format!("{path}/"), files);
        } else if kind.is_file()
            && let Ok(text) = fs::read_to_string(entry.path())
        {
            files.push(File::new(&path, &text));
        }
    }
}

/// Offsets of whole-word occurrences of `word` in `code`.
pub(crate) fn words<'a>(code: &'a str, word: &'a str) -> impl Iterator<Item = usize> + 'a {
    let inside = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() || c == '_');
    code.match_indices(word).map(|(at, _)| at).filter(move |&at| {
        !inside(code[..at].chars().next_back()) && !inside(code[at + word.len()..].chars().next())
    })
}

/// Replaces comments and the contents of string and character literals in Rust source with spaces.
/// Newlines are kept, and every byte keeps its offset.
pub(crate) fn blank(source: &str) -> String {
    let s = source.as_bytes();
    let mut out = s.to_vec();
    let mut i = 0;
    let erase = |out: &mut [u8], from: usize, to: usize| {
        out[from..to].iter_mut().filter(|b| **b != b'\n').for_each(|b| *b = b' ');
    };
    let find = |from: usize, what: &[u8]| {
        s[from..].windows(what.len()).position(|w| w == what).map_or(s.len(), |n| from + n)
    };
    while i < s.len() {
        let after_word = i > 0 && (s[i - 1].is_ascii_alphanumeric() || s[i - 1] == b'_');
        let end = if s[i..].starts_with(b"//") {
            let end = find(i, b"\n");
            erase(&mut out, i, end);
            end
        } else if s[i..].starts_with(b"/*") {
            let (mut depth, mut j) = (1, i + 2);
            while depth > 0 && j < s.len() {
                let step = if s[j..].starts_with(b"/*") {
                    depth += 1;
                    2
                } else if s[j..].starts_with(b"*/") {
                    depth -= 1;
                    2
                } else {
                    1
                };
                j += step;
            }
            let end = j.min(s.len());
            erase(&mut out, i, end);
            end
        } else if !after_word && let Some((open, hashes)) = raw_string(&s[i..]) {
            let close = [b"\"".as_slice(), &b"#".repeat(hashes)].concat();
            let end = find(i + open, &close);
            erase(&mut out, i + open, end);
            (end + close.len()).min(s.len())
        } else if s[i] == b'"' {
            let mut j = i + 1;
            while j < s.len() && s[j] != b'"' {
                j += if s[j] == b'\\' { 2 } else { 1 };
            }
            let end = j.min(s.len());
            erase(&mut out, i + 1, end);
            (end + 1).min(s.len())
        } else if s[i] == b'\'' {
            // A character literal has a closing quote; a lifetime or label has none.
            let first = source[i + 1..].chars().next();
            let width = first.map_or(0, char::len_utf8);
            if first == Some('\\') {
                let end = find(i + 3, b"'");
                erase(&mut out, i + 1, end);
                (end + 1).min(s.len())
            } else if s.get(i + 1 + width) == Some(&b'\'') {
                erase(&mut out, i + 1, i + 1 + width);
                i + 2 + width
            } else {
                i + 1
            }
        } else {
            i + 1
        };
        i = end;
    }
    String::from_utf8(out).expect("only whole characters are blanked")
}

/// Length of the opening of a raw string (`r#"`, `br"`, ...) and its number of hashes.
fn raw_string(s: &[u8]) -> Option<(usize, usize)> {
    let letters = [b"r".as_slice(), b"br", b"cr"].into_iter().find(|p| s.starts_with(p))?.len();
    let hashes = s[letters..].iter().take_while(|b| **b == b'#').count();
    (s.get(letters + hashes) == Some(&b'"')).then_some((letters + hashes + 1, hashes))
}

#[test]
fn blanking_keeps_code_and_lines_only() {
    let source = concat!(
        "// unsafe\nlet a = \"un\\\"safe\"; /* unsafe /* nested */ unsafe */ let b: &'a str = \
         r#\"un\"safe\"#;\n",
        "let c = ['\"', '\\'', 'ü', b'\\n']; unsafe { x } // done\n",
        "for_each(); bar\"unsafe\"",
    );
    let code = blank(source);
    assert_eq!(code.len(), source.len(), "offsets changed");
    assert_eq!(code.matches('\n').count(), source.matches('\n').count(), "lines changed");
    assert_eq!(
        words(&code, "unsafe").collect::<Vec<_>>(),
        [source.find("unsafe {").expect("planted")]
    );
    for kept in ["let a = \"", "&'a str", "for_each()", "x }"] {
        assert!(code.contains(kept), "`{kept}` is lost in\n{code}");
    }
}

#[test]
fn words_stand_alone() {
    assert_eq!(words("unsafe_code unsafe(x) my_unsafe", "unsafe").collect::<Vec<_>>(), [12]);
}
