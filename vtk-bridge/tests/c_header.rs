//! Generates `include/rtv.h` from the Rust sources and compares it with the committed file. With
//! `RTV_WRITE_HEADER=1`, writes the file. (cbindgen does the same for any source, but its licence,
//! MPL-2.0, is not among the allowed ones.)

use std::fmt::Write as _;
use std::path::Path;

/// Translates a Rust type to C.
fn c_type(rust: &str) -> String {
    let simple = match rust.trim() {
        "u8" => "uint8_t",
        "u16" => "uint16_t",
        "u32" => "uint32_t",
        "u64" => "uint64_t",
        "i32" => "int32_t",
        "f32" => "float",
        "f64" => "double",
        "c_char" => "char",
        "c_void" => "void",
        other if other.starts_with("Rtv") => other,
        other => {
            for (prefix, suffix) in [("*const ", " const*"), ("*mut ", "*")] {
                if let Some(inner) = other.strip_prefix(prefix) {
                    return format!("{}{suffix}", c_type(inner));
                }
            }
            panic!("no C for the Rust type `{other}`");
        }
    };
    simple.to_owned()
}

/// Translates `name: type` to a C declaration.
fn declaration(field: &str) -> String {
    let (name, rust) = field.split_once(": ").expect("name and type");
    if let Some(inner) = rust.strip_prefix('[') {
        let (of, count) = inner.trim_end_matches(']').split_once("; ").expect("an array");
        return format!("{} {name}[{count}]", c_type(of));
    }
    match function_type(rust) {
        Some((arguments, result)) => format!("{result} (*{name})({arguments})"),
        None => format!("{} {name}", c_type(rust)),
    }
}

/// Argument and result types of `unsafe extern "C" fn(A, B) -> R`.
fn function_type(rust: &str) -> Option<(String, String)> {
    let rest = rust.strip_prefix("unsafe ").unwrap_or(rust).strip_prefix("extern \"C\" fn(")?;
    let (arguments, result) = rest.rsplit_once(')').expect("closed");
    let arguments: Vec<String> =
        arguments.split(", ").filter(|a| !a.is_empty()).map(c_type).collect();
    let arguments = if arguments.is_empty() { "void".to_owned() } else { arguments.join(", ") };
    let result = result.trim().strip_prefix("-> ").map_or("void".to_owned(), c_type);
    Some((arguments, result))
}

/// Generates the header for sources in the plain style of `src/capi`.
fn header(sources: &[&str]) -> String {
    let mut out = String::from(
        "/* The C interface of vtk-bridge; src/capi tells how to use it.\n * Made from the Rust \
         sources by tests/c_header.rs: do not edit. */\n\
         #ifndef RTV_H\n#define RTV_H\n#include <stdint.h>\n#ifdef __cplusplus\nextern \"C\" \
         {\n#endif\n\n\
         /* A renderer's side of the bridge. */\ntypedef struct RtvBridge RtvBridge;\n",
    );
    let mut calls = String::new();
    for source in sources {
        let lines: Vec<&str> = source.lines().collect();
        let mut comment: Vec<&str> = Vec::new();
        let mut i = 0;
        while i < lines.len() {
            let line = lines[i];
            if let Some(text) = line.trim().strip_prefix("/// ") {
                comment.push(text);
            } else if let Some(rest) =
                line.strip_prefix("pub const ").filter(|r| r.contains(": u32 = "))
            {
                let (name, value) = rest.split_once(": u32 = ").expect("checked");
                describe(&mut out, "", &comment);
                writeln!(out, "#define {name} {}u", value.trim_end_matches(';').replace('_', ""))
                    .expect("to a string");
                comment.clear();
            } else if line.starts_with("#[repr(C)]") {
                let name_line = lines[i + 1..]
                    .iter()
                    .position(|l| l.starts_with("pub struct"))
                    .expect("a struct")
                    + i
                    + 1;
                let name =
                    lines[name_line].trim_start_matches("pub struct ").trim_end_matches(" {");
                describe(&mut out, "", &comment);
                writeln!(out, "typedef struct {name} {{").expect("to a string");
                comment.clear();
                i = name_line + 1;
                while lines[i] != "}" {
                    if let Some(text) = lines[i].trim().strip_prefix("/// ") {
                        comment.push(text);
                    } else if let Some(field) = lines[i].trim().strip_prefix("pub ") {
                        // rustfmt breaks long fields over several lines.
                        let mut field = field.to_owned();
                        while !field.ends_with(',') {
                            i += 1;
                            field = field + " " + lines[i].trim();
                        }
                        describe(&mut out, "  ", &comment);
                        writeln!(out, "  {};", declaration(field.trim_end_matches(',')))
                            .expect("to a string");
                        comment.clear();
                    }
                    i += 1;
                }
                writeln!(out, "}} {name};").expect("to a string");
            } else if line.starts_with("#[unsafe(no_mangle)]") {
                let end = lines[i..].iter().position(|l| l.ends_with('{')).expect("a body") + i;
                let text = lines[i + 1..=end].join(" ");
                let (_, rest) = text.split_once(" fn ").expect("a function");
                let (name, rest) = rest.split_once('(').expect("arguments");
                let (arguments, result) = rest.rsplit_once(')').expect("closed");
                let arguments: Vec<String> = arguments
                    .split(',')
                    .map(str::trim)
                    .filter(|a| !a.is_empty())
                    .map(declaration)
                    .collect();
                let arguments =
                    if arguments.is_empty() { "void".to_owned() } else { arguments.join(", ") };
                let result = result.trim().trim_end_matches('{').trim();
                let result = result.strip_prefix("-> ").map_or("void".to_owned(), c_type);
                let safety = comment.iter().position(|c| *c == "# Safety").unwrap_or(comment.len());
                describe(&mut calls, "", &comment[..safety]);
                writeln!(calls, "{result} {name}({arguments});").expect("to a string");
                comment.clear();
                i = end;
            } else if !line.trim().starts_with("//") && !line.trim().starts_with("#[") {
                comment.clear();
            }
            i += 1;
        }
    }
    out + "\n" + &calls + "\n#ifdef __cplusplus\n}\n#endif\n#endif\n"
}

