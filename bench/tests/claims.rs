//! Checks the claims of records, reports and notes: only measured results, and always with the
//! objections.

use bench::experiments::{self, Context};
use bench::machine::Machine;
use bench::record::{Record, Row};
use bench::report;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// A record from another time and machine, as its file would contain it.
fn record(machine: Value, ratios: Value) -> Record {
    let mut value =
        serde_json::to_value(Record::new("fig4.7", "Build time", 4, false, Machine::describe()))
            .expect("a record is JSON");
    for (key, v) in machine.as_object().expect("fields of the machine") {
        value["machine"][key] = v.clone();
    }
    if !machine.as_object().is_some_and(|m| m.contains_key("dirty")) {
        value["machine"]["dirty"] = Value::Null;
    }
    value["ratios"] = ratios;
    serde_json::from_value(value).expect("a record")
}

fn ratio(rounds: u32) -> Value {
    json!([{ "name": "ours", "rival": "theirs", "value": 3.0, "spread": 0.1, "low": 2.0, "high": 4.0, "rounds": rounds }])
}

#[test]
fn a_report_calls_nothing_faster_after_fewer_than_five_rounds() {
    let page = |rounds| report::page(&[record(json!({}), ratio(rounds))]);
    for rounds in 1..5 {
        assert!(!page(rounds).contains("n faster\""), "{rounds} rounds");
        assert!(page(rounds).contains("decide nothing"), "{rounds} rounds");
    }
    assert!(page(5).contains("n faster\""));
}

#[test]
fn a_report_shows_the_load_that_the_machine_had() {
    let machine =
        json!({ "load_1_min": 6.75, "cores": 2, "commit": "97db1462332d", "optimised": true });
    let page = report::page(&[record(machine, json!([]))]);
    assert!(page.contains("load 6.75 on 2 cores"), "{page}");
    // Above 0.75 per core, the load is marked as a doubt.
    assert!(page.contains("In doubt: the load"), "{page}");
    let machine =
        json!({ "load_1_min": 1.49, "cores": 2, "commit": "97db1462332d", "optimised": true });
    let page = report::page(&[record(machine, json!([]))]);
    assert!(page.contains("load 1.49 on 2 cores") && !page.contains("In doubt"), "{page}");
}

#[test]
fn a_report_shows_which_records_come_from_trees_with_uncommitted_changes() {
    // As older records without the field express it.
    let machine =
        json!({ "load_1_min": 0.1, "cores": 2, "commit": "53342d595e91+", "optimised": true });
    let page = report::page(&[record(machine, json!([]))]);
    assert!(page.contains("In doubt: ") && page.contains("uncommitted changes"), "{page}");
    let machine = json!({ "load_1_min": 0.1, "cores": 2, "commit": null, "optimised": true });
    let page = report::page(&[record(machine, json!([]))]);
    assert!(page.contains("In doubt: ") && page.contains("commit is not known"), "{page}");
}

/// The quick form of an experiment.
fn quick(id: &str) -> Record {
    let mut silent = |_: &str, _: Option<f64>| Ok(());
    let mut context = Context::new(true, None, &mut silent);
    experiments::run(experiments::find(id).expect(id), &mut context).expect(id).record
}

#[test]
fn the_dissertation_s_noise_stands_beside_differences_between_images() {
    let record = quick("fig5.14");
    for (filter, percent) in [("none", [7.75, 2.78, 0.91]), ("cone", [0.83, 2.55, 0.176])] {
        for (from, thesis) in [1.0, 10.0, 100.0].into_iter().zip(percent) {
            let of_thesis = |r: &&Row| r.number("thesis") == Some(thesis);
            let rows: Vec<&Row> = record.rows.iter().filter(of_thesis).collect();
            // Our results are in the same rows: independent and low-discrepancy photons.
            assert_eq!(rows.len(), 2, "{thesis} %");
            for r in rows {
                assert_eq!(r.text("filter"), Some(filter), "{r:?}");
                assert_eq!(r.number("samples"), Some(from), "{r:?}");
                assert_eq!(r.number("samples_more"), Some(10.0 * from), "{r:?}");
                assert!(r.number("difference").is_some_and(|d| d > 0.0), "{r:?}");
                assert!(
                    r.number("rms_error").is_none(),
                    "a difference is no error against a reference: {r:?}"
                );
            }
        }
    }
}

