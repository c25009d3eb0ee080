//! One process that gives every call what it must refuse, alone and under valgrind; and the header
//! in a C++ program.

use crate::launch::{cc, compile, library, member, scratch, text};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Runs `tests/c/misuse.c`, prefixed by a command.
fn misuse(before: &[&str]) -> Output {
    let flags = ["-std=c11", "-pedantic", "-pthread"];
    let name = format!("misuse-{}", before.len());
    let program = compile(&cc(), &flags, &["tests/c/misuse.c"], &name);
    let words: Vec<PathBuf> = before.iter().map(PathBuf::from).chain([program]).collect();
    let mut command = Command::new(&words[0]);
    command.args(&words[1..]).env("RAYON_NUM_THREADS", "1");
    for variable in ["OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK", "COMPOSITE_MPI"] {
        command.env_remove(variable);
    }
    command.output().expect("it starts")
}

#[test]
fn every_call_answers_misuse_with_a_status_and_a_text() {
    let output = misuse(&[]);
    assert!(output.status.success() && output.stdout == b"done\n", "{}", text(&output));
    // No call is forgotten.
    let header =
        std::fs::read_to_string(member().join("include/rtsv_composite.h")).expect("it is there");
    let program = include_str!("../c/misuse.c");
    let called = |name: &str| program.contains(&format!("{name}("));
    let calls: Vec<&str> = header
        .split("rtsv_composite_")
        .skip(1)
        .filter_map(|rest| rest.split_once('(').map(|(name, _)| name))
        .filter(|name| name.chars().all(|c| c.is_ascii_lowercase() || c == '_'))
        .collect();
    assert!(calls.len() > 25, "{calls:?}");
    for name in calls {
        assert!(called(&format!("rtsv_composite_{name}")), "{name} is not called");
    }
}

#[test]
fn valgrind_finds_no_fault_in_misuse() {
    use std::io::Write as _;
    let valgrind = "/usr/bin/valgrind";
    if !Path::new(valgrind).exists() {
        assert!(std::env::var_os("RTSV_REQUIRE_PEERS").is_none(), "{valgrind} is missing");
        writeln!(std::io::stderr(), "skipped: {valgrind} is missing").expect("stderr");
        return;
    }
    let command = [valgrind, "--error-exitcode=9", "--quiet", "--leak-check=full"];
    let leaks = ["--show-leak-kinds=definite", "--errors-for-leak-kinds=definite"];
    let output = misuse(&[&command[..], &leaks].concat());
    assert!(output.status.success() && output.stdout == b"done\n", "{}", text(&output));
}

#[test]
fn the_header_is_c_plus_plus_too() {
    let source = scratch("cpp").join("header.cc");
    let program = "#include <rtsv_composite.h>\n#include <rtsv_composite.h>\nint main() {\n  \
                   RtsvCompositeComm* comm = nullptr;\n  if (rtsv_composite_comm_self(&comm)) \
                   return 1;\n  return static_cast<int>(rtsv_composite_comm_free(comm));\n}\n";
    std::fs::write(&source, program).expect("a source");
    let out = source.with_extension("");
    let mut command = Command::new("c++");
    command.args(["-std=c++11", "-pedantic", "-Wall", "-Wextra", "-Werror", "-o"]).arg(&out);
    command.arg(format!("-I{}", member().join("include").display())).arg(&source);
    command.arg(format!("-L{}", library().display())).arg("-lrtsv_composite");
    command.arg(format!("-Wl,-rpath,{}", library().display()));
    let made = command.output().expect("a compiler of C++");
    assert!(made.status.success(), "{}", text(&made));
    let ran = Command::new(&out).output().expect("it starts");
    assert!(ran.status.success(), "{}", text(&ran));
}
