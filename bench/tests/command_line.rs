//! The program as started by a user: its output, its files, its exit codes.

use serde_json::Value;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn bench(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bench")).args(args).output().expect("the program starts")
}

fn bench_in(dir: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bench"))
        .current_dir(dir)
        .args(args)
        .output()
        .expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn list_as_json_names_id_chapter_and_title() {
    let out = bench(&["list", "--json"]);
    assert_eq!(out.status.code(), Some(0));
    let list: Value = serde_json::from_slice(&out.stdout).expect("JSON");
    let list = list.as_array().expect("an array");
    let ids: Vec<&str> = list.iter().map(|e| e["id"].as_str().unwrap()).collect();
    for id in ["fig4.7", "accuracy-build", "accuracy-robust", "peers"] {
        assert!(ids.contains(&id), "{id} is missing from {ids:?}");
    }
    assert!(list.iter().all(|e| e["chapter"].is_u64() && e["title"].is_string()));
}

#[test]
fn list_as_text_has_a_line_per_experiment() {
    let lines = text(&bench(&["list"]).stdout);
    assert!(lines.lines().any(|l| l.starts_with("fig4.7 ") && l.contains("chapter 4")), "{lines}");
}

#[test]
fn wrong_usage_ends_with_2_and_says_what_is_right() {
    let out = bench(&["run", "fig99.9"]);
    assert_eq!(out.status.code(), Some(2));
    let message = text(&out.stderr);
    assert!(message.contains("fig99.9") && message.contains("accuracy-robust"), "{message}");
    assert_eq!(bench(&["run"]).status.code(), Some(2));
    assert_eq!(bench(&["dance"]).status.code(), Some(2));
}

#[test]
fn report_without_records_ends_with_1_and_names_the_folder() {
    let dir = tempfile::tempdir().unwrap();
    let out = bench(&["report", dir.path().to_str().unwrap()]);
    assert_eq!(out.status.code(), Some(1));
    assert!(text(&out.stderr).contains(dir.path().to_str().unwrap()), "{}", text(&out.stderr));
}

#[test]
fn peers_are_found_or_explained() {
    let out = bench(&["peers", "--json"]);
    assert_eq!(out.status.code(), Some(0));
    let list: Value = serde_json::from_slice(&out.stdout).expect("JSON");
    for peer in list.as_array().unwrap() {
        let field = if peer["found"] == true { "version" } else { "reason" };
        assert!(peer[field].as_str().is_some_and(|s| !s.is_empty()), "{peer}");
    }
}

#[test]
fn a_run_prints_one_object_and_writes_record_table_and_report() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().to_str().unwrap();
    // A directory that `--record` accepts as the repository.
    let repository = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(repository.path().join("bench/src")).unwrap();
    std::fs::write(repository.path().join("bench/Cargo.toml"), "").unwrap();
    // Tests run on busy machines, in modified trees and in debug builds.
    let keep = "--record-despite-doubts";
    let args = ["run", "accuracy-robust", "--quick", "--json", "--quiet", keep, "--out", folder];
    let out = bench_in(&repository.path().join("bench/src"), &args);
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    assert!(out.stderr.is_empty(), "quiet means quiet: {}", text(&out.stderr));
    let record: Value = serde_json::from_slice(&out.stdout).expect("one JSON object");
    assert_eq!(record["id"], "accuracy-robust");
    assert!(record["machine"]["cpu"].is_string() && record["ratios"].is_array());

    let rows = record["rows"].as_array().unwrap();
    let watertight: Vec<&Value> = rows
        .iter()
        .filter(|r| r["tracer"] == "rt-core" && r["robustness"] == "watertight")
        .collect();
    assert!(watertight.len() >= 12, "meshes times aims, found {}", watertight.len());
    for r in watertight {
        assert_eq!(r["leaks"], 0, "{r}");
        assert!(
            r["rays"].as_u64().unwrap() > 100_000 && r["seconds"].as_f64().unwrap() > 0.0,
            "{r}"
        );
    }

    let file = |name: &str| std::fs::read_to_string(dir.path().join(name)).expect(name);
    let written: Value = serde_json::from_str(&file("accuracy-robust.json")).expect("JSON");
    assert_eq!(written["rows"], record["rows"], "what is printed is what is written");
    assert!(file("accuracy-robust.csv").lines().count() > rows.len());
    assert!(file("index.html").contains("id=\"accuracy-robust\""));

    // The objections are in the record and in the report; here at least that no commit is known.
    let despite = record["recorded_despite"].as_array().expect("what spoke against it");
    assert!(
        despite.iter().any(|d| d.as_str().unwrap().contains("commit is not known")),
        "{despite:?}"
    );
    assert!(file("index.html").contains("--record-despite-doubts"));
    assert!(file("accuracy-robust.csv").contains("# in doubt: the commit is not known"));

    remake_report(dir.path());
    check_kept(repository.path(), &record);
}

