//! The interface as data: read from Rust sources in the plain style of `src/capi`.

/// A part of the interface, with what its documentation says.
pub(crate) struct Item {
    pub(crate) name: String,
    pub(crate) about: String,
    pub(crate) kind: Kind,
}

pub(crate) enum Kind {
    Constant(String),
    Alias(String),
    Handle,
    Structure(Vec<Field>),
    Function { arguments: Vec<Field>, result: String },
}

/// A member or an argument, with its type in Rust.
pub(crate) struct Field {
    pub(crate) name: String,
    pub(crate) about: String,
    pub(crate) rust: String,
}

/// Type and length of an array.
pub(crate) fn array_of(rust: &str) -> Option<(&str, usize)> {
    let (of, count) = rust.strip_prefix('[')?.strip_suffix(']')?.split_once("; ")?;
    Some((of, count.parse().ok()?))
}

/// Whether it is a pointer to a function.
pub(crate) fn is_function(rust: &str) -> bool {
    rust.contains("extern \"C\" fn(")
}

/// All items of a source file, in its order.
pub(crate) fn items(source: &str) -> Vec<Item> {
    let lines: Vec<&str> = source.lines().collect();
    let (mut found, mut comment) = (Vec::new(), Vec::new());
    let mut i = 0;
    while i < lines.len() {
        let line = lines[i];
        if let Some(text) = line.strip_prefix("///") {
            comment.push(text.trim());
        } else if let Some(rest) = line.strip_prefix("pub const ") {
            let (name, rest) = rest.split_once(": u32 = ").expect("constants are u32");
            let value = rest.trim_end_matches(';').replace('_', "");
            found.push(item(name, &mut comment, Kind::Constant(value)));
        } else if let Some(rest) = line.strip_prefix("pub type ") {
            let (name, of) = rest.trim_end_matches(';').split_once(" = ").expect("a type");
            found.push(item(name, &mut comment, Kind::Alias(of.to_owned())));
        } else if line == "#[repr(C)]" {
            while !lines[i].starts_with("pub struct ") {
                i += 1;
            }
            let name = lines[i].trim_start_matches("pub struct ").trim_end_matches(" {");
            let end = i + lines[i..].iter().position(|l| *l == "}").expect("an end");
            let fields = fields(&lines[i + 1..end]);
            let kind = if fields.is_empty() { Kind::Handle } else { Kind::Structure(fields) };
            found.push(item(name, &mut comment, kind));
            i = end;
        } else if line == "#[unsafe(no_mangle)]" {
            let end = i + lines[i..].iter().position(|l| l.ends_with('{')).expect("a body");
            let text = lines[i + 1..=end].iter().map(|l| l.trim()).collect::<Vec<_>>().join(" ");
            let (name, rest) =
                text.split_once(" fn ").expect("a function").1.split_once('(').expect("arguments");
            let (arguments, result) = rest.rsplit_once(") -> ").expect("a result");
            let arguments = arguments.split(',').map(str::trim).filter(|a| !a.is_empty());
            let arguments = arguments.map(|a| field(a, &mut Vec::new())).collect();
            let result = result.trim_end_matches(" {").to_owned();
            found.push(item(name, &mut comment, Kind::Function { arguments, result }));
            i = end;
        } else if !line.starts_with("#[") {
            comment.clear();
        }
        i += 1;
    }
    found
}

fn item(name: &str, comment: &mut Vec<&str>, kind: Kind) -> Item {
    let safety = comment.iter().position(|c| *c == "# Safety").unwrap_or(comment.len());
    let about = comment[..safety].join(" ").replace("[`", "").replace("`]", "").replace('`', "");
    comment.clear();
    Item { name: name.to_owned(), about: about.trim().to_owned(), kind }
}

fn field(text: &str, comment: &mut Vec<&str>) -> Field {
    let (name, rust) = text.split_once(": ").expect("name and type");
    let about = comment.join(" ").replace('`', "");
    comment.clear();
    Field { name: name.to_owned(), about, rust: rust.to_owned() }
}

fn fields(lines: &[&str]) -> Vec<Field> {
    let (mut found, mut comment) = (Vec::new(), Vec::new());
    let mut lines = lines.iter().map(|l| l.trim());
    while let Some(line) = lines.next() {
        if let Some(text) = line.strip_prefix("/// ") {
            comment.push(text);
        } else if let Some(start) = line.strip_prefix("pub ") {
            let mut text = start.to_owned();
            while !text.ends_with(',') {
                text = text + " " + lines.next().expect("the end of a member");
            }
            found.push(field(text.trim_end_matches(','), &mut comment));
        }
    }
    found
}

/// Words in lines of at most `width` bytes.
pub(crate) fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.len() + 1 + word.len() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// Bytes and alignment of a type in C, on 64 bits.
pub(crate) fn layout(rust: &str, all: &[Item]) -> (usize, usize) {
    if let Some((of, count)) = array_of(rust) {
        let (bytes, align) = layout(of, all);
        return (bytes * count, align);
    }
    match rust {
        "u32" | "i32" | "f32" => (4, 4),
        "u64" | "i64" | "f64" => (8, 8),
        pointer if pointer.starts_with('*') || is_function(pointer) => (8, 8),
        name => {
            let structure = all.iter().find(|i| i.name == name);
            let Some(Kind::Structure(fields)) = structure.map(|i| &i.kind) else {
                panic!("no layout of `{name}`")
            };
            let (bytes, align) = fields.iter().fold((0_usize, 1), |(sum, most), field| {
                let (bytes, align) = layout(&field.rust, all);
                (sum.next_multiple_of(align) + bytes, most.max(align))
            });
            (bytes.next_multiple_of(align), align)
        }
    }
}
