//! Set-up and checks of the workspace, as one small program without dependencies.
//!
//! The steps are a list in [`plan`]; [`runner`] runs them and prints their cost; [`tools`] checks
//! the machine; [`test_programs`] runs the tests, of the packages in [`selection`]; [`peers`] finds
//! and installs the third-party software that some tests compare with; [`licences`] checks what we
//! link against; [`package`] checks what we publish; [`dist`] makes packages for machines without
//! Rust; [`systems`] runs tests on other releases of Debian; [`wheels`] makes and tests the Python
//! packages.

mod command;
mod dist;
mod licences;
mod main_job;
mod package;
mod peers;
mod plan;
mod runner;
mod selection;
mod side_by_side;
mod step;
mod systems;
mod test_programs;
mod tools;
mod wheels;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use step::Outcome;

const HELP: &str = "\
Set-up and checks of the workspace.

cargo xtask test [--require-peers] [--no-install] [--only NAME,...]
    Installs what is missing (see `setup`), then runs every check and every test.
    Without peers, the tests that need them print a note and pass; the summary lists what was not \
    run.
      --require-peers   a missing peer is an error, and no test may skip itself (what CI uses)
      --no-install      install nothing; use what is there
      --only NAME,...   run only these steps (names as in `ci-list`)

cargo xtask setup
    Installs the peers: Debian packages with apt-get (as root or through sudo), Python wheels in \
    target/peers/venv.
    Without permission to install, prints what it would install.

cargo xtask vtk [--release] [OPTIONS OF vtk-bridge install]
    Builds vtk-bridge from this checkout and installs it for the VTK and ParaView of this machine; \
    then
    `eval \"$(target/debug/vtk-bridge env --vtk)\"` (or --paraview) makes any script in this shell \
    ray traced.
      --release         build it optimised, into target/release
      --prefix FOLDER, --include FOLDER, --plugin    as of `vtk-bridge install`

cargo xtask dist [--profile NAME] [--out FOLDER]
    Makes a tarball and a Debian package of all programs, for machines without Rust.
      --profile NAME    build with this profile of cargo's instead of `release`
      --out FOLDER      put them there instead of into target/dist

cargo xtask wheels [--package NAME] [--profile NAME] [--out FOLDER]
    Makes the wheels and the source archives of the Python packages rt_core, schlieren and rtvtk, \
    installs the wheels in fresh environments of every Python of 3.10 or later here, and runs \
    their tests there.
      --package NAME    only rt_core, schlieren or rtvtk
      --profile NAME    build with this profile of cargo's instead of `release`
      --out FOLDER      put them there instead of into target/wheels/dist

cargo xtask systems [--suite NAME] [--paraview] [--record]
    Makes a small system of another release of Debian in target/systems (as root), and runs the \
    comparisons with stock programs there.
      --suite NAME      trixie (Debian 13, which CI tries) or forky (the next)
      --paraview        ParaView too: 1.8 GB more
      --record          write the result into the book's page on systems

cargo xtask book
    Updates the tables and plots of the book from the records in bench/runs.

cargo xtask ci-list
    Prints the steps and their commands without running them.

Exit status: 0 all passed, 1 a step failed, 2 the command line was wrong, 3 a required peer is \
missing.
";

/// A parsed command line.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Command {
    Help,
    Setup,
    Book,
    CiList,
    Dist(dist::DistOptions),
    Systems(systems::SystemsOptions),
    Wheels(wheels::WheelsOptions),
    Test(TestOptions),
    Vtk { release: bool, install: Vec<String> },
}

/// Options of `cargo xtask test`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct TestOptions {
    /// A missing peer is an error, and tests may not skip themselves.
    require_peers: bool,
    /// Whether missing peers may be installed.
    keep_machine: bool,
    /// Names of the steps to run; empty means all.
    only: Vec<String>,
}

/// Exit status; the only place where exit codes have numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Exit {
    Success = 0,
    StepFailed = 1,
    Usage = 2,
    PeerMissing = 3,
}

fn parse(args: &[String]) -> Result<Command, String> {
    let (command, rest) = match args.split_first() {
        None => return Ok(Command::Help),
        Some((c, rest)) => (c.as_str(), rest),
    };
    let no_options = |c: Command| match rest.first() {
        None => Ok(c),
        Some(extra) => Err(format!("`{command}` takes no options, but was given `{extra}`")),
    };
    match command {
        "help" | "--help" | "-h" => Ok(Command::Help),
        "setup" => no_options(Command::Setup),
        "book" => no_options(Command::Book),
        "ci-list" => no_options(Command::CiList),
        "systems" => systems::SystemsOptions::parse(rest).map(Command::Systems),
        "wheels" => wheels::WheelsOptions::parse(rest).map(Command::Wheels),
        "dist" => dist::DistOptions::parse(rest).map(Command::Dist),
        "test" => {
            let mut options = TestOptions::default();
            let mut rest = rest.iter();
            while let Some(arg) = rest.next() {
                match arg.as_str() {
                    "--require-peers" => options.require_peers = true,
                    "--no-install" => options.keep_machine = true,
                    "--only" => {
                        let names = rest
                            .next()
                            .ok_or("`--only` needs step names, as in `--only fmt,clippy`")?;
                        for name in names.split(',') {
                            if !plan::STEPS.iter().any(|s| s.name == name) {
                                let known: Vec<_> = plan::STEPS.iter().map(|s| s.name).collect();
                                return Err(format!(
                                    "`--only {name}`: no such step; there are {}",
                                    known.join(", ")
                                ));
                            }
                            options.only.push(name.to_owned());
                        }
                    }
                    other => {
                        return Err(format!(
                            "`test` does not know `{other}`; see `cargo xtask help`"
                        ));
                    }
                }
            }
            Ok(Command::Test(options))
        }
        "vtk" => Ok(Command::Vtk {
            release: rest.iter().any(|a| a == "--release"),
            install: rest.iter().filter(|a| *a != "--release").cloned().collect(),
        }),
        other => Err(format!(
            "no command `{other}`; there are test, setup, vtk, dist, wheels, systems, book, \
             ci-list and help"
        )),
    }
}

