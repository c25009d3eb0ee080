//! Generates the interfaces for C, Fortran and Python from the Rust sources, and compares them with
//! the committed files. With `RTSV_WRITE_INTERFACE=1`, writes them.

mod c;
mod fortran;
mod model;
mod python;

use model::{Item, Kind};
use std::path::Path;

/// Hash of structures, constants and calls, without what is said of them. When it changes:
/// additions keep RTSV_COMPOSITE_ABI; whatever breaks programs raises it, in `types.rs` and
/// `build.rs`.
const INTERFACE: u32 = 1_099_333_392;

/// The interface, in the order of a program.
fn interface() -> Vec<Item> {
    let sources = [
        include_str!("../../src/capi/types.rs"),
        include_str!("../../src/capi/scene_types.rs"),
        include_str!("../../src/capi/light_types.rs"),
        include_str!("../../src/capi/status.rs"),
        include_str!("../../src/capi/group.rs"),
        include_str!("../../src/capi/compositing.rs"),
        include_str!("../../src/capi/scene.rs"),
        include_str!("../../src/capi/volumes.rs"),
        include_str!("../../src/capi/renderer.rs"),
        include_str!("../../src/capi/light.rs"),
    ];
    sources.iter().flat_map(|source| model::items(source)).collect()
}

/// FNV-1a of the header without its comments.
fn fingerprint(header: &str) -> u32 {
    let mut code = String::new();
    let mut rest = header;
    while let Some((before, comment)) = rest.split_once("/*") {
        code += before;
        rest = comment.split_once("*/").map_or("", |(_, behind)| behind);
    }
    code += rest;
    let bytes = code.bytes().filter(|b| !b.is_ascii_whitespace());
    bytes.fold(2_166_136_261, |h: u32, b| (h ^ u32::from(b)).wrapping_mul(16_777_619))
}

fn assert_committed(path: &str, made: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    if std::env::var_os("RTSV_WRITE_INTERFACE").is_some() {
        std::fs::write(&path, made).expect("the file can be written");
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    let path = path.display();
    assert!(made == committed, "{path} is old; run this test with RTSV_WRITE_INTERFACE=1");
    for (number, line) in made.lines().enumerate() {
        assert!(line.len() <= 100, "{path}:{}: {} bytes", number + 1, line.len());
    }
}

#[test]
fn the_files_for_c_fortran_and_python_say_what_the_library_does() {
    let items = interface();
    let header = c::header(&items);
    assert_committed("include/rtsv_composite.h", &header);
    assert_committed("include/rtsv_composite.f90", &fortran::module(&items));
    assert_committed("python/rtsv_composite.py", &python::module(&items));
    for expected in [
        "#define RTSV_COMPOSITE_ALPHA_F32 8u",
        "typedef struct RtsvCompositeComm RtsvCompositeComm;",
        "  void (*release)(void*);",
        "RtsvCompositeStatus rtsv_composite_comm_free(RtsvCompositeComm* comm);",
        "  double clip_from_world[16];",
    ] {
        assert!(header.contains(expected), "{expected} is missing in\n{header}");
    }
}

#[test]
fn a_change_of_the_interface_is_noticed() {
    let number = fingerprint(&c::header(&interface()));
    assert_eq!(number, INTERFACE, "the interface has changed: see INTERFACE, then set it");
    let build = include_str!("../../build.rs");
    let abi = rtsv_composite::RTSV_COMPOSITE_ABI;
    assert!(build.contains(&format!("const ABI: u32 = {abi};")), "build.rs has another number");
    let version = rtsv_composite::RTSV_COMPOSITE_VERSION.to_be_bytes();
    assert_eq!(format!("{}.{}.{}", version[1], version[2], version[3]), env!("CARGO_PKG_VERSION"));
    assert_eq!(fingerprint("a /* b */ c"), fingerprint("/* d */ac"));
    assert_ne!(fingerprint("float a;"), fingerprint("double a;"));
}

#[test]
fn layouts_are_those_of_the_library() {
    use rtsv_composite::*;
    let items = interface();
    macro_rules! check {
        ($($structure:ident),* $(,)?) => {{
            let all = [$((stringify!($structure), size_of::<$structure>())),*];
            for (name, bytes) in all {
                assert_eq!(model::layout(name, &items).0, bytes, "{name}");
            }
            all.len()
        }};
    }
    let checked = check!(
        RtsvCompositeOptions,
        RtsvCompositePlane,
        RtsvCompositeFrame,
        RtsvCompositeTile,
        RtsvCompositeImage,
        RtsvCompositeArray,
        RtsvCompositeMaterial,
        RtsvCompositeLight,
        RtsvCompositeSurroundings,
        RtsvCompositeMesh,
        RtsvCompositeSpheres,
        RtsvCompositeVolume,
        RtsvCompositeBrick,
        RtsvCompositeRenderOptions,
        RtsvCompositeView,
        RtsvCompositePicture,
        RtsvCompositeGas,
        RtsvCompositeShot,
        RtsvCompositePhotograph,
    );
    let structures = items.iter().filter(|i| matches!(i.kind, Kind::Structure(_))).count();
    assert_eq!(checked, structures, "every structure is checked");
}