fn describe(out: &mut String, indent: &str, comment: &[&str]) {
    if !comment.is_empty() {
        // Remove the brackets of links, but keep those of formulas.
        let text = comment.join(" ").replace("[`", "").replace("`]", "").replace('`', "");
        writeln!(out, "{indent}/* {text} */").expect("to a string");
    }
}

/// FNV-1a hash of the header, without its comments and the hash itself.
fn fingerprint(header: &str) -> u32 {
    let counts = |line: &&str| !line.trim_start().starts_with("/*") && !line.contains(" RTV_ABI ");
    let bytes = header.lines().filter(counts).flat_map(str::bytes);
    bytes.fold(2_166_136_261, |h: u32, b| (h ^ u32::from(b)).wrapping_mul(16_777_619))
}

#[test]
fn the_number_of_the_interface_follows_structures_and_calls_and_not_comments() {
    let header =
        "/* One. */\ntypedef struct A {\n  /* Two. */\n  double b;\n} A;\n#define RTV_ABI 7u\n";
    let same = header.replace("Two", "Three").replace("7u", "8u");
    assert_eq!(fingerprint(header), fingerprint(&same));
    assert_ne!(fingerprint(header), fingerprint(&header.replace("double", "float")));
}

#[test]
fn the_header_says_what_the_library_does() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let made = header(&[
        include_str!("../src/capi/types.rs"),
        include_str!("../src/capi/facts.rs"),
        include_str!("../src/capi/mod.rs"),
    ]);
    let path = folder.join("include/rtv.h");
    if std::env::var_os("RTV_WRITE_HEADER").is_some() {
        std::fs::write(&path, &made).expect("the header can be written");
    }
    let committed = std::fs::read_to_string(&path).expect("include/rtv.h is there");
    assert!(made == committed, "include/rtv.h is old; run this test with RTV_WRITE_HEADER=1");
    // A shim built for one version of the interface must not be used with another, so the number is
    // the hash of the interface.
    let number = fingerprint(&made);
    assert_eq!(
        vtk_bridge::capi::RTV_ABI,
        number,
        "the interface has changed: set RTV_ABI to {number}"
    );
    let python = std::fs::read_to_string(folder.join("python/rtvtk/library.py"))
        .expect("library.py is there");
    assert!(
        python.contains(&format!("\nABI = {number}\n")),
        "python/rtvtk/library.py needs ABI = {number}"
    );
    for expected in [
        "int32_t rtv_surface(RtvBridge* bridge, RtvSurface const* surface);",
        "  double world_from_data[16];",
        "#define RTV_COLOR_MAPPED 3u",
        "  int32_t (*render)(RtvBridge*, RtvView const*, RtvPicture*);",
    ] {
        assert!(made.contains(expected), "{expected} is missing in\n{made}");
    }
}
