//! Conventions that all command-line programs of the workspace share.
//!
//! * Results go to stdout (as text, or as JSON with `--json`); progress, notes and errors go to
//!   stderr.
//! * Progress bars appear only on a terminal, and never with `--quiet`. They are hidden while other
//!   output is printed.
//! * Exit codes are those of [`Status`]: 0 done, 1 failed, 2 wrong usage, 130 interrupted.
//! * Ctrl-C asks the program to stop at the next safe point and keep its finished results. A second
//!   Ctrl-C ends it at once.
//! * A closed pipe (`program | head`) is success.
//! * Errors print the whole chain of causes and, where there is one, the cure ([`CureExt`]).
//!
//! ```
//! use clap::Parser;
//! use datasets::cli::{CommonArgs, Status, status_of};
//!
//! #[derive(Parser)]
//! struct Args {
//!     #[command(flatten)]
//!     common: CommonArgs,
//!     count: u32,
//! }
//! fn work(args: impl IntoIterator<Item = &'static str>) -> anyhow::Result<Status> {
//!     let args = Args::try_parse_from(args)?;
//!     args.common.result(&args.count, || format!("{} things", args.count))?;
//!     Ok(Status::Success)
//! }
//! // A program's main function is
//! // `fn main() -> ExitCode { run_main(|| work(std::env::args_os())) }`.
//! assert_eq!(status_of(work(["program", "--json", "3"])), Status::Success);
//! assert_eq!(status_of(work(["program", "three"])), Status::Usage);
//! ```

use anyhow::Context as _;
pub use indicatif::ProgressBar;
use indicatif::{ProgressDrawTarget, ProgressStyle, WeakProgressBar};
use std::fmt::{self, Display};
use std::io::{self, IsTerminal, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::Duration;

/// Exit status of a program; the number is its exit code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Status {
    /// The program did all its work.
    Success = 0,
    /// Part of the work failed; stderr says what.
    Failure = 1,
    /// The command line is invalid; nothing was done.
    Usage = 2,
    /// Ctrl-C stopped the program; finished results are kept.
    Interrupted = 130,
}

impl From<()> for Status {
    fn from((): ()) -> Self {
        Status::Success
    }
}

impl From<Status> for ExitCode {
    fn from(s: Status) -> Self {
        ExitCode::from(s as u8)
    }
}

/// Flags that every program has.
#[derive(Debug, Clone, Copy, Default, clap::Args)]
pub struct CommonArgs {
    /// No progress and no notes on stderr; warnings and errors remain.
    #[arg(long, short, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Results as JSON on stdout, one value per line.
    #[arg(long, global = true)]
    pub json: bool,
    /// More notes on stderr; twice for all.
    #[arg(long, short, global = true, action = clap::ArgAction::Count)]
    pub verbose: u8,
}

impl CommonArgs {
    /// Prints a result to stdout: `value` as a line of JSON with `--json`, otherwise the text.
    pub fn result<D: Display>(
        &self,
        value: &impl serde::Serialize,
        text: impl FnOnce() -> D,
    ) -> anyhow::Result<()> {
        let mut line = if self.json { serde_json::to_string(value)? } else { text().to_string() };
        line.push('\n');
        above_progress_bar(|| {
            let mut out = io::stdout().lock();
            out.write_all(line.as_bytes())?;
            out.flush()
        })?;
        Ok(())
    }

    /// Prints a note for the user. `level` 0 is shown unless `--quiet` is set, 1 with `-v`, 2 with
    /// `-vv`.
    pub fn note(&self, level: u8, text: impl Display) {
        if !self.quiet && self.verbose >= level {
            to_stderr(format_args!("{text}"));
        }
    }

    /// Prints a warning, even with `--quiet`.
    pub fn warn(&self, text: impl Display) {
        to_stderr(format_args!("warning: {text}"));
    }

