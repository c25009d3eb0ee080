//! Starts this program as simulated ranks: SimGrid's `smpirun`, a generated platform, and the
//! program as a shared library.
//!
//! Computation is measured on this machine (CPU time of each rank), communication is simulated: a
//! non-blocking crossbar of nodes with one 4X QDR InfiniBand adapter each, 3.2 GB/s both ways, half
//! a microsecond per link. Those are the nodes of chapter 3 of the thesis.
use super::mpirun::outcome;
use datasets::cli::{CommonArgs, CureExt as _, Status, UsageError};
use std::ffi::OsString;
use std::fmt::Write as _;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::Command;

const LIBRARY: &str = "libcomposite_smpi.so";
/// The variable that names the shared library to use.
const LIBRARY_VARIABLE: &str = "COMPOSITE_SMPI_LIBRARY";

/// The caveat of every number from SMPI.
pub(super) const CAVEAT: &str = "simulated network (SimGrid SMPI): non-blocking crossbar, one 3.2 \
                                 GB/s 4X QDR adapter per node; \
     computing measured on this machine's cores; no noise of operating systems, no shared memory \
     inside nodes";

/// Whether this is a simulated rank.
pub(super) fn inside() -> bool {
    // smpirun exports it to the simulation (its documentation says that programs may use it).
    std::env::var_os("SMPI_GLOBAL_SIZE").is_some()
}

/// Runs `smpirun` and waits for it.
pub(super) fn start(
    common: CommonArgs,
    ranks: usize,
    arguments: &[OsString],
) -> anyhow::Result<Status> {
    let library = library(common)?;
    let folder = std::env::temp_dir().join(format!("composite-smpi-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let (platform, hosts) = (folder.join("platform.xml"), folder.join("hosts"));
    std::fs::write(&platform, platform_text(ranks))?;
    std::fs::write(&hosts, hosts_text(ranks))?;

    let mut command = Command::new("smpirun");
    command.args(["-np", &ranks.to_string()]);
    command.arg("-platform").arg(&platform).arg("-hostfile").arg(&hosts);
    command.args([
        // A second of computing here is a simulated second, and every microsecond counts.
        "--cfg=smpi/host-speed:1Gf",
        "--cfg=smpi/simulate-computation:yes",
        "--cfg=smpi/cpu-threshold:1e-7",
        // The default collectives are pathological from 96 ranks on (13 times slower).
        "--cfg=smpi/coll-selector:mpich",
        // Polling for messages and reading the clock cost no simulated time.
        "--cfg=smpi/test:0",
        "--cfg=smpi/wtime:0",
        "--log=root.thresh:error",
        "--log=no_loc",
    ]);
    command.arg(library).args(arguments);
    common.note(1, format_args!("starting {command:?}"));
    let status = command.status();
    let _ = std::fs::remove_dir_all(&folder);
    match status {
        Err(error) if error.kind() == ErrorKind::NotFound => Err(UsageError(
            "there is no program smpirun: install SimGrid (Debian: libsimgrid-dev)".to_string(),
        )
        .into()),
        other => Ok(outcome(other.cure("try `smpirun -version`")?)),
    }
}

fn platform_text(ranks: usize) -> String {
    format!(
        "<?xml version='1.0'?>\n<!DOCTYPE platform SYSTEM \"https://simgrid.org/simgrid.dtd\">\n\
         <platform version=\"4.1\">\n  <cluster id=\"nodes\" prefix=\"node-\" suffix=\"\" \
         radical=\"0-{}\" speed=\"1Gf\" \
         bw=\"3.2GBps\" lat=\"0.5us\" sharing_policy=\"SPLITDUPLEX\" loopback_bw=\"20GBps\" \
         loopback_lat=\"0.1us\"/>\n\
         </platform>\n",
        ranks - 1
    )
}

fn hosts_text(ranks: usize) -> String {
    (0..ranks).fold(String::new(), |mut text, rank| {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "node-{rank}");
        text
    })
}

/// Paths where cargo puts the library, relative to this program.
fn candidates(program: &Path) -> Vec<PathBuf> {
    let folder = program.parent().unwrap_or(Path::new("."));
    vec![folder.join("examples").join(LIBRARY), folder.join(LIBRARY)]
}

/// The program as a shared library: the named one, one next to this program, or one built now.
fn library(common: CommonArgs) -> anyhow::Result<PathBuf> {
    if let Some(named) = std::env::var_os(LIBRARY_VARIABLE) {
        return Ok(PathBuf::from(named));
    }
    let program = std::env::current_exe()?;
    // Built where there are sources: cargo itself knows whether it is up to date.
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
    let profile = program.parent();
    let target = profile.and_then(Path::parent);
    if let (true, Some(profile), Some(target)) = (manifest.is_file(), profile, target) {
        let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
        cargo.args(["build", "--quiet", "--example", "composite_smpi"]);
        cargo.arg("--manifest-path").arg(&manifest).arg("--target-dir").arg(target);
        if profile.ends_with("release") {
            cargo.arg("--release");
        }
        common.note(
            0,
            "building the program as a shared library for SimGrid, unless it is up to date",
        );
        if cargo.status().is_ok_and(|status| status.success()) {
            let built = candidates(&program).into_iter().find(|path| path.is_file());
            if let Some(built) = built {
                return Ok(built);
            }
        }
    }
    candidates(&program).into_iter().find(|path| path.is_file()).ok_or_else(|| {
        UsageError(format!(
            "the simulation needs this program as {LIBRARY}: \
             run `cargo build -p composite --example composite_smpi`, or name the file in \
             {LIBRARY_VARIABLE}"
        ))
        .into()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_platform_has_one_host_for_each_rank() {
        let platform = platform_text(128);
        assert!(
            platform.contains("radical=\"0-127\"") && platform.contains("bw=\"3.2GBps\""),
            "{platform}"
        );
        assert_eq!(hosts_text(3), "node-0\nnode-1\nnode-2\n");
    }
}
