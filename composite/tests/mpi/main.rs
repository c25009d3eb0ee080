//! The program over real transports: Open MPI, MPICH, SimGrid; IceT on the same ranks; and faults
//! that must end in bounded time.
//!
//! These are peers (CONTRIBUTING.md): a missing one skips its tests with a note, or fails them if
//! RTSV_REQUIRE_PEERS is set.

mod demo;
mod program;

use program::{BOUND, ProgramOutput, peer, run};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// `composite check` in groups of `counts` ranks, all in one launch of as many ranks as the largest
/// needs: every strategy, workload and size, with depth and blended. With `hard`, also the hard
/// cases.
fn check(
    counts: &[usize],
    hard: bool,
    more: &[&str],
    variables: &[(&str, &Path)],
    transport: &str,
) {
    let ranks = counts.iter().max().expect("a count").to_string();
    let list = counts.iter().map(ToString::to_string).collect::<Vec<_>>().join(",");
    let mut arguments = [&["check", "--json", "-n", &ranks, "--counts", &list], more].concat();
    arguments.extend(hard.then_some("--hard"));
    let ran = run(&arguments, variables);
    assert_eq!(ran.code, Some(0), "{arguments:?}: {}", ran.text);
    let checked: serde_json::Value =
        serde_json::from_str(ran.stdout.trim()).expect("one line of JSON");
    let number = |key: &str| checked[key].as_u64().unwrap_or_else(|| panic!("{key} in {checked}"));
    assert_eq!(checked["ranks"].to_string(), ranks);
    assert!(checked["transport"].as_str().is_some_and(|t| t.contains(transport)), "{checked}");
    // All processes of a launch share memory and merge each frame there; direct send is checked
    // with messages and in the order of ranks too. Groups of some of the ranks send messages.
    let besides = if arguments.contains(&"--mpi") { 48 } else { 0 };
    assert_eq!(
        (number("images"), number("images_differ")),
        (120 * counts.len() as u64 + besides, 0)
    );
    // Equal depths alone are composited a hundred or a thousand times for each number of ranks.
    assert_eq!(number("hard_images") > 100 * counts.len() as u64, hard, "{checked}");
    assert_eq!(number("hard_images_differ"), 0);
}

#[test]
fn threads_carry_every_strategy_and_the_hard_cases_to_the_bits_of_the_reference() {
    check(&[1, 2, 3, 4, 5, 6, 7, 8, 9], true, &["--threads"], &[], "threads");
    check(&[127], false, &["--threads"], &[], "threads");
}

#[test]
fn open_mpi_carries_every_strategy_to_the_bits_of_the_reference() {
    let Some(mpirun) = peer("RTSV_MPIRUN") else { return };
    check(&[2, 3, 4, 5, 8], false, &["--mpi"], &[("COMPOSITE_MPIRUN", &mpirun)], "Open MPI");
}

#[test]
fn open_mpi_carries_the_hard_cases_to_the_bits_of_the_reference() {
    let Some(mpirun) = peer("RTSV_MPIRUN") else { return };
    // Few ranks and repeats, because ranks share this machine's processors; between threads there
    // are a thousand.
    check(
        &[2, 3],
        true,
        &["--mpi", "--repeats", "100"],
        &[("COMPOSITE_MPIRUN", &mpirun)],
        "Open MPI",
    );
}

#[test]
fn mpich_carries_every_strategy_and_the_hard_cases_to_the_bits_of_the_reference() {
    let Some(mpirun) = peer("RTSV_MPIRUN_MPICH") else { return };
    check(&[2], true, &["--mpi"], &[("COMPOSITE_MPIRUN", &mpirun)], "MPICH");
}

#[test]
fn groups_of_an_mpi_job_work_at_once_on_communicators_of_their_own() {
    for (variable, transport) in [("RTSV_MPIRUN", "Open MPI"), ("RTSV_MPIRUN_MPICH", "MPICH")] {
        let Some(mpirun) = peer(variable) else { continue };
        // Four processes in groups of two, each of which checks everything.
        let arguments = ["check", "--json", "--mpi", "-n", "4", "--groups", "2"];
        let ran = run(&arguments, &[("COMPOSITE_MPIRUN", &mpirun)]);
        assert_eq!(ran.code, Some(0), "{}", ran.text);
        let checked: serde_json::Value =
            serde_json::from_str(ran.stdout.trim()).expect("one line of JSON, of the first group");
        assert_eq!(checked["ranks"].as_u64(), Some(2), "{checked}");
        assert_eq!(checked["images_differ"].as_u64(), Some(0), "{checked}");
        assert!(checked["images"].as_u64().is_some_and(|n| n >= 120), "{checked}");
        assert!(checked["transport"].as_str().is_some_and(|t| t.contains(transport)), "{checked}");
    }
}

