//! The program as its users start it: what it prints, what it writes, how it ends.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

fn bench(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bench")).args(args).output().expect("the program starts")
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
    let out = bench(&["run", "accuracy-robust", "--quick", "--json", "--quiet", "--out", folder]);
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    assert!(out.stderr.is_empty(), "quiet means quiet: {}", text(&out.stderr));
    let record: Value = serde_json::from_slice(&out.stdout).expect("one JSON object");
    assert_eq!(record["id"], "accuracy-robust");
    assert!(record["machine"]["cpu"].is_string() && record["ratios"].is_array());

    let rows = record["rows"].as_array().unwrap();
    let watertight: Vec<&Value> =
        rows.iter().filter(|r| r["tracer"] == "rt-core" && r["robustness"] == "watertight").collect();
    assert!(watertight.len() >= 12, "meshes times aims, found {}", watertight.len());
    for r in watertight {
        assert_eq!(r["leaks"], 0, "{r}");
        assert!(r["rays"].as_u64().unwrap() > 100_000 && r["seconds"].as_f64().unwrap() > 0.0, "{r}");
    }

    let file = |name: &str| std::fs::read_to_string(dir.path().join(name)).expect(name);
    let written: Value = serde_json::from_str(&file("accuracy-robust.json")).expect("JSON");
    assert_eq!(written["rows"], record["rows"], "what is printed is what is written");
    assert!(file("accuracy-robust.csv").lines().count() > rows.len());
    assert!(file("index.html").contains("id=\"accuracy-robust\""));

    remake_report(dir.path());
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