#[test]
fn settings_of_sampling_are_timed_in_turns() {
    let record = quick("accuracy-sampling");
    let rounds: Vec<Option<f64>> = record.rows.iter().map(|r| r.number("rounds")).collect();
    assert!(rounds.iter().all(|r| r.is_some_and(|r| r >= 1.0)), "{rounds:?}");
    // All settings of a quantity have the same rounds, because they alternate.
    for quantity in ["ambient occlusion", "soft shadow", "antialiasing"] {
        let of: Vec<f64> = record
            .rows
            .iter()
            .filter(|r| r.text("quantity") == Some(quantity))
            .filter_map(|r| r.number("rounds"))
            .collect();
        assert!(of.len() > 1 && of.windows(2).all(|w| w[0] == w[1]), "{quantity}: {of:?}");
    }
}

/// The experiments' Rust files, and those of the experiments that have a folder.
fn sources() -> Vec<(PathBuf, String)> {
    let entries = |folder: &Path| -> Vec<PathBuf> {
        let entries = std::fs::read_dir(folder).expect("experiments");
        entries.map(|e| e.expect("an entry").path()).collect()
    };
    let all = entries(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src/experiments"));
    let (folders, mut files): (Vec<_>, Vec<_>) = all.into_iter().partition(|p| p.is_dir());
    files.extend(folders.iter().flat_map(|folder| entries(folder)));
    files.retain(|p| p.extension().is_some_and(|e| e == "rs"));
    files.into_iter().map(|p| (p.clone(), std::fs::read_to_string(p).expect("source"))).collect()
}

/// A ratio that an experiment builds itself could bypass the rule of the verdict: it may only
/// rename a result of `Ratio::of_rounds`.
#[test]
fn ratios_are_formed_in_one_place() {
    for (path, text) in sources() {
        for (at, _) in text.match_indices("Ratio {").filter(|(at, _)| !text[..*at].ends_with("-> "))
        {
            let mut open = 0;
            let end = text[at..].find(|c| {
                open += i32::from(c == '{') - i32::from(c == '}');
                c == '}' && open == 0
            });
            let literal = &text[at..at + end.expect("braces are closed")];
            assert!(literal.contains(" .."), "{}: {literal}", path.display());
        }
    }
}

/// Records older than the checks of `--record` are kept, and the book states the objections to
/// them.
#[test]
fn the_book_names_every_record_in_doubt() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace");
    let book = std::fs::read_to_string(root.join("docs/src/bench/report.md")).expect("the chapter");
    let mut wanted = vec![];
    for folder in std::fs::read_dir(root.join("bench/runs")).expect("runs") {
        for r in bench::record::read_dir(&folder.expect("a folder").path()).expect("records") {
            let m = &r.machine;
            let mut why = vec![];
            match &m.commit {
                None => why.push("commit not known".to_string()),
                Some(_) if m.is_dirty() => why.push("uncommitted changes".into()),
                Some(_) => {}
            }
            let busy = |l: &f64| *l > bench::doubts::MOST_LOAD_PER_CORE * m.cores as f64;
            why.extend(m.load_1_min.filter(busy).map(|l| format!("load {l:.2}")));
            assert_eq!(why.is_empty(), r.doubts().is_empty(), "{}: {:?}", r.id, r.doubts());
            if !why.is_empty() {
                let commit = m.commit.as_deref().unwrap_or("–").trim_end_matches('+');
                wanted.push(format!(
                    "| {} | `{}` | {commit} | {} |",
                    m.day(),
                    r.id,
                    why.join(", ")
                ));
            }
        }
    }
    wanted.sort();
    let mut found: Vec<&str> = book.lines().filter(|l| l.starts_with("| 20")).collect();
    found.sort_unstable();
    let missing: Vec<&String> = wanted.iter().filter(|w| !found.contains(&w.as_str())).collect();
    let stale: Vec<&&str> = found.iter().filter(|f| !wanted.iter().any(|w| w == *f)).collect();
    assert!(
        missing.is_empty() && stale.is_empty(),
        "docs/src/bench/report.md: add {missing:#?}\ntake out {stale:#?}"
    );
}