#[test]
fn messages_cut_into_chunks_arrive_whole_and_in_order() {
    for (variable, ranks) in [("RTSV_MPIRUN", 3), ("RTSV_MPIRUN_MPICH", 2)] {
        let Some(mpirun) = peer(variable) else { continue };
        // Some of the lengths in `check` are multiples of this, some differ from one by a byte.
        let more = ["--mpi", "--chunk-bytes", "1000"];
        check(&[ranks], false, &more, &[("COMPOSITE_MPIRUN", &mpirun)], "");
    }
}

/// The shared library if cargo has built it with this test (`cargo test --workspace` does);
/// otherwise the program builds it.
pub(crate) fn simulated_program() -> Vec<(&'static str, PathBuf)> {
    let program = Path::new(env!("CARGO_BIN_EXE_composite"));
    let folder = program.parent().expect("a program is in a folder");
    let places =
        ["libcomposite_smpi.so", "examples/libcomposite_smpi.so"].map(|name| folder.join(name));
    places
        .into_iter()
        .find(|p| p.is_file())
        .map(|p| ("COMPOSITE_SMPI_LIBRARY", p))
        .into_iter()
        .collect()
}

#[test]
fn the_shared_library_for_smpirun_exports_main() {
    // `cargo test` builds it in the same folder as this test, but not if only this test is
    // selected.
    let Some((_, library)) = simulated_program().pop() else {
        eprintln!("SKIPPED: cargo has not made the example composite_smpi");
        return;
    };
    let bytes = std::fs::read(&library).unwrap_or_else(|e| panic!("{}: {e}", library.display()));
    assert!(bytes.starts_with(b"\x7fELF"));
    assert!(bytes.windows(6).any(|window| window == b"\0main\0"), "no symbol `main`");
}

#[test]
fn simulated_ranks_carry_every_strategy_to_the_bits_of_the_reference() {
    if peer("RTSV_SMPIRUN").is_none() {
        return;
    }
    let library = simulated_program();
    let variables: Vec<(&str, &Path)> =
        library.iter().map(|(name, path)| (*name, path.as_path())).collect();
    check(&[3], true, &["--smpi", "--repeats", "100"], &variables, "SMPI");
    check(&[16], false, &["--smpi"], &variables, "SMPI");
}

// ---- IceT ---------------------------------------------------------------------------------------
/// Runs `composite compare` and checks its output.
fn compare(more: &[&str], variables: &[(&str, &Path)]) {
    let arguments = [&["compare", "--json", "--size", "200", "--frames", "2"], more].concat();
    let ran = run(&arguments, variables);
    assert_eq!(ran.code, Some(0), "{arguments:?}: {}", ran.text);
    let all: serde_json::Value = serde_json::from_str(ran.stdout.trim()).expect("one line of JSON");
    assert!(all["machine"].is_object());
    let rows = all["rows"].as_array().expect("rows");
    let scenes: Vec<&str> = rows.iter().filter_map(|row| row["scene"].as_str()).collect();
    assert_eq!(scenes, ["discs", "dense", "frag"]);
    for row in rows {
        assert_eq!(row["pixels_differ"].as_u64(), Some(0), "{arguments:?}: {row}");
        let number = |key: &str| row[key].as_f64().unwrap_or_else(|| panic!("{key} in {row}"));
        assert!(
            (number("rival_ms") / number("ours_ms") - number("ratio")).abs()
                < 1e-9 * number("ratio")
        );
        assert!(
            ["bswap", "radix-k", "radix-kr", "tree"]
                .contains(&row["rival"].as_str().expect("rival"))
        );
        assert!(row["ranks"].is_u64());
    }
}

#[test]
fn icet_between_threads_gives_the_same_pixels() {
    let Some(icet) = peer("RTSV_ICET") else { return };
    for ranks in ["1", "3", "8"] {
        for pixels in ["depth", "depth-f16", "depth-f32", "blend"] {
            compare(&["--threads", "-n", ranks, "--pixels", pixels], &[("RTSV_ICET", &icet)]);
        }
    }
}

