//! Simulations that make pictures while they run: `examples/cpp/blast.cc` and
//! `examples/python/plume.py`. Their files have the bytes of one process on any number of ranks,
//! and a rank that falls silent ends the others with its name.

use crate::launch::{MPIS, Mpi, member, peer, scratch, text};

/// Cells, steps and pixels of each run: small, and with bricks of at least two cells a side.
const SIZE: [&str; 3] = ["14", "20", "48"];

/// The files that a run leaves, in the order of their names.
const FILES: [&str; 4] = ["10.schlieren", "10.volume", "20.schlieren", "20.volume"];

/// What a simulation writes on `ranks` ranks; `None` without the launcher.
fn files(mpi: &Mpi, name: &str, words: &[&str], ranks: usize) -> Option<Vec<Vec<u8>>> {
    let what = format!("{name} on {ranks} ranks of {}", mpi.name);
    let folder = scratch(&format!("{name}-{}-{ranks}", mpi.name));
    let out = folder.join("out").display().to_string();
    let output = mpi.run(ranks, &[words, &[&out], &SIZE].concat())?;
    assert!(output.status.success(), "{what}: {}", text(&output));
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains(" 0 copies of densities"), "{what}: {said}");
    let read = |end: &&str| {
        let path = format!("{out}-{end}");
        std::fs::read(&path).unwrap_or_else(|e| panic!("{what}: {path}: {e}"))
    };
    let files = FILES.iter().map(read).collect();
    std::fs::remove_dir_all(&folder).expect("the folder");
    Some(files)
}

/// The darkest and the brightest number of a file of floats.
fn range(file: &[u8]) -> [f32; 2] {
    let numbers = file.as_chunks().0.iter().map(|bytes| f32::from_ne_bytes(*bytes));
    numbers.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
}

fn assert_one_picture(name: &str, words: impl Fn(&Mpi) -> Option<Vec<String>>) {
    let mut all: Vec<Vec<Vec<u8>>> = Vec::new();
    for mpi in &MPIS {
        let Some(words) = words(mpi) else { continue };
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        for ranks in [1, 4, 16] {
            let Some(found) = files(mpi, name, &words, ranks) else { break };
            for (k, file) in FILES.iter().enumerate() {
                let same = all.first().is_none_or(|one| one[k] == found[k]);
                assert!(same, "{name}: {file} differs on {ranks} ranks of {}", mpi.name);
            }
            all.push(found);
        }
    }
    let Some([early, volume, late, _]) = all.first().map(|files| &files[..]).and_then(|f| {
        let [a, b, c, d] = f else { return None };
        Some([a, b, c, d])
    }) else {
        return;
    };
    // There is something to see, and it moves.
    let [low, high] = range(late);
    assert!(high - low > 0.08 && early != late, "{name}: {low} to {high}");
    let [low, high] = range(volume);
    assert!(low == 0.0 && high > 0.1, "{name}: {low} to {high}");
}

/// A rank that stalls before a photograph ends the job, and the others say who it was.
fn assert_named(mpi: &Mpi, name: &str, words: &[&str], variable: &str) {
    let folder = scratch(&format!("{name}-{}-stalled", mpi.name));
    let out = folder.join("out").display().to_string();
    let stalls = format!("{variable}=2");
    let words = [&["env", &stalls], words, &[&out], &SIZE].concat();
    let Some(output) = mpi.run(4, &words) else { return };
    let said = text(&output);
    assert!(!output.status.success() && said.contains("rank 2 did not come"), "{said}");
    std::fs::remove_dir_all(&folder).expect("the folder");
}

#[test]
fn a_simulation_in_c_plus_plus_makes_the_pictures_of_one_process() {
    assert_one_picture("blast", |mpi| {
        Some(vec![mpi.compile_cpp("examples/cpp/blast.cc")?.display().to_string()])
    });
}

#[test]
fn a_simulation_in_python_makes_the_pictures_of_one_process() {
    let script = member().join("examples/python/plume.py").display().to_string();
    assert_one_picture("plume", |_| {
        Some(vec![peer("RTSV_PYTHON")?.display().to_string(), script.clone()])
    });
}

#[test]
fn a_rank_of_a_simulation_that_stalls_is_named_by_the_others() {
    for mpi in &MPIS {
        if let Some(program) = mpi.compile_cpp("examples/cpp/blast.cc") {
            assert_named(mpi, "blast", &[&program.display().to_string()], "BLAST_STALL");
        }
    }
    if let Some(python) = peer("RTSV_PYTHON") {
        let script = member().join("examples/python/plume.py");
        let words = [python.display().to_string(), script.display().to_string()];
        assert_named(&MPIS[0], "plume", &[&words[0], &words[1]], "PLUME_STALL");
    }
}
