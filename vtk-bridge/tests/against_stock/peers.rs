//! The programs that the bridge is compared with, found through the variables of `cargo xtask test`
//! or in their usual places.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// A program or folder from its variable, or the first of `places` that exists.
pub(crate) fn find(variable: &str, places: &[&str]) -> Option<PathBuf> {
    let from_variable = std::env::var_os(variable).map(PathBuf::from);
    from_variable.into_iter().chain(places.iter().map(PathBuf::from)).find(|p| p.exists())
}

/// Reports that a test is skipped and why; with `RTSV_REQUIRE_PEERS=1` it fails instead.
pub(crate) fn skip(reason: &str) {
    assert!(std::env::var_os("RTSV_REQUIRE_PEERS").is_none_or(|v| v != "1"), "{reason}");
    // Not `eprintln!`, because libtest captures it in passing tests.
    let _ = writeln!(std::io::stderr(), "skipped: {reason}");
}

/// Debian's VTK with its headers: on Debian 12 VTK 9.1, unpacked outside the system folders because
/// it conflicts with ParaView's Python packages; `/` where it is installed.
pub(crate) fn vtk91() -> Option<PathBuf> {
    let root = find("RTSV_VTK91", &[])
        .or_else(|| std::env::var_os("RTSV_PEERS").map(|p| PathBuf::from(p).join("vtk91")))?;
    root.join("usr/lib/python3/dist-packages/vtkmodules").is_dir().then_some(root)
}

/// The headers of the VTK in `root`, of whatever version.
pub(crate) fn vtk_headers(root: &Path) -> Option<PathBuf> {
    headers(&root.join("usr/include"), "vtk-")
}

/// The headers of Debian's ParaView with a VTK of its own, which the plugin is compiled with.
pub(crate) fn paraview_headers() -> Option<PathBuf> {
    headers(Path::new("/usr/include"), "paraview-")
}

/// The folder in `include` whose name starts with `prefix` and that has VTK's own headers.
fn headers(include: &Path, prefix: &str) -> Option<PathBuf> {
    let entries = std::fs::read_dir(include).ok()?.filter_map(|e| Some(e.ok()?.path()));
    let named =
        entries.filter(|p| p.file_name().is_some_and(|n| n.to_string_lossy().starts_with(prefix)));
    named.filter(|p| p.join("vtkObjectFactory.h").is_file()).max()
}

/// ParaView's batch program.
pub(crate) fn pvbatch() -> Option<PathBuf> {
    find("RTSV_PVBATCH", &["/usr/bin/pvbatch"])
}

/// Open MPI's launcher; Debian's ParaView is built with Open MPI.
pub(crate) fn mpirun() -> Option<PathBuf> {
    find("RTSV_MPIRUN", &["/usr/bin/mpirun.openmpi"])
}

/// Our own X server, or why there is none. It ends when this process ends for any reason: a shell
/// waits for the end of its input, which this process holds, and then stops the server.
pub(crate) fn display() -> Result<&'static str, String> {
    static DISPLAY: OnceLock<Result<(String, std::process::Child), String>> = OnceLock::new();
    let started = DISPLAY.get_or_init(|| {
        let program = find("RTSV_XVFB", &["/usr/bin/Xvfb"]).ok_or("Xvfb was not found (set \
                                                                   RTSV_XVFB)")?;
        // -noreset: otherwise the server resets when its last client leaves, which breaks the next
        // client.
        let script = r#""$0" -displayfd 1 -noreset -nolisten tcp -screen 0 1280x1024x24 2>/dev/null & cat >/dev/null; kill $!"#;
        let mut child = Command::new("sh")
            .args(["-c", script])
            .arg(&program)
            .stdin(std::process::Stdio::piped())
            .stdout(std::process::Stdio::piped())
            .spawn()
            .map_err(|e| format!("sh: {e}"))?;
        let mut number = String::new();
        let stdout = child.stdout.as_mut().ok_or("no stdout")?;
        std::io::BufRead::read_line(&mut std::io::BufReader::new(stdout), &mut number)
            .map_err(|e| e.to_string())?;
        match number.trim().parse::<u32>() {
            Ok(n) => Ok((format!(":{n}"), child)),
            Err(_) => Err(format!("{} did not start", program.display())),
        }
    });
    started.as_ref().map(|(display, _)| display.as_str()).map_err(Clone::clone)
}

/// The folder with the scripts.
pub(crate) fn scripts() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scripts")
}
