//! The header for C and C++.

use crate::model::{Field, Item, Kind, array_of, is_function, wrapped};
use std::fmt::Write as _;

fn c_type(rust: &str) -> String {
    for (prefix, suffix) in [("*const ", " const*"), ("*mut ", "*")] {
        if let Some(inner) = rust.strip_prefix(prefix) {
            return c_type(inner) + suffix;
        }
    }
    match rust {
        "u32" => "uint32_t",
        "i32" => "int32_t",
        "u64" => "uint64_t",
        "i64" => "int64_t",
        "f32" => "float",
        "f64" => "double",
        "c_char" => "char",
        "c_void" => "void",
        ours if ours.starts_with("RtsvComposite") => ours,
        other => panic!("no C for the Rust type `{other}`"),
    }
    .to_owned()
}

fn declaration(Field { name, rust, .. }: &Field) -> String {
    if let Some((of, count)) = array_of(rust) {
        return format!("{} {name}[{count}]", c_type(of));
    }
    if is_function(rust) {
        assert!(rust.contains("fn(*mut c_void)>"), "no C for `{rust}`");
        return format!("void (*{name})(void*)");
    }
    format!("{} {name}", c_type(rust))
}

fn describe(out: &mut String, indent: &str, about: &str) {
    let lines = wrapped(about, 94 - indent.len());
    let text = lines.join(&format!("\n{indent} * "));
    writeln!(out, "{indent}/* {text} */").expect("to a string");
}

/// The text of the header.
pub(crate) fn header(items: &[Item]) -> String {
    let mut out = String::from(
        "/* The C interface of composite: sort-last compositing, and rendering of scenes that no\n \
         * process has whole. Made from the Rust sources by tests/interface: do not edit.\n *\n \
         * Collective calls are made by all ranks of a group in the same order. If one fails with\n \
         * another status than RTSV_COMPOSITE_DISAGREE, the group has ended on all ranks. Handles\n \
         * belong to the thread that made them. Arrays are not kept after a call. */\n\
         #ifndef RTSV_COMPOSITE_H\n#define RTSV_COMPOSITE_H\n#include <stdint.h>\n\
         #ifdef __cplusplus\nextern \"C\" {\n#endif\n\n",
    );
    for Item { name, about, kind } in items {
        describe(&mut out, "", about);
        match kind {
            Kind::Constant(value) => writeln!(out, "#define {name} {value}u"),
            Kind::Alias(of) => writeln!(out, "typedef {} {name};", c_type(of)),
            Kind::Handle => writeln!(out, "typedef struct {name} {name};"),
            Kind::Structure(fields) => {
                writeln!(out, "typedef struct {name} {{").expect("to a string");
                for field in fields {
                    describe(&mut out, "  ", &field.about);
                    writeln!(out, "  {};", declaration(field)).expect("to a string");
                }
                writeln!(out, "}} {name};")
            }
            Kind::Function { arguments, result } => {
                let start = format!("{} {name}(", c_type(result));
                let arguments: Vec<String> = arguments.iter().map(declaration).collect();
                let one = match arguments.len() {
                    0 => format!("{start}void);"),
                    _ => format!("{start}{});", arguments.join(", ")),
                };
                match one.len() <= 100 {
                    true => writeln!(out, "{one}"),
                    false => writeln!(out, "{start}\n    {});", arguments.join(",\n    ")),
                }
            }
        }
        .expect("to a string");
    }
    out + "\n#ifdef __cplusplus\n}\n#endif\n#endif\n"
}