#[test]
fn icet_over_its_own_mpi_layer_gives_the_same_pixels() {
    let (Some(icet), Some(mpirun)) = (peer("RTSV_ICET"), peer("RTSV_MPIRUN")) else { return };
    for pixels in ["depth", "depth-f16", "depth-f32", "blend"] {
        let variables: [(&str, &Path); 2] = [("RTSV_ICET", &icet), ("COMPOSITE_MPIRUN", &mpirun)];
        compare(&["--mpi", "-n", "4", "--pixels", pixels], &variables);
    }
}

#[test]
fn open_mpi_in_shared_memory_and_by_messages_gives_the_same_pixels() {
    let (Some(icet), Some(mpirun)) = (peer("RTSV_ICET"), peer("RTSV_MPIRUN")) else { return };
    let variables: [(&str, &Path); 2] = [("RTSV_ICET", &icet), ("COMPOSITE_MPIRUN", &mpirun)];
    for (more, strategy) in
        [(&[][..], "SharedMemory"), (&["--messages", "--strategy", "direct"][..], "DirectSend")]
    {
        // Two numbers of ranks, sizes and formats give one table; in every row the pixels equal
        // those of IceT.
        let lists = [
            "compare",
            "--json",
            "--mpi",
            "--ranks",
            "2,3",
            "--size",
            "64,130",
            "--pixels",
            "depth,blend",
        ];
        let ran = run(
            &[&lists[..], &["--scene", "discs,dense", "--frames", "1"], more].concat(),
            &variables,
        );
        assert_eq!(ran.code, Some(0), "{}", ran.text);
        let all: serde_json::Value =
            serde_json::from_str(ran.stdout.trim()).expect("one line of JSON");
        let rows = all["rows"].as_array().expect("rows");
        assert_eq!(rows.len(), 16);
        for row in rows {
            assert_eq!(row["pixels_differ"].as_u64(), Some(0), "{row}");
            if cfg!(target_os = "linux") {
                assert_eq!(row["ours_strategy"].as_str(), Some(strategy), "{row}");
            }
        }
        let ranks: Vec<u64> = rows.iter().filter_map(|row| row["ranks"].as_u64()).collect();
        assert_eq!(ranks, [[2; 8], [3; 8]].concat());
    }
}

#[test]
fn icet_over_mpich_gives_the_same_pixels() {
    let (Some(icet), Some(mpirun)) = (peer("RTSV_ICET"), peer("RTSV_MPIRUN_MPICH")) else { return };
    compare(&["--mpi", "-n", "2"], &[("RTSV_ICET", &icet), ("COMPOSITE_MPIRUN", &mpirun)]);
}

#[test]
fn icet_on_simulated_ranks_gives_the_same_pixels() {
    let (Some(icet), Some(_)) = (peer("RTSV_ICET"), peer("RTSV_SMPIRUN")) else { return };
    let library = simulated_program();
    let mut variables: Vec<(&str, &Path)> =
        library.iter().map(|(name, path)| (*name, path.as_path())).collect();
    variables.push(("RTSV_ICET", &icet));
    compare(&["--smpi", "-n", "7"], &variables);
}

#[test]
fn without_icet_compare_says_so_and_ends_with_2() {
    let ran = run(&["compare", "--threads"], &[("RTSV_ICET", Path::new("no-such-library.so"))]);
    assert_eq!(ran.code, Some(2), "{}", ran.text);
    assert!(
        ran.text.contains("IceT was not found") && ran.text.contains("paraview"),
        "{}",
        ran.text
    );
}

#[test]
fn without_a_launcher_mpi_says_so_and_ends_with_2() {
    let ran = run(&["check", "--mpi"], &[("COMPOSITE_MPIRUN", Path::new("no-such-mpirun"))]);
    assert_eq!(ran.code, Some(2), "{}", ran.text);
    assert!(
        ran.text.contains("no-such-mpirun") && ran.text.contains("openmpi-bin"),
        "{}",
        ran.text
    );
}

