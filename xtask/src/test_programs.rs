//! The step `tests`: runs the test programs of all members, as many at once as there are cores.
//!
//! `cargo test` runs them one after another. Many wait for other programs or have one long test, so
//! that two cores were busy for 60 % of the 1,280 s that this took.
//!
//! rt-core's unit tests are not among them: they are a second build of the whole member, eight
//! minutes of a core. The step `counters` runs them, less optimised.

use crate::main_job::build_folder;
use crate::selection::{OTHERS, WITHOUT_UNIT_TESTS};
use crate::side_by_side;
use crate::step::{Context, Outcome};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

/// Number of the slowest programs that are named at the end.
const SLOWEST: usize = 12;

/// A test program.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Program {
    /// The folder of its member, where cargo starts it.
    folder: PathBuf,
    file: PathBuf,
}

/// How a program ended.
struct Ended {
    name: String,
    passed: bool,
    secs: f64,
}

/// Builds and runs all test programs.
pub(crate) fn run(context: &Context<'_>) -> Outcome {
    let own = match integration_tests(context.root) {
        Ok(own) => own,
        Err(why) => return Outcome::Failed(why),
    };
    // Not --examples: it would turn examples into test harnesses, and tests need the example that
    // is a shared library.
    let kinds = ["--lib", "--bins", "--tests"];
    let others: Vec<&str> = OTHERS.iter().chain(&kinds).copied().collect();
    let mut programs = Vec::new();
    for selection in [others, own_selection(&own)] {
        match built(context, &selection) {
            Ok(some) => programs.extend(some),
            Err(why) => return Outcome::Failed(why),
        }
    }
    // Where two members have a test of one name, both selections have both.
    programs.sort_by(|a, b| (&a.folder, &a.file).cmp(&(&b.folder, &b.file)));
    programs.dedup();
    if programs.is_empty() {
        return Outcome::Failed("cargo names no test program".to_owned());
    }
    // The last members' tests wait for programs of others and take longest.
    programs.reverse();
    let at_once = side_by_side::at_once();
    println!("{} test programs, {at_once} at once", programs.len());
    let libraries = build_folder(context.root, crate::build_folder_named()).join("debug");
    let ended = run_all(&programs, at_once, |program| {
        let mut command = Command::new(&program.file);
        command.current_dir(&program.folder);
        command.env("CARGO_MANIFEST_DIR", &program.folder);
        command.env("LD_LIBRARY_PATH", library_path(&libraries));
        command.envs(context.peers.environment(context.options.require_peers));
        command
    });
    let mut slowest: Vec<&Ended> = ended.iter().collect();
    slowest.sort_by(|a, b| b.secs.total_cmp(&a.secs));
    println!("\nThe slowest test programs:");
    slowest.iter().take(SLOWEST).for_each(|e| println!("{:>8.1} s  {}", e.secs, e.name));
    let failed: Vec<&str> = ended.iter().filter(|e| !e.passed).map(|e| e.name.as_str()).collect();
    match failed.len() {
        0 => Outcome::Passed,
        n => Outcome::Failed(format!("{n} test programs: {}", failed.join(", "))),
    }
}

/// Builds all test programs, and the programs and the shared library that they run.
pub(crate) fn build(context: &Context<'_>) -> Outcome {
    let own = match integration_tests(context.root) {
        Ok(own) => own,
        Err(why) => return Outcome::Failed(why),
    };
    for selection in [OTHERS.to_vec(), own_selection(&own)] {
        let args = [&["test", "--no-run"], &selection[..]].concat();
        println!("cargo {}", args.join(" "));
        let outcome = context.cargo(&args, &[]);
        if outcome != Outcome::Passed {
            return outcome;
        }
    }
    Outcome::Passed
}

/// The names of rt-core's integration tests.
fn integration_tests(root: &Path) -> Result<Vec<String>, String> {
    let folder = root.join(WITHOUT_UNIT_TESTS).join("tests");
    let entries = std::fs::read_dir(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut names: Vec<String> = entries
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| {
            path.join("main.rs").is_file() || path.extension().is_some_and(|e| e == "rs")
        })
        .filter_map(|path| Some(path.file_stem()?.to_string_lossy().into_owned()))
        .collect();
    names.sort();
    Ok(names)
}

/// cargo's selection of these tests: with all members, for the features of the other selection.
fn own_selection(names: &[String]) -> Vec<&str> {
    let each = names.iter().flat_map(|name| ["--test", name]);
    ["--workspace"].into_iter().chain(each).collect()
}

/// Builds a selection, and returns its test programs.
fn built(context: &Context<'_>, selection: &[&str]) -> Result<Vec<Program>, String> {
    let args = [&["test", "--no-run", "--message-format=json"], selection].concat();
    println!("cargo {}", args.join(" "));
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.args(&args).current_dir(context.root).stderr(Stdio::inherit());
    cargo.envs(context.peers.environment(context.options.require_peers));
    let output = cargo.output().map_err(|e| format!("cargo does not start: {e}"))?;
    if !output.status.success() {
        return Err(format!("the tests do not build: {}", output.status));
    }
    Ok(programs(&String::from_utf8_lossy(&output.stdout)))
}