    /// A progress bar on stderr over `total` steps of `what`; invisible with `--quiet` or when
    /// stderr is not a terminal ([`ProgressBar::is_hidden`]). Dropping the bar removes it from the
    /// screen. Use one at a time: notes, warnings and results are printed above the most recent
    /// one.
    pub fn progress(&self, total: u64, what: &str) -> ProgressBar {
        let visible = !self.quiet && io::stderr().is_terminal();
        let target =
            if visible { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let template = "{wide_bar} {percent:>3} % {elapsed} eta {eta}  {msg}";
        let style =
            ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
        let bar = ProgressBar::with_draw_target(Some(total), target).with_style(style);
        bar.set_message(what.to_string());
        let bar = bar.with_finish(indicatif::ProgressFinish::AndClear);
        if visible {
            // Keep the elapsed time running during long steps.
            bar.enable_steady_tick(Duration::from_millis(500));
            if let Ok(mut last) = VISIBLE_BAR.lock() {
                *last = Some(bar.downgrade());
            }
        }
        bar
    }
}

/// Runs a program: prints its error, if any, and turns the outcome into the exit code. Parse
/// arguments *inside* `work` with [`clap::Parser::try_parse`], so that usage errors are handled
/// here as well.
pub fn run_main<S: Into<Status>>(work: impl FnOnce() -> anyhow::Result<S>) -> ExitCode {
    status_of(work().map(Into::into)).into()
}

/// Does the work of [`run_main`] and returns the status.
pub fn status_of(outcome: anyhow::Result<Status>) -> Status {
    let error = match outcome {
        Ok(status) => return status,
        Err(error) => error,
    };
    if let Some(usage) = error.downcast_ref::<clap::Error>() {
        // `--help` and `--version` are also such errors; clap knows where to print them. A failure
        // to print cannot be reported anywhere.
        let _ = usage.print();
        return if usage.use_stderr() { Status::Usage } else { Status::Success };
    }
    let is_closed_pipe = |e: &(dyn std::error::Error + 'static)| {
        e.downcast_ref::<io::Error>().is_some_and(|e| e.kind() == io::ErrorKind::BrokenPipe)
    };
    if error.chain().any(is_closed_pipe) {
        return Status::Success;
    }
    if error.is::<Interrupted>() {
        to_stderr(format_args!("{error}"));
        return Status::Interrupted;
    }
    to_stderr(format_args!("{}", report(&error)));
    if error.is::<UsageError>() { Status::Usage } else { Status::Failure }
}

/// The text of an error: its chain of causes, then the cure.
pub fn report(error: &anyhow::Error) -> String {
    let cure = error.downcast_ref::<Cure>();
    let mut text = String::new();
    for message in error.chain().map(ToString::to_string) {
        if cure.is_some_and(|c| c.0 == message) {
            continue;
        }
        text += if text.is_empty() { "error: " } else { "\n  because: " };
        text += &message;
    }
    if let Some(cure) = cure {
        text += "\n  cure: ";
        text += &cure.0;
    }
    text
}

/// A command-line error that clap cannot detect: exit code 2.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct UsageError(pub String);

#[derive(Debug)]
struct Cure(String);

impl Display for Cure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Adds advice for the user to an error.
pub trait CureExt<T> {
    /// Adds `text`, which is printed after the error as its cure.
    fn cure(self, text: impl Display) -> anyhow::Result<T>;
}

impl<T, E> CureExt<T> for Result<T, E>
where
    Result<T, E>: anyhow::Context<T, E>,
{
    fn cure(self, text: impl Display) -> anyhow::Result<T> {
        anyhow::Context::with_context(self, || Cure(text.to_string()))
    }
}

/// Ctrl-C stopped the work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("interrupted; finished results are kept")]
pub struct Interrupted;

/// A flag that Ctrl-C, TERM and HUP set. Long work checks it where it can stop safely.
#[derive(Debug, Clone, Copy)]
pub struct Cancel(&'static Arc<AtomicBool>);

impl Cancel {
    /// Installs the Ctrl-C handler (once per process; later calls return the same flag). The second
    /// Ctrl-C ends the program.
    pub fn on_ctrl_c() -> anyhow::Result<Cancel> {
        static CANCELLED: OnceLock<Arc<AtomicBool>> = OnceLock::new();
        static INSTALLED: OnceLock<Result<(), String>> = OnceLock::new();
        let flag = CANCELLED.get_or_init(Arc::default);
        // A second Ctrl-C exits at once. No other place leaves without returning to the main
        // function.
        let handler = || {
            if flag.swap(true, Ordering::SeqCst) {
                std::process::exit(Status::Interrupted as i32);
            }
            to_stderr(format_args!(
                "stopping at the next good place; Ctrl-C again ends the program at once"
            ));
        };
        INSTALLED
            .get_or_init(|| ctrlc::set_handler(handler).map_err(|e| e.to_string()))
            .clone()
            .map_err(|e| anyhow::anyhow!("cannot install the Ctrl-C handler: {e}"))?;
        Ok(Cancel(flag))
    }

    /// Whether Ctrl-C was pressed or TERM received (as batch systems send it).
    pub fn is_set(self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// The flag itself, for libraries that take one.
    pub fn flag(self) -> &'static Arc<AtomicBool> {
        self.0
    }

    /// Returns [`Interrupted`] as an error after Ctrl-C, for use with `?`.
    pub fn check(self) -> Result<(), Interrupted> {
        if self.is_set() { Err(Interrupted) } else { Ok(()) }
    }
}

/// Arguments of the `completions` subcommand.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct CompletionsArgs {
    /// The shell to print a completion script for.
    pub shell: clap_complete::Shell,
}

impl CompletionsArgs {
    /// Prints the script for program `C` to stdout.
    pub fn print<C: clap::CommandFactory>(&self) -> anyhow::Result<()> {
        let mut command = C::command();
        let name = command.get_name().to_string();
        // Generate into memory first: the generator panics when it cannot write.
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut command, name, &mut script);
        io::stdout().lock().write_all(&script)?;
        Ok(())
    }
}