// ---- Faults -------------------------------------------------------------------------------------
/// The error of fault `order` where ranks share memory. With messages, the tags tell a barrier from
/// an all-gather, and the wait ends with a timeout.
#[cfg(target_os = "linux")]
const OUT_OF_STEP: &[&str] = &["ranks 0, 1 came to an all-gather and rank 2 to a barrier"];
#[cfg(not(target_os = "linux"))]
const OUT_OF_STEP: &[&str] = &["from rank 2", "at a barrier in vain"];

/// The highest of three ranks fails; all must end without success, and the output must contain
/// `words`.
fn fault(kind: &str, words: &[&str], variables: &[(&str, &Path)], transport: &str) {
    let arguments = ["check", transport, "-n", "3", "--timeout", "2", "--fault", kind];
    let ran = run(&arguments, variables);
    assert_ne!(ran.code, Some(0), "{kind}: {}", ran.text);
    assert!(
        words.iter().any(|words| ran.text.contains(words)),
        "{kind}: none of {words:?} in\n{}",
        ran.text
    );
    assert!(ran.took < Duration::from_secs(60), "{kind} took {:?}", ran.took);
}

#[test]
fn faults_over_open_mpi_end_with_a_named_error_in_bounded_time() {
    let Some(mpirun) = peer("RTSV_MPIRUN") else { return };
    let variables: [(&str, &Path); 1] = [("COMPOSITE_MPIRUN", &mpirun)];
    // The launcher's message, or ours.
    fault("killed", &["signal 9", "Killed"], &variables, "--mpi");
    fault("stalled", &["message from rank 2", "rank 2 did not come"], &variables, "--mpi");
    fault(
        "panic",
        &["rank 2 ended the group: this rank panicked", "on purpose"],
        &variables,
        "--mpi",
    );
    fault("size", &["another size", "unusable message"], &variables, "--mpi");
    fault("order", OUT_OF_STEP, &variables, "--mpi");
    fault("leaves", &["rank 2 on", "had enough"], &variables, "--mpi");
    fault("corrupt", &["checksum", "unusable message from rank 2"], &variables, "--mpi");
}

#[test]
fn ranks_that_read_late_do_not_take_a_barrier_for_what_they_expect() {
    let Some(mpirun) = peer("RTSV_MPIRUN") else { return };
    // As on a busy machine: the others read the strings of an all-gather long after rank 2 has left
    // it.
    let late =
        ["check", "--mpi", "-n", "3", "--timeout", "5", "--linger-ms", "300", "--fault", "order"];
    let ran = run(&late, &[("COMPOSITE_MPIRUN", &mpirun)]);
    assert_ne!(ran.code, Some(0), "{}", ran.text);
    assert!(OUT_OF_STEP.iter().any(|words| ran.text.contains(words)), "{}", ran.text);
    assert!(!ran.text.contains("No such file"), "{}", ran.text);
}

/// The output of `check` for a job in which the highest rank works for three timeouts.
fn slow(transport: &str, variables: &[(&str, &Path)]) {
    let arguments = ["check", transport, "-n", "3", "--timeout", "2", "--fault", "slow", "--json"];
    let ran = run(&arguments, variables);
    assert_eq!(ran.code, Some(0), "{transport}: {}", ran.text);
    assert!(ran.took > Duration::from_secs(6), "{:?}", ran.took);
}

#[test]
fn a_rank_that_works_for_longer_than_the_timeout_and_says_so_is_waited_for() {
    slow("--threads", &[]);
    for variable in ["RTSV_MPIRUN", "RTSV_MPIRUN_MPICH"] {
        let Some(mpirun) = peer(variable) else { continue };
        slow("--mpi", &[("COMPOSITE_MPIRUN", &mpirun)]);
        // With messages, between machines: rank 0 waits for rank 1, which waits for rank 2.
        let ran =
            launched(&mpirun, &[], &["-n", "3"], &APART, &["--timeout", "2", "--fault", "slow"]);
        assert_eq!(ran.code, Some(0), "{}", ran.text);
        let stalled =
            launched(&mpirun, &[], &["-n", "3"], &APART, &["--timeout", "2", "--fault", "stalled"]);
        assert_ne!(stalled.code, Some(0), "{}", stalled.text);
        assert!(stalled.text.contains("rank 2"), "{}", stalled.text);
        assert!(stalled.took < Duration::from_secs(60), "{:?}", stalled.took);
    }
}

