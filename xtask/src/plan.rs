//! The steps of `cargo xtask test`, in order. To add, drop or change a check, edit this list.
//!
//! Cheap steps come first, so that a misplaced comma is reported after seconds rather than minutes.
//! All steps share one target directory and one set of features, so that nothing is compiled twice
//! without need. `clippy` and `api-docs` check; all others, including `main-job`, build with the
//! dev profile, whose members are optimised.

use crate::step::{Action, Step};
use crate::{licences, main_job, package, systems, test_programs, tools, wheels};

const fn cargo(args: &'static [&'static str]) -> Action {
    Action::Cargo { args, env: &[] }
}

/// The step that waits for the peers. Those before it run while these are being installed, which
/// mostly waits for the network and the disk.
pub(crate) const PEERS: &str = "peers";

/// The last step that all later ones wait for.
pub(crate) const TESTS: &str = "tests";

/// Steps that run beside the others that follow [`TESTS`], in this order: no step behind the tests
/// keeps two cores busy.
pub(crate) const BESIDE: &[&str] = &[WHEELS, "book-and-doc-tests", "counters", "api-docs"];

/// The main job measures the packages that the wheels install, so it waits for them.
pub(crate) const MAIN_JOB: &str = "main-job";
pub(crate) const WHEELS: &str = "wheels";

/// All steps, in execution order.
pub(crate) const STEPS: &[Step] = &[
    Step {
        name: "tools",
        tells: "the compiler is new enough; rustfmt and clippy are there",
        action: Action::Call(tools::check_tools),
    },
    Step {
        name: "fmt",
        tells: "every source file is formatted",
        action: cargo(&["fmt", "--all", "--", "--check"]),
    },
    Step {
        name: "fmt-xtask",
        tells: "so is this program",
        action: cargo(&["fmt", "--manifest-path", "xtask/Cargo.toml", "--", "--check"]),
    },
    Step {
        name: "xtask",
        tells: "this program passes its own tests",
        action: cargo(&["test", "--quiet", "--manifest-path", "xtask/Cargo.toml"]),
    },
    Step {
        name: "licences",
        tells: "every package we build with has a licence that deny.toml allows, and none is \
                banned",
        action: Action::Call(licences::check),
    },
    Step {
        name: "deny",
        tells: "cargo-deny agrees, also about sources, duplicates and other platforms; needs \
                cargo-deny",
        action: Action::Call(tools::cargo_deny),
    },
    Step {
        name: "package",
        tells: "every published member makes a package that has its licences, its README and all \
                files it includes",
        action: Action::Call(package::check),
    },
    Step {
        name: "clippy",
        tells: "no warnings, with all features, in tests, examples and benches too",
        action: cargo(&[
            "clippy",
            "--workspace",
            "--all-targets",
            "--all-features",
            "--",
            "-D",
            "warnings",
        ]),
    },
    Step {
        name: "compositor-alone",
        tells: "who embeds the compositor builds it without the renderer, the data sets and the \
                program",
        action: cargo(&[
            "clippy",
            "-p",
            "composite",
            "--lib",
            "--no-default-features",
            "--",
            "-D",
            "warnings",
        ]),
    },
    Step {
        name: "queries-alone",
        tells: "who embeds ray queries builds them without the renderer",
        action: cargo(&[
            "clippy",
            "-p",
            "rt-core",
            "--lib",
            "--no-default-features",
            "--",
            "-D",
            "warnings",
        ]),
    },
    Step {
        name: "clippy-xtask",
        tells: "nor in this program",
        action: cargo(&[
            "clippy",
            "--manifest-path",
            "xtask/Cargo.toml",
            "--all-targets",
            "--",
            "-D",
            "warnings",
        ]),
    },
    Step {
        name: PEERS,
        tells: "the software that tests compare with is installed",
        action: Action::Call(tools::report_peers),
    },
    Step {
        name: "build-tests",
        tells: "all tests compile, and so do the programs and the shared library (for SimGrid) \
                that they run",
        action: Action::Call(test_programs::build),
    },
    Step {
        name: TESTS,
        tells: "unit and integration tests of all members pass, with the peers that were found",
        action: Action::Call(test_programs::run),
    },
    Step {
        name: "book-and-doc-tests",
        tells: "the examples in the documentation and in the book compile and hold",
        action: cargo(&["test", "--workspace", "--no-fail-fast", "--doc"]),
    },
    Step {
        name: systems::STEP,
        tells: "the comparisons with stock VTK and OpenGL programs pass on the next release of \
                Debian too, where chroots are allowed",
        action: Action::Call(systems::check),
    },
    Step {
        name: WHEELS,
        tells: "the Python package installs in fresh environments with numpy alone, and passes its \
                tests and the examples of its documentation there",
        action: Action::Call(wheels::check),
    },
    Step {
        name: "counters",
        tells: "rt-core's unit tests pass, with the counters of the traversal loops compiled in",
        // All optimisations take longer than the tests.
        action: cargo(&[
            "test",
            "-p",
            "rt-core",
            "--features",
            "stats",
            "--lib",
            "--config",
            "profile.dev.package.rt-core.opt-level=1",
        ]),
    },
    Step {
        name: "api-docs",
        tells: "the documentation builds without broken links",
        action: Action::Cargo {
            args: &["doc", "--workspace", "--no-deps", "--all-features"],
            env: &[("RUSTDOCFLAGS", "-D warnings")],
        },
    },
    Step {
        name: MAIN_JOB,
        tells: "the main job, the quick form of every experiment, runs to its end",
        action: Action::Call(main_job::run),
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_main_job_runs_experiments_and_does_not_only_list_them() {
        let step = STEPS.iter().find(|s| s.name == MAIN_JOB).expect("main-job");
        assert!(matches!(step.action, Action::Call(_)), "{:?} measures nothing", step.action);
        assert!(
            main_job::ARGUMENTS.is_empty(),
            "without a command, bench runs the quick form of everything"
        );
    }

    #[test]
    fn what_runs_beside_the_installation_needs_no_peers() {
        let peers = STEPS.iter().position(|s| s.name == PEERS).expect("peers");
        let builds_only = ["fmt", "clippy", "check", "test --quiet --manifest-path xtask"];
        for step in &STEPS[..peers] {
            if let Action::Cargo { args, .. } = step.action {
                let line = args.join(" ");
                assert!(builds_only.iter().any(|b| line.starts_with(b)), "{}: {line}", step.name);
            }
        }
    }

    #[test]
    fn what_runs_beside_the_last_steps_comes_after_the_tests_and_does_not_wait() {
        let place = |name: &str| STEPS.iter().position(|s| s.name == name).expect("a step");
        assert!(BESIDE.iter().all(|name| place(name) > place(TESTS)));
        assert!(BESIDE.contains(&WHEELS) && !BESIDE.contains(&MAIN_JOB));
    }

    #[test]
    fn step_names_are_unique_words() {
        for (i, step) in STEPS.iter().enumerate() {
            assert!(step.name.chars().all(|c| c.is_ascii_lowercase() || c == '-'), "{}", step.name);
            assert!(STEPS[..i].iter().all(|other| other.name != step.name), "{} twice", step.name);
            assert!(!step.tells.is_empty(), "{} tells nothing", step.name);
        }
    }
}