/// Arguments of the hidden `man` subcommand, which packages are made with.
#[derive(Debug, Clone, clap::Args)]
pub struct ManArgs {
    /// The folder, which exists. The pages are `PROGRAM.1` and `PROGRAM-SUBCOMMAND.1`.
    pub folder: PathBuf,
}

impl ManArgs {
    /// Writes the pages of program `C`. Errors name the folder.
    pub fn write<C: clap::CommandFactory>(&self) -> anyhow::Result<()> {
        clap_mangen::generate_to(C::command(), &self.folder)
            .with_context(|| format!("{}: cannot write manual pages", self.folder.display()))
            .cure("name a folder that exists and that you may write to")
    }
}

/// The progress bar that may be on the screen.
static VISIBLE_BAR: Mutex<Option<WeakProgressBar>> = Mutex::new(None);

/// Hides the progress bar while `print` runs.
fn above_progress_bar<T>(print: impl FnOnce() -> T) -> T {
    let bar = VISIBLE_BAR.lock().ok().and_then(|last| last.as_ref()?.upgrade());
    match bar {
        Some(bar) => bar.suspend(print),
        None => print(),
    }
}

/// Prints a line; a closed stderr is not an error.
fn to_stderr(line: fmt::Arguments<'_>) {
    let _ = above_progress_bar(|| writeln!(io::stderr().lock(), "{line}"));
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::{Context, anyhow};
    use clap::Parser;

    #[derive(Parser, Debug)]
    #[command(name = "prog", version)]
    struct Args {
        #[command(flatten)]
        common: CommonArgs,
    }

    fn failure<E: Into<anyhow::Error>>(e: E) -> anyhow::Result<Status> {
        Err(e.into())
    }

    #[test]
    fn exit_codes_are_0_1_2_130() {
        assert_eq!([Status::Success, Status::Failure, Status::Usage].map(|s| s as u8), [0, 1, 2]);
        assert_eq!(Status::Interrupted as u8, 130);
        assert_eq!(status_of(Ok(Status::Interrupted)), Status::Interrupted);
        assert_eq!(status_of(failure(anyhow!("no"))), Status::Failure);
        assert_eq!(
            status_of(failure(UsageError("width is 0; give at least 1".into()))),
            Status::Usage
        );
        assert_eq!(status_of(failure(Interrupted)), Status::Interrupted);
        let wrapped = Err(Interrupted).context("while rendering");
        assert_eq!(status_of(wrapped), Status::Interrupted);
    }

    #[test]
    fn help_and_version_are_success_and_wrong_flags_usage() {
        for (flag, status) in
            [("--help", Status::Success), ("-V", Status::Success), ("--wrong", Status::Usage)]
        {
            assert_eq!(
                status_of(failure(Args::try_parse_from(["prog", flag]).unwrap_err())),
                status,
                "{flag}"
            );
        }
        assert!(
            Args::try_parse_from(["prog", "-q", "-v"]).is_err(),
            "quiet and verbose contradict each other"
        );
        assert_eq!(Args::try_parse_from(["prog", "-vv"]).unwrap().common.verbose, 2);
    }

    #[test]
    fn broken_pipe_is_success_however_deep() {
        let pipe = || io::Error::from(io::ErrorKind::BrokenPipe);
        assert_eq!(status_of(failure(pipe())), Status::Success);
        assert_eq!(status_of(Err(pipe()).context("writing the table")), Status::Success);
        assert_eq!(status_of(failure(io::Error::from(io::ErrorKind::NotFound))), Status::Failure);
        let json: io::Error = serde_json::Error::io(pipe()).into();
        assert_eq!(status_of(failure(json)), Status::Success);
    }

    #[test]
    fn report_has_causes_in_order_and_the_cure_last() {
        let e = Err::<(), _>(io::Error::other("disk full"))
            .context("out.png: cannot write")
            .cure("free some space");
        let expected =
            "error: out.png: cannot write\n  because: disk full\n  cure: free some space";
        assert_eq!(report(&e.unwrap_err()), expected);
        let outer = Err::<(), _>(anyhow!("inner")).cure("do this").context("outer").unwrap_err();
        assert_eq!(report(&outer), "error: outer\n  because: inner\n  cure: do this");
    }

    #[test]
    fn progress_is_hidden_without_a_terminal_and_when_quiet() {
        assert!(CommonArgs { quiet: true, ..Default::default() }.progress(3, "tiles").is_hidden());
        if !io::stderr().is_terminal() {
            assert!(CommonArgs::default().progress(3, "tiles").is_hidden());
        }
    }

    #[test]
    fn manual_pages_are_written_and_a_missing_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        ManArgs { folder: folder.path().into() }.write::<Args>().unwrap();
        let page = std::fs::read_to_string(folder.path().join("prog.1")).unwrap();
        assert!(page.contains(".TH prog 1") && page.contains("quiet"), "{page}");
        let missing = folder.path().join("missing");
        let error = ManArgs { folder: missing.clone() }.write::<Args>().unwrap_err();
        assert!(report(&error).contains(missing.to_str().unwrap()), "{}", report(&error));
    }

    #[test]
    fn cancel_is_unset_until_ctrl_c_and_can_be_asked_for_twice() {
        let cancel = Cancel::on_ctrl_c().unwrap();
        assert!(Cancel::on_ctrl_c().is_ok());
        assert!(!cancel.is_set() && cancel.check().is_ok());
        cancel.flag().store(true, Ordering::Relaxed);
        assert_eq!(cancel.check(), Err(Interrupted));
        cancel.flag().store(false, Ordering::Relaxed);
    }
}