// ---- Machines -----------------------------------------------------------------------------------
/// Shell code that puts every rank on a machine of its own.
const APART: [&str; 1] = ["COMPOSITE_NODE=of-${OMPI_COMM_WORLD_RANK:-$PMI_RANK}"];

/// `composite check` started by a launcher with these arguments, each rank in a shell that sets
/// (`A=b`) or unsets (`-u A`) variables.
fn launched(
    mpirun: &Path,
    of_launcher: &[&str],
    count: &[&str],
    environment: &[&str],
    of_check: &[&str],
) -> ProgramOutput {
    let begin = Instant::now();
    let mut command = Command::new("timeout");
    command.args(["--kill-after=5", &BOUND.as_secs().to_string()]).arg(mpirun);
    command.args(of_launcher).args(count);
    let program = env!("CARGO_BIN_EXE_composite");
    let words = environment.join(" ");
    command.args([
        "sh",
        "-c",
        &format!("exec env {words} \"$0\" \"$@\""),
        program,
        "check",
        "--mpi",
        "--json",
    ]);
    command.args(of_check).stdin(Stdio::null()).env("RUST_BACKTRACE", "0");
    for (name, value) in [
        ("OMPI_MCA_btl", "self,vader"),
        ("OMPI_ALLOW_RUN_AS_ROOT", "1"),
        ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1"),
        ("OMPI_MCA_rmaps_base_oversubscribe", "1"),
        ("OMPI_MCA_mpi_yield_when_idle", "1"),
        ("OMPI_MCA_hwloc_base_binding_policy", "none"),
    ] {
        command.env(name, value);
    }
    let Output { status, stdout, stderr } = command.output().expect("coreutils' timeout runs");
    let stdout = String::from_utf8_lossy(&stdout).into_owned();
    let text = stdout.clone() + &String::from_utf8_lossy(&stderr);
    let took = begin.elapsed();
    assert!(took < BOUND, "{of_launcher:?} {environment:?} did not end:\n{text}");
    ProgramOutput { code: status.code(), stdout, text, took }
}

/// The number of machines that the ranks found and of images composited, all of which must be
/// correct.
fn nodes_and_images(ran: &ProgramOutput) -> (u64, u64) {
    assert_eq!(ran.code, Some(0), "{}", ran.text);
    let checked: serde_json::Value =
        serde_json::from_str(ran.stdout.trim()).expect("one line of JSON");
    assert_eq!(checked["images_differ"].as_u64(), Some(0), "{checked}");
    (checked["nodes"].as_u64().expect("nodes"), checked["images"].as_u64().expect("images"))
}

#[test]
fn ranks_of_one_machine_find_each_other_without_the_variables_of_their_launcher() {
    // Also by messages and in the order of ranks, where ranks of a machine share memory.
    let in_memory = if cfg!(target_os = "linux") { 48 } else { 0 };
    if let Some(mpirun) = peer("RTSV_MPIRUN") {
        let none =
            ["-u OMPI_COMM_WORLD_LOCAL_SIZE -u OMPI_COMM_WORLD_LOCAL_RANK -u OMPI_COMM_WORLD_RANK"];
        let none = [none[0], "-u OMPI_COMM_WORLD_SIZE COMPOSITE_MPI=openmpi"];
        let ran = launched(&mpirun, &[], &["-n", "3"], &none, &[]);
        assert_eq!(nodes_and_images(&ran), (1, 120 + in_memory));
    }
    if let Some(mpirun) = peer("RTSV_MPIRUN_MPICH") {
        let none = ["-u MPI_LOCALNRANKS -u MPI_LOCALRANKID COMPOSITE_MPI=mpich"];
        let ran = launched(&mpirun, &[], &["-n", "2"], &none, &[]);
        assert_eq!(nodes_and_images(&ran), (1, 120 + in_memory));
    }
}