/// Checks what `--record` keeps: DATE-MACHINE with the record, and no paths of this machine.
fn check_kept(repository: &Path, record: &Value) {
    let entries = |p: &Path| -> Vec<std::path::PathBuf> {
        let mut found: Vec<_> = std::fs::read_dir(p).unwrap().map(|e| e.unwrap().path()).collect();
        found.sort();
        found
    };
    let runs = entries(&repository.join("bench/runs"));
    assert_eq!(runs.len(), 1, "{runs:?}");
    let name = runs[0].file_name().unwrap().to_str().unwrap();
    let day = &record["machine"]["date"].as_str().unwrap()[..10];
    let cores = format!("{}core-", record["machine"]["cores"]);
    assert!(name.strip_prefix(&format!("{day}-")).is_some_and(|m| m.starts_with(&cores)), "{name}");

    let files = entries(&runs[0]);
    let names: Vec<&str> = files.iter().map(|f| f.file_name().unwrap().to_str().unwrap()).collect();
    assert_eq!(names, ["accuracy-robust.csv", "accuracy-robust.json"]);
    let mut places =
        vec![repository.to_path_buf(), std::env::temp_dir(), env!("CARGO_MANIFEST_DIR").into()];
    places.extend(Path::new(env!("CARGO_BIN_EXE_bench")).parent().map(Path::to_path_buf));
    places.extend(std::env::var_os("HOME").map(Into::into));
    for file in &files {
        let text = std::fs::read_to_string(file).unwrap();
        for place in places.iter().map(|p| p.to_str().unwrap()).filter(|p| p.len() > 1) {
            assert!(!text.contains(place), "{} names {place}", file.display());
        }
    }
    let kept: Value = serde_json::from_str(&std::fs::read_to_string(&files[1]).unwrap()).unwrap();
    assert_eq!(&kept, record);
}

/// A repository with one commit that contains what `--record` looks for.
fn repository() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(dir.path().join("bench/runs")).unwrap();
    std::fs::write(dir.path().join("bench/Cargo.toml"), "").unwrap();
    for args in [&["init", "-q"][..], &["add", "."], &["commit", "-q", "-m", "first"]] {
        let mut git = Command::new("git");
        git.arg("-C").arg(dir.path()).args(["-c", "user.name=n", "-c", "user.email=e@example.org"]);
        assert!(git.args(args).status().is_ok_and(|s| s.success()), "git {args:?}");
    }
    dir
}

#[test]
fn a_tree_with_uncommitted_changes_is_not_recorded_and_nothing_is_measured() {
    let repository = repository();
    std::fs::write(repository.path().join("bench/Cargo.toml"), "# changed").unwrap();
    let reports = tempfile::tempdir().unwrap();
    let folder = reports.path().to_str().unwrap();
    let out = bench_in(
        repository.path(),
        &["run", "accuracy-robust", "--quick", "--record", "--out", folder],
    );
    let message = text(&out.stderr);
    assert_eq!(out.status.code(), Some(2), "{message}");
    assert!(
        message.contains("uncommitted changes") && message.contains("commit them"),
        "{message}"
    );
    assert!(message.contains("--record-despite-doubts"), "{message}");
    assert!(out.stdout.is_empty() && !reports.path().join("index.html").exists());
    assert_eq!(std::fs::read_dir(repository.path().join("bench/runs")).unwrap().count(), 0);
}

#[test]
fn record_outside_a_repository_ends_with_2_and_measures_nothing() {
    let nowhere = tempfile::tempdir().unwrap();
    let out = bench_in(nowhere.path(), &["run", "accuracy-robust", "--quick", "--record"]);
    assert_eq!(out.status.code(), Some(2));
    assert!(text(&out.stderr).contains("bench/runs"), "{}", text(&out.stderr));
}

#[test]
#[cfg(unix)]
fn ctrl_c_keeps_the_finished_images() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().to_str().unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_bench"))
        .args(["run", "pictures", "--quick", "--json", "-v", "--out", folder])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    // Without a terminal, steps are printed as lines.
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    lines
        .by_ref()
        .find(|l| l.as_ref().unwrap().contains("mixing-layer-outside: data"))
        .expect("steps are printed")
        .unwrap();
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    let rest: String = lines.map(|l| l.unwrap() + "\n").collect();
    let out = child.wait_with_output().unwrap();
    assert_eq!(out.status.code(), Some(130), "{rest}");
    assert!(rest.contains("finished results are kept"), "{rest}");

    let record: Value = serde_json::from_slice(&out.stdout).expect("one JSON object");
    let rows = record["rows"].as_array().unwrap();
    assert!(!rows.is_empty() && rows.len() < 7 && rows[0]["picture"] == "wavelet", "{rows:?}");
    assert!(record["missing"][0].as_str().unwrap().contains("interrupted"), "{record}");
    for file in ["pictures.json", "pictures.wavelet.png", "index.html"] {
        assert!(dir.path().join(file).exists(), "{file}");
    }
}

/// `bench report` makes the same page from the records alone.
fn remake_report(dir: &Path) {
    let page = dir.join("again.html");
    let out = bench(&["report", dir.to_str().unwrap(), "--out", page.to_str().unwrap()]);
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    assert_eq!(text(&out.stdout).trim(), page.to_str().unwrap());
    let read = |p: &Path| std::fs::read_to_string(p).unwrap();
    assert_eq!(read(&page), read(&dir.join("index.html")));
}
