//! Limits of what safe code can do with the program's memory. Compiles the module for it alone,
//! with small stand-ins for the rest of the library, and checks that misuses do not compile.

use std::path::Path;
use std::process::Command;

const REST: &str = r#"
#![allow(dead_code)]
mod capture {
    pub(crate) mod draw {
        pub(crate) struct PackedArray {
            pub(crate) bytes: Vec<u8>,
            pub(crate) kind: u32,
            pub(crate) size: usize,
            pub(crate) normalized: bool,
        }
        pub(crate) fn component_bytes(_: u32) -> usize { 4 }
    }
    pub(crate) mod vertex_selection {
        pub(crate) enum VertexSelection { Range { first: usize, count: usize } }
        pub(crate) fn decode_indices(
            _: &[u8], _: usize, _: i32, _: Option<u32>,
        ) -> impl Iterator<Item = u32> {
            std::iter::empty()
        }
        impl VertexSelection {
            pub(crate) fn indexed(
                _: Vec<u32>, _: bool,
            ) -> Result<VertexSelection, &'static str> {
                Err("none")
            }
            pub(crate) fn several(
                _: Vec<u32>, _: Vec<usize>, _: bool, _: bool,
            ) -> Result<VertexSelection, &'static str> {
                Err("none")
            }
            pub(crate) fn span(&self) -> (usize, usize) {
                let VertexSelection::Range { first, count } = self;
                (*first, *count)
            }
        }
    }
}
#[path = ENUMS]
mod enums;
mod interpose {
    #[path = CLIENT_MEMORY]
    pub(crate) mod client_memory;
}
mod driver {
    pub(crate) mod gl {
        pub(crate) fn int(_: u32) -> i32 { 0 }
        pub(crate) fn word(_: u32) -> u32 { 0 }
        pub(crate) fn pointer(_: u32) -> usize { 0 }
        pub(crate) fn vertex_attrib_i<const N: usize>(_: u32, _: u32) -> [i32; N] { [0; N] }
        pub(crate) fn vertex_attrib_address(_: u32) -> usize { 0 }
        pub(crate) fn bind_buffer(_: u32, _: u32) {}
        pub(crate) fn buffer_i<const N: usize>(_: u32, _: u32) -> [i32; N] { [0; N] }
        pub(crate) fn buffer_bytes(_: u32, _: usize, n: usize) -> Vec<u8> { vec![0; n] }
    }
}
"#;

/// The compiler's message for safe code that uses the module; empty when it compiles.
fn said_of(code: &str) -> String {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("lib.rs");
    let path = |name: &str| format!("{:?}", sources.join(name));
    let rest = REST
        .replace("ENUMS", &path("enums.rs"))
        .replace("CLIENT_MEMORY", &path("interpose/client_memory.rs"));
    let safe = format!(
        "mod safe {{\n#![forbid(unsafe_code)]\nuse crate::interpose::client_memory::*;\nuse \
         std::borrow::Cow;\n{code}\n}}\n"
    );
    let text = rest + &safe;
    std::fs::write(&file, text).expect("written");
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let mut command = Command::new(rustc);
    command.args([
        "--edition",
        "2024",
        "--crate-type",
        "lib",
        "--emit",
        "metadata",
        "--cap-lints",
        "warn",
    ]);
    command.args(["-A", "warnings", "--out-dir"]).arg(folder.path()).arg(&file);
    let output = command.output().expect("the compiler starts");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.success(), said.is_empty(), "{said}");
    said
}

#[test]
fn safe_code_reads_what_a_call_names() {
    let said = said_of(
        "fn read(call: &ActiveCall<'_>, source: &ArraySource) -> Vec<u8> {
            let elements = Elements::of(call, None).unwrap();
            source.view(&elements).unwrap().into_owned()
        }",
    );
    assert_eq!(said, "", "the rest of the library is not what `REST` says");
}

#[test]
fn safe_code_cannot_read_an_address_of_its_own_or_longer_than_the_call_lasts() {
    let misuses = [
        ("E0133", "fn f() -> u8 { view(16, 4)[0] }"),
        ("E0133", "fn f() -> [f32; 4] { floats(16) }"),
        ("E0133", "fn f() -> [f64; 4] { doubles(16) }"),
        ("E0133", "fn f() -> [i32; 4] { ints(16) }"),
        ("E0133", "fn f() -> ActiveCall<'static> { ActiveCall::new(DrawArguments::Element(0)) }"),
        ("E0423", "fn f(layout: ArrayLayout) -> ArraySource { ArraySource(layout) }"),
        ("E0594", "fn f(mut source: ArraySource) { source.address = 16; }"),
        (
            "E0515",
            "fn f(call: ActiveCall<'_>, source: &ArraySource) -> Cow<'static, [u8]> {
                let elements = Elements::of(&call, None).unwrap();
                source.view(&elements).unwrap()
            }",
        ),
        (
            "E0505",
            "fn f(call: ActiveCall<'_>, source: &ArraySource) -> usize {
                let bytes = source.view(&Elements::of(&call, None).unwrap()).unwrap();
                drop(call);
                bytes.len()
            }",
        ),
    ];
    for (error, code) in misuses {
        let said = said_of(code);
        let errors = said.lines().filter(|l| l.starts_with("error[")).count();
        assert!(errors == 1 && said.contains(error), "{code}\n{said}");
    }
}