#[test]
fn ranks_of_two_machines_do_not_believe_that_they_share_one() {
    // MPICH assumes two machines if they have two names.
    if let Some(mpirun) = peer("RTSV_MPIRUN_MPICH") {
        for environment in [&["-u MPI_LOCALNRANKS -u MPI_LOCALRANKID"][..], &[]] {
            let hosts = ["-launcher", "fork", "-hosts", "localhost:1,127.0.0.1:1"];
            let ran = launched(&mpirun, &hosts, &["-n", "2"], environment, &[]);
            assert_eq!(nodes_and_images(&ran), (2, 120), "{environment:?}");
        }
    }
    if let Some(mpirun) = peer("RTSV_MPIRUN") {
        // Two and one.
        let halves =
            ["-u OMPI_COMM_WORLD_LOCAL_SIZE COMPOSITE_NODE=of-$((OMPI_COMM_WORLD_RANK/2))"];
        let ran = launched(&mpirun, &[], &["-n", "3"], &halves, &[]);
        let in_memory = if cfg!(target_os = "linux") { 48 } else { 0 };
        assert_eq!(nodes_and_images(&ran), (2, 120 + in_memory));
    }
    if peer("RTSV_SMPIRUN").is_some() {
        let library = simulated_program();
        let variables: Vec<(&str, &Path)> =
            library.iter().map(|(name, path)| (*name, path.as_path())).collect();
        // Each simulated rank is on a host of its own.
        let ran = run(&["check", "--json", "--smpi", "-n", "5"], &variables);
        assert_eq!(nodes_and_images(&ran), (5, 120));
    }
}

#[test]
#[cfg(target_os = "linux")]
fn machines_with_several_ranks_merge_in_their_memories_first() {
    let (openmpi, mpich) =
        (("RTSV_MPIRUN", "OMPI_COMM_WORLD_RANK"), ("RTSV_MPIRUN_MPICH", "PMI_RANK"));
    // 12 images with depth and 12 blended ones are in the order of ranks. Of these, one or the
    // other is the first that needs more shared memory, and is sent; those in the order of their
    // scene may be merged by machines too.
    for ((variable, rank), count, machine, machines, least_merged) in [
        (openmpi, "8", "/2", 4, 18),
        (openmpi, "8", "/4", 2, 18),
        (mpich, "4", "/2", 2, 18),
        // Two and three: blending them by machines would change bits.
        (openmpi, "5", ">1", 2, 9),
        // In turns: neighbours in the orders of some scenes only.
        (openmpi, "4", "%2", 2, 0),
    ] {
        let Some(mpirun) = peer(variable) else { continue };
        let environment = format!("COMPOSITE_NODE=of-$(({rank}{machine}))");
        let hard = ["--hard", "--repeats", "10"];
        let ran = launched(&mpirun, &[], &["-n", count], &[&environment], &hard);
        let what = format!("{variable} {count} ranks {machine}: {}", ran.text);
        assert_eq!(nodes_and_images(&ran), (machines, 168), "{what}");
        let checked: serde_json::Value =
            serde_json::from_str(ran.stdout.trim()).expect("one line of JSON");
        let merged = checked["merged_by_machine"].as_u64().expect("a number");
        assert!(merged >= least_merged, "{what}");
        assert_eq!(checked["hard_images_differ"].as_u64(), Some(0), "{what}");
    }
}

#[test]
fn a_killed_and_a_stalled_rank_of_mpich_end_the_job() {
    let Some(mpirun) = peer("RTSV_MPIRUN_MPICH") else { return };
    let variables: [(&str, &Path); 1] = [("COMPOSITE_MPIRUN", &mpirun)];
    fault("killed", &["EXIT CODE: 9", "signal", "Killed"], &variables, "--mpi");
    fault("stalled", &["message from rank 2", "rank 2 did not come"], &variables, "--mpi");
    fault("corrupt", &["checksum", "unusable message from rank 2"], &variables, "--mpi");
}

#[test]
fn faults_between_threads_end_with_a_named_error_in_bounded_time() {
    fault("panic", &["rank 2 panicked: on purpose"], &[], "--threads");
    fault("size", &["another size", "unusable message"], &[], "--threads");
    fault("leaves", &["had enough"], &[], "--threads");
    fault("stalled", &["message from rank 2"], &[], "--threads");
    fault("corrupt", &["checksum", "unusable message from rank 2"], &[], "--threads");
}

// ---- The other commands -------------------------------------------------------------------------
#[test]
fn doctor_names_what_there_is_and_a_cure_for_what_is_not() {
    let ran = run(&["doctor"], &[("RTSV_ICET", Path::new("no-such-library.so"))]);
    assert_eq!(ran.code, Some(0), "{}", ran.text);
    for what in ["threads", "Open MPI", "MPICH", "SMPI", "IceT", "cure: for `composite compare`"] {
        assert!(ran.stdout.contains(what), "{what} in\n{}", ran.stdout);
    }
}
