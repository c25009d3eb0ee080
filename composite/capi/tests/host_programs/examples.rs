//! The examples write the bits of the Rust interface, on the whole job and in groups.

use crate::expected::{Images, images};
use crate::launch::{MPIS, Mpi, member, peer, scratch, text};
use std::path::Path;

/// Ranks and groups of each run.
const RUNS: [(usize, usize); 4] = [(4, 1), (8, 1), (4, 2), (8, 2)];

/// Runs an example with each number of ranks and groups, and compares its files.
fn assert_same(mpi: &Mpi, language: &str, words: &[&str]) {
    for (ranks, groups) in RUNS {
        let what = format!("{language} over {}, {ranks} ranks, {groups} groups", mpi.name);
        let folder = scratch(&format!("{language}-{}-{ranks}-{groups}", mpi.name));
        let out = folder.join("out").display().to_string();
        let Some(output) = mpi.run(ranks, &[words, &[&out, &groups.to_string()]].concat()) else {
            return;
        };
        assert!(output.status.success(), "{what}: {}", text(&output));
        let expected = images((ranks / groups) as u32);
        for group in 0..groups {
            let read = |end: &str| {
                let path = format!("{out}-{group}.{end}");
                std::fs::read(&path).unwrap_or_else(|e| panic!("{what}: {path}: {e}"))
            };
            let found =
                Images { depth: read("depth"), alpha: read("alpha"), picture: read("picture") };
            assert!(found.depth == expected.depth, "{what}: images with depth differ");
            assert!(found.alpha == expected.alpha, "{what}: blended images differ");
            assert!(found.picture == expected.picture, "{what}: pictures differ");
        }
        std::fs::remove_dir_all(&folder).expect("the folder");
    }
}

#[test]
fn shadows_and_all_ranks_are_in_the_images_that_programs_are_compared_with() {
    let (four, eight) = (images(4), images(8));
    assert!(four.depth != eight.depth && four.alpha != eight.alpha);
    let pixels: Vec<[f32; 4]> = four
        .picture
        .chunks_exact(16)
        .map(|p| [0, 4, 8, 12].map(|k| f32::from_ne_bytes(p[k..k + 4].try_into().expect("4"))))
        .collect();
    let grey = |level: f32| pixels.iter().filter(|p| **p == [level, level, level, 1.0]).count();
    // On the white ground, the ambient light alone.
    assert!(grey(0.25) > 500, "{} pixels are in shadow", grey(0.25));
    assert!(pixels.iter().filter(|p| p[3] == 1.0 && p[0] > 0.5).count() > 2000);
}

#[test]
fn the_example_in_c_writes_the_bits_of_rust() {
    for mpi in &MPIS {
        if let Some(program) = mpi.compile_c("examples/c/frame.c") {
            assert_same(mpi, "c", &[&program.display().to_string()]);
        }
    }
}

#[test]
fn the_example_in_fortran_writes_the_bits_of_rust() {
    for mpi in &MPIS {
        if let Some(program) = mpi.compile_fortran("examples/fortran/frame.f90") {
            assert_same(mpi, "fortran", &[&program.display().to_string()]);
        }
    }
}

#[test]
fn the_example_in_python_writes_the_bits_of_rust() {
    let Some(python) = peer("RTSV_PYTHON") else { return };
    let script = member().join("examples/python/frame.py");
    let word = |path: &Path| path.display().to_string();
    for mpi in &MPIS {
        assert_same(mpi, "python", &[&word(&python), &word(&script)]);
    }
}
