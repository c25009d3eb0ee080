//! Starting this program again as the ranks of an MPI job.
use datasets::cli::{CommonArgs, CureExt as _, Status, UsageError};
use std::ffi::OsString;
use std::io::ErrorKind;
use std::process::{Command, ExitStatus};

/// The variable that names the launcher to use instead of `mpirun`.
pub(super) const LAUNCHER_VARIABLE: &str = "COMPOSITE_MPIRUN";

/// The launcher to use.
pub(super) fn launcher() -> OsString {
    std::env::var_os(LAUNCHER_VARIABLE)
        .filter(|name| !name.is_empty())
        .unwrap_or_else(|| "mpirun".into())
}

/// Whether this process runs as root, for which Open MPI requires two confirmations.
fn is_root() -> bool {
    use std::os::unix::fs::MetadataExt as _;
    std::fs::metadata("/proc/self").is_ok_and(|me| me.uid() == 0)
}

/// Settings that Open MPI needs in a container, and to run more ranks than there are processors
/// without waiting for whole time slices. Others ignore them.
pub(super) fn settings(ranks: usize) -> Vec<(&'static str, &'static str)> {
    let mut settings = vec![("OMPI_MCA_btl", "self,vader")];
    if is_root() {
        settings.extend([("OMPI_ALLOW_RUN_AS_ROOT", "1"), ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")]);
    }
    if ranks > std::thread::available_parallelism().map_or(1, usize::from) {
        settings.extend([
            ("OMPI_MCA_rmaps_base_oversubscribe", "1"),
            ("OMPI_MCA_mpi_yield_when_idle", "1"),
            ("OMPI_MCA_hwloc_base_binding_policy", "none"),
        ]);
    }
    settings.retain(|(name, _)| std::env::var_os(name).is_none());
    settings
}

/// Runs `mpirun -n RANKS this-program ARGUMENTS` and waits for it.
pub(super) fn start(
    common: CommonArgs,
    ranks: usize,
    arguments: &[OsString],
) -> anyhow::Result<Status> {
    let launcher = launcher();
    let name = launcher.display();
    let program = std::env::current_exe()?;
    let mut command = Command::new(&launcher);
    command.args(["-n", &ranks.to_string()]).arg(program).args(arguments).envs(settings(ranks));
    common.note(1, format_args!("starting {command:?}"));
    let status = match command.status() {
        Err(error) if error.kind() == ErrorKind::NotFound => {
            return Err(UsageError(format!(
                "there is no program {name}: install an MPI (Debian: openmpi-bin or mpich), \
                 or name its launcher in {LAUNCHER_VARIABLE}"
            ))
            .into());
        }
        other => other.cure(format_args!("try `{name} --version`"))?,
    };
    Ok(outcome(status))
}

/// A launcher exits with the code of the first rank that failed; any other code is a failure.
pub(super) fn outcome(status: ExitStatus) -> Status {
    match status.code() {
        Some(0) => Status::Success,
        Some(2) => Status::Usage,
        Some(130) => Status::Interrupted,
        _ => Status::Failure,
    }
}
