//! Whether code for an instruction set is compiled for it.
//!
//! An operation on a vector is a function that only callers of the same instruction set can inline.
//! A closure that is compiled on its own, because it was handed to a function of a library or grew
//! too large, has no instruction set: it calls a function for each addition. The picture is the
//! same, and takes up to three times as long.
#![cfg(all(target_arch = "x86_64", target_os = "linux"))]

use rt_core::bvh::{BuildOptions, MeshF64, RayF64, WorldF64};
use rt_core::glam::DVec3;
use std::collections::BTreeMap;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

/// The name of the function around an operation of fearless_simd.
const OPERATION: &str = "::kernel::__fearless_simd_kernel>";
/// Those of the instruction sets that every processor has are inlined anywhere.
const EVERYWHERE: [&str; 2] = ["sse2::Sse2", "fallback::Fallback"];

/// The function that a line of disassembly begins.
fn function(line: &str) -> Option<&str> {
    line.strip_suffix(">:")?.split_once(" <").map(|(_, name)| name)
}

/// The operation that a line calls, or jumps to.
fn operation(line: &str) -> Option<&str> {
    let target = line.rsplit_once('\t').map_or(line, |(_, instruction)| instruction);
    let calls = target.starts_with("call") || target.starts_with("jmp");
    let (_, name) = target.split_once('<')?;
    (calls && name.ends_with(OPERATION)).then_some(name)
}

/// Whether a function is compiled for an instruction set: operations themselves, and what
/// `Simd::vectorize` calls.
fn has_instruction_set(function: &str) -> bool {
    function.contains("__fearless_simd_kernel") || function.contains("::vectorize_")
}

/// How many operations each function without an instruction set calls.
fn called_operations<'l>(lines: impl Iterator<Item = &'l str>) -> BTreeMap<String, usize> {
    let mut found = BTreeMap::new();
    let mut around = String::new();
    for line in lines {
        if let Some(name) = function(line) {
            around = name.to_owned();
        } else if !has_instruction_set(&around)
            && operation(line).is_some_and(|name| !EVERYWHERE.iter().any(|set| name.contains(set)))
        {
            *found.entry(around.clone()).or_default() += 1;
        }
    }
    found
}

/// Expects that no function of a program calls such an operation.
fn expect_inlined(program: &Path) {
    let mut child = Command::new("objdump")
        .args(["--disassemble", "--demangle", "--no-show-raw-insn"])
        .arg(program)
        .stdout(Stdio::piped())
        .spawn()
        .expect("objdump, which comes with the linker (binutils)");
    let output = BufReader::new(child.stdout.take().expect("it is piped"));
    // Only these lines matter; the rest is hundreds of megabytes.
    let lines: Vec<String> = output
        .lines()
        .map(|line| line.expect("names are text"))
        .filter(|line| function(line).is_some() || operation(line).is_some())
        .collect();
    assert!(child.wait().expect("it was started").success());
    let vectorized =
        lines.iter().filter_map(|l| function(l)).filter(|f| f.contains("::vectorize_"));
    assert!(vectorized.count() > 20, "{} has names of functions", program.display());
    let found = called_operations(lines.iter().map(String::as_str));
    assert!(
        found.is_empty(),
        "compiled without their instruction set: {found:#?}\nmark the closure #[inline(always)], \
         and the function that it is handed to, or write a function in its place"
    );
}

#[test]
fn no_vector_operation_of_bench_is_called_as_a_function() {
    expect_inlined(Path::new(env!("CARGO_BIN_EXE_bench")));
}

#[test]
fn no_vector_operation_of_worlds_in_f64_is_called_as_a_function() {
    // Bench does not link them, but this program does.
    let mesh = MeshF64::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y], vec![[0, 1, 2]]);
    let world = WorldF64::from_mesh(mesh, &BuildOptions::default()).expect("a sound mesh");
    let ray = RayF64::new(DVec3::new(0.2, 0.2, 3.0), DVec3::NEG_Z);
    let (mut hits, mut blocked) = ([None], [false]);
    world.closest_of_rays(&[ray], &mut hits).expect("as many hits as rays");
    world.occluded_of_rays(&[ray], &mut blocked).expect("as many answers as rays");
    assert!(hits[0].is_some_and(|hit| hit.t == 3.0) && blocked[0]);
    expect_inlined(&std::env::current_exe().expect("this program has a path"));
}

#[test]
fn calls_are_told_from_code_of_their_instruction_set() {
    let kernel =
        "fearless_simd::generated::avx2::Avx2 as Simd>::mul_f32x8::kernel::__fearless_simd_kernel";
    let basic = kernel.replace("avx2::Avx2", "sse2::Sse2");
    let call = |name: &str| format!("   1234:\tcall   5678 <<{name}>");
    let text = [
        "0000000000001000 <<Avx2 as Simd>::vectorize::vectorize_avx2>:".to_owned(),
        call(kernel),
        "0000000000002000 <rt_core::march::{{closure}}>:".to_owned(),
        call(kernel),
        call(kernel).replace("call", "jmp"),
        call(&basic),
        "   2345:\tlea    0x0(%rip),%rax        # 5678 <<kernel::__fearless_simd_kernel>"
            .to_owned(),
    ];
    let found = called_operations(text.iter().map(String::as_str));
    assert_eq!(found.into_iter().collect::<Vec<_>>(), [("rt_core::march::{{closure}}".into(), 2)]);
}
