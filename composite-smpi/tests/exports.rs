//! That the shared library is made at all, and is what `smpirun` looks for.

#[test]
fn the_library_exports_main_as_smpirun_wants() {
    let test = std::env::current_exe().expect("a test is a file");
    let folder = test.parent().expect("in a folder");
    let library = folder.join("libcomposite_smpi.so");
    let bytes = std::fs::read(&library).unwrap_or_else(|e| panic!("{}: {e}", library.display()));
    assert!(bytes.starts_with(b"\x7fELF"));
    assert!(bytes.windows(6).any(|window| window == b"\0main\0"), "no symbol `main`");
}