/// The root of the workspace: the folder above xtask.
fn workspace_root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("xtask lies inside the workspace")
        .to_owned()
}

/// The folder that the environment names for cargo to build in.
fn build_folder_named() -> Option<PathBuf> {
    std::env::var_os("CARGO_TARGET_DIR").map(PathBuf::from)
}

/// Builds vtk-bridge and runs its own installation; it handles its options and messages itself.
fn vtk(release: bool, install: &[String]) -> Exit {
    let mut args = vec!["--bin", "vtk-bridge"];
    args.extend(release.then_some("--release"));
    args.extend(["--", "install"]);
    args.extend(install.iter().map(String::as_str));
    run_member("vtk-bridge", &args)
}

/// `cargo run -p MEMBER ARGS` in the root of the workspace.
fn run_member(member: &str, args: &[&str]) -> Exit {
    let mut cargo =
        std::process::Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.current_dir(workspace_root()).args(["run", "--quiet", "-p", member]).args(args);
    match cargo.status() {
        Ok(status) if status.success() => Exit::Success,
        Ok(status) if status.code() == Some(2) => Exit::Usage,
        Ok(_) => Exit::StepFailed,
        Err(e) => {
            eprintln!("error: cargo could not be started: {e}");
            Exit::StepFailed
        }
    }
}

fn main() -> ExitCode {
    if let Some(cargo) = std::env::var_os(wheels::one_build::CARGO) {
        return wheels::one_build::run(&cargo, std::env::args_os().skip(1));
    }
    let args: Vec<String> = std::env::args().skip(1).collect();
    let exit = match parse(&args) {
        Err(message) => {
            eprintln!("error: {message}");
            Exit::Usage
        }
        Ok(Command::Help) => {
            print!("{HELP}");
            Exit::Success
        }
        Ok(Command::CiList) => {
            runner::list();
            Exit::Success
        }
        Ok(Command::Setup) => {
            let found = peers::set_up(&workspace_root(), peers::Install::Allowed);
            print!("{}", found.describe());
            if found.missing().is_empty() { Exit::Success } else { Exit::PeerMissing }
        }
        Ok(Command::Vtk { release, install }) => vtk(release, &install),
        Ok(Command::Book) => run_member("bench", &["--", "quote"]),
        Ok(Command::Dist(options)) => {
            let build = main_job::build_folder(&workspace_root(), build_folder_named());
            match dist::run(&workspace_root(), &build, &options) {
                Ok(()) => Exit::Success,
                Err(message) => {
                    eprintln!("error: {message}");
                    Exit::StepFailed
                }
            }
        }
        Ok(Command::Wheels(options)) => {
            let build = main_job::build_folder(&workspace_root(), build_folder_named());
            match wheels::run(&workspace_root(), &build, &options) {
                Ok(()) => Exit::Success,
                Err(message) => {
                    eprintln!("error: {message}");
                    Exit::StepFailed
                }
            }
        }
        Ok(Command::Systems(options)) => {
            let root = workspace_root();
            match systems::run(&systems::Place::of(&root, true), &options) {
                Outcome::Passed => Exit::Success,
                Outcome::NotRun(why) => {
                    println!("not run: {why}");
                    Exit::Success
                }
                Outcome::Failed(why) | Outcome::PeerMissing(why) => {
                    eprintln!("error: {why}");
                    Exit::StepFailed
                }
            }
        }
        Ok(Command::Test(options)) => runner::run(&workspace_root(), &options),
    };
    ExitCode::from(exit as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(line: &str) -> Result<Command, String> {
        parse(&line.split_whitespace().map(str::to_owned).collect::<Vec<_>>())
    }

    #[test]
    fn options_of_the_bridge_are_its_own() {
        let expected =
            Command::Vtk { release: true, install: vec!["--prefix".to_owned(), "/x".to_owned()] };
        assert_eq!(parsed("vtk --release --prefix /x"), Ok(expected));
        assert_eq!(parsed("vtk"), Ok(Command::Vtk { release: false, install: Vec::new() }));
    }

    #[test]
    fn options_of_test_are_read() {
        let options = TestOptions {
            require_peers: true,
            keep_machine: true,
            only: vec!["fmt".to_owned(), "clippy".to_owned()],
        };
        assert_eq!(
            parsed("test --require-peers --no-install --only fmt,clippy"),
            Ok(Command::Test(options))
        );
        assert_eq!(parsed("test"), Ok(Command::Test(TestOptions::default())));
        assert_eq!(parsed(""), Ok(Command::Help));
    }

    #[test]
    fn wrong_options_are_refused_with_the_cure() {
        for (line, cure) in [
            ("tset", "setup"),
            ("test --require-peer", "cargo xtask help"),
            ("test --only fmt,clipy", "clippy"),
            ("test --only", "--only fmt"),
            ("setup now", "takes no options"),
        ] {
            let message = parsed(line).expect_err(line);
            assert!(message.contains(cure), "{line}: {message}");
        }
    }

    #[test]
    fn the_workspace_root_has_the_product() {
        assert!(workspace_root().join("rt-core/Cargo.toml").is_file());
    }
}
