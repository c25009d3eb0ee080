//! The module for Python (`ctypes`).

use crate::model::{Field, Item, Kind, array_of, is_function, wrapped};
use std::fmt::Write as _;

fn ctype(rust: &str, handles: &[&str]) -> String {
    if let Some((of, count)) = array_of(rust) {
        return format!("{} * {count}", ctype(of, handles));
    }
    if is_function(rust) {
        return "Release".to_owned();
    }
    let pointer = rust.strip_prefix("*const ").or_else(|| rust.strip_prefix("*mut "));
    match (pointer, rust) {
        (Some("c_char"), _) => "ctypes.c_char_p".to_owned(),
        (Some("c_void"), _) => "ctypes.c_void_p".to_owned(),
        (Some(to), _) if handles.contains(&to) => "ctypes.c_void_p".to_owned(),
        (Some(to), _) => format!("ctypes.POINTER({})", ctype(to, handles)),
        (None, "u32" | "RtsvCompositeStatus") => "ctypes.c_uint32".to_owned(),
        (None, "i32") => "ctypes.c_int32".to_owned(),
        (None, "u64") => "ctypes.c_uint64".to_owned(),
        (None, "i64") => "ctypes.c_int64".to_owned(),
        (None, "f32") => "ctypes.c_float".to_owned(),
        (None, "f64") => "ctypes.c_double".to_owned(),
        (None, ours) => short(ours).to_owned(),
    }
}

/// Names without what the module's own name says.
fn short(name: &str) -> &str {
    ["RtsvComposite", "RTSV_COMPOSITE_", "rtsv_composite_"]
        .iter()
        .find_map(|prefix| name.strip_prefix(prefix))
        .unwrap_or(name)
}

fn describe(out: &mut String, indent: &str, about: &str) {
    for line in wrapped(about, 96 - indent.len()) {
        writeln!(out, "{indent}# {line}").expect("to a string");
    }
}

fn list(fields: &[Field], handles: &[&str]) -> String {
    fields.iter().map(|f| ctype(&f.rust, handles)).collect::<Vec<_>>().join(", ")
}

/// The text of the module.
pub(crate) fn module(items: &[Item]) -> String {
    let handles: Vec<&str> =
        items.iter().filter(|i| matches!(i.kind, Kind::Handle)).map(|i| i.name.as_str()).collect();
    let mut out = String::from(
        "\"\"\"The interface of composite for Python: what rtsv_composite.h is for C, by ctypes.\n\n\
         Names have no prefix here: rtsv_composite_comm_free of C is comm_free. Calls raise Error\n\
         instead of returning a status, and structures know their size. The library is the file that\n\
         RTSV_COMPOSITE_LIBRARY names, else the one in ../lib beside this folder (an installation),\n\
         else the one that the dynamic linker finds.\n\n\
         Made from the Rust sources by tests/interface: do not edit.\n\"\"\"\n\n\
         import ctypes\nimport os\n\n\n\
         def _library_path():\n    \
         name = \"librtsv_composite.so.ABI\"\n    \
         here = os.path.dirname(os.path.realpath(__file__))\n    \
         installed = os.path.join(here, \"..\", \"lib\", name)\n    \
         named = os.environ.get(\"RTSV_COMPOSITE_LIBRARY\")\n    \
         return named or (installed if os.path.exists(installed) else name)\n\n\n\
         _library = ctypes.CDLL(_library_path())\n\
         Release = ctypes.CFUNCTYPE(None, ctypes.c_void_p)\n\n\n\
         class Error(RuntimeError):\n    \"\"\"A call that failed: its text, and its status.\"\"\"\n\n\
         \x20   def __init__(self, status):\n        super().__init__(last_error().decode())\n        \
         self.status = status\n\n\n\
         def _check(status, _function, _arguments):\n    if status != OK:\n        raise \
         Error(status)\n\n\n\
         class _Structure(ctypes.Structure):\n    def __init__(self, **members):\n        \
         super().__init__(**members)\n        if hasattr(self, \"struct_bytes\"):\n            \
         self.struct_bytes = ctypes.sizeof(self)\n\n\n",
    );
    let abi = items.iter().find(|i| i.name == "RTSV_COMPOSITE_ABI").map(|i| &i.kind);
    let Some(Kind::Constant(abi)) = abi else { panic!("the interface has no number") };
    out = out.replace("ABI\"\n", &format!("{abi}\"\n"));
    for Item { name, about, kind } in items {
        match kind {
            Kind::Constant(value) => {
                describe(&mut out, "", about);
                writeln!(out, "{} = {value}", short(name))
            }
            Kind::Structure(fields) => {
                writeln!(out, "\n\nclass {}(_Structure):", short(name)).expect("to a string");
                describe(&mut out, "    ", about);
                out += "    _fields_ = [\n";
                for field in fields {
                    describe(&mut out, "        ", &field.about);
                    let of = ctype(&field.rust, &handles);
                    writeln!(out, "        (\"{}\", {of}),", field.name).expect("to a string");
                }
                writeln!(out, "    ]\n")
            }
            Kind::Function { arguments, result } => {
                let call = short(name);
                out.push('\n');
                describe(&mut out, "", about);
                writeln!(out, "{call} = _library.{name}").expect("to a string");
                let types = list(arguments, &handles);
                let broken = wrapped(&types, 94).join("\n    ");
                writeln!(out, "{call}.argtypes = [\n    {broken}\n]").expect("to a string");
                if result == "RtsvCompositeStatus" {
                    writeln!(out, "{call}.errcheck = _check").expect("to a string");
                }
                writeln!(out, "{call}.restype = {}", ctype(result, &handles))
            }
            Kind::Alias(_) | Kind::Handle => Ok(()),
        }
        .expect("to a string");
    }
    out
}