/// Where the loader looks for shared libraries: where cargo puts them, as for its own tests.
fn library_path(libraries: &Path) -> std::ffi::OsString {
    let before = std::env::var_os("LD_LIBRARY_PATH").unwrap_or_default();
    let own = [libraries.join("deps"), libraries.to_owned()];
    let all = own.into_iter().chain(std::env::split_paths(&before));
    // A folder with a colon cannot be named there, and then nothing is.
    std::env::join_paths(all).unwrap_or_default()
}

/// Runs programs, so many at once. What one prints comes in one piece.
fn run_all(
    programs: &[Program],
    at_once: usize,
    command: impl Fn(&Program) -> Command + Sync,
) -> Vec<Ended> {
    side_by_side::each(programs, at_once, |program| {
        let begun = Instant::now();
        let output = command(program).stdin(Stdio::null()).output();
        let secs = begun.elapsed().as_secs_f64();
        let name = name(program);
        let mut out = std::io::stdout().lock();
        let passed = match output {
            Ok(output) => {
                let _ = writeln!(out, "\n{name}: {}, {secs:.1} s", output.status);
                let _ = out.write_all(&output.stdout);
                let _ = out.write_all(&output.stderr);
                output.status.success()
            }
            Err(e) => {
                let _ = writeln!(out, "\n{name} does not start: {e}");
                false
            }
        };
        let _ = out.flush();
        Ended { name, passed, secs }
    })
}

/// The member and the program, as in `rt-core hard_cases`.
fn name(program: &Program) -> String {
    let file = program.file.file_name().unwrap_or_default().to_string_lossy();
    let of_test = file.rsplit_once('-').map_or(&*file, |(name, _)| name);
    let member = program.folder.file_name().unwrap_or_default().to_string_lossy();
    format!("{member} {of_test}")
}

/// The test programs that cargo's messages name.
fn programs(messages: &str) -> Vec<Program> {
    // A program's own target also says `test`: that it could be tested.
    let is_test = |line: &&str| {
        let profile = line.split_once("\"profile\":{").and_then(|(_, p)| p.split_once('}'));
        profile.is_some_and(|(profile, _)| profile.contains("\"test\":true"))
    };
    messages
        .lines()
        .filter(is_test)
        .filter_map(|line| {
            let folder = Path::new(&text_of(line, "manifest_path")?).parent()?.to_owned();
            Some(Program { folder, file: text_of(line, "executable")?.into() })
        })
        .collect()
}

/// The text of a key of a JSON object in a line, without its escapes but `\\` and `\"`; `None` if
/// the key is missing or null.
fn text_of(line: &str, key: &str) -> Option<String> {
    let rest = line.split_once(&format!("\"{key}\":\""))?.1;
    let mut text = String::new();
    let mut letters = rest.chars();
    loop {
        match letters.next()? {
            '"' => return Some(text),
            '\\' => text.push(letters.next()?),
            c => text.push(c),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Messages of cargo, with other quotes.
    const MESSAGES: &[&str] = &[
        "{'reason':'compiler-artifact','manifest_path':'/r/b/Cargo.toml','target':{'kind':\
         ['test'],'name':'far','test':true},'profile':{'opt_level':'0','test':true},'features':\
         [],'filenames':['/t/far-02'],'executable':'/t/far-02','fresh':true}",
        "{'reason':'compiler-artifact','manifest_path':'/r/a/Cargo.toml','target':{'name':'a',\
         'test':true},'profile':{'test':false},'features':[],'executable':'/t/a','fresh':true}",
        "{'reason':'compiler-artifact','manifest_path':'/r/a/Cargo.toml','target':{'name':'a'},\
         'profile':{'test':true},'features':[],'executable':'/t/o\\'k-01','fresh':true}",
        "{'reason':'build-finished','success':true}",
    ];

    #[test]
    fn test_programs_are_found_in_messages_of_cargo() {
        let messages = MESSAGES.join("\n").replace('\'', "\"");
        let found = programs(&messages);
        let of = |folder: &str, file: &str| Program { folder: folder.into(), file: file.into() };
        assert_eq!(found, [of("/r/b", "/t/far-02"), of("/r/a", "/t/o\"k-01")]);
        assert_eq!(name(&found[0]), "b far");
        assert_eq!(text_of(&messages, "no such key"), None);
    }

    #[test]
    fn rt_core_s_integration_tests_are_found_in_files_and_folders() {
        let names = integration_tests(&crate::workspace_root()).unwrap();
        let has = |name: &str| names.iter().any(|n| n == name);
        assert!(has("hard_cases") && has("frames") && !has("scenes_common"), "{names:?}");
        assert_eq!(own_selection(&names)[..2], ["--workspace", "--test"]);
    }

    #[test]
    fn all_programs_run_and_the_one_that_fails_is_named() {
        let of = |file: &str| Program { folder: "/r/a".into(), file: file.into() };
        let programs = [of("/t/good-1"), of("/t/bad-2"), of("/t/gone-3"), of("/t/good-4")];
        let ended = run_all(&programs, 2, |p| {
            let script = match name(p).as_str() {
                "a bad" => "exit 3",
                "a gone" => return Command::new("/no/such/program"),
                _ => "echo fine",
            };
            let mut shell = Command::new("sh");
            shell.args(["-c", script]);
            shell
        });
        let failed: Vec<&str> =
            ended.iter().filter(|e| !e.passed).map(|e| e.name.as_str()).collect();
        assert_eq!((ended.len(), failed), (4, vec!["a bad", "a gone"]));
    }
}
